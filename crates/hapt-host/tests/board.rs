//! A host and a board at the two ends of a pseudoterminal.
#![cfg(unix)]

use std::time::{Duration, Instant};

use hapt_core::{Phase, SafetyProfile};
use hapt_host::board::simulate::SimulatedBoard;
use hapt_host::board::{Error, Link, Parameter, Refusal, Telemetry, pty};
use hapt_model::{DeviceSpec, Source, World};
use hapt_testing::in_time;
use hapt_wire::device::Board;
use hapt_wire::{Command, DeviceMessage, Hello, frame, hash, pack};

const BOARD: Board = Board { name: "table", firmware: "1.2.3", externally_clocked: false, periods: [5e-5, 1e-2] };

/// A constant torque on a damped puck: there is a torque whenever it is armed.
const PUSH: &str = r#"
[loop]
period = "1 ms"
estimator = "difference"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-2 N m s/rad"
limit = "822.25 N mm"
[safety]
pulse = 0
link = "2 s"
stuck = 0
energy = 1e9
[[couplings]]
kind = "constant"
between = ["puck", "ground"]
torque = "50 N mm"
"#;

/// What a board of another kind says.
const HELLO: Hello<'_> = Hello {
    protocol: 1,
    firmware: "9",
    board: "other",
    core: 0,
    world: None,
    bodies: 4,
    couplings: 8,
    window: 16,
    externally_clocked: false,
    sequence: 0,
    sample: 0,
    period: 1,
    phase: 0,
    reason: 0,
};

fn world() -> World {
    World::read(&Source::from_text("w.toml", PUSH), &[]).unwrap()
}

fn packed() -> Vec<u8> {
    packed_with(&[])
}

fn packed_with(sets: &[&str]) -> Vec<u8> {
    let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
    let world = World::read(&Source::from_text("w.toml", PUSH), &sets).unwrap();
    pack(&world.spec(), &world.limits(SafetyProfile::Certified), &mut [0; 1024]).unwrap().to_vec()
}

fn rig() -> DeviceSpec {
    world().device_spec()
}

/// Repeats until it is true, for at most a minute.
fn eventually(mut what: impl FnMut() -> bool) {
    let start = Instant::now();
    while !what() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited too long");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Takes telemetry until one satisfies the condition, with heartbeats.
fn until(link: &mut Link, mut wanted: impl FnMut(&Telemetry) -> bool) -> Telemetry {
    let start = Instant::now();
    loop {
        assert!(start.elapsed() < Duration::from_secs(60), "waited too long");
        link.heartbeat().unwrap();
        if let Some(telemetry) = link.telemetry(Instant::now() + Duration::from_millis(20)).unwrap()
            && wanted(&telemetry)
        {
            return telemetry;
        }
    }
}

/// Armed, and at full torque.
fn running(board: &SimulatedBoard) -> Link {
    running_with(board, &[])
}

fn running_with(board: &SimulatedBoard, sets: &[&str]) -> Link {
    let mut link = Link::open(board.path()).unwrap();
    let world = link.load(&packed_with(sets)).unwrap();
    link.set(Parameter::Divider, 10).unwrap();
    link.arm(world).unwrap();
    // By the board's telemetry: the motor's torque is read later, and on a busy machine the heartbeat may have been late by then.
    until(&mut link, |telemetry| telemetry.phase == Phase::Running as u8 && telemetry.output > 0.049);
    link
}

#[test]
fn a_world_is_loaded_armed_run_and_disarmed() {
    let board = SimulatedBoard::start(BOARD, rig()).unwrap();
    let mut link = running(&board);
    assert_eq!((link.board().name.as_str(), link.board().firmware.as_str()), ("table", "1.2.3"));
    assert_eq!((link.board().core, link.board().world), (hapt_core::SOURCE, Some(hash(&packed()))));
    assert_eq!(link.board().room, [4, 8, 16]);
    // The puck turns, and telemetry shows it.
    let first = until(&mut link, |telemetry| telemetry.velocity > 0.1);
    let later = until(&mut link, |telemetry| telemetry.position > first.position + 0.01);
    assert!(later.sample > first.sample && later.output == 0.05);
    assert_eq!(link.get(Parameter::Missed).unwrap(), 0);
    assert!(matches!(link.load(&[1, 2, 3]), Err(Error::Refused { why: Refusal::Armed, .. })));
    link.disarm().unwrap();
    until(&mut link, |telemetry| telemetry.phase == Phase::Disarmed as u8);
    assert_eq!(board.torque(), 0.0);
    // It ended without a fault: nothing has to be cleared.
    drop(link);
    assert_eq!(Link::open(board.path()).unwrap().board().phase, Some(Phase::Disarmed));
}

#[test]
fn dropping_a_link_with_a_torque_on_removes_the_torque() {
    let board = SimulatedBoard::start(BOARD, rig()).unwrap();
    drop(running(&board));
    eventually(|| board.torque() == 0.0);
    let link = Link::open(board.path()).unwrap();
    assert_eq!((link.board().phase, link.board().reason), (Some(Phase::Faulted), Some(hapt_core::Reason::Stop)));

    // Also by a panic.
    let board = SimulatedBoard::start(BOARD, rig()).unwrap();
    let link = running(&board);
    let panicked = std::panic::catch_unwind(std::panic::AssertUnwindSafe(move || {
        let _link = link;
        panic!("as a test wants it");
    }));
    assert!(panicked.is_err());
    eventually(|| board.torque() == 0.0);
}

#[test]
fn a_disconnected_line_is_an_error_at_the_host_and_no_torque_at_the_board() {
    let board = SimulatedBoard::start(BOARD, rig()).unwrap();
    let mut link = running(&board);
    board.unplug();
    let start = Instant::now();
    let error = loop {
        assert!(start.elapsed() < Duration::from_secs(60));
        let received = link.heartbeat().and_then(|()| link.telemetry(Instant::now() + Duration::from_millis(20)));
        if let Err(error) = received {
            break error;
        }
    };
    assert!(matches!(error, Error::Gone { .. }), "{error}");
    eventually(|| board.torque() == 0.0);
}

#[test]
fn a_host_that_hangs_loses_the_torque() {
    let boards = [(); 2].map(|()| SimulatedBoard::start(BOARD, rig()).unwrap());
    let mut links = [running(&boards[0]), running_with(&boards[1], &["safety.link_lost=fault"])];
    for ((board, link), phase) in boards.iter().zip(&mut links).zip([Phase::Disarmed, Phase::Faulted]) {
        eventually(|| board.torque() == 0.0);
        link.handshake().unwrap();
        // The board is faulted: no host has armed it.
        assert_eq!((link.board().phase, link.board().reason), (Some(phase), Some(hapt_core::Reason::Link)));
    }
    // A clear succeeds once a heartbeat has arrived in time.
    eventually(|| links[1].clear().is_ok());
    assert_eq!(links[1].handshake().unwrap().phase, Some(Phase::Disarmed));
}

#[test]
fn a_board_that_restarts_in_a_session_reports_it_at_any_next_command() {
    type Next = (&'static str, fn(&mut Link) -> Result<(), Error>);
    let nexts: [Next; 5] = [
        ("kept", |link| {
            link.heartbeat()?;
            link.telemetry(Instant::now() + Duration::from_millis(20)).map(drop)
        }),
        ("greeted", |link| link.handshake().map(drop)),
        ("disarmed", Link::disarm),
        ("armed", |link| link.arm(hash(&packed())).map(drop)),
        ("asked", |link| link.get(Parameter::Missed).map(drop)),
    ];
    let board = SimulatedBoard::start(BOARD, rig()).unwrap();
    for (what, next) in nexts {
        let mut link = running(&board);
        board.restart();
        eventually(|| board.torque() == 0.0);
        let start = Instant::now();
        let error = loop {
            assert!(start.elapsed() < Duration::from_secs(60), "{what}: it does not say so");
            if let Err(error) = next(&mut link) {
                break error;
            }
        };
        assert!(matches!(error, Error::Restarted { .. }), "{what}: {error}");
        assert!(error.to_string().contains("has restarted"), "{error}");
        // After a handshake the board can be used again.
        link.handshake().unwrap();
        assert_eq!((link.board().world, link.board().phase), (None, Some(Phase::Disarmed)), "{what}");
        assert_eq!(board.torque(), 0.0, "{what}");
    }
}

#[test]
fn a_fault_of_the_motors_driver_reaches_the_host_and_lasts_until_it_is_cleared() {
    let board = SimulatedBoard::start(BOARD, rig()).unwrap();
    let mut link = running(&board);
    board.fault_driver();
    let driver = hapt_core::Reason::Driver;
    let telemetry = until(&mut link, |telemetry| telemetry.phase == Phase::Faulted as u8);
    assert_eq!((telemetry.reason, telemetry.output), (driver.code(), 0.0));
    let world = hash(&packed());
    assert!(matches!(link.arm(world), Err(Error::Refused { why: Refusal::Phase, .. })));
    link.handshake().unwrap();
    assert_eq!((link.board().phase, link.board().reason), (Some(Phase::Faulted), Some(driver)));
    assert_eq!(board.torque(), 0.0);
    link.clear().unwrap();
    link.arm(world).unwrap();
    until(&mut link, |telemetry| telemetry.phase == Phase::Running as u8);
}

#[test]
fn a_line_that_corrupts_bytes_carries_a_world_completely_or_reports_an_error() {
    let board = SimulatedBoard::start(BOARD, rig()).unwrap();
    board.corrupt(401);
    let mut link = Link::open(board.path()).unwrap();
    match link.load(&packed()) {
        Ok(world) => assert_eq!(world, hash(&packed())),
        Err(error) => {
            assert!(matches!(error, Error::Refused { .. } | Error::Silent { .. } | Error::NotVerified), "{error}")
        }
    }
    assert_eq!(board.peak_torque(), 0.0);
    board.corrupt(0);
    let world = link.load(&packed()).unwrap();
    link.arm(world).unwrap();
    eventually(|| board.torque() > 0.0);
}

#[test]
fn an_externally_clocked_board_runs_in_lockstep() {
    in_time(runs_in_lockstep);
}

fn runs_in_lockstep() {
    let fed = Board { externally_clocked: true, ..BOARD };
    let board = SimulatedBoard::start(fed, rig()).unwrap();
    let mut link = Link::open(board.path()).unwrap();
    let world = link.load(&packed()).unwrap();
    for sample in 0..150 {
        if sample == 1 {
            link.send(Command::Arm { world }).unwrap();
        }
        let command = Command::Sample { sample, position: 0.0, velocity: 0.0, late: 0.0, announced: false };
        let telemetry = link.sample(command).unwrap().unwrap();
        assert_eq!(telemetry.sample, sample);
        // A fade of 100 samples.
        let part = (sample as f32 / 100.0).min(1.0);
        assert!((telemetry.output - 0.05 * part).abs() < 1e-6, "{telemetry:?}");
    }
    let again = Command::Sample { sample: 3, position: 0.0, velocity: 0.0, late: 0.0, announced: false };
    assert!(matches!(link.sample(again), Err(Error::Refused { .. })));
}

#[test]
fn the_samples_of_a_board_go_forward_in_time_whatever_the_line_repeats_or_overtakes() {
    let (mut ours, path) = pty().unwrap();
    let until = || Instant::now() + Duration::from_secs(60);
    let board = std::thread::spawn(move || {
        while ours.read(&mut [0; 64], until()).unwrap() == 0 {}
        let mut write = |message: DeviceMessage<'_>| {
            ours.write(frame(&message, &mut [0; 512]).unwrap(), until()).unwrap();
        };
        write(DeviceMessage::Hello(Hello { sample: 70_000, ..HELLO }));
        for sample in [70_001, 70_003, 70_002, 70_003, 70_001, 70_004] {
            write(DeviceMessage::Telemetry(Telemetry { sample, ..Telemetry::default() }));
        }
        // It restarts, and counts from 0.
        write(DeviceMessage::Hello(Hello { sample: 1, ..HELLO }));
        write(DeviceMessage::Telemetry(Telemetry { sample: 1, ..Telemetry::default() }));
        ours
    });
    let mut link = Link::open(&path).unwrap();
    let mut next = || link.telemetry(until()).map(|telemetry| telemetry.unwrap().sample);
    assert_eq!([next().unwrap(), next().unwrap(), next().unwrap()], [70_001, 70_003, 70_004]);
    assert!(matches!(next(), Err(Error::Restarted { .. })));
    assert_eq!(next().unwrap(), 1);
    drop(board.join().unwrap());
}

#[test]
fn a_port_without_an_answer_or_with_another_version_is_named() {
    let (mut ours, path) = pty().unwrap();
    let error = Link::open(&path).unwrap_err();
    assert!(matches!(error, Error::NoAnswer { .. }), "{error}");
    assert!(error.to_string().contains("hapt's firmware"));

    // A board of another version.
    let answer = std::thread::spawn(move || {
        let mut some = [0; 64];
        while ours.read(&mut some, Instant::now() + Duration::from_secs(60)).unwrap() == 0 {}
        let hello = Hello { protocol: 7, ..HELLO };
        let mut room = [0; 256];
        let frame = frame(&DeviceMessage::Hello(hello), &mut room).unwrap();
        ours.write(frame, Instant::now() + Duration::from_secs(60)).unwrap();
        ours
    });
    let error = Link::open(&path).unwrap_err();
    assert!(matches!(error, Error::Protocol { board: 7, .. }), "{error}");
    assert!(error.to_string().contains("version 7"));
    drop(answer.join().unwrap());
    assert!(matches!(Link::open("/dev/no-such-port".as_ref()), Err(Error::Open { .. })));
}
