//! The hand: its prescribed motion or push, and its release.

use crate::spec::{Drive, Hand as Model, Switching};

use crate::push::{Grasp, Inertia, NO_SINE, Push, Sine};
use crate::trajectory::{Form, Piece, Trajectory, snap};

/// A hand aligned with the loop's samples.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Hand {
    trajectory: Trajectory,
    /// The trajectory's piece since the last event.
    piece: Piece,
    kind: Kind,
    release: Option<f64>,
    switch: Option<Switch>,
}

/// A grip that alternately opens and closes.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Switch {
    switching: Switching,
    period: f64,
    /// The number of earlier closings.
    cycle: u64,
    is_open: bool,
    /// The time of the next opening or closing, in s.
    next: f64,
    /// The offset of its intended position from `moves`.
    offset: f64,
}

impl Switch {
    /// Holding from t = 0 on.
    fn new(switching: Switching, period: f64) -> Self {
        let mut switch = Switch { switching, period, cycle: 0, is_open: false, next: 0.0, offset: 0.0 };
        switch.next = switch.instant();
        switch
    }

    /// The time at which it opens if it is closed, else closes.
    fn instant(&self) -> f64 {
        let Switching { hold, open } = self.switching;
        let more = if self.is_open { hold + open } else { hold };
        snap(self.cycle as f64 * (hold + open) + more, self.period)
    }

    /// Advances to t, with the intended motion at `moves` and the puck at `position`; returns whether it opened or closed.
    fn act(&mut self, t: f64, moves: f64, position: f64) -> bool {
        let before = self.is_open;
        while self.next <= t {
            if self.is_open {
                self.cycle += 1;
                self.offset = position - moves;
            }
            self.is_open = !self.is_open;
            self.next = self.instant();
        }
        self.is_open != before
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Kind {
    Prescribed,
    Torque,
    Grip(Inertia),
}

impl Hand {
    /// The hand on the samples of this period, in s.
    pub fn new(hand: &Model, period: f64) -> Self {
        let (shape, kind, switching) = match &hand.drive {
            Drive::Position(shape) => (shape, Kind::Prescribed, None),
            Drive::Torque(shape) => (shape, Kind::Torque, None),
            &Drive::Grip { inertia, damping, stiffness, ref moves, switching } => {
                (moves, Kind::Grip(Inertia { inertia, damping, stiffness }), switching)
            }
        };
        let trajectory = Trajectory::new(shape, period);
        let switch = switching.map(|switching| Switch::new(switching, period));
        Hand { piece: trajectory.first(), trajectory, kind, release: hand.release.map(|t| snap(t, period)), switch }
    }

    /// Whether its intended value changes only in jumps.
    pub fn is_steady(&self) -> bool {
        self.trajectory.is_steady()
    }

    /// Whether its intended value is constant until the next event.
    pub fn rests(&self) -> bool {
        self.piece.is_flat()
    }

    /// Whether it alternately opens and closes.
    pub(crate) fn switches(&self) -> bool {
        self.switch.is_some()
    }

    /// The position as a function of time until the next event, where the hand prescribes it.
    #[inline]
    pub fn prescribed(&self) -> Option<&Piece> {
        matches!(self.kind, Kind::Prescribed).then_some(&self.piece)
    }

    /// Whether it holds the puck by a spring and a damper, and its inertia moves with it.
    pub fn grips(&self) -> bool {
        self.grip().is_some()
    }

    /// The inertia, damping and stiffness that the hand adds to the puck.
    pub(crate) fn grip(&self) -> Option<Inertia> {
        match self.kind {
            Kind::Grip(inertia) => Some(inertia),
            Kind::Prescribed | Kind::Torque => None,
        }
    }

    /// The push per unit of σ = sin(ωt + phase) and κ = cos(ωt + phase), and ω in rad/s; zeros where there is no sine.
    pub(crate) fn sine(&self) -> Sine {
        match (self.trajectory.last().form, self.kind) {
            (Form::Sine { amplitude, omega, .. }, Kind::Torque) => (amplitude, 0.0, omega),
            (Form::Sine { amplitude, omega, .. }, Kind::Grip(hand)) => {
                (hand.stiffness * amplitude, hand.damping * amplitude * omega, omega)
            }
            _ => (0.0, 0.0, 0.0),
        }
    }

    /// How it holds a handle on a shaft, and its drive per unit of σ and of κ there: a torque, or the acceleration of a prescribed sine.
    pub(crate) fn grasp(&self) -> (Grasp, Sine) {
        match (self.kind, self.trajectory.last().form) {
            (Kind::Prescribed, Form::Sine { amplitude, omega, .. }) => {
                (Grasp::Prescribed, (-amplitude * omega * omega, 0.0, omega))
            }
            (Kind::Prescribed, Form::Straight { .. }) => (Grasp::Prescribed, NO_SINE),
            (Kind::Torque, _) => (Grasp::Free, self.sine()),
            (Kind::Grip(grip), _) => (Grasp::Grip(grip), self.sine()),
        }
    }

    /// The phase of a prescribed motion from t on, as σ and κ of a sine, without a push.
    pub(crate) fn phase(&self, t: f64) -> Push {
        Push { value: 0.0, slope: 0.0, ..self.plain_push(t) }
    }

    /// Whether it is a hand that opens and closes, and open now.
    pub(crate) fn is_open(&self) -> bool {
        self.switch.as_ref().is_some_and(|switch| switch.is_open)
    }

    /// The push from t on, until the next event: the torque itself, or a grip's spring and damper on its intended motion. A
    /// jump of the intention has no velocity: no impulse.
    pub fn push(&self, t: f64) -> Push {
        let Some(Switch { is_open, offset, .. }) = self.switch else { return self.plain_push(t) };
        if is_open {
            return Push::default();
        }
        let mut push = self.plain_push(t);
        push.value += self.grip().map_or(0.0, |hand| hand.stiffness * offset);
        push
    }

    fn plain_push(&self, t: f64) -> Push {
        if let Form::Sine { omega, phase, .. } = self.piece.form {
            let (sin, cos) = libm::sincos(omega * t + phase);
            return Push { sin, cos, ..Push::default() };
        }
        let (value, slope) = self.piece.at(t);
        match self.kind {
            Kind::Grip(hand) => grip_push(hand, value, slope),
            Kind::Torque | Kind::Prescribed => Push { value, slope, ..Push::default() },
        }
    }

    /// Continues with the trajectory's piece at t, and opens or closes on the puck at `position`; returns the time of the next event after
    /// t, and whether it opened or closed now.
    pub fn act(&mut self, t: f64, position: f64) -> (Option<f64>, bool) {
        self.piece = self.trajectory.piece(t);
        let moves = self.piece.at(t).0;
        let switched = self.switch.as_mut().is_some_and(|switch| switch.act(t, moves, position));
        let release = self.release.filter(|&release| release > t);
        let switch = self.switch.as_ref().map(|switch| switch.next);
        let next = [self.trajectory.next_break(t), release, switch].into_iter().flatten().reduce(f64::min);
        (next, switched)
    }

    /// Whether the hand has released the puck at t, the instant of release included.
    pub fn is_gone(&self, t: f64) -> bool {
        self.release.is_some_and(|release| release <= t)
    }

    /// The time of the last event in s: a step, a ramp's end, a path's last point, or the release. 0 for a sine.
    pub fn last_event(&self) -> f64 {
        let trajectory = self.trajectory.last().from;
        self.release.map_or(trajectory, |release| release.max(trajectory.min(release)))
    }

    /// Whether the puck stands still, held, from the last event on.
    pub fn holds_still(&self) -> bool {
        self.prescribed().is_some() && self.release.is_none() && self.trajectory.last().is_flat()
    }
}

/// The push of a grip's spring and damper while the intended motion is at `value` with velocity `slope`.
pub(crate) fn grip_push(hand: Inertia, value: f64, slope: f64) -> Push {
    Push { value: hand.stiffness * value + hand.damping * slope, slope: hand.stiffness * slope, ..Push::default() }
}

/// A scenario's hand, aligned with the samples of a loop; none by default.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Script {
    pub(crate) hand: Option<Hand>,
    /// The last sample of the scenario.
    pub(crate) last: u64,
}

impl Script {
    /// A hand for `duration` s on the samples of this period in s.
    pub fn new(hand: &Model, duration: f64, period: f64) -> Self {
        Script { hand: Some(Hand::new(hand, period)), last: libm::round(duration / period) as u64 }
    }

    /// The hand, where there is one.
    pub fn hand(&self) -> Option<&Hand> {
        self.hand.as_ref()
    }
}
