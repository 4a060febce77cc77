//! Idle re-centring: when the origin slips, how fast, and that no slip raises what the couplings store.

use super::*;
use hapt_testing::laws::{SIZES, Sizes, is_potential};
use hapt_testing::prelude::*;

const PERIODS: f64 = 50.0;
const RECENTRE: Limits = Limits { recentre: PERIODS * T, ..LIMITS };

pub fn at_puck(law: Law) -> Coupling {
    law.between(End::Puck, End::Ground)
}

for_both! {
    the_torque_of_a_resting_puck_falls_with_the_time_constant
    a_puck_that_a_hand_holds_keeps_its_torque
    a_puck_that_turns_keeps_its_origin
    a_slip_is_no_work_of_the_hand
}

fn the_torque_of_a_resting_puck_falls_with_the_time_constant<F: Real>() {
    let position = 0.9 * RECENTRE.friction / K;
    let mut guard = Guard::<F>::running(&RECENTRE, &WORLD, 0.0);
    let first = guard.at(position).output.to_f64();
    assert!((first + K * position).abs() < 1e-7);
    let mut sample = 0.0;
    // The samples from the first on that the puck stands still.
    while guard.at(position).output.to_f64() == first {
        sample += 1.0;
        assert!(sample < PERIODS + 2.0, "it rests and nothing slips");
    }
    assert!(sample >= PERIODS - 1.0, "it slips after {sample} samples");
    let mut torque = first * (1.0 - 1.0 / PERIODS);
    for _ in 0..200 {
        torque *= 1.0 - 1.0 / PERIODS;
        let is = guard.at(position).output.to_f64();
        assert!((is - torque).abs() < 2e-6, "{is} in place of {torque}");
    }
    assert_eq!(guard.watch.phase, Phase::Running);
}

fn a_puck_that_a_hand_holds_keeps_its_torque<F: Real>() {
    let position = 1.1 * RECENTRE.friction / K;
    let mut guard = Guard::<F>::running(&RECENTRE, &WORLD, 0.0);
    let first = guard.at(position).output;
    for _ in 0..500 {
        assert_eq!(guard.at(position).output, first);
    }
}

fn a_puck_that_turns_keeps_its_origin<F: Real>() {
    let mut guard = Guard::<F>::running(&RECENTRE, &WORLD, 0.0);
    for k in 0..1000 {
        // A motion over 0.25 mrad takes less than the time at rest.
        guard.at(2e-5 * (f64::from(k % 400) - 200.0).abs());
    }
    assert_eq!(guard.watch.offset, F::ZERO);
}

fn a_slip_is_no_work_of_the_hand<F: Real>() {
    let limits = Limits { energy: 1e-5, ..RECENTRE };
    let mut guard = Guard::<F>::running(&limits, &WORLD, 0.0);
    for k in 0..40 {
        let to = [1.0, -1.0][k % 2] * 0.8 * RECENTRE.friction / K;
        for i in 0..100 {
            guard.at(to * (f64::from(i) / 10.0).min(1.0));
        }
        assert_eq!(guard.watch.phase, Phase::Running, "{:?} after {k} rests", guard.watch.reason);
        assert!(guard.watch.account() >= F::ZERO);
    }
}

/// Laws with an energy about a place.
pub fn law() -> impl Strategy<Value = Law> {
    let sizes = Sizes {
        stiffness: 0.05..=2.0,
        damping: 0.0..=0.0,
        torque: 1e-3..=0.05,
        length: 0.01..=0.5,
        place: 0.1,
        ..SIZES
    };
    sizes.laws(is_potential)
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// (T80): S(y + δ + e) - S(y) ≤ -τ δ + D |δ| + K δ²/2, with the true position y of the puck in the world, D = KΔ/2. With rests, slow turns
    /// and jerks, behind an encoder and without one.
    #[test]
    fn no_slip_raises_what_is_stored(
        laws in prop::collection::vec(law(), 1..4), count in prop::option::of(1e-5..2e-3_f64), periods in 2.0..60.0_f64,
        friction in 1e-3..0.05_f64, moves in prop::collection::vec((-1.0..1.0_f64, 0..4_u8, 1..120_u32), 20),
    ) {
        let couplings: Vec<Coupling> = laws.into_iter().map(at_puck).collect();
        let spec = Spec { count, couplings: &couplings, limit: None, ..WORLD };
        let none = f64::INFINITY;
        let limits = Limits {
            recentre: periods * T, friction, velocity: none, jump: none, overspeed: none, torque: none, port_trips: false, ..LIMITS
        };
        let mut guard = Guard::<f64>::running(&limits, &spec, 0.0);
        let stiffness: f64 = couplings.iter().map(|c| c.law.slopes().stiffness).sum();
        let counts = 0.5 * stiffness * count.unwrap_or(0.0);
        let stored = |y: f64| couplings.iter().map(|c| c.stored(y, 0.0)).sum::<f64>();
        let mut position = 0.0;
        let (mut y, mut torque) = (position - guard.watch.offset, guard.at(position).sample.torque);
        for (size, kind, samples) in moves {
            for i in 0..samples {
                let count = count.unwrap_or(1e-4);
                let travel = match kind {
                    0 => 0.0,
                    1 => size * 0.01 * count,
                    2 => size * 0.7 * count * f64::from(i % 2) * [1.0, -1.0][(i / 2) as usize % 2],
                    _ => size * 2e-3,
                };
                position += travel;
                let safe = guard.at(position);
                let next = position - guard.watch.offset;
                let gained = stored(next) - stored(y);
                let most = -torque * travel + counts * travel.abs() + 0.5 * stiffness * travel * travel;
                prop_assert!(gained <= most + 1e-12, "{gained} J gained, {most} allowed, after a travel of {travel} and a slip of {}", next - y - travel);
                (y, torque) = (next, safe.sample.torque);
            }
        }
    }
}
