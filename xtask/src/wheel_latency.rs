//! How long a report of a game takes to become a torque, in simulated time.

use std::fmt::Write as _;

use anyhow::{Result, anyhow, ensure};
use fastrand::Rng;
use hapt_core::wheel::{Device as WheelDevice, Timing, Wheel};
use hapt_core::{Phase, Request, SafetyProfile};
use hapt_model::{Source, World};
use hapt_rt::{Cycle, Device, EffectsWire, Failure, Moment, Outside, Plan, Position, effects};
use hapt_wire::pid::{Common, FULL, INFINITE, Kind, Operation, Pool, Report, Scale};

use crate::campaign::Campaign;
use crate::random::quantile;

/// The loops of the table: the period, and from a sample to its torque, in ms.
const LOOPS: [(f64, f64); 4] = [(0.5, 0.1), (1.0, 0.2), (1.0, 0.5), (2.0, 0.5)];
/// The motor's, N·m.
const LIMIT: f64 = 5.0;
/// The time between two changes, ms: the torque of the one before has settled.
const PAUSE: (f64, f64) = (30.0, 50.0);
/// A torque has begun to change at this part of the whole change.
const BEGUN: f64 = 0.01;

/// A wheel that stands still.
struct Still;

impl Device for Still {
    fn read(&mut self) -> Result<Position, Failure> {
        Ok(Position { position: 0.0, velocity: 0.0, announced: false })
    }

    fn write(&mut self, _: f64) -> Result<(), Failure> {
        Ok(())
    }
}

/// The times of the changes of one loop, in ms, and how many of them missed a sample.
#[derive(Default)]
struct Taken {
    begun: Vec<f64>,
    half: Vec<f64>,
    missed: u64,
}

/// `cargo xtask wheel latency [--n N] [--seed S] [--write]`
pub fn command(words: &[&str]) -> Result<()> {
    let campaign = Campaign::parse(words, false)?;
    let mut table = String::from(
        "| period | sample to torque | changes | torque begins, p50 | p99 | half of it, p50 | p99 | samples missed |\n\
         | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for (period, delay) in LOOPS {
        let taken = taken(period, delay, campaign.n, campaign.seed)?;
        let [begun, half] =
            [&taken.begun, &taken.half].map(|all| [0.5, 0.99].map(|share| quantile(all.iter().copied(), share)));
        let _ = writeln!(
            table,
            "| {period} ms | {delay} ms | {} | {:.2} ms | {:.2} ms | {:.2} ms | {:.2} ms | {} |",
            campaign.n, begun[0], begun[1], half[0], half[1], taken.missed
        );
    }
    campaign.publish("wheel latency", "docs/wheel.md", &table)
}

/// The loop of a wheel, with the host's end of its effects.
struct WheelLoop {
    cycle: Cycle,
    wire: EffectsWire,
    period: f64,
    samples: u64,
}

impl WheelLoop {
    fn new(period: f64, delay: f64) -> Result<Self> {
        let text = format!(
            "loop.period = \"{period} ms\"\nloop.delay = \"{delay} ms\"\nloop.estimator = \"difference\"\n\
             device = {{ inertia = \"0.02 kg m^2\", damping = \"0.05 N m s/rad\", limit = \"{LIMIT} N m\" }}\n"
        );
        let world = World::read(&Source::from_text("wheel.toml", text), &[]).map_err(|error| anyhow!("{error}"))?;
        let timing = Timing { delay: 1e-3 * delay, ..Timing::even(1e-3 * period) };
        let wheel = Wheel::new(&WheelDevice::ideal(timing, 0.05, LIMIT)).map_err(|error| anyhow!("{error}"))?;
        let scale = Scale { torque: LIMIT as f32, angle: 7.85, velocity: 10.0, acceleration: 200.0 };
        let (port, wire) = effects(wheel, scale);
        let plan = Plan::new(&world, SafetyProfile::Simulated).map_err(|error| anyhow!("{error}"))?;
        let cycle = Cycle::new(Box::new(plan), Box::new(Still)).with_outside(Outside::playing(port));
        let mut running = WheelLoop { cycle, wire, period, samples: 0 };
        running.sample(None)?;
        running.sample(Some(Request::Arm))?;
        while running.sample(None)?.0 != Phase::Running {}
        Ok(running)
    }

    /// The time of the next sample, ms.
    fn next(&self) -> f64 {
        self.period * (self.samples + 1) as f64
    }

    /// The phase, and the torque of the effects.
    fn sample(&mut self, request: Option<Request>) -> Result<(Phase, f64)> {
        let periods = u32::from(self.samples > 0);
        self.cycle.pass(periods);
        let now = (1e6 * self.next()).round() as u64;
        self.samples += 1;
        while self.wire.samples.pop().is_ok() {}
        let moment = Moment { periods, now, ..Moment::default() };
        let record = self.cycle.sample(&moment, request).map_err(|failure| anyhow!("{failure}"))?;
        Ok((record.phase, record.link))
    }
}

fn taken(period: f64, delay: f64, n: u64, seed: u64) -> Result<Taken> {
    let mut running = WheelLoop::new(period, delay)?;
    let mut rng = Rng::with_seed(seed);
    let mut pool = Pool::new();
    let us = |ms: f64| (1e3 * ms).round() as u64;
    let common = Common {
        kind: Kind::Constant,
        duration: INFINITE,
        repeat: 0,
        delay: 0,
        gain: FULL,
        button: 0,
        direction: Some(9000),
    };
    pool.take(&Report::Create(Kind::Constant), us(running.next()));
    pool.take(&Report::Effect { block: 0, common }, us(running.next()));
    pool.take(&Report::Operation { block: 0, operation: Operation::Start, loops: 1 }, us(running.next()));
    let (mut taken, mut sign, mut arrives) = (Taken::default(), 1, running.next() + PAUSE.1);
    for _ in 0..n {
        let mut before = 0.0;
        while running.next() < arrives {
            before = running.sample(None)?.1;
        }
        // The report is there before this sample, and after the last.
        let first = running.next();
        sign = -sign;
        pool.take(&Report::Constant { block: 0, magnitude: sign * (FULL / 4) }, us(arrives));
        ensure!(running.wire.pools.push(pool).is_ok(), "the ring of pools is full");
        let after = f64::from(-sign) * 0.25 * LIMIT;
        let (mut begun, mut half) = (None, None);
        while half.is_none() {
            let acts = running.next() + delay;
            let share = (running.sample(None)?.1 - before) / (after - before);
            ensure!(acts - arrives < PAUSE.0, "a change has no effect");
            begun = begun.or((share > BEGUN).then_some(acts));
            half = (share >= 0.5).then_some(acts);
        }
        let begun = begun.unwrap_or(f64::INFINITY);
        // The sample that comes first has the change, whose jump begins to fade there: one sample later it shows.
        taken.missed += u64::from(begun > first + period + delay + 1e-9);
        taken.begun.push(begun - arrives);
        taken.half.push(half.unwrap_or(f64::INFINITY) - arrives);
        arrives += PAUSE.0 + (PAUSE.1 - PAUSE.0) * rng.f64();
    }
    Ok(taken)
}
