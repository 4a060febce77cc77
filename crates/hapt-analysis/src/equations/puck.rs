//! The puck under a held command of the motor, with a hand's spring and the motor's lag.
//!
//! ```text
//! J z̈ + b ż + k z = τ,    lag τ̇ = command - τ
//! ```

use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::numerics::phi::phi;

/// The puck and its motor. Without a lag the torque is the command, and the third row and column of [`DrivenPuck::over`] are 0.
#[derive(Clone, Copy)]
pub(crate) struct DrivenPuck {
    pub inertia: f64,
    pub damping: f64,
    pub spring: f64,
    /// The time constant with which the torque follows the command, s; 0: at once.
    pub lag: f64,
}

/// The change of (z, ż, τ) over a stretch of time: matrix · (z, ż, τ) + push · command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Change {
    pub matrix: Matrix3<f64>,
    pub push: Vector3<f64>,
}

impl DrivenPuck {
    /// Over a time h under one command. With X of the differential equation on (z, h ż, h² τ/J), in which all entries are ratios of
    /// times, the change is X φ₁(X), and φ₁(X) times the command's column.
    pub fn over(&self, h: f64) -> Change {
        let DrivenPuck { inertia, damping, spring, lag } = *self;
        if h == 0.0 {
            return Change { matrix: Matrix3::zeros(), push: Vector3::zeros() };
        }
        let (swing, loss, force) = (-spring * h * h / inertia, -damping * h / inertia, h * h / inertia);
        // One unit of each coordinate in those of X, and what the command enters.
        let unit = [1.0, h, force];
        let (x, command) = if lag == 0.0 {
            (DMatrix::from_row_slice(2, 2, &[0.0, 1.0, swing, loss]), (1, force))
        } else {
            let rate = h / lag;
            (DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, swing, loss, 1.0, 0.0, 0.0, -rate]), (2, rate * force))
        };
        let (phi1, _) = phi(&x);
        let c = x * &phi1;
        let known = |i: usize, j: usize| i < c.nrows() && j < c.ncols();
        Change {
            matrix: Matrix3::from_fn(|i, j| if known(i, j) { c[(i, j)] * unit[j] / unit[i] } else { 0.0 }),
            push: Vector3::from_fn(|i, _| if known(i, i) { phi1[(i, command.0)] * command.1 / unit[i] } else { 0.0 }),
        }
    }
}

impl Change {
    /// The matrix of this change and then `next`, with the pushes of their commands.
    pub fn then(&self, next: &Change) -> (Matrix3<f64>, Vector3<f64>, Vector3<f64>) {
        let matrix = self.matrix + next.matrix + next.matrix * self.matrix;
        (matrix, self.push + next.matrix * self.push, next.push)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::phi::{phi1, phi2};
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn without_a_spring_it_is_the_free_puck(log in -6.0..1.5f64, h in 1e-5..1e-1f64) {
            let (inertia, x) = (6.4e-4, 10f64.powf(log));
            let puck = DrivenPuck { inertia, damping: x * inertia / h, spring: 0.0, lag: 0.0 };
            let Change { matrix, push } = puck.over(h);
            prop_assert_eq!([matrix[(0, 0)], matrix[(1, 0)]], [0.0, 0.0]);
            let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
            prop_assert!(close(matrix[(0, 1)], h * phi1(x)) && close(matrix[(1, 1)], (-x).exp_m1()));
            prop_assert!(close(push[0], h * h / inertia * phi2(x)) && close(push[1], h / inertia * phi1(x)));
        }

        #[test]
        fn an_undamped_swing_turns_by_its_angle(angle in 1e-4..20.0f64, h in 1e-5..1e-1f64) {
            let (inertia, omega) = (6.4e-4, angle / h);
            let puck = DrivenPuck { inertia, damping: 0.0, spring: inertia * omega * omega, lag: 0.0 };
            let Change { matrix, push } = puck.over(h);
            let ([a, b, c, d], [z, v]) = ([(0, 0), (0, 1), (1, 0), (1, 1)].map(|at| matrix[at]), [push[0], push[1]]);
            let (sin, less) = (angle.sin(), -2.0 * (0.5 * angle).sin().powi(2));
            let error = [a - less, b * omega - sin, c / omega + sin, d - less];
            prop_assert!(error.iter().all(|e| e.abs() < 1e-12), "{error:?}");
            // A held torque moves the rest by τ/k.
            let k = inertia * omega * omega;
            prop_assert!((z * k + less).abs() < 1e-12 && (v * k / omega - sin).abs() < 1e-12);
        }

        #[test]
        fn the_torque_follows_its_command_and_moves_a_light_puck(ratio in -4.0..3.0f64, h in 1e-5..1e-1f64) {
            // J v̇ = τ, lag τ̇ = c - τ from rest: τ = c (1 - e), v = c (h - lag (1 - e))/J, e = e^{-h/lag}.
            let (inertia, lag) = (6.4e-4, h * 10f64.powf(ratio));
            let change = DrivenPuck { inertia, damping: 0.0, spring: 0.0, lag }.over(h);
            let gone = -(-h / lag).exp_m1();
            let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-11;
            prop_assert!(close(change.push[2], gone), "{} {gone}", change.push[2]);
            prop_assert!(close(change.push[1], h / inertia * (1.0 - phi1(h / lag))) || ratio > 1.0);
            prop_assert!(close(change.matrix[(2, 2)], -gone) && close(change.matrix[(1, 2)], lag * gone / inertia));
        }

        #[test]
        fn two_stretches_are_one(part in 0.01..0.99f64, lag in prop_oneof![Just(0.0), 1e-5..1e-1f64], spring in 0.0..50.0f64) {
            let puck = DrivenPuck { inertia: 6.4e-4, damping: 1.2e-3, spring, lag };
            let whole = puck.over(2e-3);
            let (matrix, first, second) = puck.over(2e-3 * part).then(&puck.over(2e-3 * (1.0 - part)));
            for i in 0..3 {
                let close = |a: f64, b: f64| (a - b).abs() <= 1e-10 * (a.abs() + b.abs()) + 1e-14;
                prop_assert!((0..3).all(|j| close(matrix[(i, j)], whole.matrix[(i, j)])));
                prop_assert!(close(first[i] + second[i], whole.push[i]));
            }
        }
    }
}
