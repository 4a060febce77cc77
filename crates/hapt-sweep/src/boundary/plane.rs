//! The plane of two keys, and the claims about its worlds.

use hapt_analysis::Keys;
use hapt_analysis::MARGINAL;
use hapt_analysis::{
    free_eigenvalues, free_growth, held_world_eigenvalues, held_world_growth, passivity, required_damping,
};
use hapt_model::{Source, World};

use crate::axis::{Axis, Grid};
use crate::boundary::continuation::{INSET, Place};
use crate::error::Error;

hapt_model::named! {
    /// A claim that holds on one side of an edge and fails beyond it. Its name is that of the command line and of tables.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Edge {
        /// The world alone, with the puck held, is not unstable.
        Held => "held",
        /// The whole loop, with the puck free, is not unstable.
        Free => "free",
        /// The loop is passive against every passive hand.
        Passive => "passive",
    }
}

impl Edge {
    /// The state of a loop beyond it.
    pub const fn beyond(self) -> &'static str {
        match self {
            Edge::Held | Edge::Free => "unstable",
            Edge::Passive => "not passive",
        }
    }
}

/// Two keys of a world, each over a range.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// The axes to the right and upwards; both rise.
    pub axes: [Axis; 2],
    /// The world at the corner where both begin.
    pub world: World,
}

impl Plane {
    /// Reads two axes, each `KEY=FROM..TO[:log]`, against the world in `source` with the overrides `sets`.
    ///
    /// # Errors
    /// [`Error::Axis`] for what is no axis of this world, [`Error::World`] for a world, or a corner, that cannot be read.
    pub fn new(source: &Source, sets: &[String], axes: &[String]) -> Result<Plane, Error> {
        let (grid, world) = Grid::plane(source, sets, axes)?;
        let wrong = |i: usize, message: String| Error::Axis(format!("--vary {}: {message}", axes[i]));
        for (i, axis) in grid.axes.iter().enumerate() {
            if axis.from == axis.to {
                return Err(wrong(i, "both ends are the same: there is no plane".into()));
            }
        }
        let rising = |axis: &Axis| Axis { from: axis.from.min(axis.to), to: axis.from.max(axis.to), ..axis.clone() };
        match &grid.axes[..] {
            [x, y] => Ok(Plane { axes: [rising(x), rising(y)], world }),
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

    /// The world at a place.
    pub fn at(&self, place: Place) -> World {
        let mut world = self.world.clone();
        for (axis, value) in self.axes.iter().zip(self.values(place)) {
            world.set_number(&axis.key, value);
        }
        world
    }

    /// Above 0 beyond an edge: the growth in 1/s above the marginal one, or the damping that the device lacks, infinite where no damping
    /// suffices.
    ///
    /// # Errors
    /// [`Error::At`].
    pub fn beyond(&self, edge: Edge, place: Place) -> Result<f64, Error> {
        let world = self.at(place);
        // The marginal growth itself counts.
        let above = |growth: Option<f64>| match growth {
            Some(growth) if growth == MARGINAL => f64::MIN_POSITIVE,
            Some(growth) => growth - MARGINAL,
            None => f64::NEG_INFINITY,
        };
        let value = match edge {
            Edge::Held => held_world_growth(&world).map(above),
            Edge::Free => free_growth(&world).map(above),
            Edge::Passive => required_damping(&world)
                .map(|required| required.map_or(f64::INFINITY, |required| required - world.device.damping)),
        };
        value.map_err(|error| self.failed(place, error))
    }

    /// The frequency at which a claim fails, in Hz, at a place beyond its edge: that of the outermost eigenvalue, or of the largest required
    /// damping. `None` where there is none.
    ///
    /// # Errors
    /// [`Error::At`].
    pub(crate) fn hz(&self, edge: Edge, place: Place) -> Result<Option<f64>, Error> {
        let world = self.at(place);
        let sampling = &world.sampling;
        let eigenvalues = match edge {
            Edge::Held => held_world_eigenvalues(&world),
            Edge::Free => free_eigenvalues(&world),
            Edge::Passive => return passivity(&world).map(|p| p.at_hz).map_err(|error| self.failed(place, error)),
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
