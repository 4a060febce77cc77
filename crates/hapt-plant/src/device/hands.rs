//! The hands of a device: those of a scenario, and those that grip, push and release interactively.

use crate::device::{Grip, HandMode, InteractiveGrip, PeriodKind, VirtualDevice};
use crate::hand::{Hand, Script};
use crate::push::{Grasp, Inertia, NO_SINE};
use crate::trajectory::Piece;

/// The longest time, in s, over which a grip moves to a new target.
const MAX_MOVE_S: f64 = 0.05;

impl VirtualDevice {
    /// Starts a scenario's hand at its t = 0; the hand releases at the scenario's end. `script` receives the previous scenario.
    pub fn begin(&mut self, script: &mut Script) {
        core::mem::swap(&mut self.script, script);
        self.restart_clock();
        let Some(hand) = &self.script.hand else { return self.release() };
        let start = hand.prescribed().map(|piece| piece.at(0.0));
        self.mode = HandMode::Script;
        self.take();
        if let Some(start) = start {
            self.jump(start);
        }
        self.hand_acts(0.0);
    }

    /// Grips the puck at its present position, without a push; `None` releases it.
    pub fn hold(&mut self, grip: Option<Grip>) {
        let Some(Grip { inertia, damping, stiffness }) = grip else { return self.release() };
        let grip = Inertia { inertia, damping, stiffness };
        self.restart_clock();
        self.next_event = f64::INFINITY;
        let target = self.held_position();
        self.mode =
            HandMode::Grip(InteractiveGrip { grip, intended: Piece::straight(0.0, target, 0.0), target, updated: 0 });
        self.take();
    }

    /// Connects the hand of the present mode to the handle, or to the puck where there is no handle.
    pub(super) fn take(&mut self) {
        self.period_kind = PeriodKind::Unknown;
        let script = match &self.mode {
            HandMode::Script => self.script.hand.as_ref(),
            HandMode::Free | HandMode::Grip(_) | HandMode::Torque(_) => None,
        };
        let (grasp, sine) = match (&self.mode, script) {
            (HandMode::Grip(hand), _) => (Grasp::Grip(hand.grip), NO_SINE),
            (_, Some(hand)) => hand.grasp(),
            (HandMode::Free | HandMode::Script | HandMode::Torque(_), None) => (Grasp::Free, NO_SINE),
        };
        let switches = script.is_some_and(Hand::switches);
        if let Some(shaft) = &mut self.shaft {
            return shaft.take(grasp, sine, switches);
        }
        match grasp {
            Grasp::Free => self.puck.take(None, sine, false),
            Grasp::Grip(grip) => self.puck.take(Some(grip), sine, switches),
            // The hand prescribes the puck's motion: no equation of motion is solved.
            Grasp::Prescribed => self.puck.take(None, NO_SINE, false),
        }
    }

    /// Replaces the previous hand by one that pushes with this torque in N·m (linear: N) from now on.
    pub fn push(&mut self, torque: f64) {
        if !matches!(self.mode, HandMode::Torque(_)) {
            self.release();
        }
        (self.mode, self.period_kind) = (HandMode::Torque(torque), PeriodKind::Unknown);
    }

    /// Sets the grip's target to `position` in rad (linear: m). The grip moves there at constant velocity, over the time since the previous
    /// target, 50 ms at most, so that targets at a steady rate give a steady motion. Without a grip nothing happens.
    pub fn intend(&mut self, position: f64) {
        let HandMode::Grip(hand) = &mut self.mode else { return };
        if !position.is_finite() {
            return;
        }
        let longest = (MAX_MOVE_S / self.period).max(1.0) as u64;
        let samples = (self.sample - hand.updated).clamp(1, longest);
        let from = hand.intended.at(self.now).0;
        let slope = (position - from) / (samples as f64 * self.period);
        hand.intended = Piece::straight(self.now, from, slope);
        (hand.target, hand.updated) = (position, self.sample);
        self.next_event = self.origin + (self.sample + samples) as f64 * self.period;
    }

    /// Moves the hand from the puck to a newly added handle, or back.
    pub(super) fn change_hands(&mut self) {
        if self.shaft.is_some() {
            self.puck.release();
        }
        self.take();
        let is_open = matches!(self.mode, HandMode::Script) && self.script.hand.as_ref().is_some_and(Hand::is_open);
        if is_open {
            self.switch();
        }
    }

    /// Opens or closes a hand that switches.
    pub(super) fn switch(&mut self) {
        self.period_kind = PeriodKind::Unknown;
        match &mut self.shaft {
            Some(shaft) => shaft.switch(),
            None => self.puck.switch(),
        }
    }

    /// The hand's event at an instant: arrival, release or jump. A jump comes before a sample or a motor's change at the same instant,
    /// and its work is that against the torque held before it.
    pub(super) fn hand_acts(&mut self, t: f64) {
        self.period_kind = PeriodKind::Unknown;
        if let HandMode::Grip(hand) = &mut self.mode {
            hand.intended = Piece::straight(t, hand.target, 0.0);
            self.next_event = f64::INFINITY;
            return;
        }
        let position = self.held_position();
        let Some(hand) = &mut self.script.hand else { return };
        if hand.is_gone(t) {
            return self.release();
        }
        let (next, switched) = hand.act(t, position);
        self.next_event = next.unwrap_or(f64::INFINITY);
        let prescribed = hand.prescribed().map(|piece| piece.at(t));
        if switched {
            self.switch();
        }
        if let Some(motion) = prescribed {
            // A jump of the handle does not move the puck.
            self.announced = self.shaft.is_none();
            self.jump(motion);
        }
    }

    pub(super) fn release(&mut self) {
        self.period_kind = PeriodKind::Unknown;
        let was_held = self.is_held();
        (self.mode, self.next_event) = (HandMode::Free, f64::INFINITY);
        if was_held {
            self.take();
        }
    }

    /// The puck jumps with the hand, against the motor's torque before the jump. A handle jumps against its shaft's spring; the shaft's damping gives
    /// no impulse.
    fn jump(&mut self, to: (f64, f64)) {
        if let Some(shaft) = &mut self.shaft {
            let (deflection, before) = (shaft.deflection, shaft.velocity);
            (shaft.deflection, shaft.velocity) = (to.0 - self.puck.position, to.1);
            let stored =
                0.5 * shaft.handle.stiffness * (shaft.deflection - deflection) * (shaft.deflection + deflection);
            self.ledger.hand += stored + 0.5 * shaft.handle.inertia * (to.1 - before) * (to.1 + before);
            return;
        }
        let stored = self.own.stored(to.0) - self.own.stored(self.puck.position);
        self.prescribe(to, self.gap * (to.0 - self.puck.position), 0.0, stored);
    }
}
