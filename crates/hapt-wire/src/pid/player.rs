//! A pool of effects beside a loop's world, sample by sample.

use hapt_core::ExternalTorqueInput;
use hapt_core::wheel::game_loop::HostLevel;
use hapt_core::wheel::{Effect, Given, Wheel, WheelState};

use super::descriptor::EFFECTS;
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
    /// Where and when the last sample was taken.
    last: (f32, u64),
    /// The sum of what pools have changed of the static torque, N·m, and whether one has since the last sample.
    level: f32,
    changed: bool,
}

impl Player {
    /// Nothing plays.
    pub fn new(wheel: Wheel<f32>, scale: Scale) -> Self {
        let state = wheel.start();
        Player { wheel, state, scale, pool: Pool::new(), revision: 0, last: (0.0, 0), level: 0.0, changed: false }
    }

    /// The same, for [`Player::sample_with`]: what the change does to the static torque, where the wheel was at the last sample, is the host's doing.
    pub fn receive(&mut self, pool: &Pool) {
        let [before, after] = [&self.pool, pool].map(|pool| {
            // A copy: what has ended leaves the loop's own.
            let mut pool = *pool;
            let (effects, playing) = pool.effects(self.last.1, &self.scale);
            self.wheel.level(self.last.0, effects.get(..playing).unwrap_or_default())
        });
        self.changed |= after != before;
        self.level += after - before;
        self.replace(pool);
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
        let (effects, playing) = self.playing(now);
        let effects = effects.get(..playing).unwrap_or_default();
        (self.give(&beside, effects), playing)
    }

    /// The same with a torque beside the effects, N·m, for what the host has done.
    pub fn sample_with(
        &mut self,
        beside: ExternalTorqueInput<f32>,
        now: u64,
        remedy: impl FnOnce(HostLevel<f32>) -> f32,
    ) -> (Given<f32>, usize) {
        let (mut effects, playing) = self.playing(now);
        if beside.ready {
            self.last = (beside.position, now);
            let torque = |effect: &Effect<f32>| if let Effect::Torque(torque) = effect { *torque } else { 0.0 };
            let torque = effects.iter().take(playing).map(torque).sum();
            let heard = HostLevel { level: self.level, changed: core::mem::take(&mut self.changed), torque };
            if let Some(place) = effects.get_mut(playing) {
                *place = Effect::Torque(remedy(heard));
            }
        }
        let effects = effects.get(..=playing).unwrap_or_default();
        (self.give(&beside, effects), playing)
    }

    /// What plays, with a place more, and how many.
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

    fn give(&mut self, beside: &ExternalTorqueInput<f32>, effects: &[Effect<f32>]) -> Given<f32> {
        if !beside.ready {
            // The position has no zero yet: what hangs on the wheel begins where it is when it has one.
            self.state = self.wheel.start();
            return Given::NOTHING;
        }
        self.wheel.step_with(&mut self.state, beside.position, beside.torque, effects, self.revision)
    }
}
