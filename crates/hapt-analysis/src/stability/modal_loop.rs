//! The characteristic function of the free loop from the modes of its world, in O(n) operations for n bodies.
//!
//! The world answers the puck's displacement Δ = z_{k+1} - z_k and its velocity v by a sum over its poles, see
//! [`crate::stability::poles`], and the device answers the command c of d samples ago, and of a fraction earlier, by a few states x with
//! x_{k+1} = (1 + D) x_k + λ^-d (b₀ + b₁/λ) c. With μ = λ - 1:
//!
//! ```text
//! c = S Δ + R v - K z,    S = Σ (g₀ + g₁/λ)/(λ - λ_i),    R = Σ (g₂ λ + g₃)/(λ - λ_i) + direct
//! x = (μ - D)⁻¹ (b₀ + b₁/λ) λ^-d c,    Δ = r x + λ^-d (β₀ + β₁/λ) c,    v = W Δ/λ of an estimator, a state of x without one
//! p = (1 - the c that c = 1 makes) det(μ - D) ∏ (λ - λ_i),    times the estimator's denominator
//! ```
//!
//! K is the static stiffness, 0 where no spring joins the puck to ground. The zeros of p are the eigenvalues of `closed_loop`; all its poles
//! are at 0. The pole next to λ is multiplied out, so that p keeps its digits where the puck hardly feels a mode.
//!
//! The poles of the differential equation are found once for all periods. That leaves out dampers that follow the period, damped worlds
//! under semi-implicit Euler, whose damping does, and modes so near to a double pole that the sum loses digits.

use hapt_model::{Method, Sampling};
use nalgebra::{Complex, DMatrix, DVector};

use crate::equations::closed_loop::{ClosedLoop, Hold};
use crate::equations::delay::Delay;
use crate::equations::estimator::Filter;
use crate::equations::port::{Block, Port};
use crate::error::Error;
use crate::stability::multiplier::{Root, multiplier};
use crate::stability::near_circle::{Characteristic, distances};
use crate::stability::poles::{ContinuousPole, Discretisation, Gains, decompose, discrete, oscillator};

type C = Complex<f64>;

const ZERO: C = C::new(0.0, 0.0);

/// Fewest modes for which this is less work than all eigenvalues.
const FEWEST: usize = 6;

/// Condition number of the eigenvectors, for each state, above which the sum over the poles loses too many digits.
const ILL_CONDITIONED: f64 = 30.0;

/// Most states of a device: the puck's two, the motor's torque and the two of a handle.
const DEVICE: usize = 5;

/// How many distances are multiplied before their quotient is taken.
const TOGETHER: usize = 8;

/// A port by its poles, for every period.
pub(crate) struct ModalLoop {
    /// The port without its blocks.
    device: Port,
    /// ω and the spring to the puck of the modes that move no damper.
    undamped: Vec<(f64, f64)>,
    /// The poles of the others, with s for z = Ts.
    damped: Vec<ContinuousPole>,
    /// K of the module documentation.
    stiffness: f64,
    /// The scale of the error of the damped poles, 1/s: the size of the matrix that they come from, times their condition.
    size: f64,
}

impl ModalLoop {
    /// `None` for few modes, and where the poles are not one sum for all periods.
    pub fn new(port: &Port, method: Method) -> Option<Self> {
        let modes: usize = port.blocks.iter().map(|block| block.equations.bodies()).sum();
        if modes < FEWEST || port.is_uncoupled() {
            return None;
        }
        let device = Port { blocks: Vec::new(), ..port.clone() };
        let mut all = ModalLoop { device, undamped: Vec::new(), damped: Vec::new(), stiffness: 0.0, size: 0.0 };
        let mut given = 0.0;
        for block in &port.blocks {
            let (omega, gains) = of_block(block);
            given += omega.iter().zip(gains.spring.iter()).map(|(w, k)| (k / w).powi(2)).sum::<f64>();
            let e = &block.equations;
            match omega[..] {
                [omega] if e.bodies() == 1 && e.fixed.iter().chain(e.per_period.iter()).all(|c| *c == 0.0) => {
                    all.undamped.push((omega, gains.spring[0]));
                }
                _ if method == Method::SemiImplicitEuler || e.per_period.iter().any(|c| *c != 0.0) => return None,
                _ => {
                    let (poles, size) = poles(e.fixed.view((0, 0), (e.bodies(), e.bodies())).into(), &omega, &gains)?;
                    all.damped.extend(poles);
                    all.size = all.size.max(size);
                }
            }
        }
        if port.grounded {
            all.stiffness = port.stiffness - given;
        }
        Some(all)
    }

    /// How many times the rounding of 1 the eigenvalues may be off at a period.
    pub fn size(&self, period: f64) -> f64 {
        1.0 + self.size * period
    }

    /// p at a period.
    ///
    /// # Errors
    /// As [`crate::equations::closed_loop::closed_loop`].
    pub fn at<'a>(
        &self,
        sampling: &Sampling,
        damping: f64,
        filter: &'a Filter,
        period: f64,
    ) -> Result<Characteristic<'a>, Error> {
        let delay = Delay::of(sampling.delay.seconds(period), period)?;
        let port = &self.device;
        // The commands of d and of d + 1 samples ago stand where one has those of 1 and 2 samples ago; no velocity is estimated.
        let none = Filter { pole: 0.0, taps: Vec::new(), kalman: None };
        let parts = ClosedLoop::new(port, sampling, &none, period, 2)?;
        let change = parts.puck(damping, Hold { interval: period, before: delay.fraction * period, age: 1 });
        let places: Vec<(usize, usize)> =
            parts.places().into_iter().enumerate().filter_map(|(i, place)| Some((i, place?))).collect();
        let n = places.len();
        if n > DEVICE || !change.iter().all(|row| row.iter().all(|x| x.is_finite())) {
            return Err(Error::Eigenvalues { order: parts.order });
        }
        let mut device = Device { n, ..Device::default() };
        let first = parts.first_in_flight();
        for (i, (row, place)) in places.iter().enumerate() {
            device.push[i] = [0, 1].map(|late| change[*row][first + late]);
            device.d[i] = std::array::from_fn(|j| places.get(j).map_or(0.0, |(_, place)| change[*row][*place]));
            device.displacement[i] = change[0][*place];
            if *place == parts.velocity {
                device.velocity = i;
            }
        }
        device.at_once = [0, 1].map(|late| change[0][first + late]);
        let mut sum = World {
            poles: Vec::with_capacity(2 * self.undamped.len() + self.damped.len()),
            gains: Vec::with_capacity(2 * self.undamped.len() + self.damped.len()),
            has: [false; 4],
            direct: -(port.fixed + period * port.per_period),
            stiffness: self.stiffness,
            has_damper: port.has_damper(),
            unit: 1.0,
        };
        let rule =
            Discretisation { method: sampling.method, output: sampling.output, advance: sampling.advance, period };
        let more = if sampling.method == Method::SemiImplicitEuler { 1.0 } else { 0.0 };
        for (omega, spring) in &self.undamped {
            let x = omega * period;
            oscillator(*omega, x, more * x * x, *spring, 0.0).iter().for_each(|pole| sum.take(pole, rule));
        }
        for pole in &self.damped {
            sum.take(&ContinuousPole { root: Root::from(pole.root.z * period), ..*pole }, rule);
        }
        // Many small distances in a row would leave double precision.
        let size = sum.poles.iter().map(|pole| pole.norm()).sum::<f64>() / sum.poles.len() as f64;
        sum.unit = if size.is_normal() { 1.0 / size } else { 1.0 };
        let estimator = Estimator::new(filter, period);
        let zeros = sum.poles.len() + n + usize::from(sum.has_damper && estimator.has_pole());
        let samples = i32::try_from(delay.samples).unwrap_or(i32::MAX);
        Ok(Characteristic {
            value: Box::new(move |mu, found| value(&sum, &device, &estimator, samples, mu, found)),
            zeros,
            delay: samples,
        })
    }
}

/// ω and what joins the modes to the puck.
fn of_block(block: &Block) -> (Vec<f64>, Gains) {
    let e = &block.equations;
    let m = e.bodies();
    let omega = (0..block.positions).map(|i| e.stiffness[(i, i)].sqrt()).collect();
    let column = |of: &DMatrix<f64>| DVector::from_fn(m, |j, _| -of[(j, m)]);
    (omega, Gains { spring: column(&e.stiffness), damper: column(&e.fixed) })
}

/// The poles of modes that dampers couple, s for z, and [`ModalLoop::size`] of them.
fn poles(fixed: DMatrix<f64>, omega: &[f64], gains: &Gains) -> Option<(Vec<ContinuousPole>, f64)> {
    let (p, m) = (omega.len(), fixed.nrows());
    let mut a = DMatrix::zeros(p + m, p + m);
    for (i, omega) in omega.iter().enumerate() {
        a[(i, p + i)] = *omega;
        a[(p + i, i)] = -omega;
    }
    a.view_mut((p, p), (m, m)).copy_from(&-fixed);
    let (values, v, inverse) = decompose(&a)?;
    if v.norm() * inverse.norm() > ILL_CONDITIONED * (p + m) as f64 {
        return None;
    }
    let of = |(i, z): (usize, &C)| {
        let row: Vec<C> = inverse.row(i).iter().copied().collect();
        let root = Root::from(C::new(z.re.min(0.0), z.im));
        ContinuousPole::new(root, v.column(i).as_slice(), &row, omega, gains)
    };
    // An eigenvalue moves by a change of the matrix times its condition, here the norm of its row, as the columns are units.
    let condition = inverse.row_iter().map(|row| row.norm()).fold(1.0, f64::max);
    Some((values.iter().enumerate().map(of).collect(), condition * a.norm()))
}

/// The device over a sample.
#[derive(Default)]
struct Device {
    /// The number of states.
    n: usize,
    d: [[f64; DEVICE]; DEVICE],
    /// b₀ and b₁ of each state.
    push: [[f64; 2]; DEVICE],
    /// r
    displacement: [f64; DEVICE],
    /// β₀ and β₁
    at_once: [f64; 2],
    /// Which state is the puck's velocity.
    velocity: usize,
}

impl Device {
    /// x·det(μ - D) under a command of 1 and `late` of the one before, and det(μ - D).
    fn answer(&self, mu: C, late: C) -> ([C; DEVICE], C) {
        let n = self.n;
        let push = |i: usize| self.push[i][0] + late * self.push[i][1];
        let mut x = [ZERO; DEVICE];
        if n == 1 {
            x[0] = push(0);
            return (x, mu - self.d[0][0]);
        }
        let mut rows = [[ZERO; DEVICE]; DEVICE];
        for i in 0..n {
            (0..n).for_each(|j| rows[i][j] = if i == j { mu - self.d[i][j] } else { C::from(-self.d[i][j]) });
            x[i] = push(i);
        }
        let mut product = C::from(1.0);
        for k in 0..n {
            let most = (k..n).max_by(|i, j| rows[*i][k].norm_sqr().total_cmp(&rows[*j][k].norm_sqr())).unwrap_or(k);
            if most != k {
                rows.swap(k, most);
                x.swap(k, most);
                product = -product;
            }
            product *= rows[k][k];
            for i in k + 1..n {
                let part = rows[i][k] / rows[k][k];
                let (above, solved) = (rows[k], x[k]);
                (k + 1..n).for_each(|j| rows[i][j] -= part * above[j]);
                x[i] -= part * solved;
            }
        }
        for i in (0..n).rev() {
            x[i] = (i + 1..n).fold(x[i], |rest, j| rest - rows[i][j] * x[j]) / rows[i][i];
        }
        x.iter_mut().for_each(|x| *x *= product);
        (x, product)
    }
}

/// The velocity of an estimator by the displacement: v = W Δ/λ.
struct Estimator<'a> {
    filter: &'a Filter,
    /// 1 - the pole.
    decay: f64,
    gains: Vec<f64>,
}

impl<'a> Estimator<'a> {
    fn new(filter: &'a Filter, period: f64) -> Self {
        let mut sum = 0.0;
        let gains: Vec<f64> =
            filter.taps.iter().take(filter.taps.len().saturating_sub(1)).map(|tap| (sum += tap, sum).1).collect();
        let decay = period * gains.iter().sum::<f64>();
        Estimator { filter, decay, gains }
    }

    fn has_pole(&self) -> bool {
        self.filter.pole > 0.0
    }

    fn is_exact(&self) -> bool {
        self.gains.is_empty()
    }

    /// v for a displacement of 1, and what multiplies out its pole.
    fn velocity(&self, mu: C, back: C) -> (C, C) {
        let sum = self.gains.iter().rev().fold(ZERO, |sum, gain| sum * back + gain);
        if self.has_pole() {
            let denominator = mu + self.decay;
            return (sum / denominator, denominator);
        }
        (sum * back, C::from(1.0))
    }
}

struct World {
    /// λ_i - 1
    poles: Vec<C>,
    /// g₀ to g₃ of each.
    gains: Vec<[C; 4]>,
    /// Which of the four any pole has.
    has: [bool; 4],
    direct: f64,
    stiffness: f64,
    has_damper: bool,
    /// One by the mean distance of a pole from 1: the unit of distances in p.
    unit: f64,
}

impl World {
    fn take(&mut self, pole: &ContinuousPole, rule: Discretisation) {
        let (found, direct) = discrete(pole, rule);
        self.direct += direct;
        self.poles.push(multiplier(rule.method, pole.root).less_one);
        self.has = std::array::from_fn(|kind| self.has[kind] || found.gains[kind] != ZERO);
        self.gains.push(found.gains);
    }

    /// ∏ (λ - λ_i) without the pole nearest to λ, the distance from that, and S and R times it.
    fn answer(&self, mu: C, back: C, found: &[C]) -> [C; 4] {
        let distance = |pole: &C| (mu - pole).norm_sqr();
        let mut nearest = (0, f64::INFINITY);
        for (at, pole) in self.poles.iter().enumerate() {
            let distance = distance(pole);
            if distance < nearest.1 {
                nearest = (at, distance);
            }
        }
        let one = C::from(1.0);
        let (mut product, mut above, mut below) = (one, one, one);
        let mut sums = [ZERO; 4];
        // Their distances alternate with those of the poles, and a few at a time stay within double precision.
        let mut without = distances(found, mu);
        for (at, (pole, gains)) in self.poles.iter().zip(&self.gains).enumerate() {
            if at == nearest.0 {
                continue;
            }
            let from = mu - pole;
            above *= from * self.unit;
            if let Some(from) = without.next() {
                below *= from * self.unit;
            }
            if at % TOGETHER == 0 {
                product *= above / below;
                (above, below) = (one, one);
            }
            let inverse = from.conj() * (1.0 / from.norm_sqr());
            for ((sum, gain), has) in sums.iter_mut().zip(gains).zip(self.has) {
                if has {
                    *sum += gain * inverse;
                }
            }
        }
        product = without.fold(product * (above / below), |product, from| product / (from * self.unit));
        let mut whole = one;
        if let Some((pole, gains)) = self.poles.get(nearest.0).zip(self.gains.get(nearest.0)) {
            whole = mu - pole;
            sums.iter_mut().zip(gains).for_each(|(sum, gain)| *sum = *sum * whole + gain);
        }
        [product, whole, sums[0] + sums[1] * back, sums[2] * (mu + 1.0) + sums[3] + whole * self.direct]
    }
}

/// p of the module documentation, without the roots that are found.
fn value(world: &World, device: &Device, estimator: &Estimator, samples: i32, mu: C, found: &[C]) -> C {
    let lambda = mu + 1.0;
    let back = lambda.inv();
    let [product, whole, s, r] = world.answer(mu, back, found);
    let (x, det) = device.answer(mu, back);
    let displacement = (0..device.n).fold(ZERO, |sum, i| sum + x[i] * device.displacement[i])
        + det * (device.at_once[0] + back * device.at_once[1]);
    let mut torque = s * displacement;
    let mut denominator = C::from(1.0);
    if world.has_damper {
        let velocity = if estimator.is_exact() {
            x[device.velocity]
        } else {
            let (per_displacement, pole) = estimator.velocity(mu, back);
            denominator = pole;
            per_displacement * displacement
        };
        torque += r * velocity;
    }
    if world.stiffness != 0.0 {
        // Δ = μ z.
        torque -= whole * world.stiffness * x[0];
    }
    (whole * det - torque * lambda.powi(-samples)) * product * denominator
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::equations::closed_loop::closed_loop;
    use crate::equations::continuous::Slopes;
    use crate::equations::structure::{inertias_with_puck, linearise_with_puck, parts};
    use crate::numerics::eigenvalues::eigenvalues;
    use hapt_model::{Source, World as File};
    use hapt_testing::prelude::*;

    /// A chain of six bodies behind the puck, with dampers in parallel with the springs where they are requested.
    fn chain(numbers: &[f64], method: &str, estimator: &str, device: &str, is_damped: bool, is_grounded: bool) -> File {
        let mut text = format!(
            "loop = {{ period = \"1 ms\", method = \"{method}\", delay = \"{} ms\", {estimator} }}\n\
             device = {{ inertia = {}, damping = {}{device} }}\n",
            2.0 * numbers[0],
            1e-3 + 1e-2 * numbers[1],
            0.1 * numbers[2]
        );
        for i in 0..6 {
            text += &format!("[bodies.b{i}]\ninertia = {}\n", 1e-3 + 1e-2 * numbers[3 + i]);
        }
        for i in 0..7 {
            let [first, second] = [i, i + 1].map(|at| match at {
                0 => "puck".to_string(),
                7 => "ground".to_string(),
                _ => format!("b{}", at - 1),
            });
            if i == 6 && !is_grounded {
                continue;
            }
            let ends = format!("between = [\"{first}\", \"{second}\"]");
            text += &format!("[[couplings]]\nkind = \"spring\"\n{ends}\nstiffness = {}\n", 1.0 + 9.0 * numbers[9 + i]);
            if is_damped {
                text +=
                    &format!("[[couplings]]\nkind = \"damper\"\n{ends}\ndamping = {}\n", 1e-3 + 9e-3 * numbers[16 + i]);
            }
        }
        File::read(&Source::from_text("chain.toml", &text), &[]).unwrap()
    }

    proptest! {
        #[test]
        fn its_zeros_are_the_eigenvalues_of_the_whole_matrix(
            numbers in prop::collection::vec(0.0..1.0f64, 23),
            method in prop::sample::select(vec!["zoh", "trapezoidal", "rk4", "tustin", "foh", "backward-euler", "semi-implicit-euler"]),
            estimator in prop::sample::select(vec![
                "estimator = \"exact\"",
                "estimator = \"difference\"",
                "estimator = \"low-pass\", cutoff = \"30 Hz\"",
                "estimator = \"foaw\", window = 3",
                "estimator = \"difference\", every = 4",
            ]),
            device in prop::sample::select(vec!["", ", lag = 1e-3"]),
            is_damped in any::<bool>(),
            is_grounded in any::<bool>(),
            period in 1e-4..5e-3f64,
        ) {
            let is_damped = is_damped && method != "semi-implicit-euler";
            let world = chain(&numbers, method, estimator, device, is_damped, is_grounded);
            let couplings = linearise_with_puck(&world.bodies, &world.couplings, &Slopes::Flat).unwrap();
            let part = parts(&inertias_with_puck(&world).unwrap(), &couplings).remove(0);
            let port = Port::new(&part).unwrap().lagging(world.device.lag);
            let (sampling, damping) = (&world.sampling, world.device.damping);
            let filter = Filter::of(sampling, period).pop().unwrap();
            let all = eigenvalues(&closed_loop(&port, sampling, damping, &filter, period).unwrap()).unwrap();
            let modal = ModalLoop::new(&port, sampling.method);
            prop_assume!(modal.is_some());
            let mut p = modal.unwrap().at(sampling, damping, &filter, period).unwrap();
            // All that do not decay within a sample, but for the shift of the whole loop.
            let near: Vec<C> = all.iter().filter(|mu| mu.im >= 0.0 && (*mu + 1.0).norm() > 0.5).copied().collect();
            let found = p.outside(0.5, &[], &near).unwrap();
            for mu in &near {
                let distance = found.iter().map(|root| (root - mu).norm()).fold(f64::INFINITY, f64::min);
                prop_assert!(distance < 1e-9 * mu.norm() + 1e-11, "{mu} is {distance} from {found:?}");
            }
            prop_assert_eq!(found.len(), near.len());
        }
    }
}
