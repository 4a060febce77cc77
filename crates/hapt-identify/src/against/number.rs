//! One number of a record and of a file, and the verdict.

use hapt_model::keys::Measure;

use crate::interval::Interval;

/// An estimate this many standard errors outside contradicts the file. A lag that is too short to be separated from a delay can move the
/// other numbers by up to four of their standard errors.
pub(super) const SURELY: f64 = 5.0;
/// The standard errors of half a 95 % interval.
const HALF: f64 = 1.959_964;
/// A record determines a number whose interval reaches no farther than this part of the number on either side, or than its tolerance.
const TOLD: f64 = 0.2;

const NONE: &str = "not in this record";
pub(super) const WIDE: &str = "the record allows too much";

/// The verdict of a record on a number of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The record determines the number, and it is within the file's range or less than five standard errors outside.
    Agrees,
    /// It is farther outside.
    Contradicts,
    /// The record allows so wide a range that its agreement would mean nothing.
    NotDetermined,
}

/// One number, of the record and of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// inertia, damping, friction, constant torque, damping over inertia, friction over inertia, lag, delay, delay and lag, sign; handle
    /// inertia, shaft stiffness, shaft damping;
    /// stribeck torque, stribeck velocity; low stop, high stop, stop stiffness, stop damping; gravity sine and cosine; cogging sine 1 and
    /// cosine 1, and so on for each harmonic of the file; friction sine 1 and cosine 1, and so on; spring.
    pub name: &'static str,
    /// The kind of its unit, over inertia that of the dividend; `None`: it has no unit.
    pub measure: Option<Measure>,
    /// The estimate from the record.
    pub estimate: Option<Interval>,
    /// The least and the largest that the file allows; NaN: the file has none.
    pub file: [f64; 2],
    /// The distance of the estimate from that range, in standard errors; 0 inside.
    pub sigmas: Option<f64>,
    /// The conclusion.
    pub verdict: Verdict,
    /// Why the record does not determine it, or how it contradicts where there is no estimate.
    pub reason: Option<&'static str>,
    /// A smaller number counts as this size.
    pub(super) least: f64,
}

impl Verdict {
    /// The word in the JSON: `agrees`, `contradicts`, or `not determined`.
    pub fn word(self) -> &'static str {
        match self {
            Verdict::Agrees => "agrees",
            Verdict::Contradicts => "contradicts",
            Verdict::NotDetermined => "not determined",
        }
    }
}

/// The distance of an estimate from a range, in standard errors.
pub fn sigmas(x: &Interval, [low, high]: [f64; 2]) -> f64 {
    // Rounding of the file's own numbers is no contradiction.
    let rounding = 1e-9 * x.value.abs();
    let (out, half) = if x.value < low - rounding {
        (low - x.value, x.high - x.value)
    } else if x.value > high + rounding {
        (x.value - high, x.value - x.low)
    } else {
        return 0.0;
    };
    if half > 0.0 { HALF * out / half } else { f64::INFINITY }
}

impl Compared {
    pub(super) fn new(
        name: &'static str,
        measure: Option<Measure>,
        estimate: Option<Interval>,
        file: [f64; 2],
        least: f64,
    ) -> Self {
        let sigmas = estimate.map(|x| sigmas(&x, file));
        let mut compared =
            Compared { name, measure, estimate, file, sigmas, verdict: Verdict::NotDetermined, reason: None, least };
        compared.judge(estimate);
        compared
    }

    /// A number is at most as many standard errors outside of the file's range as the root of the squares, in variances, that the file's
    /// device leaves more than the best: this is so where the motion is linear in the numbers, and elsewhere the standard errors are wrong.
    pub(super) fn no_farther(&mut self, root: f64) {
        let most = root.max(HALF);
        let ([low, high], Some(x)) = (self.file, self.estimate) else { return };
        if low.is_nan() || self.sigmas.is_none_or(|sigmas| sigmas <= most) {
            return;
        }
        let reach = |file: f64| x.value + HALF / most * (file - x.value);
        let x = if x.value < low {
            Interval { high: x.high.max(reach(low)), ..x }
        } else {
            Interval { low: x.low.min(reach(high)), ..x }
        };
        (self.estimate, self.sigmas) = (Some(x), Some(most));
        self.judge(Some(x));
    }

    pub(super) fn judge(&mut self, estimate: Option<Interval>) {
        let [low, high] = self.file;
        if low.is_nan() {
            return;
        }
        let allowed = (0.5 * (high - low)).max(TOLD * (0.5 * (high + low)).abs().max(self.least));
        let is_determined = estimate.is_some_and(|x| (x.high - x.value).max(x.value - x.low) <= allowed);
        (self.verdict, self.reason) = match (self.sigmas, is_determined) {
            (Some(sigmas), _) if sigmas > SURELY => (Verdict::Contradicts, None),
            (Some(_), true) => (Verdict::Agrees, None),
            (Some(_), false) => (Verdict::NotDetermined, Some(WIDE)),
            (None, _) => (Verdict::NotDetermined, Some(NONE)),
        };
    }
}
