//! The loop on its thread: however it ends, no torque stays on.

use std::time::Duration;

use hapt_core::{Phase, Reason, Request, SafetyProfile};
use hapt_rt::{End, Engine, Error, Failure, LoopCommand, Plan, Record, Settings, Timing};

use crate::common::{ScriptedDevice, constant, spring, wheel};

type Read = Result<(f64, f64), Failure>;

/// Normal scheduling is enough: no test here depends on timing.
const ORDINARY: Settings = Settings { priority: None, lock: false, spin: Duration::ZERO, leave_a_core: false };

fn start(torque: f64, device: Box<dyn hapt_rt::Device>) -> Engine {
    let plan = Plan::new(&wheel("0.5 ms", &constant(torque)), SafetyProfile::Simulated).unwrap();
    Engine::start_with(plan, device, ORDINARY).unwrap()
}

fn ask(engine: &mut Engine, request: Request) {
    engine.send(LoopCommand::Request(request)).unwrap();
}

/// Takes records until one satisfies the condition.
fn until(engine: &mut Engine, what: impl Fn(&Record) -> bool) -> Record {
    for _ in 0..60_000 {
        while let Ok(record) = engine.records.pop() {
            if what(&record) {
                return record;
            }
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("it never came");
}

fn ended(engine: &mut Engine) -> End {
    for _ in 0..60_000 {
        if let Some(end) = engine.ended() {
            return end;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("it never ended");
}

#[test]
fn armed_the_torque_rises_and_disarmed_it_falls_and_dropped_it_is_off() {
    let (device, torque) = ScriptedDevice::new(|_| -> Read { Ok((0.0, 0.0)) });
    let mut engine = start(0.2, device);
    assert_eq!(until(&mut engine, |_| true).output, 0.0);
    ask(&mut engine, Request::Arm);
    let rising = until(&mut engine, |record| record.output > 0.0);
    assert!(rising.phase == Phase::FadingIn && rising.output < 0.2);
    until(&mut engine, |record| record.phase == Phase::Running && record.output == 0.2);
    ask(&mut engine, Request::Disarm);
    until(&mut engine, |record| record.phase == Phase::Disarmed && record.output == 0.0);
    ask(&mut engine, Request::Arm);
    until(&mut engine, |record| record.phase == Phase::Running);
    assert_eq!(engine.ended(), None);
    drop(engine);
    assert_eq!(torque.get(), 0.0);
}

/// The engine's owner may be blocked, in a print for example: only the handle's thread acts.
#[test]
fn a_handle_ends_the_loop_with_no_torque_on_while_its_owner_is_blocked() {
    let (device, torque) = ScriptedDevice::new(|_| -> Read { Ok((0.0, 0.0)) });
    let mut engine = start(0.2, device);
    ask(&mut engine, Request::Arm);
    until(&mut engine, |record| record.output == 0.2);
    let handle = engine.handle().clone();
    std::thread::spawn(move || handle.end()).join().unwrap();
    let mut looks = 0;
    while torque.get() != 0.0 {
        std::thread::sleep(Duration::from_millis(1));
        looks += 1;
        assert!(looks < 60_000, "the torque stays on");
    }
    assert_eq!(ended(&mut engine), End::Stopped);
}

#[test]
fn a_device_that_fails_ends_the_loop_with_no_torque_on() {
    let (device, torque) = ScriptedDevice::new(|k| -> Read {
        if k < 600 { Ok((0.0, 0.0)) } else { Err(Failure::Gone) }
    });
    let mut engine = start(0.2, device);
    ask(&mut engine, Request::Arm);
    until(&mut engine, |record| record.output > 0.1);
    assert_eq!(ended(&mut engine), End::Device(Failure::Gone));
    assert_eq!(torque.get(), 0.0);
}

#[test]
fn a_panic_on_the_loops_thread_leaves_no_torque_on() {
    let (device, torque) = ScriptedDevice::new(|k| -> Read {
        assert!(k < 600, "a defect, for this test");
        Ok((0.0, 0.0))
    });
    let mut engine = start(0.2, device);
    ask(&mut engine, Request::Arm);
    until(&mut engine, |record| record.output > 0.1);
    assert_eq!(ended(&mut engine), End::Panicked);
    assert_eq!(torque.get(), 0.0);
}

#[test]
fn a_stop_acts_where_the_queue_of_commands_is_full() {
    let (device, torque) = ScriptedDevice::new(|_| -> Read { Ok((0.0, 0.0)) });
    let mut engine = start(0.2, device);
    ask(&mut engine, Request::Arm);
    until(&mut engine, |record| record.phase == Phase::Running);
    // Commands are sent faster than the loop takes them, until the queue is full.
    while engine.send(LoopCommand::Request(Request::Arm)).is_ok() {}
    engine.stop();
    let stopped = until(&mut engine, |record| record.phase == Phase::Faulted);
    assert_eq!((stopped.reason, stopped.request, stopped.output), (Some(Reason::Stop), Some(Request::Stop), 0.0));
    until(&mut engine, |record| record.sample > stopped.sample);
    assert_eq!(torque.get(), 0.0);
}

#[test]
fn requests_from_before_a_stop_restore_no_torque() {
    let (device, torque) = ScriptedDevice::new(|_| -> Read { Ok((0.0, 0.0)) });
    let mut engine = start(0.2, device);
    ask(&mut engine, Request::Arm);
    until(&mut engine, |record| record.phase == Phase::Running);
    let handle = engine.handle().clone();
    // Another thread delays its requests from before the stop.
    let before = handle.epoch();
    handle.stop();
    let stopped = until(&mut engine, |record| record.phase == Phase::Faulted);
    until(&mut engine, |record| record.sample > stopped.sample + 50);
    for _ in 0..10 {
        engine.send_of(LoopCommand::Request(Request::Clear), before).unwrap();
        engine.send_of(LoopCommand::Request(Request::Arm), before).unwrap();
    }
    let late = until(&mut engine, |record| record.sample > stopped.sample + 500);
    assert_eq!((late.phase, torque.get()), (Phase::Faulted, 0.0));
    // A request of the present epoch clears it.
    ask(&mut engine, Request::Clear);
    until(&mut engine, |record| record.phase == Phase::Disarmed);
}

#[test]
fn a_withdrawal_of_control_fades_the_torque_out_and_voids_earlier_requests() {
    let (device, torque) = ScriptedDevice::new(|_| -> Read { Ok((0.0, 0.0)) });
    let mut engine = start(0.2, device);
    ask(&mut engine, Request::Arm);
    until(&mut engine, |record| record.phase == Phase::Running);
    let handle = engine.handle().clone();
    let before = handle.epoch();
    handle.withdraw();
    // The next client sends a heartbeat at once, but no request.
    handle.heartbeat();
    engine.send_of(LoopCommand::Request(Request::Arm), before).unwrap();
    let out = until(&mut engine, |record| record.phase == Phase::Disarmed);
    let late = until(&mut engine, |record| record.sample > out.sample + 100);
    assert_eq!((late.phase, torque.get()), (Phase::Disarmed, 0.0));
}

#[test]
fn every_plan_that_is_sent_arrives_complete_and_in_order() {
    let (device, _torque) = ScriptedDevice::new(|_| -> Read { Ok((0.1, 0.0)) });
    let world = |k: u32| wheel(["0.5 ms", "0.25 ms"][k as usize % 2], &spring("puck", "ground", f64::from(k + 1)));
    let mut engine =
        Engine::start_with(Plan::new(&world(0), SafetyProfile::Simulated).unwrap(), device, ORDINARY).unwrap();
    let mut before = Plan::new(&world(0), SafetyProfile::Simulated).unwrap();
    let mut sent = 0;
    // More than the rings hold.
    while sent < 200 {
        let plan = Plan::following(&world(sent + 1), &before).unwrap();
        before = plan.clone();
        let mut order = LoopCommand::Swap(Box::new(plan));
        while let Err(full) = engine.send(order) {
            order = full;
            std::thread::sleep(Duration::from_millis(1));
        }
        sent += 1;
    }
    let (mut last, mut due) = (0, 0);
    while last < 200 {
        let record = until(&mut engine, |_| true);
        assert!(record.plan >= last && record.due >= due);
        assert!((record.torque + 0.1 * f64::from(record.plan + 1)).abs() < 1e-12, "{record:?}");
        (last, due) = (record.plan, record.due);
    }
}

#[test]
fn the_records_show_missed_samples_requests_and_the_time_since_a_heartbeat() {
    let (device, _torque) = ScriptedDevice::new(|k| -> Read {
        if k == 100 {
            // About twenty periods.
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok((0.0, 0.0))
    });
    let mut engine = start(0.2, device);
    let first = until(&mut engine, |_| true);
    assert_eq!((first.sample, first.due, first.missed, first.silent), (0, 0, 0, 0.0));
    let mut timing = Timing::new();
    timing.add(&first);
    let mut sample = first.sample;
    for _ in 0..200 {
        let record = until(&mut engine, |_| true);
        timing.add(&record);
        assert_eq!(record.sample, sample + 1 + u64::from(record.missed));
        assert_eq!(record.due, record.sample * 500_000);
        assert!((record.late - f64::from(record.latency) * 1e-9).abs() < 1e-9 && record.late < 0.5e-3);
        sample = record.sample;
    }
    assert!(timing.missed() >= 19 && timing.overruns() >= 1 && timing.lost() == 0, "{timing}");
    assert!(timing.computation().max >= 10_000_000 && timing.samples() == 201);
    engine.handle().heartbeat();
    let near = until(&mut engine, |record| record.silent > 0.0);
    let far = until(&mut engine, |record| record.due >= near.due + 20_000_000);
    assert!(far.silent - near.silent > 0.019, "{} {}", near.silent, far.silent);
}

#[test]
fn a_period_too_short_for_the_clock_is_refused() {
    let (device, _torque) = ScriptedDevice::new(|_| -> Read { Ok((0.0, 0.0)) });
    let plan = || Plan::new(&wheel("9 us", &constant(0.0)), SafetyProfile::Simulated).unwrap();
    let refused = Engine::start(plan(), device).err();
    assert!(matches!(refused, Some(Error::Period { given }) if given == 9e-6));
    let mut engine = start(0.0, ScriptedDevice::new(|_| -> Read { Ok((0.0, 0.0)) }).0);
    assert!(engine.send(LoopCommand::Swap(Box::new(plan()))).is_err());
}
