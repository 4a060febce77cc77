//! Modal coordinates of a part of the held world.
//!
//! With w = M^{-1/2} V y and V the eigenvectors of M^{-1/2} K M^{-1/2}, the equations are ÿ + (C0 + T C1) ẏ + Ω² y = 0 with C0, C1
//! symmetric. The state is (Ω y, ẏ): its square is twice the energy, so
//!
//! ```text
//! A = [0, Ω; -Ω, -(C0 + T C1)]
//! ```
//!
//! is skew-symmetric apart from the damping, and rounding errors do not spread between entries of different magnitude.
//!
//! Structural eigenvalues are found here, before any solver runs:
//!
//! * A cluster without an anchor gives ω = 0. Its position is not a coordinate of the state above: it is one eigenvalue 1, decoupled
//!   from the rest. V has the shift as an exact column.
//! * A part without coupling to the fixed side conserves its momentum: that velocity is another eigenvalue 1.
//! * A mode that moves no damper is `undamped`. It is coupled to no other mode, and its s is ±jω exactly. The test uses only the mode
//!   shape, not the size of the dampers.
//! * A mode on which the dampers amount to T K is `compensated`: s² + Tω² s + ω² = 0.
//!
//! Modes of one frequency may be combined freely. There the undamped combinations are separated first.

use nalgebra::{DMatrix, DVector};

use crate::equations::structure::{Link, Part};
use crate::error::Error;
use crate::numerics::jacobi::orthogonalise;

/// Relative motion across a damper below which a mode counts as undamped. The damping would be the square of it, 1e-18, less
/// than the rounding of an eigenvalue.
const NEGLIGIBLE: f64 = 1e-9;

/// Relative difference up to which frequencies count as equal. Jacobi computes them to 1e-14.
pub(crate) const SAME: f64 = 1e-11;

/// The modes that dampers couple, see the module documentation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Coupled {
    /// Ω of the modes with a restoring spring, increasing. Velocities without a position follow them.
    pub omega: Vec<f64>,
    /// √c0 × the motion across each damper: C0 = rowsᵀ rows. m columns.
    pub fixed_rows: DMatrix<f64>,
    /// The same of C1.
    pub per_period_rows: DMatrix<f64>,
    /// C0, m × m, 1/s.
    pub fixed: DMatrix<f64>,
    /// C1, m × m, 1/s².
    pub per_period: DMatrix<f64>,
    /// C1 - K, m × m, 1/s², summed link by link: where dampers match springs it is exactly 0.
    pub uncovered: DMatrix<f64>,
    /// Whether, link by link, C1 is no less than K, so that C1 - K is positive semidefinite.
    pub covered: bool,
}

/// A part of the held world.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Modal {
    /// Eigenvalues that are exactly 1.
    pub unit_count: usize,
    /// ω of the modes that move no damper.
    pub undamped: Vec<f64>,
    /// ω of the modes whose damping is T ω² exactly.
    pub compensated: Vec<f64>,
    /// All others.
    pub coupled: Coupled,
    /// The columns of V in the order above: the undamped, the compensated, the coupled.
    pub shapes: DMatrix<f64>,
}

impl Coupled {
    /// No modes.
    pub fn none() -> Self {
        let none = || DMatrix::zeros(0, 0);
        Coupled {
            omega: vec![],
            fixed_rows: none(),
            per_period_rows: none(),
            fixed: none(),
            per_period: none(),
            uncovered: none(),
            covered: true,
        }
    }

    /// Number of velocities.
    pub fn order(&self) -> usize {
        self.fixed.nrows()
    }

    /// Whether there are no modes.
    pub fn is_empty(&self) -> bool {
        self.order() == 0
    }

    /// Ω², with zeros for the velocities that have no position.
    pub fn stiffness(&self) -> DMatrix<f64> {
        let square = |i| self.omega.get(i).map_or(0.0, |w: &f64| w * w);
        DMatrix::from_fn(self.order(), self.order(), |i, j| if i == j { square(i) } else { 0.0 })
    }

    /// v·Cv for C = C0 + T C1, with T K more when `implicit`, of a real v: as a sum of squares, which cannot become negative by
    /// rounding where a stiff damper hardly moves.
    pub fn loss(&self, period: f64, implicit: bool, v: &DVector<f64>) -> f64 {
        let stored = || self.omega.iter().zip(v.iter()).map(|(w, v)| (w * v) * (w * v)).sum::<f64>();
        let following = (&self.per_period_rows * v).norm_squared() + if implicit { stored() } else { 0.0 };
        (&self.fixed_rows * v).norm_squared() + period * following
    }

    /// C = C0 + T C1, with T K more when `implicit`.
    pub fn damping(&self, period: f64, implicit: bool) -> DMatrix<f64> {
        let damping = &self.fixed + &self.per_period * period;
        if implicit { damping + self.stiffness() * period } else { damping }
    }

    /// A T of the module documentation with the given damping: (p + m)², p positions and m velocities.
    pub fn step(&self, period: f64, damping: &DMatrix<f64>) -> DMatrix<f64> {
        let (p, m) = (self.omega.len(), self.order());
        let mut a = DMatrix::zeros(p + m, p + m);
        for (i, omega) in self.omega.iter().enumerate() {
            a[(i, p + i)] = omega * period;
            a[(p + i, i)] = -omega * period;
        }
        a.view_mut((p, p), (m, m)).copy_from(&(damping * -period));
        a
    }
}

/// The row bᵀ M^{-1/2} of a link: the relative motion of its ends.
pub(crate) fn reach(part: &Part, link: &Link) -> DVector<f64> {
    let mut row = DVector::zeros(part.inertia.len());
    row[link.body] = 1.0 / part.inertia[link.body].sqrt();
    if let Some(other) = link.other {
        row[other] = -1.0 / part.inertia[other].sqrt();
    }
    row
}

/// The rows bᵀ M^{-1/2} v √weight, one a link with weight above 0.
pub(crate) fn rows(part: &Part, v: &DMatrix<f64>, weight: impl Fn(&Link, f64) -> f64) -> DMatrix<f64> {
    let rows: Vec<_> = part
        .links
        .iter()
        .filter_map(|link| {
            let reach = reach(part, link);
            let weight = weight(link, reach.norm_squared());
            (weight > 0.0).then(|| reach.transpose() * v * weight.sqrt())
        })
        .collect();
    DMatrix::from_fn(rows.len(), v.ncols(), |i, j| rows[i][j])
}

/// Σ weight (bᵀ M^{-1/2} v)ᵀ (bᵀ M^{-1/2} v) over the links; weights of either sign.
pub(crate) fn form(part: &Part, v: &DMatrix<f64>, weight: impl Fn(&Link) -> f64) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(v.ncols(), v.ncols());
    for link in part.links.iter().filter(|l| weight(l) != 0.0) {
        let across = reach(part, link).transpose() * v;
        sum += across.transpose() * &across * weight(link);
    }
    sum
}

/// The undamped modes of a part, orthonormal in w = M^{-1/2} V y.
pub(crate) struct UndampedModes {
    /// Increasing.
    pub omega: Vec<f64>,
    /// A column each.
    pub modes: DMatrix<f64>,
    /// The shifts without a restoring spring: one column per cluster without an anchor.
    pub shifts: DMatrix<f64>,
}

impl UndampedModes {
    /// # Errors
    /// [`Error::Eigenvalues`] when a frequency is beyond double precision.
    pub fn new(part: &Part) -> Result<Self, Error> {
        let (mut modes, shifts) = basis(part);
        let mut g = rows(part, &modes, |link, _| link.stiffness);
        orthogonalise(&mut g, &mut modes);
        let omega: Vec<f64> = g.column_iter().map(|c| c.norm()).collect();
        let size = part.inertia.iter().map(|m| m.sqrt()).fold(0.0, f64::max);
        if !(omega.iter().all(|w| w.is_finite() && *w > 0.0 && (w * w).is_normal()) && size.is_finite()) {
            return Err(Error::Eigenvalues { order: 2 * part.inertia.len() });
        }
        let mut by_frequency: Vec<usize> = (0..omega.len()).collect();
        by_frequency.sort_by(|&i, &j| omega[i].total_cmp(&omega[j]));
        let sorted = by_frequency.iter().map(|&i| omega[i]).collect();
        Ok(UndampedModes { omega: sorted, modes: modes.select_columns(&by_frequency), shifts })
    }
}

/// Groups of equal frequencies, each with its mean.
pub(crate) fn of_one_frequency(omega: &[f64]) -> Vec<(f64, std::ops::Range<usize>)> {
    let mut from = 0;
    let run = |group: &[f64]| {
        let range = from..from + group.len();
        from += group.len();
        (group.iter().sum::<f64>() / group.len() as f64, range)
    };
    omega.chunk_by(|a, b| b - a <= SAME * b).map(run).collect()
}

impl Modal {
    /// # Errors
    /// [`Error::Eigenvalues`] when a frequency or damping is beyond double precision.
    pub fn new(part: &Part) -> Result<Self, Error> {
        let n = part.inertia.len();
        let UndampedModes { omega, modes, mut shifts } = UndampedModes::new(part)?;
        let mut unit_count = shifts.ncols();
        if !part.grounded {
            // The momentum of the whole part, in terms of its clusters' shifts.
            let total: f64 = part.inertia.iter().sum();
            let whole = DVector::from_iterator(n, part.inertia.iter().map(|m| (m / total).sqrt()));
            shifts = &shifts * complement(&(shifts.transpose() * whole));
            unit_count += 1;
        }
        let no_columns = || DMatrix::<f64>::zeros(n, 0);
        let (mut undamped, mut compensated, mut kept, mut kept_shapes) = (vec![], vec![], vec![], no_columns());
        let (mut undamped_shapes, mut compensated_shapes) = (no_columns(), no_columns());
        let follows = part.links.iter().any(|l| l.per_period > 0.0);
        let difference = form(part, &DMatrix::identity(n, n), |l| l.per_period - l.stiffness);
        for (w, group) in of_one_frequency(&omega) {
            let shapes = modes.columns_range(group).into_owned();
            // Unit rows: the location of a damper counts, not its size.
            let seen = rows(part, &shapes, |l, reach| f64::from(u8::from(l.fixed > 0.0 || l.per_period > 0.0)) / reach);
            let (null, shapes) = separate(seen, shapes);
            undamped.extend(std::iter::repeat_n(w, null.ncols()));
            undamped_shapes = hcat(&undamped_shapes, &null);
            let (null, shapes) = if follows {
                let seen = rows(part, &shapes, |l, reach| f64::from(u8::from(l.fixed > 0.0)) / reach);
                let uncovered = &difference * &shapes / (w * w);
                let all = DMatrix::from_fn(seen.nrows() + n, shapes.ncols(), |i, j| {
                    if i < seen.nrows() { seen[(i, j)] } else { uncovered[(i - seen.nrows(), j)] }
                });
                separate(all, shapes)
            } else {
                (no_columns(), shapes)
            };
            compensated.extend(std::iter::repeat_n(w, null.ncols()));
            compensated_shapes = hcat(&compensated_shapes, &null);
            kept.extend(std::iter::repeat_n(w, shapes.ncols()));
            kept_shapes = hcat(&kept_shapes, &shapes);
        }
        let v = hcat(&kept_shapes, &shifts);
        let fixed_rows = rows(part, &v, |l, _| l.fixed);
        let per_period_rows = rows(part, &v, |l, _| l.per_period);
        let coupled = Coupled {
            fixed: fixed_rows.transpose() * &fixed_rows,
            per_period: form(part, &v, |l| l.per_period),
            uncovered: form(part, &v, |l| l.per_period - l.stiffness),
            covered: part.links.iter().all(|l| l.per_period >= l.stiffness),
            omega: kept,
            fixed_rows,
            per_period_rows,
        };
        if coupled.fixed.iter().chain(coupled.per_period.iter()).chain(coupled.uncovered.iter()).all(|x| x.is_finite())
        {
            let shapes = hcat(&hcat(&undamped_shapes, &compensated_shapes), &v);
            Ok(Modal { unit_count, undamped, compensated, coupled, shapes })
        } else {
            Err(Error::Eigenvalues { order: 2 * n })
        }
    }
}

/// An orthonormal basis in which the shift of each cluster without an anchor, M^{1/2} 1, is a column of the second matrix,
/// and no column of the first matrix moves such a cluster as a whole.
fn basis(part: &Part) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = part.inertia.len();
    let mut all = DMatrix::<f64>::identity(n, n);
    let mut is_shift = vec![false; n];
    for cluster in part.clusters.iter().filter(|c| !c.anchored) {
        let total: f64 = cluster.bodies.iter().map(|&i| part.inertia[i]).sum();
        let shift = DVector::from_iterator(
            cluster.bodies.len(),
            cluster.bodies.iter().map(|&i| (part.inertia[i] / total).sqrt()),
        );
        let (reflection, heaviest) = reflection(&shift);
        for (a, &i) in cluster.bodies.iter().enumerate() {
            for (b, &j) in cluster.bodies.iter().enumerate() {
                all[(i, j)] = reflection[(a, b)];
            }
        }
        is_shift[cluster.bodies[heaviest]] = true;
    }
    let columns = |shift: bool| (0..n).filter(|&i| is_shift[i] == shift).collect::<Vec<_>>();
    (all.select_columns(&columns(false)), all.select_columns(&columns(true)))
}

/// The Householder reflection whose column at the largest entry of p is -p, for a unit vector with entries of 0 or more, and the
/// index of that entry. With the largest, the other columns stay near those of the identity, which separates light bodies.
fn reflection(p: &DVector<f64>) -> (DMatrix<f64>, usize) {
    let at = p.iter().enumerate().fold(0, |best, (i, x)| if *x > p[best] { i } else { best });
    let mut u = p.clone();
    u[at] += 1.0;
    let size = u.norm_squared();
    (DMatrix::identity(p.len(), p.len()) - &u * u.transpose() * (2.0 / size), at)
}

/// An orthonormal basis of the orthogonal complement of the unit vector p.
fn complement(p: &DVector<f64>) -> DMatrix<f64> {
    if p.is_empty() {
        return DMatrix::zeros(0, 0);
    }
    let (reflection, at) = reflection(&p.abs());
    // Entries of p have either sign: reflect |p|, then restore the signs.
    let signs = p.map(|x| if x < 0.0 { -1.0 } else { 1.0 });
    DMatrix::from_fn(p.len(), p.len(), |i, j| signs[i] * reflection[(i, j)]).remove_column(at)
}

/// Rotates the shapes so that as many as possible lie in the null space of the rows. Returns these, and the others.
pub(crate) fn separate(mut seen: DMatrix<f64>, mut shapes: DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    if shapes.ncols() > 1 {
        orthogonalise(&mut seen, &mut shapes);
    }
    let (others, null): (Vec<usize>, Vec<usize>) =
        (0..shapes.ncols()).partition(|&j| seen.column(j).norm() > NEGLIGIBLE);
    (shapes.select_columns(&null), shapes.select_columns(&others))
}

pub(crate) fn hcat(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let columns = a.ncols() + b.ncols();
    DMatrix::from_fn(a.nrows(), columns, |i, j| if j < a.ncols() { a[(i, j)] } else { b[(i, j - a.ncols())] })
}
