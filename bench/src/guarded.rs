//! One guarded sample of the notes' wheel, with warm caches, in a microcontroller's capacity: only the loop, and the loop behind its
//! supervisor.

use anyhow::{Context, Result, bail};
use hapt_core::{Controller, Phase, Reading, Real, Request, SafetyProfile};

use crate::{run, timed};

const SAMPLES: usize = 4096;

/// The wheel swings, and the hand turns the puck to and fro.
pub fn time(numbers: &str, guarded: bool, repeats: usize) -> Result<()> {
    match numbers {
        "f32" => time_on::<f32>(guarded, repeats),
        "f64" => time_on::<f64>(guarded, repeats),
        _ => bail!("f32 or f64?"),
    }
}

fn time_on<F: Real>(guarded: bool, repeats: usize) -> Result<()> {
    let world = run::world("held")?;
    let spec = world.spec();
    let controller = Controller::<F, 4, 8, 17>::new(&spec, &world.limits(SafetyProfile::Simulated))?;
    let reading = |k: usize| {
        let phase = 1e-2 * k as f64;
        let (position, velocity) = (0.5 * phase.sin(), 5.0 * phase.cos());
        let (position, velocity) = (F::from_f64(position), F::from_f64(velocity));
        let nothing = F::from_f64(0.0);
        Reading { position, velocity, announced: false, late: nothing, missed: 0, silent: nothing }
    };
    let readings: Vec<Reading<F>> = (0..SAMPLES).map(reading).collect();
    // Armed and fully faded in.
    let mut state = controller.start();
    let mut request = Some(Request::Arm);
    while state.supervisor.phase != Phase::Running {
        controller.step(&mut state, &readings[0], request.take());
    }
    let begin = state;
    let mut sum = 0.0;
    timed(repeats, SAMPLES, || {
        (state, sum) = (begin, 0.0);
        for reading in &readings {
            let torque = if guarded {
                controller.step(&mut state, reading, None).output
            } else {
                controller.world().step(&mut state.world, reading.position, reading.velocity).command
            };
            sum += torque.to_f64();
        }
        Ok(())
    })?;
    if guarded && state.supervisor.phase != Phase::Running {
        return Err(anyhow::anyhow!("it has faulted: {:?}", state.supervisor.reason)).context("the guarded loop");
    }
    println!("{sum:e}");
    Ok(())
}
