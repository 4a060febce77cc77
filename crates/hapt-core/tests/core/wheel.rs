//! A wheel's effects: no passive hand draws energy, and the torque is the requested one where the device allows it.

use hapt_core::wheel::{Device, Effect, REST_SPEED, Refused, Shortfall, Sides, Timing, Wheel};
use hapt_testing::prelude::*;

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

/// Steps of the shortest and the longest interval, of the nominal one, and of the delay; the motor's lag in s.
#[derive(Clone, Copy)]
struct Pattern {
    shortest: usize,
    nominal: usize,
    longest: usize,
    delay: usize,
    lag: f64,
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
            lag: self.lag,
        }
    }
}

/// The energy that a hand draws from the wheel of `device`, with end stops of a stiffness in addition to its effects, beyond the energy
/// that the damping and the friction of `real` dissipate, relative to the energy exchanged. The hand moves evenly within each step, not
/// slower than `slowest`, and the motor's torque follows its command exactly.
fn drawn(
    device: &Device,
    stops: f64,
    real: &Device,
    pattern: Pattern,
    effects: &[Effect<f64>],
    slowest: f64,
    dice: &mut Dice,
) -> f64 {
    let wheel = Wheel::<f64>::new(device).unwrap();
    let mut state = wheel.start();
    let (mut z, mut next, mut pending) = (0.0, 0, Vec::new());
    let (mut command, mut torque, mut work, mut passed, mut velocity) = (0.0, 0.0, 0.0, 0.0, 0.0_f64);
    let (speed, turns) = (dice.between(1e-2_f64.max(slowest), 10.0), dice.roll());
    let (kept, mean) = if pattern.lag > 0.0 {
        let kept = (-STEP / pattern.lag).exp();
        (kept, pattern.lag / STEP * (1.0 - kept))
    } else {
        (0.0, 0.0)
    };
    for step in 0..4000 {
        if step == next {
            let seen = if real.count > 0.0 { (z / real.count + 0.5).floor() * real.count } else { z };
            let external = (-stops * (seen - seen.clamp(-0.02, 0.02))).clamp(-device.limit, device.limit);
            let given = wheel.step_with(&mut state, seen, external, effects, 0);
            pending.push((step + pattern.delay, given.torque + external));
            next += pattern.shortest + (dice.roll() * (pattern.longest - pattern.shortest + 1) as f64) as usize;
            // A hand that turns at the samples draws the most from the hold.
            if dice.roll() < 0.8 {
                let share = if turns < 0.5 { 1.0 } else { dice.roll() };
                velocity = if velocity > 0.0 { -1.0 } else { 1.0 } * (speed * share).max(slowest);
            }
        }
        if pending.first().is_some_and(|(arrives, _)| *arrives <= step) {
            command = pending.remove(0).1;
        }
        let travel = velocity * STEP;
        z += travel;
        let given = travel * (command + (torque - command) * mean);
        torque = command + (torque - command) * kept;
        work += given - real.damping * velocity * travel - real.friction * travel.abs();
        passed += given.abs();
    }
    work / passed.max(1e-12)
}

fn device(timing: Timing, damping: f64) -> Device {
    Device::ideal(timing, damping, 5.0)
}

/// The device that stops with this share of the damping leave, and their stiffness.
fn with_stops(real: &Device, share: f64) -> (Device, f64) {
    let damping = (1.0 - share) * real.damping;
    (Device { damping, ..*real }, share * real.damping / real.timing.spring_cost())
}

fn pattern(shortest: usize, more: usize, late: f64) -> Pattern {
    let delay = (late * shortest as f64) as usize;
    Pattern { shortest, nominal: shortest + more / 2, longest: shortest + more, delay, lag: 0.0 }
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    #[test]
    fn no_hand_draws_energy_from_any_set_of_effects_under_uneven_time_and_delay(
        seed in any::<u64>(), shortest in 2..8usize, more in 0..4usize, late in 0.0..3.0f64,
    ) {
        let mut dice = Dice(seed);
        let pattern = pattern(shortest, more, late);
        let real = device(pattern.timing(), dice.between(1e-3, 0.3));
        let (device, stops) = with_stops(&real, if dice.roll() < 0.5 { 0.0 } else { 0.9 * dice.roll() });
        let effects = dice.effects(5.0);
        let drawn = drawn(&device, stops, &real, pattern, &effects, 0.0, &mut dice);
        prop_assert!(drawn < 1e-9, "{drawn} of what passes, {effects:?} and stops of {stops} on {real:?}");
    }

    #[test]
    fn nor_through_a_motor_that_lags_by_periods(
        seed in any::<u64>(), shortest in 2..8usize, more in 0..4usize, late in 0.0..3.0f64, lag in 0.01..3.0f64,
    ) {
        let mut dice = Dice(seed);
        let pattern = Pattern { lag: lag * shortest as f64 * STEP, ..pattern(shortest, more, late) };
        let real = device(pattern.timing(), dice.between(1e-3, 0.3));
        let (device, stops) = with_stops(&real, if dice.roll() < 0.5 { 0.0 } else { 0.9 * dice.roll() });
        let effects = dice.effects(5.0);
        let drawn = drawn(&device, stops, &real, pattern, &effects, 0.0, &mut dice);
        prop_assert!(drawn < 1e-9, "{drawn} of what passes, {effects:?} and stops of {stops} on {real:?}");
    }

    /// At rest speed and faster; what a slower hand draws is in the next test.
    #[test]
    fn nor_across_the_counts_of_an_encoder(
        seed in any::<u64>(), shortest in 2..8usize, more in 0..4usize, late in 0.0..3.0f64, lag in 0.01..3.0f64,
    ) {
        let mut dice = Dice(seed);
        let lag = if dice.roll() < 0.5 { 0.0 } else { lag * shortest as f64 * STEP };
        let pattern = Pattern { lag, ..pattern(shortest, more, late) };
        let friction = if dice.roll() < 0.5 { 0.0 } else { dice.between(1e-4, 0.3) };
        let counted = Device { count: dice.between(1e-5, 1e-2), friction, ..device(pattern.timing(), dice.between(1e-3, 0.3)) };
        let effects = dice.effects(5.0);
        let drawn = drawn(&counted, 0.0, &counted, pattern, &effects, REST_SPEED, &mut dice);
        prop_assert!(drawn < 1e-9, "{drawn} of what passes, {effects:?} on {counted:?}");
    }

    #[test]
    fn the_torque_keeps_the_limit_whatever_is_asked(seed in any::<u64>(), numbers in proptest::collection::vec(any::<f32>(), 6)) {
        let mut dice = Dice(seed);
        let wheel = Wheel::<f32>::new(&device(Timing::even(1e-3), 0.01)).unwrap();
        let mut state = wheel.start();
        let [offset, dead_band, above, below, most_above, most_below] = numbers[..] else { unreachable!() };
        let sides = Sides { offset, dead_band: dead_band.abs(), above, below, most_above: most_above.abs(), most_below: most_below.abs() };
        let all = [Effect::Spring(sides), Effect::Damper(sides), Effect::Friction(sides), Effect::Inertia(sides), Effect::Torque(offset)];
        for revision in 0..20 {
            let given = wheel.step(&mut state, dice.roll() as f32, &all, revision);
            prop_assert!(given.torque.abs() <= 5.0 && given.requested.abs() <= 5.0, "{given:?}");
        }
    }
}

/// The friction of a device that pays for the counts of springs at every speed.
fn friction_for(device: &Device) -> f64 {
    0.5 * device.count * device.damping / device.timing.spring_cost()
}

#[test]
fn springs_at_the_bound_draw_energy_from_a_device_with_less_damping() {
    let pattern = Pattern { shortest: 10, nominal: 10, longest: 10, delay: 0, lag: 0.0 };
    let spring = [Effect::Spring(Sides::even(1e3, 5.0))];
    let exact = device(pattern.timing(), 0.05);
    let at = |share: f64, seed| {
        let less = Device { damping: share * exact.damping, ..exact };
        drawn(&exact, 0.0, &less, pattern, &spring, 0.0, &mut Dice(seed))
    };
    assert!((0..50).all(|seed| at(1.0, seed) <= 1e-9));
    assert!((0..50).any(|seed| at(0.9, seed) > 0.0));
}

/// A hand that goes to and fro across the edge of a count, by the smallest motion that the samples allow.
#[test]
fn a_dither_across_a_count_draws_nothing_where_friction_holds_it_and_no_more_than_the_bound_elsewhere() {
    let dither = |device: &Device, friction: f64, effect: Effect<f64>, travel: f64| {
        let wheel = Wheel::<f64>::new(device).unwrap();
        let (mut state, mut work) = (wheel.start(), 0.0);
        let (count, period) = (device.count, device.timing.period);
        wheel.step(&mut state, 0.0, &[effect], 0);
        for k in 0..20_000 {
            // In the upper count after even samples: the hand then goes back, with that count's torque.
            let (seen, travel) = if k % 2 == 0 { (count, -travel) } else { (0.0, travel) };
            let torque = wheel.step(&mut state, seen, &[effect], 0).torque;
            work += torque * travel - friction * travel.abs() - device.damping * travel * travel / period;
        }
        work / (20_000.0 * period)
    };
    let timing = Timing::even(1e-3);
    let bare = Device { count: 1e-3, ..device(timing, 0.05) };
    let held = Device { friction: 4.0 * friction_for(&bare), ..bare };
    // The rest of the damping dissipates as much on a wheel at rest speed.
    let most =
        |device: &Device| 0.25 * (device.damping - device.stiffness() * timing.spring_cost()) * REST_SPEED.powi(2);
    let most_drawn = |device: &Device, friction: f64, effect: Effect<f64>| {
        let travels = (1..60).map(|step| 1e-3 * 0.85_f64.powi(step));
        travels.map(|travel| dither(device, friction, effect, travel)).fold(f64::NEG_INFINITY, f64::max)
    };
    let spring = Effect::Spring(Sides::even(1e3, 5.0));
    assert!((held.stiffness() - 0.05 / timing.spring_cost()).abs() < 1e-9 * held.stiffness());
    assert!(most_drawn(&held, friction_for(&bare), spring) <= 1e-12, "the friction of half a count is enough");
    assert!(most_drawn(&held, 0.95 * friction_for(&bare), spring) > 1e-7, "and less is not");
    for effect in [spring, Effect::Damper(Sides::even(0.3, 5.0)), Effect::Friction(Sides::even(2.0, 5.0))] {
        let [by_friction, by_damping] = [held, bare].map(|device| most_drawn(&device, device.friction, effect));
        assert!(by_friction <= 0.0, "{effect:?}: {by_friction} W");
        assert!(by_damping <= most(&bare), "{effect:?}: {by_damping} W of {}", most(&bare));
    }
    assert!(most_drawn(&held, 0.0, spring) > 20.0 * most(&bare), "a bound without counts lets a hand draw more");
}

#[test]
fn a_slow_turn_feels_friction_and_damping_in_full_and_inertia_as_a_mass() {
    let wheel = Wheel::<f64>::new(&device(Timing::even(1e-3), 0.02)).unwrap();
    let after = |effect, travel: fn(f64) -> f64| {
        let mut state = wheel.start();
        (0..1000).map(|k| wheel.step(&mut state, travel(f64::from(k) * 1e-3), &[effect], 0).torque).last().unwrap()
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
    let wheel = Wheel::<f64>::new(&device(Timing::even(1e-3), 0.02)).unwrap();
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
    let wheel = Wheel::<f64>::new(&device(Timing::even(1e-3), 0.02)).unwrap();
    let reason = |effect| wheel.step(&mut wheel.start(), 0.1, &[effect], 0).shortfall;
    assert_eq!(reason(Effect::Spring(Sides::even(40.0, 5.0))), None);
    assert_eq!(reason(Effect::Spring(Sides::even(41.0, 5.0))), Some(Shortfall::Stiffness));
    assert_eq!(reason(Effect::Spring(Sides::even(-1.0, 5.0))), Some(Shortfall::Drives));
    assert_eq!(reason(Effect::Torque(6.0)), Some(Shortfall::Limit));
}

#[test]
fn a_number_out_of_its_range_is_refused_by_its_name() {
    let good = device(Timing::even(1e-3), 0.02);
    for (bad, name) in [
        (Device { timing: Timing { shortest: 2e-3, ..good.timing }, ..good }, "timing"),
        (Device { damping: -1e-9, ..good }, "damping"),
        (Device { friction: f64::NAN, ..good }, "friction"),
        (Device { count: f64::INFINITY, ..good }, "count"),
        (Device { limit: 0.0, ..good }, "limit"),
    ] {
        assert_eq!(Wheel::<f64>::new(&bad).map(|_| ()), Err(Refused(name)));
    }
    assert!(Wheel::<f64>::new(&good).is_ok());
}
