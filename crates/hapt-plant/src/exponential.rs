//! Matrix exponentials and integrals of quadratic forms along a linear motion ẏ = N y, to rounding.

/// A square matrix, row by row.
pub(crate) type Square<const M: usize> = [[f64; M]; M];

/// Gauss and Legendre's 8 nodes and weights on [0, 1]: exact to degree 15, and to the last bit over a quarter radian.
pub(crate) const GAUSS: [(f64, f64); 8] = [
    (0.019855071751231884, 0.05061426814518813),
    (0.10166676129318663, 0.11119051722668724),
    (0.2372337950418355, 0.15685332293894364),
    (0.4082826787521751, 0.181_341_891_689_181),
    (0.591_717_321_247_825, 0.181_341_891_689_181),
    (0.7627662049581645, 0.15685332293894364),
    (0.8983332387068134, 0.11119051722668724),
    (0.9801449282487681, 0.05061426814518813),
];

/// A step of a quarter radian at most of a rate in 1/s, and how often to double it for `dt`.
pub(crate) fn halved(rate: f64, dt: f64) -> (f64, u32) {
    let (mut h, mut angle, mut halvings) = (dt, rate * dt, 0);
    while angle > 0.25 && halvings < 1100 {
        h *= 0.5;
        angle *= 0.5;
        halvings += 1;
    }
    (h, halvings)
}

/// A quadratic form with its lower triangle added to its upper one.
pub(crate) fn folded<const M: usize>(form: &Square<M>) -> Square<M> {
    let mut out = [[0.0; M]; M];
    for i in 0..M {
        out[i][i] = form[i][i];
        for j in i + 1..M {
            out[i][j] = form[i][j] + form[j][i];
        }
    }
    out
}

/// The matrix of these states among all, with zeros for those that do not occur.
pub(crate) fn widened<const M: usize, const ALL: usize>(states: [usize; M], part: &Square<M>) -> Square<ALL> {
    let mut all = [[0.0; ALL]; ALL];
    for (i, row) in states.into_iter().zip(part) {
        for (j, x) in states.into_iter().zip(row) {
            all[i][j] = *x;
        }
    }
    all
}

/// The state y after the change.
pub(crate) fn applied<const M: usize>(change: &Square<M>, y: &[f64; M]) -> [f64; M] {
    let mut out = *y;
    for (out, row) in out.iter_mut().zip(change) {
        for (x, y) in row.iter().zip(y) {
            *out += x * y;
        }
    }
    out
}

pub(crate) fn product<const M: usize>(a: &Square<M>, b: &Square<M>) -> Square<M> {
    let mut out = [[0.0; M]; M];
    for (out, a) in out.iter_mut().zip(a) {
        // Most entries of a generator are zero.
        for (a, b) in a.iter().zip(b).filter(|(a, _)| **a != 0.0) {
            for (out, b) in out.iter_mut().zip(b) {
                *out += a * b;
            }
        }
    }
    out
}

/// exp(N h) - I by its series. 16 terms: at a quarter radian 0.25^16/16! is far below the last bit; what is not a rate (the
/// drives' gains) enters once and only scales.
pub(crate) fn series<const M: usize>(n: &Square<M>, h: f64) -> Square<M> {
    let mut sum = [[0.0; M]; M];
    for j in (1..=16).rev() {
        // sum = hN/j · (I + sum), from the last term inward.
        for (i, row) in sum.iter_mut().enumerate() {
            row[i] += 1.0;
        }
        sum = product(n, &sum);
        for x in sum.as_flattened_mut() {
            *x *= h / f64::from(j);
        }
    }
    sum
}

/// (I + E)² - I = 2E + E²: small changes keep their digits.
pub(crate) fn doubled<const M: usize>(change: &Square<M>) -> Square<M> {
    let mut out = product(change, change);
    for (out, x) in out.as_flattened_mut().iter_mut().zip(change.as_flattened()) {
        *out += 2.0 * x;
    }
    out
}

/// (I + E)ᵀ G (I + E)
pub(crate) fn congruent<const M: usize>(change: &Square<M>, form: &Square<M>) -> Square<M> {
    let mut phi = *change;
    for (i, row) in phi.iter_mut().enumerate() {
        row[i] += 1.0;
    }
    let right = product(form, &phi);
    let mut out = [[0.0; M]; M];
    for (phi, right) in phi.iter().zip(&right) {
        for (out, phi) in out.iter_mut().zip(phi) {
            for (out, right) in out.iter_mut().zip(right) {
                *out += phi * right;
            }
        }
    }
    out
}
