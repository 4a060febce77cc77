//! A game that computes its torque from the wheel's position with a delay, through pools and the loop's samples.

use std::sync::{Arc, Mutex};

use hapt_core::wheel::Wheel;
use hapt_core::{Phase, Request, SafetyProfile};
use hapt_host::game_wheel::{GameStatus, Room, game_law, game_remedy};
use hapt_model::{Source, World};
use hapt_plant::VirtualDevice;
use hapt_rt::{Cycle, Moment, Outside, Plan, effects};
use hapt_wire::pid::{FULL, Kind, Operation, Pool, Report};

use crate::base_feel::Free;
use crate::{LIMIT, RANGE};

const STIFFNESS: f64 = 10.0;
/// Samples from a frame to the next, and from a frame to its report.
const FRAME: usize = 17;
const LATE: usize = 16;

/// The largest speeds in the first and in the last of six seconds after an initial velocity, and the estimate of the loop.
fn kicked(acts: bool) -> ([f64; 2], GameStatus) {
    let text = format!(
        "loop = {{ period = \"1 ms\", estimator = \"difference\" }}\n\
         device = {{ inertia = 0.03, damping = 0.05, limit = {LIMIT}, encoder = 65536 }}\n"
    );
    let world = World::read(&Source::from_text("wheel.toml", text), &[]).unwrap();
    let room = Room::of(&world, RANGE).unwrap();
    let room = if acts { room } else { room.measuring() };
    let (port, mut wire) = effects(Wheel::new(room.device()).unwrap(), room.scale());
    let free = Free(Arc::new(Mutex::new(VirtualDevice::new(&world.device_spec()))));
    let plan = Plan::new(&world, SafetyProfile::Simulated).unwrap();
    let outside = Outside::playing(port.watching(room.game_loop().unwrap()));
    let mut cycle = Cycle::new(Box::new(plan), Box::new(free.clone())).with_outside(outside);
    let mut samples = 0;
    let mut sample = |request| {
        let periods = u32::from(samples > 0);
        cycle.pass(periods);
        samples += 1;
        let now = samples * 1_000_000;
        (cycle.sample(&Moment { periods, now, ..Moment::default() }, request).unwrap().phase, now / 1000)
    };
    sample(None);
    let mut ready = sample(Some(Request::Arm));
    while ready.0 != Phase::Running {
        ready = sample(None);
    }
    let mut pool = Pool::new();
    let start = Report::Operation { block: 0, operation: Operation::Start, loops: 1 };
    for report in [Report::Create(Kind::Constant), Report::Constant { block: 0, magnitude: 0 }, start] {
        assert!(pool.take(&report, ready.1), "{report:?}");
    }
    free.0.lock().unwrap().set_out((0.0, 2.0), (0.0, 0.0));
    let (mut speeds, mut status, mut seen) = ([0.0_f64; 2], None::<GameStatus>, 0.0);
    for k in 0..6000 {
        if k % FRAME == 0 {
            seen = free.0.lock().unwrap().puck().0;
        }
        if k % FRAME == LATE {
            let level = (STIFFNESS * seen / LIMIT).clamp(-1.0, 1.0);
            let magnitude = (f64::from(FULL) * level).round() as i16;
            pool.take(&Report::Constant { block: 0, magnitude }, 1000 * (k as u64) + ready.1);
            let _ = wire.pools.push(pool);
        }
        assert_eq!(sample(None).0, Phase::Running);
        let speed = free.0.lock().unwrap().puck().1.abs();
        match k {
            0..1000 => speeds[0] = speeds[0].max(speed),
            5000.. => speeds[1] = speeds[1].max(speed),
            _ => {}
        }
        while let Ok(sample) = wire.samples.pop() {
            status.get_or_insert(GameStatus::new(sample.game)).add(&sample.game);
        }
    }
    (speeds, status.unwrap())
}

#[test]
fn the_loop_of_a_delayed_game_is_measured_grows_without_the_remedy_and_decays_with_it() {
    let ([_, grown], measured) = kicked(false);
    assert!(grown > 4.0, "{grown} rad/s");
    assert!(measured.damping == 0.0 && measured.lacking > 0.1, "{measured:?}");
    assert!(game_remedy(&measured, false).contains("only measured"));
    let ([_, quiet], steadied) = kicked(true);
    assert!(quiet < 0.1, "{quiet} rad/s: {steadied:?}");
    let law = steadied.last.law.expect("a law");
    // The output that docs/wheel.md shows.
    println!("{}\n{}", game_law(&law), game_remedy(&steadied, true));
    assert!((law.stiffness - STIFFNESS).abs() < 1.0 && (law.lateness - 0.016).abs() < 4e-3, "{}", game_law(&law));
    assert!((1.0 / law.hold - 1000.0 / FRAME as f64).abs() < 3.0);
    assert!(steadied.damping > 0.1 && steadied.held_back == 0.0, "{steadied:?}");
}
