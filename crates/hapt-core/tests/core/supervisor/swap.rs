//! A world that takes another's place under a torque: the energy that the hand receives, (T81), and where the puck enters it, (T82).

use super::recentre::{at_puck, law};
use super::*;
use hapt_testing::prelude::*;

const NONE: f64 = f64::INFINITY;
/// No limit ends the run.
const FREE: Limits = Limits {
    velocity: NONE,
    jump: NONE,
    overspeed: NONE,
    torque: NONE,
    port_trips: false,
    zero_where_armed: true,
    ..LIMITS
};

fn at_pucks(laws: Vec<Law>) -> Vec<Coupling> {
    laws.into_iter().map(at_puck).collect()
}

fn stiffness(couplings: &[Coupling]) -> f64 {
    couplings.iter().map(|c| c.law.slopes().stiffness).sum()
}

fn stored(couplings: &[Coupling], y: f64) -> f64 {
    couplings.iter().map(|c| c.stored(y, 0.0)).sum()
}

/// A running world, at its 0 where the puck was armed, and then `turned`.
fn turned<F: Real>(limits: &Limits, spec: &Spec, armed: f64, turned: f64) -> Guard<F> {
    let mut guard = Guard::<F>::running(limits, spec, armed);
    guard.at(armed + turned);
    guard
}

impl<F: Real> Guard<F> {
    /// Enters another world; the torque that was held.
    fn enter(&mut self, limits: &Limits, spec: &Spec) -> F {
        let held = self.watch.output;
        let next = Self::new(limits, spec);
        self.state = next.world.transfer(&self.world, &self.state, |_| None, |_| None);
        (self.world, self.supervisor) = (next.world, next.supervisor);
        self.watch.enter(F::from_f64(T), F::from_f64(T), F::from_f64(spec.entry()));
        held
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// The torque continues from its value, and over any path its work is at most the energy that the new world has stored at the change,
    /// half a sample's rise of the torque, and the fade's r² T (n + 1)(2n + 1)/(24 n c) + c δ²/T, for any damping c.
    #[test]
    fn a_change_of_the_world_gives_what_the_new_one_stores_and_what_the_fade_works(
        laws in prop::collection::vec(law(), 1..4), others in prop::collection::vec(law(), 1..4), start in -0.2..0.2_f64,
        samples in 2..40_u32, spare in -5.0..-1.0_f64, moves in prop::collection::vec((-1.0..1.0_f64, 1..30_u32), 12), along in any::<bool>(),
    ) {
        let [before, after] = [laws, others].map(at_pucks);
        let spec = |couplings| Spec { couplings, limit: None, ..WORLD };
        let limits = Limits { fade: f64::from(samples) * T, zero_where_armed: false, ..FREE };
        let mut guard = Guard::<f64>::running(&limits, &spec(&before), start);
        let next = Guard::<f64>::new(&limits, &spec(&after));
        let held = guard.watch.output;
        (guard.world, guard.supervisor, guard.state) = (next.world, next.supervisor, next.state);
        guard.watch.swap(T, T);
        let first = guard.at(start);
        prop_assert!((first.output - held).abs() < 1e-12, "the torque steps from {held} to {}", first.output);

        let stiffness = stiffness(&after);
        let stored = |y| stored(&after, y);
        let (r, n, c) = (held - first.sample.torque, f64::from(samples), 10_f64.powf(spare));
        let fade = r * r * T * (n + 1.0) * (2.0 * n + 1.0) / (24.0 * n * c);
        let (mut position, mut output, mut k) = (start, first.output, 0.0);
        let (mut work, mut rise, mut spent, mut travel) = (0.0, 0.0, 0.0, 0.0);
        for (size, count) in moves {
            for _ in 0..count {
                // A hand that moves along with the rest of the old torque, at the speed that draws the most, or any other.
                let left = r * (1.0 - k / n).max(0.0);
                k += 1.0;
                let step = if along { 0.5 * T * left / c } else { size * 2e-3 };
                let step = step.clamp(-0.01, 0.01);
                position += step;
                work += output * step;
                rise += 0.5 * stiffness * step * step;
                spent += c * step * step / T;
                travel += step.abs();
                output = guard.at(position).output;
                let of_world = stored(start) - stored(position) + rise;
                prop_assert!(work <= of_world + spent + fade + 1e-11, "{work} J, {of_world}, {spent} and {fade} J allowed");
                prop_assert!(work <= of_world + r.abs() * travel + 1e-11, "{work} J, {of_world} J and a travel of {travel} allowed");
            }
        }
        prop_assert_eq!(guard.watch.phase, Phase::Running);
    }

    /// At the place where a world is entered, its couplings push with no more than half a count's rise, store no more than at its 0, and
    /// push back to both sides.
    #[test]
    fn a_puck_enters_a_world_at_a_rest(laws in prop::collection::vec(law(), 1..4), counts in prop::option::of(1e-5..1e-2_f64)) {
        let couplings = at_pucks(laws);
        let spec = Spec { couplings: &couplings, count: counts, limit: None, ..WORLD };
        let (at, k) = (spec.entry(), stiffness(&couplings));
        let near = counts.map_or(1e-8, |count| 0.5 * count);
        let stored = |y| stored(&couplings, y);
        prop_assert!(stored(at) <= stored(0.0) + 1e-15, "{} J at {at}, {} J at 0", stored(at), stored(0.0));
        let push = |y: f64| (stored(y - 1e-6) - stored(y + 1e-6)) / 2e-6;
        prop_assert!(push(at).abs() <= k * (near + 2e-6), "{} at {at}", push(at));
        match counts {
            Some(count) => prop_assert!((at / count - (at / count).round()).abs() < 1e-9, "{at} is no whole number of counts of {count}"),
            None => {
                let [ahead, behind] = [push(at + 2e-5), push(at - 2e-5)];
                prop_assert!(ahead <= k * 1e-5 && behind >= -k * 1e-5, "{behind} and {ahead} beside {at}");
            }
        }
    }

    /// (T82): a world that is entered begins at the same place of its own wherever the knob is, and the torque continues. If the knob is
    /// not turned the torque falls to 0; over any path its work is at most the energy that the world stores at its entry, which is no more
    /// than at its 0, half a sample's rise, and the work of the fade with no more than the torque that was held.
    #[test]
    fn a_world_that_is_entered_gives_no_more_than_the_torque_that_was_held(
        laws in prop::collection::vec(law(), 1..4), others in prop::collection::vec(law(), 1..4), armed in -9.0..9.0_f64, away in -0.2..0.2_f64,
        samples in 2..40_u32, spare in -5.0..-1.0_f64, moves in prop::collection::vec((-1.0..1.0_f64, 1..30_u32), 12), along in any::<bool>(),
    ) {
        let [before, after] = [laws, others].map(at_pucks);
        let spec = |couplings| Spec { couplings, limit: None, ..WORLD };
        let limits = Limits { fade: f64::from(samples) * T, ..FREE };
        let start = armed + away;
        let mut guard = turned::<f64>(&limits, &spec(&before), armed, away);
        let held = guard.enter(&limits, &spec(&after));
        let mut resting = Guard { world: guard.world, supervisor: guard.supervisor, state: guard.state, watch: guard.watch };
        let first = guard.at(start);
        let (entry, stiffness) = (spec(&after).entry(), stiffness(&after));
        prop_assert!((first.output - held).abs() < 1e-12, "the torque steps from {held} to {}", first.output);
        prop_assert!((first.sample.puck.position - entry).abs() < 1e-12, "it enters at {}, not {entry}", first.sample.puck.position);
        prop_assert!(first.sample.torque.abs() <= 1e-8 * stiffness, "it is pushed with {}", first.sample.torque);
        let last = (0..=samples).map(|_| resting.at(start).output).last().unwrap_or(held);
        prop_assert!(last.abs() <= 1e-8 * stiffness, "{last} is left where nobody turned it");

        let stored = |y| stored(&after, y);
        prop_assert!(stored(entry) <= stored(0.0) + 1e-15);
        let (r, n, c) = (held.abs() + 1e-8 * stiffness, f64::from(samples), 10_f64.powf(spare));
        let fade = r * r * T * (n + 1.0) * (2.0 * n + 1.0) / (24.0 * n * c);
        let (mut position, mut output, mut k) = (start, first.output, 0.0);
        let (mut work, mut rise, mut spent, mut travel) = (0.0, 0.0, 0.0, 0.0);
        for (size, count) in moves {
            for _ in 0..count {
                let left = held * (1.0 - k / n).max(0.0);
                k += 1.0;
                let step = if along { 0.5 * T * left / c } else { size * 2e-3 };
                let step = step.clamp(-0.01, 0.01);
                position += step;
                work += output * step;
                rise += 0.5 * stiffness * step * step;
                spent += c * step * step / T;
                travel += step.abs();
                output = guard.at(position).output;
                let of_world = stored(entry) - stored(entry + position - start) + rise;
                prop_assert!(work <= of_world + spent + fade + 1e-11, "{work} J, {of_world}, {spent} and {fade} J allowed");
                prop_assert!(work <= of_world + r * travel + 1e-11, "{work} J, {of_world} J and a travel of {travel} allowed");
            }
        }
        prop_assert_eq!(guard.watch.phase, Phase::Running);
    }

    /// The velocity estimate of a turning knob continues across the new origin, with any estimator, with counts and without.
    #[test]
    fn a_knob_that_turns_enters_at_the_speed_that_it_has(
        armed in -9.0..9.0_f64, counts in 1..9_u32, encoder in any::<bool>(), phase in -0.1..0.1_f64,
        estimator in prop::sample::select(vec![
            Estimator::Difference, Estimator::LowPass { cutoff: 50.0 }, Estimator::Foaw { window: 8 }, Estimator::FoawBest { window: 8 },
            Estimator::DifferenceOver { every: 5 }, Estimator::Kalman { cutoff: 50.0 }, Estimator::Levant { acceleration: 100.0 },
        ]),
    ) {
        let count = 1e-3;
        let detent = [at_puck(Law::Detent { torque: 1e-2, pitch: 0.2, phase })];
        let spec = Spec { estimator, count: encoder.then_some(count), couplings: &detent, ..WORLD };
        let mut guard = Guard::<f64>::running(&FREE, &spec, armed);
        let step = f64::from(counts) * count;
        let mut position = armed;
        for _ in 0..300 {
            position += step;
            guard.at(position);
        }
        guard.enter(&FREE, &spec);
        for _ in 0..30 {
            position += step;
            let velocity = guard.at(position).sample.puck.velocity;
            prop_assert!((velocity - step / T).abs() < 1e-6 * step / T, "{velocity} rad/s of {}", step / T);
        }
    }
}
