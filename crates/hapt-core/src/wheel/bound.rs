//! The device damping and friction that a stiffness requires, in a loop with uneven intervals, a delay, a lag and an encoder's counts.

use super::Device;

/// In rad/s, a revolution a minute: counts do not sustain a motion at this speed or a higher one. They can sustain a slower one where
/// friction does not hold the torque that they cause.
pub const REST_SPEED: f64 = 0.1;

/// The time of a wheel's loop, in s.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Timing {
    /// From one sample to the next, nominally; positive.
    pub period: f64,
    /// The shortest interval between two samples, positive, at most the period.
    pub shortest: f64,
    /// The longest interval, at least the period.
    pub longest: f64,
    /// From a sample to the arrival of its command, zero or more.
    pub delay: f64,
    /// The time constant of the motor's torque, zero or more.
    pub lag: f64,
}

impl Timing {
    /// Samples at equal intervals, without delay or lag.
    pub fn even(period: f64) -> Self {
        Timing { period, shortest: period, longest: period, delay: 0.0, lag: 0.0 }
    }

    /// Whether the numbers describe a loop.
    pub(crate) fn is_possible(&self) -> bool {
        let finite = [self.period, self.shortest, self.longest, self.delay, self.lag].iter().all(|t| t.is_finite());
        let ordered = 0.0 < self.shortest && self.shortest <= self.period && self.period <= self.longest;
        finite && ordered && self.delay >= 0.0 && self.lag >= 0.0
    }

    /// The delay times the number of delays that overlap; of a lag, the mean over the delays that it mixes.
    fn overlap(&self) -> f64 {
        let (delay, lag) = (self.delay, self.lag);
        if lag == 0.0 && delay <= self.shortest {
            delay
        } else {
            // The mean of s (1 + s/shortest) over delays s = delay + x, x distributed as exp(-x/lag)/lag.
            delay + lag + (delay * delay + 2.0 * delay * lag + 2.0 * lag * lag) / self.shortest
        }
    }

    /// Device damping that pays for 1 N·m/rad behind which an implicit element yields, in s: ½ (√T + √m)².
    ///
    /// Over a sample the element's stored energy S obeys, with F = K e, the hand's displacement dz and the element's displacement d,
    /// F₋ dz = ΔS - K dz²/2 + F d + K d²/2, where F d ≥ 0 is dissipated or becomes kinetic energy. A command that arrives after a further
    /// displacement ε of the hand does (F₋ - F) ε of further work, at most K |dz| |ε| + K |d| |ε|, and K |d| |ε| ≤ K d²/2 + K ε²/2: the
    /// implicit step's own loss pays it. The rest, K (dz² + 2 |dz| |ε| + ε²)/2, is at most K (√T + √m)²/2 times ∫ż², by the
    /// Cauchy-Schwarz inequality, with T the longest interval and m the delay times the number of delays that overlap. A lag is a mixture
    /// of delays.
    pub fn element_cost(&self) -> f64 {
        let m = self.overlap();
        0.5 * (self.longest + m + 2.0 * libm::sqrt(self.longest * m))
    }

    /// Device damping that pays for 1 N·m/rad of a static law, in s; never more than [`Timing::element_cost`].
    ///
    /// Without lag, T/4 · (q + √(q² + 4 a (1 - a))) with a = delay/T and q = 1 + 2 a, for a delay within every interval. With a lag,
    /// 2 T/π + delay + lag.
    pub fn spring_cost(&self) -> f64 {
        let general = self.element_cost();
        if self.delay > self.shortest {
            return general;
        }
        let sharp = if self.lag == 0.0 {
            let a = self.delay / self.longest;
            let q = 1.0 + 2.0 * a;
            0.25 * self.longest * (q + libm::sqrt(q * q + 4.0 * a * (1.0 - a)))
        } else {
            2.0 * self.longest / core::f64::consts::PI + self.delay + self.lag
        };
        sharp.min(general)
    }
}

/// The stiffness budget of the device: of springs, or the smaller one of sliders or bodies.
///
/// With counts the loop sees z + e, |e| ≤ Δ/2. A static law of stiffness K is the exact one and a torque of at most KΔ/2. A slider is a monotone
/// map of positions that commutes with shifts: e shifts it by Δ/2 at most, and its torque differs by at most KΔ. Such a torque D does at
/// most D|dz| of work: friction of D pays for it at every speed, and damping of D/v from the speed v on.
///
/// A body is moved by e, but the wheel's friction does not act on it. With the true stretch in the stored energy, a step adds K e' d of
/// work by e to what [`Timing::element_cost`] counts, and half of the loss K d²/2 leaves at most KΔ²/4 of it; the other half then pays for
/// half as much of a delay. At the speed v, damping of KΔ²/(4 T v²) dissipates that, T the shortest interval.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    /// The stiffness without sliders and bodies, N·m/rad.
    pub springs: f64,
    /// The ratio of a slider's stiffness to a spring's, for the same damping.
    pub drag: f64,
    /// The same of a body's.
    pub mass: f64,
}

impl Budget {
    pub fn of(device: &Device) -> Self {
        let &Device { timing, damping, friction, count, .. } = device;
        // Δ/2 at the rest speed, as a time.
        let half = 0.5 * count / REST_SPEED;
        let (spring, drag) = (timing.spring_cost(), timing.element_cost());
        let mass = if count > 0.0 {
            let m = timing.overlap();
            0.5 * (timing.longest + 2.0 * m + 2.0 * libm::sqrt(timing.longest * m)) + half * half / timing.shortest
        } else {
            drag
        };
        // The largest torque error by counts, for any use of the damping.
        let torque = 0.5 * count * damping * (1.0 / spring).max(2.0 / drag).max(1.0 / mass);
        if torque <= friction {
            return Budget { springs: damping / spring, drag: spring / drag, mass: spring / mass };
        }
        let least = |element: f64, halves: f64| (spring / element).min((spring + half) / (element + halves * half));
        let springs = (damping / spring).min((damping + friction / REST_SPEED) / (spring + half));
        Budget { springs, drag: least(drag, 2.0), mass: least(mass, 1.0) }
    }
}
