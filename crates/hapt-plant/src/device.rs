//! The device on its own, period after period: the exact puck, the motor, and whatever hand holds it. Whoever has a loop runs it
//! beside one: a simulation, a thread in real time, a page.

use crate::hand::{Hand, grip_push};
use crate::ledger::Ledger;
use crate::motor::Motor;
use crate::puck::{Inertia, Lengths, Puck, Push};
use crate::spec::{self, DeviceSpec};
use crate::trajectory::Piece;

/// A hand that takes longer than this from one word to the next has stopped in between, in s.
const LONGEST_MOVE: f64 = 0.05;

/// A hand on the puck: its inertia moves with the puck, spring and damper stand between the puck and what it intends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// kg·m² (linear: kg), zero or more.
    pub inertia: f64,
    /// N·m·s/rad (linear: N·s/m), zero or more.
    pub damping: f64,
    /// N·m/rad (linear: N/m), zero or more.
    pub stiffness: f64,
}

/// A scenario's hand, laid on the samples of a loop; none by default.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Script {
    hand: Option<Hand>,
    /// The sample after which it is over.
    last: u64,
}

impl Script {
    /// A hand for `duration` s on the samples of this period in s.
    pub fn new(hand: &spec::Hand, duration: f64, period: f64) -> Self {
        Script { hand: Some(Hand::new(hand, period)), last: libm::round(duration / period) as u64 }
    }

    /// The hand, where there is one.
    pub fn hand(&self) -> Option<&Hand> {
        self.hand.as_ref()
    }
}

/// Who holds the puck.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Holder {
    Nobody,
    Script,
    Grip(Follower),
    /// A torque in N·m (linear: N), held until the next one.
    Torque(f64),
}

/// A grip whose intended motion is told as it goes.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Follower {
    grip: Inertia,
    intended: Piece,
    /// Where it is on the way to.
    target: f64,
    /// The sample at which that was said.
    said: u64,
}

/// A world's device. Nothing that it does between two samples allocates, once it is made.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VirtualDevice {
    period: f64,
    device: Inertia,
    friction: f64,
    delay: f64,
    motor: Motor<f64>,
    puck: Puck,
    script: Script,
    holder: Holder,
    /// The instant of this sample by the hand's own clock in s, origin + sample · T.
    now: f64,
    origin: f64,
    sample: u64,
    /// When the hand does something next, in s; infinite when never.
    next_event: f64,
    announced: bool,
    ledger: Ledger,
    /// Seconds since this sample, where [`VirtualDevice::travel_to`] has gone on from it.
    elapsed: f64,
}

impl VirtualDevice {
    /// The puck at rest at 0, nobody's hand on it.
    pub fn new(spec: &DeviceSpec) -> Self {
        let &DeviceSpec { period, delay, inertia, damping, friction } = spec;
        let device = Inertia { inertia, damping, stiffness: 0.0 };
        let motor = Motor::new(delay, period);
        VirtualDevice {
            period,
            device,
            friction,
            delay,
            puck: Puck::new(device, friction, lengths(&motor, period)),
            motor,
            script: Script::default(),
            holder: Holder::Nobody,
            now: 0.0,
            origin: 0.0,
            sample: 0,
            next_event: f64::INFINITY,
            announced: false,
            ledger: Ledger::default(),
            elapsed: 0.0,
        }
    }

    /// Makes room for all commands that the motor's delay keeps on their way (up to 65 536), for a thread that must not.
    pub fn reserve(&mut self) {
        self.motor.reserve();
    }

    /// The puck's true position in rad (linear: m) and velocity in rad/s (m/s).
    #[inline]
    pub fn puck(&self) -> (f64, f64) {
        (self.puck.position, self.puck.velocity)
    }

    /// What the motor holds, in N·m (linear: N).
    #[inline]
    pub fn applied(&self) -> f64 {
        self.motor.applied
    }

    /// The device's works up to here.
    #[inline]
    pub fn ledger(&self) -> Ledger {
        self.ledger
    }

    /// Whether a hand has prescribed the puck a jump, or a corner of its motion, since the last sample.
    pub fn announced(&self) -> bool {
        self.announced
    }

    /// Whether anybody holds the puck.
    pub fn is_held(&self) -> bool {
        !matches!(self.holder, Holder::Nobody)
    }

    /// The scenario's hand that has taken hold last.
    pub fn script(&self) -> &Script {
        &self.script
    }

    /// A scenario's hand takes hold now, at its t = 0, and lets go when the scenario is over; `script` is then the one before it.
    pub fn begin(&mut self, script: &mut Script) {
        core::mem::swap(&mut self.script, script);
        self.restart_clock();
        let Some(hand) = &self.script.hand else { return self.let_go() };
        self.holder = Holder::Script;
        self.puck.take(hand.grip(), hand.sine(), hand.switches());
        if let Some(piece) = hand.prescribed() {
            self.prescribe(piece.at(0.0), 0.0, 0.0);
        }
        self.hand_acts(0.0);
    }

    /// A hand takes hold where the puck is, without a push, or whoever holds it lets go.
    pub fn hold(&mut self, grip: Option<Grip>) {
        let Some(Grip { inertia, damping, stiffness }) = grip else { return self.let_go() };
        let grip = Inertia { inertia, damping, stiffness };
        self.restart_clock();
        self.next_event = f64::INFINITY;
        self.puck.take(Some(grip), (0.0, 0.0, 0.0), false);
        let target = self.puck.position;
        self.holder = Holder::Grip(Follower { grip, intended: Piece::straight(0.0, target, 0.0), target, said: 0 });
    }

    /// A hand pushes with this torque in N·m (linear: N) from now on, in place of whatever held the puck.
    pub fn push(&mut self, torque: f64) {
        if !matches!(self.holder, Holder::Torque(_)) {
            self.let_go();
        }
        self.holder = Holder::Torque(torque);
    }

    /// The grip means to be at `position` in rad (linear: m), and goes there straight: for as long as its word before this one is ago,
    /// but 50 ms at most, so that words at a steady rate make one steady motion. Without a grip nothing happens.
    pub fn intend(&mut self, position: f64) {
        let Holder::Grip(hand) = &mut self.holder else { return };
        if !position.is_finite() {
            return;
        }
        let longest = (LONGEST_MOVE / self.period).max(1.0) as u64;
        let samples = (self.sample - hand.said).clamp(1, longest);
        let from = hand.intended.at(self.now).0;
        let slope = (position - from) / (samples as f64 * self.period);
        hand.intended = Piece::straight(self.now, from, slope);
        (hand.target, hand.said) = (position, self.sample);
        self.next_event = self.origin + (self.sample + samples) as f64 * self.period;
    }

    /// The puck's coordinate, and that of the grip's intention, counts from `by` rad (linear: m) further on: nothing moves. A scenario's
    /// positions are from the new 0. Allocates nothing.
    pub fn shift(&mut self, by: f64) {
        self.puck.position -= by;
        if let Holder::Grip(hand) = &mut self.holder {
            let (intended, slope) = hand.intended.at(self.now);
            hand.intended = Piece::straight(self.now, intended - by, slope);
            hand.target -= by;
        }
    }

    /// The puck at rest at 0, nobody's hand on it, and no torque on its way. Allocates nothing.
    pub fn restart(&mut self) {
        (self.puck.position, self.puck.velocity) = (0.0, 0.0);
        self.let_go();
        self.motor.clear();
        (self.announced, self.ledger) = (false, Ledger::default());
        self.restart_clock();
        self.elapsed = 0.0;
    }

    /// The loop's command, in N·m (linear: N).
    #[inline]
    pub fn command(&mut self, torque: f64) {
        self.motor.command(torque);
    }

    /// Goes on as the device `to`, with the puck where and as it is, in the same hand; `to` takes the place of what was.
    pub fn refit(&mut self, to: &mut VirtualDevice) {
        let key = |device: &Self| {
            (device.period, device.device.inertia, device.device.damping, device.friction, device.delay)
        };
        if key(self) == key(to) {
            return;
        }
        if (self.period, self.delay) != (to.period, to.delay) {
            to.motor.follow(&self.motor);
            core::mem::swap(&mut self.motor, &mut to.motor);
            core::mem::swap(&mut self.delay, &mut to.delay);
        }
        core::mem::swap(&mut self.device, &mut to.device);
        core::mem::swap(&mut self.friction, &mut to.friction);
        if self.period != to.period {
            let ratio = self.period / to.period;
            core::mem::swap(&mut self.period, &mut to.period);
            // The hand's clock goes on, in other samples.
            if let Holder::Grip(hand) = &mut self.holder {
                hand.said = 0;
            }
            self.script.last = (self.script.last.saturating_sub(self.sample) as f64 * ratio) as u64;
            (self.origin, self.sample) = (self.now, 0);
        }
        self.puck.refit(self.device, self.friction, lengths(&self.motor, self.period));
    }

    fn restart_clock(&mut self) {
        (self.now, self.origin, self.sample) = (0.0, 0.0, 0);
    }

    /// Goes on to `elapsed` s after this sample, at most a period, without reaching the next sample. Only for a puck that is pushed
    /// ([`VirtualDevice::push`]) or free; [`VirtualDevice::travel_on`] goes from there to the next sample.
    pub fn travel_to(&mut self, elapsed: f64) {
        let rest = self.motor.rest;
        if rest > 0.0 && self.elapsed < rest && rest <= elapsed {
            self.stretch(self.now, self.now, rest - self.elapsed);
            self.motor.change();
            self.elapsed = rest;
        }
        if self.elapsed < elapsed {
            self.stretch(self.now, self.now, elapsed - self.elapsed);
            self.elapsed = elapsed;
        }
    }

    /// From wherever [`VirtualDevice::travel_to`] has gone to the next sample; from a sample the same as [`VirtualDevice::travel`].
    pub fn travel_on(&mut self) {
        if self.elapsed == 0.0 {
            return self.travel();
        }
        self.travel_to(self.period);
        self.elapsed = 0.0;
        self.sample += 1;
        self.now = self.origin + self.sample as f64 * self.period;
    }

    /// From this sample to the next.
    #[inline]
    pub fn travel(&mut self) {
        let from = self.now;
        self.sample += 1;
        self.announced = false;
        // t_k is k·T in one multiplication.
        let to = self.origin + self.sample as f64 * self.period;
        if self.motor.rest == 0.0 && self.next_event > to {
            self.stretch(from, to, self.period);
        } else {
            self.travel_by_events(from, to);
        }
        self.now = to;
        if self.sample > self.script.last && matches!(self.holder, Holder::Script) {
            self.let_go();
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
        let push = match (&self.holder, &self.script.hand) {
            (Holder::Script, Some(hand)) => match hand.prescribed() {
                None => hand.push(from),
                // It is there already.
                Some(piece) if piece.is_flat() => return,
                Some(piece) => {
                    let (square, path) = piece.travel(from, to);
                    self.prescribe(piece.at(to), self.device.damping * square, self.friction * path);
                    return;
                }
            },
            (Holder::Grip(hand), _) => {
                let (intended, velocity) = hand.intended.at(from);
                grip_push(hand.grip, intended, velocity)
            }
            (&Holder::Torque(value), _) => Push { value, ..Push::default() },
            (Holder::Nobody, _) | (Holder::Script, None) => Push::default(),
        };
        self.puck.advance(length, self.motor.applied, push, &mut self.ledger);
    }

    /// What the hand does at an instant: arrive, release, or jump. A jump comes before a sample or a motor's change at the same instant,
    /// and its work is done against the torque held before it.
    fn hand_acts(&mut self, t: f64) {
        if let Holder::Grip(hand) = &mut self.holder {
            hand.intended = Piece::straight(t, hand.target, 0.0);
            self.next_event = f64::INFINITY;
            return;
        }
        let Some(hand) = &mut self.script.hand else { return };
        if hand.is_gone(t) {
            return self.let_go();
        }
        let (next, switched) = hand.act(t, self.puck.position);
        self.next_event = next.unwrap_or(f64::INFINITY);
        let prescribed = hand.prescribed().map(|piece| piece.at(t));
        if switched {
            self.puck.switch();
        }
        if let Some(motion) = prescribed {
            self.announced = true;
            self.prescribe(motion, 0.0, 0.0);
        }
    }

    fn let_go(&mut self) {
        if self.is_held() {
            self.puck.release();
        }
        (self.holder, self.next_event) = (Holder::Nobody, f64::INFINITY);
    }

    /// The puck is where the hand wants it; the hand's work is whatever the others leave over.
    fn prescribe(&mut self, (position, velocity): (f64, f64), damping: f64, friction: f64) {
        let motor = self.motor.applied * (position - self.puck.position);
        let before = self.puck.velocity;
        let moving = 0.5 * self.device.inertia * (velocity - before) * (velocity + before);
        (self.puck.position, self.puck.velocity) = (position, velocity);
        let ledger = &mut self.ledger;
        ledger.motor += motor;
        ledger.damping += damping;
        ledger.friction += friction;
        ledger.hand += moving + damping + friction - motor;
    }
}

/// The lengths between the instants at which a motor's command may change.
fn lengths(motor: &Motor<f64>, period: f64) -> Lengths {
    if motor.rest > 0.0 { [motor.rest, period - motor.rest] } else { [period; 2] }
}
