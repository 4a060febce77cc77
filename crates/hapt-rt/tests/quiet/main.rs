//! The loop's thread allocates nothing, frees nothing, and waits only on its clock.
//!
//! This is a separate test program, because its allocator counts.

#[path = "../rt/common.rs"]
mod common;
mod counting;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use common::{spring, wheel};
use counting::counted;
use hapt_core::{Request, SafetyProfile};
use hapt_model::World;
use hapt_rt::{Device, Engine, Failure, HandCommand, Hands, LoopCommand, Plan, Position, Settings, SimulatedDevice};
use hapt_sim::{Grip, script};

/// A simulated device that counts the allocations and frees of its thread since its first reading.
struct CountingDevice {
    device: SimulatedDevice,
    first: Option<u64>,
    since: Arc<AtomicU64>,
}

impl Device for CountingDevice {
    fn read(&mut self) -> Result<Position, Failure> {
        let now = counted();
        self.since.store(now - *self.first.get_or_insert(now), Ordering::SeqCst);
        self.device.read()
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        self.device.write(torque)
    }

    fn passed(&mut self, periods: u32) {
        self.device.passed(periods);
    }

    fn adopt(&mut self, plan: &mut Plan) {
        self.device.adopt(plan);
    }
}

/// A wheel whose device, loop and couplings change with k.
fn world(k: u64) -> World {
    let spring = spring("puck", "wheel", 1.0 + k as f64 * 0.01);
    let mut world =
        wheel("0.1 ms", &format!("friction = 0.002\nencoder = 4000\n[bodies.wheel]\ninertia = 0.0258\n{spring}"));
    world.sampling.period *= [1.0, 2.0][(k / 3) as usize % 2];
    world.sampling.delay = hapt_model::Delay::Seconds([0.0, 0.35e-3, 2e-3][k as usize % 3]);
    world.device.inertia *= 1.0 + 0.1 * (k % 5) as f64;
    world
}

const SCENARIO: &str = "[scenarios.test]\nduration = \"20 ms\"\nhand = { kind = \"grip\", inertia = 1e-4, damping = 0.01, stiffness = 2, \
                        hold = \"3 ms\", open = \"2 ms\", moves = { kind = \"sine\", amplitude = 0.3, frequency = 30 } }\n";

fn touch(hands: &mut Hands, k: u64) {
    let touch = match k % 4 {
        0 => HandCommand::Grab(Grip { inertia: 1e-4, damping: 0.01, stiffness: 3.0 }),
        1 => HandCommand::Move(0.1 * (k as f64).sin()),
        2 => HandCommand::Release,
        _ => HandCommand::Scenario(Box::new(script(&wheel("0.1 ms", SCENARIO).scenarios[0], 1e-4))),
    };
    let _ = hands.push(touch);
}

/// The number of voluntary context switches of the loop's thread; `None` where the system does not report it.
fn waits() -> Option<u64> {
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        let task = task.ok()?.path();
        if std::fs::read_to_string(task.join("comm")).is_ok_and(|name| name.trim() == "loop") {
            let status = std::fs::read_to_string(task.join("status")).ok()?;
            let line = status.lines().find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"))?;
            return line.trim().parse().ok();
        }
    }
    None
}

#[test]
fn ten_thousand_samples_with_commands_swaps_snapshots_and_hands_allocate_nothing_and_wait_once_each() {
    let (device, mut hands) = SimulatedDevice::new(&world(0));
    let since = Arc::new(AtomicU64::new(0));
    let device = CountingDevice { device, first: None, since: Arc::clone(&since) };
    let mut before = Plan::new(&world(0), SafetyProfile::Simulated).unwrap();
    let settings = Settings { lock: false, ..Settings::default() };
    let mut engine = Engine::start_with(before.clone(), Box::new(device), settings).unwrap();
    let _ = engine.send(LoopCommand::Request(Request::Arm));
    let (mut samples, mut plans, mut round) = (0, 0, 0);
    let (mut snapshots, mut last) = (0, 0);
    let (start, mut at_start) = (waits(), None);
    while samples < 10_000 {
        std::thread::sleep(Duration::from_millis(1));
        round += 1;
        touch(&mut hands, round);
        engine.handle().heartbeat();
        if round % 5 == 0 {
            let plan = Plan::following(&world(round / 5), &before).unwrap();
            before = plan.clone();
            let _ = engine.send(LoopCommand::Swap(Box::new(plan)));
        }
        engine.snapshot();
        let _ = engine.send(LoopCommand::Request([Request::Arm, Request::Disarm][(round / 300) as usize % 2]));
        while let Ok(record) = engine.records.pop() {
            at_start.get_or_insert(record.sample);
            samples += 1;
            plans = record.plan;
            while let Ok(snapshot) = engine.snapshots.pop() {
                assert!(snapshot.sample >= last, "{} after {last}", snapshot.sample);
                (last, snapshots) = (snapshot.sample, snapshots + 1);
            }
        }
        assert_eq!(engine.ended(), None);
    }
    assert!(plans > 20 && snapshots > 100, "{plans} swaps, {snapshots} snapshots");
    assert_eq!(since.load(Ordering::SeqCst), 0, "allocated or freed on the loop's thread");
    if let (Some(start), Some(end)) = (start, waits()) {
        // The samples whose records are still in the ring count too.
        while engine.records.pop().is_ok() {
            samples += 1;
        }
        assert!(end - start <= samples + 8, "{} waits in {samples} samples", end - start);
    }
}
