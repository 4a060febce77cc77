//! The supervisor: what stands between a loop's command and a motor, sample by sample.
//!
//! A [`Supervisor`] is the limits, compiled once; a [`Watch`] is everything that it remembers, one `Copy` struct. It runs the loop
//! itself, so that no torque reaches the motor but through it:
//!
//! ```text
//! disarmed --arm--> fading in --> running --disarm--> fading out --> disarmed
//!     any of them --fault--> faulted --clear, the cause gone--> disarmed
//! ```
//!
//! Each sample looks at the reading (`motion.rs`), steps the world, books its energies (`energy.rs`, `ledger.rs`), and looks at the
//! torque. A fault takes the torque away at the sample that shows it.

mod energy;
mod ledger;
mod limits;
mod motion;
mod phase;
mod pulse;
mod reason;
mod springs;
mod standing;
mod thermal;
mod watch;

use crate::{Error, Loop, Real, Sample, Spec, State};
use energy::Energy;
use ledger::Ledger;
pub use limits::{Guarding, Heat, Limits};
use motion::Motion;
pub use phase::{Guarded, Phase, Reading, Request};
use pulse::{Answer, Pulse, Testing};
pub use reason::Reason;
use standing::Stand;
use thermal::Thermal;
pub use watch::Watch;

/// Samples without anything wrong after which a cause counts as gone.
const CALM: u32 = 16;

/// Whether all of them are finite: then 0 times all of them is 0, and else it is no number.
fn are_finite<F: Real, const N: usize>(numbers: [F; N]) -> bool {
    numbers.iter().fold(F::ZERO, |zero, x| zero * *x) == F::ZERO
}

/// What a reading and a request come to.
#[derive(Clone, Copy)]
struct Look {
    wrong: Option<Reason>,
    /// The world waits at its start, and nothing is booked.
    waits: bool,
    /// The torque may leap.
    leaps: bool,
}

impl Look {
    const ORDINARY: Self = Look { wrong: None, waits: false, leaps: false };
}

/// The limits, compiled once, for a loop with room for B bodies and C couplings.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor<F, const B: usize, const C: usize> {
    /// 1/samples of a fade.
    fade: F,
    motion: Motion<F>,
    energy: Energy<F, B, C>,
    ledger: Ledger<F>,
    motor: Thermal<F>,
    driver: Thermal<F>,
    pulse: Option<Pulse<F>>,
    torque: F,
    slew: F,
    /// Torque per displacement of a sample after a fault; 0: none.
    brake: F,
    link_faults: bool,
    world_trips: bool,
    port_trips: bool,
    zero_where_armed: bool,
    announcements: bool,
}

impl<F: Real, const B: usize, const C: usize> Supervisor<F, B, C> {
    /// A supervisor of the loop of `spec`. Errors where a limit is out of range, or the loop has no room for the world.
    pub fn new(limits: &Limits, spec: &Spec) -> Result<Self, Error> {
        limits.check(spec)?;
        if spec.bodies.len() > B {
            return Err(Error::TooManyBodies { given: spec.bodies.len(), room: B });
        }
        if spec.couplings.len() > C {
            return Err(Error::TooManyCouplings { given: spec.couplings.len(), room: C });
        }
        let f = F::from_f64;
        let periods = limits.delay / spec.period;
        // A differenced damper that is a sample and the delay late is stable below J/(T(1 + 2 delays)); a quarter of that is calm.
        let most = 0.25 * limits.inertia / (spec.period * (1.0 + 2.0 * periods));
        let brake = if limits.brake < most { limits.brake } else { most };
        let fade = libm::ceil(limits.fade / spec.period);
        Ok(Supervisor {
            fade: f(1.0 / fade),
            motion: Motion::new(limits, spec),
            energy: Energy::new(spec),
            ledger: Ledger::new(limits, spec.period, periods),
            motor: Thermal::new(&limits.motor, spec.period),
            driver: Thermal::new(&limits.driver, spec.period),
            pulse: Pulse::new(limits, spec),
            // A limit rounded to this number is no fault.
            torque: f(limits.torque * (1.0 + 8.0 * F::EPSILON.to_f64())),
            slew: f(limits.slew),
            brake: f(brake / spec.period),
            link_faults: limits.link_faults,
            world_trips: limits.world_trips,
            port_trips: limits.port_trips,
            zero_where_armed: limits.zero_where_armed,
            announcements: limits.announcements,
        })
    }

    /// One sample of `world`, guarded.
    ///
    /// Written for the sample that is like the last: the torque is all there, nobody asks for anything, and nothing is wrong. Whatever
    /// else there may be is looked at out of line, by all the same rules.
    pub fn step<const W: usize>(
        &self,
        watch: &mut Watch<F>,
        world: &Loop<F, B, C, W>,
        state: &mut State<F, B, C, W>,
        reading: &Reading<F>,
        request: Option<Request>,
    ) -> Guarded<F> {
        let ordinary =
            request.is_none() && watch.is_steady() && self.motion.is_ordinary(&mut watch.seen, reading, watch.output);
        let look = if ordinary { Look::ORDINARY } else { self.look(watch, world, state, reading, request) };
        // A reading that is no number is not shown to the world.
        let velocity = reading.velocity.finite_or_zero();
        let sample = world.sample(state, watch.seen.position - watch.offset, velocity);
        if !look.waits {
            self.book(watch, state, &sample, reading);
        }
        let whole = watch.whole(sample.command);
        let goes_on = ordinary && watch.phase == Phase::Running && (whole - watch.output).abs() <= self.slew;
        let held = if goes_on { whole } else { self.held(watch, &sample, look) };
        let mut output = held;
        if self.motor.warm(&mut watch.heat[0], held) && watch.fault_where_active(Reason::Heat) {
            output = F::ZERO;
        }
        if self.driver.warm(&mut watch.heat[1], held) && watch.fault_where_active(Reason::DriverHeat) {
            output = F::ZERO;
        }
        watch.output = output;
        let Watch { phase, reason, warning, .. } = *watch;
        Guarded { sample, output, phase, reason, warning }
    }

    /// A sample that is not like the last, before the world takes it.
    #[cold]
    #[inline(never)]
    fn look<const W: usize>(
        &self,
        watch: &mut Watch<F>,
        world: &Loop<F, B, C, W>,
        state: &mut State<F, B, C, W>,
        reading: &Reading<F>,
        request: Option<Request>,
    ) -> Look {
        let announced = reading.announced && self.announcements;
        let wrong = self.motion.wrong(&mut watch.seen, reading, announced, watch.output);
        if wrong.is_some() {
            watch.calm = 0;
        } else if watch.calm < CALM {
            watch.calm += 1;
        }
        self.ask(watch, request, wrong, self.motion.link_is_lost(reading), announced);

        let testing = watch.testing.is_some();
        let waits = !watch.phase.is_active() || testing;
        if waits || watch.fresh {
            *state = world.start();
            watch.books.reopen();
            watch.fresh = false;
        }
        Look { wrong, waits, leaps: announced || testing }
    }

    /// What somebody asks for, and what the reading says.
    fn ask(&self, watch: &mut Watch<F>, request: Option<Request>, wrong: Option<Reason>, lost: bool, announced: bool) {
        if let Some(request) = request {
            self.answer(watch, request, wrong, lost, announced);
        }
        if !watch.phase.is_active() {
            return;
        }
        if let Some(reason) = wrong {
            watch.fault(reason);
        } else if lost && self.link_faults {
            watch.fault(Reason::Link);
        } else if lost && watch.phase != Phase::FadingOut {
            (watch.phase, watch.reason) = (Phase::FadingOut, Some(Reason::Link));
        }
    }

    #[inline(never)]
    fn answer(&self, watch: &mut Watch<F>, request: Request, wrong: Option<Reason>, lost: bool, announced: bool) {
        match (request, watch.phase) {
            (Request::Stop, _) => {
                watch.fault(Reason::Stop);
                watch.calm = 0;
            }
            (Request::Arm, Phase::Disarmed | Phase::FadingOut) => match wrong {
                Some(reason) => watch.fault(reason),
                None if lost => watch.reason = Some(Reason::Link),
                None => self.arm(watch, announced),
            },
            (Request::Disarm, Phase::FadingIn | Phase::Running) => watch.phase = Phase::FadingOut,
            (Request::Clear, Phase::Faulted) if self.is_over(watch, lost) => {
                (watch.phase, watch.reason) = (Phase::Disarmed, None);
            }
            (Request::Arm, Phase::FadingIn | Phase::Running | Phase::Faulted)
            | (Request::Disarm, Phase::Disarmed | Phase::FadingOut | Phase::Faulted)
            | (
                Request::Clear,
                Phase::Disarmed | Phase::FadingIn | Phase::Running | Phase::FadingOut | Phase::Faulted,
            ) => {}
        }
    }

    /// `announced`: a scenario says where the puck is, from the world's own 0.
    fn arm(&self, watch: &mut Watch<F>, announced: bool) {
        (watch.reason, watch.warning) = (None, None);
        if watch.phase == Phase::Disarmed {
            watch.fresh = true;
            watch.seen.stand = Stand::NONE;
            watch.testing = self.pulse.map(|_| Testing::BEGIN);
            if !announced {
                self.home(watch);
            }
        }
        watch.phase = Phase::FadingIn;
    }

    fn home(&self, watch: &mut Watch<F>) {
        if self.zero_where_armed {
            watch.offset = watch.seen.position;
        }
    }

    /// What it can do beyond its limits: test the sign when armed, and keep the account at the port.
    pub fn watches(&self) -> [bool; 2] {
        [self.pulse.is_some(), self.ledger.keeps_account()]
    }

    /// Whether the cause of a fault is gone.
    fn is_over(&self, watch: &Watch<F>, lost: bool) -> bool {
        let [motor, driver] = watch.heat;
        let cool = self.motor.has_cooled(motor) && self.driver.has_cooled(driver);
        match watch.reason {
            Some(Reason::Heat | Reason::DriverHeat) => cool,
            Some(Reason::Link) => !lost,
            None
            | Some(
                Reason::Stop
                | Reason::NotFinite
                | Reason::Jump
                | Reason::Velocity
                | Reason::Stuck
                | Reason::Torque
                | Reason::Slew
                | Reason::Overspeed
                | Reason::Late
                | Reason::PortEnergy
                | Reason::WorldEnergy
                | Reason::Reversed
                | Reason::Driver,
            ) => watch.calm >= CALM,
        }
    }

    /// The world's numbers and energies.
    #[inline(always)]
    fn book<const W: usize>(
        &self,
        watch: &mut Watch<F>,
        state: &State<F, B, C, W>,
        sample: &Sample<F>,
        reading: &Reading<F>,
    ) {
        let puck = (sample.puck.position, sample.puck.velocity);
        let step = self.energy.step(state, puck);
        if !are_finite([sample.torque, step.stored, step.made]) {
            watch.fault(Reason::NotFinite);
            return;
        }
        let torque = sample.torque - self.energy.constant;
        self.ledger.enter(&mut watch.books, &step, puck.0, torque, reading.missed);
        // Written so that what is no number is within nothing.
        let within = watch.books.account >= F::ZERO && watch.books.made <= self.ledger.most;
        if !within {
            self.overdraw(watch);
        }
        if sample.command.abs() > self.torque {
            watch.fault(Reason::Torque);
        }
    }

    /// One of the ledgers is beyond its bound.
    #[cold]
    #[inline(never)]
    fn overdraw(&self, watch: &mut Watch<F>) {
        let (in_account, within) = (watch.books.account >= F::ZERO, watch.books.made <= self.ledger.most);
        for (right, trips, reason) in
            [(in_account, self.port_trips, Reason::PortEnergy), (within, self.world_trips, Reason::WorldEnergy)]
        {
            if !right && trips {
                watch.fault(reason);
            } else if !right {
                watch.warning = Some(reason);
            }
        }
    }

    /// The torque that the motor is to hold, where it is not just the world's command.
    #[cold]
    #[inline(never)]
    fn held(&self, watch: &mut Watch<F>, sample: &Sample<F>, look: Look) -> F {
        let wanted = self.wanted(watch, sample);
        if (wanted - watch.output).abs() > self.slew && !look.leaps {
            watch.fault_where_active(Reason::Slew);
        }
        if watch.phase == Phase::Faulted { self.braked(watch, look.wrong) } else { wanted }
    }

    /// What the phase makes of the world's command, and the phase after this sample.
    fn wanted(&self, watch: &mut Watch<F>, sample: &Sample<F>) -> F {
        let before = watch.gain;
        if watch.phase != Phase::Running {
            if !watch.phase.is_active() {
                (watch.gain, watch.testing, watch.carry, watch.swapped) = (F::ZERO, None, [F::ZERO; 2], false);
                return F::ZERO;
            }
            if let (Some(testing), Some(pulse), Phase::FadingIn) = (watch.testing.as_mut(), &self.pulse, watch.phase) {
                match pulse.sample(testing, watch.seen.position) {
                    Answer::Torque(torque) => return torque,
                    Answer::Right => {
                        (watch.testing, watch.fresh) = (None, true);
                        self.home(watch);
                    }
                    Answer::Wrong(reason) => watch.fault(reason),
                }
                return F::ZERO;
            }
            watch.gain += if watch.phase == Phase::FadingIn { self.fade } else { -self.fade };
            // A sum of many parts is near a whole, not one.
            let near = F::HALF * self.fade;
            if watch.gain > F::ONE - near {
                (watch.gain, watch.phase) = (F::ONE, Phase::Running);
            } else if watch.gain < near {
                (watch.gain, watch.phase, watch.testing) = (F::ZERO, Phase::Disarmed, None);
                return F::ZERO;
            }
        }
        let wanted = watch.gain * sample.command;
        let [carry, part] = watch.carry;
        if watch.swapped {
            let carry = watch.output - wanted;
            (watch.carry, watch.swapped) = ([carry, carry * self.fade], false);
        } else if carry != F::ZERO {
            let gone = carry.abs() <= part.abs();
            let left = if gone { F::ZERO } else { carry - part };
            // It leaves with the torque that fades out.
            let left = if watch.phase == Phase::FadingOut { left * (watch.gain / before) } else { left };
            watch.carry[0] = left;
        } else {
            // The command is within it, or has faulted.
            return watch.whole(sample.command);
        }
        (wanted + watch.carry[0]).within(self.torque)
    }

    /// The torque after a fault: none, or what brings the puck to rest over a fade's time.
    fn braked(&self, watch: &mut Watch<F>, wrong: Option<Reason>) -> F {
        if watch.braking < F::HALF * self.fade || self.brake <= F::ZERO {
            return F::ZERO;
        }
        // The speed that made it fault may be believed; a reading that is wrong since may not.
        if wrong.is_some_and(|reason| !reason.trusts_the_encoder()) {
            watch.braking = F::ZERO;
            return F::ZERO;
        }
        watch.braking -= self.fade;
        if watch.braking < F::HALF * self.fade {
            return F::ZERO;
        }
        let step = watch.seen.step.unwrap_or(F::ZERO);
        -(self.brake * step * watch.braking).within(self.torque)
    }
}
