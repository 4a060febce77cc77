//! The computed impedance, and the shipped loop under a hand that swings: the fundamental of the motor's
//! torque over whole periods of the hand.

use std::f64::consts::{PI, TAU};

use crate::common::*;
use hapt_analysis::{Impedance, Slopes, held_growth};
use hapt_model::*;
use hapt_testing::prelude::*;
use nalgebra::Complex;

type C = Complex<f64>;

/// The number of samples that hold a whole number of the hand's periods.
const SAMPLES: u64 = 600;

/// Σ ∫ torque e^{-jωt} over the last [`SAMPLES`] of `rows`, over that of the position; the motor's change lies `part` of a sample
/// after t_k, from where on it holds what the next row shows.
fn fundamental(world: &World, swings: u64, settle: u64) -> C {
    let period = world.sampling.period;
    let frequency = swings as f64 / (SAMPLES as f64 * period);
    let omega = TAU * frequency;
    let sine = Drive::Position(Shape::Sine { amplitude: 1.0, frequency, phase: 0.0 });
    let rows = rows(world, &scenario((settle + SAMPLES) as f64 * period, sine, None));
    let ratio = world.sampling.delay_s() / period;
    let part = ratio - (ratio + 1e-6).floor();
    let part = if part < 1e-6 { 0.0 } else { part };
    // ∫ e^{-jωt} dt from a to b, in samples.
    let integral = |a: f64, b: f64| {
        let (a, b) = (a * omega * period, b * omega * period);
        C::from_polar(2.0 * (0.5 * (b - a)).sin() / omega, -0.5 * (a + b))
    };
    let torque = (settle..settle + SAMPLES).fold(C::from(0.0), |sum, k| {
        let (t, at) = (k as f64, k as usize);
        let (before, after) =
            if part > 0.0 { (rows[at].applied, rows[at + 1].applied) } else { (0.0, rows[at].applied) };
        sum + before * integral(t, t + part) + after * integral(t + part, t + 1.0)
    });
    // sin ωt is -j e^{jωt}/2 and its mirror.
    let position = C::new(0.0, -0.5) * (SAMPLES as f64 * period);
    -torque / position
}

/// A world whose every body comes to rest by itself.
fn damped() -> impl Strategy<Value = World> {
    let body = (-1.2..-0.2f64, 0.05..0.8f64, 0.05..0.8f64, 0..3usize);
    (prop::collection::vec(body, 0..4), (0.1..50.0f64, 0.0..0.02f64), 0..8usize, 0..3usize, 0..6usize, 0..6u32)
        .prop_map(|(bodies, (stiffness, damping), method, output, estimator, delay)| {
            let mut world = bare();
            let period = world.sampling.period;
            world.couplings = vec![
                spring(End::Puck, End::Ground, stiffness),
                Coupling {
                    first: End::Ground,
                    second: End::Puck,
                    law: Law::Damper { damping: Damping::Fixed(damping) },
                    limit: None,
                },
            ];
            for (i, (angle, ratio, coupled, chosen)) in bodies.into_iter().enumerate() {
                // A frequency of some tenths of a radian per sample.
                let omega = 10f64.powf(angle) / period;
                let inertia = 1e-3 * (1.0 + i as f64);
                let to = if i == 0 || chosen == 0 { End::Puck } else { End::Body(chosen.min(i) - 1) };
                let damper = |first, second, part: f64| Coupling {
                    first,
                    second,
                    law: Law::Damper { damping: Damping::Fixed(part * omega * inertia) },
                    limit: None,
                };
                world.names.push(format!("body{i}"));
                world.bodies.push(Body { inertia, position: 0.0, velocity: 0.0 });
                world.couplings.push(spring(to, End::Body(i), 0.3 * omega * omega * inertia));
                world.couplings.push(damper(End::Body(i), to, coupled));
                world.couplings.push(damper(End::Body(i), End::Ground, ratio));
            }
            let sampling = &mut world.sampling;
            sampling.method = Method::ALL[method];
            sampling.output =
                if sampling.method.takes_new_sample_first() { Output::Start } else { Output::ALL[output] };
            // On an ideal encoder both kinds of FOAW are the difference, and so is Levant's within its acceleration.
            sampling.estimator = [
                EstimatorKind::Exact,
                EstimatorKind::Difference,
                EstimatorKind::LowPass,
                EstimatorKind::Foaw,
                EstimatorKind::Kalman,
                EstimatorKind::Levant,
            ][estimator];
            (sampling.cutoff, sampling.acceleration) = (Some(80.0), Some(1e9));
            sampling.delay = hapt_model::Delay::Seconds(0.35 * f64::from(delay) * period);
            if delay == 5 {
                sampling.delay = hapt_model::Delay::Seconds(2.0 * period);
                sampling.advance = if sampling.output == Output::End { 2 } else { 0 };
            }
            world
        })
}

proptest! {
    #![proptest_config(hapt_testing::cases(300))]

    #[test]
    fn the_torque_on_a_swinging_hand_is_that_of_the_computed_impedance(world in damped(), swings in 1..SAMPLES / 2) {
        let sampling = &world.sampling;
        let growth = held_growth(&world.bodies, &world.couplings, sampling.method, sampling.period).unwrap();
        // In samples: the decay of the initial state over 18 digits, and that of the low-pass.
        let settle = growth.map_or(0.0, |growth| -40.0 / (growth * sampling.period)) + 200.0;
        prop_assume!(growth.is_none_or(|growth| growth < 0.0) && settle < 2e4);
        let found = fundamental(&world, swings, settle as u64);
        let felt = Impedance::new(&world, &Slopes::Flat).unwrap();
        let hz = swings as f64 / (SAMPLES as f64 * sampling.period);
        let wanted = felt.row(hz).rendered.unwrap();
        let wanted = C::new(wanted.stiffness, TAU * hz * wanted.damping);
        let [k, b] = felt.at_puck();
        let size = wanted.norm() + 1e-3 * (k + TAU * hz * b);
        prop_assert!((found - wanted).norm() < 1e-9 * size, "{found} {wanted}");
    }
}

/// The encoder's counts are left out; they are small compared with a motion of many counts.
#[test]
fn foaw_on_an_ideal_encoder_is_the_difference() {
    let mut world = bare();
    world.couplings = vec![Coupling {
        first: End::Puck,
        second: End::Ground,
        law: Law::Damper { damping: Damping::Fixed(0.01) },
        limit: None,
    }];
    world.sampling.estimator = EstimatorKind::Foaw;
    let felt = Impedance::new(&world, &Slopes::Flat).unwrap();
    let hz = 7.0 / (SAMPLES as f64 * world.sampling.period);
    let wanted = felt.row(hz).rendered.unwrap();
    let found = fundamental(&world, 7, 100);
    assert!((found - C::new(wanted.stiffness, TAU * hz * wanted.damping)).norm() < 1e-12, "{found}");
    // By half a sample of its own and half of the hold.
    let phi = PI * hz / felt.nyquist_hz();
    assert!((found.arg() - (0.5 * PI - phi)).abs() < 1e-12);
}
