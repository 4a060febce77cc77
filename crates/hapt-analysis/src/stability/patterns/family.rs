//! The maps of the hands-off loop from one sample to the next, one for each interval and delay.
//!
//! World and estimator step by the nominal period for any true interval, so that only the puck's motion depends on it. With
//! X(h, d) the change of (z, ż, τ), and with a handle on a shaft of (s, ḣ), over an interval h whose command arrives after d,
//!
//! ```text
//! s_{k+1} = s_k + (F + G X(h, d)) s_k
//! ```
//!
//! In units of a time r, q = (z, r ż, r² τ/J) obeys q' = A q + B c, c = r² command/J. With s = (h - d)/r, the new command c and the old one c₀,
//!
//! ```text
//! ∂²q/∂h² = A e^{As} (e^{Ad/r} (A q + B c₀) + B (c - c₀))/r²,    ∂²q/∂d² = -A e^{As} B (c₀ - c)/r²
//! ```
//!
//! The symmetric part of A has no eigenvalue above 1/√2, so that |e^{As}| ≤ e^{s/√2} for s ≥ 0. With a handle q has two more entries,
//! r √(k/J) s and r √(J_h/J) ḣ, in which the shaft's spring is skew and its damping negative: the bound stays.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{DMatrix, DVector, RowDVector};

use crate::equations::closed_loop::{ClosedLoop, Hold};
use crate::equations::port::Port;

/// The times that follow a sample, both in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    /// To the next sample.
    pub interval: f64,
    /// To the arrival of its command.
    pub delay: f64,
}

/// See the module documentation.
pub(crate) struct Family<'a> {
    parts: &'a ClosedLoop<'a>,
    damping: f64,
    port: &'a Port,
    lag: f64,
    /// Whether a command may arrive after its sample, so that the one before is part of the state.
    late: bool,
    /// F.
    fixed: DMatrix<f64>,
    /// G.
    effect: DMatrix<f64>,
}

/// Intervals and delays between two of each, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
    pub interval: [f64; 2],
    pub delay: [f64; 2],
}

/// Bounds of the second derivatives of a family in one norm.
pub(crate) struct Curvature {
    reference: f64,
    /// How fast e^{-As} may grow.
    back: f64,
    gain: f64,
    before: f64,
    switch: f64,
}

impl<'a> Family<'a> {
    pub fn new(parts: &'a ClosedLoop<'a>, damping: f64, port: &'a Port, late: bool) -> Self {
        let still = vec![RowDVector::zeros(parts.order); parts.places().len()];
        let fixed = parts.map(&still);
        // Affine in the change: its column is what one unit changes.
        let mut effect = DMatrix::zeros(parts.order, still.len());
        for i in 0..still.len() {
            let mut moved = still.clone();
            moved[i][parts.velocity] = 1.0;
            effect.set_column(i, &(parts.map(&moved) - &fixed).column(parts.velocity));
        }
        let lag = if parts.motor.is_some() { port.lag } else { 0.0 };
        Family { parts, damping, port, lag, late, fixed, effect }
    }

    /// Whether nothing but the puck moves from one sample to the next, so that after no time nothing has changed: no bodies, no estimator.
    pub fn stands_at_zero(&self) -> bool {
        !self.late && self.fixed.iter().all(|x| *x == 0.0)
    }

    /// The number of states.
    pub fn order(&self) -> usize {
        self.parts.order
    }

    /// The change of the state over a step: the map less 1.
    pub fn at(&self, step: Step) -> DMatrix<f64> {
        let before = if self.late { step.delay } else { 0.0 };
        let change = self.parts.puck(self.damping, Hold { interval: step.interval, before, age: 0 });
        let mut d = self.fixed.clone();
        for (i, row) in change.iter().enumerate() {
            d += self.effect.column(i) * row;
        }
        d
    }

    /// The bounds in the norm |C s|, with the longest interval as reference.
    pub fn curvature(&self, c: &DMatrix<f64>, inverse: &DMatrix<f64>, reference: f64) -> Curvature {
        let r = reference;
        let inertia = self.port.inertia;
        let [loss, rate] = [self.damping * r / inertia, if self.lag > 0.0 { r / self.lag } else { 0.0 }];
        let torque = r * r / inertia;
        let places = self.parts.places();
        let n = places.len();
        let mut a = DMatrix::zeros(n, n);
        // Without a lag the command is no state, and its row and column are 0.
        (a[(0, 1)], a[(1, 1)], a[(1, 2)], a[(2, 2)]) = (1.0, -loss, if self.lag > 0.0 { 1.0 } else { 0.0 }, -rate);
        let mut b = DVector::zeros(n);
        b[if self.lag > 0.0 { 2 } else { 1 }] = if self.lag > 0.0 { rate } else { 1.0 };
        // One unit of each state in q.
        let mut unit = vec![1.0, r, torque];
        let mut losses = loss;
        if let Some((handle, _)) = self.port.handle {
            let ratio = (handle.inertia / inertia).sqrt();
            let [swing, slip] = [r * (handle.stiffness / inertia).sqrt(), handle.damping * r / inertia];
            a[(1, 1)] -= slip;
            (a[(1, 3)], a[(3, 1)]) = (swing, -swing);
            (a[(3, 4)], a[(4, 3)]) = (swing / ratio, -swing / ratio);
            (a[(1, 4)], a[(4, 1)], a[(4, 4)]) = (slip / ratio, slip / ratio, -slip / (ratio * ratio));
            unit.extend([swing, r * ratio]);
            losses += slip + slip / (ratio * ratio);
        }
        // Without a lag there is no third row.
        let outer = unit.iter().enumerate().map(|(i, unit)| if i == 2 && self.lag == 0.0 { 0.0 } else { 1.0 / unit });
        let outer = DMatrix::from_diagonal(&DVector::from_iterator(n, outer));
        let mut q = DMatrix::zeros(n, self.order());
        for (i, (place, unit)) in places.into_iter().zip(unit).enumerate().skip(1) {
            if let Some(place) = place {
                q[(i, place)] = unit;
            }
        }
        let new = self.parts.command(0) * torque;
        let old = if self.late { self.parts.command(1) * torque } else { new.clone() };
        // No change depends on where the puck is: A times the first unit vector is 0.
        let mut before = &a * q + &b * &old;
        before.row_mut(0).fill(0.0);
        Curvature {
            reference: r,
            back: FRAC_1_SQRT_2 + losses.max(rate),
            gain: (c * &self.effect * outer * &a).norm(),
            before: (before * inverse).norm(),
            switch: (b * (new - old) * inverse).norm(),
        }
    }
}

impl Cell {
    pub fn corners(&self) -> [Step; 4] {
        let [[h0, h1], [d0, d1]] = [self.interval, self.delay];
        [[h0, d0], [h1, d0], [h0, d1], [h1, d1]].map(|[interval, delay]| Step { interval, delay })
    }
}

impl Curvature {
    /// How far the maps of a cell lie from the mean of its corners at most: along the intervals and along the delays.
    pub fn error(&self, cell: &Cell) -> [f64; 2] {
        let r = self.reference;
        let grown = |s: f64| if s >= 0.0 { (FRAC_1_SQRT_2 * s).exp() } else { (self.back * -s).exp() };
        let [s0, s1] = [(cell.interval[0] - cell.delay[1]) / r, (cell.interval[1] - cell.delay[0]) / r];
        let most = grown(s0).max(grown(s1));
        let along = (FRAC_1_SQRT_2 * cell.delay[1] / r).exp() * self.before + self.switch;
        let part = |[from, to]: [f64; 2]| ((to - from) / r).powi(2) / 8.0;
        [part(cell.interval) * self.gain * most * along, part(cell.delay) * self.gain * most * self.switch]
    }
}
