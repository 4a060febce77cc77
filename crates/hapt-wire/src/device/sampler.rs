//! The half in the timer's interrupt: one guarded sample a period.

use crate::{ROOM, Refusal, States, Telemetry};
use hapt_core::{ControllerState, Phase, Reading, Reason, Request, SafeOutput, State, SupervisorState};

use super::mailbox::{Action, FIRST_PERIOD, Outcome, Pending, Progress, Response};
use super::{Board, Mailbox, WorldStorage};

/// The measurement of the puck at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// In rad (linear: m).
    pub position: f32,
    /// In rad/s (m/s) where the device measures it; used by the exact estimator only, which requires an externally clocked board.
    pub velocity: f32,
    /// Lateness of the sample, in s.
    pub late: f32,
    /// Samples missed since the last one.
    pub missed: u32,
    /// A prescribed jump of a simulated hand falls on this sample.
    pub announced: bool,
    /// The motor's driver has reported a fault since the last sample, and switched itself off.
    pub fault: bool,
}

/// The command of the motor until the next sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motor {
    /// The torque to hold, in N·m (linear: N).
    pub torque: f32,
    /// Whether the driver is on. Off, the torque is 0.
    pub on: bool,
}

/// Takes one guarded sample per period. It owns the running world; commands and worlds arrive only by [`Sampler::exchange`].
#[derive(Debug)]
pub struct Sampler<'w> {
    storage: &'w mut WorldStorage,
    state: ControllerState<f32, { ROOM[0] }, { ROOM[1] }, { ROOM[2] }>,
    /// The number of the next sample.
    next: u64,
    /// The number of the sample before which the last heartbeat arrived.
    last_heartbeat: Option<u64>,
    /// The request for the next sample, with its command's sequence.
    request: Option<(u32, Request)>,
    response: Option<Response>,
    divider: u16,
    /// Samples until the next telemetry.
    countdown: u16,
    externally_clocked: bool,
    telemetry: Option<Telemetry>,
    /// The sequence of the telemetry.
    sequence: u32,
    missed: u32,
    used: u32,
    most_used: u32,
}

impl<'w> Sampler<'w> {
    /// Disarmed and without a world: `storage` is the second of the board's two, and empty.
    pub fn new(board: &Board, storage: &'w mut WorldStorage) -> Self {
        *storage = WorldStorage::EMPTY;
        Sampler {
            storage,
            state: ControllerState { world: State::EMPTY, supervisor: SupervisorState::START },
            next: 0,
            last_heartbeat: None,
            request: None,
            response: None,
            divider: 0,
            countdown: 0,
            externally_clocked: board.externally_clocked,
            telemetry: None,
            sequence: 0,
            missed: 0,
            used: 0,
            most_used: 0,
        }
    }

    /// T in s: 1 ms before there is a world.
    pub fn period(&self) -> f32 {
        self.storage.0.as_ref().map_or(FIRST_PERIOD, |compiled| compiled.controller.period())
    }

    /// The whole periods for which the motor may hold a torque, where the world bounds it: a timer that has begun more of them without a
    /// sample removes the torque in hardware.
    pub fn longest_hold(&self) -> Option<u32> {
        super::game_wheel::longest_hold(&self.storage.0.as_ref()?.controller)
    }

    /// The number of the next sample, when none is missed.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Takes one sample. The torque is 0 unless the running world is armed.
    pub fn sample(&mut self, measurement: &Measurement) -> Motor {
        let sample = self.next.saturating_add(u64::from(measurement.missed));
        self.next = sample.saturating_add(1);
        self.missed = self.missed.saturating_add(measurement.missed);
        let requested = self.request.take();
        if measurement.fault {
            self.state.trip(Reason::Driver);
        }
        let reading = Reading {
            position: measurement.position,
            velocity: measurement.velocity,
            announced: measurement.announced,
            late: measurement.late,
            missed: measurement.missed,
            silent: self.silent(sample),
        };
        let Some(compiled) = &self.storage.0 else {
            if let Some((sequence, _)) = requested {
                self.respond(sequence, Outcome::Refused(Refusal::NoWorld));
            }
            let (phase, reason) = (self.state.supervisor.phase as u8, code(self.state.supervisor.reason));
            self.publish(Telemetry { sample, phase, reason, position: measurement.position, ..Telemetry::default() });
            return Motor::default();
        };
        let request = requested.map(|(_, request)| request);
        let guarded = compiled.controller.step(&mut self.state, &reading, request);
        let now = &self.state.world.now;
        let states = now.position.iter().copied().zip(now.velocity.iter().copied());
        let bodies = States::new(states.take(compiled.controller.world().bodies()));
        let SafeOutput { sample: of_world, output, phase, reason, warning, outside: _ } = guarded;
        if let Some((sequence, request)) = requested {
            let went = match request {
                Request::Arm => phase.is_active(),
                Request::Clear => phase != Phase::Faulted,
                Request::Disarm | Request::Stop => true,
            };
            self.respond(sequence, if went { Outcome::Done } else { Outcome::Refused(Refusal::Phase) });
        }
        self.publish(Telemetry {
            sample,
            phase: phase as u8,
            reason: code(reason),
            warning: code(warning),
            position: measurement.position,
            measured: of_world.puck.position,
            velocity: of_world.puck.velocity,
            torque: of_world.torque,
            command: of_world.command,
            output,
            bodies,
            ..Telemetry::default()
        });
        Motor { torque: output, on: phase.is_active() || output != 0.0 }
    }

    /// Sets the delay in s after which the motor has received the torque of the last sample: the supervisor evaluates it at the next sample.
    pub fn commanded(&mut self, delay: f32) {
        self.state.commanded(delay);
    }

    /// Sets the cost of the last sample for the telemetry, in a unit of the board.
    pub fn used(&mut self, used: u32) {
        self.used = used;
        self.most_used = self.most_used.max(used);
    }

    /// Passes on responses and telemetry, and takes commands for the next sample. True where the world has changed, which may change the
    /// timer's period.
    pub fn exchange(&mut self, mailbox: &mut Mailbox<'w>) -> bool {
        if let Some(response) = self.response.take() {
            let _ = mailbox.responses.push(response);
        }
        if let Some(telemetry) = self.telemetry.take() {
            mailbox.telemetry = Some(telemetry);
        }
        let mut swapped = false;
        if let Some(sequence) = mailbox.stop.take() {
            // Earlier commands are void.
            if let Some((sequence, _)) = self.request.replace((sequence, Request::Stop)) {
                refuse(mailbox, sequence, Refusal::Late);
            }
            while let Some(Pending { sequence, what, .. }) = mailbox.pending.pop() {
                if let Action::Swap(storage) = what {
                    mailbox.back = Some(storage);
                }
                refuse(mailbox, sequence, Refusal::Late);
            }
        }
        // At most one request per sample; later ones wait.
        while self.request.is_none() && !mailbox.responses.is_full() {
            let Some(Pending { sequence, not_after, what }) = mailbox.pending.pop() else { break };
            let outcome = if not_after < self.next {
                if let Action::Swap(storage) = what {
                    mailbox.back = Some(storage);
                }
                Some(Outcome::Refused(Refusal::Late))
            } else {
                self.take(sequence, what, mailbox, &mut swapped)
            };
            if let Some(outcome) = outcome {
                let _ = mailbox.responses.push(Response { sequence, outcome });
            }
        }
        mailbox.progress = Progress {
            next: self.next,
            period: self.period(),
            phase: self.state.supervisor.phase as u8,
            reason: code(self.state.supervisor.reason),
            world: self.storage.hash(),
            divider: self.divider,
            missed: self.missed,
            most_used: self.most_used,
            outside: self.state.supervisor.outside(),
        };
        swapped
    }

    /// Executes a valid command; `None` where its response comes with the next sample.
    fn take(
        &mut self,
        sequence: u32,
        what: Action<'w>,
        mailbox: &mut Mailbox<'w>,
        swapped: &mut bool,
    ) -> Option<Outcome> {
        Some(match what {
            Action::Heartbeat => {
                self.last_heartbeat = Some(self.next);
                Outcome::Done
            }
            Action::Ask(Request::Arm, world) if world.is_none() || world != self.storage.hash() => {
                Outcome::Refused(Refusal::NoWorld)
            }
            Action::Ask(request, _) => {
                if request == Request::Arm {
                    self.last_heartbeat = Some(self.next);
                }
                self.request = Some((sequence, request));
                return None;
            }
            Action::Swap(storage) if self.state.supervisor.phase.is_active() => {
                mailbox.back = Some(storage);
                Outcome::Refused(Refusal::Armed)
            }
            Action::Swap(storage) => {
                let before = self.period();
                mailbox.back = Some(core::mem::replace(&mut self.storage, storage));
                self.state.supervisor.swap(before, self.period());
                if let Some(compiled) = &self.storage.0 {
                    self.state.world = compiled.controller.world().start();
                }
                *swapped = true;
                Outcome::Done
            }
            Action::Divide(divider) => {
                (self.divider, self.countdown) = (divider, 0);
                Outcome::Value(crate::Parameter::Divider as u8, u32::from(divider))
            }
            Action::CountUseFrom(used) => {
                self.most_used = used;
                Outcome::Value(crate::Parameter::MostUsed as u8, used)
            }
        })
    }

    /// Time since the last heartbeat at this sample, in s; infinite without one.
    fn silent(&self, sample: u64) -> f32 {
        self.last_heartbeat
            .map_or(f32::INFINITY, |last_heartbeat| sample.saturating_sub(last_heartbeat) as f32 * self.period())
    }

    fn respond(&mut self, sequence: u32, outcome: Outcome) {
        self.response = Some(Response { sequence, outcome });
    }

    fn publish(&mut self, telemetry: Telemetry) {
        if !self.externally_clocked {
            if self.divider == 0 {
                return;
            }
            if self.countdown > 0 {
                self.countdown -= 1;
                return;
            }
            self.countdown = self.divider - 1;
        }
        self.sequence = self.sequence.wrapping_add(1);
        let (sequence, missed, used) = (self.sequence, self.missed, self.used);
        let outside = self.state.supervisor.outside();
        self.telemetry = Some(Telemetry { sequence, missed, used, outside, ..telemetry });
    }
}

fn refuse(mailbox: &mut Mailbox<'_>, sequence: u32, why: Refusal) {
    let _ = mailbox.responses.push(Response { sequence, outcome: Outcome::Refused(why) });
}

fn code(reason: Option<Reason>) -> u8 {
    reason.map_or(0, Reason::code)
}
