//! From the spec to a loop: the couplings become matrices by the method's rule, once a world.

use crate::actuate::Actuator;
use crate::gradient::Gradient;
use crate::matrix::{Block, Half, Response, Vector};
use crate::nonlinear::Nonlinear;
use crate::rules::Dynamics;
use crate::sense::Sensor;
use crate::spec::{Linear, Quantity, Range};
use crate::step::{Loop, Moment, Port};
use crate::{Coupling, Damping, End, Error, Law, Method, Output, Real, Spec, Waveform};

impl Error {
    pub(crate) fn check_positive(what: &'static str, given: f64) -> Result<(), Error> {
        if given > 0.0 && given.is_finite() { Ok(()) } else { Err(Error::Value { what, given, wanted: "positive" }) }
    }

    fn check_not_negative(what: &'static str, given: f64) -> Result<(), Error> {
        let right = given >= 0.0 && given.is_finite();
        if right { Ok(()) } else { Err(Error::Value { what, given, wanted: "zero or more" }) }
    }

    fn check_finite(what: &'static str, given: f64) -> Result<(), Error> {
        if given.is_finite() { Ok(()) } else { Err(Error::Value { what, given, wanted: "finite" }) }
    }
}

/// The linear part of the world: torques on the bodies, F = -K w - C ẇ + puck terms + offset, and on the puck.
struct Network<const B: usize> {
    stiffness: Block<f64, B>,
    damping: Block<f64, B>,
    /// Torque on the bodies per position and velocity of the puck, and without either.
    from_puck: [[f64; B]; 2],
    offset: [f64; B],
    /// Torque on the puck per its own position and velocity, and without either. That from the bodies is `from_puck` again:
    /// couplings are mutual.
    own: [f64; 2],
    own_offset: f64,
}

impl<const B: usize> Network<B> {
    /// Adds a torque -slope · (q - rest) between two ends, to the stiffness (`derivative` 0) or damping (1).
    fn add(&mut self, ends: [End; 2], derivative: usize, slope: f64) {
        let block = if derivative == 0 { &mut self.stiffness } else { &mut self.damping };
        for (one, other) in [(ends[0], ends[1]), (ends[1], ends[0])] {
            match (one, other) {
                (End::Body(i), other) => {
                    if let Some(x) = block.get_mut(i).and_then(|row| row.get_mut(i)) {
                        *x += slope;
                    }
                    match other {
                        End::Body(j) => {
                            if let Some(x) = block.get_mut(i).and_then(|row| row.get_mut(j)) {
                                *x -= slope;
                            }
                        }
                        End::Puck => {
                            if let Some(x) = self.from_puck.get_mut(derivative).and_then(|row| row.get_mut(i)) {
                                *x += slope;
                            }
                        }
                        End::Ground => {}
                    }
                }
                (End::Puck, _) => {
                    if let Some(x) = self.own.get_mut(derivative) {
                        *x -= slope;
                    }
                }
                (End::Ground, _) => {}
            }
        }
    }

    /// Adds a torque on the first end and its opposite on the second.
    fn push(&mut self, ends: [End; 2], torque: f64) {
        for (end, torque) in [(ends[0], torque), (ends[1], -torque)] {
            match end {
                End::Body(i) => {
                    if let Some(x) = self.offset.get_mut(i) {
                        *x += torque;
                    }
                }
                End::Puck => self.own_offset += torque,
                End::Ground => {}
            }
        }
    }

    fn new(spec: &Spec) -> Result<Self, Error> {
        let mut network = Network {
            stiffness: [[0.0; B]; B],
            damping: [[0.0; B]; B],
            from_puck: [[0.0; B]; 2],
            offset: [0.0; B],
            own: [0.0; 2],
            own_offset: 0.0,
        };
        for (index, coupling) in spec.couplings.iter().enumerate() {
            let ends = [coupling.first, coupling.second];
            let Some(Linear { stiffness, damping, torque }) = coupling.linear() else { continue };
            let damping = match damping {
                Damping::Fixed(damping) => damping,
                Damping::Compensating => {
                    let springs = compensated(spec.couplings, coupling).ok_or(Error::NoSpring { coupling: index })?;
                    spec.compensates_over(coupling) * springs
                }
            };
            network.add(ends, 0, stiffness);
            network.add(ends, 1, damping);
            network.push(ends, torque);
        }
        Ok(network)
    }
}

/// The stiffness that a compensating damper undoes: of all springs between its two ends, in either order; between a body and
/// ground, of all springs at the body. `None` when there is no such spring.
pub(crate) fn compensated(couplings: &[Coupling], damper: &Coupling) -> Option<f64> {
    let grounded = match (damper.first, damper.second) {
        (body @ End::Body(_), End::Ground) | (End::Ground, body @ End::Body(_)) => Some(body),
        (End::Puck, _) | (End::Ground, End::Puck | End::Ground) | (End::Body(_), End::Puck | End::Body(_)) => None,
    };
    couplings
        .iter()
        .filter(|spring| match grounded {
            Some(body) => spring.first == body || spring.second == body,
            None => {
                (spring.first, spring.second) == (damper.first, damper.second)
                    || (spring.second, spring.first) == (damper.first, damper.second)
            }
        })
        .filter_map(|spring| spring.law.spring())
        .fold(None, |sum, stiffness| Some(sum.unwrap_or(0.0) + stiffness))
}

/// Most further steps for one sample's torque: the time of a sample is bounded.
const MOST_AHEAD: u32 = 1000;
/// The most samples from one step of the bodies to the next.
const RAREST: u32 = 1000;

fn check(spec: &Spec) -> Result<(), Error> {
    Error::check_positive("period", spec.period)?;
    if spec.method.takes_new_sample_first() && spec.output != Output::Start {
        return Err(Error::OutputNotStart);
    }
    if spec.advance > 0 && spec.output != Output::End {
        return Err(Error::AdvanceWithoutEnd);
    }
    if spec.advance > MOST_AHEAD {
        return Err(Error::Value { what: "advance", given: f64::from(spec.advance), wanted: "1000 at most" });
    }
    if !(1..=RAREST).contains(&spec.bodies_every) {
        let given = f64::from(spec.bodies_every);
        return Err(Error::Value { what: "bodies_every", given, wanted: "from 1 to 1000" });
    }
    if spec.bodies_every > 1 {
        let lugre = |c: &Coupling| c.is_at_body() && c.law.has_bristle();
        for (feature, is_there) in [
            ("tustin and foh, which take the new sample first", spec.method.takes_new_sample_first()),
            ("an advance", spec.advance > 0),
            ("LuGre friction at a body", spec.couplings.iter().any(lugre)),
            ("a world without bodies", spec.bodies.is_empty()),
        ] {
            if is_there {
                return Err(Error::BodiesEvery { feature });
            }
        }
    }
    for body in spec.bodies {
        Error::check_positive("inertia", body.inertia)?;
        Error::check_finite("position", body.position)?;
        Error::check_finite("velocity", body.velocity)?;
    }
    for (index, coupling) in spec.couplings.iter().enumerate() {
        for end in [coupling.first, coupling.second] {
            if end.body().is_some_and(|i| i >= spec.bodies.len()) {
                return Err(Error::NoSuchBody { coupling: index });
            }
        }
        if coupling.first == coupling.second {
            return Err(Error::SameEnds { coupling: index });
        }
        check_numbers(coupling)?;
        if coupling.law.is_at_puck() && (coupling.is_at_body() || spec.advance > 0) {
            return Err(Error::AtPuck { coupling: index });
        }
        // Of a faster low-pass nothing but rounding is left of v - s.
        if let Law::Acceleration { cutoff, .. } = coupling.law {
            if cutoff * spec.period > 1.0 {
                return Err(Error::Value { what: "cutoff", given: cutoff, wanted: "at most the sampling rate" });
            }
        }
        if !coupling.goes_with(spec.method) {
            return Err(Error::Unsupported { coupling: index, method: spec.method });
        }
    }
    Ok(())
}

/// Every number in its range, and a limit on a law that takes one.
fn check_numbers(coupling: &Coupling) -> Result<(), Error> {
    if let Some(limit) = coupling.limit {
        Error::check_positive("limit", limit)?;
        if !coupling.law.takes_limit() {
            return Err(Error::Value { what: "limit", given: limit, wanted: "absent: this law takes none" });
        }
    }
    let mut law = coupling.law;
    if let Some(Waveform { sine, cosine }) = law.waveform() {
        let factors = || sine.iter().chain(cosine);
        factors().try_for_each(|factor| Error::check_finite("waveform", f64::from(*factor)))?;
    }
    law.quantities().try_for_each(|Quantity { name, range, value }| match range {
        Range::Any => Error::check_finite(name, *value),
        Range::ZeroOrMore => Error::check_not_negative(name, *value),
        Range::Positive => Error::check_positive(name, *value),
    })
}

impl<F: Real, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    /// Compiles a world. Errors when the spec does not fit, is out of range (docs/contract.md, section 2), or the method does not support
    /// it.
    pub fn new(spec: &Spec) -> Result<Self, Error> {
        let n = spec.bodies.len();
        if n > B {
            return Err(Error::TooManyBodies { given: n, room: B });
        }
        if spec.couplings.len() > C {
            return Err(Error::TooManyCouplings { given: spec.couplings.len(), room: C });
        }
        check(spec)?;

        let network = Network::<B>::new(spec)?;
        let mut inertia = [1.0; B];
        let mut start = Vector::<f64, B>::ZERO;
        for (place, body) in inertia.iter_mut().zip(spec.bodies) {
            *place = body.inertia;
        }
        for ((position, velocity), body) in start.position.iter_mut().zip(&mut start.velocity).zip(spec.bodies) {
            (*position, *velocity) = (body.position, body.velocity);
        }

        let mut nonlinear = [None; C];
        for (index, (place, coupling)) in nonlinear.iter_mut().zip(spec.couplings).enumerate() {
            let springs =
                if coupling.law.is_compensating() { compensated(spec.couplings, coupling) } else { Some(0.0) };
            let springs = springs.ok_or(Error::NoSpring { coupling: index })?;
            let compensating = spec.compensates_over(coupling) * springs;
            *place = Nonlinear::<F>::new(coupling, compensating, spec.method.finds_torques());
        }
        let contacts = nonlinear.iter().flatten().filter(|coupling| coupling.at_body()).count();
        let force_on_bodies = contacts > 0;
        // Runge-Kutta is a matrix only for a linear world; with nonlinear torques it takes four of Euler's stages.
        let staged = spec.method.has_stages() && force_on_bodies;
        let method = if staged { Method::ForwardEuler } else { spec.method };

        let dynamics = Dynamics { n, inertia, stiffness: network.stiffness, damping: network.damping };
        let rule = dynamics.rule(method, spec.step())?;
        let respond = |half: &Half<f64, B>, torque: &[f64; B]| {
            let mut out = Vector::ZERO;
            half.apply(n, torque, &mut out);
            out
        };
        let input = |half: &Half<f64, B>| Response {
            position: respond(half, &network.from_puck[0]).map(F::from_f64),
            velocity: respond(half, &network.from_puck[1]).map(F::from_f64),
        };
        let mut drift = respond(&rule.new, &network.offset);
        drift.add(n, 1.0, &respond(&rule.old, &network.offset));

        let mut compiled = Loop {
            bodies: n,
            period: F::from_f64(spec.period),
            rate: F::from_f64(1.0 / spec.step()),
            new_sample_first: spec.method.takes_new_sample_first(),
            skips: spec.bodies_every.saturating_sub(1),
            staged,
            has_fast_path: false,
            moment: match spec.output {
                Output::Start => Moment::Start,
                Output::Middle => Moment::Middle,
                Output::End if spec.advance == 0 => Moment::End,
                Output::End => Moment::Ahead(spec.advance),
            },
            start: start.map(F::from_f64),
            state: core::array::from_fn(|j| Response {
                position: rule.state.from_position.column(j).map(F::from_f64),
                velocity: rule.state.from_velocity.column(j).map(F::from_f64),
            }),
            input_new: input(&rule.new),
            input_old: input(&rule.old),
            drift: drift.map(F::from_f64),
            force: force_on_bodies.then(|| core::array::from_fn(|j| rule.new.column(j).map(F::from_f64))),
            gradient: (force_on_bodies && spec.method.finds_torques()).then(|| Gradient {
                inertia: inertia.map(F::from_f64),
                rate: F::from_f64(1.0 / spec.step()),
                contacts,
            }),
            port: Port {
                puck: network.own.map(F::from_f64),
                bodies: Vector { position: network.from_puck[0], velocity: network.from_puck[1] }.map(F::from_f64),
                offset: F::from_f64(network.own_offset),
            },
            nonlinear,
            nonlinear_count: nonlinear.iter().rposition(Option::is_some).map_or(0, |last| last + 1),
            sensor: Sensor::new::<W>(spec)?,
            actuator: Actuator::new(spec)?,
        };
        compiled.has_fast_path = compiled.allows_fast_path();
        if compiled.is_finite() { Ok(compiled) } else { Err(Error::NotFinite) }
    }

    fn is_finite(&self) -> bool {
        let vectors = [&self.start, &self.drift, &self.port.bodies];
        let numbers = [self.period, self.rate, self.port.offset, self.port.puck[0], self.port.puck[1]];
        self.state.iter().chain([&self.input_new, &self.input_old]).all(Response::is_finite)
            && vectors.iter().all(|v| v.is_finite())
            && numbers.iter().all(|x| x.is_finite())
            && self.force.iter().flatten().all(Vector::is_finite)
            && self.period > F::ZERO
    }
}
