//! The energy that all hands together have drawn from a network, from the ledgers of a run.

use hapt_model::{Link, System};
use hapt_sim::{Error, Run, SystemSummary};
use serde::Serialize;

use crate::worst::drawn::{ROUNDING, RUNAWAY, Supply};

/// The instant of a run at which the hands had drawn most energy beyond the supplied one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DrawnFromNetwork {
    /// The net energy from all pucks to their hands, less `supplied`, in J. At most 0 for a passive network.
    pub gain: f64,
    /// The energy that worlds and links supply, in J: the energy stored at the start, the work of delays and constant torques, and the largest
    /// energy that links add when they connect.
    pub supplied: f64,
    /// That instant, in s.
    pub at_s: f64,
    /// All the work that went between hands and network up to that instant, in J; rounding is a part of it.
    pub exchanged: f64,
    /// The error due to the different sample times of stations, and the counts of encoders, in J.
    pub blur: f64,
    /// The number of releases of link ends.
    pub let_go: u64,
    /// The gain at the last sample, in J.
    pub end: f64,
    /// The time of the last sample, in s: before the scenario's end where the network has diverged.
    pub until_s: f64,
}

impl DrawnFromNetwork {
    /// Whether the gain exceeds rounding and blur.
    pub fn is_gain(&self) -> bool {
        self.gain > ROUNDING * self.exchanged + self.blur
    }
}

/// The energy that a link may add each time that it connects, (T54) and (T55).
#[derive(Clone, Copy, Default)]
struct Hold {
    /// The largest torque of its law, N·m (linear: N), and how far its ends were beyond slack there, rad (linear: m).
    torque: f64,
    stretch: f64,
    /// The fastest of both pucks, rad/s (linear: m/s).
    speed: f64,
}

impl Hold {
    fn see(&mut self, link: &Link, [one, other]: [f64; 2], speed: f64) {
        let torque = link.torque(one - other, 0.0).abs();
        if torque > self.torque {
            (self.torque, self.stretch) = (torque, torque / link.stiffness());
        }
        self.speed = self.speed.max(speed);
    }

    fn most(&self, link: &Link, soft: f64) -> f64 {
        let beyond = (self.torque / soft).max(1.0).ln();
        // The displacement in the sum of both ages.
        let travel = 2.0 * link.age_max * self.speed;
        self.torque.min(soft) * (self.stretch + travel * (1.0 + beyond))
    }
}

/// The energy of a count at each puck, J.
fn grain(network: &System) -> f64 {
    let of = |(at, station): (usize, &hapt_model::Station)| {
        let links = network.links.iter().filter(|link| link.between.contains(&at));
        let stiffness: f64 = links.map(Link::stiffness).sum();
        station.world.count().map_or(0.0, |count| 0.5 * stiffness * count * count)
    };
    network.stations.iter().enumerate().map(of).sum()
}

/// Runs the scenario `name` and computes at each sample the energy that all hands have drawn. They move from `begins` on, when links have
/// connected. `had` in J is the initial energy of the hands' springs. A gain of a million times that plus the network's own ends the run, and
/// so does a number that is not finite.
///
/// # Errors
/// When a loop cannot be compiled.
pub fn drawn_from_network(network: &System, name: &str, begins: f64, had: f64) -> Result<DrawnFromNetwork, Error> {
    let mut run = Run::new(network, name)?;
    let mut summary = SystemSummary::new(network, &run);
    let mut supplies: Vec<Supply> = network.stations.iter().map(|station| Supply::new(&station.world)).collect();
    let count = network.stations.len();
    let (mut supplied, mut places, mut speeds) = (vec![0.0; count], vec![0.0; count], vec![0.0f64; count]);
    // The first connection, before the hands begin, and any later one, after a release.
    let mut first = vec![Hold::default(); network.links.len()];
    let mut whole = first.clone();
    let soft: Vec<f64> = (0..network.links.len()).map(|at| network.end(at, 0).soft).collect();
    let mut most: Option<DrawnFromNetwork> = None;
    let (mut end, mut until_s) = (0.0, 0.0);
    while let Some(row) = run.next() {
        let Ok(row) = row else { break };
        let (at, time) = (row.station, row.row.time);
        if summary.stations[at].rows == 0 {
            supplies[at].begin(row.row);
        }
        supplied[at] = supplies[at].until(row.row);
        (places[at], speeds[at]) = (row.row.puck, row.row.puck_velocity.abs());
        let link_torque = row.link;
        summary.add(&row);
        for (index, link) in network.links.iter().enumerate().filter(|(_, link)| link.between.contains(&at)) {
            let ends = link.between;
            let (ends, speed) = (ends.map(|end| places[end]), speeds[ends[0]].max(speeds[ends[1]]));
            whole[index].see(link, ends, speed);
            if time <= begins {
                first[index].see(link, ends, speed);
            }
        }
        if !summary.is_together(time) {
            continue;
        }
        let taken: f64 = (0..network.links.len())
            .zip(run.releases())
            .map(|(index, released)| {
                let most = |hold: &Hold| hold.most(&network.links[index], soft[index]);
                most(&first[index]) + released.iter().sum::<u64>() as f64 * most(&whole[index])
            })
            .sum();
        let supplied = supplied.iter().sum::<f64>() + taken;
        let gain = summary.had() - supplied;
        if !gain.is_finite() || !link_torque.is_finite() {
            break;
        }
        (end, until_s) = (gain, time);
        if most.is_none_or(|most| gain > most.gain) {
            let exchanged = had + supplied.abs() + summary.exchanged;
            most = Some(DrawnFromNetwork { gain, supplied, at_s: time, exchanged, ..DrawnFromNetwork::default() });
        }
        if gain > 0.0 && gain > RUNAWAY * (had + supplied) {
            break;
        }
    }
    let blur = summary.blur() + grain(network);
    let let_go = run.releases().flatten().sum();
    Ok(DrawnFromNetwork { end, until_s, blur, let_go, ..most.unwrap_or_default() })
}
