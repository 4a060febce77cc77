//! The simulated device, advanced period by period: the exact puck, the motor, and the hand that holds it. A simulation, a real-time
//! thread or the page runs it in closed loop with the control loop.

mod hands;

use alloc::boxed::Box;

use crate::hand::{Script, grip_push};
use crate::ledger::Ledger;
use crate::motor::Motor;
use crate::own::{Kind, Own};
use crate::puck::{Lengths, Puck};
use crate::push::{Inertia, Push};
use crate::shaft::Shaft;
use crate::spec::DeviceSpec;
use crate::trajectory::Piece;

/// A hand on the puck: its inertia moves with the puck, a spring and a damper connect the puck to the intended position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// kg·m² (linear: kg), zero or more.
    pub inertia: f64,
    /// N·m·s/rad (linear: N·s/m), zero or more.
    pub damping: f64,
    /// N·m/rad (linear: N/m), zero or more.
    pub stiffness: f64,
}

/// The hand that holds the puck.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum HandMode {
    Free,
    Script,
    Grip(InteractiveGrip),
    /// A torque in N·m (linear: N), held until the next one.
    Torque(f64),
}

/// A grip whose target arrives while it moves.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct InteractiveGrip {
    grip: Inertia,
    intended: Piece,
    /// The target, in the same unit.
    target: f64,
    /// The sample at which the target was set.
    updated: u64,
}

/// The kind of an event-free period, cached until the hand or the device changes.
#[derive(Clone, Copy, Debug, Default)]
enum PeriodKind {
    /// Not determined yet.
    #[default]
    Unknown,
    /// No special case applies: the general computation is necessary.
    Any,
    /// The hand prescribes a constant position.
    Rests,
    /// The motor's torque and this torque of the hand, in N·m (linear: N), are constant between samples, and the device has no friction.
    Pushed(f64),
}

/// A world's device. After construction nothing between two samples allocates.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VirtualDevice {
    period: f64,
    device: Inertia,
    kind: Kind,
    /// The position of the puck's 0 in the coordinate of `kind`.
    zero: f64,
    /// `kind` with the puck's 0 at `zero`.
    own: Own,
    delay: f64,
    /// The time constant in s with which the motor's torque follows what it holds; 0: at once.
    lag: f64,
    /// Whether the ledger of works is kept for a puck without a shaft.
    works: bool,
    motor: Motor<f64>,
    /// The motor's torque less what it holds; it decays with the lag, and is 0 without one.
    gap: f64,
    puck: Puck,
    /// The handle that the hand holds in place of the puck, where there is one.
    shaft: Option<Box<Shaft>>,
    script: Script,
    mode: HandMode,
    #[cfg_attr(feature = "serde", serde(skip))]
    period_kind: PeriodKind,
    /// The time of this sample on the hand's clock in s, origin + sample · T.
    now: f64,
    origin: f64,
    sample: u64,
    /// The time of the hand's next event in s; infinite if there is none.
    next_event: f64,
    announced: bool,
    ledger: Ledger,
    /// Seconds since this sample up to which [`VirtualDevice::travel_to`] has advanced.
    elapsed: f64,
}

impl VirtualDevice {
    /// The puck at rest at 0, free.
    pub fn new(spec: &DeviceSpec) -> Self {
        Self::with_works(spec, true)
    }

    /// A device with bit-identical motion that keeps no ledger of works (unless it has a shaft): faster to construct, slower per sample. For a
    /// caller that computes most samples itself ([`VirtualDevice::skip_to`]).
    pub fn without_works(spec: &DeviceSpec) -> Self {
        Self::with_works(spec, false)
    }

    fn with_works(spec: &DeviceSpec, works: bool) -> Self {
        let &DeviceSpec { period, delay, lag, inertia, damping, handle, .. } = spec;
        let kind = Kind::new(spec);
        let own = kind.at(0.0);
        let device = Inertia { inertia, damping, stiffness: 0.0 };
        let motor = Motor::new(delay, period);
        let lengths = lengths(&motor, period);
        VirtualDevice {
            period,
            device,
            kind,
            zero: 0.0,
            own,
            delay,
            lag,
            works,
            puck: Puck::new(device, own, lag, works.then_some(lengths)),
            shaft: handle.map(|handle| Shaft::boxed(handle, device, own, lag, lengths)),
            motor,
            gap: 0.0,
            script: Script::default(),
            mode: HandMode::Free,
            period_kind: PeriodKind::Unknown,
            now: 0.0,
            origin: 0.0,
            sample: 0,
            next_event: f64::INFINITY,
            announced: false,
            ledger: Ledger::default(),
            elapsed: 0.0,
        }
    }

    /// Moves the puck, and with a shaft the handle, to a position in rad (linear: m) and a velocity in rad/s (m/s).
    pub fn set_out(&mut self, puck: (f64, f64), handle: (f64, f64)) {
        (self.puck.position, self.puck.velocity) = puck;
        if let Some(shaft) = &mut self.shaft {
            (shaft.deflection, shaft.velocity) = (handle.0 - puck.0, handle.1);
        }
    }

    /// Reserves memory for the motor's delay line (up to 65 536 commands), for a thread that must not allocate.
    pub fn reserve(&mut self) {
        self.motor.reserve();
    }

    /// The puck's true position in rad (linear: m) and velocity in rad/s (m/s).
    #[inline]
    pub fn puck(&self) -> (f64, f64) {
        (self.puck.position, self.puck.velocity)
    }

    /// The true position and velocity of a handle on a shaft, in the same units; `None`: the puck is the handle.
    #[inline]
    pub fn handle(&self) -> Option<(f64, f64)> {
        self.shaft.as_ref().map(|shaft| (self.puck.position + shaft.deflection, shaft.velocity))
    }

    /// The time of this sample since the hand's t = 0, in s: k T for the samples of [`VirtualDevice::travel`].
    #[inline]
    pub fn time(&self) -> f64 {
        self.now
    }

    /// The position of what the hand holds: the handle, or the puck.
    fn held_position(&self) -> f64 {
        self.handle().map_or(self.puck.position, |handle| handle.0)
    }

    /// The motor's torque now, in N·m (linear: N): the held command, or, with a lag, the filtered one.
    #[inline]
    pub fn applied(&self) -> f64 {
        if self.lag > 0.0 { self.lagging() } else { self.motor.applied }
    }

    /// Out of line, so that it is not computed where there is no lag.
    #[inline(never)]
    fn lagging(&self) -> f64 {
        self.motor.applied + self.gap
    }

    /// The works so far.
    #[inline]
    pub fn ledger(&self) -> Ledger {
        self.ledger
    }

    /// Whether a hand prescribed a jump of the puck's position or velocity since the last sample.
    pub fn announced(&self) -> bool {
        self.announced
    }

    /// Whether a hand holds the puck.
    pub fn is_held(&self) -> bool {
        !matches!(self.mode, HandMode::Free)
    }

    /// The last scenario's hand.
    pub fn script(&self) -> &Script {
        &self.script
    }

    /// Moves the origin of the puck's and the grip's coordinates by `by` rad (linear: m); nothing moves. A scenario's positions count from
    /// the new 0. Allocates nothing.
    pub fn shift(&mut self, by: f64) {
        self.puck.position -= by;
        self.zero += by;
        if self.kind.has_place() {
            self.place();
        }
        if let HandMode::Grip(hand) = &mut self.mode {
            let (intended, slope) = hand.intended.at(self.now);
            hand.intended = Piece::straight(self.now, intended - by, slope);
            hand.target -= by;
        }
    }

    /// Resets the puck to rest at 0, free, with an empty delay line. Allocates nothing.
    pub fn restart(&mut self) {
        (self.puck.position, self.puck.velocity) = (0.0, 0.0);
        if let Some(shaft) = &mut self.shaft {
            (shaft.deflection, shaft.velocity) = (0.0, 0.0);
        }
        self.release();
        self.motor.clear();
        self.gap = 0.0;
        (self.announced, self.ledger) = (false, Ledger::default());
        self.restart_clock();
        self.elapsed = 0.0;
    }

    /// Sets the loop's command, in N·m (linear: N).
    #[inline]
    pub fn command(&mut self, torque: f64) {
        if self.motor.samples == 0 && matches!(self.period_kind, PeriodKind::Rests | PeriodKind::Pushed(_)) {
            self.motor.applied = torque;
            return;
        }
        let before = self.motor.applied;
        self.motor.command(torque);
        self.lag_behind(before);
    }

    /// A delayed command arrives: the motor holds it from now on.
    fn change(&mut self) {
        let before = self.motor.applied;
        self.motor.change();
        self.lag_behind(before);
    }

    /// Keeps the motor's torque continuous over a change of the held command when it lags; `before` is the previous command.
    #[inline]
    fn lag_behind(&mut self, before: f64) {
        if self.lag > 0.0 {
            self.gap += before - self.motor.applied;
        }
    }

    /// Continues as the device `to`, with the same state of puck and hand; the old device is exchanged into `to`.
    pub fn refit(&mut self, to: &mut VirtualDevice) {
        let key = |device: &Self| {
            let Inertia { inertia, damping, .. } = device.device;
            let handle = device.shaft.as_ref().map(|shaft| shaft.handle);
            (device.period, inertia, damping, device.kind, device.delay, device.lag, handle)
        };
        if key(self) == key(to) {
            return;
        }
        self.period_kind = PeriodKind::Unknown;
        if (self.period, self.delay) != (to.period, to.delay) {
            to.motor.follow(&self.motor);
            core::mem::swap(&mut self.motor, &mut to.motor);
            core::mem::swap(&mut self.delay, &mut to.delay);
        }
        core::mem::swap(&mut self.device, &mut to.device);
        core::mem::swap(&mut self.kind, &mut to.kind);
        core::mem::swap(&mut self.lag, &mut to.lag);
        if self.lag == 0.0 {
            self.gap = 0.0;
        }
        if self.period != to.period {
            let ratio = self.period / to.period;
            core::mem::swap(&mut self.period, &mut to.period);
            // The hand's clock continues, in samples of the new period.
            if let HandMode::Grip(hand) = &mut self.mode {
                hand.updated = 0;
            }
            self.script.last = (self.script.last.saturating_sub(self.sample) as f64 * ratio) as u64;
            (self.origin, self.sample) = (self.now, 0);
        }
        self.own = self.kind.at(self.zero);
        let (lengths, own) = (lengths(&self.motor, self.period), self.own);
        let held_by = self.shaft.is_some();
        match (&mut self.shaft, &to.shaft) {
            (Some(shaft), Some(new)) => shaft.handle = new.handle,
            (None, None) => {}
            // A newly added handle moves with the puck, on an unloaded shaft.
            (Some(_), None) | (None, Some(_)) => core::mem::swap(&mut self.shaft, &mut to.shaft),
        }
        if let Some(shaft) = &mut self.shaft {
            shaft.refit(self.device, own, self.lag, lengths);
            if !held_by {
                shaft.velocity = self.puck.velocity;
            }
        }
        self.puck.refit(self.device, own, self.lag, self.works.then_some(lengths));
        if held_by != self.shaft.is_some() {
            self.change_hands();
        }
    }

    /// Recomputes what depends on the position of the puck's 0.
    fn place(&mut self) {
        self.own = self.kind.at(self.zero);
        self.puck.place(self.own);
        if let Some(shaft) = &mut self.shaft {
            shaft.place(self.own);
        }
    }

    fn restart_clock(&mut self) {
        (self.now, self.origin, self.sample) = (0.0, 0.0, 0);
    }

    /// Continues at sample number `sample` with the puck's position and velocity `puck`, after the hand's events until then. For a caller that
    /// has computed the puck's motion up to there.
    pub fn skip_to(&mut self, sample: u64, puck: (f64, f64)) {
        let to = self.origin + sample as f64 * self.period;
        while self.next_event <= to {
            self.hand_acts(self.next_event);
        }
        (self.sample, self.now) = (sample, to);
        (self.puck.position, self.puck.velocity) = puck;
    }

    /// Advances to `elapsed` s after this sample, at most a period, without reaching the next sample. Only for a puck that is pushed
    /// ([`VirtualDevice::push`]) or free; [`VirtualDevice::travel_on`] advances from there to the next sample.
    pub fn travel_to(&mut self, elapsed: f64) {
        let rest = self.motor.rest;
        if rest > 0.0 && self.elapsed < rest && rest <= elapsed {
            self.stretch(self.now, self.now, rest - self.elapsed);
            self.change();
            self.elapsed = rest;
        }
        if self.elapsed < elapsed {
            self.stretch(self.now, self.now, elapsed - self.elapsed);
            self.elapsed = elapsed;
        }
    }

    /// Advances from the time of [`VirtualDevice::travel_to`] to the next sample; from a sample the same as [`VirtualDevice::travel`].
    pub fn travel_on(&mut self) {
        if self.elapsed == 0.0 {
            return self.travel();
        }
        self.travel_to(self.period);
        self.elapsed = 0.0;
        self.sample += 1;
        self.now = self.origin + self.sample as f64 * self.period;
    }

    /// Advances from this sample to the next.
    #[inline]
    pub fn travel(&mut self) {
        // t_k is k·T in one multiplication; an i64 becomes a number in one instruction.
        let to = self.origin + (self.sample + 1) as i64 as f64 * self.period;
        match self.period_kind {
            PeriodKind::Pushed(push) if self.next_event > to => {
                self.puck.advance_free_period(self.motor.applied, push, &mut self.ledger);
            }
            PeriodKind::Rests if self.next_event > to && self.sample < self.script.last => {}
            PeriodKind::Unknown | PeriodKind::Any | PeriodKind::Rests | PeriodKind::Pushed(_) => {
                return self.travel_any(to);
            }
        }
        self.sample += 1;
        self.now = to;
    }

    /// The general computation of a period; it determines the kind of period where that is unknown.
    #[inline(never)]
    fn travel_any(&mut self, to: f64) {
        if let PeriodKind::Unknown = self.period_kind {
            self.period_kind = self.find_period_kind();
        }
        let from = self.now;
        self.sample += 1;
        self.announced = false;
        if self.motor.rest == 0.0 && self.next_event > to {
            self.stretch(from, to, self.period);
        } else {
            let change = (self.motor.rest > 0.0).then_some((self.motor.rest, None));
            self.travel_by_events(from, to, self.period, change);
        }
        self.now = to;
        if self.sample > self.script.last && matches!(self.mode, HandMode::Script) {
            self.release();
        }
    }

    /// The kind of the following periods, until the hand or the device changes.
    fn find_period_kind(&self) -> PeriodKind {
        if self.shaft.is_some() || self.lag > 0.0 || self.motor.rest > 0.0 {
            return PeriodKind::Any;
        }
        let push = match (&self.mode, &self.script.hand) {
            (HandMode::Script, Some(hand)) if hand.prescribed().is_some_and(Piece::is_flat) => {
                return PeriodKind::Rests;
            }
            (HandMode::Script | HandMode::Grip(_), _) => return PeriodKind::Any,
            (&HandMode::Torque(value), _) => value,
            (HandMode::Free, _) => 0.0,
        };
        if self.puck.slides_freely_each_period() { PeriodKind::Pushed(push) } else { PeriodKind::Any }
    }

    /// Advances from this sample to the next, at `to` s on the hand's clock, which comes after `interval` s. After `delay` s, above 0 and
    /// no more than the interval, the motor holds `command`; with a delay of 0 it keeps the command that it has. For samples at arbitrary
    /// times, on a device that is made without a delay; the caller ends its scenario.
    pub fn travel_uneven(&mut self, interval: f64, to: f64, delay: f64, command: f64) {
        self.announced = false;
        let inside = (delay > 0.0 && delay < interval).then_some((delay, Some(command)));
        self.travel_by_events(self.now, to, interval, inside);
        (self.sample, self.now) = (self.sample + 1, to);
        if delay > 0.0 && delay >= interval {
            self.command(command);
        }
    }

    /// Advances from event to event over `length` s: those of the hand, and the motor's change, to a command or to the next of its delay
    /// line.
    fn travel_by_events(&mut self, from: f64, to: f64, length: f64, mut change: Option<(f64, Option<f64>)>) {
        let mut now = from;
        // Seconds since `from`: these lengths repeat to the bit, unlike differences of absolute times.
        let mut elapsed = 0.0;
        loop {
            let change_at = change.map(|(at, _)| at);
            let event_at = (self.next_event < to).then(|| (self.next_event - from).max(elapsed));
            let end = [change_at, event_at].into_iter().flatten().fold(length, f64::min);
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
                match change.take() {
                    Some((_, Some(command))) => self.command(command),
                    Some((_, None)) | None => self.change(),
                }
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
        self.move_puck(from, to, length);
        if self.gap != 0.0 {
            self.gap *= libm::exp(-length / self.lag);
        }
    }

    /// The puck's part in it.
    #[inline]
    fn move_puck(&mut self, from: f64, to: f64, length: f64) {
        let push = match (&self.mode, &self.script.hand) {
            (HandMode::Script, Some(hand)) => match hand.prescribed() {
                None => hand.push(from),
                Some(piece) if self.shaft.is_some() => {
                    let (end, phase) = (piece.at(to), hand.phase(from));
                    return self.move_shaft(length, phase, Some(end));
                }
                // The target is reached.
                Some(piece) if piece.is_flat() => return,
                Some(piece) => {
                    let square = piece.travel(from, to).0;
                    let lagging =
                        if self.gap != 0.0 { self.gap * piece.decaying_travel(from, to, self.lag) } else { 0.0 };
                    let own = self.own.prescribe(piece, from, to, &mut self.ledger);
                    self.prescribe(piece.at(to), lagging, self.device.damping * square, own);
                    return;
                }
            },
            (HandMode::Grip(hand), _) => {
                let (intended, velocity) = hand.intended.at(from);
                grip_push(hand.grip, intended, velocity)
            }
            (&HandMode::Torque(value), _) => Push { value, ..Push::default() },
            (HandMode::Free, _) | (HandMode::Script, None) => Push::default(),
        };
        if self.shaft.is_some() {
            return self.move_shaft(length, push, None);
        }
        self.puck.advance(length, self.motor.applied, self.gap, push, &mut self.ledger);
    }

    /// The same with a handle on a shaft; where the hand prescribes its motion, it ends at `end`.
    fn move_shaft(&mut self, length: f64, push: Push, end: Option<(f64, f64)>) {
        let Some(shaft) = &mut self.shaft else { return };
        let (from, motor) = ([self.puck.position, self.puck.velocity], (self.motor.applied, self.gap));
        [self.puck.position, self.puck.velocity] = shaft.advance(from, length, motor, push, &mut self.ledger);
        if let Some((position, velocity)) = end {
            (shaft.deflection, shaft.velocity) = (position - self.puck.position, velocity);
        }
    }

    /// Moves the puck with the hand; the hand's work closes the energy balance. `lagging` is the work of the motor's torque in excess of the held
    /// command, `own` the work that friction and stops take.
    fn prescribe(&mut self, (position, velocity): (f64, f64), lagging: f64, damping: f64, own: f64) {
        let motor = self.motor.applied * (position - self.puck.position) + lagging;
        let before = self.puck.velocity;
        let moving = 0.5 * self.device.inertia * (velocity - before) * (velocity + before);
        let field = self.own.field.map_or(0.0, |field| field.work(self.puck.position, position));
        (self.puck.position, self.puck.velocity) = (position, velocity);
        let ledger = &mut self.ledger;
        ledger.motor += motor;
        ledger.damping += damping;
        ledger.field += field;
        ledger.hand += moving + damping + own - motor - field;
    }
}

/// The lengths between the instants at which a motor's command may change.
fn lengths(motor: &Motor<f64>, period: f64) -> Lengths {
    if motor.rest > 0.0 { [motor.rest, period - motor.rest] } else { [period; 2] }
}
