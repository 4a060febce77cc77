//! Passivity of stations that are joined by links (docs/theory.md, (T50) to (T53)).
//!
//! Each station computes its own end of a link, -φ(z_i - z_j), from its own sample and the newest position that has come from the
//! other. Their errors in z are at most the displacements since: with |φ'| ≤ K, the pair does beyond the change of the link's energy at
//! most the work
//!
//! ```text
//! K a_i ∫ż_i² + K a_j ∫ż_j² + K (A_ij + A_ji) ‖ż_i‖ ‖ż_j‖
//! ```
//!
//! a_i is what the station's own sampling requires per stiffness, (T42), (T45) or (T46); A_ij is the greatest age of the position of j that
//! i uses, at any time that it acts, with the motor's lag. No clocks are compared and no message has to arrive. With the local demands d_i
//! the network is passive where the matrix
//!
//! ```text
//! M = diag(b_i - d_i - Σ_j K_ij a_i),    M_ij = -K_ij (A_ij + A_ji)/2
//! ```
//!
//! is not indefinite; weights of 1 give b_i ≥ d_i + Σ_j K_ij (a_i + (A_ij + A_ji)/2).

mod burden;
mod demands;
mod fixed;
mod linked;
mod rounded;
mod system;
mod text;

use hapt_model::{Damping, End, Law, Link, Station, System, World};
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use crate::certificate::check::{Check, check};
use crate::certificate::remedies::remedies;
use crate::equations::laws;
use crate::error::Error;
use crate::passivity::quantisation::{quantisation, step};
use crate::passivity::within::beyond_friction;
use burden::{Burden, bounds_damping};

pub use demands::{Demands, FixedExcess};
pub use fixed::FixedRates;
pub use linked::{Linked, StationFindings, check_links};
pub use rounded::{Rounded, rounded};
pub use system::{SystemCheck, check_system};

/// The certificate of a network. It serialises to what `hapt check --json` prints of one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NetworkCheck {
    /// In file order; serialised as a mapping by name.
    #[serde(serialize_with = "by_name")]
    pub stations: Vec<StationCheck>,
    /// In file order.
    pub links: Vec<LinkCheck>,
    /// Whether every station is certified by itself, and all are passive together.
    pub certified: bool,
    /// The same at exactly the periods, phases and delays of the file: a second and sharper verdict.
    pub fixed: FixedRates,
    /// The remedies, or the margins of a passive one; `None` where they are left out.
    pub remedies: Option<NetworkRemedies>,
    /// Conditions that apply to the numbers.
    pub notes: Vec<String>,
}

/// One station.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StationCheck {
    /// Its name.
    #[serde(skip)]
    pub name: String,
    /// Its world without links.
    pub local: Check,
    /// The device damping that its world and its part of all links require, N·m·s/rad (linear: N·s/m); `None` where no finite damping
    /// is known to suffice.
    pub required_damping: Option<f64>,
    /// The least damping of its device, in the same unit.
    pub device_damping: f64,
    /// Whether that is enough.
    pub passive: bool,
    /// Whether it is proved for the whole loop with its links, not only for the linear part.
    pub proved: bool,
    /// The reasons why it is not proved, one sentence each.
    pub not_proved: Vec<String>,
}

/// One link.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinkCheck {
    /// The stations' names.
    pub between: [String; 2],
    /// The greatest age of a position at any time that its torque acts, s.
    pub age_max_s: f64,
    /// Its stiffness, N·m/rad (linear: N/m).
    pub stiffness: f64,
    /// Its damping, N·m·s/rad (linear: N·s/m).
    pub damping: f64,
    /// The largest stiffness with which the network is passive, all else as it is; `None`: with none.
    pub stiffness_max: Option<f64>,
}

/// Values of which each makes the network passive by itself; where it is, its margins. `None`: none does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NetworkRemedies {
    /// The largest factor on the stiffness of every link.
    pub stiffness_scale: Option<f64>,
    /// The largest factor on the `age_max` of every link.
    pub age_scale: Option<f64>,
    /// The largest factor on the damping of every link.
    pub damping_scale: Option<f64>,
    /// The least damping of each station's device, the others as they are.
    #[serde(serialize_with = "pairs")]
    pub device_damping: Vec<(String, Option<f64>)>,
}

fn by_name<S: Serializer>(stations: &[StationCheck], to: S) -> Result<S::Ok, S::Error> {
    let mut map = to.serialize_map(Some(stations.len()))?;
    for station in stations {
        map.serialize_entry(&station.name, station)?;
    }
    map.end()
}

fn pairs<S: Serializer>(pairs: &[(String, Option<f64>)], to: S) -> Result<S::Ok, S::Error> {
    let mut map = to.serialize_map(Some(pairs.len()))?;
    for (name, value) in pairs {
        map.serialize_entry(name, value)?;
    }
    map.end()
}

/// The certificate of a network: each station by itself, and all of them together, for any clocks and any loss within the links' ages.
///
/// # Errors
/// As [`check`] of a station's world.
pub fn check_network(network: &System) -> Result<NetworkCheck, Error> {
    let locals = network.stations.iter().map(|station| check(&station.world)).collect::<Result<Vec<_>, _>>()?;
    let demands = Demands::found(&locals);
    let burden = Burden::of(network, &demands.uneven)?;
    let required = burden.required();
    let mut stations = Vec::new();
    let mut of_links = Vec::new();
    for index in 0..locals.len() {
        of_links.push(unproved_of_links(network, index)?);
    }
    let named = |(station, reasons): (&Station, &Vec<String>)| {
        reasons.iter().map(|reason| format!("{}: {reason}", station.name)).collect::<Vec<_>>()
    };
    let mut unproved: Vec<String> = network.stations.iter().zip(&of_links).flat_map(named).collect();
    let of_worlds = locals.iter().map(|local| &local.passivity.not_proved);
    unproved.extend(network.stations.iter().zip(of_worlds).flat_map(named));
    let fixed = fixed::fixed(network, &demands.even, &burden, &required, unproved)?;
    for (index, ((station, local), of_links)) in network.stations.iter().zip(locals).zip(of_links).enumerate() {
        let not_proved = [local.uneven.not_proved.clone(), of_links].concat();
        let device_damping = burden.damping[index];
        let required_damping = required[index];
        stations.push(StationCheck {
            name: station.name.clone(),
            required_damping,
            device_damping,
            passive: required_damping.is_some_and(|b| b <= device_damping),
            proved: not_proved.is_empty(),
            not_proved,
            local,
        });
    }
    let links = network.links.iter().enumerate().map(|(index, link)| LinkCheck {
        between: link.between.map(|at| network.stations[at].name.clone()),
        age_max_s: link.age_max,
        stiffness: link.stiffness(),
        damping: link.damping,
        stiffness_max: burden.stiffness_max(index),
    });
    let remedies = NetworkRemedies {
        stiffness_scale: burden.stiffness_scale(),
        age_scale: burden.age_scale(),
        damping_scale: burden.damping_scale(),
        device_damping: stations
            .iter()
            .enumerate()
            .map(|(index, station)| (station.name.clone(), burden.least_damping(index)))
            .collect(),
    };
    Ok(NetworkCheck {
        links: links.collect(),
        fixed,
        certified: stations.iter().all(|station| station.passive && station.local.certified.holds()),
        remedies: Some(remedies),
        notes: notes(network),
        stations,
    })
}

impl NetworkCheck {
    /// The same with the remedies of each station's world without links, or with none: those of `network`, whose certificate this is.
    ///
    /// # Errors
    /// As [`remedies`].
    pub fn with_remedies(mut self, network: &System, wanted: bool) -> Result<Self, Error> {
        self.remedies = self.remedies.filter(|_| wanted);
        for (checked, station) in self.stations.iter_mut().zip(&network.stations) {
            checked.local.remedies = wanted.then(|| remedies(&station.world)).transpose()?;
        }
        Ok(self)
    }
}

fn notes(network: &System) -> Vec<String> {
    let mut notes = vec![
        "the claim holds for any clocks, any order and any loss, as long as no position acts beyond its age_max; a link that lets go keeps \
         it, and one that takes hold again adds at most its soft torque times its stretch, and a little where one end acts before the other"
            .to_string(),
    ];
    for link in network.links.iter().filter(|link| link.acts()) {
        let [one, other] = link.between.map(|at| &network.stations[at]);
        for (sender, receiver) in [(one, other), (other, one)] {
            let usual = link.between_messages(sender.world.sampling.period) + link.delay_max_s() + receiver.hold();
            if usual > link.age_max {
                notes.push(format!(
                    "the link lets go at {} even when no message of {} is lost: a position is up to {:?} s old, and age_max is {:?} s",
                    receiver.name, sender.name, usual, link.age_max
                ));
            }
        }
    }
    notes
}

/// Why the claim is not proved of a station's whole loop with its links, beyond the reasons of its world.
fn unproved_of_links(network: &System, index: usize) -> Result<Vec<String>, Error> {
    let station = &network.stations[index];
    let own: Vec<&Link> = network.links.iter().filter(|link| link.between.contains(&index)).collect();
    let mut reasons = Vec::new();
    if own.iter().any(|link| link.damping > 0.0) && !bounds_damping(station) {
        reasons.push(format!(
            "the damping of a link takes the velocity of {} by the {} estimator{}, for which there is no bound; expected \
             stations.{}.loop.estimator = \"difference\" or \"low-pass\"",
            station.name,
            station.world.sampling.estimator.name(),
            if station.world.sampling.takes_several_samples() { " over several samples" } else { "" },
            station.name
        ));
    }
    if let Some(reason) = limit(station, &own) {
        reasons.push(reason);
    }
    if let Some(reason) = counts(network, index, &own)? {
        reasons.push(reason);
    }
    Ok(reasons)
}

/// The motor's limit is never reached, or cuts the sum of world and links.
fn limit(station: &Station, own: &[&Link]) -> Option<String> {
    let limit = station.world.device.limit?;
    let world: f64 = station.world.couplings.iter().filter(|coupling| laws::at_puck(coupling)).map(laws::most).sum();
    let links: f64 = own.iter().map(|link| link.limit.unwrap_or(f64::INFINITY)).sum();
    let is_linked = own.iter().any(|link| link.acts());
    (is_linked && world + links > limit).then(|| {
        "the motor's limit may cut the sum of the world's torque and the links': give the links, and the couplings at the puck, a limit each \
         whose sum is within device.limit"
            .to_string()
    })
}

/// Whether the torque errors by the counts of both ends of every link are within the friction of the device.
fn counts(network: &System, index: usize, own: &[&Link]) -> Result<Option<String>, Error> {
    let Some(world) = station_with_links(network, index, own) else { return Ok(None) };
    let is_enough = world.device.least_friction() >= 0.0 && quantisation(&world)?.ok;
    Ok((!is_enough).then(|| {
        "encoder counts, here or at the other end of a link, make steps in its torque that the friction of the device does not cover".to_string()
    }))
}

/// The world of a claim on the least friction of its device, less the torques that this friction takes, (T76).
fn on_least_friction(world: &World) -> World {
    let mut least = world.clone();
    least.device.set_friction(world.device.friction_range()[0]);
    beyond_friction(&least).into_owned()
}

/// The world of a station with its links as couplings to ground, and the friction that the counts at their other ends leave; `None` without
/// counts and levels, or links.
fn station_with_links(network: &System, index: usize, own: &[&Link]) -> Option<World> {
    let station = &network.stations[index];
    let is_rotary = network.motion == hapt_model::Motion::Rotary;
    let size =
        |world: &World| world.device.encoder.map_or(0.0, |n| if is_rotary { std::f64::consts::TAU / n } else { n });
    // The torque's error is at most K (Δ_i + Δ_j)/2 + D (Δ_i/T_i + Δ_j/T_j), whose work is at most that times the path.
    let (mut others, mut here, mut damping) = (0.0, 0.0, 0.0);
    for link in own {
        let other = &network.stations[link.between[usize::from(link.between[0] == index)]].world;
        let shortest = link.period.unwrap_or(other.sampling.period);
        others += (0.5 * link.stiffness() + link.damping / shortest) * size(other);
        here += link.stiffness();
        damping += link.damping;
    }
    if here + damping == 0.0 || others + size(&station.world) == 0.0 && step(&station.world) == 0.0 {
        return None;
    }
    let mut with_links = on_least_friction(&station.world);
    with_links.device.set_friction(with_links.device.friction - others);
    let laws = [Law::Spring { stiffness: here, rest: 0.0 }, Law::Damper { damping: Damping::Fixed(damping) }];
    with_links.couplings.extend(laws.map(|law| law.between(End::Puck, End::Ground)));
    Some(with_links)
}
