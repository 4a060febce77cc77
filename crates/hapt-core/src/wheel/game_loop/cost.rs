//! The device damping that a law computed by a host requires, and how much of it a rendered damper provides.

use crate::Real;

/// When a host's torque acts: it belongs to samples of the position that the host takes `hold` apart, and each is in force until the next
/// one's, which arrives up to `lateness` after its sample. The motor's delay and lag are part of the lateness. In s, zero or more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostTime<F> {
    /// From one sample of the host to the next.
    pub hold: F,
    /// From a sample of the host to its torque.
    pub lateness: F,
}

impl<F: Real> HostTime<F> {
    /// The greatest age of the position to which a torque belongs, s.
    pub fn oldest(&self) -> F {
        self.hold + self.lateness
    }

    /// Device damping that pays for 1 N·m/rad of a law f, |f(z) - f(z')| ≤ K|z - z'|, where the host samples evenly, in s. Where its
    /// intervals vary up to `hold`, [`HostTime::oldest`] pays.
    ///
    /// (T67): H/4 · (q + √(q² + 4 a (1 - a))), q = 1 + 2 (d + a), lateness = (d + a) H, d whole and 0 ≤ a < 1; lateness + H/2 where a = 0.
    pub fn cost(&self) -> F {
        let (one, two) = (F::ONE, F::ONE + F::ONE);
        if self.hold <= F::ZERO {
            return self.lateness;
        }
        let samples = self.lateness / self.hold;
        let a = samples - samples.floor();
        let q = one + two * samples;
        self.hold * F::from_f64(0.25) * (q + (q * q + two * two * a * (one - a)).sqrt())
    }
}

/// A damper that is rendered from sampled positions, by a low-pass of their difference: v ← v + T/(T + τ) (dz/T - v), τ being `smoothing`. SI
/// units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damper<F> {
    /// N·m·s/rad
    pub damping: F,
    /// The wheel's inertia, kg·m²: certainly not less than this.
    pub inertia: F,
    /// Of the loop, s.
    pub period: F,
    /// From a sample to its torque, s.
    pub delay: F,
    /// Of the motor, s.
    pub lag: F,
    /// Of the velocity, s.
    pub smoothing: F,
}

impl<F: Real> Damper<F> {
    /// The mean age, in s, of the velocity to which its torque belongs, and the mean of its square, in s²: not less than these.
    fn age(&self) -> (F, F) {
        let two = F::ONE + F::ONE;
        // The displacement of one period acts for the next one.
        let (sharp, blunt) = (self.delay + two * self.period, self.smoothing + self.lag);
        let Damper { period, smoothing, lag, .. } = *self;
        let spread = smoothing * period + two * (smoothing * smoothing + smoothing * lag + lag * lag);
        (sharp + blunt, sharp * sharp + two * sharp * blunt + spread)
    }

    /// J' and θ of (T68); none where the damper is too late for this inertia.
    fn reserve(&self) -> Option<(F, F)> {
        let (first, second) = self.age();
        let inertia = self.inertia - self.damping * first;
        (inertia > F::ZERO).then(|| (inertia, self.damping * second / inertia))
    }

    /// The damping that a host's law of this stiffness lacks on a wheel of the damping `device`, N·m·s/rad, were the damper as late as this one is;
    /// the largest number where it is too late. (T69)
    pub fn lacking(&self, device: F, host: &HostTime<F>, stiffness: F) -> F {
        let Some((inertia, theta)) = self.reserve() else { return F::MAX };
        let aged = stiffness * host.oldest();
        stiffness * (host.cost() + theta) + F::HALF * aged * aged * theta / inertia - device
    }

    /// The largest stiffness of a host's law, in N·m/rad, with which the free wheel does not oscillate: `device` is the wheel's own
    /// damping.
    ///
    /// (T69): with δ₁ and δ₂² the mean age of the velocity and that of its square, J' = J - B δ₁, θ = B δ₂²/J' and p = θ/(2 J'), the largest K with
    /// b + B ≥ K (c + θ) + p (K α)². It is b/c without a damper, and 0 where J' ≤ 0.
    pub fn stiffness(&self, device: F, host: &HostTime<F>) -> F {
        let two = F::ONE + F::ONE;
        let damping = device + self.damping;
        let Some((inertia, theta)) = self.reserve() else { return F::ZERO };
        let (cost, age) = (host.cost() + theta, host.oldest());
        let square = age * age * theta / (two * inertia);
        let late = cost + (cost * cost + two * two * square * damping).sqrt();
        // The form of the root without a difference.
        if late > F::ZERO { (two * damping / late).finite_or_zero() } else { F::MAX }
    }
}
