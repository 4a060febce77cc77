//! The energy that a network keeps, as a Hermitian matrix at every frequency.
//!
//! All hands may move as they like. Within a stretch of time in which a station takes no sample and its torque does not change, the
//! damping takes b δ²/h at least, δ the displacement and h the length, and the torque gives τ δ. Each torque of a link is
//! -K (z_i(a) - z_j(α)), a and α the instants of its two positions. The stored energy of its ideal spring, K (z_i - z_j)²/2, comes back;
//! without it the link keeps
//!
//! ```text
//! Σ K (z_j(t) - z_j(α) - z_i(t) + z_i(a)) δ_i
//! ```
//!
//! over stretches in which neither puck turns, t their middle: a form in displacements that go back no further than the ages. With the
//! displacements over the stretches of a common period as e^{jφp} times a vector the form is a trigonometric polynomial in φ. The network
//! is passive exactly where that matrix has no negative eigenvalue for 0 ≤ φ ≤ π.

use std::collections::BTreeMap;

use hapt_model::{Link, System};
use nalgebra::{Complex, DMatrix};

use super::schedule::{Clock, Schedule};

pub(super) type C = Complex<f64>;

/// The entries of Σ C_l e^{-jφl}, by the power l and the place in the matrix, column by column.
#[derive(Default)]
struct Terms(BTreeMap<i64, BTreeMap<[usize; 2], f64>>);

impl Terms {
    fn add(&mut self, shift: i64, row: usize, column: usize, value: f64) {
        *self.0.entry(shift).or_default().entry([column, row]).or_default() += value;
    }

    fn polynomial(self, order: usize) -> Polynomial {
        let entry = |([column, row], value): ([usize; 2], f64)| (column * order + row, value);
        let terms = self.0.into_iter().map(|(shift, term)| (shift as f64, term.into_iter().map(entry).collect()));
        let terms: Vec<(f64, Vec<(usize, f64)>)> = terms.collect();
        let norm = |term: &[(usize, f64)]| term.iter().map(|(_, value)| value * value).sum::<f64>().sqrt();
        let size = terms.iter().map(|(_, term)| norm(term)).sum();
        let bend = terms.iter().map(|(shift, term)| shift * shift * norm(term)).sum();
        Polynomial { order, terms, size, bend }
    }
}

/// Σ C_l e^{-jφl} and its conjugate transpose, halved. Few entries of each C_l are not 0.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Polynomial {
    order: usize,
    /// Each power with its entries, by their place in the matrix.
    terms: Vec<(f64, Vec<(usize, f64)>)>,
    /// A bound of its norm.
    pub size: f64,
    /// A bound of the norm of its second derivative.
    pub bend: f64,
}

impl Polynomial {
    /// The matrix at φ, or its derivative by φ.
    pub fn at(&self, angle: f64, derivative: bool) -> DMatrix<C> {
        let mut sum = DMatrix::from_element(self.order, self.order, C::from(0.0));
        for (shift, term) in &self.terms {
            let turn = C::from_polar(0.5, -angle * shift) * if derivative { C::new(0.0, -shift) } else { C::from(1.0) };
            for (place, value) in term {
                sum[*place] += turn * *value;
            }
        }
        &sum + sum.adjoint()
    }
}

/// The energy that links and worlds keep, per displacement/√length.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Form {
    /// Of all links.
    pub links: Polynomial,
    /// Of the springs and dampers of the worlds.
    pub local: Polynomial,
    /// The station of each stretch; those without links have none.
    pub station: Vec<usize>,
}

impl Form {
    /// `local`: stiffness and damping between the puck of each station and ground; `counts`: whether the station's device has to supply
    /// damping.
    pub fn of(network: &System, schedule: &Schedule, local: &[[f64; 2]], counts: &[bool]) -> Form {
        let (mut station, mut first) = (Vec::new(), Vec::new());
        for (at, clock) in schedule.clocks.iter().enumerate() {
            first.push(station.len());
            station.extend((0..clock.segments()).filter(|_| counts[at]).map(|_| at));
        }
        let (mut links, mut local_terms) = (Terms::default(), Terms::default());
        for link in network.links.iter().filter(|link| link.acts()) {
            for to in link.between {
                add_end(&mut links, &first, schedule, link, to);
            }
        }
        for (at, (clock, [stiffness, damping])) in schedule.clocks.iter().zip(local).enumerate() {
            if !counts[at] {
                continue;
            }
            for segment in 0..clock.segments() {
                let (start, length) = (clock.start(segment), clock.length(segment));
                let (middle, row) = (start + 0.5 * length, first[at] + segment as usize);
                let sample = clock.acting(middle);
                let used = clock.sample(sample);
                let weight = length.sqrt();
                displacements(clock, [used, middle], |column, shift, part| {
                    local_terms.add(shift, row, first[at] + column, -stiffness * weight * part);
                });
                // -B (z_k - z_{k-1})/T
                displacements(clock, [clock.sample(sample - 1), used], |column, shift, part| {
                    let value = damping / clock.period * weight * part;
                    local_terms.add(shift, row, first[at] + column, value);
                });
            }
        }
        let order = station.len();
        Form { links: links.polynomial(order), local: local_terms.polynomial(order), station }
    }
}

/// The energy that the torque of one end of a link keeps; `first`: the first stretch of each station.
fn add_end(links: &mut Terms, first: &[usize], schedule: &Schedule, link: &Link, to: usize) {
    let from = link.between[usize::from(link.between[0] == to)];
    let (own, other, timing) = (schedule.clocks[to], schedule.clocks[from], schedule.message_timing(link, to));
    let stiffness = link.stiffness();
    for segment in 0..own.segments() {
        let [start, end] = [own.start(segment), own.start(segment + 1)];
        let row = first[to] + segment as usize;
        let sample = own.acting(0.5 * (start + end));
        let (measured, received) = (own.sample(sample), timing.used(sample));
        // Where the other's stretches end, the slope of its displacement changes.
        let mut from_here = start;
        while from_here < end {
            let step = 1e-9 * own.period;
            let next = other.start(other.segment_at(from_here + step) + 1);
            let until = if next < end - step { next } else { end };
            let middle = 0.5 * (from_here + until);
            let weight = stiffness * (until - from_here) / (end - start).sqrt();
            displacements(&own, [measured, middle], |column, shift, part| {
                links.add(shift, row, first[to] + column, -weight * part);
            });
            displacements(&other, [received, middle], |column, shift, part| {
                links.add(shift, row, first[from] + column, weight * part);
            });
            from_here = until;
        }
    }
}

/// The displacement of a puck between two instants: for each stretch in between its number in the common period, how many periods ago it
/// was, and its part, times √length.
fn displacements(clock: &Clock, [from, to]: [f64; 2], mut each: impl FnMut(usize, i64, f64)) {
    let count = clock.segments();
    let mut segment = clock.segment_at(from + 1e-9 * clock.period);
    loop {
        let (start, length) = (clock.start(segment), clock.length(segment));
        let part = (to.min(start + length) - from.max(start)) / length;
        if part <= 0.0 || start >= to {
            return;
        }
        each(segment.rem_euclid(count) as usize, -segment.div_euclid(count), part * length.sqrt());
        segment += 1;
    }
}
