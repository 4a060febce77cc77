//! The Z-width of a device: the range of springs and dampers that it can render (Colgate and Brown, "Factors affecting the Z-width of a
//! haptic display", ICRA 1994).
//!
//! A spring K and a damper B between puck and ground replace the world of the file. Each B has two limits of K:
//!
//! * **passive** against every passive hand. The required device damping b(K, B) is convex and homogeneous of degree one, so the
//!   passive pairs form a convex set that scales with b. With the difference estimator it is b ≥ KT/2 + |B| (Colgate and Schenkel
//!   1997), and with a low-pass b ≥ KT/2 + BT/(T + 2τ).
//! * **stable** hands-off: the eigenvalues of the free loop. Without damping and delay, with the difference,
//!   KT²/J ≤ 2β(2 - β)/(2 + β), β = BT/J; for light springs K ≤ (b + B)/(T/2 + delay) (Gil et al. 2004, Hulin et al. 2006). If the
//!   loop is stable again beyond a gap, the limit is the start of the gap.
//!
//! The third limit is that of the encoder quantisation, min(2b/T, 2 f_c/Δ) (Diolaiti et al. 2006, Abbott and Okamura 2005). A real
//! hand adds inertia and damping. The passive limit holds for every hand, the stable limit for none.

use hapt_model::{Coupling, Damping, End, Law, Sampling, World};
use serde::Serialize;

use crate::error::Error;
use crate::numerics::crossing::{Ranked, Spacing, first_crossing, illinois};
use crate::passivity::quantisation::quantisation;
use crate::passivity::required::requirement;
use crate::stability::free::free_growths;

/// Upper end of a search, as a multiple of the scale that inertia, damping and period set.
const MAX_RATIO: f64 = 1e9;
/// Largest number of doublings of the stiffness in the search for the passive limit.
const DOUBLINGS: usize = 64;

/// The Z-width of a device under its loop.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ZWidth {
    /// By increasing damping, from 0 to the largest stable one.
    pub edges: Vec<Edge>,
    /// The largest passive damper without a spring, N·m·s/rad (linear: N·s/m).
    pub passive_damping: f64,
    /// The largest damper without a spring for which the free loop is not unstable, in the same unit.
    pub stable_damping: f64,
    /// The stiffness limit of the encoder quantisation, N·m/rad (linear: N/m); `None` for an ideal encoder.
    pub counts: Option<f64>,
}

/// The stiffness limits for one damper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Edge {
    /// B in N·m·s/rad (linear: N·s/m).
    pub damping: f64,
    /// The largest passive K, N·m/rad (linear: N/m); `None` where this damper is not passive with any spring.
    pub passive: Option<f64>,
    /// The largest K up to which the free loop is not unstable; `None` where it is unstable with the damper and no spring.
    pub stable: Option<f64>,
}

/// The device of `world` with a spring and a damper from the puck to ground in place of its bodies and couplings.
pub fn with_wall(world: &World, stiffness: f64, damping: f64) -> World {
    let law = [Law::Spring { stiffness, rest: 0.0 }, Law::Damper { damping: Damping::Fixed(damping) }];
    let is = [stiffness > 0.0, damping > 0.0];
    let couplings = law.into_iter().zip(is).filter(|(_, is)| *is);
    World {
        names: Vec::new(),
        bodies: Vec::new(),
        couplings: couplings
            .map(|(law, _)| Coupling { first: End::Puck, second: End::Ground, law, limit: None })
            .collect(),
        scenarios: Vec::new(),
        sampling: Sampling { bodies_every: 1, ..world.sampling.clone() },
        ..world.clone()
    }
}

/// The search of [`z_width`], one damper at a time, so that callers can distribute the work.
#[derive(Clone, Debug)]
pub struct WallSearch<'a> {
    world: &'a World,
    damping: f64,
    inertia: f64,
    period: f64,
    /// [`ZWidth::passive_damping`]
    pub passive_damping: f64,
    /// [`ZWidth::stable_damping`]
    pub stable_damping: f64,
}

impl<'a> WallSearch<'a> {
    /// For the device and the loop of `world`, without its bodies and couplings.
    ///
    /// # Errors
    /// As [`z_width`].
    pub fn new(world: &'a World) -> Result<Self, Error> {
        let (device, period) = (&world.device, world.sampling.period);
        let (inertia, damping) = (device.inertia, device.damping);
        let mut walls = WallSearch { world, damping, inertia, period, passive_damping: 0.0, stable_damping: 0.0 };
        let unit = inertia / period;
        walls.passive_damping = damping / walls.required(0.0, 1.0)?;
        let far = MAX_RATIO * (unit + damping);
        let grows = |damping: f64| walls.growths(0.0, damping);
        walls.stable_damping =
            first_crossing(grows, Spacing::Ratio, 1e-6 * unit, far, 0.0)?.ok_or(Error::Far { what: "damper" })?;
        Ok(walls)
    }

    /// About `points` dampers: half of them evenly spaced in the passive range, the others up to the largest stable one.
    pub fn dampers(&self, points: usize) -> Vec<f64> {
        let last = self.stable_damping;
        let from = if self.passive_damping > 0.0 { self.passive_damping.min(last) } else { 1e-3 * last };
        let half = (points / 2).max(2);
        let evenly = (0..=half).map(|i| from * i as f64 / half as f64);
        // Denser toward the end, where the stable limit falls.
        let part = |i: usize| (std::f64::consts::FRAC_PI_2 * i as f64 / half as f64).sin();
        let by_ratio = (1..half).map(|i| from * (last / from).powf(part(i)));
        evenly.chain(by_ratio).filter(|damping| *damping < last * (1.0 - 1e-9)).chain([last]).collect()
    }

    /// Both limits for a damper of 0 or more.
    ///
    /// # Errors
    /// As [`z_width`].
    pub fn edge(&self, damping: f64) -> Result<Edge, Error> {
        Ok(Edge { damping, passive: self.passive(damping)?, stable: self.stable(damping)? })
    }

    /// The Z-width from its edges.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn width(&self, edges: Vec<Edge>) -> Result<ZWidth, Error> {
        let counts = quantisation(self.world)?.max_stiffness;
        let (passive_damping, stable_damping) = (self.passive_damping, self.stable_damping);
        Ok(ZWidth { edges, passive_damping, stable_damping, counts })
    }

    /// The required damping of a wall; infinite where no finite damping suffices.
    fn required(&self, stiffness: f64, damping: f64) -> Result<f64, Error> {
        let wall = with_wall(self.world, stiffness, damping);
        Ok(requirement(&wall, &wall.couplings)?.damping.unwrap_or(f64::INFINITY))
    }

    /// The growths of the free loop with a wall, less the margin of the verdict, 1/s.
    fn growths(&self, stiffness: f64, damping: f64) -> Result<Ranked, Error> {
        free_growths(&with_wall(self.world, stiffness, damping))
    }

    /// The largest passive K for B, if any.
    fn passive(&self, damping: f64) -> Result<Option<f64>, Error> {
        if self.damping == 0.0 {
            return Ok((damping == 0.0).then_some(0.0));
        }
        let over = |stiffness: f64| Ok(self.required(stiffness, damping)? - self.damping);
        let at = over(0.0)?;
        if at > 1e-11 * self.damping {
            return Ok(None);
        }
        // b(K, 0) is homogeneous of degree one.
        let undamped_stiffness = self.damping / self.required(1.0, 0.0)?;
        let (mut low, mut high) = ((0.0, at), (undamped_stiffness, over(undamped_stiffness)?));
        for _ in 0..DOUBLINGS {
            if high.1 > 0.0 {
                break;
            }
            low = high;
            high = (2.0 * low.0, over(2.0 * low.0)?);
        }
        if high.1 <= 0.0 {
            return Err(Error::Far { what: "spring" });
        }
        if low.1 >= 0.0 { Ok(Some(low.0)) } else { illinois(&mut { over }, low, high, 0.0).map(Some) }
    }

    /// The largest K for B up to which the free loop is not unstable.
    fn stable(&self, damping: f64) -> Result<Option<f64>, Error> {
        if self.growths(0.0, damping)?.max() > 0.0 {
            return Ok(None);
        }
        let unit = self.inertia / (self.period * self.period);
        // An estimate of the limit by the formula for light springs.
        let light = (damping + self.damping) / (0.5 * self.period + self.world.sampling.delay_s());
        let low = 1e-2 * light.min(unit);
        if low == 0.0 {
            return Ok(Some(0.0));
        }
        let grows = |stiffness| self.growths(stiffness, damping);
        let first = grows(low)?.max();
        if first > 0.0 {
            // With the largest damper even a very soft spring is unstable.
            let least = 1e-6 * low;
            return match grows(least)?.max() {
                more if more > 0.0 => Ok(Some(0.0)),
                less => {
                    let mut top = |stiffness| Ok(grows(stiffness)?.max());
                    illinois(&mut top, (least, less), (low, first), 0.0).map(Some)
                }
            };
        }
        let far = MAX_RATIO * (unit + (damping + self.damping) / self.period);
        first_crossing(grows, Spacing::Ratio, low, far, 0.0)?.ok_or(Error::Far { what: "spring" }).map(Some)
    }
}

/// The Z-width of the device of `world` at [`WallSearch::dampers`]. FOAW counts as its longest and its shortest window, the worse of
/// the two; the true velocity counts as the difference for passivity.
///
/// Work: some fifty eigenvalue problems a point, each O(n³) in the samples in flight and in the estimator window.
///
/// # Errors
/// As [`crate::passivity()`] and [`crate::free()`].
pub fn z_width(world: &World, points: usize) -> Result<ZWidth, Error> {
    let walls = WallSearch::new(world)?;
    let edges =
        walls.dampers(points).into_iter().map(|damping| walls.edge(damping)).collect::<Result<Vec<_>, Error>>()?;
    walls.width(edges)
}
