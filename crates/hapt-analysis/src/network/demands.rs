//! What the worlds of a network's stations require without their links. A study of links computes it once.

use hapt_model::System;

use super::burden::Burden;
use super::fixed;
use crate::certificate::check::Check;
use crate::error::Error;
use crate::passivity::supremum::Wanted;
use crate::passivity::timing::Timing;
use crate::theorems::claim::{Claim, least};

/// The device dampings that the world of each station requires without links, in N·m·s/rad (linear: N·s/m); `None` where no finite damping
/// suffices, or no theorem covers the world.
///
/// ```
/// use hapt_analysis::Demands;
/// use hapt_model::{System, Source};
///
/// let mut source = Source::from_text("pair.toml", r#"
/// stations.left.world = "wheel.toml"
/// stations.right.world = "wheel.toml"
/// links = [{ kind = "spring", between = ["left", "right"], stiffness = 0.2, age_max = "20 ms" }]
/// "#);
/// source.files.insert("wheel.toml".into(), "loop.period = '1 ms'\ndevice = { inertia = 1e-3, damping = 0.005 }".into());
/// let mut network = System::read(&source, &[])?;
/// let demands = Demands::of(&network)?;
/// // (T53): K (T/2 + age_max) of 0.0041, and the devices have 0.005.
/// assert!((demands.excess(&network)?.unwrap() - (0.2 * 20.5e-3 - 0.005)).abs() < 1e-9);
/// // The links do not change them.
/// network.set_number("links.0.stiffness", 0.3);
/// assert!(demands.excess(&network)?.unwrap() > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Demands {
    /// For the times and tolerances that each world states.
    pub(super) uneven: Vec<Option<f64>>,
    /// For even samples and the nominal device.
    pub(super) even: Vec<Option<f64>>,
}

/// How far a network is beyond its edge at fixed times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedExcess {
    /// Above 0 where some hands draw energy: 1/s - 1, the links being passive up to `s` times as stiff.
    pub value: f64,
    /// A frequency at which they do, Hz.
    pub hz: Option<f64>,
}

impl Demands {
    /// Of all stations.
    ///
    /// # Errors
    /// As [`crate::uneven_damping`].
    pub fn of(network: &System) -> Result<Demands, Error> {
        let none = vec![None; network.stations.len()];
        let demands = Demands { uneven: none.clone(), even: none };
        demands.renewed(network, 0..network.stations.len())
    }

    /// The same, with these stations of a network computed anew.
    ///
    /// # Errors
    /// As [`crate::uneven_damping`].
    pub fn renewed(&self, network: &System, stations: impl IntoIterator<Item = usize>) -> Result<Demands, Error> {
        let mut demands = self.clone();
        for at in stations {
            let world = &network.stations[at].world;
            demands.uneven[at] = Claim::of(&least(world), Timing::of(world), Wanted::Least)?.proved_damping();
            demands.even[at] = Claim::of(world, Timing::even(world), Wanted::Least)?.proved_damping();
        }
        Ok(demands)
    }

    /// Those of checks.
    pub(super) fn found(locals: &[Check]) -> Demands {
        Demands {
            uneven: locals.iter().map(|local| local.uneven.proved_damping()).collect(),
            even: locals.iter().map(|local| local.passivity.proved_damping()).collect(),
        }
    }

    /// By how much the devices' dampings are too small together for any clocks, in their unit: no more than 0 where the network is
    /// passive. `None` where no finite damping is known to suffice.
    ///
    /// # Errors
    /// As [`crate::uneven_damping`].
    pub fn excess(&self, network: &System) -> Result<Option<f64>, Error> {
        Ok(Burden::of(network, &self.uneven)?.excess())
    }

    /// How much each puck moves, in the proportions that require the most of the devices; `None` where no finite damping is known to
    /// suffice.
    ///
    /// # Errors
    /// As [`crate::uneven_damping`].
    pub fn favoured(&self, network: &System) -> Result<Option<Vec<f64>>, Error> {
        Ok(Burden::of(network, &self.uneven)?.favoured())
    }

    /// How far the network is beyond its edge at its own periods, phases and delays, or why there is no verdict at fixed times.
    ///
    /// # Errors
    /// As [`crate::uneven_damping`].
    pub fn fixed_excess(&self, network: &System) -> Result<Result<FixedExcess, Vec<String>>, Error> {
        let damping: Vec<f64> =
            network.stations.iter().map(|station| station.world.device.damping_range()[0]).collect();
        fixed::excess(network, &self.even, &damping)
    }
}
