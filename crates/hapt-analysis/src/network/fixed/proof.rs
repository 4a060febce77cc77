//! Whether a matrix that depends on a frequency has no negative eigenvalue at any, between computed frequencies too.
//!
//! Over an interval c ± h a matrix is F(c) + x F'(c) up to x²/2 times the bound of its second derivative. The least eigenvalue of
//! F(c) + x F'(c) is concave in x: where it is no less than h²/2 times that bound at both ends, the interval is proved. Others are
//! halved.

use std::f64::consts::PI;

use nalgebra::DMatrix;

use super::form::{C, Form};

/// The relative margin of a searched value, to the safe side.
const SAFE: f64 = 1e-7;
/// Rounding of a matrix, in parts of its size.
const ROUNDING: f64 = 1e-13;
/// The most intervals of one search.
const INTERVALS: usize = 20_000;

/// A family of matrices: diag(`damping` of each station) + `scale` · links + local.
pub(super) struct Member {
    pub damping: Vec<f64>,
    pub scale: f64,
}

/// The form at one angle.
struct At {
    links: DMatrix<C>,
    local: DMatrix<C>,
}

/// A value at the edge, and the angle that sets it; no angle where none does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extreme {
    pub value: f64,
    pub angle: Option<f64>,
}

/// Whether the matrix has no eigenvalue below `least`: its decomposition has no negative pivot.
fn is_above(matrix: &DMatrix<C>, least: f64) -> bool {
    let n = matrix.nrows();
    let mut m = matrix.clone();
    for k in 0..n {
        let pivot = m[(k, k)].re - least;
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        for i in k + 1..n {
            let factor = m[(i, k)] / pivot;
            for j in k + 1..=i {
                let product = factor * m[(j, k)].conj();
                m[(i, j)] -= product;
            }
        }
    }
    true
}

impl Form {
    fn sum(&self, at: &At, member: &Member) -> DMatrix<C> {
        let mut sum = &at.links * C::from(member.scale) + &at.local;
        for (i, station) in self.station.iter().enumerate() {
            sum[(i, i)] += member.damping[*station];
        }
        sum
    }

    fn look(&self, angle: f64) -> At {
        At { links: self.links.at(angle, false), local: self.local.at(angle, false) }
    }

    fn rounding(&self, member: &Member) -> f64 {
        let most = member.damping.iter().fold(0.0, |most: f64, b| most.max(b.abs()));
        ROUNDING * (most + member.scale * self.links.size + self.local.size)
    }

    fn holds(&self, at: &At, member: &Member) -> bool {
        is_above(&self.sum(at, member), self.rounding(member))
    }

    /// Whether an interval is proved.
    fn is_proved(&self, [low, high]: [f64; 2], at: &At, member: &Member) -> bool {
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let bend = member.scale * self.links.bend + self.local.bend;
        let least = 0.5 * half * half * bend + self.rounding(member);
        let sum = self.sum(at, member);
        let slope = (self.links.at(middle, true) * C::from(member.scale) + self.local.at(middle, true)) * C::from(half);
        is_above(&(&sum + &slope), least) && is_above(&(&sum - &slope), least)
    }

    /// Whether one member has no negative eigenvalue at any angle: `Ok`, or the angle where it has one; `None` where the search does
    /// not decide.
    pub fn passive(&self, member: &Member) -> Option<Result<(), f64>> {
        let mut todo = Vec::new();
        for angle in [0.0, PI] {
            if !self.holds(&self.look(angle), member) {
                return Some(Err(angle));
            }
        }
        todo.push([0.0, PI]);
        for _ in 0..INTERVALS {
            let Some([low, high]) = todo.pop() else { return Some(Ok(())) };
            let middle = 0.5 * (low + high);
            let at = self.look(middle);
            if self.is_proved([low, high], &at, member) {
                continue;
            }
            if !self.holds(&at, member) {
                return Some(Err(middle));
            }
            todo.extend([[middle, high], [low, middle]]);
        }
        None
    }

    /// The value next to `from` at which the member that it names has no negative eigenvalue at any angle: the least one where `up`, else the
    /// largest one up to `from`. Every value beyond, or below, has none either. `None`: none is found.
    pub fn extreme(&self, from: f64, up: bool, member: impl Fn(f64) -> Member) -> Option<Extreme> {
        let mut found = Extreme { value: from, angle: None };
        for angle in [0.0, PI] {
            self.improve(&mut found, angle, &self.look(angle), up, &member)?;
        }
        let mut todo = vec![[0.0, PI]];
        for _ in 0..INTERVALS {
            let Some([low, high]) = todo.pop() else { return Some(found) };
            let middle = 0.5 * (low + high);
            let at = self.look(middle);
            self.improve(&mut found, middle, &at, up, &member)?;
            if !self.is_proved([low, high], &at, &member(found.value)) {
                todo.extend([[middle, high], [low, middle]]);
            }
        }
        None
    }

    /// Moves the value to where it holds at one angle.
    fn improve(
        &self,
        found: &mut Extreme,
        angle: f64,
        at: &At,
        up: bool,
        member: &impl Fn(f64) -> Member,
    ) -> Option<()> {
        let holds = |value: f64| self.holds(at, &member(value));
        if holds(found.value) {
            return Some(());
        }
        let (mut bad, mut good) = (found.value, if up { found.value.max(1.0) } else { 0.0 });
        while up && !holds(good) {
            (bad, good) = (good, 2.0 * good);
            if good > 1e30 {
                return None;
            }
        }
        if !up && !holds(good) {
            return None;
        }
        while (good - bad).abs() > 0.01 * SAFE * good.abs().max(bad.abs()) && good.abs().max(bad.abs()) > 1e-30 {
            let middle = 0.5 * (good + bad);
            if holds(middle) { good = middle } else { bad = middle }
        }
        *found = Extreme { value: good * if up { 1.0 + SAFE } else { 1.0 - SAFE }, angle: Some(angle) };
        Some(())
    }
}
