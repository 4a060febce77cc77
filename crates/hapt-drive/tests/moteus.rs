//! The loop on a simulated moteus, over a serial line: a certified world is quiet, and whatever goes wrong takes the torque away.

#![cfg(target_os = "linux")]

use std::io;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hapt_core::{Guarding, Phase, Reason, Request};
use hapt_drive::moteus::{Adapter, Client, Moteus, Simulated};
use hapt_drive::simulate::{Firmware, Shaft, Simulator, Time};
use hapt_drive::{Bus, Drive, Error, Frame, Line, Terms, Trouble, Wheel, pty};
use hapt_model::{Source, World};
use hapt_rt::{Cycle, Failure, Moment, Plan, Record};

/// A spring to ground that this device certifies, through a gear that turns the other way. The period is long, so that a busy machine
/// answers in time; in lockstep it takes no longer.
const WORLD: &str = r#"
    [loop]
    period = "100 ms"
    estimator = "difference"
    [device]
    inertia = "6.4e-4 kg m^2"
    damping = "1.2e-3 N m s/rad"
    limit = "100 N mm"
    [device.drive]
    gear = 3
    direction = "reverse"
    [safety]
    stuck = 0
    fade = "1 s"
    [[couplings]]
    kind = "spring"
    between = ["puck", "ground"]
    stiffness = "0.02 N m/rad"
    rest = "0.3 rad"
    [scenarios.push]
    duration = "1 s"
    hand = { kind = "torque", moves = { kind = "step", to = "20 N mm" } }
"#;

fn world(sets: &[&str]) -> World {
    let sets: Vec<String> = sets.iter().map(|set| set.to_string()).collect();
    World::read(&Source::from_text("w.toml", WORLD), &sets).unwrap()
}

/// What is done to the frames that a simulated drive sends, and what is seen of it from outside.
#[derive(Default)]
struct Mischief {
    /// The drive is dead: it says and does nothing more.
    dead: AtomicBool,
    /// Its answers are so many answers old.
    late: AtomicUsize,
    /// Garbage in place of answers.
    garbage: AtomicBool,
    /// The fault that strikes it next.
    fault: AtomicUsize,
    /// The mode of the simulated drive, as its own answers say; torque at its shaft.
    torque: Mutex<f64>,
}

/// A simulated drive that can be struck from outside.
struct Struck(Simulated, Arc<Mischief>);

impl Firmware for Struck {
    fn asks(&self, frame: &Frame) -> bool {
        !self.1.dead.load(Ordering::SeqCst) && self.0.asks(frame)
    }

    fn hear(&mut self, frame: &Frame, shaft: Shaft, say: &mut dyn FnMut(Frame)) {
        if !self.1.dead.load(Ordering::SeqCst) {
            self.0.hear(frame, shaft, say);
        }
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, say: &mut dyn FnMut(Frame)) -> f64 {
        let code = self.1.fault.swap(0, Ordering::SeqCst);
        if code > 0 {
            self.0.fail(code as u8);
        }
        let torque = self.0.pass(seconds, shaft, say);
        *self.1.torque.lock().unwrap() = torque;
        torque
    }
}

/// A line that delays and garbles what the drive says.
struct Bent {
    bus: Adapter,
    mischief: Arc<Mischief>,
    held: Vec<Frame>,
}

impl Bus for Bent {
    fn send(&mut self, frame: &Frame, until: Instant) -> io::Result<()> {
        if self.mischief.garbage.load(Ordering::SeqCst) {
            return self.bus.send(&Frame::fd(frame.id, &frame.data().iter().map(|x| !x).collect::<Vec<_>>()), until);
        }
        self.held.push(*frame);
        while self.held.len() > self.mischief.late.load(Ordering::SeqCst) {
            let frame = self.held.remove(0);
            self.bus.send(&frame, until)?;
        }
        Ok(())
    }

    fn receive(&mut self, until: Instant) -> io::Result<Option<Frame>> {
        self.bus.receive(until)
    }
}

/// A simulated drive at work on a thread of its own.
struct Rig {
    mischief: Arc<Mischief>,
    path: std::path::PathBuf,
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Rig {
    fn new(world: &World, id: u8, time: Time) -> Self {
        let (line, path) = pty().unwrap();
        let mischief = Arc::new(Mischief::default());
        let bus = Bent { bus: Adapter::new(line), mischief: Arc::clone(&mischief), held: Vec::new() };
        let firmware = Struck(Simulated::new(id), Arc::clone(&mischief));
        let mut simulator = Simulator::new(Box::new(bus), Box::new(firmware), world, time);
        let ends = Arc::new(AtomicBool::new(false));
        let thread = std::thread::spawn({
            let ends = Arc::clone(&ends);
            move || drop(simulator.run(|| ends.load(Ordering::SeqCst)))
        });
        Rig { mischief, path, ends, thread: Some(thread) }
    }

    fn drive(&self, id: u8) -> Moteus {
        let line = Line::open(&self.path).unwrap();
        Moteus::new(Box::new(Client::new(line, true)), id, self.path.display().to_string())
    }

    /// The cable is pulled out.
    fn unplug(&mut self) {
        self.ends.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }

    fn torque(&self) -> f64 {
        *self.mischief.torque.lock().unwrap()
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        self.unplug();
    }
}

/// A loop on it, armed, its time that of its own samples.
struct Looped {
    cycle: Cycle,
    samples: u32,
}

impl Looped {
    fn new(rig: &Rig, world: &World) -> Self {
        let wheel = Wheel::start(Box::new(rig.drive(1)), world).unwrap();
        let plan = Plan::new(world, Guarding::Certified).unwrap();
        Looped { cycle: Cycle::new(Box::new(plan), Box::new(wheel)), samples: 0 }
    }

    fn sample(&mut self, request: Option<Request>) -> Result<Record, Failure> {
        let periods = u32::from(self.samples > 0);
        self.cycle.pass(periods);
        self.samples += 1;
        self.cycle.sample(&Moment { periods, ..Moment::default() }, request)
    }

    /// Samples until it runs at full torque.
    fn run(&mut self) -> Record {
        let mut record = self.sample(Some(Request::Arm)).unwrap();
        while record.phase != Phase::Running {
            assert!(record.phase.is_active() && self.samples < 500, "{record:?}");
            record = self.sample(None).unwrap();
        }
        record
    }

    /// Until it fails or faults.
    fn until_it_ends(&mut self) -> Result<Reason, Failure> {
        for _ in 0..200 {
            let record = self.sample(None)?;
            if record.phase == Phase::Faulted {
                assert_eq!(record.output, 0.0);
                return Ok(record.reason.unwrap());
            }
        }
        panic!("it goes on");
    }
}

fn lockstep(world: &World) -> Time {
    Time::Lockstep(world.sampling.period)
}

/// In lockstep nothing depends on the machine: the sign test passes through the gear that turns the other way, and the puck comes to
/// rest where the spring is slack.
#[test]
fn a_certified_world_brings_the_puck_to_rest_through_gear_and_drive() {
    let world = world(&[]);
    assert!(hapt_analysis::check(&world).unwrap().certified);
    let rig = Rig::new(&world, 1, lockstep(&world));
    let mut looped = Looped::new(&rig, &world);
    looped.run();
    let mut last = Vec::new();
    for _ in 0..1500 {
        let record = looped.sample(None).unwrap();
        assert_eq!(record.phase, Phase::Running, "{record:?}");
        assert!(record.missed == 0 || record.sample < 2);
        last.push(record.measured);
    }
    let end = &last[1400..];
    assert!(end.iter().all(|position| (position - 0.3).abs() < 0.01), "{end:?}");
}

/// What the loop asks for at the puck does the same work at the drive's shaft: a third of it, the other way.
#[test]
fn torque_and_position_do_the_same_work_on_both_sides_of_the_gear() {
    let world = world(&["safety.pulse=0"]);
    let rig = Rig::new(&world, 1, lockstep(&world));
    let mut looped = Looped::new(&rig, &world);
    looped.run();
    let before = looped.sample(None).unwrap();
    looped.sample(None).unwrap();
    // The period before the last sample passed under the torque of the one before it.
    let wanted = -before.output / 3.0;
    assert!((rig.torque() - wanted).abs() < 1e-6 && before.output.abs() > 1e-4, "{} {wanted}", rig.torque());
}

#[test]
fn a_drive_that_dies_is_gone_within_five_samples() {
    let world = world(&[]);
    let rig = Rig::new(&world, 1, lockstep(&world));
    let mut looped = Looped::new(&rig, &world);
    looped.run();
    let before = looped.samples;
    rig.mischief.dead.store(true, Ordering::SeqCst);
    assert_eq!(looped.until_it_ends(), Err(Failure::Gone));
    assert_eq!(looped.samples - before, 5);
}

#[test]
fn answers_that_come_late_are_never_taken_for_new_ones() {
    let world = world(&[]);
    let rig = Rig::new(&world, 1, lockstep(&world));
    let mut looped = Looped::new(&rig, &world);
    looped.run();
    rig.mischief.late.store(1, Ordering::SeqCst);
    assert_eq!(looped.until_it_ends(), Ok(Reason::Late));
    // On time again, it can be cleared and armed, and by nothing else.
    rig.mischief.late.store(0, Ordering::SeqCst);
    for _ in 0..20 {
        assert_eq!(looped.sample(None).unwrap().phase, Phase::Faulted);
    }
    assert_eq!(looped.sample(Some(Request::Clear)).unwrap().phase, Phase::Disarmed);
    looped.run();
}

/// One answer lost now and then is a missed sample, and no more.
#[test]
fn a_lost_answer_is_a_missed_sample() {
    // So long a period that a busy machine loses none by itself.
    let world = world(&["loop.period=0.3 s", "couplings.0.stiffness=5e-3", "safety.pulse=0"]);
    let rig = Rig::new(&world, 1, lockstep(&world));
    let mut looped = Looped::new(&rig, &world);
    looped.run();
    for _ in 0..3 {
        rig.mischief.late.store(1, Ordering::SeqCst);
        assert_eq!(looped.sample(None).unwrap().missed, 1);
        rig.mischief.late.store(0, Ordering::SeqCst);
        assert_eq!(looped.sample(None).unwrap().missed, 1);
        for _ in 0..5 {
            let record = looped.sample(None).unwrap();
            assert_eq!((record.missed, record.phase), (0, Phase::Running));
        }
    }
}

#[test]
fn garbage_is_no_answer() {
    let world = world(&[]);
    let rig = Rig::new(&world, 1, lockstep(&world));
    let mut looped = Looped::new(&rig, &world);
    looped.run();
    rig.mischief.garbage.store(true, Ordering::SeqCst);
    // It says something, and nothing that answers the question.
    assert_eq!(looped.until_it_ends(), Ok(Reason::Late));
}

#[test]
fn a_fault_of_the_drive_ends_the_loop_by_name() {
    let world = world(&[]);
    for (code, reason) in [(38, Some(Reason::DriverHeat)), (35, Some(Reason::Jump)), (40, None)] {
        let rig = Rig::new(&world, 1, lockstep(&world));
        let mut looped = Looped::new(&rig, &world);
        looped.run();
        rig.mischief.fault.store(code, Ordering::SeqCst);
        match looped.until_it_ends() {
            Err(Failure::Drive(fault)) => assert_eq!((fault.code as usize, fault.reason), (code, reason)),
            other => panic!("{other:?}"),
        }
        // Starting again is an explicit clear.
        drop(looped);
        Looped::new(&rig, &world).run();
    }
}

#[test]
fn a_cable_that_is_pulled_out_ends_the_loop() {
    let world = world(&[]);
    let mut rig = Rig::new(&world, 1, lockstep(&world));
    let mut looped = Looped::new(&rig, &world);
    looped.run();
    rig.unplug();
    assert_eq!(looped.until_it_ends(), Err(Failure::Unplugged));
}

/// The way out of every end that this program sees: dropped, the loop leaves the drive stopped, which then makes no torque.
#[test]
fn a_loop_that_ends_leaves_the_drive_stopped() {
    let world = world(&[]);
    let rig = Rig::new(&world, 1, Time::Real);
    let mut looped = Looped::new(&rig, &world);
    for _ in 0..10 {
        let _ = looped.sample(None);
    }
    drop(looped);
    let mut after = rig.drive(1);
    let soon = || Instant::now() + Duration::from_secs(5);
    after.read(soon()).unwrap();
    // Stopped, not timed out: a stopped drive starts again, a timed-out one does not.
    after.command(0.0, soon()).unwrap();
    let until = Instant::now() + Duration::from_secs(5);
    while Instant::now() < until {
        match after.read(soon()) {
            Ok(_) => return,
            Err(Trouble::Fault(fault)) => panic!("{fault}"),
            Err(_) => {}
        }
    }
    panic!("it never answered");
}

/// Nobody takes the torque off after a kill -9 but the drive's own watchdog. It stays off until somebody stops the drive.
#[test]
fn the_drives_watchdog_latches_and_only_a_stop_clears_it() {
    let world = world(&[]);
    let rig = Rig::new(&world, 1, Time::Real);
    let mut drive = rig.drive(1);
    let soon = || Instant::now() + Duration::from_secs(5);
    drive.start(&Terms { watchdog: 0.05, torque: 1.0 }).unwrap();
    drive.command(0.02, soon()).unwrap();
    std::thread::sleep(Duration::from_millis(300));
    let silent = match drive.read(soon()) {
        Err(Trouble::Fault(fault)) => fault,
        other => panic!("{other:?}"),
    };
    assert_eq!((silent.code, silent.reason), (11, Some(Reason::Late)));
    // Commands do not bring it back.
    for _ in 0..5 {
        drive.command(0.02, soon()).unwrap();
        assert!(matches!(drive.read(soon()), Err(Trouble::Fault(_))));
    }
    drive.start(&Terms { watchdog: 10.0, torque: 1.0 }).unwrap();
    drive.command(0.02, soon()).unwrap();
    drive.read(soon()).unwrap();
    drive.stop();
}

#[test]
fn a_wrong_identifier_says_which_one_is_there() {
    let world = world(&[]);
    let rig = Rig::new(&world, 7, Time::Real);
    let mut drive = rig.drive(1);
    match drive.start(&Terms { watchdog: 1.0, torque: 1.0 }) {
        Err(error @ Error::Silent { .. }) => assert!(error.to_string().contains("#7"), "{error}"),
        other => panic!("{other:?}"),
    }
}

/// With a home the world's 0 is a place, and the puck is within half a turn of it.
#[test]
fn with_a_home_positions_are_counted_from_it() {
    for (home, at) in [("1 rad", -1.0), ("-200 deg", 200_f64.to_radians() - std::f64::consts::TAU), ("720 deg", 0.0)] {
        let world = world(&[&format!("device.drive.home={home}"), "safety.pulse=0"]);
        let rig = Rig::new(&world, 1, lockstep(&world));
        let mut looped = Looped::new(&rig, &world);
        let record = looped.sample(None).unwrap();
        assert!((record.measured - at).abs() < 1e-6, "{home}: {} {at}", record.measured);
    }
}
