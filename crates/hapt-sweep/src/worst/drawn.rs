//! The energy that a hand has drawn from a loop, from the ledger of a run.

use hapt_model::{Coupling, End, Law, Linear, Scenario, World};
use hapt_sim::{DelayWork, Error, Row, Simulation, world_energy};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// A run whose energy exceeds this multiple of the initial one has diverged, and ends.
pub(super) const RUNAWAY: f64 = 1e6;

/// The part of the energy exchanged that may be rounding.
pub(super) const ROUNDING: f64 = 1e-9;

/// The instant of a run at which the hand had drawn most energy beyond the supplied one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Drawn {
    /// The net energy from the puck to the hand, less `supplied`, in J. At most 0 for a passive loop.
    pub gain: f64,
    /// The energy that the world stored at the start, plus the work of its delay ([`DelayWork`]) and of its constant torques so far, in J.
    pub supplied: f64,
    /// That instant, in s.
    pub at_s: f64,
    /// The energy exchanged up to that instant, in J; the ledger's rounding is a part of it.
    pub turnover: f64,
    /// The gain at the last sample, in J.
    pub end: f64,
    /// The work of hand and motor and the device's losses up to the last sample, in J.
    pub moved: f64,
    /// The time of the last sample, in s: before the scenario's end where the loop has diverged.
    pub until_s: f64,
}

impl Drawn {
    /// Whether the gain exceeds rounding and `grain`, the energy of one count of the encoder, in J.
    pub fn is_gain(&self, grain: f64) -> bool {
        self.gain > ROUNDING * self.turnover + grain
    }

    /// The duration in s of a scenario that shows this run, begun with `length`: up to the last sample where the loop has diverged before, and
    /// one period at least, since a file has no duration of 0.
    pub(super) fn shown_s(&self, length: f64, period: f64) -> f64 {
        if self.until_s < length - period { self.until_s.max(period) } else { length }
    }
}

/// The energy supplied to a loop so far.
pub(super) struct Supply {
    /// The world without its constant torques.
    stored: World,
    /// Those whose work counts as supplied.
    constants: Vec<(End, End, f64)>,
    /// The energy that the other constant torques can supply beyond the stored one, in J.
    reserve: f64,
    first: f64,
    /// Σ torque · q at the start.
    height: f64,
    delay: DelayWork,
}

impl Supply {
    pub fn new(world: &World) -> Supply {
        let reserve = reserve(world);
        let mut stored = world.clone();
        let mut constants = Vec::new();
        // Couplings keep their indices, by which bristles are counted.
        for c in &mut stored.couplings {
            if let Some(torque) = c.law.constant() {
                c.law = Law::Constant { torque: 0.0 };
                if reserve.is_none() || !c.is_at_body() {
                    constants.push((c.first, c.second, torque));
                }
            }
        }
        Supply {
            stored,
            constants,
            reserve: reserve.unwrap_or(0.0),
            first: 0.0,
            height: 0.0,
            delay: DelayWork::new(world),
        }
    }

    fn work(&self, row: &Row) -> f64 {
        let at = |end: End| match end {
            End::Puck => row.puck,
            End::Ground => 0.0,
            End::Body(i) => row.bodies.get(i).map_or(0.0, |body| body.0),
        };
        self.constants.iter().map(|&(first, second, torque)| torque * (at(first) - at(second))).sum()
    }

    pub fn begin(&mut self, row: &Row) {
        self.first = world_energy(&self.stored, row.puck, &row.bodies, &row.bristles) + self.reserve;
        self.height = self.work(row);
    }

    pub fn until(&mut self, row: &Row) -> f64 {
        self.delay.add(row);
        // If the motor's limit clips a constant, the hand works less against it.
        let work = self.work(row) - self.height;
        let cut = self.stored.device.limit.is_some();
        self.first + self.delay.work + if cut { work.max(0.0) } else { work }
    }
}

/// The energy that constant torques at bodies can supply in a world of springs and dampers, in J: they move it to its equilibrium under
/// them. If springs leave a direction without equilibrium, the torques are a source without bound, and none of their work counts as
/// supplied: 0. `None` if the world has other couplings, or no such torque.
fn reserve(world: &World) -> Option<f64> {
    let pushes = |c: &Coupling| c.is_at_body() && c.law.constant().is_some_and(|torque| torque != 0.0);
    if !world.couplings.iter().all(|c| c.linear().is_some()) || !world.couplings.iter().any(pushes) {
        return None;
    }
    // The puck is the last coordinate.
    let n = world.bodies.len();
    let mut matrix = DMatrix::<f64>::zeros(n + 1, n + 1);
    let (mut push, mut rest) = (DVector::<f64>::zeros(n + 1), DVector::<f64>::zeros(n + 1));
    let place = |end: End| match end {
        End::Puck => Some(n),
        End::Body(i) => Some(i),
        End::Ground => None,
    };
    for c in &world.couplings {
        let Some(Linear { stiffness, torque, .. }) = c.linear() else { continue };
        let own = c.law.constant().is_some() && c.is_at_body();
        let ends = [(place(c.first), 1.0), (place(c.second), -1.0)];
        for (i, sign) in ends {
            let Some(i) = i else { continue };
            if own {
                push[i] += sign * torque
            } else {
                rest[i] += sign * torque
            }
            for (j, other) in ends {
                if let Some(j) = j {
                    matrix[(i, j)] += sign * other * stiffness;
                }
            }
        }
    }
    let Ok(step) = matrix.clone().svd(true, true).solve(&push, 1e-12 * matrix.amax().max(f64::MIN_POSITIVE)) else {
        return Some(0.0);
    };
    if (&matrix * &step - &push).amax() > 1e-9 * push.amax() {
        return Some(0.0);
    }
    // From the start to the equilibrium of the springs without the torques, and on to the equilibrium with them.
    let start: f64 = world.bodies.iter().enumerate().map(|(i, body)| push[i] * body.position).sum();
    Some((0.5 * push.dot(&step) + step.dot(&rest) - start).max(0.0))
}

/// The speed at which the supervisor removes the torque, rad/s (linear: m/s), as in the certificate: no device gives a hand energy beyond
/// that speed.
fn overspeed(world: &World) -> f64 {
    let kept = world.safety.overspeed.map(|most| world.safety.velocity.unwrap_or(0.0).max(most));
    kept.unwrap_or(f64::INFINITY)
}

/// Runs a scenario and computes at each sample the energy that its hand has drawn. `had` in J is the initial energy of the hand's spring. A
/// gain of a million times that plus the world's own ends the run, and so does a number that is not finite, and a puck that went faster than
/// `safety.overspeed` since the last sample.
///
/// # Errors
/// When the loop cannot be compiled.
pub fn drawn(world: &World, scenario: &Scenario, had: f64) -> Result<Drawn, Error> {
    let mut run = Simulation::new(world, scenario)?;
    let mut supply = Supply::new(world);
    let mut most: Option<Drawn> = None;
    let (mut end, mut until_s, mut moved) = (0.0, 0.0, 0.0);
    let (overspeed, mut last) = (overspeed(world), None);
    while let Some(row) = run.next() {
        let Ok(row) = row else { break };
        if most.is_none() {
            supply.begin(row);
        }
        let before = last.replace((row.time, row.puck));
        if before.is_some_and(|(time, puck)| (row.puck - puck).abs() > overspeed * (row.time - time)) {
            break;
        }
        let supplied = supply.until(row);
        let ledger = row.ledger;
        // Gravity and cogging of the device count as a part of the hand: their stored energy is not drawn.
        let gain = -(ledger.hand + ledger.field) - supplied;
        if !gain.is_finite() {
            break;
        }
        (end, until_s) = (gain, row.time);
        moved = ledger.hand.abs() + ledger.motor.abs() + ledger.damping + ledger.friction + ledger.stops + ledger.shaft;
        if most.is_none_or(|most| gain > most.gain) {
            let turnover = had + supplied.abs() + moved;
            most = Some(Drawn { gain, supplied, at_s: row.time, turnover, end, until_s, moved });
        }
        if gain > RUNAWAY * (had + supply.first) && gain > 0.0 {
            break;
        }
    }
    Ok(Drawn { end, until_s, moved, ..most.unwrap_or_default() })
}
