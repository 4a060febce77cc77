//! From one plan's torque to the next one's, without a step.

use hapt_core::Phase;

/// How long the last plan's torque takes to be forgotten, in s.
const FADE: f64 = 0.1;

/// What is added to the new plan's output so that it begins where the old one's was: an offset that fades.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bridge {
    /// The output before the swap, until the first after it.
    before: Option<f64>,
    offset: f64,
    /// From 1 to 0.
    left: f64,
}

impl Bridge {
    /// The plan changes after `output`.
    pub fn begin(&mut self, output: f64) {
        self.before = Some(output);
    }

    /// The output that the motor gets, for a sample of `period` s whose supervisor let `output` through; never beyond ±`limit`.
    pub fn over(&mut self, output: f64, phase: Phase, period: f64, limit: f64) -> f64 {
        if matches!(phase, Phase::Disarmed | Phase::Faulted) || !output.is_finite() {
            // No torque means none.
            *self = Bridge::default();
            return output;
        }
        if let Some(before) = self.before.take() {
            (self.offset, self.left) = (before - output, 1.0);
        }
        if self.left <= 0.0 {
            return output;
        }
        let sum = output + self.offset * self.left;
        self.left -= period / FADE;
        // A number and no clamp: what is not finite is the supervisor's to see.
        if sum > limit {
            limit
        } else if sum < -limit {
            -limit
        } else {
            sum
        }
    }
}
