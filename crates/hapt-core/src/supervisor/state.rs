//! The state of the supervisor.

use crate::Real;
use crate::supervisor::ledger::Books;
use crate::supervisor::motion::Seen;
use crate::supervisor::pulse::Testing;
use crate::supervisor::recentre::{Recentre, Rest};
use crate::supervisor::{CALM, Phase, Reason, WhenLate};

/// The state of the supervisor from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SupervisorState<F> {
    /// Its phase.
    pub phase: Phase,
    /// Why it is faulted, or has faded out by itself.
    pub reason: Option<Reason>,
    /// A limit that was exceeded and only warns, since it was armed with this world.
    pub warning: Option<Reason>,
    /// From 0 to 1: how much of the command reaches the motor.
    pub gain: F,
    /// The device's position at which the world's is 0, in rad (linear: m).
    pub offset: F,
    /// The torque that was last commanded, in N·m (N).
    pub output: F,
    pub(crate) seen: Seen<F>,
    pub(crate) books: Books<F>,
    /// Of the motor and of its driver.
    pub(crate) heat: [F; 2],
    pub(crate) testing: Option<Testing<F>>,
    pub(crate) rest: Rest<F>,
    /// The world begins anew at the next sample.
    pub(crate) fresh: bool,
    /// Another world runs from the next sample on.
    pub(crate) swapped: bool,
    /// The puck's position in that world at the next sample; `None`: the origin stays.
    pub(crate) entry: Option<F>,
    /// Bumpless transfer: the remaining step in torque between two worlds, in N·m (N), and its decrease per sample.
    pub(crate) transfer: [F; 2],
    /// From 1 to 0: the remaining part of the braking after a fault.
    pub(crate) braking: F,
    /// Samples since the last one with a cause for a fault.
    pub(crate) calm: u32,
    /// Samples under a torque that came later than the certificate covers, or after a command that did.
    pub(crate) outside: u32,
}

impl<F: Real> SupervisorState<F> {
    /// Disarmed.
    pub const START: Self = SupervisorState {
        phase: Phase::Disarmed,
        reason: None,
        warning: None,
        gain: F::ZERO,
        offset: F::ZERO,
        output: F::ZERO,
        seen: Seen::NOTHING,
        books: Books::CLOSED,
        heat: [F::ZERO; 2],
        testing: None,
        rest: Rest::NONE,
        fresh: true,
        swapped: false,
        entry: None,
        transfer: [F::ZERO; 2],
        braking: F::ZERO,
        calm: 0,
        outside: 0,
    };

    /// From the next sample on the world and its supervisor are others; these are the periods of both, in s. The torque continues from its
    /// value and fades to the new world's; the energy that this has stored is credited to the ledger. A warning of the old world is
    /// cleared.
    pub fn swap(&mut self, before: F, after: F) {
        self.swapped = true;
        self.warning = None;
        self.seen.step = None;
        // The interval before the next sample is one of the old period.
        self.seen.late += after - before;
        self.seen.stand = self.seen.stand.at_period(before, after);
        self.books.reopen();
    }

    /// The same, and the world's origin is placed at the next sample so that the puck is at `at` in it ([`crate::Spec::entry`]), unless the
    /// device has a zero of its own, or that sample is a prescribed jump.
    pub fn enter(&mut self, before: F, after: F, at: F) {
        self.swap(before, after);
        self.entry = Some(at);
    }

    /// Whether the next sample places the origin.
    pub fn enters(&self) -> bool {
        self.entry.is_some()
    }

    /// The device had the command of the last sample this long after it, in s: the supervisor judges it at the next sample. A device that
    /// does not report a delay counts as on time.
    pub fn commanded(&mut self, delay: F) {
        self.seen.delay = delay;
    }

    /// Samples under a torque, since the start, that came later than the certificate covers or after a command that did.
    pub fn outside(&self) -> u32 {
        self.outside
    }

    /// Reports a sample that the certificate does not cover, before the sample at which the supervisor detects it, where its times are not
    /// known.
    pub fn lapse(&mut self, when_late: WhenLate) {
        if !self.phase.is_active() {
            return;
        }
        match when_late {
            WhenLate::Fault => self.fault(Reason::Uneven),
            WhenLate::Fade if self.phase != Phase::FadingOut => {
                (self.phase, self.reason) = (Phase::FadingOut, Some(Reason::Uneven));
            }
            WhenLate::Fade => {}
            WhenLate::Count => self.warning = self.warning.or(Some(Reason::Uneven)),
        }
    }

    /// The energy that the hand may still receive beyond the stored energy, in J; below 0 it received too much.
    pub fn account(&self) -> F {
        self.books.account
    }

    /// The energy that the integration method has generated, in J.
    pub fn made(&self) -> F {
        self.books.made
    }

    /// Lets the world's origin slip where the puck rests.
    #[inline]
    pub(crate) fn slip(&mut self, recentre: &Recentre<F>) {
        let step = self.seen.step.unwrap_or(F::ZERO);
        let origin = recentre.origin(&mut self.rest, self.offset, self.seen.position, step, self.books.torque());
        if origin != self.offset {
            self.books.slip(self.offset - origin);
            self.offset = origin;
        }
    }

    /// Whether this sample continues the last one: running, without a transfer, a test or a recent fault.
    #[inline(always)]
    pub(crate) fn is_steady(&self) -> bool {
        self.phase == Phase::Running
            && !self.fresh
            && !self.swapped
            && self.testing.is_none()
            && self.transfer[0] == F::ZERO
            && self.calm >= CALM
    }

    /// The torque of this command, outside a transfer between worlds.
    #[inline(always)]
    pub(crate) fn whole(&self, command: F) -> F {
        self.gain * command + self.transfer[0]
    }

    /// The device itself reports a fault: before the sample that shows it, and again before each sample while it lasts. The supervisor
    /// faults from any phase, nothing brakes the puck, and a clear counts only when the fault has been gone for some samples.
    pub fn trip(&mut self, reason: Reason) {
        self.fault(reason);
        (self.braking, self.calm) = (F::ZERO, 0);
    }

    /// Faults where there may be a torque; returns whether there may be one.
    #[cold]
    #[inline(never)]
    pub(crate) fn fault_where_active(&mut self, reason: Reason) -> bool {
        let active = self.phase.is_active();
        if active {
            self.fault(reason);
        }
        active
    }

    /// Faults, unless it is faulted already.
    #[cold]
    #[inline(never)]
    pub(crate) fn fault(&mut self, reason: Reason) {
        if self.phase != Phase::Faulted || reason == Reason::Stop {
            // No longer than a fade that is under way would have taken.
            self.braking = if reason.trusts_the_encoder() && self.phase.is_active() { self.gain } else { F::ZERO };
            (self.phase, self.reason) = (Phase::Faulted, Some(reason));
        }
    }
}
