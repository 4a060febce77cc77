//! The thread and its rings.

use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;

use hapt_core::Request;
use rtrb::{Consumer, Producer, RingBuffer};

use crate::clock::Clock;
use crate::cycle::{Cycle, Moment};
use crate::handle::{Epoch, LoopHandle};
use crate::schedule::Schedule;
use crate::{Device, Failure, LoopCommand, Outside, Plan, Realtime, Record, Snapshot, scheduling};

/// The shortest period of a loop in real time, in s: the limit for waking a thread on a PC.
pub const SHORTEST_PERIOD: f64 = 1e-5;
/// Capacity of the rings of commands and of old plans.
const COMMANDS: usize = 64;
/// Capacity of the ring of records: half a minute at 1 kHz.
const RECORDS: usize = 1 << 15;
/// Capacity of the ring of records without a thread, where the caller takes them sample by sample.
const STEPPED: usize = 4;
/// The number of commands that one sample takes at most: requests of a past epoch are dropped, and the next one is read.
const COMMANDS_PER_SAMPLE: usize = 4;

/// The reason that a loop does not start.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The system cannot create a thread.
    #[error("the system cannot create a thread for the loop: {0}")]
    Thread(#[from] std::io::Error),
    /// The period is too short.
    #[error("a loop in real time needs a period of 10 us or more; this one is {} us", given * 1e6)]
    Period {
        /// In s.
        given: f64,
    },
}

/// What the loop's thread requests of the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The priority under SCHED_FIFO, from 1 to 99; `None`: normal scheduling.
    pub priority: Option<u8>,
    /// Whether to lock the process's memory in place.
    pub lock: bool,
    /// The thread polls the clock for this time before each instant instead of sleeping: more load on the core, less jitter.
    pub spin: Duration,
    /// With a priority the thread leaves the first core to all other threads, for several loops on one computer; on a computer with a single core
    /// it takes no priority.
    pub leave_a_core: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { priority: Some(80), lock: true, spin: Duration::ZERO, leave_a_core: false }
    }
}

/// How a loop ended. The torque is off in each case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// It was stopped by its owner.
    Stopped,
    /// The device failed.
    Device(Failure),
    /// A panic, a defect of this program.
    Panicked,
}

/// A running loop. Dropping it stops the loop, without torque.
pub struct Engine {
    /// The records of the loop, one per sample. The ring holds half a minute at 1 kHz; records beyond that are lost.
    pub records: Consumer<Record>,
    /// The snapshots, in the order of their requests. The snapshot before a sample arrives before that sample's record.
    pub snapshots: Consumer<Box<Snapshot>>,
    commands: Producer<(Epoch, LoopCommand)>,
    /// Plans that the loop no longer uses, to be freed on this side.
    spent: Consumer<Box<Plan>>,
    realtime: Realtime,
    handle: LoopHandle,
    thread: Option<JoinHandle<End>>,
    ended: Option<End>,
}

impl Engine {
    /// Runs `plan` on `device`, disarmed, with the best scheduling that the system grants.
    pub fn start(plan: Plan, device: Box<dyn Device>) -> Result<Self, Error> {
        Engine::start_with(plan, device, Settings::default())
    }

    /// As [`Engine::start`], with these settings.
    pub fn start_with(plan: Plan, device: Box<dyn Device>, settings: Settings) -> Result<Self, Error> {
        Engine::start_with_outside(plan, device, settings, Outside::default())
    }

    /// The same with external torques.
    pub fn start_with_outside(
        plan: Plan,
        device: Box<dyn Device>,
        settings: Settings,
        outside: Outside,
    ) -> Result<Self, Error> {
        let (mut engine, mut stepper) = Engine::connect(plan, device, RECORDS, outside)?;
        let (sender, receiver) = mpsc::sync_channel(1);
        let clock = engine.handle.clock().spinning(settings.spin);
        engine.thread = Some(std::thread::Builder::new().name("loop".into()).spawn(move || {
            let _ = sender.send(scheduling::prepare(&settings));
            // Freed before the loop runs, so that it frees nothing.
            drop(sender);
            stepper.schedule = Schedule::new(clock.now(), stepper.cycle.period());
            run(stepper, clock)
        })?);
        // A thread that ended before it reported its grant is in `ended`.
        engine.realtime = receiver.recv().unwrap_or_default();
        Ok(engine)
    }

    /// Runs `plan` on `device` without a thread, disarmed, with external torques: [`Stepper::step`] takes each sample.
    pub fn stepped(plan: Plan, device: Box<dyn Device>, outside: Outside) -> Result<(Self, Stepper), Error> {
        Engine::connect(plan, device, STEPPED, outside)
    }

    fn connect(plan: Plan, device: Box<dyn Device>, room: usize, outside: Outside) -> Result<(Self, Stepper), Error> {
        check(&plan)?;
        let (commands, incoming) = RingBuffer::new(COMMANDS);
        let (outgoing, records) = RingBuffer::new(room);
        let (back, spent) = RingBuffer::new(COMMANDS);
        let (taken, snapshots) = RingBuffer::new(COMMANDS);
        let handle = LoopHandle::default();
        let rings = Rings {
            commands: incoming,
            records: outgoing,
            snapshots: taken,
            back,
            seen: handle.epoch(),
            handle: handle.clone(),
        };
        let schedule = Schedule::new(0, plan.period());
        let cycle = Cycle::new(Box::new(plan), device).with_outside(outside);
        let realtime = Realtime::default();
        let engine = Engine { records, snapshots, commands, spent, realtime, handle, thread: None, ended: None };
        Ok((engine, Stepper { cycle, rings, schedule, start: None }))
    }

    /// The scheduling that the system has granted; none without a thread.
    pub fn realtime(&self) -> &Realtime {
        &self.realtime
    }

    /// A handle for any thread; its requests do not queue.
    pub fn handle(&self) -> &LoopHandle {
        &self.handle
    }

    /// Sends a command for the next sample. It is returned where 64 are queued, or where the plan's period is too short. A plan is
    /// made by [`Plan::following`] the one that was sent before it.
    pub fn send(&mut self, command: LoopCommand) -> Result<(), LoopCommand> {
        let epoch = self.handle.epoch();
        self.send_of(command, epoch)
    }

    /// As [`Engine::send`], for a command made in `epoch`: if the loop was stopped or control withdrawn since, arming and clearing
    /// are ignored.
    pub fn send_of(&mut self, mut command: LoopCommand, epoch: Epoch) -> Result<(), LoopCommand> {
        while self.spent.pop().is_ok() {}
        match &mut command {
            LoopCommand::Swap(plan) if check(plan).is_err() => return Err(command),
            LoopCommand::Swap(plan) => plan.reserve(),
            LoopCommand::Request(_) | LoopCommand::Snapshot(_) => {}
        }
        self.commands.push((epoch, command)).map_err(|rtrb::PushError::Full((_, command))| command)
    }

    /// Requests a snapshot before the next sample; it arrives in [`Engine::snapshots`]. False where the queue is full.
    pub fn snapshot(&mut self) -> bool {
        self.send(LoopCommand::Snapshot(Box::new(Snapshot::EMPTY))).is_ok()
    }

    /// Stop, ahead of all commands: no torque from the next sample on.
    pub fn stop(&self) {
        self.handle.stop();
    }

    /// How the loop ended; `None` while it runs.
    pub fn ended(&mut self) -> Option<End> {
        if self.thread.as_ref().is_some_and(|thread| thread.is_finished()) {
            self.join();
        }
        self.ended
    }

    /// Ends the loop, and waits until the torque is off.
    pub fn end(&mut self) -> End {
        self.handle.end();
        self.join();
        *self.ended.get_or_insert(End::Stopped)
    }

    fn join(&mut self) {
        if let Some(thread) = self.thread.take() {
            self.ended = Some(thread.join().unwrap_or(End::Panicked));
        }
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.end();
    }
}

fn check(plan: &Plan) -> Result<(), Error> {
    let given = plan.period();
    if given >= SHORTEST_PERIOD { Ok(()) } else { Err(Error::Period { given }) }
}

/// The loop's ends of the rings.
struct Rings {
    commands: Consumer<(Epoch, LoopCommand)>,
    records: Producer<Record>,
    snapshots: Producer<Box<Snapshot>>,
    back: Producer<Box<Plan>>,
    handle: LoopHandle,
    /// The epoch of the last sample.
    seen: Epoch,
}

/// The loop's side of an [`Engine`]: it takes the samples.
pub struct Stepper {
    cycle: Cycle,
    rings: Rings,
    schedule: Schedule,
    /// The instant of sample 0.
    start: Option<u64>,
}

impl Stepper {
    /// The instant of the next sample, in ns from the first.
    pub fn due(&self) -> u64 {
        self.schedule.due()
    }

    /// Takes the next sample, at its instant. Its record is lost where four have not been read.
    ///
    /// # Errors
    /// The device fails; its torque is then set to 0.
    pub fn step(&mut self) -> Result<(), Failure> {
        let due = self.schedule.due();
        let record = self.sample(due)?;
        self.leave(record, due);
        Ok(())
    }

    /// The sample whose instant is the last before `now`.
    fn sample(&mut self, now: u64) -> Result<Record, Failure> {
        let Stepper { cycle, rings, schedule, start } = self;
        let taken = schedule.take(now);
        cycle.pass(taken.periods);
        let request = rings.commands(cycle, schedule);
        let moment = Moment {
            due: taken.due - *start.get_or_insert(taken.due),
            now,
            late: taken.late as f64 * 1e-9,
            periods: taken.periods,
            silent: rings.handle.since_heartbeat_at(now),
        };
        cycle.sample(&moment, request)
    }

    /// Sends the record of a sample that was completed at `now`. A record that finds the ring full is lost; the loop does not wait.
    fn leave(&mut self, record: Record, now: u64) {
        self.cycle.commanded(record.computation);
        let _ = self.rings.records.push(record);
        self.schedule.done(now);
    }
}

/// The loop on its thread. From its first sample to its last its only system calls are those of the clock and the device.
fn run(mut stepper: Stepper, clock: Clock) -> End {
    let handle = stepper.rings.handle.clone();
    let ends = || handle.is_ended();
    loop {
        clock.wait(stepper.schedule.due(), ends);
        if ends() {
            return End::Stopped;
        }
        let woken = clock.now();
        let mut record = match stepper.sample(woken) {
            Ok(record) => record,
            Err(failure) => return End::Device(failure),
        };
        let spent = u32::try_from(clock.now() - woken).unwrap_or(u32::MAX);
        record.computation = record.computation.saturating_add(spent);
        stepper.leave(record, clock.now());
    }
}

impl Rings {
    /// Applies the commands of this sample: one request, one swap, or one snapshot. Two swaps at one sample would skip a world
    /// that appears in no record.
    fn commands(&mut self, cycle: &mut Cycle, schedule: &mut Schedule) -> Option<Request> {
        let (now, before) = (self.handle.epoch(), self.seen);
        self.seen = now;
        if now.stopped_since(before) {
            return Some(Request::Stop);
        }
        if now != before {
            return Some(Request::Disarm);
        }
        for _ in 0..COMMANDS_PER_SAMPLE {
            // This thread frees nothing: a swap or snapshot waits until the ring back has room.
            match self.commands.peek() {
                Ok((_, LoopCommand::Swap(_))) if self.back.is_full() => return None,
                Ok((_, LoopCommand::Snapshot(_))) if self.snapshots.is_full() => return None,
                _ => {}
            }
            match self.commands.pop() {
                // From before a stop: obsolete.
                Ok((made, LoopCommand::Request(Request::Arm | Request::Clear))) if made != now => {}
                Ok((_, LoopCommand::Request(request))) => return Some(request),
                Ok((_, LoopCommand::Swap(plan))) => {
                    let old = cycle.swap(plan);
                    if old.period() != cycle.period() {
                        schedule.change_period(cycle.period());
                    }
                    let _ = self.back.push(old);
                    return None;
                }
                Ok((_, LoopCommand::Snapshot(mut snapshot))) => {
                    cycle.snapshot(&mut snapshot);
                    let _ = self.snapshots.push(snapshot);
                    return None;
                }
                Err(_) => return None,
            }
        }
        None
    }
}
