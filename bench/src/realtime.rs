//! The loop in real time on the simulated device: its latency, for comparison with `bench/c/realtime.c`.

use std::time::Duration;

use anyhow::{Result, ensure};
use hapt_core::{Request, SafetyProfile};
use hapt_model::{Source, World};
use hapt_rt::{Engine, LoopCommand, Plan, Settings, SimulatedDevice};

/// Prints whether the loop runs under SCHED_FIFO, and the quantiles of its latency in ns.
pub fn time(samples: usize, period: u64, spin: u64) -> Result<()> {
    let source = Source::open("worlds/notes/default.toml")?;
    let world = World::read(&source, &[format!("loop.period={}us", period as f64 * 1e-3)])?;
    let (device, _hands) = SimulatedDevice::new(&world);
    let settings = Settings { spin: Duration::from_nanos(spin), ..Settings::default() };
    let mut engine = Engine::start_with(Plan::new(&world, SafetyProfile::Simulated)?, Box::new(device), settings)?;
    let _ = engine.send(LoopCommand::Request(Request::Arm));
    let mut latencies = Vec::with_capacity(samples + (1 << 15));
    while latencies.len() < samples {
        std::thread::sleep(Duration::from_millis(100));
        while let Ok(record) = engine.records.pop() {
            latencies.push(record.latency);
        }
        ensure!(engine.ended().is_none(), "the loop has ended");
    }
    latencies.truncate(samples);
    latencies.sort_unstable();
    print!("{}", i32::from(engine.realtime().priority.is_some()));
    for quantile in [0.5, 0.9, 0.99, 0.999, 1.0] {
        print!(" {}", latencies[(quantile * (samples - 1) as f64) as usize]);
    }
    println!();
    Ok(())
}
