//! A run: the loop on the exact device, sample after sample.

use std::collections::VecDeque;

use hapt_core::Number;
use hapt_model::{Scenario, World};

use crate::control::Control;
use crate::hand::Hand;
use crate::puck::{Inertia, Puck, Push};
use crate::row::Row;

/// Why a run cannot start or go on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The world cannot be compiled.
    #[error("{0}")]
    Loop(#[from] hapt_core::Error),
    /// A number has left the range of numbers; the rows before it are good.
    #[error("the run stops being finite at t = {time} s: the loop has run away")]
    NotFinite {
        /// t_k of the first row that is not finite, in s.
        time: f64,
    },
}

/// A scenario of a world, run sample by sample: a stream of [`Row`]s that takes the same memory however long it is.
///
/// Between the samples the puck is integrated exactly (no step error): inertia, viscous damping, Coulomb friction with
/// located stops and starts, the motor's held torque through any delay, and the hand.
#[derive(Clone, Debug)]
pub struct Simulation {
    control: Control,
    period: f64,
    hand: Hand,
    /// Whether the hand is still there.
    held: bool,
    /// When it does something next, in s; infinite when never.
    next_event: f64,
    puck: Puck,
    device: Inertia,
    friction: f64,
    motor: Motor<f64>,
    sample: u64,
    rows: u64,
    row: Row,
}

/// The motor holds a command from t_k + delay on.
#[derive(Clone, Debug)]
pub(crate) struct Motor<F> {
    /// Whole samples of the delay, and the rest in s.
    pub samples: usize,
    pub rest: f64,
    /// Commands on their way.
    flying: VecDeque<F>,
    pub applied: F,
}

impl<F: Number> Motor<F> {
    pub fn new(delay: f64, period: f64) -> Self {
        let ratio = delay / period;
        let whole = ratio.round();
        // Within 1e-6 T of a whole sample it is that sample.
        let (samples, rest) = if (ratio - whole).abs() <= 1e-6 {
            (whole, 0.0)
        } else {
            (ratio.floor(), (ratio - ratio.floor()) * period)
        };
        Motor { samples: samples as usize, rest, flying: VecDeque::new(), applied: F::ZERO }
    }

    /// The instant at which a command arrives.
    fn change(&mut self) {
        if self.flying.len() > self.samples
            && let Some(command) = self.flying.pop_front()
        {
            self.applied = command;
        }
    }

    pub fn command(&mut self, command: F) {
        if self.samples == 0 && self.rest == 0.0 {
            self.applied = command;
            return;
        }
        self.flying.push_back(command);
        if self.rest == 0.0 {
            self.change();
        }
    }
}

impl Simulation {
    /// A run of `scenario` in `world`. Errors when the loop cannot be compiled.
    pub fn new(world: &World, scenario: &Scenario) -> Result<Self, Error> {
        let control = Control::new(&world.spec())?;
        let period = world.sampling.period;
        let hand = Hand::new(&scenario.hand, period);
        let motor = Motor::new(world.sampling.delay, period);
        let device = Inertia { inertia: world.device.inertia, damping: world.device.damping, stiffness: 0.0 };
        let lengths = if motor.rest > 0.0 { vec![motor.rest, period - motor.rest] } else { vec![period] };
        let mut puck = Puck::new(device, hand.grip(), world.device.friction, hand.sine(), &lengths);
        if hand.switches() {
            puck = puck.that_switches();
        }
        if let Some(piece) = hand.prescribed() {
            (puck.position, puck.velocity) = piece.at(0.0);
        }
        Ok(Simulation {
            control,
            period,
            hand,
            held: true,
            next_event: f64::INFINITY,
            puck,
            device,
            friction: world.device.friction,
            motor,
            sample: 0,
            rows: rows(scenario.duration, period),
            row: Row {
                bodies: vec![(0.0, 0.0); world.bodies.len()],
                bristles: vec![0.0; world.couplings.len()],
                ..Row::default()
            },
        })
    }

    /// How many rows the whole run has: round(duration/T) + 1.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// The hand's last event in s, if the puck stands still, held, from then on.
    pub fn still_from(&self) -> Option<f64> {
        self.hand.holds_still().then(|| self.hand.last_event())
    }

    /// The hand's last event in s: the latest of a step, a ramp's end, a path's last point and the release; 0 for a sine.
    pub fn last_event(&self) -> f64 {
        self.hand.last_event()
    }

    /// Whether the hand still prescribes the puck's position at `t`, in s.
    pub fn is_held_at(&self, t: f64) -> bool {
        self.hand.prescribed().is_some() && !self.hand.is_gone(t)
    }

    /// The next row; `None` after the last. An error ends the run.
    #[allow(clippy::should_implement_trait)] // The row is lent, not given: an iterator would allocate for each.
    pub fn next(&mut self) -> Option<Result<&Row, Error>> {
        if self.sample >= self.rows {
            return None;
        }
        let time = self.sample as f64 * self.period;
        if self.sample == 0 {
            self.hand_acts(time);
        } else {
            self.travel(self.row.time, time);
        }
        let row = &mut self.row;
        let Puck { position, velocity, .. } = self.puck;
        let sample = self.control.step(position, velocity, &mut row.bodies, &mut row.bristles);
        self.motor.command(sample.command);
        row.time = time;
        (row.puck, row.puck_velocity) = (position, velocity);
        (row.measured, row.measured_velocity) = (sample.puck.position, sample.puck.velocity);
        (row.torque, row.command, row.applied) = (sample.torque, sample.command, self.motor.applied);
        self.sample += 1;
        if !self.row.is_finite() {
            self.rows = 0;
            return Some(Err(Error::NotFinite { time }));
        }
        Some(Ok(&self.row))
    }

    /// From one sample to the next.
    #[inline]
    fn travel(&mut self, from: f64, to: f64) {
        if self.motor.rest == 0.0 && self.next_event > to {
            self.stretch(from, to, self.period);
        } else {
            self.travel_by_events(from, to);
        }
    }

    /// The same from event to event: the hand's, and the motor's change within the period.
    fn travel_by_events(&mut self, from: f64, to: f64) {
        let mut now = from;
        // Seconds since `from`: these, and not the difference of absolute times, are the lengths that come again.
        let mut elapsed = 0.0;
        let mut change_at = (self.motor.rest > 0.0).then_some(self.motor.rest);
        loop {
            let event_at = (self.next_event < to).then(|| (self.next_event - from).max(elapsed));
            let end = [change_at, event_at].into_iter().flatten().fold(self.period, f64::min);
            let change_now = change_at.is_some_and(|at| at <= end);
            let event_now = event_at.is_some_and(|at| at <= end);
            let next = match (event_now, change_now) {
                (true, _) => self.next_event,
                (false, true) => from + end,
                (false, false) => to,
            };
            self.stretch(now, next, end - elapsed);
            (now, elapsed) = (next, end);
            if event_now {
                self.hand_acts(now);
            }
            if change_now {
                self.motor.change();
                change_at = None;
            }
            if !(event_now || change_now) {
                break;
            }
        }
        if self.next_event <= to {
            self.hand_acts(to);
        }
    }

    /// A stretch of `length` seconds without an event.
    #[inline]
    fn stretch(&mut self, from: f64, to: f64, length: f64) {
        let push = match self.hand.prescribed() {
            _ if !self.held => Push::default(),
            None => self.hand.push(from),
            // It is there already.
            Some(piece) if piece.is_flat() => return,
            Some(piece) => {
                let (square, path) = piece.travel(from, to);
                self.prescribe(piece.at(to), self.device.damping * square, self.friction * path);
                return;
            }
        };
        self.puck.advance(length, self.motor.applied, push, &mut self.row.ledger);
    }

    /// What the hand does at an instant: let go, or jump. A jump comes before a sample or a motor's change at the same instant,
    /// and its work is done against the torque held before it.
    fn hand_acts(&mut self, t: f64) {
        if self.hand.is_gone(t) {
            self.held = false;
            self.next_event = f64::INFINITY;
            self.puck.release();
            return;
        }
        let (next, switched) = self.hand.act(t, self.puck.position);
        self.next_event = next.unwrap_or(f64::INFINITY);
        if switched {
            self.puck.switch();
        }
        if let Some(piece) = self.hand.prescribed() {
            self.prescribe(piece.at(t), 0.0, 0.0);
        }
    }

    /// The puck is where the hand wants it; the hand's work is whatever the others leave over.
    fn prescribe(&mut self, (position, velocity): (f64, f64), damping: f64, friction: f64) {
        let motor = self.motor.applied * (position - self.puck.position);
        let before = self.puck.velocity;
        let moving = 0.5 * self.device.inertia * (velocity - before) * (velocity + before);
        (self.puck.position, self.puck.velocity) = (position, velocity);
        let ledger = &mut self.row.ledger;
        ledger.motor += motor;
        ledger.damping += damping;
        ledger.friction += friction;
        ledger.hand += moving + damping + friction - motor;
    }
}

/// Whether the world's loop can be compiled. Nothing else can keep a scenario of it from beginning.
pub fn check(world: &World) -> Result<(), Error> {
    Control::new(&world.spec())?;
    Ok(())
}

/// round(duration/T) + 1
pub fn rows(duration: f64, period: f64) -> u64 {
    (duration / period).round() as u64 + 1
}
