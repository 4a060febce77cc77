//! The thread and its two rings.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hapt_core::{Reading, State, Watch};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::{BODIES, Device, Order, Plan, Record};

/// Why the loop cannot start.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The system gives no thread.
    #[error("the system gives no thread for the loop: {0}")]
    Thread(#[from] std::io::Error),
}

/// A loop at work. Dropped, it stops, with no torque on.
pub struct Engine {
    /// Toward the loop.
    pub orders: Producer<Order>,
    /// From it.
    pub records: Consumer<Record>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Engine {
    /// Runs `plan` on `device` from now on, disarmed.
    pub fn start(plan: Plan, device: Box<dyn Device>) -> Result<Self, Error> {
        let (orders, incoming) = RingBuffer::new(64);
        let (outgoing, records) = RingBuffer::new(1 << 15);
        let end = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&end);
        let plan = Box::new(plan);
        let thread = std::thread::Builder::new()
            .name("loop".into())
            .spawn(move || run(plan, device, incoming, outgoing, &stop))?;
        Ok(Engine { orders, records, end, thread: Some(thread) })
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn run(
    mut plan: Box<Plan>,
    mut device: Box<dyn Device>,
    mut orders: Consumer<Order>,
    mut records: Producer<Record>,
    end: &AtomicBool,
) {
    let mut state: State<_, _, _, _> = plan.world.start();
    let mut watch = Watch::START;
    let mut plans = 0;
    let mut sample = 0_u64;
    let begin = Instant::now();
    while !end.load(Ordering::Relaxed) {
        let period = Duration::from_secs_f64(plan.world.period());
        let due = begin + period.mul_f64(sample as f64);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        let woken = Instant::now();
        let mut request = None;
        while request.is_none()
            && let Ok(order) = orders.pop()
        {
            match order {
                Order::Request(what) => request = Some(what),
                Order::Swap(next) => {
                    let mut fresh = next.world.start();
                    for (to, from) in next.carried.iter().enumerate() {
                        if let Some(from) = *from {
                            fresh.now.position[to] = state.now.position[from];
                            fresh.now.velocity[to] = state.now.velocity[from];
                        }
                    }
                    (plan, state, plans) = (next, fresh, plans + 1);
                }
                Order::Alive => {}
            }
        }
        let Ok(position) = device.read() else { break };
        let reading = Reading {
            position: position.position,
            velocity: position.velocity,
            announced: position.announced,
            late: 0.0,
            missed: 0,
            silent: 0.0,
        };
        let guarded = plan.supervisor.step(&mut watch, &plan.world, &mut state, &reading, request);
        if device.write(guarded.output).is_err() {
            break;
        }
        let mut bodies = [(0.0, 0.0); BODIES];
        for (place, i) in bodies.iter_mut().zip(0..plan.world.bodies()) {
            *place = (state.now.position[i], state.now.velocity[i]);
        }
        let record = Record {
            sample,
            plan: plans,
            position: position.position,
            velocity: position.velocity,
            measured: guarded.sample.puck.position,
            measured_velocity: guarded.sample.puck.velocity,
            torque: guarded.sample.torque,
            command: guarded.sample.command,
            output: guarded.output,
            phase: guarded.phase,
            reason: guarded.reason,
            latency: woken.saturating_duration_since(due).as_nanos() as u32,
            computation: woken.elapsed().as_nanos() as u32,
            missed: 0,
            bodies,
            announced: position.announced,
        };
        let _ = records.push(record);
        device.passed(1);
        sample += 1;
    }
    let _ = device.write(0.0);
}
