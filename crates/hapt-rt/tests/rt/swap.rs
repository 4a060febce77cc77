//! A world that replaces another: for any methods and estimators of the two, motion is continuous.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use hapt_core::SafetyProfile;
use hapt_model::World;
use hapt_rt::{Change, Cycle, Failure, HandCommand, Moment, Plan, Record, SimulatedDevice};
use hapt_sim::Grip;
use hapt_testing::prelude::*;

use crate::common::{ScriptedDevice, armed, sample, spring};

const METHODS: [&str; 8] =
    ["forward-euler", "backward-euler", "semi-implicit-euler", "trapezoidal", "zoh", "rk4", "tustin", "foh"];
const ESTIMATORS: [&str; 7] = [
    "estimator = \"exact\"\n",
    "estimator = \"difference\"\n",
    "estimator = \"low-pass\"\ncutoff = 50\n",
    "estimator = \"foaw\"\n",
    "estimator = \"foaw-best\"\nwindow = 9\n",
    "estimator = \"kalman\"\ncutoff = 50\n",
    "estimator = \"levant\"\nacceleration = 1000\n",
];
/// The encoder's counts per radian: at 16 counts per ms a period of 0.5, 1 or 2 ms is a whole number of counts.
const COUNTS: f64 = 4000.0 / std::f64::consts::TAU;

fn world(method: &str, estimator: &str, period_ms: f64, encoder: bool, rest: &str) -> World {
    let encoder = if encoder { "encoder = 4000\n" } else { "" };
    crate::common::world(&format!(
        "[loop]\nperiod = {}\nmethod = \"{method}\"\n{estimator}[device]\ninertia = 6.4e-4\n{encoder}{rest}",
        period_ms * 1e-3
    ))
}

/// Runs `before` for a while, then `after` in its place, on a puck with position and velocity `moves(t)`, t in s; returns the last record of the
/// first and the first three of the second.
fn swapped(before: &World, after: &World, moves: impl Fn(f64) -> (f64, f64) + Send + 'static) -> (Record, Vec<Record>) {
    // In µs: all periods here are whole numbers of them.
    let clock = Arc::new(AtomicU64::new(0));
    let its = Arc::clone(&clock);
    let at = move |_| -> Result<(f64, f64), Failure> { Ok(moves(its.load(Ordering::SeqCst) as f64 * 1e-6)) };
    let plan = Plan::new(before, SafetyProfile::Simulated).unwrap();
    let mut cycle = Cycle::new(Box::new(plan.clone()), ScriptedDevice::new(at).0);
    let tick = |period: f64| clock.fetch_add((period * 1e6).round() as u64, Ordering::SeqCst);
    // Armed while the time is constant, so that the bodies begin at the puck's position.
    let mut last = armed(&mut cycle);
    for _ in 0..300 {
        tick(before.sampling.period);
        last = sample(&mut cycle, false, None);
    }
    tick(before.sampling.period);
    cycle.pass(1);
    cycle.swap(Box::new(Plan::following(after, &plan).unwrap()));
    let mut records = vec![cycle.sample(&Moment { periods: 1, ..Moment::default() }, None).unwrap()];
    for _ in 0..2 {
        tick(after.sampling.period);
        records.push(sample(&mut cycle, false, None));
    }
    (last, records)
}

fn any_world(rest: &'static str) -> impl Strategy<Value = (&'static str, &'static str, f64, &'static str)> {
    let period = prop::sample::select(&[0.5, 1.0, 2.0][..]);
    (prop::sample::select(&METHODS[..]), prop::sample::select(&ESTIMATORS[..]), period, Just(rest))
}

/// A damper on the puck to ground.
const DAMPER: &str = "[[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"ground\"]\ndamping = 0.01\n";
/// A body without couplings, at constant velocity.
const COASTS: &str = "[bodies.free]\ninertia = 0.01\nvelocity = 3\n";

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// The estimate of a steady velocity is that velocity, before and after.
    #[test]
    fn the_estimate_of_a_steady_velocity_continues_over_any_change(
        from in any_world(DAMPER),
        to in any_world(DAMPER),
        encoder in any::<bool>(),
    ) {
        let make = |(method, estimator, period, rest)| world(method, estimator, period, encoder, rest);
        // 16 counts per millisecond.
        let velocity = 16.0e3 / COUNTS;
        let (last, after) = swapped(&make(from), &make(to), move |time| (velocity * time, velocity));
        let wanted = -0.01 * velocity;
        for record in std::iter::once(&last).chain(&after) {
            prop_assert!((record.torque - wanted).abs() < 1e-7 * wanted.abs(), "{} for {wanted}", record.torque);
        }
    }

    /// A body without couplings moves as far in the sample of the change as in any other.
    #[test]
    fn a_body_without_couplings_continues_at_its_velocity(from in any_world(COASTS), to in any_world(COASTS)) {
        let make = |(method, estimator, period, rest)| world(method, estimator, period, false, rest);
        let (before, now) = (make(from), make(to));
        let (last, after) = swapped(&before, &now, |_| (0.0, 0.0));
        let mut place = last.bodies[0].0 + 3.0 * before.sampling.period;
        for record in after {
            prop_assert!((record.bodies[0].0 - place).abs() < 1e-12 && record.bodies[0].1 == 3.0, "{:?} {place}", record.bodies[0]);
            place += 3.0 * now.sampling.period;
        }
    }

    /// At rest in springs a change of method, estimator or period causes no torque step.
    #[test]
    fn at_rest_in_a_spring_a_change_causes_no_torque_step(from in any_world(""), to in any_world(""), turned in -1.0_f64..1.0) {
        let rest = format!(
            "[bodies.wheel]\ninertia = 0.02\nposition = {turned}\n{}{}{}",
            spring("puck", "ground", 1.5),
            spring("puck", "wheel", 0.7),
            "[[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"wheel\"]\ndamping = 0.01\n"
        );
        let make = |(method, estimator, period, _)| world(method, estimator, period, true, &rest);
        // The puck is turned, and the wheel rests where its spring is slack.
        let count = 1.0 / COUNTS;
        let at = (turned / count).round() * count;
        let exactly = |mut world: World| { world.bodies[0].position = at; world };
        let (last, after) = swapped(&exactly(make(from)), &exactly(make(to)), move |_| (at, 0.0));
        for record in after {
            prop_assert!((record.torque - last.torque).abs() < 1e-12 * (1.0 + last.torque.abs()), "{} after {}", record.torque, last.torque);
        }
    }
}

/// A wheel that swings under a moving puck: over a change between any two methods the step of its torque is at most their difference.
#[test]
fn a_swinging_wheel_continues_from_its_state() {
    let rest = format!("[bodies.wheel]\ninertia = 0.0258\n{}", spring("puck", "wheel", 1.0));
    let moves = |time: f64| (0.3 * (5.0 * time).sin(), 1.5 * (5.0 * time).cos());
    for (from, to) in METHODS.iter().flat_map(|from| METHODS.iter().map(move |to| (from, to))) {
        let make = |method| world(method, "", 1.0, false, &rest);
        let (last, after) = swapped(&make(from), &make(to), moves);
        // The relative velocity of puck and wheel is at most 2 rad/s, and one method's output may be a step ahead of another's.
        let steepest = 3.0e-3;
        let step = (after[0].torque - last.torque).abs();
        assert!(step < steepest, "{from} to {to}: {step}");
        // A lost or doubled step would be a change of the position by 1e-3 times the velocity.
        let (went, speed) = (after[0].bodies[0].0 - last.bodies[0].0, last.bodies[0].1);
        assert!((went - 1e-3 * speed).abs() < 0.05 * 1e-3 * speed.abs(), "{from} to {to}: {went} at {speed}");
    }
}

/// A held knob that enters another world does not move, on the device and in the hand, and is at that world's rest.
#[test]
fn a_held_knob_enters_at_the_worlds_rest_and_moves_nowhere() {
    let knob = |law: &str| {
        crate::common::world(&format!(
            "[loop]\nperiod = 1e-3\nestimator = \"difference\"\n[device]\ninertia = 6.4e-4\ndamping = 1e-3\nencoder = 16384\n\
             [[couplings]]\nbetween = [\"puck\", \"ground\"]\n{law}\n"
        ))
    };
    let before = knob("kind = \"spring\"\nstiffness = 0.05");
    let after = knob("kind = \"detent\"\ntorque = 0.02\npitch = 0.5\nphase = 0.1");
    for turn in [0.3, -0.2, 1.7] {
        let (device, mut hands) = SimulatedDevice::new(&before);
        let plan = Plan::new(&before, SafetyProfile::Simulated).unwrap();
        let mut cycle = Cycle::new(Box::new(plan.clone()), Box::new(device));
        armed(&mut cycle);
        hands.push(HandCommand::Grab(Grip { inertia: 1e-3, damping: 0.2, stiffness: 6.0 })).unwrap();
        hands.push(HandCommand::Move(turn)).unwrap();
        let mut last = sample(&mut cycle, false, None);
        for _ in 0..2000 {
            last = sample(&mut cycle, false, None);
        }
        cycle.pass(1);
        cycle.swap(Box::new(Plan::replacing(&after, &plan, Change::Enters).unwrap()));
        let first = cycle.sample(&Moment { periods: 1, ..Moment::default() }, None).unwrap();
        let place = first.position - first.zero;
        assert!((place - 0.1).abs() < 2.0 / COUNTS, "it stands at {place}");
        assert!((first.position - last.position).abs() < 1e-6 && (first.output - last.output).abs() < 1e-9);
        for _ in 0..500 {
            last = sample(&mut cycle, false, None);
        }
        // The hand no longer holds it against the spring.
        assert!(
            (last.position - first.position).abs() < 0.05 * turn.abs() && last.output.abs() < 0.1 * first.output.abs(),
            "{last:?}"
        );
        hands.push(HandCommand::Move(0.6)).unwrap();
        for _ in 0..2000 {
            last = sample(&mut cycle, false, None);
        }
        assert!((last.position - last.zero - 0.6).abs() < 0.01, "the hand's positions are not the world's");
    }
}
