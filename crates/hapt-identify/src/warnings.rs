//! The warnings that go with a result.

use crate::handle::WithHandle;
use crate::identified::{CorrelatedPair, Identified};
use crate::interval::Interval;

/// The largest correlation at which the residuals count as independent.
const INDEPENDENT: f64 = 0.1;
/// The residual in counts of half a count of noise with rounding: the root of 1/4 + 1/12, less a margin.
const LEAST_NOISE: f64 = 0.55;

impl CorrelatedPair {
    fn warning(&self) -> String {
        let CorrelatedPair { names: [one, other], correlation } = self;
        format!(
            "this record hardly separates {one} from {other} (their estimates are correlated by {correlation:.4}); record other speeds and accelerations too"
        )
    }
}

impl WithHandle {
    /// Reasons to doubt the result, a sentence each.
    pub fn warnings(&self) -> Vec<String> {
        self.correlated.iter().map(CorrelatedPair::warning).collect()
    }
}

impl Identified {
    /// Reasons to doubt the result, a sentence each.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.is_exact {
            return warnings;
        }
        warnings.extend(self.correlated.iter().map(CorrelatedPair::warning));
        let step = self.lattice.map_or(0.0, |lattice| lattice.step);
        if self.residual.correlation.abs() > INDEPENDENT {
            warnings.push(format!(
                "the residuals of the fit are not independent noise (neighbours are correlated by {:.2}): something else moves the device too; the intervals are wider for it, and may still be too narrow",
                self.residual.correlation
            ));
        } else if self.residual.rms < LEAST_NOISE * step {
            warnings.push(
                "the positions carry less than half a count of noise: where the motion is slow, counts are not independent noise, and the intervals may miss the true value more often than once in 20; move faster, or use a finer encoder"
                    .into(),
            );
        }
        if self.sign.is_some() && self.offset.is_none() && self.friction.is_none() {
            warnings.push(
                "a constant torque (a tilted table, a motor's offset) moves the puck, and this record does not separate it from friction: neither is given; record motion in both directions"
                    .into(),
            );
        } else if self.sign.is_some() && self.offset.is_none() {
            warnings.push(
                "this record does not separate a constant torque (a tilted table, a motor's offset) from friction: it is taken as zero; record motion in both directions"
                    .into(),
            );
        }
        let below = [
            ("damping", self.rates[0].is_none(), "something drives the puck along its motion"),
            (
                "friction",
                self.friction.is_none() && self.offset.is_some(),
                "something drives the puck along its motion",
            ),
            (
                "delay",
                self.delay.is_none() && self.sign.is_some(),
                "the torques are of later samples than the positions",
            ),
        ];
        for (name, is_below, reason) in below {
            if is_below {
                warnings.push(format!(
                    "the fit is best with a {name} below 0, which no device has, so it is not given; {reason}"
                ));
            }
        }
        let uncertain = |interval: Option<Interval>| interval.is_some_and(|x| x.low == 0.0 && x.high > 0.0);
        for (name, interval) in [("damping", self.damping), ("friction", self.friction)] {
            if uncertain(interval) {
                warnings.push(format!("the {name} may be zero: its interval begins at 0"));
            }
        }
        warnings
    }
}
