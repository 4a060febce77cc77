//! The free loop: against the real loop on an exact puck, against the laws of the field, and its structure.
#![allow(clippy::needless_range_loop)] // Rows and columns, as on paper.

use std::f64::consts::TAU;

use hapt_analysis::{Grip, Stability, Verdict, eigenvalues, free, gripped_growth};
use hapt_core::{Loop, Puck, Spec};
use hapt_model::{Coupling, Damping, End, Estimator, EstimatorKind, Law, Method, Output, Side, World};
use hapt_testing::prelude::*;
use nalgebra::{Complex, DMatrix, Matrix3, Vector3};

use crate::common::*;

const ROOM: usize = 8;
type Room = Loop<f64, ROOM, 32, 2>;

fn world(bench: &Bench, method: Method, output: Output, period: f64) -> World {
    let mut world = bench.world(method, output, period);
    world.sampling.estimator = EstimatorKind::Exact;
    world
}

const STIFFNESS: f64 = 1.018592;
const WHEEL: f64 = 0.02580123;

/// The notes' wheel on its spring.
fn notes() -> Bench {
    Bench { bodies: vec![body(WHEEL)], couplings: vec![spring(End::Puck, End::Body(0), STIFFNESS)] }
}

/// A spring from the puck to ground.
fn to_ground(stiffness: f64) -> Bench {
    Bench { bodies: vec![], couplings: vec![spring(End::Puck, End::Ground, stiffness)] }
}

/// The real loop and the exact puck, one sample at a time, from a state that the test sets.
struct Brute {
    core: Room,
    first: bool,
    every: u32,
    filters: bool,
    bodies: usize,
    estimator: (EstimatorKind, f64, usize),
    period: f64,
    /// exp of the puck's equations over the delay's part of a period and over the rest of it, and whole samples of the delay.
    parts: Vec<DMatrix<f64>>,
    samples: usize,
    scale: Vec<f64>,
}

impl Brute {
    fn new(world: &World) -> Self {
        Brute::gripped(world, &Grip::default())
    }

    /// With a hand on the puck.
    fn gripped(world: &World, grip: &Grip) -> Self {
        let sampling = &world.sampling;
        let period = sampling.period;
        let (j, b, k) = (world.device.inertia + grip.inertia, world.device.damping + grip.damping, grip.stiffness);
        let spec = Spec { estimator: Estimator::Exact, count: None, limit: None, levels: None, ..world.spec() };
        let ratio = sampling.delay_s() / period;
        let near = (ratio - ratio.round()).abs() <= 1e-6;
        let samples = if near { ratio.round() } else { ratio.floor() };
        let equations = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, -k / j, -b / j, 1.0 / j, 0.0, 0.0, 0.0]);
        let over = |h: f64| (&equations * h).exp();
        let part = (ratio - samples) * period;
        let parts = if near { vec![over(period)] } else { vec![over(part), over(period - part)] };
        let window = match sampling.estimator {
            EstimatorKind::Foaw | EstimatorKind::FoawBest => sampling.window as usize,
            EstimatorKind::Difference => sampling.every as usize,
            // The last position, the filter's, and T² times its acceleration.
            EstimatorKind::Kalman => 3,
            EstimatorKind::Exact | EstimatorKind::LowPass | EstimatorKind::Levant => 1,
        };
        let n = world.bodies.len();
        let samples = samples as usize;
        // Units in which entries are comparable: positions 1, velocities 1/T, torques J/T².
        let mut scale = vec![1.0, 1.0 / period];
        scale.extend(vec![1.0; n]);
        scale.extend(vec![1.0 / period; n + 1]);
        scale.extend(vec![1.0; window + 1]);
        scale.extend(vec![j / period / period; samples + usize::from(!near)]);
        Brute {
            core: Room::new(&spec).unwrap(),
            first: sampling.method.takes_new_sample_first(),
            every: sampling.bodies_every,
            filters: sampling.filter.is_some(),
            bodies: n,
            estimator: (sampling.estimator, sampling.cutoff.unwrap_or(1.0), window),
            period,
            parts,
            samples,
            scale,
        }
    }

    fn velocity(&self, z: f64, exact: f64, last: f64, older: &[f64]) -> f64 {
        let t = self.period;
        let (kind, cutoff, n) = self.estimator;
        match kind {
            EstimatorKind::Exact => exact,
            EstimatorKind::Difference => (z - older[n - 1]) / (n as f64 * t),
            EstimatorKind::Levant => (z - older[0]) / t,
            EstimatorKind::Kalman => {
                let error = z - older[1] - t * last - 0.5 * older[2];
                last + (older[2] + kalman(TAU * cutoff * t)[1] * error) / t
            }
            EstimatorKind::LowPass => {
                let tau = 1.0 / (TAU * cutoff);
                (tau * last + z - older[0]) / (tau + t)
            }
            EstimatorKind::Foaw => (z - older[n - 1]) / (n as f64 * t),
            EstimatorKind::FoawBest => {
                let line = |i: usize| if i == 0 { z } else { older[i - 1] };
                let mean = 0.5 * n as f64;
                let (mut sum, mut square) = (0.0, 0.0);
                for i in 0..=n {
                    sum += (mean - i as f64) * line(i);
                    square += (mean - i as f64).powi(2);
                }
                sum / square / t
            }
        }
    }

    /// (z, ż, w, ẇ, last velocity, last filtered z, older z, commands in flight), newest first, after a step of the bodies.
    fn step(&self, s: &[f64]) -> Vec<f64> {
        let (n, window) = (self.bodies, self.estimator.2);
        let mut puck = (s[0], s[1]);
        let (w, rest) = s[2..].split_at(n);
        let (dw, rest) = rest.split_at(n);
        let (last, rest) = rest.split_at(1);
        let (filtered, rest) = rest.split_at(1);
        let (older, flight) = rest.split_at(window);
        let (mut last, mut older, mut flight) = (last[0], older.to_vec(), flight.to_vec());
        let mut state = self.core.start();
        state.now.position[..n].copy_from_slice(w);
        state.now.velocity[..n].copy_from_slice(dw);
        state.memory.last = Some(Puck { position: older[0], velocity: last });
        state.memory.filtered = filtered[0];
        for _ in 0..self.every {
            let before = last;
            last = self.velocity(puck.0, puck.1, last, &older);
            let command = self.core.step(&mut state, puck.0, last).command;
            if let (EstimatorKind::Kalman, cutoff, _) = self.estimator {
                let predicted = older[1] + self.period * before + 0.5 * older[2];
                let [a, _, c] = kalman(TAU * cutoff * self.period);
                let error = puck.0 - predicted;
                older = vec![puck.0, predicted + a * error, older[2] + c * error];
            } else {
                older.insert(0, puck.0);
                older.pop();
            }
            flight.insert(0, command);
            let ages = if self.parts.len() == 2 { vec![self.samples + 1, self.samples] } else { vec![self.samples] };
            for (part, age) in self.parts.iter().zip(ages) {
                let at = |i: usize| part[(i, 0)] * puck.0 + part[(i, 1)] * puck.1 + part[(i, 2)] * flight[age];
                puck = (at(0), at(1));
            }
            flight.pop();
        }
        if !self.first {
            let change = state.change;
            (0..n).for_each(|i| {
                state.now.position[i] += change.position[i];
                state.now.velocity[i] += change.velocity[i];
            });
        }
        let mut next = vec![puck.0, puck.1];
        next.extend_from_slice(&state.now.position[..n]);
        next.extend_from_slice(&state.now.velocity[..n]);
        next.push(last);
        next.push(if self.filters { state.memory.filtered } else { 0.0 });
        next.extend(older);
        next.extend(flight);
        next
    }

    /// The map of a step of the bodies less 1, column by column, in units in which its entries are comparable.
    fn map(&self) -> DMatrix<f64> {
        let n = self.scale.len();
        let mut map = DMatrix::zeros(n, n);
        for j in 0..n {
            let mut s = vec![0.0; n];
            s[j] = self.scale[j];
            let next = self.step(&s);
            for i in 0..n {
                map[(i, j)] = (next[i] - s[i]) / self.scale[i];
            }
        }
        map
    }
}

/// The gains of the steady Kalman filter at x = 2π cutoff T, by the Riccati equation step by step: q T⁵/R = x⁶.
fn kalman(x: f64) -> [f64; 3] {
    let a = Matrix3::new(1.0, 1.0, 0.5, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0);
    let q = Matrix3::new(0.05, 0.125, 1.0 / 6.0, 0.125, 1.0 / 3.0, 0.5, 1.0 / 6.0, 0.5, 1.0) * x.powi(6);
    let (mut p, mut gain) = (q + Matrix3::identity(), Vector3::zeros());
    for _ in 0..(100.0 / x) as usize + 100 {
        let ahead = a * p * a.transpose() + q;
        gain = ahead.column(0) / (ahead[(0, 0)] + 1.0);
        p = ahead - gain * ahead.row(0);
        p = 0.5 * (p + p.transpose());
    }
    gain.into()
}

proptest! {
    /// The gains in closed form are those to which the Riccati equation settles.
    #[test]
    fn the_kalman_filter_is_the_steady_one_of_white_jerk(x in log_uniform(-2.0..1.5)) {
        for (found, expected) in hapt_model::kalman_gains(x).into_iter().zip(kalman(x)) {
            prop_assert!((found / expected - 1.0).abs() < 1e-9 + 1e-16 / x.powi(4), "{x}: {found} {expected}");
        }
    }
}

/// For a short period the filter is Butterworth's of third order, whose poles lie on a circle: the gains go to 2x, 2x², x³, at a long one to
/// those of positions without noise.
#[test]
fn the_gains_have_their_limits() {
    for x in [1e-9, 1e-6, 1e-4] {
        let limits = [2.0 * x, 2.0 * x * x, x * x * x];
        for (found, limit) in hapt_model::kalman_gains(x).into_iter().zip(limits) {
            assert!((found / limit - 1.0).abs() < 2.0 * x, "{x}: {found} {limit}");
        }
    }
    let most = hapt_model::kalman_gains(f64::INFINITY);
    assert_eq!(most, hapt_model::kalman_gains(1e7));
    assert!((most[0] - 1.0).abs() < 1e-12 && most[1] > 1.0 && most[2] > 1.0, "{most:?}");
}

/// All of `found`'s eigenvalues are eigenvalues of the real loop's map, and there are no others.
fn agrees(found: &Stability, map: &DMatrix<f64>, what: &str) -> Result<(), TestCaseError> {
    let n = map.nrows();
    prop_assert!(found.eigenvalues.len() <= n, "{what}");
    let complex = map.map(|x| Complex::new(x, 0.0));
    let size = map.norm().max(1.0);
    for value in &found.eigenvalues {
        let less_one = Complex::new(value.re - 1.0, value.im);
        let least = (&complex - DMatrix::from_diagonal_element(n, n, less_one)).svd(false, false).singular_values.min();
        prop_assert!(least < 1e-12 * size * size, "{what}: {value:?} is none of the loop's, by {least:e}, {size:e}");
    }
    let gone = (n - found.eigenvalues.len()) as f64;
    let mut power = map.clone();
    for k in 1..=4 {
        let sum: Complex<f64> = found.eigenvalues.iter().map(|v| Complex::new(v.re - 1.0, v.im).powi(k)).sum();
        let sum = sum + gone * (-1f64).powi(k);
        let error = (sum - power.trace()).norm();
        prop_assert!(error < 1e-10 * size.powi(k), "{what}: traces of power {k} differ by {error:e}");
        power *= map;
    }
    Ok(())
}

fn log_uniform(decades: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    decades.prop_map(|d| 10f64.powf(d))
}

/// Random worlds with ties at the puck and a random loop around them.
fn loops() -> impl Strategy<Value = World> {
    let bench = (worlds(Dampers::Mixed, true), 0..4u8, log_uniform(-1.0..2.0), log_uniform(-4.0..-1.0));
    let device = (log_uniform(-4.0..-2.0), prop_oneof![Just(0.0), log_uniform(-4.0..-1.0)]);
    let sampling = (
        0..8usize,
        0..3usize,
        0..EstimatorKind::ALL.len(),
        0..4u8,
        0.0..4.0f64,
        log_uniform(-3.0..0.0),
        1..5u32,
        (0..4u32, prop_oneof![2 => Just(1), 1 => 2..8u32]),
    );
    (bench, device, sampling).prop_map(
        |(
            (mut bench, tie, k, b),
            (inertia, damping),
            (method, output, estimator, delay, periods, x, window, (advance, every)),
        )| {
            if tie % 2 == 1 {
                bench.couplings.push(spring(End::Ground, End::Puck, k));
            }
            if tie >= 2 {
                bench.couplings.push(damper(End::Puck, End::Ground, b));
            }
            let at_puck: f64 = bench
                .couplings
                .iter()
                .filter(|c| c.first == End::Puck || c.second == End::Puck)
                .map(|c| if let Law::Spring { stiffness, .. } = c.law { stiffness } else { 0.0 })
                .sum();
            // Where a damper stops its body within a small part of the period, the two derivations part by rounding.
            let damped = |c: &Coupling| if let Law::Damper { damping: Damping::Fixed(b) } = c.law { b } else { 0.0 };
            let lightest = bench.bodies.iter().map(|b| b.inertia).fold(inertia, f64::min);
            let most = bench.couplings.iter().map(damped).sum::<f64>() / lightest;
            let period = x / fastest(&bench).max((2.0 * at_puck / inertia).sqrt()).max(1.0).max(0.1 * most);
            let slower = every > 1 && !bench.bodies.is_empty() && !Method::ALL[method].takes_new_sample_first();
            let (every, advance) = if slower { (every, 0) } else { (1, advance) };
            let mut world = world(&bench, Method::ALL[method], Output::ALL[output], period / f64::from(every));
            let period = world.sampling.period;
            world.sampling.bodies_every = every;
            world.device.inertia = inertia;
            world.device.damping = damping;
            let sampling = &mut world.sampling;
            sampling.estimator = EstimatorKind::ALL[estimator];
            sampling.cutoff = Some(0.05 / period);
            (sampling.window, sampling.every) = (window, window);
            sampling.filter = (advance % 2 == 1).then(|| 0.02 * (1.0 + periods) / period);
            sampling.advance = if sampling.output == Output::End { advance } else { 0 };
            sampling.delay = match delay {
                0 => hapt_model::Delay::Seconds(0.0),
                1 => hapt_model::Delay::Samples(periods.floor()),
                _ => hapt_model::Delay::Seconds(periods * period),
            };
            world
        },
    )
}

proptest! {
    #![proptest_config(hapt_testing::cases(80))]

    #[test]
    fn the_real_loop_on_an_exact_puck_has_the_same_eigenvalues(world in loops()) {
        let found = free(&world).unwrap();
        let what = format!("{:?}", world);
        if matches!(world.sampling.estimator, EstimatorKind::Foaw | EstimatorKind::FoawBest) {
            // The worse of the longest and the shortest window counts: one of them agrees.
            let mut short = world.clone();
            short.sampling.window = 1;
            let one = agrees(&found, &Brute::new(&short).map(), &what);
            if one.is_err() {
                agrees(&found, &Brute::new(&world).map(), &what)?;
            }
        } else {
            agrees(&found, &Brute::new(&world).map(), &what)?;
        }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(80))]

    #[test]
    fn the_real_loop_with_a_hand_on_an_exact_puck_grows_as_fast(
        world in loops(), mass in 0.0..10.0f64, swing in log_uniform(-2.0..0.5), damped in 0.0..0.5f64,
    ) {
        // FOAW counts as the worse of two windows: here it has one.
        let mut world = world;
        world.sampling.window = 1;
        let inertia = mass * world.device.inertia;
        let (total, omega) = (inertia + world.device.inertia, swing / world.sampling.period);
        let grip = Grip { inertia, damping: damped * total * omega, stiffness: total * omega * omega };
        let found = gripped_growth(&world, &grip).unwrap();
        let map = Brute::gripped(&world, &grip).map();
        // A double eigenvalue 1, a body that nothing holds, splits by √eps.
        let near = 1e-5 * map.norm();
        let values = eigenvalues(&map).unwrap();
        let most = values.iter().filter(|mu| mu.norm() > near).map(|mu| (mu + 1.0).norm()).fold(0.0, f64::max);
        let radius = found.map_or(0.0, |g| (g * world.sampling.step()).exp());
        let size = map.norm().max(1.0);
        let slow = (radius - 1.0).abs() < 2.0 * near;
        prop_assert!((radius - most).abs() < 1e-7 * size || (slow && most < 1.0 + 2.0 * near), "{radius} {most}: {world:?} {grip:?}");
    }
}

/// The same world at another period, the delay staying in s.
fn at(world: &World, period: f64) -> Stability {
    let mut world = world.clone();
    world.sampling.period = period;
    free(&world).unwrap()
}

fn grows(found: &Stability) -> f64 {
    found.growth_per_s.unwrap_or(f64::NEG_INFINITY)
}

/// Growth that counts as none: below the resolution of a verdict, or a few eps of λ a sample.
fn nothing(period: f64) -> f64 {
    1e-9 + 1e-14 / period
}

/// How many eigenvalues stand within 1e-9 per second of 1.
fn ones(found: &Stability, period: f64) -> usize {
    found.eigenvalues.iter().filter(|v| (v.re - 1.0).hypot(v.im) < 1e-9 * period + 3e-16).count()
}

proptest! {
    #![proptest_config(hapt_testing::cases(40))]

    #[test]
    fn growth_turns_at_the_critical_period(world in loops()) {
        let found = free(&world).unwrap();
        let what = format!("{world:?}");
        let low = hapt_analysis::shortest_period(&world.sampling);
        // Far below a microsecond the rounding of λ exceeds the resolution of a verdict.
        if low < 1e-6 {
            return Ok(());
        }
        // The same holds far beyond all time constants of the loop, where eigenvalues crowd at 1.
        if found.critical_period_s.is_some_and(|critical| critical > 1e3 * world.sampling.period) {
            return Ok(());
        }
        match found.critical_period_s {
            Some(critical) => {
                // Less than 1e-9 1/s of drift counts as momentum: where growth rises slowly it shows a little later.
                let above = |margin: f64| grows(&at(&world, critical * (1.0 + margin))) > 0.0;
                prop_assert!([1e-6, 1e-4, 1e-2].into_iter().any(above), "{what}: not above {critical}");
                prop_assert!(grows(&at(&world, critical * (1.0 - 1e-6))) < nothing(critical), "{what}: below {critical}");
                for i in 1..20 {
                    let period = low * (critical / low).powf(f64::from(i) / 20.0);
                    if period > low {
                        prop_assert!(grows(&at(&world, period)) < nothing(period), "{what}: {critical}, but {period}");
                    }
                }
            }
            None if found.critical_period_reason == Some("never") => {
                prop_assert!(grows(&at(&world, low)) > 0.0, "{what}");
            }
            None => prop_assert!(grows(&found) < nothing(world.sampling.period), "{what}"),
        }
    }

    #[test]
    fn a_spring_to_ground_has_the_closed_limit(beta in log_uniform(-4.0..1.0), inertia in log_uniform(-5.0..0.0), period in log_uniform(-4.0..-2.0)) {
        // KT²/J = β²(1 - e^-β)/(1 - e^-β - β e^-β), β = bT/J: where the determinant of the puck's map is 1.
        let e = (-beta).exp();
        let limit = beta * beta * -(-beta).exp_m1() / (-(-beta).exp_m1() - beta * e);
        let stiffness = limit * inertia / period / period;
        let mut world = world(&to_ground(stiffness), Method::Zoh, Output::End, period);
        world.device.inertia = inertia;
        world.device.damping = beta * inertia / period;
        let found = free(&world).unwrap();
        // Beyond a real eigenvalue -1 the determinant does not decide.
        let flip = 2.0 * beta * -(-beta).exp_m1() / (2.0 * (beta * (1.0 + e) / 2.0 + (-beta).exp_m1()));
        prop_assume!(limit < 0.99 * flip.abs() || flip < 0.0);
        let critical = found.critical_period_s.unwrap();
        prop_assert!((critical / period - 1.0).abs() < 1e-9, "{critical} {period}");
        prop_assert!(grows(&found).abs() < 1e-13 / period);
    }

    #[test]
    fn the_law_of_gil_and_hulin_holds_for_small_parameters(beta in log_uniform(-4.0..-2.0), delay in 0.0..3.0f64) {
        // K < b/(T/2 + t_d).
        let (period, inertia) = (1e-3, 6.4e-4);
        let damping = beta * inertia / period;
        let limit = damping / (period * (0.5 + delay));
        for (factor, stable) in [(0.99, true), (1.06, false)] {
            let mut world = world(&to_ground(factor * limit), Method::Zoh, Output::End, period);
            world.device.damping = damping;
            world.sampling.delay = hapt_model::Delay::Seconds(delay * period);
            prop_assert_eq!(grows(&free(&world).unwrap()) < 0.0, stable);
        }
    }

    #[test]
    fn growth_is_continuous_in_the_delay(world in loops(), samples in 0..4u32) {
        let with = |periods: f64| {
            let mut world = world.clone();
            world.sampling.delay = hapt_model::Delay::Seconds(periods * world.sampling.period);
            free(&world).unwrap().spectral_radius
        };
        let d = f64::from(samples);
        let whole = with(d);
        prop_assert!((with(d + 2e-6) - whole).abs() < 1e-2 * (1.0 + whole), "{}", whole);
        if d > 0.0 {
            prop_assert!((with(d - 2e-6) - whole).abs() < 1e-2 * (1.0 + whole), "{}", whole);
        }
    }
}

/// The notes' wheel on a puck without friction.
fn frictionless(method: Method, output: Output) -> World {
    let mut world = world(&notes(), method, output, 1e-3);
    world.device.damping = 0.0;
    world
}

#[test]
fn start_and_middle_conserve_momentum_and_end_pushes_the_loop_along() {
    use Method::*;
    use Output::*;
    let period = 1e-3;
    for (method, output) in [
        (ForwardEuler, Start),
        (SemiImplicitEuler, Start),
        (Zoh, Middle),
        (Trapezoidal, Middle),
        (Tustin, Start),
        (Foh, Start),
        (BackwardEuler, End),
    ] {
        let found = free(&frictionless(method, output)).unwrap();
        assert_eq!(ones(&found, period), 2, "{} {}: {:?}", method.name(), output.name(), found.eigenvalues);
        assert_eq!(found.eigenvalues.len(), 4);
    }
    let total = 6.4e-4 + WHEEL;
    for (method, output) in [(Zoh, End), (Trapezoidal, End), (Rk4, End), (SemiImplicitEuler, Middle)] {
        let found = free(&frictionless(method, output)).unwrap();
        assert_eq!(ones(&found, period), 1, "{} {}", method.name(), output.name());
        let drift = found.eigenvalues.iter().filter(|v| v.im == 0.0 && v.re != 1.0).map(|v| (v.re - 1.0) / period);
        let law = STIFFNESS * period / 2.0 / total;
        assert!(
            drift.clone().any(|g| (g / law - 1.0).abs() < 0.05),
            "{} {}: {:?}, {law}",
            method.name(),
            output.name(),
            drift.collect::<Vec<_>>()
        );
    }
}

#[test]
fn free_spin_of_the_notes_wheel_is_decided_by_half_a_sample_of_stiffness() {
    let limit = STIFFNESS * 1e-3 / 2.0;
    for method in [Method::Zoh, Method::Trapezoidal] {
        for (factor, verdict) in
            [(1.0 - 1e-6, Verdict::Unstable), (1.0, Verdict::Stable), (1.0 + 1e-6, Verdict::Stable)]
        {
            let mut world = frictionless(method, Output::End);
            world.device.damping = factor * limit;
            let found = free(&world).unwrap();
            assert_eq!(found.verdict, verdict, "{} {factor} {:?}", method.name(), found.growth_per_s);
            if factor != 1.0 {
                // Only the momentum, to first order.
                let law = (limit - world.device.damping) / (6.4e-4 + WHEEL);
                assert!((grows(&found) - law).abs() < 0.01 * law.abs() + 1e-12, "{} {law}", grows(&found));
                let critical = found.critical_period_s.unwrap();
                assert!((critical / 1e-3 - factor).abs() < 1e-9, "{critical}");
            }
        }
    }
}

#[test]
fn without_couplings_nothing_is_left_and_with_friction_the_puck_slows_down() {
    let nothing = Bench { bodies: vec![], couplings: vec![] };
    let mut world = world(&nothing, Method::Zoh, Output::End, 1e-3);
    world.sampling.delay = hapt_model::Delay::Seconds(3.3e-3);
    let found = free(&world).unwrap();
    assert_eq!(found.eigenvalues.len(), 2);
    assert!((grows(&found) + 1.2e-3 / 6.4e-4).abs() < 1e-12);
    assert_eq!((found.verdict, found.critical_period_reason), (Verdict::Stable, Some("unbounded")));
    world.device.damping = 0.0;
    // A Kalman filter keeps its own poles.
    for estimator in EstimatorKind::ALL.into_iter().filter(|estimator| *estimator != EstimatorKind::Kalman) {
        world.sampling.estimator = estimator;
        let found = free(&world).unwrap();
        assert_eq!(ones(&found, 1e-3), 2);
        assert_eq!((found.spectral_radius, found.growth_per_s, found.verdict), (0.0, None, Verdict::Stable));
    }
    // A loose body brings two more.
    world.bodies.push(body(1.0));
    let found = free(&world).unwrap();
    assert_eq!(ones(&found, 1e-3), 4);
    assert_eq!(found.growth_per_s, None);
}

#[test]
fn shifts_are_counted_on_the_graph() {
    let exact = |couplings: Vec<Coupling>| {
        let bench = Bench { bodies: vec![body(1e-3), body(2e-3)], couplings };
        let found = free(&world(&bench, Method::Zoh, Output::End, 1e-3)).unwrap();
        found.eigenvalues.iter().filter(|v| v.re == 1.0 && v.im == 0.0 && v.abs == 1.0).count()
    };
    let (a, b) = (End::Body(0), End::Body(1));
    assert_eq!(exact(vec![spring(End::Puck, a, 1.0), spring(a, b, 1.0)]), 1);
    assert_eq!(exact(vec![spring(End::Puck, a, 1.0), spring(a, b, 1.0), spring(b, End::Ground, 1.0)]), 0);
    assert_eq!(exact(vec![spring(End::Puck, a, 1.0), damper(a, b, 1e-3)]), 2);
    assert_eq!(exact(vec![spring(End::Puck, End::Ground, 1.0), damper(End::Puck, a, 1e-3), damper(a, b, 1e-3)]), 2);
    // Apart from the puck: two shifts and their momentum, in addition to the puck's own.
    assert_eq!(exact(vec![spring(a, b, 1.0)]), 3);
    assert_eq!(exact(vec![damper(a, b, 1e-3)]), 4);
}

#[test]
fn what_the_puck_never_feels_keeps_its_closed_form() {
    // Two equal bodies on the puck: their swing against each other moves nothing else.
    let mut bench = Bench {
        bodies: vec![body(1e-3), body(1e-3)],
        couplings: vec![spring(End::Puck, End::Body(0), 10.0), spring(End::Body(1), End::Puck, 10.0)],
    };
    let mut world_ = world(&bench, Method::Zoh, Output::End, 1e-3);
    world_.device.damping = 0.05;
    world_.sampling.delay = hapt_model::Delay::Seconds(0.4e-3);
    let found = free(&world_).unwrap();
    assert_eq!((found.growth_per_s, found.verdict), (Some(0.0), Verdict::Marginal), "{found:?}");
    assert!(found.critical_period_s.is_some_and(|t| t > 1e-3), "{:?}", found.critical_period_s);
    assert_eq!(found.modes.iter().filter(|m| m.damping_ratio == 0.0).count(), 1);
    world_.sampling.method = Method::ForwardEuler;
    let found = free(&world_).unwrap();
    assert!(grows(&found) >= 0.5 / 1e-3 * (1e-6f64 * 1e4).ln_1p() - 1e-9);
    assert_eq!(found.critical_period_reason, Some("never"));
    bench.couplings.push(compensator(End::Puck, End::Body(0)));
    bench.couplings.push(compensator(End::Puck, End::Body(1)));
    world_.couplings = bench.couplings;
    world_.sampling.output = Output::Start;
    let found = free(&world_).unwrap();
    assert!(found.eigenvalues.iter().any(|v| (v.abs - 1.0).abs() < 1e-15 && v.im > 0.0));
}

#[test]
fn a_wall_between_puck_and_ground_counts_in_and_out() {
    let wall = Coupling {
        first: End::Puck,
        second: End::Ground,
        law: Law::Wall { side: Side::Above, at: 0.0, stiffness: 50.0, damping: 0.0 },
        limit: None,
    };
    let mut bench = notes();
    bench.couplings.push(wall);
    let found = free(&world(&bench, Method::Zoh, Output::End, 1e-3)).unwrap();
    let mut inside = notes();
    inside.couplings.push(spring(End::Puck, End::Ground, 50.0));
    let inside = free(&world(&inside, Method::Zoh, Output::End, 1e-3)).unwrap();
    assert_eq!(found.verdict, Verdict::Unstable);
    assert_eq!(found.growth_per_s, inside.growth_per_s);
    assert_eq!(found.eigenvalues, inside.eigenvalues);
}

#[test]
fn too_many_commands_in_flight_are_refused_with_the_limit() {
    let mut world = world(&notes(), Method::Zoh, Output::End, 1e-3);
    world.sampling.delay = hapt_model::Delay::Seconds(0.6);
    let message = free(&world).unwrap_err().to_string();
    assert!(message.contains("600 periods") && message.contains("500"), "{message}");
}
