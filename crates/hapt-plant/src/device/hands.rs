//! The hands of a device: those of a scenario, and those that take hold, push and let go while it runs.

use crate::device::{Grip, HandMode, InteractiveGrip, Stage, VirtualDevice};
use crate::hand::{Hand, Script};
use crate::push::{Grasp, Inertia, NO_SINE};
use crate::trajectory::Piece;

/// A hand whose target is older than this has stopped, in s.
const LONGEST_MOVE: f64 = 0.05;

impl VirtualDevice {
    /// Starts a scenario's hand at its t = 0; it releases at the scenario's end. `script` receives the previous one.
    pub fn begin(&mut self, script: &mut Script) {
        core::mem::swap(&mut self.script, script);
        self.restart_clock();
        let Some(hand) = &self.script.hand else { return self.let_go() };
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
        let Some(Grip { inertia, damping, stiffness }) = grip else { return self.let_go() };
        let grip = Inertia { inertia, damping, stiffness };
        self.restart_clock();
        self.next_event = f64::INFINITY;
        let target = self.held_position();
        self.mode =
            HandMode::Grip(InteractiveGrip { grip, intended: Piece::straight(0.0, target, 0.0), target, updated: 0 });
        self.take();
    }

    /// The hand of this mode takes hold of the handle, or of the puck.
    pub(super) fn take(&mut self) {
        self.stage = Stage::Unknown;
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
            // Nothing but the hand moves the puck.
            Grasp::Prescribed => self.puck.take(None, NO_SINE, false),
        }
    }

    /// A hand pushes with this torque in N·m (linear: N) from now on, instead of the previous hand.
    pub fn push(&mut self, torque: f64) {
        if !matches!(self.mode, HandMode::Torque(_)) {
            self.let_go();
        }
        (self.mode, self.stage) = (HandMode::Torque(torque), Stage::Unknown);
    }

    /// Sets the grip's target to `position` in rad (linear: m). The grip moves there at constant velocity, over the time since the previous
    /// target, 50 ms at most, so that targets at a steady rate give a steady motion. Without a grip nothing happens.
    pub fn intend(&mut self, position: f64) {
        let HandMode::Grip(hand) = &mut self.mode else { return };
        if !position.is_finite() {
            return;
        }
        let longest = (LONGEST_MOVE / self.period).max(1.0) as u64;
        let samples = (self.sample - hand.updated).clamp(1, longest);
        let from = hand.intended.at(self.now).0;
        let slope = (position - from) / (samples as f64 * self.period);
        hand.intended = Piece::straight(self.now, from, slope);
        (hand.target, hand.updated) = (position, self.sample);
        self.next_event = self.origin + (self.sample + samples) as f64 * self.period;
    }

    /// The hand goes over from the puck to a new handle, or back.
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
        self.stage = Stage::Unknown;
        match &mut self.shaft {
            Some(shaft) => shaft.switch(),
            None => self.puck.switch(),
        }
    }

    /// The hand's event at an instant: arrival, release or jump. A jump comes before a sample or a motor's change at the same instant,
    /// and its work is done against the torque held before it.
    pub(super) fn hand_acts(&mut self, t: f64) {
        self.stage = Stage::Unknown;
        if let HandMode::Grip(hand) = &mut self.mode {
            hand.intended = Piece::straight(t, hand.target, 0.0);
            self.next_event = f64::INFINITY;
            return;
        }
        let position = self.held_position();
        let Some(hand) = &mut self.script.hand else { return };
        if hand.is_gone(t) {
            return self.let_go();
        }
        let (next, switched) = hand.act(t, position);
        self.next_event = next.unwrap_or(f64::INFINITY);
        let prescribed = hand.prescribed().map(|piece| piece.at(t));
        if switched {
            self.switch();
        }
        if let Some(motion) = prescribed {
            // A handle that jumps leaves the puck where it is.
            self.announced = self.shaft.is_none();
            self.jump(motion);
        }
    }

    pub(super) fn let_go(&mut self) {
        self.stage = Stage::Unknown;
        let was_held = self.is_held();
        (self.mode, self.next_event) = (HandMode::Free, f64::INFINITY);
        if was_held {
            self.take();
        }
    }

    /// The puck jumps with the hand, against the motor's torque before; a handle against its shaft's spring, without an impulse of its damping.
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
