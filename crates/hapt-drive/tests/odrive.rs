//! The loop on a simulated ODrive behind a serial adapter: a certified world is quiet, and whatever goes wrong takes the torque away.

#![cfg(target_os = "linux")]

mod rig;

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};
use std::time::{Duration, Instant};

use hapt_core::{Phase, Reason, Request};
use hapt_drive::odrive::{Odrive, Simulated};
use hapt_drive::simulate::{Firmware, Shaft, Time};
use hapt_drive::{Bus, Drive, Error, Frame, Make, Terms, Trouble};
use hapt_model::World;
use hapt_rt::{DriveFault, Failure, Record};
use rig::{Looped, Rig, lockstep, soon, world};

/// Longer than a busy machine takes to answer, ms.
const PATIENCE: u64 = 200;
/// Less than what ends lockstep.
const STILL: Duration = Duration::from_millis(30);
const TERMS: Terms = Terms { watchdog: 0.01, torque: 1.0 };

fn rig(world: &World, time: Time) -> Rig {
    Rig::new(Make::Odrive, None, Box::new(Simulated::new(1)), world, time)
}

fn looped(rig: &Rig, world: &World) -> Looped {
    rig.looped(world, PATIENCE)
}

/// A drive that is struck by an error from outside, and again as long as it stands.
struct Struck(Simulated, Arc<AtomicU32>);

impl Firmware for Struck {
    fn asks(&self, frame: &Frame) -> bool {
        self.0.asks(frame)
    }

    fn hear(&mut self, frame: &Frame, shaft: Shaft, say: &mut dyn FnMut(Frame)) {
        self.0.hear(frame, shaft, say);
        let error = self.1.load(SeqCst);
        if error != 0 {
            self.0.fail(error);
        }
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, say: &mut dyn FnMut(Frame)) -> f64 {
        self.0.pass(seconds, shaft, say)
    }
}

fn struck(world: &World, time: Time) -> (Rig, Arc<AtomicU32>) {
    let error = Arc::new(AtomicU32::new(0));
    let firmware = Box::new(Struck(Simulated::new(1), Arc::clone(&error)));
    (Rig::new(Make::Odrive, None, firmware, world, time), error)
}

/// Through floats of 32 bits and a line of text the loop is what it is on the exact device, sample by sample.
#[test]
fn in_lockstep_the_loop_on_the_drive_is_the_loop_on_the_exact_device() {
    let world = world(&[]);
    assert!(hapt_analysis::check(&world).unwrap().certified);
    // Where the machine stands still for longer than lockstep bears, the run says nothing.
    let last = (0..20).find_map(|_| both(&world)).expect("a run in which the machine does not stand still");
    assert_eq!(last.phase, Phase::Running);
    assert!((last.position - 0.3).abs() < 0.01, "it swings still: {}", last.position);
}

/// The loop on both devices from rest, and its last sample; `None`: the machine has stood still.
fn both(world: &World) -> Option<Record> {
    let rig = rig(world, lockstep(world));
    let mut drive = rig.looped(world, PATIENCE);
    let mut exact = Looped::on(Box::new(hapt_rt::Simulated::new(world).0), world);
    // The drive's first command arms it.
    drive.sample(None).ok()?;
    exact.sample(None).unwrap();
    let mut request = Some(Request::Arm);
    let (mut begin, mut last) = (0.0, None);
    for k in 0..2000 {
        let before = Instant::now();
        let ours = drive.sample(request).ok()?;
        let theirs = exact.sample(request.take()).unwrap();
        // An answer that is missed is one that the machine has held up; one that never comes fails every run.
        if before.elapsed() > STILL || ours.missed > 0 {
            return None;
        }
        if k == 0 {
            begin = ours.position;
        }
        assert_eq!(ours.phase, theirs.phase, "sample {k}");
        let position = ours.position - begin;
        assert!((position - theirs.position).abs() < 1e-5, "sample {k}: {position} {}", theirs.position);
        last = Some(Record { position, ..ours });
    }
    last
}

#[test]
fn a_drive_that_dies_is_gone_within_five_samples() {
    let world = world(&[]);
    let rig = rig(&world, lockstep(&world));
    let mut looped = looped(&rig, &world);
    looped.run();
    rig.faults.dead.store(true, SeqCst);
    assert_eq!(looped.ends(5), Some(Err(Failure::Gone)));
    // Its own watchdog does what nobody else can.
    rig.torque_goes_off();
}

#[test]
fn answers_that_come_late_are_never_taken_for_new_ones() {
    let world = world(&[]);
    let rig = rig(&world, lockstep(&world));
    let mut looped = rig.looped(&world, 20);
    looped.run();
    rig.faults.late.store(35, SeqCst);
    let ends = looped.ends(200);
    assert!(matches!(ends, Some(Ok(Reason::Late) | Err(Failure::Gone))), "{ends:?}");
}

#[test]
fn a_few_lost_frames_are_missed_samples_and_half_of_them_are_the_end() {
    for (loss, survives) in [(0, true), (2, true), (500, false)] {
        let world = world(&[]);
        let rig = rig(&world, lockstep(&world));
        let mut looped = rig.looped(&world, 30);
        looped.run();
        rig.faults.loss.store(loss, SeqCst);
        match looped.ends(600) {
            None => assert!(survives, "{loss} of 1000"),
            Some(ends) => {
                assert!(!survives, "{loss} of 1000: {ends:?}");
                assert!(matches!(ends, Ok(Reason::Late) | Err(Failure::Gone | Failure::Drive(_))), "{ends:?}");
            }
        }
    }
}

#[test]
fn an_error_of_the_drive_ends_the_loop_by_name_and_only_a_new_start_clears_it() {
    // Where it is armed again the puck moves still: no sign test.
    let world = world(&["safety.pulse=0"]);
    let (rig, error) = struck(&world, lockstep(&world));
    for (bits, reason) in [(0x2000, Some(Reason::Heat)), (0x8000, Some(Reason::Overspeed)), (0x200, None)] {
        let mut looped = looped(&rig, &world);
        looped.run();
        error.store(bits, SeqCst);
        // A heartbeat tells of it, every 100 ms.
        match looped.ends(150) {
            Some(Err(Failure::Drive(fault))) => assert_eq!((fault.code, fault.reason), (bits, reason)),
            other => panic!("{other:?}"),
        }
        error.store(0, SeqCst);
        for _ in 0..20 {
            assert!(matches!(looped.sample(None), Err(Failure::Drive(_))), "it has come back by itself");
        }
        rig.torque_goes_off();
    }
}

#[test]
fn a_drive_whose_error_stays_is_not_started() {
    let world = world(&[]);
    let (rig, error) = struck(&world, Time::Real);
    error.store(0x200, SeqCst);
    match rig.drive(1).start(&TERMS) {
        Err(Error::Fault { fault: DriveFault { code: 0x200, what: "DC_BUS_UNDER_VOLTAGE", .. }, .. }) => {}
        other => panic!("{other:?}"),
    }
}

/// As an ODrive is shipped its torque stays for ever. No program may drive it so, and no drive is believed to be otherwise.
#[test]
fn a_drive_that_is_not_set_up_is_not_started() {
    let world = world(&[]);
    for watchdog in [None, Some(2.0)] {
        let firmware = Simulated::new(1).with_watchdog(watchdog);
        let rig = Rig::new(Make::Odrive, None, Box::new(firmware), &world, Time::Real);
        match rig.drive(1).start(&TERMS) {
            Err(error @ Error::Refused { .. }) => {
                assert!(error.to_string().contains("enable_watchdog = True"), "{error}");
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(rig.faults.torque(), 0.0);
    }
    let firmware = Simulated::new(1).with_estimates(Some(0.01));
    let rig = Rig::new(Make::Odrive, None, Box::new(firmware), &world, Time::Real);
    match rig.drive(1).start(&TERMS) {
        Err(error @ Error::Refused { .. }) => assert!(error.to_string().contains("encoder_msg_rate_ms = 0"), "{error}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_watchdog_bites_whoever_is_killed_and_torques_alone_do_not_bring_the_drive_back() {
    let world = world(&["couplings.0.stiffness=0"]);
    let rig = rig(&world, Time::Real);
    let mut drive = rig.drive(1);
    drive.start(&TERMS).unwrap();
    drive.command(0.01, soon()).unwrap();
    let end = soon();
    while rig.faults.torque() == 0.0 {
        assert!(Instant::now() < end, "it was never armed");
        drive.command(0.01, soon()).unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
    // As after a kill -9: nobody says anything.
    rig.torque_goes_off();
    let fault = loop {
        drive.command(0.01, soon()).unwrap();
        match drive.read(soon()) {
            Ok(_) => {}
            Err(Trouble::Fault(fault)) => break fault,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!((fault.what, fault.reason), ("WATCHDOG_TIMER_EXPIRED", Some(Reason::Late)));
    assert_eq!(rig.faults.torque(), 0.0);
    assert_eq!(drive.command(0.01, soon()), Err(Trouble::Fault(fault)));
    drive.start(&TERMS).unwrap();
    drive.read(soon()).unwrap();
}

#[test]
fn a_loop_that_is_dropped_leaves_the_drive_disarmed_at_once() {
    let world = world(&[]);
    let rig = rig(&world, lockstep(&world));
    let mut looped = looped(&rig, &world);
    looped.run();
    drop(looped);
    rig.torque_goes_off();
    // Disarmed, and not bitten: no error is left.
    let bus = hapt_drive::slcan::Client::open(hapt_drive::Line::open(path(&rig)).unwrap()).unwrap();
    assert_eq!(error(bus), 0);
}

fn path(rig: &Rig) -> &std::path::Path {
    match &rig.place {
        rig::Place::Port(path) => path,
        rig::Place::Can(_) => unreachable!("it is behind a port"),
    }
}

/// What the drive says that is wrong with it.
fn error(mut bus: impl Bus) -> u32 {
    use hapt_drive::odrive::codec::{Command, numbers, padded};
    bus.send(&Frame::remote(Command::Error.id(1).into(), 8), soon()).unwrap();
    loop {
        let frame = bus.receive(soon()).unwrap().expect("it answers");
        if frame.id == u32::from(Command::Error.id(1)) {
            return numbers(padded(frame.data())).0;
        }
    }
}

#[test]
fn a_cable_that_is_pulled_out_ends_the_loop() {
    let world = world(&[]);
    let mut rig = rig(&world, lockstep(&world));
    let mut looped = looped(&rig, &world);
    looped.run();
    rig.unplug();
    assert_eq!(looped.ends(2), Some(Err(Failure::Unplugged)));
}

#[test]
fn a_wrong_node_says_which_one_is_there() {
    let world = world(&[]);
    let rig = rig(&world, Time::Real);
    match rig.drive(5).start(&TERMS) {
        Err(error @ Error::Silent { .. }) => {
            let text = error.to_string();
            assert!(text.contains("node_id 5") && text.contains("but from 1"), "{text}");
        }
        other => panic!("{other:?}"),
    }
}

/// A drive in a script: what is on the bus is a list.
struct Listed(Vec<Frame>);

impl Bus for Listed {
    fn send(&mut self, _: &Frame, _: Instant) -> std::io::Result<()> {
        Ok(())
    }

    fn receive(&mut self, _: Instant) -> std::io::Result<Option<Frame>> {
        Ok(self.0.pop())
    }
}

/// Whoever asks the drive for anything feeds its watchdog, and whoever tells it anything drives it.
#[test]
fn a_frame_of_another_host_is_a_fault() {
    use hapt_drive::odrive::codec::{Command, floats};
    for frame in [
        Frame::classic(Command::Torque.id(1).into(), &floats(0.1, 0.0)),
        Frame::classic(Command::State.id(1).into(), &[8, 0, 0, 0]),
        Frame::classic(Command::Clear.id(1).into(), &[]),
        Frame::remote(Command::Estimates.id(1).into(), 8),
    ] {
        let mut drive = Odrive::new(Box::new(Listed(vec![frame])), 1, "nowhere");
        match drive.read(soon()) {
            Err(Trouble::Fault(fault)) => assert_eq!(fault.reason, Some(Reason::Link)),
            other => panic!("{frame:?}: {other:?}"),
        }
        assert!(drive.command(0.0, soon()).is_err(), "it goes on all the same");
        // To another drive it may say what it likes.
        let mut other = Odrive::new(Box::new(Listed(vec![frame])), 2, "nowhere");
        assert_eq!(other.read(soon()), Err(Trouble::Silent));
    }
}

#[test]
fn an_answer_that_nobody_has_asked_for_is_another_drives() {
    use hapt_drive::odrive::codec::{Command, floats};
    let answer = Frame::classic(Command::Estimates.id(1).into(), &floats(0.1, 0.0));
    // The list runs backward: one before the question, and one as its answer.
    let mut drive = Odrive::new(Box::new(Listed(vec![answer; 2])), 1, "nowhere");
    assert!(matches!(drive.read(soon()), Err(Trouble::Fault(fault)) if fault.what.contains("another drive")));
}
