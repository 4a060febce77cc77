//! A simulated drive on its own thread, with injected bus faults, and a loop on it.
#![allow(dead_code)]

use std::collections::VecDeque;
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, AtomicUsize, Ordering::SeqCst};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hapt_core::{Phase, Reason, Request, SafetyProfile};
use hapt_drive::moteus::{self, Moteus};
use hapt_drive::odrive::Odrive;
use hapt_drive::simplefoc::{self, MotorConstant, SimpleFoc, VOLTS_PER_TORQUE};
use hapt_drive::simulate::{Firmware, Shaft, Simulator, Time};
use hapt_drive::{
    Bus, Drive, DriveDevice, DriveError, DriveLimits, Error, Frame, Line, Make, ShaftState, Socket, pty, slcan,
};
use hapt_model::{Source, World};
use hapt_rt::{Cycle, Failure, Moment, Plan, Record};

/// Attempts of tests that a pause of the machine may interrupt.
const TRIES: u32 = 20;
/// Shorter than the timeout of lockstep.
pub const STILL: Duration = Duration::from_millis(40);

/// A wheel on a spring to ground that this device certifies.
const WORLD: &str = r#"
    [loop]
    period = "1 ms"
    estimator = "difference"
    [device]
    inertia = "6.4e-4 kg m^2"
    damping = "2e-3 N m s/rad"
    limit = "100 N mm"
    [safety]
    stuck = 0
    [[couplings]]
    kind = "spring"
    between = ["puck", "ground"]
    stiffness = "0.2 N m/rad"
    rest = "0.3 rad"
"#;

pub fn world(sets: &[&str]) -> World {
    read(WORLD, sets)
}

pub fn read(text: &str, sets: &[&str]) -> World {
    let sets: Vec<String> = sets.iter().map(|set| set.to_string()).collect();
    World::read(&Source::from_text("w.toml", text), &sets).unwrap()
}

pub fn lockstep(world: &World) -> Time {
    Time::Lockstep(world.sampling.period)
}

pub fn soon() -> Instant {
    Instant::now() + Duration::from_secs(10)
}

/// The direction of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the drive to the host.
    FromDrive,
    /// From the host to the drive.
    ToDrive,
}

/// Replaces each frame by others.
pub type Interceptor = Box<dyn FnMut(Direction, Frame) -> Vec<Frame> + Send>;

/// The faults between a drive and its host, and the observed state of the drive.
#[derive(Default)]
pub struct Faults {
    /// The drive neither receives nor sends.
    pub dead: AtomicBool,
    /// Lost frames of 1000, in both directions.
    pub loss: AtomicU32,
    /// Delay of the drive's frames, ms.
    pub late: AtomicU64,
    /// The drive's frames wait for this many later ones.
    pub held: AtomicUsize,
    /// The drive's frames are random bytes.
    pub garbage: AtomicBool,
    /// The interceptor.
    pub middle: Mutex<Option<Interceptor>>,
    /// The torque at its shaft, N·m, and its position in revolutions, as bits.
    torque: AtomicU64,
    position: AtomicU64,
}

impl Faults {
    pub fn torque(&self) -> f64 {
        f64::from_bits(self.torque.load(SeqCst))
    }

    /// Installs an interceptor.
    pub fn intercept(&self, middle: impl FnMut(Direction, Frame) -> Vec<Frame> + Send + 'static) {
        *self.middle.lock().unwrap() = Some(Box::new(middle));
    }

    pub fn position(&self) -> f64 {
        f64::from_bits(self.position.load(SeqCst))
    }
}

/// A firmware whose torque and position are observed.
struct Observed(Box<dyn Firmware>, Arc<Faults>);

impl Firmware for Observed {
    fn requests_position(&self, frame: &Frame) -> bool {
        self.0.requests_position(frame)
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        self.0.receive(frame, shaft, send);
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, send: &mut dyn FnMut(Frame)) -> f64 {
        let torque = self.0.pass(seconds, shaft, send);
        self.1.torque.store(torque.to_bits(), SeqCst);
        self.1.position.store(shaft.position.to_bits(), SeqCst);
        torque
    }
}

/// A bus with these faults.
struct Faulty {
    bus: Box<dyn Bus>,
    faults: Arc<Faults>,
    under_way: VecDeque<(Instant, Frame)>,
    received: VecDeque<Frame>,
    /// xorshift: the same losses in every run.
    dice: u64,
}

impl Faulty {
    fn is_lost(&mut self) -> bool {
        for (left, by) in [(true, 13), (false, 7), (true, 17)] {
            self.dice ^= if left { self.dice << by } else { self.dice >> by };
        }
        self.faults.dead.load(SeqCst) || self.dice % 1000 < self.faults.loss.load(SeqCst).into()
    }

    fn pass(&mut self, direction: Direction, frame: Frame) -> Vec<Frame> {
        match &mut *self.faults.middle.lock().unwrap() {
            Some(middle) => middle(direction, frame),
            None => vec![frame],
        }
    }

    fn deliver(&mut self, until: Instant) -> io::Result<()> {
        while let Some((at, frame)) = self.under_way.front().copied()
            && at <= Instant::now()
            && self.under_way.len() > self.faults.held.load(SeqCst)
        {
            self.under_way.pop_front();
            self.bus.send(&frame, until)?;
        }
        Ok(())
    }
}

impl Bus for Faulty {
    fn send(&mut self, frame: &Frame, until: Instant) -> io::Result<()> {
        if !self.is_lost() {
            let late = Duration::from_millis(self.faults.late.load(SeqCst));
            let inverted: Vec<u8> = frame.data().iter().map(|byte| !byte).collect();
            let frame = if self.faults.garbage.load(SeqCst) { Frame::fd(frame.id, &inverted) } else { *frame };
            for frame in self.pass(Direction::FromDrive, frame) {
                self.under_way.push_back((Instant::now() + late, frame));
            }
        }
        self.deliver(until)
    }

    fn receive(&mut self, until: Instant) -> io::Result<Option<Frame>> {
        self.deliver(until)?;
        if self.received.is_empty()
            && let Some(frame) = self.bus.receive(until)?
            && !self.is_lost()
        {
            let frames = self.pass(Direction::ToDrive, frame);
            self.received.extend(frames);
        }
        Ok(self.received.pop_front())
    }
}

/// A drive whose host waits longer by this many ms, so that a busy machine answers in time. In lockstep this takes no longer.
pub struct WaitingDrive(pub Box<dyn Drive>, pub Arc<AtomicU64>);

impl WaitingDrive {
    /// Also where the machine paused until the deadline.
    fn until(&self, until: Instant) -> Instant {
        until.max(Instant::now()) + Duration::from_millis(self.1.load(SeqCst))
    }
}

impl Drive for WaitingDrive {
    fn start(&mut self, limits: &DriveLimits) -> Result<ShaftState, Error> {
        self.0.start(limits)
    }

    fn read(&mut self, until: Instant) -> Result<ShaftState, DriveError> {
        let until = self.until(until);
        self.0.read(until)
    }

    fn command(&mut self, torque: f64, until: Instant) -> Result<(), DriveError> {
        let until = self.until(until);
        self.0.command(torque, until)
    }

    fn halt(&mut self, until: Instant) {
        self.0.halt(until);
    }

    fn stop(&mut self) {
        self.0.stop();
    }

    fn paced(&mut self, period: f64) {
        self.0.paced(period);
    }

    fn notes(&self) -> Vec<String> {
        self.0.notes()
    }
}

/// The connection of drive and host.
#[derive(Clone, Debug)]
pub enum Place {
    Port(PathBuf),
    Can(String),
}

pub struct TestBench {
    pub faults: Arc<Faults>,
    pub place: Place,
    make: Make,
    /// The additional waiting time of hosts, ms.
    wait_ms: Arc<AtomicU64>,
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl TestBench {
    /// `firmware` on a CAN interface, or behind a new serial port.
    pub fn new(make: Make, can: Option<&str>, firmware: Box<dyn Firmware>, world: &World, time: Time) -> Self {
        let (bus, place): (Box<dyn Bus>, Place) = match can {
            Some(interface) => (Box::new(Socket::open(interface).unwrap()), Place::Can(interface.into())),
            None => {
                let (line, path) = pty().unwrap();
                (make.adapter(line), Place::Port(path))
            }
        };
        let faults = Arc::new(Faults::default());
        let bus = Faulty {
            bus,
            faults: Arc::clone(&faults),
            under_way: VecDeque::new(),
            received: VecDeque::new(),
            dice: 0x9e37_79b9_7f4a_7c15,
        };
        let firmware = Observed(firmware, Arc::clone(&faults));
        let mut simulator = Simulator::new(Box::new(bus), Box::new(firmware), world, time);
        let ends = Arc::new(AtomicBool::new(false));
        let thread = std::thread::spawn({
            let ends = Arc::clone(&ends);
            move || {
                // A bus that is down is down for the drive too, which continues.
                while !ends.load(SeqCst) {
                    let _ = simulator.run(|| ends.load(SeqCst));
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
        });
        TestBench { faults, place, make, wait_ms: Arc::default(), ends, thread: Some(thread) }
    }

    /// The back end for the drive with this identifier.
    pub fn drive(&self, id: u8) -> Box<dyn Drive> {
        let (bus, name): (Box<dyn Bus>, String) = match (&self.place, self.make) {
            (Place::Can(interface), _) => (Box::new(Socket::open(interface).unwrap()), interface.clone()),
            (Place::Port(path), Make::Odrive) => {
                let line = Line::open(path).unwrap();
                (Box::new(slcan::Client::open(line, slcan::Rate::default()).unwrap()), path.display().to_string())
            }
            (Place::Port(path), Make::Moteus) => {
                (Box::new(moteus::Client::new(Line::open(path).unwrap(), true)), path.display().to_string())
            }
            (Place::Port(path), Make::Simplefoc) => {
                (Box::new(simplefoc::Client::new(Line::open(path).unwrap())), path.display().to_string())
            }
        };
        let drive: Box<dyn Drive> = match self.make {
            Make::Odrive => Box::new(Odrive::new(bus, id, &name)),
            Make::Moteus => Box::new(Moteus::new(bus, id, name)),
            Make::Simplefoc => Box::new(SimpleFoc::new(bus, MotorConstant::VoltsPerTorque(VOLTS_PER_TORQUE), &name)),
        };
        Box::new(WaitingDrive(drive, Arc::clone(&self.wait_ms)))
    }

    /// A loop on the drive with identifier 1, which waits this many ms for answers, for any period.
    pub fn looped(&self, world: &World, wait_ms: u64) -> Looped {
        self.wait_for(0);
        let wheel = self.wheel(world);
        self.wait_for(wait_ms);
        Looped::on(Box::new(wheel), world)
    }

    /// The drive with identifier 1, started. If the machine pauses, the drive's watchdog expires and the start is repeated; a faulty drive
    /// fails every time.
    pub fn wheel(&self, world: &World) -> DriveDevice {
        let mut last = None;
        for _ in 0..TRIES {
            match DriveDevice::start(self.drive(1), world) {
                Ok(wheel) => return wheel,
                Err(error) => last = Some(error),
            }
        }
        panic!("{last:?}");
    }

    /// The same loop at full torque; repeated if the machine pauses and the drive's watchdog expires.
    pub fn running(&self, world: &World, wait_ms: u64) -> Looped {
        let mut last = None;
        for _ in 0..TRIES {
            let mut looped = self.looped(world, wait_ms);
            match looped.runs() {
                Ok(_) => return looped,
                ended => last = Some(ended),
            }
        }
        panic!("{last:?}");
    }

    /// Sets the waiting time of hosts, ms.
    pub fn wait_for(&self, wait_ms: u64) {
        self.wait_ms.store(wait_ms, SeqCst);
    }

    /// Removes the other end.
    pub fn unplug(&mut self) {
        self.ends.store(true, SeqCst);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }

    /// Waits in real time until the torque is off.
    pub fn torque_goes_off(&self) {
        let end = soon();
        while self.faults.torque() != 0.0 {
            assert!(Instant::now() < end, "there is a torque still");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for TestBench {
    fn drop(&mut self) {
        self.unplug();
    }
}

/// A loop on the drive, with the time of its own samples.
pub struct Looped {
    pub cycle: Cycle,
    pub samples: u32,
}

impl Looped {
    pub fn on(device: Box<dyn hapt_rt::Device>, world: &World) -> Self {
        let plan = Plan::new(world, SafetyProfile::Certified).unwrap();
        Looped { cycle: Cycle::new(Box::new(plan), device), samples: 0 }
    }

    pub fn sample(&mut self, request: Option<Request>) -> Result<Record, Failure> {
        let periods = u32::from(self.samples > 0);
        self.cycle.pass(periods);
        self.samples += 1;
        self.cycle.sample(&Moment { periods, ..Moment::default() }, request)
    }

    /// A sample whose command takes no time but that of an old answer.
    pub fn late_sample(&mut self) -> Record {
        let record = self.sample(None).unwrap();
        self.cycle.commanded(record.computation);
        record
    }

    /// Samples until it runs at full torque.
    pub fn run(&mut self) -> Record {
        self.runs().unwrap()
    }

    /// The same, or the reason of an earlier end.
    pub fn runs(&mut self) -> Result<Record, String> {
        let mut record = self.sample(Some(Request::Arm)).map_err(|failure| failure.to_string())?;
        while record.phase != Phase::Running {
            if !record.phase.is_active() || self.samples >= 2000 {
                return Err(format!("{record:?}"));
            }
            record = self.sample(None).map_err(|failure| failure.to_string())?;
        }
        Ok(record)
    }

    /// As [`Looped::ends`], and whether the machine paused meanwhile: time then passes for the drive and not for the loop, which may end
    /// for any reason.
    pub fn ends_or_stands_still(&mut self, within: u32) -> (Option<Result<Reason, Failure>>, bool) {
        let mut stood_still = false;
        for _ in 0..within {
            let begun = Instant::now();
            let ends = self.ends(1);
            stood_still |= begun.elapsed() > STILL;
            if ends.is_some() {
                return (ends, stood_still);
            }
        }
        (None, stood_still)
    }

    /// Runs until a failure or fault, for this many samples at most; `None`: neither. After a fault the torque is 0 and stays so.
    pub fn ends(&mut self, within: u32) -> Option<Result<Reason, Failure>> {
        for _ in 0..within {
            let record = match self.sample(None) {
                Ok(record) => record,
                Err(failure) => return Some(Err(failure)),
            };
            if record.phase == Phase::Faulted {
                assert_eq!(record.output, 0.0);
                return Some(Ok(record.reason.unwrap()));
            }
        }
        None
    }
}
