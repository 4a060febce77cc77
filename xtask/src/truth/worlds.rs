//! Random loops, over the whole scope of the certificate.

use fastrand::Rng;
use hapt_model::{
    Body, Coupling, Damping, Device, End, EstimatorKind, FrictionByPosition, Handle, Law, Method, Output, Sampling,
    Stops, Stribeck, Waveform, World,
};

use crate::random::{as_steep_as, log_uniform, one_of, potentials};

fn between(rng: &mut Rng, from: f64, to: f64) -> f64 {
    from + (to - from) * rng.f64()
}

/// A handle on a shaft for a fifth of the loops: heavier and lighter than the puck, swinging from far below the sampling rate to above it.
pub fn handle(rng: &mut Rng, world: &World) -> Option<Handle> {
    let inertia = world.device.inertia * log_uniform(rng, -1.5, 1.5);
    let mass = 1.0 / (1.0 / inertia + 1.0 / world.device.inertia);
    let omega = log_uniform(rng, -2.0, 1.0) / world.sampling.period;
    let ratio = if rng.bool() { 0.0 } else { log_uniform(rng, -3.0, 0.5) };
    let handle = Handle { inertia, stiffness: mass * omega * omega, damping: 2.0 * ratio * mass * omega };
    (rng.u8(..5) == 0).then_some(handle)
}

/// The samples to a step of the bodies: up to eight for a sixth of the loops that take it.
pub fn bodies_every(rng: &mut Rng, world: &World) -> u32 {
    let sampling = &world.sampling;
    let holds = !sampling.method.takes_new_sample_first() && sampling.advance == 0 && !world.bodies.is_empty();
    if holds && rng.u8(..6) == 0 { rng.u32(2..9) } else { 1 }
}

/// A loop of up to three bodies: every method, output and estimator; delays with and without a fraction; periods from 0.1 to
/// 10 ms; ωT up to about 3; a device with a damping near the required one. `is_nonlinear` puts walls, detents and clamped springs
/// in, constant torques, and encoder, levels, limit and Coulomb friction into the device, in all combinations.
pub fn random(rng: &mut Rng, is_nonlinear: bool) -> World {
    let period = log_uniform(rng, -4.0, -2.0);
    let (method, output, advance) = rule(rng);
    let estimator = one_of(
        rng,
        &[
            EstimatorKind::Exact,
            EstimatorKind::Exact,
            EstimatorKind::Difference,
            EstimatorKind::Difference,
            EstimatorKind::LowPass,
        ],
    );
    let delay = match rng.u8(..4) {
        0 | 1 => 0.0,
        2 => f64::from(rng.u8(1..4)) * period,
        _ => between(rng, 0.0, 3.0) * period,
    };
    let cutoff = (estimator == EstimatorKind::LowPass).then(|| log_uniform(rng, -2.0, 0.0) / period);
    let sampling = Sampling {
        method,
        output,
        advance,
        delay: hapt_model::Delay::Seconds(delay),
        filter: (rng.u8(..4) == 0).then(|| log_uniform(rng, -2.5, 0.3) / period),
        estimator,
        cutoff,
        acceleration: None,
        every: if estimator == EstimatorKind::Difference && rng.bool() { rng.u32(2..17) } else { 1 },
        ..Sampling::new(period)
    };
    let inertia = log_uniform(rng, -5.0, -2.0);
    let bodies: Vec<Body> = (0..rng.usize(..4))
        .map(|_| Body { inertia: inertia * log_uniform(rng, -1.0, 2.0), position: 0.0, velocity: 0.0 })
        .collect();
    let couplings = couplings(rng, &bodies, inertia, period, is_nonlinear, method);
    let wanted: f64 = couplings
        .iter()
        .filter(|c| c.first == End::Puck || c.second == End::Puck)
        .map(|c| {
            let [stiffness, damping] = steepest(c);
            stiffness * period * (0.5 + delay / period) + damping
        })
        .sum();
    let damping = match rng.u8(..6) {
        0 => 0.0,
        1 => log_uniform(rng, -6.0, -1.0),
        _ => wanted * between(rng, 0.5, 3.0),
    };
    let mut device = Device { damping, ..Device::new(inertia) };
    if is_nonlinear && rng.u8(..4) > 0 {
        device.encoder = rng.bool().then(|| log_uniform(rng, 3.0, 6.0).round());
        device.limit = rng.bool().then(|| log_uniform(rng, -2.0, 1.0));
        device.levels = device.limit.filter(|_| rng.bool()).map(|_| 2 * log_uniform(rng, 1.0, 4.0).round() as u32);
        device.friction = friction(rng, &device, &couplings, period);
        device.stribeck = (device.friction > 0.0 && rng.u8(..4) == 0).then(|| Stribeck {
            torque: device.friction * between(rng, 0.1, 3.0),
            velocity: log_uniform(rng, -1.0, 1.0),
        });
        device.stops = (rng.u8(..6) == 0).then(|| Stops {
            low: Some(-log_uniform(rng, -3.0, 0.0)),
            high: Some(log_uniform(rng, -3.0, 0.0)),
            stiffness: log_uniform(rng, 0.0, 3.0),
            damping: if rng.bool() { 0.0 } else { log_uniform(rng, -4.0, -1.0) },
        });
        device.friction_by_position = (device.friction > 0.0 && rng.u8(..4) == 0).then(|| changes(rng));
        if device.fault(period).is_some() {
            (device.friction_by_position, device.stribeck, device.stops) = (None, None, None);
        }
        device.friction_backward = (rng.u8(..3) == 0).then(|| device.friction * between(rng, 0.2, 3.0));
    }
    let names = (0..bodies.len()).map(|i| format!("b{i}")).collect();
    World { names, bodies, couplings, ..World::new(sampling, device) }
}

/// A coupling's steepest rise by position and by velocity; a compensating damper's is left out.
fn steepest(coupling: &Coupling) -> [f64; 2] {
    let slopes = coupling.law.slopes();
    match slopes.damping {
        Damping::Fixed(damping) => [slopes.stiffness, damping],
        Damping::Compensating => [slopes.stiffness, 0.0],
    }
}

/// None, any, or about the friction that counts and levels require: half a count of all stiffness, a count a sample of all damping, half a
/// level.
fn friction(rng: &mut Rng, device: &Device, couplings: &[Coupling], period: f64) -> f64 {
    let at_puck = couplings.iter().filter(|c| c.first == End::Puck || c.second == End::Puck);
    let [stiffness, damping] =
        at_puck.map(steepest).fold([0.0, 0.0], |[k, b], [stiffness, damping]| [k + stiffness, b + damping]);
    let count = device.encoder.map_or(0.0, |counts| std::f64::consts::TAU / counts);
    let step = device.levels.zip(device.limit).map_or(0.0, |(levels, limit)| 2.0 * limit / f64::from(levels));
    match rng.u8(..6) {
        0 => 0.0,
        1 => log_uniform(rng, -5.0, -2.0),
        _ => (0.5 * stiffness * count + damping * count / period + 0.5 * step) * between(rng, 0.5, 2.0),
    }
}

/// Friction that changes by up to all of itself, once a turn or oftener.
fn changes(rng: &mut Rng) -> FrictionByPosition {
    let mut factors = || [0; 4].map(|_| between(rng, -1.0, 1.0) as f32);
    let waveform = Waveform { sine: factors(), cosine: factors() };
    let (pitch, phase) = (log_uniform(rng, -2.0, 0.0) * std::f64::consts::TAU, rng.f64());
    let whole = FrictionByPosition { share: 1.0, pitch, phase, waveform };
    FrictionByPosition { share: between(rng, 0.0, 0.999) / whole.most(), ..whole }
}

fn rule(rng: &mut Rng) -> (Method, Output, u32) {
    let method = one_of(rng, &Method::ALL);
    if method.takes_new_sample_first() {
        return (method, Output::Start, 0);
    }
    let output = one_of(rng, &[Output::Start, Output::Middle, Output::End, Output::End]);
    let advance = if output == Output::End && rng.u8(..4) == 0 { rng.u32(1..4) } else { 0 };
    (method, output, advance)
}

/// Springs and dampers that tie each body to the puck, ground or an earlier one; sometimes the puck to ground.
fn couplings(
    rng: &mut Rng,
    bodies: &[Body],
    inertia: f64,
    period: f64,
    is_nonlinear: bool,
    method: Method,
) -> Vec<Coupling> {
    let mut all = Vec::new();
    let mut tie = |rng: &mut Rng, first: End, second: End, inertia: f64| {
        // Stiffness by the angle that the inertia on it would go a sample.
        let x = log_uniform(rng, -2.0, 0.4);
        // Now and then so soft that the body behind it is hardly felt. Its oscillation is longer than any run, so that this is left out
        // where motions are followed.
        let soft = if is_nonlinear && rng.u8(..12) == 0 { log_uniform(rng, -14.0, -4.0) } else { 1.0 };
        let stiffness = soft * inertia * (x / period).powi(2);
        all.push(Coupling { first, second, law: Law::Spring { stiffness, rest: 0.0 }, limit: None });
        match rng.u8(..6) {
            // The notes' damper.
            0 => all.push(Coupling { first, second, law: Law::Damper { damping: Damping::Compensating }, limit: None }),
            1 | 2 => {
                let damping = 2.0 * log_uniform(rng, -3.0, 0.0) * stiffness * period / x;
                all.push(Coupling {
                    first,
                    second,
                    law: Law::Damper { damping: Damping::Fixed(damping) },
                    limit: None,
                });
            }
            _ => {}
        }
    };
    for (i, body) in bodies.iter().enumerate() {
        let other = match rng.u8(..6) {
            0 => End::Ground,
            1 | 2 if i > 0 => End::Body(rng.usize(..i)),
            _ => End::Puck,
        };
        tie(rng, End::Body(i), other, body.inertia);
    }
    if bodies.is_empty() || rng.u8(..4) == 0 {
        tie(rng, End::Puck, End::Ground, inertia);
    }
    if is_nonlinear {
        for _ in 0..rng.usize(..3) {
            // A body's contact under the new-sample-first methods is refused by the loop.
            let at_body = !bodies.is_empty() && rng.bool() && !method.takes_new_sample_first();
            let ends = match at_body {
                true => (End::Body(rng.usize(..bodies.len())), one_of(rng, &[End::Ground, End::Puck])),
                false => (End::Puck, End::Ground),
            };
            let (law, limit) = nonlinear(rng, inertia, period);
            all.push(Coupling { first: ends.0, second: ends.1, law, limit });
        }
        // Damped at the puck, and pushed, at a body too.
        if rng.u8(..3) == 0 {
            let damping = inertia / period * log_uniform(rng, -3.0, -1.0);
            all.push(Coupling {
                first: End::Puck,
                second: End::Ground,
                law: Law::Damper { damping: Damping::Fixed(damping) },
                limit: None,
            });
        }
        if rng.u8(..6) == 0 {
            let law = Law::Constant { torque: log_uniform(rng, -4.0, -1.0) * if rng.bool() { 1.0 } else { -1.0 } };
            let at_body = !bodies.is_empty() && rng.bool() && !method.takes_new_sample_first();
            let first = if at_body { End::Body(rng.usize(..bodies.len())) } else { End::Puck };
            all.push(Coupling { first, second: End::Ground, law, limit: None });
        }
    }
    all
}

/// A nonlinear law, or a spring with a limit.
fn nonlinear(rng: &mut Rng, inertia: f64, period: f64) -> (Law, Option<f64>) {
    let stiffness = inertia * (log_uniform(rng, -2.0, 0.0) / period).powi(2);
    let damping = if rng.bool() { stiffness * period * rng.f64() } else { 0.0 };
    let law = one_of(rng, &potentials());
    let law = as_steep_as(rng, law, stiffness, damping);
    (law, law.spring().map(|stiffness| stiffness * between(rng, 0.01, 0.3)))
}
