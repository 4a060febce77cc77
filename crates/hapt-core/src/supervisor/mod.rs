//! The supervisor: it checks every sample between the loop's command and the motor.
//!
//! A [`Supervisor`] holds the limits, compiled once; a [`SupervisorState`] is its state, one `Copy` struct. The supervisor runs the
//! loop, so that every torque passes its checks:
//!
//! ```text
//! disarmed --arm--> fading in --> running --disarm--> fading out --> disarmed
//!     any of them --fault--> faulted --clear, the cause gone--> disarmed
//! ```
//!
//! Each sample checks the reading (`motion.rs`), steps the world, books its energies (`energy.rs`, `ledger.rs`), and checks the
//! torque. A fault removes the torque at the sample that shows it.

mod energy;
mod ledger;
mod limits;
mod motion;
mod phase;
mod pulse;
mod reason;
mod recentre;
mod springs;
mod standing;
mod state;
mod sums;
mod thermal;

use crate::{Constants, Error, Loop, Puck, Real, Sample, Spec, State};
use energy::Energy;
use ledger::Ledger;
pub use limits::{CertifiedTime, Heat, Limits, SafetyProfile, WhenLate};
use motion::ReadingLimits;
pub use phase::{ExternalTorqueInput, Phase, Reading, Request, SafeOutput};
use pulse::{Pulse, SignTest, Testing};
pub use reason::Reason;
use recentre::Recentre;
use standing::Stand;
pub use state::SupervisorState;
use thermal::Thermal;

/// Number of faultless samples after which a cause counts as gone.
const CALM: u32 = 16;

/// Whether all are finite: 0 times a finite number is 0, and 0 times any other is NaN.
fn are_finite<F: Real, const N: usize>(numbers: [F; N]) -> bool {
    numbers.iter().fold(F::ZERO, |zero, x| zero * *x) == F::ZERO
}

/// The evaluation of a reading and a request.
#[derive(Clone, Copy)]
struct Evaluation {
    wrong: Option<Reason>,
    /// The world stays at its start, and no energy is booked.
    is_idle: bool,
    /// The torque may jump.
    may_jump: bool,
    /// The certificate does not cover the sample.
    is_uncertified: bool,
}

impl Evaluation {
    const ORDINARY: Self = Evaluation { wrong: None, is_idle: false, may_jump: false, is_uncertified: false };
}

/// The limits, compiled once, for a loop with a capacity of B bodies and C couplings.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor<F, const B: usize, const C: usize> {
    /// 1/samples of a fade.
    fade: F,
    motion: ReadingLimits<F>,
    energy: Energy<F, B, C>,
    ledger: Ledger<F>,
    motor: Thermal<F>,
    driver: Thermal<F>,
    pulse: Option<Pulse<F>>,
    recentre: Option<Recentre<F>>,
    torque: F,
    slew: F,
    /// Torque per displacement of a sample after a fault; 0: none.
    brake: F,
    when_late: WhenLate,
    link_faults: bool,
    world_trips: bool,
    port_trips: bool,
    zero_where_armed: bool,
    announcements: bool,
}

impl<F: Real, const B: usize, const C: usize> Supervisor<F, B, C> {
    /// A supervisor of the loop of `spec`. Errors where a limit is out of range, or the world exceeds the loop's capacity.
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
        // No limit of the supervisor widens the motor's.
        let ceiling = spec.limit.unwrap_or(f64::INFINITY);
        Ok(Supervisor {
            fade: f(1.0 / fade),
            motion: ReadingLimits::new(limits, spec),
            energy: Energy::new(spec),
            ledger: Ledger::new(limits, spec),
            motor: Thermal::new(&limits.motor, spec.period),
            driver: Thermal::new(&limits.driver, spec.period),
            pulse: Pulse::new(&Limits { pulse: limits.pulse.min(ceiling), ..*limits }, spec),
            recentre: Recentre::new(limits, spec),
            // A limit rounded to this number is no fault.
            torque: f(limits.torque.min(ceiling) * (1.0 + 8.0 * F::EPSILON.to_f64())),
            slew: f(limits.slew),
            brake: f(brake / spec.period),
            when_late: limits.time.when_late,
            link_faults: limits.link_faults,
            world_trips: limits.world_trips,
            port_trips: limits.port_trips,
            zero_where_armed: limits.zero_where_armed,
            announcements: limits.announcements,
        })
    }

    /// All numbers that it compares and counts with.
    pub fn constants(&self, to: &mut dyn Constants) {
        to.number("fade", "1 over the samples of a fade", self.fade.to_f64());
        self.motion.constants(to);
        self.energy.constants(to);
        self.ledger.constants(to);
        self.motor.constants(to, "motor_part", "motor_most");
        self.driver.constants(to, "driver_part", "driver_most");
        if let Some(pulse) = &self.pulse {
            pulse.constants(to);
        }
        if let Some(recentre) = &self.recentre {
            recentre.constants(to);
        }
        to.number("torque", "the largest command", self.torque.to_f64());
        to.number("slew", "the largest change of torque in a sample", self.slew.to_f64());
        to.number("brake", "torque per displacement of a sample after a fault; 0: none", self.brake.to_f64());
        to.whole("when_late", "beyond the certified times: 0 fault, 1 fade, 2 count", i64::from(self.when_late as u8));
        to.whole("link_faults", "whether a lost link is a fault", i64::from(self.link_faults));
        to.whole("world_trips", "whether the world's ledger trips", i64::from(self.world_trips));
        to.whole("port_trips", "whether the ledger at the port trips", i64::from(self.port_trips));
        to.whole("zero_where_armed", "whether arming sets the position to 0", i64::from(self.zero_where_armed));
    }

    /// One sample of `world`, guarded.
    ///
    /// The fast path is the ordinary sample: fully faded in, without a request, within every limit. Every other sample takes a slower
    /// path with the same rules.
    pub fn step<const W: usize>(
        &self,
        state: &mut SupervisorState<F>,
        world: &Loop<F, B, C, W>,
        loop_state: &mut State<F, B, C, W>,
        reading: &Reading<F>,
        request: Option<Request>,
    ) -> SafeOutput<F> {
        self.guarded(state, world, loop_state, reading, request, |_| None)
    }

    /// The same with an external torque on the puck, a function of the measured position: it is added to the world's before levels and
    /// limit. The ledgers count only the world. `None`: no external torque, with the same bits as without one.
    pub fn step_with<const W: usize>(
        &self,
        state: &mut SupervisorState<F>,
        world: &Loop<F, B, C, W>,
        loop_state: &mut State<F, B, C, W>,
        reading: &Reading<F>,
        request: Option<Request>,
        torque: impl FnOnce(ExternalTorqueInput<F>) -> Option<F>,
    ) -> SafeOutput<F> {
        self.guarded(state, world, loop_state, reading, request, torque)
    }

    #[inline(always)]
    fn guarded<const W: usize>(
        &self,
        state: &mut SupervisorState<F>,
        world: &Loop<F, B, C, W>,
        loop_state: &mut State<F, B, C, W>,
        reading: &Reading<F>,
        request: Option<Request>,
        external: impl FnOnce(ExternalTorqueInput<F>) -> Option<F>,
    ) -> SafeOutput<F> {
        let ordinary =
            request.is_none() && state.is_steady() && self.motion.is_ordinary(&mut state.seen, reading, state.output);
        let evaluation =
            if ordinary { Evaluation::ORDINARY } else { self.evaluate(state, world, loop_state, reading, request) };
        if let (true, Some(recentre)) = (ordinary, &self.recentre) {
            state.slip(recentre);
        }
        // A NaN never enters the world.
        let velocity = reading.velocity.finite_or_zero();
        let mut sample = world.step(loop_state, state.seen.position - state.offset, velocity);
        let Puck { position, velocity } = sample.puck;
        let seen = ExternalTorqueInput { ready: !evaluation.is_idle, position, velocity, torque: sample.torque };
        if let Some(torque) = external(seen) {
            if !are_finite([torque]) {
                state.fault_where_active(Reason::NotFinite);
            }
            sample.command = world.command(sample.torque + torque.finite_or_zero());
        }
        if !evaluation.is_idle {
            self.book(state, loop_state, &sample, reading);
        }
        let whole = state.whole(sample.command);
        let goes_on = ordinary && state.phase == Phase::Running && (whole - state.output).abs() <= self.slew;
        let held = if goes_on { whole } else { self.held(state, &sample, evaluation) };
        let mut output = held;
        if self.motor.warm(&mut state.heat[0], held) && state.fault_where_active(Reason::Heat) {
            output = F::ZERO;
        }
        if self.driver.warm(&mut state.heat[1], held) && state.fault_where_active(Reason::DriverHeat) {
            output = F::ZERO;
        }
        state.output = output;
        let SupervisorState { phase, reason, warning, .. } = *state;
        SafeOutput { sample, output, phase, reason, warning, outside: evaluation.is_uncertified }
    }

    /// A sample that is not like the last, before the world takes it.
    #[cold]
    #[inline(never)]
    fn evaluate<const W: usize>(
        &self,
        state: &mut SupervisorState<F>,
        world: &Loop<F, B, C, W>,
        loop_state: &mut State<F, B, C, W>,
        reading: &Reading<F>,
        request: Option<Request>,
    ) -> Evaluation {
        state.rest.samples = 0;
        let announced = reading.announced && self.announcements;
        let keeps_time = self.motion.keeps_time(&mut state.seen, reading);
        let wrong = self.motion.wrong(&mut state.seen, reading, announced, state.output);
        if wrong.is_some() || (!keeps_time && self.when_late == WhenLate::Fault) {
            state.calm = 0;
        } else if state.calm < CALM {
            state.calm += 1;
        }
        // Without a torque before it, a late sample has no effect.
        let is_uncertified = !keeps_time && state.phase.is_active();
        self.ask(state, request, wrong, self.motion.link_is_lost(reading), announced);
        if is_uncertified {
            state.outside = state.outside.saturating_add(1);
            state.lapse(self.when_late);
        }

        let testing = state.testing.is_some();
        let is_idle = !state.phase.is_active() || testing;
        if is_idle || state.fresh {
            *loop_state = world.start();
            state.books.reopen();
            state.fresh = false;
        }
        if let Some(at) = state.entry.take() {
            // Arming sets the zero while there is no torque yet.
            if !is_idle && !announced && self.zero_where_armed {
                let position = state.seen.position;
                world.sensor.place(&mut loop_state.memory, position - state.offset, at);
                state.offset = position - at;
                state.rest.origin_is_set();
            }
        }
        Evaluation { wrong, is_idle, may_jump: announced || testing, is_uncertified }
    }

    /// Handles the request and the result of the reading.
    fn ask(
        &self,
        state: &mut SupervisorState<F>,
        request: Option<Request>,
        wrong: Option<Reason>,
        lost: bool,
        announced: bool,
    ) {
        if let Some(request) = request {
            self.handle(state, request, wrong, lost, announced);
        }
        if !state.phase.is_active() {
            return;
        }
        if let Some(reason) = wrong {
            state.fault(reason);
        } else if lost && self.link_faults {
            state.fault(Reason::Link);
        } else if lost && state.phase != Phase::FadingOut {
            (state.phase, state.reason) = (Phase::FadingOut, Some(Reason::Link));
        }
    }

    #[inline(never)]
    fn handle(
        &self,
        state: &mut SupervisorState<F>,
        request: Request,
        wrong: Option<Reason>,
        lost: bool,
        announced: bool,
    ) {
        match (request, state.phase) {
            (Request::Stop, _) => {
                state.fault(Reason::Stop);
                state.calm = 0;
            }
            (Request::Arm, Phase::Disarmed | Phase::FadingOut) => match wrong {
                Some(reason) => state.fault(reason),
                None if lost => state.reason = Some(Reason::Link),
                None => self.arm(state, announced),
            },
            (Request::Disarm, Phase::FadingIn | Phase::Running) => state.phase = Phase::FadingOut,
            (Request::Clear, Phase::Faulted) if self.is_over(state, lost) => {
                (state.phase, state.reason) = (Phase::Disarmed, None);
            }
            (Request::Arm, Phase::FadingIn | Phase::Running | Phase::Faulted)
            | (Request::Disarm, Phase::Disarmed | Phase::FadingOut | Phase::Faulted)
            | (
                Request::Clear,
                Phase::Disarmed | Phase::FadingIn | Phase::Running | Phase::FadingOut | Phase::Faulted,
            ) => {}
        }
    }

    /// `announced`: the position comes from a scenario and counts from the world's own 0.
    fn arm(&self, state: &mut SupervisorState<F>, announced: bool) {
        (state.reason, state.warning) = (None, None);
        if state.phase == Phase::Disarmed {
            state.fresh = true;
            state.seen.stand = Stand::NONE;
            state.testing = self.pulse.map(|_| Testing::BEGIN);
            if !announced {
                self.home(state);
            }
        }
        state.phase = Phase::FadingIn;
    }

    fn home(&self, state: &mut SupervisorState<F>) {
        if self.zero_where_armed {
            state.offset = state.seen.position;
            state.rest.origin_is_set();
        }
    }

    /// The longest time in s that the motor may hold a torque: the certified interval where a late sample is a fault, else infinite. The
    /// timer or drive that holds the torque while the loop is late removes it then.
    pub fn longest_hold(&self) -> F {
        match self.when_late {
            WhenLate::Fault => self.motion.longest_interval(),
            WhenLate::Fade | WhenLate::Count => F::from_f64(f64::INFINITY),
        }
    }

    /// Its functions beyond its limits: the sign test when armed, and the account at the port.
    pub fn watches(&self) -> [bool; 2] {
        [self.pulse.is_some(), self.ledger.keeps_account()]
    }

    /// Whether the cause of a fault is gone.
    fn is_over(&self, state: &SupervisorState<F>, lost: bool) -> bool {
        let [motor, driver] = state.heat;
        let cool = self.motor.has_cooled(motor) && self.driver.has_cooled(driver);
        match state.reason {
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
                | Reason::Driver
                | Reason::Uneven,
            ) => state.calm >= CALM,
        }
    }

    /// The world's numbers and energies.
    #[inline(always)]
    fn book<const W: usize>(
        &self,
        state: &mut SupervisorState<F>,
        loop_state: &State<F, B, C, W>,
        sample: &Sample<F>,
        reading: &Reading<F>,
    ) {
        let puck = (sample.puck.position, sample.puck.velocity);
        let step = self.energy.step(loop_state, puck);
        if !are_finite([sample.torque, step.stored, step.made]) {
            state.fault(Reason::NotFinite);
            return;
        }
        let torque = sample.torque - self.energy.sources(loop_state, puck.1);
        self.ledger.enter(&mut state.books, &step, puck.0, torque, reading.missed);
        // Written so that a NaN is outside every limit.
        let within = state.books.account >= F::ZERO && state.books.made <= self.ledger.most;
        if !within {
            self.overdraw(state);
        }
        if sample.command.abs() > self.torque {
            state.fault(Reason::Torque);
        }
    }

    /// One of the ledgers is beyond its bound.
    #[cold]
    #[inline(never)]
    fn overdraw(&self, state: &mut SupervisorState<F>) {
        let (in_account, within) = (state.books.account >= F::ZERO, state.books.made <= self.ledger.most);
        for (right, trips, reason) in
            [(in_account, self.port_trips, Reason::PortEnergy), (within, self.world_trips, Reason::WorldEnergy)]
        {
            if !right && trips {
                state.fault(reason);
            } else if !right {
                state.warning = Some(reason);
            }
        }
    }

    /// The torque that the motor is to hold, where it differs from the world's command.
    #[cold]
    #[inline(never)]
    fn held(&self, state: &mut SupervisorState<F>, sample: &Sample<F>, evaluation: Evaluation) -> F {
        let wanted = self.wanted(state, sample);
        if (wanted - state.output).abs() > self.slew && !evaluation.may_jump {
            state.fault_where_active(Reason::Slew);
        }
        if state.phase == Phase::Faulted { self.braked(state, evaluation.wrong) } else { wanted }
    }

    /// The torque that the phase allows of the world's command, and the phase after this sample.
    fn wanted(&self, state: &mut SupervisorState<F>, sample: &Sample<F>) -> F {
        let before = state.gain;
        if state.phase != Phase::Running {
            if !state.phase.is_active() {
                (state.gain, state.testing, state.transfer, state.swapped) = (F::ZERO, None, [F::ZERO; 2], false);
                return F::ZERO;
            }
            if let (Some(testing), Some(pulse), Phase::FadingIn) = (state.testing.as_mut(), &self.pulse, state.phase) {
                match pulse.sample(testing, state.seen.position) {
                    SignTest::Torque(torque) => return torque,
                    SignTest::Right => {
                        (state.testing, state.fresh) = (None, true);
                        self.home(state);
                    }
                    SignTest::Wrong(reason) => state.fault(reason),
                }
                return F::ZERO;
            }
            state.gain += if state.phase == Phase::FadingIn { self.fade } else { -self.fade };
            // A sum of many parts is near 1, not exactly 1.
            let near = F::HALF * self.fade;
            if state.gain > F::ONE - near {
                (state.gain, state.phase) = (F::ONE, Phase::Running);
            } else if state.gain < near {
                (state.gain, state.phase, state.testing) = (F::ZERO, Phase::Disarmed, None);
                return F::ZERO;
            }
        }
        let wanted = state.gain * sample.command;
        let [rest, part] = state.transfer;
        if state.swapped {
            let rest = state.output - wanted;
            (state.transfer, state.swapped) = ([rest, rest * self.fade], false);
        } else if rest != F::ZERO {
            let gone = rest.abs() <= part.abs();
            let left = if gone { F::ZERO } else { rest - part };
            // It fades with the torque.
            let left = if state.phase == Phase::FadingOut { left * (state.gain / before) } else { left };
            state.transfer[0] = left;
        } else {
            // The command is within it, or has faulted.
            return state.whole(sample.command);
        }
        (wanted + state.transfer[0]).within(self.torque)
    }

    /// The torque after a fault: none, or damping that brings the puck to rest within a fade's time.
    fn braked(&self, state: &mut SupervisorState<F>, wrong: Option<Reason>) -> F {
        if state.braking < F::HALF * self.fade || self.brake <= F::ZERO {
            return F::ZERO;
        }
        // The speed that caused the fault is trusted; a reading that is wrong since then is not.
        if wrong.is_some_and(|reason| !reason.trusts_the_encoder()) {
            state.braking = F::ZERO;
            return F::ZERO;
        }
        state.braking -= self.fade;
        if state.braking < F::HALF * self.fade {
            return F::ZERO;
        }
        let step = state.seen.step.unwrap_or(F::ZERO);
        -(self.brake * step * state.braking).within(self.torque)
    }
}
