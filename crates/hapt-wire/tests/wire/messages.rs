//! The messages of host and board: the examples of docs/wire.md, and messages after noise.

use hapt_core::{
    Body, CertifiedTime, Coupling, End, Estimator, Heat, Law, Limits, Loop, Phase, SafetyProfile, Spec, Supervisor,
};
use hapt_testing::prelude::*;
use hapt_wire::{
    Command, DeviceMessage, Hello, HostMessage, LARGEST, MAX_FRAME_BYTES, PIECE, PROTOCOL, Parameter, Reader, Refusal,
    States, Telemetry, frame, hash, pack, unpack,
};
use proptest::collection::vec;
use serde::Serialize;

const PAGE: &str = include_str!("../../../../docs/wire.md");

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ")
}

fn framed(message: &impl Serialize) -> String {
    hex(frame(message, &mut [0; 512]).unwrap())
}

/// The examples of the page.
fn examples() -> Vec<(&'static str, String)> {
    let command = |sequence, not_after, command| framed(&HostMessage { sequence, not_after, command });
    let hello = Hello {
        protocol: PROTOCOL,
        firmware: "0.1.0",
        board: "table",
        core: 0x1234_abcd,
        world: Some(0x00c0_ffee),
        bodies: 4,
        couplings: 8,
        window: 16,
        externally_clocked: false,
        sequence: 300,
        sample: 70_000,
        period: 1_000_000,
        phase: Phase::Running as u8,
        reason: 0,
    };
    let telemetry = Telemetry {
        sequence: 7,
        sample: 70_020,
        phase: 2,
        reason: 0,
        warning: 0,
        position: 1.5,
        measured: 0.5,
        velocity: -0.25,
        torque: 0.125,
        command: 0.125,
        output: 0.125,
        missed: 0,
        used: 380,
        bodies: States::new([(0.625, -1.0)]),
        outside: 2,
    };
    let (position, velocity) = (0.5, -0.25);
    vec![
        ("Hello", command(0, 0, Command::Hello { protocol: PROTOCOL })),
        ("Stop", command(301, 0, Command::Stop)),
        ("Heartbeat", command(301, 70_250, Command::Heartbeat)),
        ("Arm", command(302, 70_250, Command::Arm { world: 0x00c0_ffee })),
        ("Disarm", command(303, 70_250, Command::Disarm)),
        ("Clear", command(304, 70_250, Command::Clear)),
        ("Begin", command(305, 70_250, Command::Begin { length: 349, hash: 0x00c0_ffee })),
        ("Piece", command(306, 70_250, Command::Piece { at: 0, bytes: &[1, 0, 2] })),
        ("Commit", command(307, 70_250, Command::Commit)),
        ("Get", command(308, 70_250, Command::Get { parameter: Parameter::Missed as u8 })),
        ("Set", command(309, 70_250, Command::Set { parameter: Parameter::Divider as u8, value: 20 })),
        ("Sample", command(310, 5, Command::Sample { sample: 5, position, velocity, late: 0.0, announced: false })),
        ("Hello, from the board", framed(&DeviceMessage::Hello(hello))),
        ("Done", framed(&DeviceMessage::Done { sequence: 302 })),
        ("Refused", framed(&DeviceMessage::Refused { sequence: 302, why: Refusal::NoWorld })),
        ("Value", framed(&DeviceMessage::Value { sequence: 309, parameter: 0, value: 20 })),
        ("Telemetry", framed(&DeviceMessage::Telemetry(telemetry))),
    ]
}

/// The wheel on a spring of the page.
fn packed() -> Vec<u8> {
    let none = Heat { rms: f64::INFINITY, time: 30.0 };
    let limits = Limits {
        fade: 0.1,
        velocity: 100.0,
        jump: 0.05,
        overspeed: 50.0,
        stuck: 1.0,
        stuck_torque: 0.05,
        torque: 0.8,
        slew: f64::INFINITY,
        motor: none,
        driver: none,
        stall: 5e-3,
        time: CertifiedTime::NOT_STATED,
        link: 0.3,
        link_faults: false,
        energy: 0.04,
        world_trips: true,
        port_trips: true,
        pulse: 0.0,
        brake: 0.0,
        recentre: 0.0,
        zero_where_armed: true,
        announcements: false,
        inertia: 6.4e-4,
        damping: 1.2e-3,
        friction: 5e-3,
        delay: 0.0,
    };
    pack(&spec(), &limits, &mut [0; LARGEST]).unwrap().to_vec()
}

fn spec() -> Spec<'static> {
    Spec {
        estimator: Estimator::Difference,
        count: Some(std::f64::consts::TAU / 4000.0),
        limit: Some(0.8),
        bodies: &[Body { inertia: 0.025, position: 0.0, velocity: 0.0 }],
        couplings: &[Coupling {
            first: End::Puck,
            second: End::Body(0),
            law: Law::Spring { stiffness: 1.0, rest: 0.0 },
            limit: None,
        }],
        ..Spec::new(1e-3)
    }
}

#[test]
fn the_page_shows_the_bytes_of_every_message() {
    for (name, bytes) in examples() {
        let row = PAGE.lines().find(|line| line.starts_with(&format!("| {name} |")) && line.contains(" 00` |"));
        let row = row.unwrap_or_else(|| panic!("no example of {name}: | {name} | `{bytes}` |"));
        assert!(row.contains(&format!("`{bytes}`")), "{name} is `{bytes}`, and the page has {row}");
    }
}

#[test]
fn the_page_shows_the_bytes_of_a_world() {
    let bytes = packed();
    let shown: String = PAGE.split("```hex\n").nth(1).unwrap().split("```").next().unwrap().into();
    let shown: Vec<&str> = shown.split_whitespace().collect();
    assert_eq!(shown.join(" "), hex(&bytes));
    assert!(PAGE.contains(&format!("`{:08x}`", hash(&bytes))), "its hash is {:08x}", hash(&bytes));
    assert!(PAGE.contains(&format!("{} bytes", bytes.len())), "it has {} bytes", bytes.len());
    // zlib's own example.
    assert_eq!(hash(b"123456789"), 0xcbf4_3926);
}

#[test]
fn the_page_names_every_code() {
    for phase in Phase::ALL {
        assert!(PAGE.contains(&format!("{} {}", phase as u8, phase.name())), "{}", phase.name());
    }
    for parameter in Parameter::ALL {
        assert_eq!(Parameter::from_code(parameter as u8), Some(parameter));
        assert!(PAGE.contains(&format!("- {} {parameter:?}:", parameter as u8)), "{parameter:?}");
    }
    let whys = [
        Refusal::Hello,
        Refusal::Sequence,
        Refusal::Late,
        Refusal::Busy,
        Refusal::Piece,
        Refusal::Hash,
        Refusal::Version,
        Refusal::Bytes,
        Refusal::Room,
        Refusal::World,
        Refusal::Period,
        Refusal::NoLimit,
        Refusal::Exact,
        Refusal::Armed,
        Refusal::NoWorld,
        Refusal::Phase,
        Refusal::NotExternallyClocked,
        Refusal::Sample,
        Refusal::Parameter,
    ];
    for why in whys {
        let code = frame(&why, &mut [0; 16]).unwrap().to_vec();
        // A code below 128 is one byte; 0 is stuffed.
        let code = if code[0] == 1 { 0 } else { code[1] };
        assert!(PAGE.contains(&format!("- {code} {why:?}:")), "- {code} {why:?}");
    }
}

#[test]
fn the_largest_world_of_a_board_fits_into_its_room_and_a_full_piece_into_a_frame() {
    let lugre = Law::Lugre {
        coulomb: 1.0,
        stribeck: 1.0,
        stribeck_velocity: 1.0,
        bristle_stiffness: 1.0,
        bristle_damping: 1.0,
        viscous: 1.0,
    };
    let coupling = Coupling { first: End::Body(3), second: End::Body(2), law: lugre, limit: None };
    let body = Body { inertia: 1.0, position: 0.0, velocity: 0.0 };
    let spec = Spec {
        advance: u32::MAX,
        bodies_every: u32::MAX,
        levels: Some(u32::MAX),
        estimator: Estimator::LowPass { cutoff: 1.0 },
        filter: None,
        bodies: &[body; 4],
        couplings: &[coupling; 8],
        ..spec()
    };
    let (limits, _) = unpack::<4, 8>(&packed()).unwrap();
    let bytes = pack(&spec, &limits, &mut [0; 4096]).unwrap().to_vec();
    assert!(bytes.len() <= LARGEST, "{} bytes", bytes.len());
    let command = Command::Piece { at: u16::MAX, bytes: &[0; PIECE] };
    let longest = HostMessage { sequence: u32::MAX, not_after: u64::MAX, command };
    assert!(frame(&longest, &mut [0; MAX_FRAME_BYTES]).is_ok());
}

#[test]
fn a_packed_world_is_the_same_world_with_the_same_limits() {
    let bytes = packed();
    let (limits, stored) = unpack::<4, 8>(&bytes).unwrap();
    assert_eq!(stored.spec(), spec());
    assert_eq!((limits.fade, limits.slew, limits.delay), (0.1, f64::INFINITY, 0.0));
    assert!(Loop::<f32, 4, 8, 17>::new(&stored.spec()).is_ok());
    assert!(Supervisor::<f32, 4, 8>::new(&limits, &stored.spec()).is_ok());
    for cut in 0..bytes.len() {
        assert!(unpack::<4, 8>(&bytes[..cut]).is_err());
    }
    assert_eq!(SafetyProfile::ALL.len(), 3);
}

proptest! {
    /// The host's side: the board's frames between noise.
    #[test]
    fn after_any_noise_and_a_zero_the_boards_next_frame_is_read(
        noise in vec(any::<u8>(), 0..1500), sequence in any::<u32>(), sample in any::<u64>(), output in any::<f32>(),
        bodies in vec((any::<f32>(), any::<f32>()), 0..5),
    ) {
        let bodies = States::new(bodies);
        let telemetry = Telemetry { sequence, sample, output, bodies, ..Telemetry::default() };
        let stream = [noise, vec![0], frame(&DeviceMessage::Telemetry(telemetry), &mut [0; 512]).unwrap().to_vec()].concat();
        let mut reader = Reader::<512>::new();
        let mut last = None;
        for byte in stream {
            if let Some(says) = reader.push::<DeviceMessage>(byte) {
                last = Some(format!("{says:?}"));
            }
        }
        prop_assert_eq!(last, Some(format!("{:?}", DeviceMessage::Telemetry(telemetry))));
    }

    #[test]
    fn more_bodies_than_there_is_room_for_are_no_telemetry(count in 5..40_u8) {
        let mut bytes = vec![4, 0, 0, 0, 0, 0];
        bytes.extend([0; 24]);
        bytes.extend([0, 0, count]);
        bytes.extend(vec![0; 8 * usize::from(count)]);
        prop_assert!(postcard::from_bytes::<DeviceMessage>(&bytes).is_err());
        bytes[32] = 4;
        prop_assert!(postcard::from_bytes::<DeviceMessage>(&bytes[..33 + 32 + 1]).is_ok());
    }
}
