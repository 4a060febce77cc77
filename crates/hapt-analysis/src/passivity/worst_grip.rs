//! The passive hand that makes the loop grow most: a mass, a spring and a damper on the puck.
//!
//! Where the loop is not passive at some frequency, there is a passive hand that swings there and draws energy (Colgate and Schenkel,
//! J. Robotic Systems 14(1), 1997). The simplest is a mass on a spring. With it on the puck the loop is one linear map again, and
//! whether its eigenvalues grow is exact: no simulation.
//!
//! A heavy hand that swings at ω tells how near the family comes to the certificate. It moves the puck along a sine, so that
//! only the fundamental of the held torque works, and at no delay it grows where the device's damping is below
//!
//! ```text
//! (sin(ωT/2)/(ωT/2))² m(ω),    m the certificate's curve, all of which the device must pay
//! ```
//!
//! A virtual spring asks for the same at every frequency, so a heavy slow hand breaks it nearly up to the certificate. What asks
//! most at Nyquist falls to a hand that swings there exactly, from one sample's peak to the next's. Its sine costs the device
//! b A² π²/2T a sample where straight lines would cost 4 b A²/T: it gets 8/π² of the certificate, and no hand of one mode was seen
//! to get more. The hand's damper is damping on the device by another name, so the search leaves it out.

use std::f64::consts::{PI, TAU};

use hapt_model::World;
use serde::Serialize;

use crate::equations::continuous::Slopes;
use crate::equations::estimator::Filter;
use crate::equations::grip::Grip;
use crate::equations::port::Port;
use crate::equations::slopes::at_puck;
use crate::equations::structure::{Part, inertias_with_puck, parts, with_puck};
use crate::error::{Error, positive};
use crate::numerics::nelder_mead::climb;
use crate::passivity::required::{Cause, need};
use crate::stability::MARGINAL;
use crate::stability::free::{counting, multipliers};

/// The hand found, and what the loop does with it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Worst {
    /// The hand.
    pub grip: Grip,
    /// Of the loop with the hand on the puck, in 1/s.
    pub growth_per_s: f64,
}

/// Masses that are tried, over the device's inertia. Heavy hands come nearest to the certificate and grow slowest.
const MASSES: [f64; 7] = [0.0, 0.5, 2.0, 10.0, 60.0, 500.0, 5000.0];
/// The heaviest that a search may end at.
const HEAVIEST: f64 = 2e4;
/// A hand's spring is no softer than this, over the springs at the puck: it is by its spring that a hand gives the first kick.
const SOFTEST: f64 = 0.01;
/// How many frequencies are tried, from [`SLOWEST`] to beyond Nyquist, ωT.
const FREQUENCIES: usize = 16;
const SLOWEST: f64 = 2e-3;
const FASTEST: f64 = 1.5 * PI;
/// Beside the frequency at which the certificate asks for most.
const BESIDE: [f64; 9] = [0.9, 0.97, 0.99, 0.999, 1.0, 1.001, 1.01, 1.03, 1.1];
/// How far up a breaking damping is searched where nothing bounds it.
pub const FAR: f64 = 1e6;
/// How often a breaking damping is looked for again, and how close above the last.
const ROUNDS: usize = 8;
const CLOSE: f64 = 1e-4;
/// The most looks of one climb.
const LOOKS: usize = 50;

/// A world whose hands change: its ports, with all nonlinear couplings steep and with all flat.
struct Grips {
    world: World,
    ports: Vec<Port>,
    filters: Vec<Filter>,
    /// All springs at the puck.
    stiffness: f64,
}

/// How near a hand comes to making the loop grow.
#[derive(Clone, Copy, Debug)]
struct Look {
    grip: Grip,
    growth: f64,
    /// How much device damping the growth would make up for, N·m·s/rad: below 0 for a hand that decays.
    excess: f64,
}

impl Look {
    /// Whatever grows stands above whatever decays.
    fn height(&self) -> f64 {
        if self.growth >= MARGINAL { 1.0 + self.growth.ln_1p() } else { self.excess.min(0.0) }
    }
}

impl Grips {
    fn new(world: &World) -> Result<Grips, Error> {
        let inertia = inertias_with_puck(world)?;
        positive("the period", world.sampling.period)?;
        let mut known: Vec<Part> = Vec::new();
        for slopes in [Slopes::Steep, Slopes::Flat] {
            let parts = parts(&inertia, &with_puck(&world.bodies, &world.couplings, &slopes)?);
            if let Some(part) = parts.into_iter().next().filter(|part| !known.contains(part)) {
                known.push(part);
            }
        }
        let ports: Vec<Port> = known.iter().map(Port::new).collect::<Result<_, _>>()?;
        // What pulls at nothing draws nothing.
        let ports = ports.into_iter().filter(|port| !port.is_slack()).collect();
        let [stiffness, _] = at_puck(world, &world.couplings)?;
        Ok(Grips {
            world: world.clone(),
            filters: Filter::of(&world.sampling, world.sampling.period),
            ports,
            stiffness,
        })
    }

    /// The growth in 1/s of what the puck feels. A shift or an even motion that nothing drives neither grows nor decays, and is left
    /// out: beside it nothing that decays would show.
    fn growth(&self, device: f64, grip: &Grip) -> Result<f64, Error> {
        let sampling = &self.world.sampling;
        let period = sampling.period;
        let mut most = f64::NEG_INFINITY;
        for port in &self.ports {
            let port = port.clone().gripped(grip.inertia, grip.stiffness);
            for filter in &self.filters {
                let found = multipliers(&port, sampling, device + grip.damping, filter, period)?;
                let found = counting(found.into_iter().map(|(m, _)| m).collect(), port.shifts, period, MARGINAL);
                let moves = |g: f64, arg: f64| g >= MARGINAL || arg.abs() > 1e-7;
                let growths = found.iter().map(|m| (m.growth(period), m.arg())).filter(|&(g, arg)| moves(g, arg));
                most = growths.map(|(g, _)| g).fold(most, f64::max);
                if !port.has_damper() {
                    break;
                }
            }
        }
        Ok(most)
    }

    fn look(&self, grip: Grip) -> Look {
        let device = &self.world.device;
        let growth = self.growth(device.damping, &grip).unwrap_or(f64::NEG_INFINITY);
        let excess = if growth >= MARGINAL || growth == f64::NEG_INFINITY {
            growth
        } else {
            // By one step of Newton's: how a little more damping changes it.
            let step = 1e-3 * (device.damping + 1e-3 * device.inertia / self.world.sampling.period);
            let more = self.growth(device.damping + step, &grip).unwrap_or(growth);
            growth * step / ((growth - more).abs() + 1e-12)
        };
        Look { grip, growth, excess }
    }

    /// A hand of `mass` over the device's inertia that would swing at ωT alone, or a little faster.
    fn hand(&self, mass: f64, angle: f64) -> Grip {
        let inertia = self.world.device.inertia;
        let omega = angle / self.world.sampling.period;
        let swings = (1.0 + mass) * inertia * omega * omega;
        Grip { inertia: mass * inertia, damping: 0.0, stiffness: swings.max(SOFTEST * self.stiffness) }
    }

    /// The frequencies to try, as ωT.
    fn angles(&self) -> Result<Vec<f64>, Error> {
        let ratio = FASTEST / SLOWEST;
        let mut angles: Vec<f64> =
            (0..FREQUENCIES).map(|i| SLOWEST * ratio.powf(i as f64 / (FREQUENCIES - 1) as f64)).collect();
        let need = need(&self.world, &self.world.couplings)?;
        let hz = match need.damping {
            Err(Cause::Grows { hz }) => Some(hz),
            _ => need.at_hz,
        };
        if let Some(hz) = hz.filter(|hz| *hz > 0.0) {
            angles.extend(BESIDE.map(|beside| beside * hz * TAU * self.world.sampling.period));
        }
        Ok(angles)
    }

    /// Up from a hand, over mass and frequency.
    fn climb(&self, from: &Grip) -> Look {
        let inertia = self.world.device.inertia;
        let total = inertia + from.inertia;
        let rate = (from.stiffness / total).sqrt() * self.world.sampling.period;
        // A hand without a mass begins with a little of it.
        let start = [(from.inertia / inertia).max(1e-2).ln(), rate.max(0.1 * SLOWEST).ln()];
        let mut best = self.look(*from);
        climb(start, [0.6, 0.25], LOOKS, |&[mass, angle]| {
            let look = self.look(self.hand(mass.exp().clamp(1e-3, HEAVIEST), angle.exp().min(TAU)));
            if look.height() > best.height() {
                best = look;
            }
            look.height()
        });
        best
    }

    /// The hand that comes nearest to growth, or grows most.
    fn worst(&self) -> Result<Option<Look>, Error> {
        if self.ports.is_empty() {
            return Ok(None);
        }
        let mut all: Vec<Look> = Vec::new();
        for angle in self.angles()? {
            all.extend(MASSES.map(|mass| self.look(self.hand(mass, angle))));
        }
        all.sort_by(|a, b| b.height().total_cmp(&a.height()));
        // The best, and the best at another frequency.
        let angle = |look: &Look| look.grip.stiffness / (self.world.device.inertia + look.grip.inertia);
        let Some(first) = all.first().copied() else { return Ok(None) };
        let apart = |look: &&Look| !(0.5..2.0).contains(&(angle(look) / angle(&first)));
        let starts = [Some(first), all.iter().find(apart).copied()];
        let best = starts.iter().flatten().map(|look| self.climb(&look.grip)).chain([first]);
        Ok(best.max_by(|a, b| a.height().total_cmp(&b.height())))
    }
}

/// The passive hand of mass and spring that makes the loop grow most; `None` when none that was tried makes it grow by
/// [`MARGINAL`] or more.
///
/// What grows by itself grows in any hand. Nonlinear couplings count all by their steepest rise or all flat; limit, levels,
/// encoder and Coulomb friction are left out.
/// Masses up to 2e4 times the device's inertia, frequencies up to twice Nyquist: a grid, and a climb from its best. Deterministic.
///
/// Work: some 300 eigenvalue problems of the puck's own modes, memory and commands in flight.
///
/// # Errors
/// As [`crate::passivity()`].
pub fn worst_grip(world: &World) -> Result<Option<Worst>, Error> {
    let worst = Grips::new(world)?.worst()?;
    Ok(worst.filter(|w| w.growth >= MARGINAL).map(|w| Worst { grip: w.grip, growth_per_s: w.growth }))
}

/// A hand, and the device damping up to which it makes the loop grow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Breaking {
    /// The hand.
    pub grip: Grip,
    /// N·m·s/rad (linear: N·s/m).
    pub damping: f64,
}

/// The largest device damping at which a hand of [`worst_grip`]'s family still makes the loop grow, as far as the search sees; `None`
/// where none does at any. Where the certificate knows no finite damping, the search ends at [`FAR`] times the device's.
///
/// A hand that grows has a damping at which it does no more. There the worst hand is looked for again, until none is worse.
///
/// Work: some five of [`worst_grip`].
///
/// # Errors
/// As [`worst_grip`].
pub fn breaking_damping(world: &World) -> Result<Option<Breaking>, Error> {
    let mut grips = Grips::new(world)?;
    let mut at = |damping: f64| -> Result<Option<Grip>, Error> {
        grips.world.device.damping = damping;
        Ok(grips.worst()?.filter(|w| w.growth >= MARGINAL).map(|w| w.grip))
    };
    let own = world.device.damping;
    let scale = own.max(1e-6 * world.device.inertia / world.sampling.period);
    let most = need(world, &world.couplings)?.damping.unwrap_or(FAR * scale).max(own);
    // Where the device's own damping is too much, from none on.
    let (mut damping, mut found) = (own, at(own)?);
    if found.is_none() {
        (damping, found) = (0.0, at(0.0)?);
    }
    let mut breaking = None;
    for _ in 0..ROUNDS {
        let Some(grip) = found else { break };
        damping = last_growth(world, &grip, damping, most)?;
        breaking = Some(Breaking { grip, damping });
        if damping >= most {
            break;
        }
        damping = (damping * (1.0 + CLOSE)).max(1e-9 * scale);
        found = at(damping)?;
    }
    Ok(breaking)
}

/// The largest damping from `low`, where the hand makes the loop grow, up to `high`, at which it still does.
fn last_growth(world: &World, grip: &Grip, mut low: f64, mut high: f64) -> Result<f64, Error> {
    let grips = Grips::new(world)?;
    let grows = |damping: f64| Ok::<bool, Error>(grips.growth(damping, grip)? >= MARGINAL);
    if grows(high)? {
        return Ok(high);
    }
    while high - low > 0.1 * CLOSE * high {
        // By ratios where they are far apart; toward 0 no further than a billionth.
        let middle = match low {
            _ if low > 0.0 && high > 4.0 * low => (low * high).sqrt(),
            _ => 0.5 * (low + high),
        };
        if grows(middle)? {
            low = middle
        } else {
            high = middle
        }
        if high < 1e-12 * world.device.inertia / world.sampling.period {
            break;
        }
    }
    Ok(low)
}
