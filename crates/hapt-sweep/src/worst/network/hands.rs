//! Hands at all stations whose inertias tune a mode of the whole network.
//!
//! A link on old positions amplifies opposite motions of its two ends: a negative damping of K A in each direction, at low frequencies. Let v be
//! the mode shape of the pucks, with opposite signs at the two ends of every link, and let each hand have a spring of the part ρ of the stiffness
//! at the puck. With
//!
//! ```text
//! S_i = k_i + Σ_j K_ij (1 - v_j/v_i),    m_i = (1 + ρ) S_i/ω²
//! ```
//!
//! v is a mode of the frequency ω for any network: the hand's inertia is m_i less the device's.

use hapt_analysis::Grip;
use hapt_model::{Link, System};

use crate::worst::hand::{Hand, plain};

/// The smallest inertia of a hand, as a part of its device's inertia.
const MIN_INERTIA_RATIO: f64 = 1e-3;

/// The motion of the pucks in a mode.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Mode {
    /// The mode shape, scaled to a largest entry of 1; 0 for a station without a hand.
    pub shape: Vec<f64>,
    /// ω in rad/s.
    pub angular: f64,
    /// ρ.
    pub share: f64,
}

fn joined(network: &System) -> impl Iterator<Item = &Link> {
    network.links.iter().filter(|link| link.stiffness() > 0.0)
}

/// Signs that differ at the two ends of every link, as far as rings of links allow; 0 without a link.
pub(super) fn opposite(network: &System) -> Vec<f64> {
    let mut signs = vec![0.0; network.stations.len()];
    for start in 0..signs.len() {
        if signs[start] != 0.0 || !joined(network).any(|link| link.between.contains(&start)) {
            continue;
        }
        signs[start] = 1.0;
        let mut todo = vec![start];
        while let Some(at) = todo.pop() {
            for [one, other] in joined(network).map(|link| link.between) {
                for (from, to) in [(one, other), (other, one)] {
                    if from == at && signs[to] == 0.0 {
                        signs[to] = -signs[from];
                        todo.push(to);
                    }
                }
            }
        }
    }
    signs
}

impl Mode {
    /// S_i, N·m/rad (linear: N/m), for the stiffness at each puck that its own world has.
    fn felt(&self, network: &System, own: &[f64]) -> Vec<f64> {
        let mut felt = own.to_vec();
        for link in joined(network) {
            let [i, j] = link.between;
            for (at, other) in [(i, j), (j, i)] {
                if self.shape[at] != 0.0 {
                    felt[at] += link.stiffness() * (1.0 - self.shape[other] / self.shape[at]);
                }
            }
        }
        felt
    }

    /// The hands, for pucks that oscillate with the amplitudes `reach` times the shape.
    pub fn hands(&self, network: &System, own: &[f64], reach: f64) -> Vec<Option<Hand>> {
        let felt = self.felt(network, own);
        let hand = |(at, station): (usize, &hapt_model::Station)| {
            if self.shape[at] == 0.0 || felt[at] <= 0.0 {
                return None;
            }
            let device = station.world.device.inertia;
            let all = (1.0 + self.share) * felt[at] / (self.angular * self.angular);
            let stiffness = self.share * felt[at];
            let grip = Grip { inertia: (all - device).max(MIN_INERTIA_RATIO * device), damping: 0.0, stiffness };
            let place = reach * self.shape[at];
            // At rest its spring balances the network's torque and the friction.
            let to = place * (1.0 + 1.0 / self.share)
                + 2.0 * station.world.device.largest_friction() * place.signum() / stiffness;
            Some(Hand { grip, to, hold_and_open: None })
        };
        network.stations.iter().enumerate().map(hand).collect()
    }
}

/// The amplitude of the pucks: a tenth of a radian (linear: 1 cm), within a quarter of the limits of links and motors, at least ten counts, and
/// inside of every wall.
pub(super) fn reach(network: &System) -> f64 {
    let (mut within, mut least) = (plain(network.motion), 0.0f64);
    for link in joined(network) {
        let motors = link.between.map(|at| network.stations[at].world.device.limit);
        let limits = motors.into_iter().chain([link.limit]).flatten();
        within = limits.map(|limit| 0.125 * limit / link.stiffness()).fold(within, f64::min);
        if let hapt_model::Law::Wall { at, .. } = link.law {
            least = least.max(at.abs());
        }
    }
    let counts = network.stations.iter().filter_map(|station| station.world.count());
    counts.fold(within + least, |reach, count| reach.max(10.0 * count))
}
