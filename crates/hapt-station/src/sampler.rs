//! The half in the timer's interrupt: one guarded sample a period.

use hapt_core::{Guarded, Phase, Reading, Reason, Request, Watch};
use hapt_wire::{States, Telemetry, Why};

use crate::mail::{Errand, FIRST_PERIOD, Progress, Said, Verdict, What};
use crate::{Board, Mail, Slot};

/// What the device says about the puck at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// In rad (linear: m).
    pub position: f32,
    /// In rad/s (m/s), where the device knows it; only the exact estimator looks at it, which only a fed board takes.
    pub velocity: f32,
    /// How long after its instant the sample is taken, in s.
    pub late: f32,
    /// Samples missed since the last.
    pub missed: u32,
    /// A prescribed jump of a simulated hand falls on this sample.
    pub announced: bool,
    /// The motor's driver has reported a fault since the last sample, and switched itself off.
    pub fault: bool,
}

/// What the motor is to do until the next sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motor {
    /// To be held, in N·m (linear: N).
    pub torque: f32,
    /// Whether its driver is to be on at all. Off, the torque is 0.
    pub on: bool,
}

/// One guarded sample a period. It owns what runs; orders and worlds reach it by [`Sampler::exchange`] alone.
#[derive(Debug)]
pub struct Sampler<'w> {
    slot: &'w mut Slot,
    watch: Watch<f32>,
    /// The number of the next sample.
    next: u64,
    /// The number of the sample before which somebody was last heard.
    heard: Option<u64>,
    /// For the next sample, with the sequence of who asks.
    request: Option<(u32, Request)>,
    verdict: Option<Verdict>,
    divider: u16,
    /// Samples until the next telemetry.
    countdown: u16,
    fed: bool,
    telemetry: Option<Telemetry>,
    /// Of the telemetry.
    sequence: u32,
    missed: u32,
    used: u32,
    most_used: u32,
}

impl<'w> Sampler<'w> {
    /// Disarmed, and with nothing to run: `slot` is the second of the board's two, and comes empty.
    pub fn new(board: &Board, slot: &'w mut Slot) -> Self {
        *slot = Slot::EMPTY;
        Sampler {
            slot,
            watch: Watch::START,
            next: 0,
            heard: None,
            request: None,
            verdict: None,
            divider: 0,
            countdown: 0,
            fed: board.fed,
            telemetry: None,
            sequence: 0,
            missed: 0,
            used: 0,
            most_used: 0,
        }
    }

    /// T in s: 1 ms before there is a world.
    pub fn period(&self) -> f32 {
        self.slot.0.as_ref().map_or(FIRST_PERIOD, |compiled| compiled.world.period())
    }

    /// The number of the next sample, when none is missed.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// One sample. The torque is 0 whenever nobody has armed the world that runs.
    pub fn sample(&mut self, seen: &Seen) -> Motor {
        let sample = self.next.saturating_add(u64::from(seen.missed));
        self.next = sample.saturating_add(1);
        self.missed = self.missed.saturating_add(seen.missed);
        let asked = self.request.take();
        if seen.fault {
            self.watch.trip(Reason::Driver);
        }
        let reading = Reading {
            position: seen.position,
            velocity: seen.velocity,
            announced: seen.announced,
            late: seen.late,
            missed: seen.missed,
            silent: self.silent(sample),
        };
        let Some(compiled) = &mut self.slot.0 else {
            if let Some((sequence, _)) = asked {
                self.answer(sequence, Said::Refused(Why::NoWorld));
            }
            let (phase, reason) = (self.watch.phase as u8, code(self.watch.reason));
            self.tell(Telemetry { sample, phase, reason, position: seen.position, ..Telemetry::default() });
            return Motor::default();
        };
        let request = asked.map(|(_, request)| request);
        let guarded =
            compiled.supervisor.step(&mut self.watch, &compiled.world, &mut compiled.state, &reading, request);
        let now = &compiled.state.now;
        let states = now.position.iter().copied().zip(now.velocity.iter().copied());
        let bodies = States::new(states.take(compiled.world.bodies()));
        let Guarded { sample: of_world, output, phase, reason, warning } = guarded;
        if let Some((sequence, request)) = asked {
            let went = match request {
                Request::Arm => phase.is_active(),
                Request::Clear => phase != Phase::Faulted,
                Request::Disarm | Request::Stop => true,
            };
            self.answer(sequence, if went { Said::Done } else { Said::Refused(Why::Phase) });
        }
        self.tell(Telemetry {
            sample,
            phase: phase as u8,
            reason: code(reason),
            warning: code(warning),
            position: seen.position,
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

    /// What the sample just taken has cost, in a unit of the board's; telemetry shows it.
    pub fn used(&mut self, used: u32) {
        self.used = used;
        self.most_used = self.most_used.max(used);
    }

    /// Leaves what there is to say, and takes orders for the next sample. True where the world is another now: the timer's period may be.
    pub fn exchange(&mut self, mail: &mut Mail<'w>) -> bool {
        if let Some(verdict) = self.verdict.take() {
            let _ = mail.verdicts.push(verdict);
        }
        if let Some(telemetry) = self.telemetry.take() {
            mail.telemetry = Some(telemetry);
        }
        let mut swapped = false;
        if let Some(sequence) = mail.stop.take() {
            // What was asked for before counts no more.
            if let Some((sequence, _)) = self.request.replace((sequence, Request::Stop)) {
                refuse(mail, sequence, Why::Late);
            }
            while let Some(Errand { sequence, what, .. }) = mail.orders.pop() {
                if let What::Swap(slot) = what {
                    mail.back = Some(slot);
                }
                refuse(mail, sequence, Why::Late);
            }
        }
        // At most one request a sample; what comes after it waits.
        while self.request.is_none() && !mail.verdicts.is_full() {
            let Some(Errand { sequence, not_after, what }) = mail.orders.pop() else { break };
            let said = if not_after < self.next {
                if let What::Swap(slot) = what {
                    mail.back = Some(slot);
                }
                Some(Said::Refused(Why::Late))
            } else {
                self.take(sequence, what, mail, &mut swapped)
            };
            if let Some(said) = said {
                let _ = mail.verdicts.push(Verdict { sequence, said });
            }
        }
        mail.progress = Progress {
            next: self.next,
            period: self.period(),
            phase: self.watch.phase as u8,
            reason: code(self.watch.reason),
            world: self.slot.hash(),
            divider: self.divider,
            missed: self.missed,
            most_used: self.most_used,
        };
        swapped
    }

    /// Does an order in time; `None` where its verdict comes with the next sample.
    fn take(&mut self, sequence: u32, what: What<'w>, mail: &mut Mail<'w>, swapped: &mut bool) -> Option<Said> {
        Some(match what {
            What::Alive => {
                self.heard = Some(self.next);
                Said::Done
            }
            What::Ask(Request::Arm, world) if world.is_none() || world != self.slot.hash() => {
                Said::Refused(Why::NoWorld)
            }
            What::Ask(request, _) => {
                if request == Request::Arm {
                    self.heard = Some(self.next);
                }
                self.request = Some((sequence, request));
                return None;
            }
            What::Swap(slot) if self.watch.phase.is_active() => {
                mail.back = Some(slot);
                Said::Refused(Why::Armed)
            }
            What::Swap(slot) => {
                let before = self.period();
                mail.back = Some(core::mem::replace(&mut self.slot, slot));
                self.watch.swap(before, self.period());
                *swapped = true;
                Said::Done
            }
            What::Divide(divider) => {
                (self.divider, self.countdown) = (divider, 0);
                Said::Value(hapt_wire::Parameter::Divider as u8, u32::from(divider))
            }
            What::CountUseFrom(used) => {
                self.most_used = used;
                Said::Value(hapt_wire::Parameter::MostUsed as u8, used)
            }
        })
    }

    /// How long ago somebody was heard, at this sample; for ever where nobody was.
    fn silent(&self, sample: u64) -> f32 {
        self.heard.map_or(f32::INFINITY, |heard| sample.saturating_sub(heard) as f32 * self.period())
    }

    fn answer(&mut self, sequence: u32, said: Said) {
        self.verdict = Some(Verdict { sequence, said });
    }

    fn tell(&mut self, telemetry: Telemetry) {
        if !self.fed {
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
        self.telemetry = Some(Telemetry { sequence, missed, used, ..telemetry });
    }
}

fn refuse(mail: &mut Mail<'_>, sequence: u32, why: Why) {
    let _ = mail.verdicts.push(Verdict { sequence, said: Said::Refused(why) });
}

fn code(reason: Option<Reason>) -> u8 {
    reason.map_or(0, Reason::code)
}
