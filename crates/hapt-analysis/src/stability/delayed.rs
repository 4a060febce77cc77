//! The roots near the unit circle of a loop with many commands in flight.
//!
//! The commands in flight only hand a command on, so that the characteristic equation needs none of their states. With the rest of the
//! state x, D₀ and the command c = t x of `closed_loop`, and a delay of d samples and a fraction of one, μ = λ - 1,
//!
//! ```text
//! p(λ) = det(μ - D₀ - λ^-d (b₀ + b₁/λ) t) = 0
//! ```
//!
//! In coordinates where t is a multiple of the last unit vector and D₀ has Hessenberg form, the whole matrix has, and p takes O(n²)
//! operations for n states, for any delay. p has n more zeros than poles, all poles at 0.

use hapt_model::Sampling;
use nalgebra::linalg::Hessenberg;
use nalgebra::{Complex, DMatrix, DVector};

use crate::equations::closed_loop::{ClosedLoop, Hold};
use crate::equations::delay::Delay;
use crate::equations::estimator::Filter;
use crate::equations::port::Port;
use crate::error::Error;
use crate::numerics::balance::{balance, scaled};
use crate::stability::near_circle::{Characteristic, product};

type C = Complex<f64>;

/// Fewest commands in flight for which this is less work than all eigenvalues.
const FEWEST: usize = 4;

/// Most states of which p is made.
const MOST_STATES: usize = 40;

/// p of the module documentation, at one period.
pub(crate) struct Delayed {
    /// D₀ in Hessenberg form, row by row.
    h: Vec<f64>,
    n: usize,
    /// t b₀ and t b₁, in the last column.
    push: [Vec<f64>; 2],
    delay: i32,
    /// The largest entry of the matrix of all states.
    pub size: f64,
}

impl Delayed {
    /// `None` for a loop of few commands in flight, or of many other states.
    ///
    /// # Errors
    /// As [`crate::equations::closed_loop::closed_loop`].
    pub fn new(
        port: &Port,
        sampling: &Sampling,
        damping: f64,
        filter: &Filter,
        period: f64,
    ) -> Result<Option<Self>, Error> {
        let delay = Delay::of(sampling.delay.seconds(period), period)?;
        let bodies: usize = port.blocks.iter().map(|block| block.positions + block.equations.bodies()).sum();
        if delay.in_flight() < FEWEST || port.is_uncoupled() || bodies > MOST_STATES {
            return Ok(None);
        }
        // The commands of d and of d + 1 samples ago stand where one has those of 1 and 2 samples ago.
        let parts = ClosedLoop::new(port, sampling, filter, period, 2)?;
        if parts.order > MOST_STATES {
            return Ok(None);
        }
        let hold = Hold { interval: period, before: delay.fraction * period, age: 1 };
        let d = parts.map(&parts.puck(damping, hold));
        if !d.iter().all(|x| x.is_finite()) {
            return Err(Error::Eigenvalues { order: parts.order });
        }
        let d = scaled(&d, &balance(&d));
        let size = d.amax().max(1.0);
        let first = parts.first_in_flight();
        let kept: Vec<usize> = (0..d.nrows()).filter(|i| *i != first && *i != first + 1).collect();
        let n = kept.len();
        // The first command in flight takes this sample's, less itself.
        let t = DVector::from_fn(n, |i, _| d[(first, kept[i])]);
        let rest = d.select_rows(&kept);
        let (own, commands) = (rest.select_columns(&kept), rest.columns(first, 2).into_owned());
        // In units of the first, the second takes the first command by the ratio of their units.
        let units = d[(first + 1, first)];
        // A reflection takes t to a multiple of the first unit vector; D₀ᵀ then keeps it in its Hessenberg form.
        let (reflection, along) = reflected(&t);
        let transposed = &reflection * own.transpose() * &reflection;
        let (q, upper) =
            if n > 2 { Hessenberg::new(transposed).unpack() } else { (DMatrix::identity(n, n), transposed) };
        let to = q.transpose() * reflection;
        let [old, older] = [0, 1].map(|i| &to * commands.column(i) * along);
        let turned = |v: &DVector<f64>, unit: f64| (0..n).map(|i| v[n - 1 - i] * unit).collect();
        let h = (0..n * n).map(|at| upper[(n - 1 - at % n, n - 1 - at / n)]).collect();
        Ok(Some(Delayed {
            h,
            n,
            push: [turned(&old, 1.0), turned(&older, units)],
            delay: i32::try_from(delay.samples).unwrap_or(i32::MAX),
            size,
        }))
    }

    /// p, as what is searched for its zeros.
    pub fn characteristic(&self) -> Characteristic<'_> {
        let mut room = Vec::with_capacity(self.n * self.n);
        Characteristic {
            value: Box::new(move |mu, found| self.at(mu, &mut room) / product(found, mu)),
            zeros: self.n,
            delay: self.delay,
        }
    }

    /// p at λ = 1 + μ.
    fn at(&self, mu: C, room: &mut Vec<C>) -> C {
        let n = self.n;
        let lambda = mu + 1.0;
        let late = lambda.powi(-self.delay);
        let later = late / lambda;
        room.clear();
        room.extend(self.h.iter().map(|x| C::from(-x)));
        for i in 0..n {
            room[i * n + i] += mu;
            room[i * n + n - 1] -= late * self.push[0][i] + later * self.push[1][i];
        }
        let mut product = C::from(1.0);
        for k in 0..n {
            if k + 1 < n {
                let (above, below) = room.split_at_mut((k + 1) * n);
                let (row, next) = (&mut above[k * n + k..], &mut below[k..n]);
                if row[0].norm_sqr() < next[0].norm_sqr() {
                    row.swap_with_slice(next);
                    product = -product;
                }
                if row[0] != C::from(0.0) {
                    let part = next[0] / row[0];
                    next.iter_mut().zip(row.iter()).skip(1).for_each(|(x, y)| *x -= part * y);
                }
            }
            product *= room[k * n + k];
        }
        product
    }
}

/// The reflection that takes v to the first unit vector times the number.
fn reflected(v: &DVector<f64>) -> (DMatrix<f64>, f64) {
    let n = v.len();
    let size = v.norm();
    let mut u = v.clone();
    let along = if v[0] > 0.0 { -size } else { size };
    u[0] -= along;
    let square = u.norm_squared();
    if square == 0.0 {
        return (DMatrix::identity(n, n), along);
    }
    (DMatrix::identity(n, n) - &u * u.transpose() * (2.0 / square), along)
}
