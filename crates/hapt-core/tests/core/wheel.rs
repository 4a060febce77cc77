//! A wheel's effects: no passive hand draws energy, and what is given is what was asked where the device allows it.

use hapt_core::wheel::{Device, Effect, Refused, Shortfall, Sides, Stops, Timing, Wheel};
use proptest::prelude::*;

/// Random numbers in [0, 1).
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Evenly distributed in its logarithm.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.roll())
    }

    /// About 0, with its energy there.
    fn sides(&mut self, low: f64, high: f64, limit: f64) -> Sides<f64> {
        Sides {
            offset: 0.0,
            dead_band: if self.roll() < 0.5 { 0.0 } else { 0.01 * self.roll() },
            above: self.between(low, high),
            below: self.between(low, high),
            most_above: limit * self.roll(),
            most_below: limit * self.roll(),
        }
    }

    fn effects(&mut self, limit: f64) -> Vec<Effect<f64>> {
        let count = 1 + (self.roll() * 6.0) as usize;
        let one = |dice: &mut Self| match (dice.roll() * 4.0) as usize {
            0 => Effect::Spring(dice.sides(0.1, 1e3, limit)),
            1 => Effect::Damper(dice.sides(1e-3, 10.0, limit)),
            2 => Effect::Friction(dice.sides(1e-2, 10.0, limit)),
            _ => Effect::Inertia(dice.sides(1e-5, 1.0, limit)),
        };
        (0..count).map(|_| one(self)).collect()
    }
}

/// Steps of the shortest and the longest interval, of the nominal one, and of the delay.
#[derive(Clone, Copy)]
struct Pattern {
    shortest: usize,
    nominal: usize,
    longest: usize,
    delay: usize,
}

const STEP: f64 = 1e-4;

impl Pattern {
    fn timing(&self) -> Timing {
        let of = |steps: usize| steps as f64 * STEP;
        Timing {
            period: of(self.nominal),
            shortest: of(self.shortest),
            longest: of(self.longest),
            delay: of(self.delay),
            lag: 0.0,
        }
    }
}

/// What the hand draws beyond what the device's damping takes, relative to what passes to and fro, with `damping` in place of the device's own.
fn drawn(device: &Device, damping: f64, pattern: Pattern, effects: &[Effect<f64>], dice: &mut Dice) -> f64 {
    let wheel = Wheel::<f64>::new(device).unwrap();
    let mut state = wheel.start();
    let (mut z, mut next, mut pending) = (0.0, 0, Vec::new());
    let (mut torque, mut work, mut passed, mut velocity) = (0.0, 0.0, 0.0, 0.0);
    let (speed, turns) = (dice.between(1e-2, 10.0), dice.roll());
    for step in 0..4000 {
        if step == next {
            let given = wheel.step(&mut state, z, effects, 0);
            pending.push((step + pattern.delay, given.torque));
            next += pattern.shortest + (dice.roll() * (pattern.longest - pattern.shortest + 1) as f64) as usize;
            // A hand that turns at the samples asks most of the hold.
            if dice.roll() < 0.8 {
                velocity = if velocity > 0.0 { -speed } else { speed } * if turns < 0.5 { 1.0 } else { dice.roll() };
            }
        }
        if pending.first().is_some_and(|(arrives, _)| *arrives <= step) {
            torque = pending.remove(0).1;
        }
        let way = velocity * STEP;
        z += way;
        work += torque * way - damping * velocity * way;
        passed += (torque * way).abs();
    }
    work / passed.max(1e-12)
}

fn device(timing: Timing, damping: f64, stops: f64) -> Device {
    let stiffness = stops * damping / timing.spring_cost();
    let stops = (stiffness > 0.0).then_some(Stops { angle: 0.02, stiffness });
    Device { timing, damping, limit: 5.0, stops, base_friction: 0.0, base_damping: 0.0 }
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    #[test]
    fn no_hand_draws_energy_from_any_set_of_effects_under_uneven_time_and_delay(seed: u64, shortest in 2..8usize, more in 0..4usize, late in 0.0..3.0f64) {
        let mut dice = Dice(seed);
        let pattern = Pattern { shortest, nominal: shortest + more / 2, longest: shortest + more, delay: (late * shortest as f64) as usize };
        let device = device(pattern.timing(), dice.between(1e-3, 0.3), if dice.roll() < 0.5 { 0.0 } else { 0.9 * dice.roll() });
        let effects = dice.effects(5.0);
        let drawn = drawn(&device, device.damping, pattern, &effects, &mut dice);
        prop_assert!(drawn < 1e-9, "{drawn} of what passes, {effects:?} on {device:?}");
    }

    #[test]
    fn the_torque_keeps_the_limit_whatever_is_asked(seed: u64, numbers in proptest::collection::vec(any::<f32>(), 6)) {
        let mut dice = Dice(seed);
        let wheel = Wheel::<f32>::new(&device(Timing::even(1e-3), 0.01, 0.5)).unwrap();
        let mut state = wheel.start();
        let [offset, dead_band, above, below, most_above, most_below] = numbers[..] else { unreachable!() };
        let sides = Sides { offset, dead_band: dead_band.abs(), above, below, most_above: most_above.abs(), most_below: most_below.abs() };
        let all = [Effect::Spring(sides), Effect::Damper(sides), Effect::Friction(sides), Effect::Inertia(sides), Effect::Torque(offset)];
        for revision in 0..20 {
            let given = wheel.step(&mut state, dice.roll() as f32, &all, revision);
            prop_assert!(given.torque.abs() <= 5.0 && given.asked.abs() <= 5.0, "{given:?}");
        }
    }
}

#[test]
fn springs_at_the_bound_draw_energy_from_a_device_with_less_damping() {
    let pattern = Pattern { shortest: 10, nominal: 10, longest: 10, delay: 0 };
    let device = device(pattern.timing(), 0.05, 0.0);
    let spring = [Effect::Spring(Sides::even(1e3, 5.0))];
    let at = |share: f64, seed| drawn(&device, share * device.damping, pattern, &spring, &mut Dice(seed));
    assert!((0..50).all(|seed| at(1.0, seed) <= 1e-9));
    assert!((0..50).any(|seed| at(0.9, seed) > 0.0));
}

#[test]
fn a_slow_turn_feels_friction_and_damping_in_full_and_inertia_as_a_mass() {
    let wheel = Wheel::<f64>::new(&device(Timing::even(1e-3), 0.02, 0.0)).unwrap();
    let after = |effect, way: fn(f64) -> f64| {
        let mut state = wheel.start();
        (0..1000).map(|k| wheel.step(&mut state, way(f64::from(k) * 1e-3), &[effect], 0).torque).last().unwrap()
    };
    let turning = |t: f64| 2.0 * t;
    assert!((after(Effect::Friction(Sides::even(0.7, 5.0)), turning) + 0.7).abs() < 1e-9);
    assert!((after(Effect::Damper(Sides::even(0.3, 5.0)), turning) + 0.6).abs() < 1e-9);
    assert!((after(Effect::Damper(Sides::even(30.0, 1.5)), turning) + 1.5).abs() < 1e-9);
    // 5 rad/s², with the body's oscillation on its spring about it: their mean.
    let mut state = wheel.start();
    let inertia = [Effect::Inertia(Sides::even(0.02, 5.0))];
    let torques: Vec<f64> =
        (0..4000).map(|k| wheel.step(&mut state, 2.5 * (f64::from(k) * 1e-3).powi(2), &inertia, 0).torque).collect();
    let mean = torques[2000..].iter().sum::<f64>() / 2000.0;
    assert!((mean + 0.1).abs() < 0.002, "{mean}");
}

#[test]
fn a_change_of_effects_makes_no_jump() {
    let wheel = Wheel::<f64>::new(&device(Timing::even(1e-3), 0.02, 0.0)).unwrap();
    let mut state = wheel.start();
    wheel.step(&mut state, 0.1, &[], 0);
    let pushed = [Effect::Torque(3.0), Effect::Spring(Sides::even(10.0, 5.0))];
    let first = wheel.step(&mut state, 0.1, &pushed, 1).torque;
    assert!(first.abs() < 1e-12, "{first}");
    let torques: Vec<f64> = (0..20).map(|_| wheel.step(&mut state, 0.1, &pushed, 1).torque).collect();
    assert!(torques.windows(2).all(|pair| pair[0] < pair[1]) && (torques[19] - 2.0).abs() < 1e-3, "{torques:?}");
}

#[test]
fn what_is_not_given_has_a_reason() {
    let wheel = Wheel::<f64>::new(&device(Timing::even(1e-3), 0.02, 0.0)).unwrap();
    let reason = |effect| wheel.step(&mut wheel.start(), 0.1, &[effect], 0).shortfall;
    assert_eq!(reason(Effect::Spring(Sides::even(40.0, 5.0))), None);
    assert_eq!(reason(Effect::Spring(Sides::even(41.0, 5.0))), Some(Shortfall::Stiffness));
    assert_eq!(reason(Effect::Spring(Sides::even(-1.0, 5.0))), Some(Shortfall::Drives));
    assert_eq!(reason(Effect::Torque(6.0)), Some(Shortfall::Limit));
}

#[test]
fn stops_stiffer_than_the_damping_allows_are_refused_with_the_stiffness_that_would_do() {
    let most = 2.0 * 0.02 / 1e-3;
    let stops = |stiffness| {
        let stops = Some(Stops { angle: 7.85, stiffness });
        Wheel::<f64>::new(&Device { stops, ..device(Timing::even(1e-3), 0.02, 0.0) }).map(|_| ())
    };
    assert_eq!(stops(most), Ok(()));
    assert_eq!(stops(1.01 * most), Err(Refused::Stops { stiffness: 1.01 * most, most }));
}
