//! What a stiffness costs in device damping, through a loop with uneven intervals, a delay and a lag.

/// The time of a wheel's loop, in s.
#[derive(Clone, Copy, Debug, PartialEq)]
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

    /// Device damping that pays for 1 N·m/rad behind which an implicit element yields, in s: ½ (√T + √m)².
    ///
    /// Over a sample the element's stored energy S obeys, with F = K e, the hand's way dz and the element's way d,
    /// F₋ dz = ΔS - K dz²/2 + F d + K d²/2, where F d ≥ 0 is dissipated or becomes kinetic energy. A command that arrives after the
    /// hand went ε more does (F₋ - F) ε of further work, at most K |dz| |ε| + K |d| |ε|, and K |d| |ε| ≤ K d²/2 + K ε²/2: the implicit
    /// step's own loss pays it. What is left, K (dz² + 2 |dz| |ε| + ε²)/2, is at most K (√T + √m)²/2 times ∫ż², by the Cauchy-Schwarz
    /// inequality, with T the longest interval and m the delay times the number of delays that overlap. A lag is a mixture of delays.
    pub fn element_cost(&self) -> f64 {
        let (delay, lag) = (self.delay, self.lag);
        let m = if lag == 0.0 && delay <= self.shortest {
            delay
        } else {
            // The mean of s (1 + s/shortest) over delays s = delay + x, x distributed as exp(-x/lag)/lag.
            delay + lag + (delay * delay + 2.0 * delay * lag + 2.0 * lag * lag) / self.shortest
        };
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
