//! What the hand feels against frequency: closed forms, the dense matrices, limits and laws.

use std::f64::consts::{PI, TAU};

use hapt_analysis::impedance::rendered::{Element, Nominal, TOLERANCE};
use hapt_analysis::{Continuous, Elements, Impedance, Slopes, required_damping};
use hapt_model::{Coupling, End, EstimatorKind, Law, Method, Output, Side, World};
use hapt_testing::prelude::*;
use nalgebra::{Complex, DMatrix};

use crate::common::*;

type C = Complex<f64>;

fn world(bench: Bench, method: Method, period: f64) -> World {
    bench.world(method, Output::End, period)
}

fn plain(couplings: Vec<Coupling>, period: f64) -> World {
    world(Bench::of(couplings), Method::Zoh, period)
}

fn felt(world: &World) -> Impedance {
    Impedance::new(world, &Slopes::Steep).unwrap()
}

fn impedance(of: Option<Elements>, hz: f64) -> C {
    let of = of.unwrap();
    C::new(of.stiffness, TAU * hz * of.damping)
}

fn rendered(world: &World, hz: f64) -> C {
    impedance(felt(world).row(hz).rendered, hz)
}

fn near(found: C, wanted: C, relative: f64) {
    assert!((found - wanted).norm() <= relative * wanted.norm(), "{found} is not {wanted}");
}

/// The fundamental of a held signal: sinc(φ/2) e^{-jφ/2}.
fn hold(phi: f64) -> C {
    C::from_polar((0.5 * phi).sin() / (0.5 * phi), -0.5 * phi)
}

fn only(nominal: &[Nominal]) -> Nominal {
    assert_eq!(nominal.len(), 1, "{nominal:?}");
    nominal[0]
}

proptest! {
    #![proptest_config(hapt_testing::cases(256))]

    #[test]
    fn a_spring_is_felt_through_the_hold_and_late(k in 0.1..100.0f64, part in 1e-6..1.0f64, delay in 0.0..3.0f64) {
        let period = 1e-3;
        let mut world = plain(vec![spring(End::Puck, End::Ground, k)], period);
        world.sampling.delay = hapt_model::Delay::Seconds(delay * period);
        let phi = PI * part;
        near(rendered(&world, part * 500.0), k * hold(phi) * C::from_polar(1.0, -delay * phi), 1e-12);
    }

    #[test]
    fn a_damper_is_felt_by_the_velocity_it_is_given(b in 1e-4..1.0f64, part in 1e-6..1.0f64, cutoff in 1.0..1e3f64) {
        let (period, hz) = (1e-3, part * 500.0);
        let phi = PI * part;
        let mut world = plain(vec![damper(End::Ground, End::Puck, b)], period);
        let step = C::new(0.0, 1.0) * 2.0 * (0.5 * phi).sin() * C::from_polar(1.0, -0.5 * phi);
        near(rendered(&world, hz), b * step / period * hold(phi), 1e-12);
        let tau = 1.0 / (TAU * cutoff);
        world.sampling.estimator = EstimatorKind::LowPass;
        world.sampling.cutoff = Some(cutoff);
        let filter = (tau + period) * (1.0 - tau / (tau + period) * C::from_polar(1.0, -phi));
        near(rendered(&world, hz), b * step / filter * hold(phi), 1e-9);
        world.sampling.estimator = EstimatorKind::Exact;
        near(rendered(&world, hz), b * C::new(0.0, TAU * hz) * hold(phi), 1e-12);
    }

    #[test]
    fn a_wheel_on_a_spring_is_felt_as_a_spring_and_a_mass_in_series(k in 0.1..100.0f64, j in 1e-4..1.0f64, ratio in 1e-3..0.99f64) {
        let wheel = Bench { bodies: vec![body(j)], couplings: vec![spring(End::Puck, End::Body(0), k)] };
        let world = world(wheel, Method::Zoh, 1e-5 * (j / k).sqrt());
        let omega = ratio * (k / j).sqrt();
        let mass = -omega * omega * j;
        let row = felt(&world).row(omega / TAU);
        near(impedance(row.ideal, row.frequency_hz), C::from(k * mass / (k + mass)), 1e-10);
        let is = row.ideal.unwrap();
        prop_assert!((is.inertia / (j / (1.0 - ratio * ratio)) - 1.0).abs() < 1e-10);
        prop_assert!((is.stiffness / (-is.inertia * omega * omega) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn the_ideal_is_what_the_bodies_matrix_leaves_to_the_puck(bench in worlds(Dampers::Mixed, true), log in -2.0..2.0f64) {
        let period = 1e-3;
        let omega = 10f64.powf(log) * fastest(&bench).min(1e3);
        let world = world(bench, Method::Zoh, period);
        let n = world.bodies.len();
        let continuous = Continuous::new(&world.bodies, &world.couplings, &Slopes::Steep).unwrap();
        let (k, c) = (&continuous.stiffness, continuous.damping(period));
        let all = DMatrix::from_fn(n + 1, n + 1, |i, j| {
            let own = if i == j && i < n { omega * omega * continuous.inertia[i] } else { 0.0 };
            C::new(k[(i, j)] - own, omega * c[(i, j)])
        });
        let bodies = all.view((0, 0), (n, n)).into_owned();
        let column = all.view((0, n), (n, 1)).into_owned();
        let solved = bodies.lu().solve(&column).unwrap();
        let wanted = all[(n, n)] - (column.transpose() * solved)[0];
        let scale = felt(&world).at_puck();
        // Near a resonance, and with large springs, the dense matrix has no more digits.
        prop_assume!(wanted.norm() < 1e3 * (scale[0] + omega * scale[1]));
        let row = felt(&world).row(omega / TAU);
        let found = impedance(row.ideal, row.frequency_hz);
        prop_assert!((found - wanted).norm() <= 1e-6 * (wanted.norm() + scale[0] + omega * scale[1]), "{found} {wanted}");
    }

    /// The hold shifts by half a sample, the methods err by T or less.
    #[test]
    fn rendered_goes_to_ideal_as_the_period_goes_to_zero(zeta in 0.01..1.0f64, at in 0.1..3.0f64, method in 0..8usize) {
        let bench = oscillator(1.0, zeta);
        let error = |period: f64| {
            let row = felt(&world(bench.clone(), Method::ALL[method], period)).row(at / TAU);
            (impedance(row.rendered, row.frequency_hz) - impedance(row.ideal, row.frequency_hz)).norm()
                / impedance(row.ideal, row.frequency_hz).norm()
        };
        let [long, short] = [2e-4, 1e-4].map(error);
        prop_assert!(long < 0.1, "{long}");
        // A first order may vanish, and then the second counts.
        prop_assert!(short < 0.55 * long && short > 0.2 * long || short < 1e-7, "{long} {short}");
    }

    /// A passive loop never gives energy to a hand that swings: the damping of loop and device together is nowhere below 0.
    #[test]
    fn a_device_that_makes_the_loop_passive_is_felt_to_damp_at_every_frequency(
        bench in worlds(Dampers::Mixed, true), method in 0..8usize, log in -4.0..-2.0f64, ahead in 0..3u32,
    ) {
        let mut world = world(bench, Method::ALL[method], 10f64.powf(log));
        if world.sampling.output == Output::End {
            world.sampling.advance = ahead;
            world.sampling.delay = hapt_model::Delay::Seconds(f64::from(ahead) * world.sampling.period);
        }
        let Ok(Some(required)) = required_damping(&world) else { return Ok(()) };
        world.device.damping = required;
        let felt = felt(&world);
        for row in felt.rows(felt.low_hz(), felt.nyquist_hz(), 60) {
            let Some(whole) = row.whole else { continue };
            let [k, b] = felt.at_puck();
            // Near an undamped resonance, to a billionth of what is felt.
            let size = row.rendered.unwrap().stiffness.abs().max(k) / (TAU * row.frequency_hz);
            let rounding = 1e-9 * (required + k * world.sampling.period + b + size);
            prop_assert!(whole.damping >= -rounding, "{} at {} Hz", whole.damping, row.frequency_hz);
        }
    }

    /// From there on it is off, and nowhere below is it off for long.
    #[test]
    fn it_departs_where_it_says_and_nowhere_below(bench in worlds(Dampers::Mixed, false), log in -4.0..-2.0f64, method in 0..8usize) {
        let world = world(bench, Method::ALL[method], 10f64.powf(log));
        let felt = felt(&world);
        for nominal in felt.nominal() {
            let off = |hz: f64, ideal: bool| {
                let row = felt.row(hz);
                let (is, ideally) = (row.rendered?, row.ideal?);
                let unit = match nominal.element {
                    Element::Stiffness => 1.0,
                    Element::Damping => TAU * hz,
                    Element::Inertia => -(TAU * hz).powi(2),
                };
                let part = |k: C| if nominal.element == Element::Damping { k.im } else { k.re };
                let (is, ideally) = (impedance(Some(is), hz), impedance(Some(ideally), hz));
                let (wanted, size) = if ideal { (part(ideally), ideally.norm()) } else { (nominal.value * unit, (nominal.value * unit).abs()) };
                Some((part(is) - wanted).abs() / size)
            };
            for (from, ideal) in [(nominal.from_nominal_hz, false), (nominal.from_ideal_hz, true)] {
                let is_off = |hz: f64| off(hz, ideal).is_some_and(|off| off > TOLERANCE + 1e-6);
                if let Some(from) = from {
                    prop_assert!(off(from, ideal).is_none_or(|off| off >= TOLERANCE - 1e-6), "{nominal:?} {:?}", off(from, ideal));
                    // Between two sampled points it may depart briefly.
                    let above = (0..20).map(|i| from * (1.0 + 5e-4 * f64::from(i))).filter(|hz| *hz <= felt.nyquist_hz());
                    let above: Vec<bool> = above.map(|hz| off(hz, ideal).is_some_and(|off| off > TOLERANCE - 1e-6)).collect();
                    prop_assert!(2 * above.iter().filter(|off| **off).count() > above.len() - 2, "{nominal:?}");
                }
                let mut hz = 0.1 * felt.low_hz();
                let mut begun = None;
                while hz < from.unwrap_or(felt.nyquist_hz()) * (1.0 - 1e-9) {
                    begun = is_off(hz).then(|| begun.unwrap_or(hz));
                    prop_assert!(begun.is_none_or(|begun| hz < 1.03 * begun), "{nominal:?} {hz}");
                    hz *= 1.001;
                }
            }
        }
    }
}

#[test]
fn the_notes_wheel_is_felt_as_its_inertia_to_three_tenths_of_its_resonance() {
    // m = J/(1 - (ω/ω₀)²) is 1.1 J at ω₀/√11.
    let (omega, period) = (TAU, 1e-3);
    let world = world(oscillator(omega, 0.0), Method::Zoh, period);
    let felt = felt(&world);
    let nominal = only(&felt.nominal());
    assert_eq!((nominal.element, nominal.value), (Element::Inertia, 1.0));
    assert!((nominal.from_nominal_hz.unwrap() * 11f64.sqrt() - 1.0).abs() < 1e-4, "{nominal:?}");
    // Above the resonance there is the spring, through the hold: Re K = k sin φ/φ at the start of a step.
    let ideal = nominal.from_ideal_hz.unwrap();
    assert!(ideal > 10.0, "{nominal:?}");
    let resonance = felt.resonances();
    assert_eq!(resonance.len(), 1);
    assert!((resonance[0].frequency_hz - 1.0).abs() < 1e-12 && resonance[0].damping_ratio == 0.0, "{resonance:?}");
    let there = felt.row(1.0);
    assert_eq!((there.rendered, there.ideal, there.whole), (None, None, None));
    assert!(felt.row(0.999).rendered.is_some());
}

#[test]
fn a_spring_to_ground_is_felt_until_the_hold_has_turned_it() {
    let world = plain(vec![spring(End::Puck, End::Ground, 3.0)], 1e-3);
    let nominal = only(&felt(&world).nominal());
    assert_eq!((nominal.element, nominal.value), (Element::Stiffness, 3.0));
    assert_eq!(nominal.from_nominal_hz, nominal.from_ideal_hz);
    // sin φ/φ = 0.9
    let phi = TAU * nominal.from_nominal_hz.unwrap() * 1e-3;
    assert!((phi.sin() / phi - 0.9).abs() < 1e-12);
}

#[test]
fn a_hold_takes_half_a_sample_of_stiffness_from_the_damping() {
    // Im K/ω → -KT/2 - K delay.
    let mut world = plain(vec![spring(End::Puck, End::Ground, 3.0)], 1e-3);
    world.sampling.delay = hapt_model::Delay::Seconds(0.4e-3);
    let row = felt(&world).row(1e-3);
    assert!((row.rendered.unwrap().damping / (-3.0 * 0.9e-3) - 1.0).abs() < 1e-9);
    let whole = row.whole.unwrap();
    assert_eq!(whole.damping, row.rendered.unwrap().damping + 1.2e-3);
    assert_eq!(whole.inertia, row.rendered.unwrap().inertia + 6.4e-4);
}

#[test]
fn what_is_asked_follows_the_way_to_ground() {
    let (puck, ground, one, two) = (End::Puck, End::Ground, End::Body(0), End::Body(1));
    let nominal = |couplings: Vec<Coupling>| {
        let bench = Bench { bodies: vec![body(0.02), body(0.03)], couplings };
        let found = felt(&world(bench, Method::Zoh, 1e-3)).nominal();
        found.into_iter().map(|a| (a.element, a.value)).collect::<Vec<_>>()
    };
    let close = |found: Vec<(Element, f64)>, wanted: &[(Element, f64)]| {
        assert_eq!(found.len(), wanted.len(), "{found:?}");
        for (found, wanted) in found.iter().zip(wanted) {
            assert!(found.0 == wanted.0 && (found.1 / wanted.1 - 1.0).abs() < 1e-12, "{found:?} {wanted:?}");
        }
    };
    use Element::{Damping, Inertia, Stiffness};
    // Both are carried along.
    close(nominal(vec![spring(puck, one, 1.0), spring(one, two, 1.0)]), &[(Inertia, 0.05)]);
    close(nominal(vec![spring(puck, one, 1.0), damper(one, two, 1.0)]), &[(Inertia, 0.05)]);
    close(nominal(vec![spring(puck, one, 1.0)]), &[(Inertia, 0.02)]);
    // Springs in series, a body on the way, another on a side.
    let couplings = vec![spring(puck, one, 1.0), spring(one, ground, 3.0), spring(one, two, 2.0)];
    close(nominal(couplings), &[(Stiffness, 0.75)]);
    // Dampers in series; the second body is no longer carried.
    let couplings = vec![damper(puck, one, 1.0), damper(one, ground, 3.0), spring(one, two, 2.0)];
    close(nominal(couplings), &[(Damping, 0.75)]);
    close(nominal(vec![spring(puck, one, 1.0), damper(ground, one, 0.3)]), &[(Damping, 0.3), (Inertia, 0.02)]);
    // Behind a body that a spring holds.
    let couplings = vec![spring(puck, one, 1.0), damper(one, two, 0.5), spring(two, ground, 3.0)];
    close(nominal(couplings), &[(Damping, 0.5), (Inertia, 0.02)]);
    close(nominal(vec![spring(one, ground, 1.0)]), &[]);
}

#[test]
fn a_wall_is_felt_touched_or_not_at_all() {
    let law = Law::Wall { side: Side::Above, at: 0.5, stiffness: 2.0, damping: 0.0 };
    let world = plain(vec![Coupling { first: End::Puck, second: End::Ground, law, limit: None }], 1e-3);
    let at = |slopes: Slopes| Impedance::new(&world, &slopes).unwrap();
    assert!((at(Slopes::Steep).row(1.0).rendered.unwrap().stiffness - 2.0).abs() < 1e-4);
    let flat = at(Slopes::Flat);
    assert_eq!(flat.row(1.0).rendered.unwrap(), Elements { stiffness: 0.0, damping: 0.0, inertia: 0.0 });
    assert!(flat.nominal().is_empty());
    assert_eq!(flat.row(1.0).whole.unwrap().inertia, 6.4e-4);
}

#[test]
fn a_compensating_damper_is_no_part_of_what_forward_euler_is_asked_for() {
    let mut bench = oscillator(TAU, 0.0);
    bench.couplings.push(compensator(End::Body(0), End::Puck));
    let ideal = |method| felt(&world(bench.clone(), method, 1e-3)).row(1.5).ideal.unwrap().damping;
    assert_eq!(ideal(Method::ForwardEuler), 0.0);
    assert!(ideal(Method::Zoh) > 0.0);
}

#[test]
fn rows_run_from_the_first_frequency_to_the_last() {
    let felt = felt(&plain(vec![spring(End::Puck, End::Ground, 3.0)], 1e-3));
    let rows = felt.rows(0.5, 500.0, 4);
    let hz: Vec<f64> = rows.iter().map(|row| row.frequency_hz).collect();
    assert_eq!((hz[0], hz[3], hz.len()), (0.5, 500.0, 4));
    assert!((hz[1] / 5.0 - 1.0).abs() < 1e-12 && (hz[2] / 50.0 - 1.0).abs() < 1e-12);
    assert_eq!(felt.rows(2.0, 500.0, 1)[0].frequency_hz, 2.0);
    assert!(rows.iter().all(|row| row.rendered.is_some()));
}
