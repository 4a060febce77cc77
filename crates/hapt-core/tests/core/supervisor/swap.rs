//! A world that takes another's place under a torque: what the hand receives, (T81).

use super::recentre::{at_puck, law};
use super::*;
use proptest::prelude::*;

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// The torque goes on from where it was, and over any way its work is at most what the new world has stored at the change, half a sample's
    /// rise of the torque, and the fade's r² T (n + 1)(2n + 1)/(24 n c) + c δ²/T, for any damping c.
    #[test]
    fn a_change_of_the_world_gives_what_the_new_one_stores_and_what_the_fade_works(
        laws in prop::collection::vec(law(), 1..4), others in prop::collection::vec(law(), 1..4), start in -0.2..0.2_f64,
        samples in 2..40_u32, spare in -5.0..-1.0_f64, moves in prop::collection::vec((-1.0..1.0_f64, 1..30_u32), 12), along in any::<bool>(),
    ) {
        let [before, after]: [Vec<Coupling>; 2] = [laws, others].map(|laws| laws.into_iter().map(at_puck).collect());
        let spec = |couplings| Spec { couplings, limit: None, ..WORLD };
        let none = f64::INFINITY;
        let limits = Limits {
            fade: f64::from(samples) * T, velocity: none, jump: none, overspeed: none, torque: none, port_trips: false, ..LIMITS
        };
        let mut guard = Guard::<f64>::running(&limits, &spec(&before), start);
        let next = Guard::<f64>::new(&limits, &spec(&after));
        let held = guard.watch.output;
        (guard.world, guard.supervisor, guard.state) = (next.world, next.supervisor, next.state);
        guard.watch.swap(T, T);
        let first = guard.at(start);
        prop_assert!((first.output - held).abs() < 1e-12, "the torque steps from {held} to {}", first.output);

        let stiffness: f64 = after.iter().map(|c| c.law.slopes().stiffness).sum();
        let stored = |y: f64| after.iter().map(|c| c.stored(y, 0.0)).sum::<f64>();
        let (r, n, c) = (held - first.sample.torque, f64::from(samples), 10_f64.powf(spare));
        let fade = r * r * T * (n + 1.0) * (2.0 * n + 1.0) / (24.0 * n * c);
        let (mut position, mut output, mut k) = (start, first.output, 0.0);
        let (mut work, mut rise, mut spent, mut way) = (0.0, 0.0, 0.0, 0.0);
        for (size, count) in moves {
            for _ in 0..count {
                // A hand that goes along with what is left of the old torque, as fast as pays best, or any other.
                let left = r * (1.0 - k / n).max(0.0);
                k += 1.0;
                let step = if along { 0.5 * T * left / c } else { size * 2e-3 };
                let step = step.clamp(-0.01, 0.01);
                position += step;
                work += output * step;
                rise += 0.5 * stiffness * step * step;
                spent += c * step * step / T;
                way += step.abs();
                output = guard.at(position).output;
                let of_world = stored(start) - stored(position) + rise;
                prop_assert!(work <= of_world + spent + fade + 1e-11, "{work} J, {of_world}, {spent} and {fade} J allowed");
                prop_assert!(work <= of_world + r.abs() * way + 1e-11, "{work} J, {of_world} J and a way of {way} allowed");
            }
        }
        prop_assert_eq!(guard.watch.phase, Phase::Running);
    }
}
