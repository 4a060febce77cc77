//! A pool of effects beside a loop's world, sample by sample.

use hapt_core::ExternalTorqueInput;
use hapt_core::wheel::{Given, Wheel, WheelState};

use super::pool::{Pool, Scale};

/// What a wheel's loop holds of the effects: it renders the newest pool, and asks nobody.
#[derive(Clone, Copy, Debug)]
pub struct Player {
    wheel: Wheel<f32>,
    state: WheelState<f32>,
    scale: Scale,
    pool: Pool,
    /// Counts what has changed here: two pools may have the same number.
    revision: u32,
}

impl Player {
    /// Nothing plays.
    pub fn new(wheel: Wheel<f32>, scale: Scale) -> Self {
        let state = wheel.start();
        Player { wheel, state, scale, pool: Pool::new(), revision: 0 }
    }

    /// From the next sample on this is played.
    pub fn replace(&mut self, pool: &Pool) {
        self.pool = *pool;
        self.revision = self.revision.wrapping_add(1);
    }

    /// From the next sample on nothing plays.
    pub fn stop_all(&mut self) {
        self.pool.stop_all();
        self.revision = self.revision.wrapping_add(1);
    }

    /// The torque of the effects beside the world's in the sample that is taken at `now`, in µs by the clock of the pool's reports, and how
    /// many of them play.
    pub fn sample(&mut self, beside: ExternalTorqueInput<f32>, now: u64) -> (Given<f32>, usize) {
        let before = self.pool.revision();
        let (effects, playing) = self.pool.effects(now, &self.scale);
        if self.pool.revision() != before {
            self.revision = self.revision.wrapping_add(1);
        }
        if !beside.ready {
            // The position has no zero yet: what hangs on the wheel begins where it is when it has one.
            self.state = self.wheel.start();
            return (Given::NOTHING, playing);
        }
        let effects = effects.get(..playing).unwrap_or_default();
        let given = self.wheel.step_with(&mut self.state, beside.position, beside.torque, effects, self.revision);
        (given, playing)
    }
}
