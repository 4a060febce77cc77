//! Random worlds and their differential equation, written down a second time, coupling by coupling.
#![allow(dead_code)]

use hapt_core::{Body, Coupling, Damping, End, Law, Method, Output, Side, Spec, Waveform};
use hapt_testing::laws::{SIZES, Sizes, goes_to_bodies, some_limited};
use proptest::prelude::*;

#[derive(Clone, Debug)]
pub struct World {
    pub bodies: Vec<Body>,
    pub couplings: Vec<Coupling>,
}

impl World {
    pub fn spec(&self, method: Method, output: Output, period: f64) -> Spec<'_> {
        Spec { method, output, bodies: &self.bodies, couplings: &self.couplings, ..Spec::new(period) }
    }

    /// q and q̇ of a coupling.
    pub fn relative(&self, coupling: &Coupling, x: &[f64], u: (f64, f64)) -> (f64, f64) {
        let n = self.bodies.len();
        let at = |end| match end {
            End::Puck => u,
            End::Ground => (0.0, 0.0),
            End::Body(i) => (x[i], x[n + i]),
        };
        let (a, b) = (at(coupling.first), at(coupling.second));
        (a.0 - b.0, a.1 - b.1)
    }

    /// f(x, u)
    pub fn rate(&self, x: &[f64], u: (f64, f64)) -> Vec<f64> {
        let n = self.bodies.len();
        let mut rate = x[n..].to_vec();
        rate.resize(2 * n, 0.0);
        for coupling in &self.couplings {
            let (q, qd) = self.relative(coupling, x, u);
            let torque = torque(coupling, q, qd);
            for (end, torque) in [(coupling.first, torque), (coupling.second, -torque)] {
                if let End::Body(i) = end {
                    rate[n + i] += torque / self.bodies[i].inertia;
                }
            }
        }
        rate
    }

    /// The torque on the puck.
    pub fn torque(&self, x: &[f64], u: (f64, f64)) -> f64 {
        let one = |coupling: &Coupling| {
            let (q, qd) = self.relative(coupling, x, u);
            let torque = torque(coupling, q, qd);
            match (coupling.first, coupling.second) {
                (End::Puck, _) => torque,
                (_, End::Puck) => -torque,
                _ => 0.0,
            }
        };
        self.couplings.iter().map(one).sum()
    }

    /// A bound on the fastest rate in 1/s.
    pub fn fastest(&self) -> f64 {
        let lightest = self.bodies.iter().map(|body| body.inertia).fold(f64::INFINITY, f64::min);
        let (k, c) = self.slopes();
        2.0 * (k / lightest).sqrt() + 2.0 * c / lightest + 1.0
    }

    pub fn torque_scale(&self) -> f64 {
        let (k, c) = self.slopes();
        let torques: f64 = self.couplings.iter().map(|coupling| torque(coupling, 0.0, 1.0).abs()).sum();
        1.0 + 4.0 * k + 20.0 * c + torques
    }

    /// The kinetic and stored energy, with z held; and the size of the parts, below which differences are rounding.
    pub fn energy(&self, x: &[f64], z: f64) -> (f64, f64) {
        let n = self.bodies.len();
        let moving: f64 = self.bodies.iter().zip(&x[n..]).map(|(body, v)| 0.5 * body.inertia * v * v).sum();
        let stored = self.couplings.iter().map(|coupling| stored(coupling, self.relative(coupling, x, (z, 0.0)).0));
        stored.fold((moving, moving), |(sum, size), part| (sum + part, size + part.abs()))
    }

    fn slopes(&self) -> (f64, f64) {
        self.couplings.iter().fold((0.0, 0.0), |(k, c), coupling| match coupling.law {
            Law::Spring { stiffness, .. } => (k + stiffness, c),
            Law::Damper { damping: Damping::Fixed(damping) } => (k, c + damping),
            Law::Wall { stiffness, damping, .. } => (k + stiffness, c + damping),
            Law::Detent { torque, pitch, .. } => (k + 7.0 * torque / pitch, c),
            Law::DeadBand { stiffness, .. } => (k + stiffness, c),
            Law::Magnet { torque, width, .. } => (k + 2.0 * torque / width, c),
            Law::Texture { torque, pitch, waveform: Waveform { sine, cosine }, .. } => {
                let sizes =
                    (1..).zip(sine.iter().zip(cosine)).map(|(n, (s, c))| f64::from(n) * f64::from(s.abs() + c.abs()));
                (k + 7.0 * torque / pitch * sizes.sum::<f64>(), c)
            }
            _ => (k, c),
        })
    }
}

/// V of a coupling, with its limit; 0 of a coupling that only dissipates.
pub fn stored(coupling: &Coupling, q: f64) -> f64 {
    let limit = coupling.limit.unwrap_or(f64::INFINITY);
    match coupling.law {
        Law::Spring { stiffness, rest } => level_off(stiffness, q - rest, limit),
        Law::Wall { side, at, stiffness, .. } => {
            let depth = if side == Side::Above { q - at } else { at - q };
            level_off(stiffness, depth.max(0.0), limit)
        }
        Law::Detent { torque, pitch, phase } => {
            torque * pitch / std::f64::consts::PI * (std::f64::consts::PI * (q - phase) / pitch).sin().powi(2)
        }
        Law::DeadBand { stiffness, rest, width } => level_off(stiffness, ((q - rest).abs() - width).max(0.0), limit),
        Law::Magnet { torque, width, at } => {
            torque * width * (0.5_f64.exp() - (0.5 - 0.5 * ((q - at) / width).powi(2)).exp())
        }
        Law::Texture { torque, pitch, phase, waveform: Waveform { sine, cosine } } => {
            let of = |(n, (s, c)): (i32, (f32, f32))| {
                let (s, c) = (f64::from(s), f64::from(c));
                let (size, turn) = ((s * s + c * c).sqrt(), c.atan2(s));
                let angle = f64::from(n) * std::f64::consts::TAU * (q - phase) / pitch + turn;
                size / f64::from(n) * 2.0 * (0.5 * angle).cos().powi(2)
            };
            torque * pitch / std::f64::consts::TAU * (1..).zip(sine.into_iter().zip(cosine)).map(of).sum::<f64>()
        }
        Law::Constant { torque } => -torque * q,
        Law::Damper { .. }
        | Law::Coulomb { .. }
        | Law::Lugre { .. }
        | Law::Integral { .. }
        | Law::Assist { .. }
        | Law::Acceleration { .. } => 0.0,
    }
}

/// ∫ min(k x, limit) dx
fn level_off(stiffness: f64, x: f64, limit: f64) -> f64 {
    let slope = x.abs().min(limit / stiffness);
    0.5 * stiffness * slope * slope + if x.abs() > slope { limit * (x.abs() - slope) } else { 0.0 }
}

/// The contract's table of laws.
pub fn torque(coupling: &Coupling, q: f64, qd: f64) -> f64 {
    let limit = coupling.limit.unwrap_or(f64::INFINITY);
    let torque = match coupling.law {
        Law::Spring { stiffness, rest } => -stiffness * (q - rest),
        Law::Damper { damping: Damping::Fixed(damping) } => -damping * qd,
        Law::Wall { side: Side::Above, at, stiffness, damping } if q > at => {
            (-(stiffness * (q - at) + damping * qd)).min(0.0)
        }
        Law::Wall { side: Side::Below, at, stiffness, damping } if q < at => {
            (-(stiffness * (q - at) + damping * qd)).max(0.0)
        }
        Law::Detent { torque, pitch, phase } => -torque * (std::f64::consts::TAU * (q - phase) / pitch).sin(),
        Law::DeadBand { stiffness, rest, width } => {
            -stiffness * ((q - rest).abs() - width).max(0.0) * (q - rest).signum()
        }
        Law::Magnet { torque, width, at } => {
            let x = (q - at) / width;
            -torque * x * (0.5 - 0.5 * x * x).exp()
        }
        Law::Texture { torque, pitch, phase, waveform: Waveform { sine, cosine } } => {
            let of = |(n, (s, c)): (i32, (f32, f32))| {
                let angle = f64::from(n) * std::f64::consts::TAU * (q - phase) / pitch;
                f64::from(s) * angle.sin() + f64::from(c) * angle.cos()
            };
            torque * (1..).zip(sine.into_iter().zip(cosine)).map(of).sum::<f64>()
        }
        Law::Coulomb { torque } if qd != 0.0 => -torque * qd.signum(),
        Law::Constant { torque } => torque,
        _ => 0.0,
    };
    torque.clamp(-limit, limit)
}

/// One to five bodies in a chain from the puck, with further couplings between random ends.
pub fn world(nonlinear: bool) -> impl Strategy<Value = World> {
    let body = (1e-3_f64..0.1, -1.0_f64..1.0, -5.0_f64..5.0).prop_map(|(inertia, position, velocity)| Body {
        inertia,
        position,
        velocity,
    });
    prop::collection::vec(body, 1..=5).prop_flat_map(move |bodies| {
        let n = bodies.len();
        let chain = prop::collection::vec(0.01_f64..20.0, n).prop_map(|stiffness| {
            let link = |(i, stiffness)| Coupling {
                first: if i == 0 { End::Puck } else { End::Body(i - 1) },
                second: End::Body(i),
                law: Law::Spring { stiffness, rest: 0.0 },
                limit: None,
            };
            stiffness.into_iter().enumerate().map(link).collect::<Vec<_>>()
        });
        let extra = (0..n + 2, 0..n + 2, law(nonlinear))
            .prop_filter("two ends", |(a, b, _)| a != b)
            .prop_map(move |(a, b, (law, limit))| Coupling { first: end(a, n), second: end(b, n), law, limit });
        (chain, prop::collection::vec(extra, 0..6)).prop_map(move |(mut couplings, extra)| {
            couplings.extend(extra);
            World { bodies: bodies.clone(), couplings }
        })
    })
}

fn end(i: usize, n: usize) -> End {
    match i {
        i if i < n => End::Body(i),
        i if i == n => End::Puck,
        _ => End::Ground,
    }
}

/// A law, and its limit.
fn law(nonlinear: bool) -> BoxedStrategy<(Law, Option<f64>)> {
    let sizes = Sizes { stiffness: 0.0..=10.0, damping: 0.0..=0.1, torque: 0.0..=1.0, place: 1.0, ..SIZES };
    if nonlinear {
        some_limited(sizes.laws(goes_to_bodies), 0.01_f64..2.0).boxed()
    } else {
        let laws =
            sizes.laws(|law| law.spring().is_some() || matches!(law, Law::Damper { damping: Damping::Fixed(_) }));
        laws.prop_map(|law| (law, None)).boxed()
    }
}
