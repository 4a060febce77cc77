//! The Z-width of a device: which springs and dampers it can stand for (Colgate and Brown, "Factors affecting the Z-width of a
//! haptic display", ICRA 1994).
//!
//! The world of the file is put away, and a spring K and a damper B stand between puck and ground. Two edges for each B:
//!
//! * **passive** against every passive hand. The damping b(K, B) that this asks of the device is convex, and of degree one, so the
//!   passive pairs are a convex set that shrinks and grows with b. With the difference it is b ≥ KT/2 + |B| (Colgate and Schenkel
//!   1997), and with a low-pass b ≥ KT/2 + BT/(T + 2τ).
//! * **stable** with nobody at the puck: the eigenvalues of the free loop. Without damping and delay, with the difference,
//!   KT²/J ≤ 2β(2 - β)/(2 + β), β = BT/J; for light springs K ≤ (b + B)/(T/2 + delay) (Gil et al. 2004, Hulin et al. 2006). Where
//!   the loop is stable again beyond a gap, the gap is the end.
//!
//! Beside them stands what an encoder's counts allow, min(2b/T, 2 f_c/Δ) (Diolaiti et al. 2006, Abbott and Okamura 2005). A hand
//! that holds adds inertia and damping; passive is for every hand, stable let go is for none.

use hapt_model::{Coupling, Damping, End, Law, World};
use serde::Serialize;

use crate::error::Error;
use crate::numerics::crossing::{Along, Heights, crossing, first_rise};
use crate::passivity::quantisation::quantisation;
use crate::passivity::required::need;
use crate::stability::free::free_heights;

/// How far beyond what a device's inertia and damping make of a sample an edge is searched. A sampled loop has one.
const FAR: f64 = 1e9;
/// How often the stiffness is doubled that a damper may be passive with.
const DOUBLINGS: usize = 64;

/// The Z-width of a device under its loop.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ZWidth {
    /// Upwards in damping, from 0 to where nothing is stable.
    pub edges: Vec<Edge>,
    /// The largest passive damper without a spring, N·m·s/rad (linear: N·s/m).
    pub passive_damping: f64,
    /// The largest damper without a spring that is not unstable let go, in the same unit.
    pub stable_damping: f64,
    /// What an encoder's counts allow, N·m/rad (linear: N/m); `None` for an ideal encoder.
    pub counts: Option<f64>,
}

/// How stiff a spring may be beside a damper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Edge {
    /// B in N·m·s/rad (linear: N·s/m).
    pub damping: f64,
    /// The largest passive K, N·m/rad (linear: N/m); `None` where this damper is not passive with any.
    pub passive: Option<f64>,
    /// The largest K up to which nothing grows when let go; `None` where the damper alone grows.
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
        ..world.clone()
    }
}

/// A device, and what is asked of it, one damper at a time: for who wants to share out the work of [`z_width`].
#[derive(Clone, Debug)]
pub struct Walls<'a> {
    world: &'a World,
    damping: f64,
    inertia: f64,
    period: f64,
    /// [`ZWidth::passive_damping`]
    pub passive_damping: f64,
    /// [`ZWidth::stable_damping`]
    pub stable_damping: f64,
}

impl<'a> Walls<'a> {
    /// Of the device and the loop of `world`, its own bodies and couplings put away.
    ///
    /// # Errors
    /// As [`z_width`].
    pub fn new(world: &'a World) -> Result<Self, Error> {
        let (device, period) = (&world.device, world.sampling.period);
        let (inertia, damping) = (device.inertia, device.damping);
        let mut walls = Walls { world, damping, inertia, period, passive_damping: 0.0, stable_damping: 0.0 };
        let unit = inertia / period;
        walls.passive_damping = damping / walls.asks(0.0, 1.0)?;
        let far = FAR * (unit + damping);
        let grows = |damping: f64| walls.grows(0.0, damping);
        walls.stable_damping =
            first_rise(grows, Along::Ratio, 1e-6 * unit, far, 0.0)?.ok_or(Error::Far { what: "damper" })?;
        Ok(walls)
    }

    /// About `points` dampers: half of them evenly where some are passive, the others up to where nothing is stable.
    pub fn dampers(&self, points: usize) -> Vec<f64> {
        let last = self.stable_damping;
        let from = if self.passive_damping > 0.0 { self.passive_damping.min(last) } else { 1e-3 * last };
        let half = (points / 2).max(2);
        let evenly = (0..=half).map(|i| from * i as f64 / half as f64);
        // Closer toward the end, where the edge of what is stable falls.
        let part = |i: usize| (std::f64::consts::FRAC_PI_2 * i as f64 / half as f64).sin();
        let by_ratio = (1..half).map(|i| from * (last / from).powf(part(i)));
        evenly.chain(by_ratio).filter(|damping| *damping < last * (1.0 - 1e-9)).chain([last]).collect()
    }

    /// Both edges beside a damper, 0 or more.
    ///
    /// # Errors
    /// As [`z_width`].
    pub fn edge(&self, damping: f64) -> Result<Edge, Error> {
        Ok(Edge { damping, passive: self.passive(damping)?, stable: self.stable(damping)? })
    }

    /// The whole, from its edges.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn width(&self, edges: Vec<Edge>) -> Result<ZWidth, Error> {
        let counts = quantisation(self.world)?.max_stiffness;
        let (passive_damping, stable_damping) = (self.passive_damping, self.stable_damping);
        Ok(ZWidth { edges, passive_damping, stable_damping, counts })
    }

    /// The damping that a wall asks for; infinite where none will do.
    fn asks(&self, stiffness: f64, damping: f64) -> Result<f64, Error> {
        let wall = with_wall(self.world, stiffness, damping);
        Ok(need(&wall, &wall.couplings)?.damping.unwrap_or(f64::INFINITY))
    }

    /// How fast a wall grows let go, less what a verdict lets pass, 1/s.
    fn grows(&self, stiffness: f64, damping: f64) -> Result<Heights, Error> {
        free_heights(&with_wall(self.world, stiffness, damping))
    }

    /// The largest passive K beside B, where there is one.
    fn passive(&self, damping: f64) -> Result<Option<f64>, Error> {
        if self.damping == 0.0 {
            return Ok((damping == 0.0).then_some(0.0));
        }
        let over = |stiffness: f64| Ok(self.asks(stiffness, damping)? - self.damping);
        let at = over(0.0)?;
        if at > 1e-11 * self.damping {
            return Ok(None);
        }
        // By the degree one of b(K, 0).
        let alone = self.damping / self.asks(1.0, 0.0)?;
        let (mut low, mut high) = ((0.0, at), (alone, over(alone)?));
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
        if low.1 >= 0.0 { Ok(Some(low.0)) } else { crossing(&mut { over }, low, high, 0.0).map(Some) }
    }

    /// The largest K beside B up to which nothing grows.
    fn stable(&self, damping: f64) -> Result<Option<f64>, Error> {
        if self.grows(0.0, damping)?.top() > 0.0 {
            return Ok(None);
        }
        let unit = self.inertia / (self.period * self.period);
        // Where the first spring begins to grow, by the law for light ones.
        let light = (damping + self.damping) / (0.5 * self.period + self.world.sampling.delay_s());
        let low = 1e-2 * light.min(unit);
        if low == 0.0 {
            return Ok(Some(0.0));
        }
        let grows = |stiffness| self.grows(stiffness, damping);
        let first = grows(low)?.top();
        if first > 0.0 {
            // Beside the largest damper the least of springs is too much.
            let least = 1e-6 * low;
            return match grows(least)?.top() {
                more if more > 0.0 => Ok(Some(0.0)),
                less => {
                    let mut top = |stiffness| Ok(grows(stiffness)?.top());
                    crossing(&mut top, (least, less), (low, first), 0.0).map(Some)
                }
            };
        }
        let far = FAR * (unit + (damping + self.damping) / self.period);
        first_rise(grows, Along::Ratio, low, far, 0.0)?.ok_or(Error::Far { what: "spring" }).map(Some)
    }
}

/// The Z-width of the device of `world` at [`Walls::dampers`]. FOAW counts as its longest and its shortest window, the worse of
/// the two; the true velocity counts as the difference for passivity.
///
/// Work: some fifty eigenvalue problems a point, each a cube of the samples that are in flight or in the estimator's window.
///
/// # Errors
/// As [`crate::passivity()`] and [`crate::free()`].
pub fn z_width(world: &World, points: usize) -> Result<ZWidth, Error> {
    let walls = Walls::new(world)?;
    let edges =
        walls.dampers(points).into_iter().map(|damping| walls.edge(damping)).collect::<Result<Vec<_>, Error>>()?;
    walls.width(edges)
}
