//! The plane of two keys, and the claims about its worlds.

use std::borrow::Cow;

use hapt_analysis::{
    Demands, FixedExcess, Keys, MARGINAL, excess, free_eigenvalues, free_growth, held_world_eigenvalues,
    held_world_growth, passivity, required_damping,
};
use hapt_model::{Source, System, World};

use crate::axis::{Axis, Grid};
use crate::boundary::continuation::{INSET, Place};
use crate::error::Error;

hapt_model::named! {
    /// A claim that holds on one side of an edge and fails beyond it. Its name is that of the command line and of tables.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Edge {
        /// The world with the puck held is not unstable.
        Held => "held",
        /// The whole loop, with the puck free, is not unstable.
        Free => "free",
        /// The loop is passive against every passive hand; a network for any clocks and any loss.
        Passive => "passive",
        /// The loop is certified: theorems claim that it is stable held and hands-off and passive, for all times and tolerances that the file states.
        Certified => "certified",
        /// A network is passive at its own periods, phases and delays, which never change.
        Fixed => "fixed",
    }
}

impl Edge {
    /// The state of a loop beyond it.
    pub const fn beyond(self) -> &'static str {
        match self {
            Edge::Held | Edge::Free => "unstable",
            Edge::Passive => "not passive",
            Edge::Certified => "not certified",
            Edge::Fixed => "not passive at fixed times",
        }
    }

    /// The claims about a world, or about a network.
    pub fn of(system: &System) -> &'static [Edge] {
        match system.world() {
            Some(_) => &[Edge::Held, Edge::Free, Edge::Passive, Edge::Certified],
            None => &[Edge::Passive, Edge::Fixed],
        }
    }
}

/// Of a network: the required dampings of its stations' worlds, and the stations for which they change in the plane.
#[derive(Clone, Debug, PartialEq)]
struct NetworkDemands {
    demands: Demands,
    change: Vec<usize>,
}

/// Two keys of a world or network, each over a range.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// The axes to the right and upwards; both rise.
    pub axes: [Axis; 2],
    /// The world or network at the corner where both begin.
    pub system: System,
    demands_of_network: Option<NetworkDemands>,
}

impl Plane {
    /// Reads two axes, each `KEY=FROM..TO[:log]`, against the world or network in `source` with the overrides `sets`.
    ///
    /// # Errors
    /// [`Error::Axis`] for an invalid axis, [`Error::Model`] for a file, or a corner, that cannot be read, [`Error::At`].
    pub fn new(source: &Source, sets: &[String], axes: &[String]) -> Result<Plane, Error> {
        let (grid, system) = Grid::plane(source, sets, axes)?;
        let wrong = |i: usize, message: String| Error::Axis(format!("--vary {}: {message}", axes[i]));
        for (i, axis) in grid.axes.iter().enumerate() {
            if axis.from == axis.to {
                return Err(wrong(i, "both ends are the same: there is no plane".into()));
            }
        }
        let rising = |axis: &Axis| Axis { from: axis.from.min(axis.to), to: axis.from.max(axis.to), ..axis.clone() };
        match &grid.axes[..] {
            [x, y] => {
                let mut plane = Plane { axes: [rising(x), rising(y)], system, demands_of_network: None };
                if plane.system.world().is_none() {
                    let stations = &plane.system.stations;
                    let demands = Demands::of(&plane.system).map_err(|error| plane.failed([0.0, 0.0], error))?;
                    let is_varied = |name: &str| {
                        let own = format!("stations.{name}.");
                        plane.axes.iter().any(|axis| axis.key.starts_with(&own))
                    };
                    let change = (0..stations.len()).filter(|at| is_varied(&stations[*at].name)).collect();
                    plane.demands_of_network = Some(NetworkDemands { demands, change });
                }
                Ok(plane)
            }
            axes => Err(Error::Axis(format!("a boundary is in the plane of two keys, and {} are given", axes.len()))),
        }
    }

    /// The keys' values at a place.
    pub fn values(&self, place: Place) -> [f64; 2] {
        [0, 1].map(|i| {
            let (axis, x) = (&self.axes[i], place[i]);
            if axis.logarithmic {
                axis.from * libm::pow(axis.to / axis.from, x)
            } else {
                axis.from + x * (axis.to - axis.from)
            }
        })
    }

    /// The place of the keys' values; NaN where a logarithmic axis cannot reach one.
    pub fn place(&self, values: [f64; 2]) -> Place {
        [0, 1].map(|i| {
            let (axis, value) = (&self.axes[i], values[i]);
            if axis.logarithmic {
                libm::log(value / axis.from) / libm::log(axis.to / axis.from)
            } else {
                (value - axis.from) / (axis.to - axis.from)
            }
        })
    }

    /// The world or network at a place.
    pub fn at(&self, place: Place) -> System {
        let mut system = self.system.clone();
        for (axis, value) in self.axes.iter().zip(self.values(place)) {
            system.set_number(&axis.key, value);
        }
        system
    }

    /// Above 0 beyond an edge: the growth in 1/s above the marginal one, or the damping that the device lacks, infinite where no damping
    /// suffices, or lacks for the certificate as a part of what it has; of a network at fixed times [`FixedExcess`], infinite where there is no verdict.
    ///
    /// # Errors
    /// [`Error::At`]; [`Error::Claim`] for a claim that does not apply to such a file.
    pub fn beyond(&self, edge: Edge, place: Place) -> Result<f64, Error> {
        let system = self.at(place);
        match (system.world(), edge) {
            (Some(world), Edge::Held | Edge::Free | Edge::Passive | Edge::Certified) => {
                self.beyond_world(edge, place, world)
            }
            (None, Edge::Passive) => {
                let excess = self.demands(&system).and_then(|demands| demands.excess(&system));
                Ok(excess.map_err(|error| self.failed(place, error))?.unwrap_or(f64::INFINITY))
            }
            (None, Edge::Fixed) => Ok(self.fixed(&system, place)?.map_or(f64::INFINITY, |excess| excess.value)),
            (Some(_), Edge::Fixed) | (None, Edge::Held | Edge::Free | Edge::Certified) => {
                Err(Plane::foreign(edge, &system))
            }
        }
    }

    pub(crate) fn foreign(edge: Edge, system: &System) -> Error {
        let names: Vec<&str> = Edge::of(system).iter().map(|edge| edge.name()).collect();
        Error::Claim(format!(
            "--of: {:?} is no edge of a {}; expected {}",
            edge.name(),
            system.kind(),
            names.join(", ")
        ))
    }

    fn demands(&self, network: &System) -> Result<Cow<'_, Demands>, hapt_analysis::Error> {
        match &self.demands_of_network {
            Some(NetworkDemands { demands, change }) if change.is_empty() => Ok(Cow::Borrowed(demands)),
            Some(NetworkDemands { demands, change }) => {
                demands.renewed(network, change.iter().copied()).map(Cow::Owned)
            }
            None => Demands::of(network).map(Cow::Owned),
        }
    }

    /// Of a network at fixed times, or the reasons that there is no verdict.
    fn fixed(&self, network: &System, place: Place) -> Result<Result<FixedExcess, Vec<String>>, Error> {
        let excess = self.demands(network).and_then(|demands| demands.fixed_excess(network));
        excess.map_err(|error| self.failed(place, error))
    }

    /// The reason that a claim has no verdict in the whole plane, by its corners and its middle; `None` where it has a verdict at one of them.
    pub(crate) fn undecided(&self, edge: Edge) -> Result<Option<String>, Error> {
        if edge != Edge::Fixed {
            return Ok(None);
        }
        if let Some(axis) = self.axes.iter().find(|axis| axis.key.ends_with(".period")) {
            let reason = "between most of its values the periods have no common multiple of few samples";
            return Ok(Some(format!("{}: {reason}", axis.key)));
        }
        let mut reason = None;
        for place in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]].map(Plane::inside) {
            let system = self.at(place);
            if system.world().is_some() {
                return Ok(None);
            }
            match self.fixed(&system, place)? {
                Ok(_) => return Ok(None),
                Err(reasons) => reason = reason.or(Some(reasons.join("; "))),
            }
        }
        Ok(reason)
    }

    fn beyond_world(&self, edge: Edge, place: Place, world: &World) -> Result<f64, Error> {
        // The marginal growth itself counts.
        let above = |growth: Option<f64>| match growth {
            Some(growth) if growth == MARGINAL => f64::MIN_POSITIVE,
            Some(growth) => growth - MARGINAL,
            None => f64::NEG_INFINITY,
        };
        let value = match edge {
            Edge::Held => held_world_growth(world).map(above),
            Edge::Free => free_growth(world).map(above),
            Edge::Certified => Ok(excess(world)),
            Edge::Passive | Edge::Fixed => required_damping(world)
                .map(|required| required.map_or(f64::INFINITY, |required| required - world.device.damping)),
        };
        value.map_err(|error| self.failed(place, error))
    }

    /// The frequency at which a claim fails, in Hz, at a place beyond its edge: that of the outermost eigenvalue, or of the largest required
    /// damping, of a network at fixed times. `None` where there is none.
    ///
    /// # Errors
    /// [`Error::At`].
    pub(crate) fn hz(&self, edge: Edge, place: Place) -> Result<Option<f64>, Error> {
        let system = self.at(place);
        let Some(world) = system.world() else {
            return match edge {
                Edge::Fixed => Ok(self.fixed(&system, place)?.ok().and_then(|excess| excess.hz)),
                Edge::Held | Edge::Free | Edge::Passive | Edge::Certified => Ok(None),
            };
        };
        let sampling = &world.sampling;
        let eigenvalues = match edge {
            Edge::Held => held_world_eigenvalues(world),
            Edge::Free => free_eigenvalues(world),
            // It is not determined which claim fails first.
            Edge::Certified => return Ok(None),
            Edge::Passive | Edge::Fixed => {
                return passivity(world).map(|p| p.at_hz).map_err(|error| self.failed(place, error));
            }
        };
        let eigenvalues = eigenvalues.map_err(|error| self.failed(place, error))?;
        let most = eigenvalues.iter().max_by(|a, b| a.abs.total_cmp(&b.abs));
        Ok(most.map(|e| e.im.atan2(e.re).abs() / std::f64::consts::TAU / sampling.step()))
    }

    pub(crate) fn failed(&self, place: Place, error: hapt_analysis::Error) -> Error {
        let [a, b] = self.values(place);
        let [x, y] = &self.axes;
        Error::At { at: format!("{}={a:?}, {}={b:?}", x.key, y.key), error }
    }

    pub(crate) fn keys(&self) -> Keys<'_> {
        let [x, y] = &self.axes;
        Keys { paths: [&x.key, &y.key], ranges: [[x.from, x.to], [y.from, y.to]] }
    }

    /// The place, moved inside the margin of the frame.
    pub(crate) fn inside(place: Place) -> Place {
        place.map(|x| x.clamp(INSET, 1.0 - INSET))
    }
}
