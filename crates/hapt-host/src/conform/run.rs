//! Plays effects on a wheel and records its motion.
//!
//! A constant torque, changed 50 times a second, makes the wheel swing about the middle, also while other effects play. The torque that the
//! wheel's motion needs beyond that one is the effects' torque.

use super::cases::Case;
use super::effect::{HostEffect, LEFT};
use super::meaning::Action;

/// The reason that a test of a wheel ends early.
#[derive(Debug, thiserror::Error)]
pub enum ConformError {
    /// The system, or the driver.
    #[error("{0}")]
    Device(String),
    /// The user has requested the end.
    #[error("interrupted")]
    Interrupted,
    /// The probe.
    #[error("a constant torque of {0:.0} % does not move the wheel; free it, or allow more with --level")]
    Still(f64),
    /// At the start.
    #[error("the wheel stands at {0:.0} % of its way from the middle; turn it near the middle")]
    Aside(f64),
    /// The probe.
    #[error("{}; nothing else can be measured", super::KnownError::Update.sentence())]
    NoUpdates,
    /// The swing.
    #[error("the wheel leaves the middle of its range, though a torque holds it there; is a hand on it?")]
    Leaves,
    /// The fit.
    #[error("the wheel's motion under a constant torque is not that of a mass with friction; is a hand on it?")]
    NoPlant,
}

/// The interface of a wheel's driver. Times are in s from any start.
pub trait Wheel {
    /// Now.
    fn now(&mut self) -> f64;
    /// Uploads an effect to a place, or changes the one that is there.
    ///
    /// # Errors
    /// The driver refuses it.
    fn put(&mut self, place: usize, requested: &HostEffect) -> Result<(), ConformError>;
    /// Starts it, this many times in a row.
    ///
    /// # Errors
    /// As above.
    fn start(&mut self, place: usize, count: u32) -> Result<(), ConformError>;
    /// Stops it.
    ///
    /// # Errors
    /// As above.
    fn stop(&mut self, place: usize) -> Result<(), ConformError>;
    /// Removes all effects.
    ///
    /// # Errors
    /// As above.
    fn clear(&mut self) -> Result<(), ConformError>;
    /// Sets the device's gain.
    ///
    /// # Errors
    /// As above.
    fn gain(&mut self, share: f64) -> Result<(), ConformError>;
    /// Waits until then, and appends times and positions of the wheel, in parts of half its range, 1 at the right end.
    ///
    /// # Errors
    /// The wheel is gone, or the user has asked to end.
    fn watch(&mut self, until: f64, trace: &mut Vec<(f64, f64)>) -> Result<(), ConformError>;
}

/// The observations of a case.
pub struct Seen {
    /// Times and positions of the wheel.
    pub trace: Vec<(f64, f64)>,
    /// The times from which torques were requested, and these torques to the left.
    pub pushes: Vec<(f64, f64)>,
    /// The effect's place in the case, the time, and the action, of each action.
    pub done: Vec<(usize, f64, Action)>,
}

impl Seen {
    /// The requested torque to the right at that time.
    pub fn push(&self, time: f64) -> f64 {
        let before = self.pushes.partition_point(|(when, _)| *when <= time);
        before.checked_sub(1).and_then(|at| self.pushes.get(at)).map_or(0.0, |(_, level)| -level)
    }
}

/// The controlled swing of the wheel.
#[derive(Clone, Copy, Debug)]
pub struct Swing {
    /// The acceleration of the largest torque to the right, 1/s²; negative where the sign is inverted.
    pub strength: f64,
    /// The largest share of the torque.
    pub most: f64,
    /// The amplitude, in parts of half the range.
    pub amplitude: f64,
}

/// The time between two changes of the torque, in s.
const TICK: f64 = 0.02;
/// The period of the swing, in s.
const PERIOD: f64 = 1.6;
/// The natural frequency of the controller, rad/s, and its damping ratio.
const FREQUENCY: f64 = 8.0;
const RATIO: f64 = 0.8;
/// The position, in parts of half the range, and the speed, in half ranges per second, beyond which a case is ended.
const EDGE: f64 = 0.7;
const FASTEST: f64 = 4.0;
/// The number of half seconds that may pass without bringing the wheel nearer to the middle.
const TRIES: u32 = 3;
/// The time over which the controller differences the position, in s.
const DIFFERENCE_S: f64 = 0.04;
/// The place of the effect that makes the wheel swing; a case's own follow.
const PUSH: usize = 0;

/// The effect of the swing's torque. It has a length: some wheels ignore effects without one, and it ends also where the stop is lost.
fn push(level: f64) -> HostEffect {
    HostEffect { length: Some(20.0), ..HostEffect::constant(level, LEFT) }
}

/// Position and velocity now. A trace contains only changes.
pub fn latest(trace: &[(f64, f64)], now: f64) -> (f64, f64) {
    let Some(&(_, position)) = trace.last() else { return (0.0, 0.0) };
    let known = trace.partition_point(|(when, _)| *when <= now - DIFFERENCE_S);
    let before = trace.get(known.saturating_sub(1)).map_or(position, |(_, before)| *before);
    (position, (position - before) / DIFFERENCE_S)
}

impl Swing {
    /// The square of its angular frequency, 1/s².
    pub fn square() -> f64 {
        (std::f64::consts::TAU / PERIOD).powi(2)
    }

    /// The level to the left at `time` after the start.
    fn level(&self, time: f64, (position, velocity): (f64, f64)) -> f64 {
        let omega = std::f64::consts::TAU / PERIOD;
        let (sine, cosine) = (omega * time).sin_cos();
        let wanted = (self.amplitude * sine, self.amplitude * omega * cosine);
        let acceleration = FREQUENCY * FREQUENCY * (wanted.0 - position)
            + 2.0 * RATIO * FREQUENCY * (wanted.1 - velocity)
            - omega * omega * wanted.0;
        -(acceleration / self.strength).clamp(-self.most, self.most)
    }

    /// Plays a case. At its end no effect plays, also after an error.
    ///
    /// # Errors
    /// The wheel's.
    pub fn play(&self, wheel: &mut dyn Wheel, case: &Case) -> Result<Seen, ConformError> {
        let seen = self.played(wheel, case);
        wheel.clear()?;
        seen
    }

    fn played(&self, wheel: &mut dyn Wheel, case: &Case) -> Result<Seen, ConformError> {
        let mut seen = Seen { trace: Vec::new(), pushes: Vec::new(), done: Vec::new() };
        wheel.gain(case.gain)?;
        for (at, effect) in case.effects.iter().enumerate() {
            wheel.put(at + 1, &effect.requested)?;
        }
        let mut due: Vec<(f64, usize, Action)> = case
            .effects
            .iter()
            .enumerate()
            .flat_map(|(at, effect)| effect.actions.iter().map(move |(when, action)| (*when, at, *action)))
            .collect();
        due.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut due = due.into_iter().peekable();
        let begin = wheel.now();
        wheel.put(PUSH, &push(0.0))?;
        wheel.start(PUSH, 1)?;
        wheel.watch(begin, &mut seen.trace)?;
        loop {
            let now = wheel.now();
            let at = latest(&seen.trace, now);
            let leaves = !case.effects.is_empty() && at.0.abs() > EDGE || at.1.abs() > FASTEST;
            if now - begin >= case.seconds || leaves {
                return Ok(seen);
            }
            while let Some((_, at, action)) = due.next_if(|(when, ..)| begin + when <= now) {
                seen.done.push((at, wheel.now(), action));
                match action {
                    Action::Start(count) => wheel.start(at + 1, count)?,
                    Action::Stop => wheel.stop(at + 1)?,
                    Action::Change(requested) => wheel.put(at + 1, &requested)?,
                }
            }
            // Rounded to the driver's integers.
            let level = (32_767.0 * self.level(now - begin, at)).round() / 32_767.0;
            seen.pushes.push((wheel.now(), level));
            wheel.put(PUSH, &push(level))?;
            let next = wheel.now().max(now) + TICK;
            wheel.watch(next, &mut seen.trace)?;
        }
    }

    /// Brings the wheel to rest at the middle.
    ///
    /// # Errors
    /// It does not get there.
    pub fn centre(&self, wheel: &mut dyn Wheel) -> Result<(), ConformError> {
        let still = Swing { amplitude: 0.0, ..*self };
        let near = |(position, velocity): (f64, f64)| position.abs() < 0.05 && velocity.abs() < 0.1;
        // It gives up where the wheel does not come nearer to the middle: a hand or an end stop holds it.
        let (mut nearest, mut tries) = (f64::INFINITY, 0);
        while tries < TRIES {
            let rest = Case { seconds: 0.5, ..Case::rest() };
            let seen = still.play(wheel, &rest)?;
            let at = latest(&seen.trace, wheel.now());
            if near(at) {
                return Ok(());
            }
            if at.0.abs() < 0.9 * nearest {
                nearest = at.0.abs();
            } else {
                tries += 1;
            }
        }
        Err(ConformError::Leaves)
    }
}

/// Finds the smallest torque that moves the wheel by a hundredth of half its range in 0.3 s, and returns the acceleration of the largest torque to
/// the right that follows from it.
///
/// # Errors
/// The wheel stays where it is, or takes no change of a torque.
pub fn probe(wheel: &mut dyn Wheel, most: f64) -> Result<f64, ConformError> {
    const MOMENT: f64 = 0.3;
    const MOVED: f64 = 0.01;
    wheel.gain(1.0)?;
    let mut level = 0.01;
    while level <= most {
        let mut trace = Vec::new();
        wheel.put(PUSH, &push(level))?;
        let begin = wheel.now();
        wheel.watch(begin, &mut trace)?;
        let from = trace.first().map_or(0.0, |(_, position)| *position);
        if from.abs() > EDGE {
            wheel.clear()?;
            return Err(ConformError::Aside(100.0 * from));
        }
        wheel.start(PUSH, 1)?;
        wheel.watch(begin + MOMENT, &mut trace)?;
        let first = latest(&trace, begin + MOMENT);
        let travel = first.0 - from;
        if travel.abs() >= MOVED {
            // The opposite direction, twice as strong: the wheel has to reverse.
            wheel.put(PUSH, &push(-(2.0 * level).min(most)))?;
            let turned = wheel.now();
            wheel.watch(turned + MOMENT, &mut trace)?;
            let second = latest(&trace, turned + MOMENT);
            wheel.clear()?;
            let change = second.1 - first.1;
            if change * travel >= 0.0 || change.abs() < 0.5 * first.1.abs() {
                return Err(ConformError::NoUpdates);
            }
            return Ok(-2.0 * travel / (level * MOMENT * MOMENT));
        }
        wheel.clear()?;
        level *= 2.0;
    }
    Err(ConformError::Still(100.0 * most))
}
