//! The answer on a world, for programs and for people.

use std::f64::consts::TAU;

use hapt_model::keys::Measure;
use hapt_model::{End, EstimatorKind, Law, Method, Motion, World};
use serde::Serialize;

use crate::continuous::{bent, bent_anywhere};
use crate::counts::{Quantisation, power, quantisation};
use crate::error::Error;
use crate::free::{free, free_at_this_period, shortest_period};
use crate::held::held;
use crate::laws::{self, Kind, is_nonlinear};
use crate::passivity::{Cause, Passivity, passivity};
use crate::remedies::Remedies;
use crate::stability::{COMBINED, Mode, NOT_SEARCHED, Stability, Verdict};

/// What `check` says of a world. It serialises to the mapping that `hapt check --json` prints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// T in s.
    pub period_s: f64,
    /// The method's name in world files.
    pub method: &'static str,
    /// The output's name in world files.
    pub output: &'static str,
    /// The world alone, the puck held still.
    pub held: Stability,
    /// World, estimator, delay, hold and device together, no hand on the puck.
    pub free: Stability,
    /// The loop against any passive hand.
    pub passivity: Passivity,
    /// What the encoder's counts allow.
    pub quantisation: Quantisation,
    /// What would make it certified, or how far it is from losing that; `None` where nobody asked.
    pub remedies: Option<Remedies>,
    /// Neither held nor free unstable, and passive.
    pub certified: bool,
    /// What a reader of the numbers has to know.
    pub notes: Vec<String>,
    #[serde(skip)]
    motion: Motion,
    #[serde(skip)]
    has_counts: bool,
}

/// Analyses a world: its loop's period and method, its bodies and couplings.
///
/// # Errors
/// [`Error::Eigenvalues`] and [`Error::Step`] when its numbers go beyond double precision; [`Error::InFlight`] when its delay is
/// more periods than the analysis carries; [`Error::Value`] and [`Error::NoSuchBody`] for a world
/// that no reader has checked.
pub fn check(world: &World) -> Result<Check, Error> {
    with_free(world, free(world)?)
}

/// The same but for the free loop's critical period, which is not searched: that search is most of `check`'s work, and changes no verdict.
/// For whoever needs the answer while a value is still under somebody's finger.
///
/// # Errors
/// As [`check`].
pub fn quick_check(world: &World) -> Result<Check, Error> {
    with_free(world, free_at_this_period(world)?)
}

fn with_free(world: &World, free: Stability) -> Result<Check, Error> {
    let sampling = &world.sampling;
    let held = held(&world.bodies, &world.couplings, sampling.method, sampling.period)?;
    let passivity = passivity(world)?;
    let holds = |of: &Stability| of.verdict != Verdict::Unstable;
    Ok(Check {
        period_s: sampling.period,
        method: sampling.method.name(),
        output: sampling.output.name(),
        certified: holds(&held) && holds(&free) && passivity.passive,
        held,
        free,
        passivity,
        quantisation: quantisation(world)?,
        remedies: None,
        notes: notes(world)?,
        motion: world.motion,
        has_counts: world.device.encoder.is_some(),
    })
}

/// How the note begins that says so.
const ESTIMATE: &str = "held is a linear estimate of a nonlinear world";

fn notes(world: &World) -> Result<Vec<String>, Error> {
    let mut notes = Vec::new();
    let bent = bent(&world.couplings);
    let looked = |bent: usize, flat: &str| match bent {
        0 => flat.to_string(),
        n if n <= COMBINED => format!("the worst of {} combinations of flat and steep slopes counts", 1u32 << n),
        n => format!("the worst counts of all flat, all steep and each of {n} nonlinear couplings alone steep"),
    };
    if world.couplings.iter().any(|c| is_nonlinear(c) && laws::at_body(c)) {
        let looked = looked(bent.len(), "its nonlinear couplings at bodies have slope 0 and count as absent");
        notes.push(format!("{ESTIMATE}: {looked}"));
    }
    let method = world.sampling.method;
    if method != Method::ForwardEuler {
        for (index, _) in world.couplings.iter().enumerate().filter(|(_, c)| c.law.is_compensating()) {
            notes.push(format!(
                "couplings.{index}: a compensating damper undoes the growth of forward Euler; with {} it only damps",
                method.name()
            ));
        }
    }
    // No spring, and no nonlinear coupling, holds the body in place: whatever else it does, a shift of it stays.
    for (index, _) in world.bodies.iter().enumerate() {
        let holds = |mut law: Law| law.strength().is_some_and(|strength| *strength.value > 0.0);
        let body = End::Body(index);
        if !world.couplings.iter().any(|c| holds(c.law) && (c.first == body || c.second == body)) {
            let name = world.names.get(index).map_or("", String::as_str);
            notes.push(format!("body {name}: no spring is tied to it, so it stays where it is shifted to"));
        }
    }
    if world.couplings.iter().any(is_nonlinear) {
        let bent = bent_anywhere(&world.couplings);
        let looked = looked(bent.len(), "its nonlinear couplings have slope 0 and count as absent");
        notes.push(format!("free is a linear estimate of a nonlinear world: {looked}"));
    }
    let sampling = &world.sampling;
    let is_foaw = match sampling.estimator {
        EstimatorKind::Foaw | EstimatorKind::FoawBest => true,
        EstimatorKind::Exact | EstimatorKind::Difference | EstimatorKind::LowPass => false,
    };
    if is_foaw && sampling.window > 1 {
        notes.push(format!(
            "free takes {} at its longest window, {} samples, and at its shortest, 1: the worse of the two counts",
            sampling.estimator.name(),
            sampling.window
        ));
    }
    if world.couplings.iter().any(laws::at_puck) {
        notes.push(format!("free: its critical period is searched from {} up", time(shortest_period(sampling))));
    }
    if let Some(power) = power(world)? {
        notes.push(format!(
            "the encoder's counts can feed the bodies, and a hand by them, with a power of at most {} W: for one body K²Δ²/(16 B), K its \
             stiffness to the puck, Δ the count, B its damping to ground",
            short(power)
        ));
    }
    notes.extend(at_puck(world));
    Ok(notes)
}

/// What passivity leaves out, or cannot be had with, at the puck.
fn at_puck(world: &World) -> impl Iterator<Item = String> {
    let damping = world.device.damping;
    world.couplings.iter().enumerate().filter(|(_, c)| laws::at_puck(c)).filter_map(move |(index, c)| match (Kind::of(c), laws::most(c)) {
        (Kind::Coulomb, torque) if torque > 0.0 => Some(format!(
            "couplings.{index}: Coulomb friction at the puck jumps with the sign of the velocity, so no finite damping makes \
             it passive; LuGre friction with its bristles has a finite slope"
        )),
        (Kind::Constant, torque) if torque != 0.0 => {
            let speed = if damping > 0.0 {
                format!("drives the puck at up to {}, its torque over the device's damping", short(torque / damping))
            } else {
                "drives the puck ever faster, because the device has no damping".to_string()
            };
            Some(format!(
                "couplings.{index}: a constant torque at the puck gives energy without bound and counts 0 in passivity; hands \
                 off it {speed}"
            ))
        }
        (Kind::Linear | Kind::Constant | Kind::Potential | Kind::Coulomb | Kind::Lugre, _) => None,
    })
}

/// A rate or a time for people: four digits, no trailing zeros.
pub(crate) fn short(x: f64) -> String {
    let digits = if x == 0.0 { 3 } else { (3 - x.abs().log10().floor() as i32).clamp(0, 12) };
    let text = format!("{x:.*}", digits as usize);
    let scientific = x != 0.0 && !(1e-4..1e5).contains(&x.abs());
    if scientific {
        format!("{x:.3e}")
    } else if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    } else {
        text
    }
}

/// A time for people.
fn time(s: f64) -> String {
    match s {
        s if s < 1e-3 => format!("{} us", short(s * 1e6)),
        s if s < 1.0 => format!("{} ms", short(s * 1e3)),
        s => format!("{} s", short(s)),
    }
}

/// Whether the loop keeps the mode's swing as it is, to what a verdict can see.
fn is_kept(mode: &Mode) -> bool {
    mode.discrete_damping_ratio.is_some_and(|ratio| ratio.abs() < 1e-12)
}

/// The method's name in a sentence.
fn spoken(method: &str) -> &str {
    match method {
        "forward-euler" => "forward Euler",
        "backward-euler" => "backward Euler",
        "semi-implicit-euler" => "semi-implicit Euler",
        "rk4" => "RK4",
        "trapezoidal" => "the trapezoidal rule",
        other => other,
    }
}

/// How fast that is.
fn pace(growth: f64) -> String {
    let ten = (10.0 * growth).exp();
    if ten < 1e3 {
        format!("a factor {ten:.2} in 10 s")
    } else {
        format!("doubling every {}", time(std::f64::consts::LN_2 / growth))
    }
}

impl Check {
    /// The whole verdict in one sentence.
    pub fn verdict_sentence(&self) -> String {
        let reasons = [
            (self.held.verdict == Verdict::Unstable, "it is unstable with the puck held"),
            (self.free.verdict == Verdict::Unstable, "it is unstable when the puck is let go"),
            (!self.passivity.passive, "some passive hands can extract energy"),
        ];
        let reasons: Vec<&str> = reasons.into_iter().filter(|(holds, _)| *holds).map(|(_, words)| words).collect();
        match (reasons.is_empty(), self.passivity.proved) {
            (false, _) => format!("not certified: {}", reasons.join("; ")),
            (true, true) => "certified: stable held and let go, and passive against every passive hand".to_string(),
            (true, false) => {
                "certified, as far as the linear loop goes: stable held and let go, and passive".to_string()
            }
        }
    }

    /// The verdict on the held world in one sentence, with its reason.
    pub fn sentence(&self) -> String {
        let held = &self.held;
        let method = spoken(self.method);
        let Some(growth) = held.growth_per_s else {
            return "stable: with the puck held, nothing is left to move after a sample".to_string();
        };
        match held.verdict {
            Verdict::Unstable => {
                let pace = pace(growth);
                let reason = match (held.critical_period_reason, held.critical_period_s) {
                    (Some("never"), _) if held.modes.iter().any(|m| m.damping_ratio == 0.0) => {
                        format!("{method} is never stable on an undamped mode")
                    }
                    (Some("never"), _) => {
                        format!("at every period {method} takes more damping from a mode than its dampers give")
                    }
                    (_, Some(limit)) if limit < self.period_s => {
                        format!(
                            "{method} is stable here up to a period of {}, and this one is {}",
                            time(limit),
                            time(self.period_s)
                        )
                    }
                    _ => format!("{method} at this period takes it out of the unit circle"),
                };
                format!("unstable: the held world grows by {} per second ({pace}); {reason}", short(growth))
            }
            Verdict::Marginal => {
                let reason = if held.eigenvalues.iter().any(|e| e.im == 0.0 && e.re == 1.0 && e.abs == 1.0) {
                    if self.notes.iter().any(|note| note.starts_with(ESTIMATE)) {
                        "where the nonlinear couplings are slack, something stays where it is shifted to"
                    } else {
                        "something is tied by no spring and stays where it is shifted to"
                    }
                } else if self.method == "forward-euler" {
                    "its dampers undo what forward Euler adds to a swing"
                } else if held.modes.iter().any(|mode| mode.damping_ratio > 0.0 && is_kept(mode)) {
                    "the damping takes just what the method adds to a swing"
                } else {
                    "a swing keeps its size, because nothing damps it"
                };
                let room = held.critical_period_s.map_or(String::new(), |t| format!(", up to a period of {}", time(t)));
                format!("marginal: the held world neither grows nor decays; {reason}{room}")
            }
            Verdict::Stable => {
                let room = match held.critical_period_s {
                    Some(limit) => format!("{method} stays so up to a period of {}", time(limit)),
                    None => format!("{method} stays so at every period"),
                };
                format!(
                    "stable: a disturbance of the held world decays by at least {} per second; {room}",
                    short(-growth)
                )
            }
        }
    }

    /// The verdict on the free loop in one sentence, with its reason.
    pub fn free_sentence(&self) -> String {
        let free = &self.free;
        let Some(growth) = free.growth_per_s else {
            return "stable: let go, the loop goes on as it is, and nothing pulls at the puck".to_string();
        };
        let limit = free.critical_period_s;
        match free.verdict {
            Verdict::Unstable => {
                // The first listed is the largest of all.
                let swing = free.eigenvalues.first().map_or(0.0, |v| v.im.atan2(v.re).abs() / (TAU * self.period_s));
                let how =
                    if swing > 0.0 { format!("swinging at {} Hz", short(swing)) } else { "without a swing".into() };
                let reason = match (free.critical_period_reason, limit) {
                    (Some("never"), _) => "so it does at every shorter period that was examined".to_string(),
                    (Some(NOT_SEARCHED), _) => "its dampers take less than the hold of the torque feeds it".to_string(),
                    (_, Some(limit)) if limit < self.period_s => {
                        format!("it holds up to a period of {}, and this one is {}", time(limit), time(self.period_s))
                    }
                    _ => "the hold of the torque between samples feeds it more than its dampers take".to_string(),
                };
                format!(
                    "unstable: let go, the loop grows by {} per second ({}), {how}; {reason}",
                    short(growth),
                    pace(growth)
                )
            }
            Verdict::Marginal => {
                let room = limit.map_or(String::new(), |t| format!(", up to a period of {}", time(t)));
                format!(
                    "marginal: let go, the loop neither grows nor decays; something in it swings or drifts for ever{room}"
                )
            }
            Verdict::Stable => {
                let room = match limit {
                    Some(limit) => format!("it stays so up to a period of {}", time(limit)),
                    None => "no limit of the period was found".to_string(),
                };
                format!("stable: let go, the loop comes to rest by at least {} per second; {room}", short(-growth))
            }
        }
    }

    /// The verdict on passivity in one sentence, with its reason; dampings in SI.
    pub fn passivity_sentence(&self) -> String {
        let Passivity { required_damping, device_damping, at_hz, passive, proved, cause, .. } = &self.passivity;
        let linear = if *proved { "" } else { " (the linear loop)" };
        let Some(required) = required_damping else {
            let reason = match *cause {
                Some(Cause::Grows { hz }) => {
                    format!("the hand feels a motion at {} Hz that grows by itself", short(hz))
                }
                Some(Cause::Unseen { hz }) => {
                    format!(
                        "the world has a motion at {} Hz that grows by itself, little as the hand feels of it",
                        short(hz)
                    )
                }
                Some(Cause::OutOfStep { hz }) => {
                    format!("the mode at {} Hz is undamped, and its torque is out of phase with the hand", short(hz))
                }
                Some(Cause::Fraction { hz }) => {
                    format!("the mode at {} Hz is undamped, and the delay is not a whole number of samples", short(hz))
                }
                Some(Cause::Coulomb) | None => "Coulomb friction at the puck has no finite slope".to_string(),
            };
            return format!("not passive at any device damping{linear}: {reason}");
        };
        let place = match *at_hz {
            None => "the same at every frequency".to_string(),
            Some(0.0) => "most toward 0 Hz".to_string(),
            Some(hz) => format!("most at {} Hz", short(hz)),
        };
        let unit = Measure::Damping.dimension(self.motion).symbol();
        let (has, wanted) = (short(*device_damping), short(*required));
        if *passive {
            format!(
                "passive against every passive hand{linear}: it requires a device damping of {wanted} {unit}, {place}, and the device has {has}"
            )
        } else {
            let more = short(required - device_damping);
            format!(
                "not passive{linear}: it requires a device damping of {wanted} {unit}, {place}, and the device has {has}, {more} too little"
            )
        }
    }

    /// What the encoder's counts and the motor's levels allow, in one sentence; `None` where both are ideal.
    pub fn quantisation_sentence(&self) -> Option<String> {
        let found = &self.quantisation;
        let unit = |measure: Measure| measure.dimension(self.motion).symbol();
        let most = format!("{} {}", short(found.max_stiffness?), unit(Measure::Stiffness));
        let what = if self.has_counts { "the encoder's counts" } else { "the motor's levels" };
        Some(if found.lacks_friction() {
            let torque = unit(Measure::Torque);
            format!(
                "dampers and levels require a friction of {} {torque}, and the device has {} {torque}: it may buzz",
                short(found.least_friction),
                short(found.friction)
            )
        } else if found.ok {
            format!("friction and damping of the device absorb {what} up to {most} at the puck, and there is less")
        } else {
            format!(
                "friction and damping of the device absorb {what} only up to {most} at the puck, and there is more: it may buzz"
            )
        })
    }
}
