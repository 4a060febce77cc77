//! A pool of effects in addition to a loop's world, sample by sample.

use hapt_core::ExternalTorqueInput;
use hapt_core::wheel::game_loop::HostLevel;
use hapt_core::wheel::{Effect, Given, Wheel, WheelState};

use super::descriptor::EFFECTS;
use super::pool::{Pool, Scale};

/// The effects in a wheel's loop: it renders the newest pool, and never blocks.
#[derive(Clone, Copy, Debug)]
pub struct Player {
    wheel: Wheel<f32>,
    state: WheelState<f32>,
    scale: Scale,
    pool: Pool,
    /// Counts the changes here: two pools may have the same number.
    revision: u32,
    /// Position and time of the last sample.
    last: (f32, u64),
    /// The sum of the changes of the static torque by new pools, N·m, and whether there was one since the last sample.
    level: f32,
    changed: bool,
}

impl Player {
    /// A player without effects.
    pub fn new(wheel: Wheel<f32>, scale: Scale) -> Self {
        let state = wheel.start();
        Player { wheel, state, scale, pool: Pool::new(), revision: 0, last: (0.0, 0), level: 0.0, changed: false }
    }

    /// Replaces the pool, and adds the change of the static torque at the position of the last sample to the host's level, for [`Player::sample_with`].
    pub fn receive(&mut self, pool: &Pool) {
        let [before, after] = [&self.pool, pool].map(|pool| {
            // On a copy: `effects` removes those that have ended.
            let mut pool = *pool;
            let (effects, playing) = pool.effects(self.last.1, &self.scale);
            self.wheel.level(self.last.0, effects.get(..playing).unwrap_or_default())
        });
        self.changed |= after != before;
        self.level += after - before;
        self.replace(pool);
    }

    /// Replaces the pool from the next sample on.
    pub fn replace(&mut self, pool: &Pool) {
        self.pool = *pool;
        self.revision = self.revision.wrapping_add(1);
    }

    /// Stops all effects from the next sample on.
    pub fn stop_all(&mut self) {
        self.pool.stop_all();
        self.revision = self.revision.wrapping_add(1);
    }

    /// The torque of the effects in addition to the world's in the sample that is taken at `now`, in µs by the clock of the pool's reports, and the
    /// number of effects that play.
    pub fn sample(&mut self, input: ExternalTorqueInput<f32>, now: u64) -> (Given<f32>, usize) {
        let (effects, playing) = self.playing(now);
        let effects = effects.get(..playing).unwrap_or_default();
        (self.give(&input, effects), playing)
    }

    /// The same with an additional torque, N·m, computed by `remedy` from the host's level.
    pub fn sample_with(
        &mut self,
        input: ExternalTorqueInput<f32>,
        now: u64,
        remedy: impl FnOnce(HostLevel<f32>) -> f32,
    ) -> (Given<f32>, usize) {
        let (mut effects, playing) = self.playing(now);
        if input.ready {
            self.last = (input.position, now);
            let torque = |effect: &Effect<f32>| if let Effect::Torque(torque) = effect { *torque } else { 0.0 };
            let torque = effects.iter().take(playing).map(torque).sum();
            let level = HostLevel { level: self.level, changed: core::mem::take(&mut self.changed), torque };
            if let Some(place) = effects.get_mut(playing) {
                *place = Effect::Torque(remedy(level));
            }
        }
        let effects = effects.get(..=playing).unwrap_or_default();
        (self.give(&input, effects), playing)
    }

    /// The effects that play, in an array with one more place, and their number.
    fn playing(&mut self, now: u64) -> ([Effect<f32>; EFFECTS + 1], usize) {
        let before = self.pool.revision();
        let (effects, playing) = self.pool.effects(now, &self.scale);
        if self.pool.revision() != before {
            self.revision = self.revision.wrapping_add(1);
        }
        let mut all = [Effect::Torque(0.0); EFFECTS + 1];
        for (place, effect) in all.iter_mut().zip(effects) {
            *place = effect;
        }
        (all, playing)
    }

    fn give(&mut self, input: &ExternalTorqueInput<f32>, effects: &[Effect<f32>]) -> Given<f32> {
        if !input.ready {
            // The position has no zero yet: the state starts at the position at which the zero is set.
            self.state = self.wheel.start();
            return Given::NOTHING;
        }
        self.wheel.step_with(&mut self.state, input.position, input.torque, effects, self.revision)
    }
}
