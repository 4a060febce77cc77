//! Passivity of a network whose periods, phases and delays are those of the file and never change (docs/theory.md, "Fixed rates").
//!
//! The bound for any clocks takes the oldest position at every instant. Where the times are known, each instant has its own, and the
//! condition over all hands is a Hermitian matrix at every frequency, decided between computed frequencies too.

mod form;
mod proof;
mod schedule;

use std::f64::consts::{PI, TAU};

use hapt_model::{End, EstimatorKind, Law, System, World};
use serde::Serialize;

use super::FixedExcess;
use super::burden::Burden;
use crate::equations::laws::Kind;
use crate::equations::slopes;
use crate::error::Error;
use form::Form;
use proof::Member;
use schedule::Schedule;

/// The most stretches of a common period: the order of the matrix.
const ORDER: i64 = 64;
/// The most periods that an age lasts.
const BACK: f64 = 500.0;

const UNDECIDED: &str = "the search over all frequencies does not decide";

/// The verdict at the periods, phases and delays of the file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FixedRates {
    /// Whether the devices' dampings are enough; `None` where the times are not fixed, or the search does not decide.
    pub passive: Option<bool>,
    /// Whether the condition is necessary too: some hands draw energy where it fails.
    pub exact: bool,
    /// Whether it is proved for the whole loops with their links, not only for the linear part.
    pub proved: bool,
    /// Why not, or why there is no verdict; one sentence each.
    pub not_proved: Vec<String>,
    /// Dampings of the devices that are enough, at the edge, N·m·s/rad (linear: N·s/m).
    #[serde(serialize_with = "super::pairs")]
    pub required_damping: Vec<(String, Option<f64>)>,
    /// The frequency that requires them; 0 where it is approached toward 0.
    pub at_hz: Option<f64>,
    /// The largest factor on the stiffness of every link up to which it is passive.
    pub stiffness_scale: Option<f64>,
}

/// The form of a network, and the part of each device's damping that is available to it.
struct Posed {
    form: Form,
    /// The part of each device's damping that its world requires, where the world is not in the form.
    taken: Vec<f64>,
    common: f64,
    exact: bool,
}

/// Stiffness and damping to ground of a world that the form takes exactly.
fn in_form(world: &World) -> Result<Option<[f64; 2]>, Error> {
    let is_plain = world.bodies.is_empty()
        && matches!(world.sampling.estimator, EstimatorKind::Exact | EstimatorKind::Difference)
        && !world.sampling.takes_several_samples()
        && world.sampling.filter.is_none()
        && world.couplings.iter().all(|coupling| {
            matches!(Kind::of(coupling), Kind::Linear | Kind::Constant)
                && [coupling.first, coupling.second].contains(&End::Ground)
        });
    is_plain.then(|| slopes::at_puck(world, &world.couplings)).transpose()
}

fn outside_form(network: &System) -> Vec<String> {
    let mut reasons = Vec::new();
    for station in &network.stations {
        let (name, world) = (&station.name, &station.world);
        if station.drift != 0.0 {
            reasons.push(format!("the clock of {name} drifts"));
        } else if !world.sampling.is_even() {
            reasons.push(format!("the intervals or the delay of {name} vary: loop.interval_max, loop.delay_max"));
        }
        if world.device.lag_range()[1] > 0.0 {
            reasons.push(format!("the motor of {name} lags behind its command: device.lag"));
        }
    }
    for link in network.links.iter().filter(|link| link.acts()) {
        let [one, other] = link.between.map(|at| network.stations[at].name.as_str());
        if link.damping > 0.0 {
            reasons.push(format!("the link between {one} and {other} is damped: links.*.damping"));
        }
        if link.delay_max_s() > link.delay || link.loss > 0.0 {
            reasons.push(format!("the messages between {one} and {other} vary in delay or are lost: delay_max, loss"));
        }
    }
    reasons
}

/// The form, or why there is none.
fn posed(network: &System, demands: &[Option<f64>]) -> Result<Result<Posed, Vec<String>>, Error> {
    let reasons = outside_form(network);
    if !reasons.is_empty() {
        return Ok(Err(reasons));
    }
    let no = |reason: &str| Ok(Err(vec![reason.to_string()]));
    let Some(schedule) = Schedule::of(network)? else {
        return no("the periods of the stations and links have no common multiple of few samples");
    };
    let order: i64 = schedule.clocks.iter().map(|clock| clock.segments()).sum();
    let oldest = network.links.iter().map(|link| link.age_max).fold(0.0, f64::max);
    if order > ORDER || oldest > BACK * schedule.common {
        return no(
            "the periods of the stations and links repeat too rarely, or too often within an age, to be followed",
        );
    }
    for link in network.links.iter().filter(|link| link.acts()) {
        for to in link.between {
            let age = schedule.message_timing(link, to).age() + network.stations[to].hold();
            if age > link.age_max * (1.0 + 1e-9) {
                return no(
                    "a link lets go between its messages: age_max is below the age of a position at these delays",
                );
            }
        }
    }
    let (mut local, mut taken, mut exact) = (Vec::new(), Vec::new(), true);
    for (station, demand) in network.stations.iter().zip(demands) {
        let (own, demand) = match in_form(&station.world)? {
            Some(own) => (own, Some(0.0)),
            None => ([0.0; 2], *demand),
        };
        let Some(demand) = demand else {
            return Ok(Err(vec![format!("no finite damping suffices for the world of {} alone", station.name)]));
        };
        exact &= demand == 0.0;
        local.push(own);
        taken.push(demand);
    }
    let is_linked = |at: usize| network.links.iter().any(|link| link.acts() && link.between.contains(&at));
    let counts: Vec<bool> =
        (0..local.len()).map(|at| is_linked(at) || local[at] != [0.0; 2] || taken[at] > 0.0).collect();
    Ok(Ok(Posed { form: Form::of(network, &schedule, &local, &counts), taken, common: schedule.common, exact }))
}

impl Posed {
    /// Devices with these dampings, and links `scale` times as stiff.
    fn member(&self, damping: impl Fn(usize) -> f64, scale: f64) -> Member {
        let damping = self.taken.iter().enumerate().map(|(at, taken)| damping(at) - taken).collect();
        Member { damping, scale }
    }

    /// The largest factor on the stiffness of all links up to which it is passive; `None` where it is with any, or with none.
    fn scale(&self, damping: &[f64]) -> Option<f64> {
        let found = self.form.extreme(1e12, false, |scale| self.member(|at| damping[at], scale))?;
        found.angle.map(|_| found.value)
    }

    fn hz(&self, angle: f64) -> f64 {
        angle.min(PI) / (TAU * self.common)
    }
}

/// The verdict; `required`: what any clocks require, whose proportions the dampings at the edge have where those of the devices are not
/// enough.
pub(super) fn fixed(
    network: &System,
    demands: &[Option<f64>],
    burden: &Burden,
    required: &[Option<f64>],
    mut not_proved: Vec<String>,
) -> Result<FixedRates, Error> {
    let names = || network.stations.iter().map(|station| station.name.clone());
    let none = |reasons: Vec<String>| FixedRates {
        passive: None,
        exact: false,
        proved: false,
        not_proved: reasons,
        required_damping: names().map(|name| (name, None)).collect(),
        at_hz: None,
        stiffness_scale: None,
    };
    let posed = match posed(network, demands)? {
        Ok(posed) => posed,
        Err(reasons) => return Ok(none(reasons)),
    };
    if network.links.iter().any(|link| link.limit.is_some() || !matches!(link.law, Law::Spring { .. })) {
        not_proved.push("a wall, or a spring with a limit, counts as its steepest slope at all times".into());
    }
    let own = |at: usize| burden.damping[at];
    let Some(verdict) = posed.form.passive(&posed.member(own, 1.0)) else { return Ok(none(vec![UNDECIDED.into()])) };
    let passive = verdict.is_ok();
    let share: Vec<f64> = match passive {
        true => burden.damping.clone(),
        false => required.iter().map(|b| b.unwrap_or(0.0)).collect(),
    };
    let edge = posed.form.extreme(0.0, true, |factor| posed.member(|at| factor * share[at], 1.0));
    let scale = posed.scale(&burden.damping);
    Ok(FixedRates {
        passive: Some(passive),
        exact: posed.exact,
        proved: not_proved.is_empty(),
        not_proved,
        required_damping: names()
            .zip(&share)
            .map(|(name, share)| (name, edge.map(|edge| edge.value * share)))
            .collect(),
        at_hz: edge.and_then(|edge| edge.angle).map(|angle| posed.hz(angle)),
        stiffness_scale: scale,
    })
}

/// How far the network is beyond the edge at the file's own times; else why there is no verdict.
pub(super) fn excess(
    network: &System,
    demands: &[Option<f64>],
    damping: &[f64],
) -> Result<Result<FixedExcess, Vec<String>>, Error> {
    let posed = match posed(network, demands)? {
        Ok(posed) => posed,
        Err(reasons) => return Ok(Err(reasons)),
    };
    let Some(verdict) = posed.form.passive(&posed.member(|at| damping[at], 1.0)) else {
        return Ok(Err(vec![UNDECIDED.into()]));
    };
    // `1.0 / scale` is 1 at the edge, and is proportional to the stiffness of the links where the worlds require no damping.
    let stiffness = posed.scale(damping).map(|scale| 1.0 / scale - 1.0);
    Ok(Ok(match verdict {
        Ok(()) => FixedExcess { value: stiffness.unwrap_or(-1.0).min(-f64::MIN_POSITIVE), hz: None },
        Err(angle) => {
            let value = stiffness.unwrap_or(f64::INFINITY).max(f64::MIN_POSITIVE);
            FixedExcess { value, hz: Some(posed.hz(angle)) }
        }
    }))
}
