//! What a hand has had from a loop, by the ledger of a run.

use hapt_model::{Coupling, End, Law, Linear, Scenario, World};
use hapt_sim::{Error, Lent, Row, Simulation, world_energy};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Beyond so many times what a run began with, it has run away, and no more of it is needed.
const RUNAWAY: f64 = 1e6;

/// A part of all energy that goes to and fro which may be rounding.
const ROUNDING: f64 = 1e-9;

/// Where, in a run, the hand had drawn most beyond what the loop was given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Drawn {
    /// What the hand had from the puck, less what it gave, and less `supplied`: J. Not above 0 on a passive loop.
    pub gain: f64,
    /// What the world stored at the start, what its delay has lent ([`Lent`]), and what its constant torques did until then: J.
    pub supplied: f64,
    /// When that was, s.
    pub at_s: f64,
    /// All energy that went to and fro until then, J: of it the ledger's rounding is a part.
    pub turnover: f64,
    /// The gain at the last instant looked at, J.
    pub end: f64,
    /// What hand and motor have moved until then and the device has taken, J.
    pub moved: f64,
    /// That instant, s: before the scenario's end where the loop has run away.
    pub until_s: f64,
}

impl Drawn {
    /// Whether the gain is more than rounding, and than `grain`, J: what a count of the encoder is worth.
    pub fn is_gain(&self, grain: f64) -> bool {
        self.gain > ROUNDING * self.turnover + grain
    }
}

/// The energy that a loop had to give until now.
struct Supply {
    /// The world without its constant torques.
    stored: World,
    /// Those whose work counts as given.
    constants: Vec<(End, End, f64)>,
    /// What the others have to give beyond what is stored, J.
    reserve: f64,
    first: f64,
    /// Σ torque · q at the start.
    height: f64,
    lent: Lent,
}

impl Supply {
    fn new(world: &World) -> Supply {
        let reserve = reserve(world);
        let mut stored = world.clone();
        let mut constants = Vec::new();
        // What the ledger of bristles counts by stays in its place.
        for c in &mut stored.couplings {
            if let Some(torque) = c.law.constant() {
                c.law = Law::Constant { torque: 0.0 };
                if reserve.is_none() || !c.is_at_body() {
                    constants.push((c.first, c.second, torque));
                }
            }
        }
        Supply { stored, constants, reserve: reserve.unwrap_or(0.0), first: 0.0, height: 0.0, lent: Lent::new(world) }
    }

    fn work(&self, row: &Row) -> f64 {
        let at = |end: End| match end {
            End::Puck => row.puck,
            End::Ground => 0.0,
            End::Body(i) => row.bodies.get(i).map_or(0.0, |body| body.0),
        };
        self.constants.iter().map(|&(first, second, torque)| torque * (at(first) - at(second))).sum()
    }

    fn begin(&mut self, row: &Row) {
        self.first = world_energy(&self.stored, row.puck, &row.bodies, &row.bristles) + self.reserve;
        self.height = self.work(row);
    }

    fn until(&mut self, row: &Row) -> f64 {
        self.lent.add(row);
        // Against a constant that the motor's limit cuts the hand has less to give.
        let work = self.work(row) - self.height;
        let cut = self.stored.device.limit.is_some();
        self.first + self.lent.work + if cut { work.max(0.0) } else { work }
    }
}

/// What constant torques at bodies give in all, in a world of springs and dampers beside: they move it to where it rests with them, and
/// no further, unless springs leave a way along which they push for ever. That is a source, and nothing of what it does is given: 0.
/// `None` where the world is not of that kind, or has no such torque.
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
    let Ok(way) = matrix.clone().svd(true, true).solve(&push, 1e-12 * matrix.amax().max(f64::MIN_POSITIVE)) else {
        return Some(0.0);
    };
    if (&matrix * &way - &push).amax() > 1e-9 * push.amax() {
        return Some(0.0);
    }
    // From the start to where springs alone would rest, and on to where they rest with the push.
    let start: f64 = world.bodies.iter().enumerate().map(|(i, body)| push[i] * body.position).sum();
    Some((0.5 * push.dot(&way) + way.dot(&rest) - start).max(0.0))
}

/// Runs a scenario and looks at each sample how much its hand has drawn. `had` in J is what the hand's spring holds at first: a
/// gain of a million times that and the world's own ends the run. So does a number that is not finite.
///
/// # Errors
/// When the loop cannot be compiled.
pub fn drawn(world: &World, scenario: &Scenario, had: f64) -> Result<Drawn, Error> {
    let mut run = Simulation::new(world, scenario)?;
    let mut supply = Supply::new(world);
    let mut most: Option<Drawn> = None;
    let (mut end, mut until_s, mut moved) = (0.0, 0.0, 0.0);
    while let Some(row) = run.next() {
        let Ok(row) = row else { break };
        if most.is_none() {
            supply.begin(row);
        }
        let supplied = supply.until(row);
        let ledger = row.ledger;
        let gain = -ledger.hand - supplied;
        if !gain.is_finite() {
            break;
        }
        (end, until_s) = (gain, row.time);
        moved = ledger.hand.abs() + ledger.motor.abs() + ledger.damping + ledger.friction;
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
