//! The sketch as a program on this computer, at the end of a serial line that a test may disturb.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};
use std::sync::{Arc, LazyLock, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hapt_drive::simplefoc::{Client, MotorConstant, SimpleFoc, VOLTS_PER_TORQUE};
use hapt_drive::{DriveDevice, Line, pty};
use hapt_export_c::DRIVE_SKETCH;
use hapt_model::World;

use crate::bench::{Looped, WaitingDrive, soon};

/// Longer than an answer takes on a busy machine, and shorter than the watchdog, ms.
const ANSWER_MS: u64 = 200;
/// Of the motor by current, N·m/A.
pub const TORQUE_CONSTANT: f64 = 0.05;

/// The files of SimpleFOC, whose folder `HAPT_SIMPLEFOC` names: the motor, its components, and its Commander.
const SIMPLEFOC: [&str; 12] = [
    "BLDCMotor",
    "common/base_classes/CurrentSense",
    "common/base_classes/FOCMotor",
    "common/base_classes/Sensor",
    "common/foc_utils",
    "common/lowpass_filter",
    "common/pid",
    "common/time_utils",
    "communication/Commander",
    "drivers/BLDCDriver3PWM",
    "current_sense/InlineCurrentSense",
    "sensors/MagneticSensorI2C",
];

/// The programs by voltage and by current, with a stand-in for SimpleFOC or with SimpleFOC itself, whose folder `HAPT_SIMPLEFOC` names as
/// an absolute path; `None`: this computer has no compiler of C++.
static BOARDS: LazyLock<Option<(tempfile::TempDir, [PathBuf; 2])>> = LazyLock::new(|| {
    let compiler = ["g++", "clang++"].into_iter().find(|name| Command::new(name).arg("--version").output().is_ok());
    let Some(compiler) = compiler else {
        assert!(std::env::var_os("CI").is_none(), "a compiler of C++ has to be there where CI is set");
        println!("SKIPPED: the sketch is not tried, for want of a compiler of C++ (g++ or clang++)");
        return None;
    };
    let folder = tempfile::tempdir().unwrap();
    let run = |more: &[&str]| {
        let mut command = Command::new(compiler);
        command.args(["-O1", "-g", "-I.", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]).args(more);
        let ran = command.current_dir(&folder).output().unwrap();
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    };
    let put = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    put("sketch.cpp", &format!("#include <Arduino.h>\n{DRIVE_SKETCH}"));
    put("board.cpp", include_str!("board.cpp"));
    put("board.h", include_str!("board.h"));
    let mut objects = vec!["board.o".to_string(), "motor.o".to_string()];
    let mut options = vec!["-std=c++11", "-Wall", "-Wextra", "-Werror"];
    let source = std::env::var("HAPT_SIMPLEFOC").map(|library| format!("{library}/src"));
    let its_headers = source.as_ref().map(|source| format!("-I{source}"));
    if let (Ok(source), Ok(headers)) = (&source, &its_headers) {
        put("Arduino.h", include_str!("simplefoc/Arduino.h"));
        put("Wire.h", include_str!("simplefoc/Wire.h"));
        put("SPI.h", include_str!("simplefoc/SPI.h"));
        put("motor.cpp", include_str!("simplefoc/motor.cpp"));
        // Its warnings are not the sketch's.
        options = vec!["-std=c++17", "-w", "-DSIMPLEFOC_DISABLE_DEBUG", headers];
        for name in SIMPLEFOC {
            let (file, object) = (format!("{source}/{name}.cpp"), format!("{}.o", name.replace('/', "-")));
            run(&[&options[..], &["-c", &file, "-o", &object]].concat());
            objects.push(object);
        }
    } else {
        put("Arduino.h", include_str!("../../../../hapt-export-c/tests/arduino/Arduino.h"));
        put("SimpleFOC.h", include_str!("../../../../hapt-export-c/tests/arduino/SimpleFOC.h"));
        put("motor.cpp", include_str!("motor.cpp"));
    }
    run(&[&options[..], &["-c", "board.cpp", "motor.cpp"]].concat());
    let objects: Vec<&str> = objects.iter().map(|object| &**object).collect();
    let programs = [("-DBY_CURRENT=0", "by-voltage"), ("-DBY_CURRENT=1", "by-current")].map(|(define, name)| {
        run(&[&options[..], &[define, "sketch.cpp"], &objects[..], &["-o", name]].concat());
        folder.path().join(name)
    });
    Some((folder, programs))
});

/// Replaces bytes in transit to the board or from it.
type Interceptor = Box<dyn FnMut(bool, &[u8]) -> Vec<u8> + Send>;

/// A board with the sketch, and the line to it.
pub struct Board {
    program: PathBuf,
    motor: MotorConstant,
    /// The computer's end, and the board's.
    pub ours: PathBuf,
    theirs: PathBuf,
    period: u64,
    child: Option<Child>,
    listener: Option<JoinHandle<()>>,
    /// The largest voltage or current so far and the present one, as bits.
    largest: Arc<AtomicU64>,
    present: Arc<AtomicU64>,
    interceptor: Arc<Mutex<Option<Interceptor>>>,
    ends: Arc<AtomicBool>,
    line: Option<JoinHandle<()>>,
}

impl Board {
    /// By voltage. `None`: it cannot be compiled here.
    pub fn new(period: u64, starts: bool) -> Option<Self> {
        Board::of(&BOARDS.as_ref()?.1[0], MotorConstant::VoltsPerTorque(VOLTS_PER_TORQUE), period, starts)
    }

    /// By current.
    pub fn by_current(period: u64) -> Option<Self> {
        Board::of(&BOARDS.as_ref()?.1[1], MotorConstant::TorqueConstant(TORQUE_CONSTANT), period, true)
    }

    fn of(program: &Path, motor: MotorConstant, period: u64, starts: bool) -> Option<Self> {
        let ((mut computer, ours), (mut board, theirs)) = (pty().unwrap(), pty().unwrap());
        let (interceptor, ends) = (Arc::new(Mutex::new(None::<Interceptor>)), Arc::new(AtomicBool::new(false)));
        let line = std::thread::spawn({
            let (interceptor, ends) = (Arc::clone(&interceptor), Arc::clone(&ends));
            move || {
                let mut bytes = [0; 256];
                while !ends.load(SeqCst) {
                    for to_board in [true, false] {
                        let (from, to) =
                            if to_board { (&mut computer, &mut board) } else { (&mut board, &mut computer) };
                        let wait = Duration::from_micros(if to_board { 200 } else { 0 });
                        let count = from.read(&mut bytes, Instant::now() + wait).unwrap_or(0);
                        let bytes = match &mut *interceptor.lock().unwrap() {
                            Some(interceptor) if count > 0 => interceptor(to_board, &bytes[..count]),
                            _ => bytes[..count].to_vec(),
                        };
                        // A board that is off reads nothing.
                        let _ = to.write(&bytes, Instant::now() + Duration::from_millis(20));
                    }
                }
            }
        });
        let mut board = Board {
            program: program.into(),
            motor,
            ours,
            theirs,
            period,
            child: None,
            listener: None,
            largest: Arc::default(),
            present: Arc::default(),
            interceptor,
            ends,
            line: Some(line),
        };
        board.switch_on(starts);
        Some(board)
    }

    pub fn switch_on(&mut self, starts: bool) {
        let mut child = Command::new(&self.program)
            .arg(&self.theirs)
            .args([self.period.to_string(), u8::from(starts).to_string()])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut printed = BufReader::new(child.stdout.take().unwrap()).lines();
        assert_eq!(printed.next().unwrap().unwrap(), "started");
        let (largest, present) = (Arc::clone(&self.largest), Arc::clone(&self.present));
        self.listener = Some(std::thread::spawn(move || {
            for line in printed.map_while(Result::ok) {
                let mut numbers = line.split(' ').map(|number| number.parse::<f64>().unwrap());
                largest.fetch_max(numbers.next().unwrap().to_bits(), SeqCst);
                present.store(numbers.next().unwrap().to_bits(), SeqCst);
            }
        }));
        self.child = Some(child);
    }

    pub fn switch_off(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            child.wait().unwrap();
        }
        if let Some(listener) = self.listener.take() {
            listener.join().unwrap();
        }
        self.present.store(0, SeqCst);
    }

    pub fn intercept(&self, interceptor: impl FnMut(bool, &[u8]) -> Vec<u8> + Send + 'static) {
        *self.interceptor.lock().unwrap() = Some(Box::new(interceptor));
    }

    pub fn is_clean(&self) {
        *self.interceptor.lock().unwrap() = None;
    }

    pub fn client(&self) -> Client {
        Client::new(Line::open(&self.ours).unwrap())
    }

    pub fn drive(&self, motor: MotorConstant) -> SimpleFoc {
        SimpleFoc::new(Box::new(self.client()), motor, "here")
    }

    /// Started, and waiting this long for answers; repeated if the machine pauses.
    pub fn wheel(&self, world: &World, wait_ms: u64) -> DriveDevice {
        let shared_wait_ms = Arc::new(AtomicU64::new(wait_ms));
        let mut last = None;
        for _ in 0..20 {
            let drive = self.drive(self.motor);
            match DriveDevice::start(Box::new(WaitingDrive(Box::new(drive), Arc::clone(&shared_wait_ms))), world) {
                Ok(wheel) => return wheel,
                Err(error) => last = Some(error),
            }
        }
        panic!("{last:?}");
    }

    pub fn running(&self, world: &World) -> Looped {
        for _ in 0..20 {
            let mut looped = Looped::on(Box::new(self.wheel(world, ANSWER_MS)), world);
            if looped.runs().is_ok() {
                return looped;
            }
        }
        panic!("it does not run");
    }

    pub fn largest(&self) -> f64 {
        f64::from_bits(self.largest.load(SeqCst))
    }

    pub fn present(&self) -> f64 {
        f64::from_bits(self.present.load(SeqCst))
    }

    pub fn goes_off(&self) {
        let end = soon();
        while self.present() != 0.0 {
            assert!(Instant::now() < end, "there is a voltage or a current still");
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.switch_off();
        self.ends.store(true, SeqCst);
        if let Some(line) = self.line.take() {
            line.join().unwrap();
        }
    }
}
