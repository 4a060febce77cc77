//! A position that does not change, under constant, oscillating and alternating torques.

use hapt_core::{Body, Reason, Side};
use hapt_testing::prelude::*;

use super::*;

for_both! {
    a_puck_that_stands_still_under_torque_is_stuck
    five_short_pushes_find_a_dead_encoder
    a_dead_encoder_can_be_cleared_and_is_found_again
}

/// Beyond this torque the puck should move.
const ASKS: f64 = LIMITS.stuck_torque;
const COUNT: f64 = std::f64::consts::TAU / 4000.0;

/// A body on a spring to ground, which swings at `frequency` and pulls at the puck by up to `torque`, through so soft a spring that the
/// puck's own motion hardly changes it.
fn swing(torque: f64, frequency: f64) -> ([Body; 1], [Coupling; 2]) {
    let (soft, rate) = (1e-3, std::f64::consts::TAU * frequency);
    let law = Law::Spring { stiffness: rate * rate, rest: 0.0 };
    (
        [Body { inertia: 1.0, position: 0.0, velocity: torque / soft * rate }],
        [
            Coupling { first: End::Body(0), second: End::Ground, law, limit: None },
            Coupling {
                first: End::Puck,
                second: End::Body(0),
                law: Law::Spring { stiffness: soft, rest: 0.0 },
                limit: None,
            },
        ],
    )
}

/// How long a free puck of [`LIMITS`] takes from rest to four counts, under the least torque that counts, in s.
fn four_counts() -> f64 {
    let net = ASKS - 0.5 * (ASKS + LIMITS.friction);
    let (mut travel, mut speed, mut samples) = (0.0, 0.0, 0.0);
    while travel <= 4.0 * COUNT {
        speed = (speed + T * net / LIMITS.inertia) / (1.0 + T * LIMITS.damping / LIMITS.inertia);
        travel += T * speed;
        samples += 1.0;
    }
    samples * T
}

/// The time under a torque that should move the puck, from when it stands still to the fault; `None`: none in `samples`.
fn pushed_until_stuck<F: Real>(limits: &Limits, torque: f64, frequency: f64, samples: u32) -> Option<f64> {
    let (bodies, couplings) = swing(torque, frequency);
    let spec = Spec { count: Some(COUNT), bodies: &bodies, couplings: &couplings, ..WORLD };
    let mut guard = Guard::<F>::running(limits, &spec, 0.0);
    let mut pushed = 0.0;
    for _ in 0..samples {
        let guarded = guard.at(0.0);
        if guarded.phase == Phase::Faulted {
            assert_eq!((guarded.reason, guarded.output.to_f64()), (Some(Reason::Stuck), 0.0));
            return Some(pushed);
        }
        pushed += if guarded.output.to_f64().abs() > ASKS { T } else { 0.0 };
    }
    None
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// It crosses the threshold again and again; each crossing once reset the sum.
    #[test]
    fn a_torque_that_swings_finds_a_dead_encoder_as_one_that_stays(
        torque in 1.5..7.5f64, frequency in -2.0..0.7f64, stuck in 0.2..1.5f64,
    ) {
        let limits = Limits { stuck, energy: 1e9, ..LIMITS };
        let pushed = pushed_until_stuck::<f64>(&limits, torque * ASKS, 10f64.powf(frequency), 200_000);
        let least = four_counts();
        // Of each swing's time beyond the threshold, the time of four counts may be lost.
        let each = (std::f64::consts::PI - 2.0 * (1.0 / torque).asin()) / (std::f64::consts::TAU * 10f64.powf(frequency));
        let bound = (stuck.max(4.0 * least) + 2.0 * least) / (1.0 - least / each) + 0.05;
        prop_assert!(pushed.is_some_and(|pushed| pushed <= bound), "{pushed:?} s, not {bound} s");
        let single = pushed_until_stuck::<f32>(&limits, torque * ASKS, 10f64.powf(frequency), 200_000);
        prop_assert!(single.is_some(), "not in f32");
    }

    /// A period that changes under a standing encoder neither lengthens nor shortens the time to its detection.
    #[test]
    fn a_world_whose_period_changes_finds_a_dead_encoder_in_the_same_time(
        periods in proptest::collection::vec((0.25..4.0f64, 5..60u32), 400), stuck in 0.2..1.0f64,
    ) {
        let limits = Limits { stuck, energy: 1e9, stall: 1.0, ..LIMITS };
        let mut guard = Guard::<f64>::running(&limits, &WORLD, 0.5);
        let mut stood = 0.0;
        'found: for (period, samples) in &periods {
            let spec = Spec { period: period * T, ..WORLD };
            let next = Guard::<f64>::new(&limits, &spec);
            guard.watch.swap(guard.world.period(), next.world.period());
            (guard.world, guard.supervisor, guard.state) = (next.world, next.supervisor, next.state);
            for _ in 0..*samples {
                stood += spec.period;
                if guard.at(0.5).phase == Phase::Faulted {
                    break 'found;
                }
            }
        }
        prop_assert_eq!(guard.watch.reason, Some(Reason::Stuck));
        // A count of samples is rounded up at each change, and the time of four counts is whole.
        let changes = periods.iter().map(|(period, samples)| period * T * f64::from(*samples)).scan(0.0, |sum, time| {
            *sum += time;
            (*sum < stood).then_some(0.008)
        });
        prop_assert!(stood > 0.8 * stuck - changes.sum::<f64>() && stood < 1.3 * stuck + 0.1, "{stood} s of {stuck} s");
    }

    /// With 1.5 times the friction of the file, at every frequency, moving by many counts and by none.
    #[test]
    fn a_free_puck_is_never_stuck(
        torque in 0.2..7.5f64, frequency in -1.5..2.4f64, sticks in 0.0..3.0f64, start in 0.0..1.0f64,
    ) {
        let limits = Limits { stuck: 0.2, energy: 1e9, jump: 1.0, ..LIMITS };
        let (bodies, couplings) = swing(torque * ASKS, 10f64.powf(frequency));
        let spec = Spec { count: Some(COUNT), bodies: &bodies, couplings: &couplings, ..WORLD };
        let mut guard = Guard::<f64>::running(&limits, &spec, 0.0);
        let (mut position, mut velocity) = (start * COUNT, 0.0_f64);
        let friction = T * sticks * LIMITS.friction / LIMITS.inertia;
        for k in 0..5000 {
            let guarded = guard.at((position / COUNT).floor() * COUNT);
            prop_assert_ne!(guarded.reason, Some(Reason::Stuck), "after {} samples", k);
            let pushed = velocity + T * guarded.output.to_f64() / LIMITS.inertia;
            let slid = pushed.signum() * (pushed.abs() - friction).max(0.0);
            velocity = slid / (1.0 + T * LIMITS.damping / LIMITS.inertia);
            position += T * velocity;
        }
    }
}

/// A body that swings by 1 rad once in a second touches the puck's wall for a fourteenth of it.
fn five_short_pushes_find_a_dead_encoder<F: Real>() {
    let rate = std::f64::consts::TAU;
    let spring = Law::Spring { stiffness: rate * rate, rest: 0.0 };
    let wall = Law::Wall { side: Side::Above, at: 0.97, stiffness: 20.0, damping: 0.0 };
    let bodies = [Body { inertia: 1.0, position: 0.0, velocity: rate }];
    let couplings = [
        Coupling { first: End::Body(0), second: End::Ground, law: spring, limit: None },
        Coupling { first: End::Body(0), second: End::Puck, law: wall, limit: None },
    ];
    let spec = Spec { count: Some(COUNT), bodies: &bodies, couplings: &couplings, ..WORLD };
    let mut guard = Guard::<F>::running(&Limits { stuck: 1.0, energy: 1e3, ..LIMITS }, &spec, 0.0);
    let (mut pushes, mut pushed, mut last) = (0, 0, 0.0);
    for _ in 0..20_000 {
        let guarded = guard.at(0.0);
        let torque = guarded.output.to_f64().abs();
        pushes += i32::from(torque > ASKS && last <= ASKS);
        pushed += i32::from(torque > ASKS);
        last = torque;
        if guarded.phase == Phase::Faulted {
            assert_eq!(guarded.reason, Some(Reason::Stuck));
            assert!((4..=5).contains(&pushes) && pushed < 500, "{pushes} pushes, {pushed} ms");
            return;
        }
    }
    panic!("{pushes} pushes, and no fault");
}

/// Torques from before it was armed do not count.
fn a_dead_encoder_can_be_cleared_and_is_found_again<F: Real>() {
    let limits = Limits { stuck: 0.2, ..LIMITS };
    let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
    for _ in 0..2 {
        let mut samples = 20;
        while guard.at(0.5).phase == Phase::Running {
            samples += 1;
        }
        assert_eq!(guard.watch.reason, Some(Reason::Stuck));
        assert!((199..=205).contains(&samples), "{samples}");
        for _ in 0..20 {
            guard.at(0.5);
        }
        assert_eq!(guard.step(&reading(0.5), Some(Request::Clear)).phase, Phase::Disarmed);
        guard.step(&reading(0.5), Some(Request::Arm));
        for _ in 0..20 {
            guard.at(0.5);
        }
        assert_eq!(guard.watch.phase, Phase::Running);
    }
}

fn a_puck_that_stands_still_under_torque_is_stuck<F: Real>() {
    let limits = Limits { stuck: 0.2, ..LIMITS };
    let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
    let mut samples = 20;
    while guard.at(0.5).phase == Phase::Running {
        samples += 1;
    }
    assert_eq!(guard.watch.reason, Some(Reason::Stuck));
    assert!((199..=205).contains(&samples), "{samples}");
    // A puck that moves a little now and then is held by a hand, and one without torque may rest for ever.
    let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
    for k in 0..1000 {
        assert_eq!(guard.at(if k / 100 % 2 == 0 { 0.5 } else { 0.501 }).phase, Phase::Running);
    }
    let mut guard = Guard::<F>::running(&limits, &WORLD, 0.05);
    for _ in 0..1000 {
        assert_eq!(guard.at(0.05).phase, Phase::Running);
    }
}
