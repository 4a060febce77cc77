//! What has to be said about an answer before anybody relies on it.

use crate::estimate::{Identified, Interval, Twins};

/// The residuals of a model that fits are independent up to this.
const INDEPENDENT: f64 = 0.1;
/// What half a count of noise leaves when it is counted, in counts: the root of 1/4 + 1/12, less a little.
const LEAST_NOISE: f64 = 0.55;

impl Identified {
    /// What has to be said about it before anybody relies on it, a sentence each.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.is_exact {
            return warnings;
        }
        for Twins { names: [one, other], correlation } in &self.twins {
            warnings.push(format!(
                "this record hardly tells {one} and {other} apart (their estimates are correlated by {correlation:.4}); one that goes through other speeds and accelerations would"
            ));
        }
        let step = self.lattice.map_or(0.0, |lattice| lattice.step);
        if self.residual.correlation.abs() > INDEPENDENT {
            warnings.push(format!(
                "the residuals of the fit are not independent noise (neighbours are correlated by {:.2}): something else moves the device too, and the intervals are narrower than they should be",
                self.residual.correlation
            ));
        } else if self.residual.rms < LEAST_NOISE * step {
            warnings.push(
                "the positions carry less than half a count of noise: where the motion is slow, counts are no independent noise, and the intervals may miss the truth more often than once in 20; faster motion or a finer encoder would not"
                    .into(),
            );
        }
        if self.sign.is_some() && self.offset.is_none() && self.friction.is_none() {
            warnings.push(
                "a constant torque (a tilted table, a motor's offset) moves the puck, and this record does not tell it from friction: neither is given; motion both ways would tell"
                    .into(),
            );
        } else if self.sign.is_some() && self.offset.is_none() {
            warnings.push(
                "this record does not tell a constant torque (a tilted table, a motor's offset) from friction: it is taken as none; motion both ways would tell"
                    .into(),
            );
        }
        let below = [
            ("damping", self.rates[0].is_none(), "something drives the puck on as it moves"),
            ("friction", self.friction.is_none() && self.offset.is_some(), "something drives the puck on as it moves"),
            (
                "delay",
                self.delay.is_none() && self.sign.is_some(),
                "the torques are of later samples than the positions",
            ),
        ];
        for (name, is_below, reason) in below {
            if is_below {
                warnings.push(format!(
                    "the fit is best with a {name} below 0, which no device has: none is given; {reason}"
                ));
            }
        }
        let uncertain = |interval: Option<Interval>| interval.is_some_and(|x| x.low == 0.0 && x.high > 0.0);
        for (name, interval) in [("damping", self.damping), ("friction", self.friction)] {
            if uncertain(interval) {
                warnings.push(format!("the {name} may be none: its interval begins at 0"));
            }
        }
        warnings
    }
}
