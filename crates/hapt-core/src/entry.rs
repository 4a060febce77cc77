//! The puck's position in a world that it enters: a place without torque.

use crate::nonlinear::{Nonlinear, Relative};
use crate::spec::{Linear, sign_at_puck};
use crate::{End, Spec};

/// The most steps from the world's 0 to the other side of a rest, and the halvings between both.
const STEPS: u32 = 256;
const HALVINGS: u32 = 64;
/// How near the rest is found without counts, in rad (linear: m).
const NEAR: f64 = 1e-9;

impl Spec<'_> {
    /// The position at which the puck enters this world where its origin may be placed: with the bodies at their start, the first rest in
    /// the direction in which the energy of the couplings at the puck falls from the world's 0, to the nearest count; 0 where there is
    /// none. At rest the torque of the couplings is 0, and they store no more than at 0 (docs/theory.md, (T82)).
    ///
    /// ```
    /// use hapt_core::{End, Law, Spec};
    ///
    /// let detent = Law::Detent { torque: 5e-3, pitch: 0.2, phase: 0.03 }.between(End::Puck, End::Ground);
    /// let spec = Spec { couplings: &[detent], ..Spec::new(1e-3) };
    /// assert!((spec.entry() - 0.03).abs() < 1e-8); // the bottom of the detent
    /// ```
    pub fn entry(&self) -> f64 {
        let near = self.count.map_or(NEAR, |count| 0.5 * count);
        let stiffness: f64 = self
            .couplings
            .iter()
            .filter(|c| sign_at_puck(c.first, c.second) != 0.0)
            .map(|c| c.law.slopes().stiffness)
            .sum();
        // Constants without springs push everywhere.
        if stiffness <= 0.0 {
            return 0.0;
        }
        let here = self.torque_at_rest(0.0);
        let [ahead, behind] = [1.0, -1.0].map(|side| side * self.torque_at_rest(side * near));
        // In the direction of falling energy; from a maximum, to a side on which it falls.
        let side = match here {
            _ if here > 0.0 => 1.0,
            _ if here < 0.0 => -1.0,
            _ if ahead > 0.0 => 1.0,
            _ if behind > 0.0 => -1.0,
            _ => return 0.0,
        };
        // The torque in this direction, and the stored energy, after a displacement.
        let after = |travel: f64| (side * self.torque_at_rest(side * travel), self.stored_at_rest(side * travel));
        let (mut travel, mut torque, mut stored, mut step) = (0.0, here.abs(), self.stored_at_rest(0.0), near);
        let mut beyond = None;
        for _ in 0..STEPS {
            // The torque falls to 0 no sooner than this far.
            step = step.max(torque / stiffness).max(near);
            let (next, lower) = after(travel + step);
            if next <= 0.0 || lower > stored {
                beyond = Some(travel + step);
                break;
            }
            let slope = (torque - next) / step;
            (travel, torque, stored) = (travel + step, next, lower);
            step = if slope > 0.0 { (torque / slope).min(4.0 * step) } else { 2.0 * step };
        }
        let Some(mut beyond) = beyond else { return 0.0 };
        // There is a rest in between: beyond it the energy rises.
        for _ in 0..HALVINGS {
            let middle = 0.5 * (travel + beyond);
            let (on, lower) = after(middle);
            if on > 0.0 && lower <= stored {
                (travel, stored) = (middle, lower);
            } else {
                beyond = middle;
            }
        }
        let rest = side * travel;
        let rest = self.count.map_or(rest, |count| libm::floor(rest / count + 0.5) * count);
        if self.stored_at_rest(rest) <= self.stored_at_rest(0.0) { rest } else { 0.0 }
    }

    /// The torque of the couplings at the puck in N·m (linear: N), with everything at rest, the puck at `position` and the bodies at their start.
    fn torque_at_rest(&self, position: f64) -> f64 {
        let mut torque = 0.0;
        for coupling in self.couplings {
            let sign = sign_at_puck(coupling.first, coupling.second);
            if sign == 0.0 {
                continue;
            }
            let q = self.place(coupling.first, position) - self.place(coupling.second, position);
            torque += sign
                * match coupling.linear() {
                    Some(Linear { stiffness, torque, .. }) => torque - stiffness * q,
                    None => {
                        let law = Nonlinear::<f64>::new(coupling, 0.0, false);
                        law.map_or(0.0, |law| law.torque(Relative { position: q, velocity: 0.0 }, 0.0))
                    }
                };
        }
        torque
    }

    /// The energy that they store there, in J.
    fn stored_at_rest(&self, position: f64) -> f64 {
        let at_puck = self.couplings.iter().filter(|c| sign_at_puck(c.first, c.second) != 0.0);
        at_puck.map(|c| c.stored(self.place(c.first, position) - self.place(c.second, position), 0.0)).sum()
    }

    fn place(&self, end: End, puck: f64) -> f64 {
        match end {
            End::Puck => puck,
            End::Ground => 0.0,
            End::Body(index) => self.bodies.get(index).map_or(0.0, |body| body.position),
        }
    }
}
