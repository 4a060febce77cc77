//! The power that hands draw from a network whose messages round positions (docs/theory.md, (T65)).

use hapt_model::{Link, System};

use super::burden::Burden;
use super::demands::Demands;
use super::{NetworkCheck, on_least_friction, station_with_links};
use crate::error::Error;
use crate::passivity::quantisation::quantisation;

/// The power that a network gives where the positions in messages are rounded, if it is passive on exact positions.
#[derive(Clone, Debug, PartialEq)]
pub struct Rounded {
    /// At each station, the torque that its friction does not cover, N·m (linear: N).
    pub torque: Vec<f64>,
    /// All hands together draw no more than this mean power from the instant on at which nothing was stored, in W; 0 where the friction
    /// covers all of it. `None`: nothing is known to bound it.
    pub power: Option<f64>,
}

/// The bound for positions that are rounded to the nearest multiple of `step`, in rad (linear: m), of the network whose certificate is `check`.
///
/// # Errors
/// As [`super::check_network`].
pub fn rounded(network: &System, check: &NetworkCheck, step: f64) -> Result<Rounded, Error> {
    let locals: Vec<_> = check.stations.iter().map(|station| station.local.clone()).collect();
    let burden = Burden::of(network, &Demands::found(&locals).uneven)?;
    let mut torque = Vec::new();
    for at in 0..network.stations.len() {
        let own: Vec<&Link> = network.links.iter().filter(|link| link.between.contains(&at)).collect();
        let sent: f64 = own
            .iter()
            .map(|link| {
                let other = link.between[usize::from(link.between[0] == at)];
                let shortest = link.period.unwrap_or(network.stations[other].world.sampling.period);
                (0.5 * link.stiffness() + link.damping / shortest) * step
            })
            .sum();
        torque.push((sent - friction_left(network, at, &own)?).max(0.0));
    }
    let power = burden.power(&torque);
    Ok(Rounded { torque, power })
}

/// The friction of a device that the counts of both ends of its links leave, N·m (linear: N).
fn friction_left(network: &System, at: usize, own: &[&Link]) -> Result<f64, Error> {
    let Some(world) = station_with_links(network, at, own) else {
        return Ok(on_least_friction(&network.stations[at].world).device.friction);
    };
    let found = quantisation(&world)?;
    let count = world.count().unwrap_or(0.0);
    Ok((found.friction - found.least_friction - 0.5 * found.stiffness * count).max(0.0))
}
