//! The frames agree with ODrive's own DBC files, as read and written by cantools.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command as Program, Stdio};

use hapt_drive::odrive::codec::{self, Command, Heartbeat, Version, control, state};
use hapt_rt::DriveFault;
use hapt_testing::in_time;

use crate::python::{ODRIVE_CAN, python};

/// The contents of the DBC files, requested line by line.
struct Oracle {
    questions: ChildStdin,
    answers: Lines<BufReader<ChildStdout>>,
    program: Child,
}

const VERSIONS: [(&str, Version); 2] =
    [("0.5.6", Version::SILENT), ("0.6.10", Version { major: 0, minor: 6, revision: 10 })];
const NODE: u8 = 1;

impl Oracle {
    fn new() -> Option<Self> {
        let python = python(ODRIVE_CAN)?;
        let mut program = Program::new(python)
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/cansimple.py"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (questions, answers) = (program.stdin.take().unwrap(), program.stdout.take().unwrap());
        Some(Oracle { questions, answers: BufReader::new(answers).lines(), program })
    }

    fn ask(&mut self, line: &str) -> String {
        writeln!(self.questions, "{line}").unwrap();
        self.answers.next().unwrap_or_else(|| panic!("{line}: the DBC says nothing")).unwrap()
    }

    /// The identifier, and the signals of the data.
    fn decode(&mut self, version: &str, name: &str, data: &[u8]) -> (u16, BTreeMap<String, f64>) {
        let hex: String = data.iter().map(|byte| format!("{byte:02x}")).collect();
        let answer = self.ask(&format!("{version} decode {name} {hex}"));
        let mut words = answer.split(' ');
        let id = u16::from_str_radix(words.next().unwrap(), 16).unwrap();
        let signals = words.map(|word| word.split_once('=').unwrap());
        (id, signals.map(|(name, value)| (name.into(), value.parse().unwrap())).collect())
    }

    /// The identifier and the data of a drive's message.
    fn encode(&mut self, version: &str, name: &str, signals: &[(&str, f64)]) -> (u16, Vec<u8>) {
        let signals: String = signals.iter().map(|(name, value)| format!(" {name}={value:?}")).collect();
        let answer = self.ask(&format!("{version} encode {name}{signals}"));
        let (id, hex) = answer.split_once(' ').unwrap();
        let digits: Vec<u32> = hex.chars().map(|digit| digit.to_digit(16).unwrap()).collect();
        let data = digits.chunks(2).map(|pair| (pair[0] << 4 | pair[1]) as u8).collect();
        (u16::from_str_radix(id, 16).unwrap(), data)
    }
}

impl Drop for Oracle {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

/// Numbers of every size, the same in f32 and f64.
fn numbers() -> impl Iterator<Item = f32> {
    (0..40_u32).map(|i| {
        let bits = i.wrapping_mul(0x9e37_79b9);
        let size = 10_f32.powi((bits % 9) as i32 - 4);
        (bits >> 8) as f32 / (1 << 24) as f32 * size * if i % 2 == 0 { 1.0 } else { -1.0 }
    })
}

#[test]
fn commands_to_a_drive_are_decoded_alike_by_the_dbc() {
    in_time(|| {
        let Some(mut oracle) = Oracle::new() else { return };
        for (version, _) in VERSIONS {
            for (first, second) in numbers().zip(numbers().skip(1)) {
                let data = codec::floats(first, second);
                for (command, name, signals) in [
                    (Command::Torque, "Set_Input_Torque", &["Input_Torque"][..]),
                    (Command::Velocity, "Set_Input_Vel", &["Input_Vel", "Input_Torque_FF"]),
                    (Command::Limits, "Set_Limits", &["Velocity_Limit", "Current_Limit"]),
                ] {
                    let (id, read) = oracle.decode(version, name, &data);
                    assert_eq!(id, command.id(NODE), "{name}");
                    for (signal, ours) in signals.iter().zip([first, second]) {
                        assert_eq!(read[*signal], f64::from(ours), "{version} {name} {signal}");
                    }
                }
            }
            let (id, read) = oracle.decode(version, "Set_Axis_State", &codec::pair(state::CLOSED_LOOP, 0));
            assert_eq!((id, read["Axis_Requested_State"]), (Command::State.id(NODE), 8.0));
            let mode = codec::pair(control::TORQUE, codec::PASSTHROUGH);
            let (id, read) = oracle.decode(version, "Set_Controller_Mode", &mode);
            assert_eq!((id, read["Control_Mode"], read["Input_Mode"]), (Command::Mode.id(NODE), 1.0, 1.0));
            assert_eq!(oracle.encode(version, "Clear_Errors", &[]).0, Command::Clear.id(NODE));
            assert_eq!(oracle.encode(version, "Reboot", &[]).0, Command::Reboot.id(NODE));
        }
        assert_eq!(oracle.encode("0.6.10", "Estop", &[]).0, Command::Estop.id(NODE));
        let (id, read) = oracle.decode("0.6.10", "Set_Absolute_Position", &codec::floats(-2.5, 0.0));
        assert_eq!((id, read["Position"]), (Command::Absolute.id(NODE), -2.5));
    });
}

#[test]
fn messages_of_a_drive_encoded_by_the_dbc_read_back() {
    in_time(|| {
        let Some(mut oracle) = Oracle::new() else { return };
        for (version, _) in VERSIONS {
            for (position, velocity) in numbers().zip(numbers().skip(1)) {
                let signals = [("Pos_Estimate", f64::from(position)), ("Vel_Estimate", f64::from(velocity))];
                let (id, data) = oracle.encode(version, "Get_Encoder_Estimates", &signals);
                assert_eq!(id, Command::Estimates.id(NODE));
                assert_eq!(codec::two_floats(&data), Some((position, velocity)));
            }
            for state in [0_u8, 1, 4, 8] {
                // With any other fields of a heartbeat.
                let done = [("Axis_Error", 2048.0), ("Axis_State", f64::from(state)), ("Trajectory_Done_Flag", 1.0)];
                let (id, data) = oracle.encode(version, "Heartbeat", &done);
                assert_eq!(id, Command::Heartbeat.id(NODE));
                assert_eq!(Heartbeat::read(&data), Some(Heartbeat { error: 2048, state }));
                let ours = Heartbeat { error: 2048, state };
                let (_, read) = oracle.decode(version, "Heartbeat", &ours.data());
                assert_eq!((read["Axis_Error"], read["Axis_State"]), (2048.0, f64::from(state)));
            }
            let (id, data) =
                oracle.encode(version, "Get_Bus_Voltage_Current", &[("Bus_Voltage", 24.0), ("Bus_Current", 1.5)]);
            assert_eq!((id, codec::two_floats(&data)), (Command::Bus.id(NODE), Some((24.0, 1.5))));
        }
        let signals = [("Fw_Version_Major", 0.0), ("Fw_Version_Minor", 6.0), ("Fw_Version_Revision", 9.0)];
        let (id, data) = oracle.encode("0.6.10", "Get_Version", &signals);
        assert_eq!(id, Command::Version.id(NODE));
        assert_eq!(Version::read(&data), Some(Version { major: 0, minor: 6, revision: 9 }));
        for (version, name, command) in [
            ("0.6.10", "Get_Torques", Command::Torques),
            ("0.6.10", "Get_Powers", Command::Powers),
            ("0.5.6", "Get_Controller_Error", Command::Powers),
            ("0.5.6", "Get_Sensorless_Estimates", Command::Warmth),
            ("0.6.10", "Get_Temperature", Command::Warmth),
        ] {
            assert_eq!(oracle.encode(version, name, &[]).0, command.id(NODE), "{name}");
        }
        let (id, data) = oracle.encode("0.6.10", "Get_Error", &[("Active_Errors", 64.0), ("Disarm_Reason", 32.0)]);
        assert_eq!((id, codec::numbers(codec::padded(&data))), (Command::Error.id(NODE), (64, 32)));
    });
}

#[test]
fn each_bit_of_an_error_has_the_name_that_the_dbc_gives_it() {
    in_time(|| {
        let Some(mut oracle) = Oracle::new() else { return };
        for (name, version) in VERSIONS {
            for bit in (0..32).map(|place| 1_u32 << place) {
                let theirs = oracle.ask(&format!("{name} choice Heartbeat Axis_Error {bit}"));
                let DriveFault { code, what, .. } = version.fault(bit);
                assert_eq!(code, bit);
                if theirs != "-" {
                    assert_eq!(what, theirs, "{name}: bit {bit:#x}");
                }
            }
            let watchdog = oracle.ask(&format!("{name} choice Heartbeat Axis_Error {}", version.watchdog()));
            assert_eq!(watchdog, "WATCHDOG_TIMER_EXPIRED");
            let estop = oracle.ask(&format!("{name} choice Heartbeat Axis_Error {}", version.estop()));
            assert_eq!(estop, "ESTOP_REQUESTED");
        }
    });
}

#[test]
fn a_short_frame_of_a_drive_is_ignored_and_a_hosts_is_padded() {
    in_time(|| {
        let data = codec::floats(1.0, 2.0);
        for length in 0..8 {
            assert_eq!(codec::two_floats(&data[..length]), None);
            assert_eq!(Heartbeat::read(&data[..length]).is_some(), length >= 5);
            assert_eq!(codec::padded(&data[..length])[length..], [0; 8][length..]);
        }
        for node in 0..=codec::LARGEST_NODE {
            for command in Command::ALL {
                let id = command.id(node);
                assert!(id < 0x800);
                assert_eq!((codec::node(id), Command::of(id)), (node, Some(command)));
            }
        }
    });
}
