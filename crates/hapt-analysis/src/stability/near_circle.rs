//! The roots of a characteristic function outside of a circle, from those of a neighbouring period: found by a search each, and counted by
//! the turns of the function along the circle, so that none is missed.

use nalgebra::Complex;

type C = Complex<f64>;

/// Steps of a search for a root.
const STEPS: usize = 24;

/// Largest turn of the function between two neighbouring points on the circle, rad.
const TURN: f64 = 1.0;

/// How often an arc is halved.
const HALVINGS: u32 = 12;

/// A function's value at μ, divided by ∏ (μ - μ_i) of the roots that are given, up to a constant factor.
type Value<'a> = dyn FnMut(C, &[C]) -> C + 'a;

/// A function of μ = λ - 1 whose zeros are the eigenvalues of a loop. Its poles are at λ = 0.
pub(crate) struct Characteristic<'a> {
    /// Without the roots that are given.
    pub value: Box<Value<'a>>,
    /// How many more zeros than poles it has.
    pub zeros: usize,
    /// Whole samples of delay, for which it turns on the circle.
    pub delay: i32,
}

impl Characteristic<'_> {
    /// μ of all roots with |λ| above `radius`, from those near them: one of each pair, Im μ ≥ 0. `known` are roots by structure. `None`
    /// where not all are found.
    pub fn outside(&mut self, radius: f64, known: &[C], near: &[C]) -> Option<Vec<C>> {
        let mut found = known.to_vec();
        for guess in near {
            self.search(*guess, radius, &mut found);
        }
        for _ in 0..2 {
            let (missing, least) = self.missing(radius, &found)?;
            if missing == 0 {
                return Some(found);
            }
            // A pair may have become two real roots, or another root may have come near the circle.
            let before = found.len();
            for guess in near.iter().copied().chain([least]) {
                self.search(guess * C::new(1.01, 0.01), radius, &mut found);
            }
            if found.len() == before {
                break;
            }
        }
        None
    }

    /// Adds the root near `guess` that is not yet found, by parabolas through three points (Muller 1956).
    fn search(&mut self, guess: C, radius: f64, found: &mut Vec<C>) {
        let without = &mut self.value;
        let mut value = |mu: C| without(mu, found);
        let step = 1e-3 * guess + 1e-12;
        let mut x = [guess - step, guess + step * C::new(0.7, 0.7), guess];
        let mut f = x.map(&mut value);
        for _ in 0..STEPS {
            let [h0, h1] = [x[1] - x[0], x[2] - x[1]];
            let [d0, d1] = [(f[1] - f[0]) / h0, (f[2] - f[1]) / h1];
            let a = (d1 - d0) / (h1 + h0);
            let b = a * h1 + d1;
            let root = (b * b - 4.0 * f[2] * a).sqrt();
            let below = if (b + root).norm_sqr() > (b - root).norm_sqr() { b + root } else { b - root };
            let step = -2.0 * f[2] / below;
            if !(step.re.is_finite() && step.im.is_finite()) {
                // Three equal values: the root is reached as far as numbers go.
                if f[2].norm() > f64::EPSILON * f[0].norm() {
                    return;
                }
                break;
            }
            x = [x[1], x[2], x[2] + step];
            if step.norm() <= 2.0 * f64::EPSILON * (1.0 + x[2].norm()) || step.norm() <= 1e-14 * x[2].norm() {
                let mu = self.as_real(x[2], found);
                let mu = if mu.im < 0.0 { mu.conj() } else { mu };
                if (mu + 1.0).norm() > radius {
                    found.push(mu);
                }
                return;
            }
            f = [f[1], f[2], value(x[2])];
            if f[2] == C::from(0.0) {
                f[2] = C::from(f64::MIN_POSITIVE);
            }
        }
    }

    /// The real root near `mu`, if `mu` is real up to rounding.
    fn as_real(&mut self, mu: C, found: &[C]) -> C {
        if mu.im.abs() > 1e-6 * mu.norm() {
            return mu;
        }
        // p is real on the real axis, and changes its sign at a simple root.
        let reach = 2.0 * mu.im.abs() + 1e-13 * mu.norm() + 4.0 * f64::EPSILON;
        let mut value = |x: f64| {
            let mu = C::from(x);
            (self.value)(mu, found).re
        };
        if value(mu.re - reach) * value(mu.re + reach) <= 0.0 { C::from(mu.re) } else { mu }
    }

    /// How many zeros outside the circle of `radius` are not among those found, and μ where p without those is least on it. `None` where
    /// rounding hides it.
    fn missing(&mut self, radius: f64, found: &[C]) -> Option<(usize, C)> {
        let pairs: i32 = found.iter().map(|mu| if mu.im > 0.0 { 2 } else { 1 }).sum();
        let power = self.zeros as i32 - pairs;
        let inside = radius - 1.0;
        let place = |phi: f64| {
            let (sin, cos) = (0.5 * phi).sin_cos();
            C::new(inside - 2.0 * radius * sin * sin, 2.0 * radius * sin * cos)
        };
        let mut least = (f64::INFINITY, C::from(0.0));
        let mut value = |phi: f64| {
            let mu = place(phi);
            let value = (self.value)(mu, found) * (mu + 1.0).powi(-power);
            if value.norm() < least.0 {
                least = (value.norm(), mu);
            }
            value
        };
        let arcs = 12 + self.delay / 2;
        let mut turns = 0.0;
        let mut from = value(0.0);
        for i in 1..=arcs {
            let ends = [i - 1, i].map(|i| std::f64::consts::PI * f64::from(i) / f64::from(arcs));
            let to = value(ends[1]);
            turns += turned(&mut value, ends, [from, to], HALVINGS)?;
            from = to;
        }
        let missing = (-turns / std::f64::consts::PI).round();
        (missing >= 0.0).then_some((missing as usize, least.1))
    }
}

/// ∏ (μ - μ_i) of the found roots, with the conjugates of pairs.
pub(crate) fn product(found: &[C], mu: C) -> C {
    distances(found, mu).fold(C::from(1.0), |all, one| all * one)
}

/// μ - μ_i of the found roots, with the conjugates of pairs.
pub(crate) fn distances(found: &[C], mu: C) -> impl Iterator<Item = C> {
    found.iter().flat_map(move |root| [Some(mu - root), (root.im > 0.0).then(|| mu - root.conj())]).flatten()
}

/// The change of the argument along an arc, rad.
fn turned(value: &mut impl FnMut(f64) -> C, ends: [f64; 2], values: [C; 2], halvings: u32) -> Option<f64> {
    let turn = (values[1] / values[0]).arg();
    if turn.abs() < TURN {
        return Some(turn);
    }
    let halvings = halvings.checked_sub(1)?;
    let middle = 0.5 * (ends[0] + ends[1]);
    let between = value(middle);
    Some(
        turned(value, [ends[0], middle], [values[0], between], halvings)?
            + turned(value, [middle, ends[1]], [between, values[1]], halvings)?,
    )
}
