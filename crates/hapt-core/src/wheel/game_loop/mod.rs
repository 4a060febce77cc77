//! The loop that a game closes: it computes a torque from the wheel's position, late and at a rate of its own.
//!
//! [`GameLoop`] finds that law from the levels and the motion, and adds the damping that it lacks, (T69), for the least device and the
//! worst law within their intervals. Where the wheel's swings gain more energy than the law explains, it adds the damping that they show.
//! Where no damper of this device gives enough, a part of the level is held back. Where a hand does the work that the damping would do,
//! both fade: the hand then feels the game's torque. An unidentified law changes nothing.

mod cost;
mod hand;
mod law;
mod swing;

pub use cost::{Damper, HostTime};
pub use law::GameLaw;

use super::{BLEND, Device, Refused};
use crate::Real;
use crate::contact::within;
use hand::{Hand, Works};
use law::{Memory, SPAN, Search};
use swing::Swings;

/// The largest torque that a count of the encoder may make through the damper, N·m: its velocity is smoothed accordingly.
const COUNT_STEP: f64 = 0.03;
/// The damper takes at most this part of the inertia, J/(B δ₁) of (T68).
const PART_OF_INERTIA: f64 = 0.25;
/// The ratio of the added damping to the lacking one.
const SPARE: f64 = 1.1;
/// The same for the damping that swings lose, which is found from few of them.
const SPARE_OF_SWINGS: f64 = 2.0;
/// The shortest rise time of a remedy, s.
const RISE: f64 = 0.05;
/// The part of the motor's limit from which on a level counts as the largest.
const LARGEST: f64 = 0.99;
/// The time constant in motion, s, with which the estimate of a more demanding law fades; the second applies where no law is identified any
/// more.
const BELIEF: [f64; 2] = [5.0, 1.0];
/// Steps of the search for the damping that pays for its own lateness too; it grows from below.
const ROUNDS: usize = 8;

/// Peculiarities of a game's levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Oddity {
    /// The torque pushes away from where the wheel was: no damping keeps such a wheel in the middle.
    Outward,
    /// It may be later than the range of the search.
    Late,
    /// The intervals differ by more than half of their mean.
    Uneven,
    /// The levels follow the motion in a small part only.
    Loose,
    /// The free wheel's swings gain more than the law explains.
    Swings,
}

/// The estimate of a game's loop, and the remedy, at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GameReport<F> {
    /// The estimated law; none where it is not identified.
    pub law: Option<GameLaw<F>>,
    /// Its peculiarity.
    pub oddity: Option<Oddity>,
    /// The damping that the law lacks on this device, hands-off, N·m·s/rad.
    pub lacking: F,
    /// The damping that is added, N·m·s/rad.
    pub damping: F,
    /// The part of the level that is held back, 0 to 1.
    pub held_back: F,
    /// The part of the remedy that remains with the hands on the wheel, 0 to 1; 1 hands-off.
    pub hands_off: F,
    /// The torque that is added to the game's, N·m.
    pub torque: F,
}

/// The wheel itself, including the damping and friction that a world uses. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotor {
    /// kg·m²: certainly not less than this.
    pub inertia: f64,
    /// N·m·s/rad
    pub damping: f64,
    /// N·m
    pub friction: f64,
}

/// The host's level at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostLevel<F> {
    /// Its level, N·m: the sum of the changes of the static torque by its reports.
    pub level: F,
    /// Whether the host has changed it.
    pub changed: bool,
    /// The present torque of constant, ramp and periodic effects, of which a part may be held back, N·m.
    pub torque: F,
}

/// Finds a game's law and keeps the free wheel from oscillating; compiled from a device.
#[derive(Clone, Copy, Debug)]
pub struct GameLoop<F> {
    search: Search<F>,
    hand: Hand<F>,
    /// A damper of 0, with the times and inertia of the device.
    damper: Damper<F>,
    device: F,
    /// The lateness that the loop adds to a host's: delay, lag, and the fading of a change, s.
    later: F,
    count: F,
    /// The largest damping that can be rendered, N·m·s/rad.
    most: F,
    /// The largest change of a torque in a second, N·m/s.
    slew: F,
    /// A level from this size on counts as the largest, N·m.
    largest: F,
    acts: bool,
}

/// The state, which changes from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GameLoopState<F> {
    memory: Memory<F>,
    works: Works<F>,
    swings: Swings<F>,
    last: Option<F>,
    velocity: F,
    /// The recent law that requires the most damping.
    dearest: Option<(F, HostTime<F>)>,
    /// Its requirement, hands-off: damping, and the part that is held back.
    wanted: (F, F),
    report: GameReport<F>,
}

impl<F: Real> GameReport<F> {
    /// No law is identified, and there is no remedy.
    pub const NOTHING: Self = GameReport {
        law: None,
        oddity: None,
        lacking: F::ZERO,
        damping: F::ZERO,
        held_back: F::ZERO,
        hands_off: F::ONE,
        torque: F::ZERO,
    };
}

impl<F: Real> GameLoopState<F> {
    /// The report of the last sample.
    pub fn report(&self) -> &GameReport<F> {
        &self.report
    }
}

impl<F: Real> GameLoop<F> {
    /// For a device, with the part of its damping that is left for effects, and its wheel. Without `acts` it only measures.
    ///
    /// # Errors
    /// Names the number that is out of range.
    pub fn new(device: &Device, rotor: &Rotor, acts: bool) -> Result<Self, Refused> {
        super::Wheel::<F>::new(device)?;
        let &Rotor { inertia, .. } = rotor;
        let is_resistance = |x: f64| x.is_finite() && x >= 0.0;
        let numbers = [
            ("inertia", inertia.is_finite() && inertia > 0.0),
            ("damping", is_resistance(rotor.damping)),
            ("friction", is_resistance(rotor.friction)),
        ];
        if let Some((name, _)) = numbers.iter().find(|(_, holds)| !holds) {
            return Err(Refused(name));
        }
        let of = F::from_f64;
        let fade = libm::exp(-device.timing.period / BLEND);
        let &Device { timing, damping, count, limit, .. } = device;
        let damper = Damper {
            damping: F::ZERO,
            inertia: of(inertia),
            period: of(timing.period),
            delay: of(timing.delay),
            lag: of(timing.lag),
            smoothing: F::ZERO,
        };
        Ok(GameLoop {
            search: Search::new(timing.period, count),
            hand: Hand::new(timing, rotor, count),
            damper,
            device: of(damping),
            later: of(timing.delay + timing.lag + timing.period / (1.0 - fade)),
            count: of(count),
            most: of(most_damping(inertia, timing.period, timing.delay + timing.lag, count)),
            slew: of(limit / RISE),
            largest: of(LARGEST * limit),
            acts,
        })
    }

    /// The largest damping that this device can render, N·m·s/rad.
    pub fn most_damping(&self) -> F {
        self.most
    }

    /// Before the first sample.
    pub fn start(&self) -> GameLoopState<F> {
        GameLoopState {
            memory: self.search.start(),
            works: self.hand.start(),
            swings: Swings::start(),
            last: None,
            velocity: F::ZERO,
            dearest: None,
            wanted: (F::ZERO, F::ZERO),
            report: GameReport::NOTHING,
        }
    }

    /// A sample: the torque to add to the game's, N·m, for the wheel's position in rad. A number that is not finite resets the state.
    pub fn step(&self, state: &mut GameLoopState<F>, position: F, host_level: HostLevel<F>) -> F {
        if !position.is_finite() {
            *state = self.start();
            return F::ZERO;
        }
        let travel = state.last.map_or(F::ZERO, |last| position - last);
        state.last = Some(position);
        let level = host_level.level.finite_or_zero();
        if let Some(estimate) = self.search.sample(&mut state.memory, position, level, host_level.changed) {
            self.judge(state, estimate);
        }
        let period = self.damper.period;
        let mut report = state.report;
        let interval = self.hand.interval(&mut state.works, travel);
        state.swings.sample(period, &interval, level, report.damping, report.held_back);
        report.hands_off = self.hand.leaves(&mut state.works, report.lacking);
        // A law at the motor's limit stays there while the wheel comes back from far out.
        let is_largest = host_level.torque.abs() >= self.largest;
        let live = self.acts && (is_largest || self.search.is_live(&state.memory));
        let (damping, held_back) = if live { state.wanted } else { (F::ZERO, F::ZERO) };
        // A remedy comes no faster than a torque may.
        let smoothing = self.smoothing(report.damping);
        state.velocity += period / (period + smoothing) * (travel / period - state.velocity);
        let speed = state.velocity.abs();
        let size = host_level.torque.abs();
        let slowed = |most: F, by: F| if most * by > self.slew * period { self.slew * period / by } else { most };
        let rise = period * F::from_f64(1.0 / RISE);
        report.damping += (damping * report.hands_off - report.damping).within(slowed(self.most * rise, speed));
        report.held_back += (held_back * report.hands_off - report.held_back).within(slowed(rise, size));
        report.torque = -(report.held_back * host_level.torque + report.damping * state.velocity);
        if !report.torque.is_finite() {
            *state = self.start();
            return F::ZERO;
        }
        state.report = report;
        report.torque
    }

    /// The whole torque that the motor has been commanded in this sample, N·m, from which a hand's work is computed.
    pub fn commanded(&self, state: &mut GameLoopState<F>, torque: F) {
        state.works.command(torque);
    }

    fn smoothing(&self, damping: F) -> F {
        let smoothing = damping * self.count * F::from_f64(1.0 / COUNT_STEP) - self.damper.period;
        if smoothing > F::ZERO { smoothing } else { F::ZERO }
    }

    fn damper(&self, damping: F) -> Damper<F> {
        Damper { damping, smoothing: self.smoothing(damping), ..self.damper }
    }

    /// Updates the law's requirement, by the estimate of a span.
    fn judge(&self, state: &mut GameLoopState<F>, estimate: Option<GameLaw<F>>) {
        state.report.law = estimate;
        state.report.oddity = estimate.as_ref().and_then(oddity);
        let belief = F::from_f64(if estimate.is_some() { BELIEF[0] } else { BELIEF[1] });
        let kept = belief / (belief + F::from_f64(SPAN));
        let believed = state.dearest.map(|(stiffness, host)| (stiffness * kept, host));
        let found = estimate.map(|law| {
            let (stiffness, host) = law.worst;
            (stiffness, HostTime { lateness: host.lateness + self.later, ..host })
        });
        let cost = |law: Option<(F, HostTime<F>)>| law.map_or(F::ZERO, |(stiffness, host)| stiffness * host.cost());
        state.dearest = if cost(believed) > cost(found) { believed } else { found };
        self.decide(state);
    }

    /// The damping that keeps the law from oscillating, by (T69), and the one that keeps the swings small; the greater of the two.
    fn decide(&self, state: &mut GameLoopState<F>) {
        let nothing = (F::ZERO, HostTime { hold: F::ZERO, lateness: F::ZERO });
        let (stiffness, host) = state.dearest.unwrap_or(nothing);
        let takes = state.swings.takes();
        let of_swings = takes * F::from_f64(SPARE_OF_SWINGS) - self.device;
        let lacking = larger(stiffness * host.cost(), takes) - self.device;
        let mut damping = F::ZERO;
        for _ in 0..ROUNDS {
            let next = self.damper(damping).lacking(self.device, &host, stiffness) * F::from_f64(SPARE);
            damping = within(next, F::ZERO, self.most);
        }
        damping = larger(damping, within(of_swings, F::ZERO, self.most));
        // (T69) at the resulting damping.
        let quiet = self.damper(damping).stiffness(self.device, &host);
        let of_law = if quiet < stiffness { F::ONE - quiet / stiffness } else { F::ZERO };
        let beyond = of_swings - self.most;
        let of_swings = if beyond > F::ZERO { beyond / (of_swings + self.device) } else { F::ZERO };
        state.wanted = (damping, larger(of_law, of_swings));
        state.report.lacking = if lacking > F::ZERO { lacking } else { F::ZERO };
        if state.report.oddity.is_none() && takes > stiffness * host.cost() && takes > self.device {
            state.report.oddity = Some(Oddity::Swings);
        }
    }
}

fn larger<F: Real>(one: F, other: F) -> F {
    if other > one { other } else { one }
}

fn oddity<F: Real>(law: &GameLaw<F>) -> Option<Oddity> {
    if law.stiffness_range[1] < F::ZERO {
        Some(Oddity::Outward)
    } else if law.beyond {
        Some(Oddity::Late)
    } else if law.uneven > F::HALF * law.hold {
        Some(Oddity::Uneven)
    } else if law.explained < F::HALF {
        Some(Oddity::Loose)
    } else {
        None
    }
}

/// B such that B δ₁ is the part of the inertia, with the velocity as smooth as the counts require.
fn most_damping(inertia: f64, period: f64, later: f64, count: f64) -> f64 {
    let part = PART_OF_INERTIA * inertia;
    let sharp = part / (later + 2.0 * period);
    let smooth = count / COUNT_STEP;
    if sharp * smooth <= period {
        return sharp;
    }
    let late = later + period;
    2.0 * part / (late + libm::sqrt(late * late + 4.0 * smooth * part))
}
