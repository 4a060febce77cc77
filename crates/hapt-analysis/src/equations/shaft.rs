//! The puck under a held command of the motor, with a handle on a flexible shaft, and a hand on the handle.
//!
//! ```text
//! J z̈ + b ż = τ + k s + d ṡ,    s = h - z,    lag τ̇ = command - τ
//! J_h ḧ = -(k s + d ṡ) - c ḣ - g h
//! ```
//!
//! J_h is the inertia of handle and hand, c and g the damping and the spring of the hand.

use hapt_model::Handle;
use nalgebra::{DMatrix, SMatrix, SVector};

use crate::equations::grip::Grip;
use crate::equations::puck::DrivenPuck;
use crate::numerics::phi::phi;

/// The states z, ż, τ, s, ḣ.
pub(crate) const STATES: usize = 5;

/// A puck, its motor, and a handle in a hand. Without a lag the torque is the command, and its row and column of
/// [`DrivenShaft::over`] are 0.
#[derive(Clone, Copy)]
pub(crate) struct DrivenShaft {
    pub puck: DrivenPuck,
    pub handle: Handle,
    pub grip: Grip,
}

/// The change of (z, ż, τ, s, ḣ) over a stretch of time: matrix · state + push · command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShaftChange {
    pub matrix: SMatrix<f64, STATES, STATES>,
    pub push: SVector<f64, STATES>,
}

impl DrivenShaft {
    /// Over a time h under one command, as [`DrivenPuck::over`]: with X of the differential equation on (z, h ż, h² τ/J, s, h ḣ), in which
    /// all entries are ratios of times.
    pub fn over(&self, h: f64) -> ShaftChange {
        let DrivenShaft { puck: DrivenPuck { inertia, damping, spring, lag }, handle, grip } = *self;
        let mut change = ShaftChange { matrix: SMatrix::zeros(), push: SVector::zeros() };
        if h == 0.0 {
            return change;
        }
        let force = h * h / inertia;
        let unit = [1.0, h, force, 1.0, h];
        let own = [-spring * force, -(damping + handle.damping) * h / inertia, 1.0, handle.stiffness * force];
        let mass = handle.inertia + grip.inertia;
        let [swing, loss] = [h * h / mass, h / mass];
        let held = -grip.stiffness * swing;
        let rate = if lag > 0.0 { h / lag } else { 0.0 };
        let x = DMatrix::from_row_slice(
            STATES,
            STATES,
            &[
                [0.0, 1.0, 0.0, 0.0, 0.0],
                [own[0], own[1], if lag > 0.0 { 1.0 } else { 0.0 }, own[3], handle.damping * h / inertia],
                [0.0, 0.0, -rate, 0.0, 0.0],
                [0.0, -1.0, 0.0, 0.0, 1.0],
                [
                    held,
                    handle.damping * loss,
                    0.0,
                    held - handle.stiffness * swing,
                    -(handle.damping + grip.damping) * loss,
                ],
            ]
            .concat(),
        );
        let (entry, scale) = if lag > 0.0 { (2, rate * force) } else { (1, force) };
        let (phi1, _) = phi(&x);
        let c = x * &phi1;
        change.matrix = SMatrix::from_fn(|i, j| c[(i, j)] * unit[j] / unit[i]);
        change.push = SVector::from_fn(|i, _| phi1[(i, entry)] * scale / unit[i]);
        change
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    const HANDLE: Handle = Handle { inertia: 5e-4, stiffness: 20.0, damping: 0.0 };

    fn shaft(handle: Handle, grip: Grip, lag: f64) -> DrivenShaft {
        DrivenShaft { puck: DrivenPuck { inertia: 6.4e-4, damping: 0.0, spring: 0.0, lag }, handle, grip }
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(64))]

        #[test]
        fn a_free_shaft_turns_by_its_angle(angle in 1e-3..20.0f64, inertia in 1e-5..1e-2f64) {
            let handle = Handle { inertia, ..HANDLE };
            let all = 1.0 / 6.4e-4 + 1.0 / inertia;
            let omega = (20.0 * all).sqrt();
            let ShaftChange { matrix, .. } = shaft(handle, Grip::default(), 0.0).over(angle / omega);
            // From a deflection s at rest: s cos ωt, and ḣ - ż = -s ω sin ωt, with no momentum.
            let less = -2.0 * (0.5 * angle).sin().powi(2);
            let turn = -omega * angle.sin();
            prop_assert!((matrix[(3, 3)] - less).abs() < 1e-11 * (1.0 + angle));
            prop_assert!((matrix[(4, 3)] - matrix[(1, 3)] - turn).abs() < 1e-11 * omega * (1.0 + angle));
            prop_assert!((6.4e-4 * matrix[(1, 3)] + inertia * matrix[(4, 3)]).abs() < 1e-12 * omega * inertia.max(6.4e-4) * (1.0 + angle));
        }

        #[test]
        fn a_hand_of_great_mass_makes_it_a_puck_on_a_spring(h in 1e-4..1e-2f64, damping in 0.0..0.1f64, lag in prop_oneof![Just(0.0), 1e-4..1e-2f64]) {
            let handle = Handle { damping, ..HANDLE };
            let held = shaft(handle, Grip { inertia: 1e15, ..Grip::default() }, lag).over(h);
            let puck = DrivenPuck { inertia: 6.4e-4, damping, spring: 20.0, lag }.over(h);
            // The deflection is minus the puck's position.
            let close = |a: f64, b: f64| (a - b).abs() <= 1e-10 * (1.0 + a.abs().max(b.abs()));
            prop_assert!(close(-held.matrix[(1, 3)], puck.matrix[(1, 0)]) && close(held.matrix[(1, 1)], puck.matrix[(1, 1)]));
            prop_assert!(close(held.push[1], puck.push[1]) && close(held.push[0], puck.push[0]) && close(held.push[2], puck.push[2]));
        }

        #[test]
        fn two_stretches_of_a_shaft_are_one(part in 0.01..0.99f64, lag in prop_oneof![Just(0.0), 1e-5..1e-1f64], stiffness in 0.0..50.0f64) {
            let of = shaft(Handle { damping: 1e-3, ..HANDLE }, Grip { inertia: 1e-4, damping: 1e-3, stiffness }, lag);
            let (whole, first, second) = (of.over(2e-3), of.over(2e-3 * part), of.over(2e-3 * (1.0 - part)));
            let matrix = first.matrix + second.matrix + second.matrix * first.matrix;
            let push = first.push + second.push + second.matrix * first.push;
            let size = whole.matrix.amax();
            prop_assert!((matrix - whole.matrix).amax() <= 1e-10 * size, "{matrix} {}", whole.matrix);
            prop_assert!((push - whole.push).amax() <= 1e-10 * whole.push.amax());
        }
    }
}
