//! The checks of a single reading: numbers, times, and whether a puck can have moved that way.

use crate::supervisor::standing::{Stand, Standing};
use crate::supervisor::{Limits, Reading, Reason, are_finite};
use crate::{Constants, Real, Spec};

/// The limits of a reading, in the displacement of one sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReadingLimits<F> {
    period: F,
    /// The largest displacement of a sample, without the encoder's own.
    velocity: F,
    overspeed: F,
    /// The largest change of it, with the encoder's own.
    jump: F,
    count: F,
    stall: F,
    link: F,
    friction: F,
    standing: Standing<F>,
    ordinary: Ordinary<F>,
}

/// Bounds within which a reading needs no further check: each is as tight as the tightest of its limits, and none is infinite.
#[derive(Clone, Copy, Debug)]
struct Ordinary<F> {
    distance: F,
    jump: F,
    late: F,
    /// The longest interval and delay that the certificate covers, with their rounding.
    interval: F,
    delay: F,
    silent: F,
}

/// The memory of the last reading.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Seen<F> {
    /// The last position that was a number.
    pub position: F,
    /// The displacement a period, where two positions were seen; else nothing.
    pub step: Option<F>,
    /// Whether one was.
    known: bool,
    /// The lateness of the last sample, in s.
    pub late: F,
    /// From the last sample to when the device had its command, in s.
    pub delay: F,
    /// The effect that the torque should have had since it last moved.
    pub stand: Stand<F>,
}

impl<F: Real> Seen<F> {
    pub const NOTHING: Self =
        Seen { position: F::ZERO, step: None, known: false, late: F::ZERO, delay: F::ZERO, stand: Stand::NONE };
}

impl<F: Real> ReadingLimits<F> {
    pub fn new(limits: &Limits, spec: &Spec) -> Self {
        let f = F::from_f64;
        let count = spec.count.unwrap_or(0.0);
        let finite = |x: f64| f(x).within(F::MAX);
        let slow = f(limits.velocity.min(limits.overspeed) * spec.period) + f(count);
        let jump = limits.jump + 2.0 * count;
        let rounding = 1.0 + 8.0 * F::EPSILON.to_f64();
        let (interval, delay) = (limits.time.interval * rounding, limits.time.delay * rounding);
        let ordinary = Ordinary {
            distance: slow.within(F::MAX),
            jump: finite(jump),
            late: finite(limits.stall),
            interval: finite(interval),
            delay: finite(delay),
            silent: finite(limits.silence(spec.period)),
        };
        ReadingLimits {
            period: f(spec.period),
            velocity: f(limits.velocity * spec.period),
            overspeed: f(limits.overspeed * spec.period),
            jump: f(jump),
            count: f(count),
            stall: f(limits.stall),
            link: f(limits.silence(spec.period)),
            friction: f(limits.friction),
            standing: Standing::new(limits, spec),
            ordinary,
        }
    }

    pub fn constants(&self, to: &mut dyn Constants) {
        let Ordinary { distance, jump, late, interval, delay, silent } = self.ordinary;
        for (name, about, value) in [
            ("velocity", "the largest displacement of a sample", self.velocity),
            ("overspeed", "the same with the motor on", self.overspeed),
            ("jump", "the largest change of it", self.jump),
            ("size", "one count of the encoder; 0: ideal", self.count),
            ("stall", "the latest sample, s", self.stall),
            ("link", "the longest silence of the link, s", self.link),
            ("friction", "of the device", self.friction),
            ("ordinary_distance", "within all of these no other look is needed", distance),
            ("ordinary_jump", "", jump),
            ("ordinary_late", "s", late),
            ("ordinary_interval", "s", interval),
            ("ordinary_delay", "s", delay),
            ("ordinary_silent", "s", silent),
        ] {
            to.number(name, about, value.to_f64());
        }
        self.standing.constants(to);
    }

    /// Whether a reading is ordinary: within every limit, on time, the link alive. Then it is recorded in `seen`. Otherwise `seen` is
    /// unchanged, and [`ReadingLimits::wrong`] gives the reason.
    #[inline(always)]
    pub fn is_ordinary(&self, seen: &mut Seen<F>, reading: &Reading<F>, held: F) -> bool {
        let (step, within) = (reading.position - seen.position, &self.ordinary);
        let Some(last) = &mut seen.step else { return false };
        if reading.missed > 0 || reading.announced {
            return false;
        }
        // Written so that a NaN is outside every limit.
        let moves =
            step.abs() <= within.distance && (step - *last).abs() <= within.jump && reading.velocity.is_finite();
        if !moves {
            return false;
        }
        let arrives = reading.late.abs() <= within.late && reading.silent.abs() <= within.silent;
        let keeps_time = self.period + (reading.late - seen.late) <= within.interval && seen.delay <= within.delay;
        if !(arrives && keeps_time) {
            return false;
        }
        let mut stand = Stand::NONE;
        if step == F::ZERO && self.standing.counts(&seen.stand, held) {
            let (next, is_stuck) = self.standing.after(&seen.stand, held, 1, F::ONE);
            if is_stuck {
                return false;
            }
            stand = next;
        }
        (seen.position, *last, seen.stand) = (reading.position, step, stand);
        (seen.late, seen.delay) = (reading.late, F::ZERO);
        true
    }

    /// Whether the interval before this sample, and the command of the sample before it, are within what the certificate covers.
    #[inline(never)]
    pub fn keeps_time(&self, seen: &mut Seen<F>, reading: &Reading<F>) -> bool {
        let periods = F::ONE + F::from_f64(f64::from(reading.missed));
        let interval = periods * self.period + (reading.late - seen.late);
        let keeps = interval <= self.ordinary.interval && seen.delay <= self.ordinary.delay;
        (seen.late, seen.delay) = (reading.late.finite_or_zero(), F::ZERO);
        keeps
    }

    /// The fault of a reading under the torque `held` since the last; a lost link is checked separately.
    #[inline(never)]
    pub fn wrong(&self, seen: &mut Seen<F>, reading: &Reading<F>, announced: bool, held: F) -> Option<Reason> {
        if !are_finite([reading.position, reading.velocity, reading.late, reading.silent]) {
            return Some(Reason::NotFinite);
        }
        match reading.missed {
            // Compiled separately for no missed sample, the usual case.
            0 => self.moved(seen, reading, announced, held, F::ZERO),
            missed => self.moved(seen, reading, announced, held, F::from_f64(f64::from(missed))),
        }
    }

    /// The same for finite numbers, after `missed` missed samples.
    #[inline(always)]
    fn moved(&self, seen: &mut Seen<F>, reading: &Reading<F>, announced: bool, held: F, missed: F) -> Option<Reason> {
        let periods = F::ONE + missed;
        let (distance, known) = (reading.position - seen.position, seen.known);
        (seen.position, seen.known) = (reading.position, true);
        let stands = distance == F::ZERO && !announced;
        let samples = reading.missed.saturating_add(1);
        let is_stuck;
        (seen.stand, is_stuck) =
            if stands { self.standing.after(&seen.stand, held, samples, periods) } else { (Stand::NONE, false) };
        let late = reading.late.abs() + missed * self.period > self.stall;
        if !known || announced {
            // A jump has no velocity, before or after.
            seen.step = known.then_some(F::ZERO);
            return late.then_some(Reason::Late);
        }
        let step = distance / periods;
        let before = seen.step.replace(step);
        let size = distance.abs();
        let jumped = reading.missed == 0 && before.is_some_and(|before| (step - before).abs() > self.jump);
        let runs_away = size > self.overspeed * periods + self.count && held.abs() > self.friction;
        if jumped {
            Some(Reason::Jump)
        } else if runs_away && self.velocity <= self.overspeed {
            // One speed for both: with the motor on it is the puck that is too fast, not the reading.
            Some(Reason::Overspeed)
        } else if size > self.velocity * periods + self.count {
            Some(Reason::Velocity)
        } else if runs_away {
            Some(Reason::Overspeed)
        } else if late {
            Some(Reason::Late)
        } else if is_stuck {
            Some(Reason::Stuck)
        } else {
            None
        }
    }

    /// The longest interval that the certificate covers, in s; infinite where none is stated.
    pub fn longest_interval(&self) -> F {
        if self.ordinary.interval < F::MAX { self.ordinary.interval } else { F::from_f64(f64::INFINITY) }
    }

    /// Whether the heartbeat of the client in control has timed out.
    pub fn link_is_lost(&self, reading: &Reading<F>) -> bool {
        reading.silent > self.link
    }
}
