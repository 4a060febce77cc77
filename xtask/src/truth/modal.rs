//! A lossless hand of several masses and springs, which reaches what the condition of Colgate and Schenkel is about.
//!
//! Hand and puck together have the mobility Σ c s/(s² + ω²) with any ω and c > 0 where Σ c is no more than 1/J: a hand of springs and masses
//! that gives it exists (Foster 1924). All ω are aliases of one frequency, |θ + 2πn|/T. The samples tell none of them from another, so that
//! the loop couples them all, and the motion between two samples may take the shape that costs the device's damping the least. A hand of one
//! mass and one spring has one of them.
//!
//! At the alias ω hand and device give the mobility 1/(b + ix) to a torque, and x is free. With the phase φ by which the torque's alias leads
//! the worst one, that of the largest part of it along φ has x = -b tan(φ/2): each mode is off its alias by -c x/2. What a delay and a lag
//! add to φ differs from alias to alias; the rest of it is common to all, and tried.

use std::f64::consts::PI;

use hapt_analysis::{Error, passivity};
use hapt_model::World;
use hapt_sim::DesktopLoop;
use nalgebra::{DMatrix, DVector};

/// Aliases on either side of θ.
const ALIASES: i32 = 8;
/// The damping's rate in hand and puck, per sample: small enough that the motion keeps its frequencies.
const SLOW: f64 = 0.01;
/// The common parts of φ that are tried beside a delay or a lag, and the largest |tan(φ/2)|.
const PHASES: usize = 12;
const STEEPEST: f64 = 20.0;
/// θ where the worst frequency is 0, or all are alike.
const LOW: f64 = 0.15;
const ALIKE: f64 = 1.0;
/// Samples of a run, and of its first part, in which the decaying motions go.
const SAMPLES: usize = 60_000;
const FIRST: usize = 30_000;
/// A size that has risen by this part has grown.
const SEEN: f64 = 0.01;

/// Hand and puck under a held torque: positions and velocities of the modes, and the motor's torque where it lags.
struct Modes {
    /// exp of both parts of a period, with what the held torque adds.
    parts: [(DMatrix<f64>, DVector<f64>); 2],
    state: DVector<f64>,
    modes: usize,
}

impl Modes {
    /// With this damping of the device, at even samples and a delay of no more than one; `phase` is the common part of φ.
    fn new(world: &World, damping: f64, theta: f64, phase: f64) -> Self {
        let (period, lag, delay) = (world.sampling.period, world.device.lag, world.sampling.delay_s());
        let modes = 2 * ALIASES as usize + 1;
        let share = 1.0 / world.device.inertia.max(damping * period / SLOW) / modes as f64;
        let mode = |n: i32| {
            let alias = (theta + 2.0 * PI * f64::from(n)) / period;
            let late = if lag > 0.0 || delay > 0.0 { phase + alias * delay + (alias * lag).atan() } else { 0.0 };
            let steep = (0.5 * late).tan().clamp(-STEEPEST, STEEPEST);
            (alias + 0.5 * share * damping * steep).abs()
        };
        let omega: Vec<f64> = (-ALIASES..=ALIASES).map(mode).collect();
        let order = 2 * modes + 1 + usize::from(lag > 0.0);
        let torque = order - 1;
        // Without a lag the motor's torque is what is held, the last of all.
        let motor = if lag > 0.0 { order - 2 } else { torque };
        let mut rates = DMatrix::zeros(order, order);
        for i in 0..modes {
            rates[(i, modes + i)] = 1.0;
            rates[(modes + i, i)] = -omega[i] * omega[i];
            rates.view_mut((modes + i, modes), (1, modes)).fill(-damping * share);
            rates[(modes + i, motor)] = share;
        }
        if lag > 0.0 {
            rates[(motor, motor)] = -1.0 / lag;
            rates[(motor, torque)] = 1.0 / lag;
        }
        let part = |length: f64| {
            let map = (&rates * length).exp();
            (map.view((0, 0), (torque, torque)).into_owned(), map.view((0, torque), (torque, 1)).column(0).into_owned())
        };
        // Every mode moves, in step with the others at the samples.
        let mut state = DVector::zeros(torque);
        state.rows_mut(0, modes).fill(1.0);
        Modes { parts: [part(delay), part(period - delay)], state, modes }
    }

    fn position(&self) -> f64 {
        self.state.rows(0, self.modes).sum()
    }

    /// On to the next sample: the motor holds `before` until the delay is over, and then `torque`.
    fn travel(&mut self, before: f64, torque: f64) {
        for ((map, gain), held) in self.parts.iter().zip([before, torque]) {
            self.state = map * &self.state + gain * held;
        }
    }
}

/// Whether the real core grows in such a hand, at the worst frequency of the linear loop `world` and with this damping of the device. Even
/// samples, the delay no longer than one.
///
/// # Errors
/// As [`passivity()`].
pub fn grows(world: &World, damping: f64) -> Result<bool, Error> {
    let theta = match passivity(world)?.at_hz {
        None => ALIKE,
        Some(hz) => (2.0 * PI * hz * world.sampling.period).max(LOW),
    };
    let Ok(core) = DesktopLoop::new(&world.spec()) else { return Ok(false) };
    let is_late = world.device.lag > 0.0 || world.sampling.delay_s() > 0.0;
    let mut phases = (0..if is_late { PHASES } else { 1 }).map(|i| 2.0 * PI * i as f64 / PHASES as f64);
    Ok(phases.any(|phase| swells(&core, Modes::new(world, damping, theta, phase))))
}

/// Whether the motion grows from the middle of a run to its end.
fn swells(core: &DesktopLoop, mut modes: Modes) -> bool {
    let mut state = core.start();
    let (mut before, mut middle, mut end) = (0.0, 0.0f64, 0.0f64);
    for i in 0..SAMPLES {
        let torque = core.step(&mut state, modes.position(), 0.0).torque;
        modes.travel(before, torque);
        before = torque;
        let size = modes.state.amax();
        if !size.is_finite() || size > 1e200 {
            return true;
        }
        // The largest over as many samples each.
        if (FIRST..FIRST + SAMPLES / 10).contains(&i) {
            middle = middle.max(size);
        } else if i >= SAMPLES - SAMPLES / 10 {
            end = end.max(size);
        }
    }
    end > middle * (1.0 + SEEN)
}
