//! Exact responses of a wheel on a spring: the formulas of the notes, with their errata.
//!
//! ω is in rad/s, t and T in s, angles in rad, k in N·m/rad. The body starts at rest at 0; the puck steps to z0 at t = 0.

use std::f64::consts::{PI, TAU};

/// The body after a step of the puck, (2.3): z0 (1 - cos ωt).
pub fn step_response(z0: f64, omega: f64, t: f64) -> f64 {
    // 1 - cos x = 2 sin²(x/2): no cancellation at the start.
    let half = (0.5 * omega * t).sin();
    2.0 * z0 * half * half
}

/// The torque on the puck after its step: k (w - z0) = -k z0 cos ωt. The notes' (2.4) is its magnitude.
pub fn step_torque(k: f64, z0: f64, omega: f64, t: f64) -> f64 {
    -k * z0 * (omega * t).cos()
}

/// The body when the puck moves as A sin ωt, at resonance: (A/2)(sin ωt - ωt cos ωt), without bound.
pub fn resonance(amplitude: f64, omega: f64, t: f64) -> f64 {
    let x = omega * t;
    // sin x - x cos x = x³/3 - x⁵/30 + x⁷/840 - x⁹/45360 + ...: by its series where the terms would cancel.
    let difference = if x.abs() < 0.1 {
        x * x * x * (1.0 / 3.0 - x * x * (1.0 / 30.0 - x * x * (1.0 / 840.0 - x * x / 45360.0)))
    } else {
        x.sin() - x * x.cos()
    };
    0.5 * amplitude * difference
}

/// The frequency in Hz at which the distance of puck and body oscillates hands-off, (3.8): √(k (1/J_z + 1/J_w))/2π. The centre of mass
/// keeps its velocity.
pub fn released_frequency_hz(k: f64, puck_inertia: f64, body_inertia: f64) -> f64 {
    (k * (1.0 / puck_inertia + 1.0 / body_inertia)).sqrt() / TAU
}

/// The growth in 1/s of an undamped held body under forward Euler: ln(1 + x²)/(2T), x = ωT.
pub fn forward_euler_growth(omega: f64, period: f64) -> f64 {
    let x = omega * period;
    (x * x).ln_1p() / (2.0 * period)
}

/// Sample k of the torque of undamped forward Euler, output "start", after a step of the puck: -k z0 Re((1 + jx)^k), by
/// modulus and angle, so that only the angle loses digits over a million samples.
pub fn forward_euler_torque(stiffness: f64, z0: f64, omega: f64, period: f64, k: u64) -> f64 {
    let x = omega * period;
    let k = k as f64;
    -stiffness * z0 * (0.5 * k * (x * x).ln_1p()).exp() * (k * x.atan()).cos()
}

/// The first sample whose torque, as above, is beyond ±`limit`; `None` when that takes more than 10^10 samples, or never
/// happens. The work does not depend on the number of samples.
pub fn forward_euler_exceeds(stiffness: f64, z0: f64, omega: f64, period: f64, limit: f64) -> Option<u64> {
    const MAX_SAMPLES: f64 = 1e10;
    let exceeds = |k: f64| forward_euler_torque(stiffness, z0, omega, period, k as u64).abs() > limit;
    if exceeds(0.0) {
        return Some(0);
    }
    let size = (stiffness * z0).abs();
    let x = (omega * period).abs();
    let (angle, rate) = (x.atan(), 0.5 * (x * x).ln_1p());
    // No sample before the envelope, size e^(rate k), has reached the limit.
    let start = ((limit / size).ln() / rate - 1.0).max(0.0);
    if !(rate > 0.0 && rate.is_finite() && start <= MAX_SAMPLES) {
        return None;
    }
    // Between two zeros of the cosine the torque rises to one peak, at tan(angle k) = rate/angle, and falls.
    let mut lobe = (start * angle / PI + 0.5).floor();
    loop {
        let from = ((lobe - 0.5) * PI / angle).ceil().max(0.0);
        let top = ((lobe * PI + (rate / angle).atan()) / angle).floor().max(from);
        if from > MAX_SAMPLES {
            return None;
        }
        if exceeds(top) {
            let (mut low, mut high) = (from - 1.0, top);
            while high - low > 1.0 {
                let middle = (0.5 * (low + high)).floor();
                if exceeds(middle) { high = middle } else { low = middle }
            }
            return Some(high as u64);
        }
        if exceeds(top + 1.0) {
            return Some(top as u64 + 1);
        }
        lobe += 1.0;
    }
}

/// The angle of the poles of forward Euler with b = Tk, and of semi-implicit Euler: φ = 2 asin(x/2), x = ωT; `None` from x = 2
/// on, where the poles are real.
pub fn compensated_angle(omega: f64, period: f64) -> Option<f64> {
    let x = omega * period;
    (x.abs() < 2.0).then(|| 2.0 * (0.5 * x).asin())
}

/// The amplitude of the body about z0 after a step, under forward Euler with b = Tk: z0/cos(φ/2), a little more than z0; `None`
/// from x = 2 on.
pub fn compensated_amplitude(z0: f64, omega: f64, period: f64) -> Option<f64> {
    compensated_angle(omega, period).map(|phi| z0 / (0.5 * phi).cos())
}
