//! The effects of a wheel for games beside the world: a ring with what plays, and what becomes of it at a sample.

use hapt_core::ExternalTorqueInput;
use hapt_core::wheel::game_loop::{GameLoop, GameLoopState, GameReport, HostLevel};
use hapt_core::wheel::{Given, Wheel};
use hapt_wire::pid::{Player, Pool, Scale};
use rtrb::{Consumer, Producer, RingBuffer};

/// Capacity of the ring of pools.
const POOLS: usize = 8;
/// Capacity of the ring of samples.
const SAMPLES: usize = 256;

/// What a sample has made of the effects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectsSample {
    /// When it was taken, in ns by the loop's clock.
    pub sampled: u64,
    /// The wheel's position, rad.
    pub position: f64,
    /// How many effects play.
    pub playing: usize,
    /// The world's torque, before the motor's limit, N·m.
    pub world: f64,
    /// What was asked and what is given, beside the world's torque.
    pub given: Given<f32>,
    /// The loop that the host closes, where it is looked for.
    pub game: GameReport<f64>,
}

/// The loop that a host closes, and what is done about it.
struct Watch {
    game: GameLoop<f64>,
    state: GameLoopState<f64>,
}

/// The loop's side of the effects. It reads the newest pool from a ring, and waits for nobody.
pub struct EffectsPort {
    player: Player,
    incoming: Consumer<Pool>,
    /// The host's side is gone.
    abandoned: bool,
    samples: Producer<EffectsSample>,
    watch: Option<Box<Watch>>,
}

/// The host's side of them. Dropped, in whatever way, it ends them.
pub struct EffectsWire {
    /// The pool after a change. Its times are those of the samples.
    pub pools: Producer<Pool>,
    /// One a sample; those without room are lost.
    pub samples: Consumer<EffectsSample>,
}

/// Effects on this wheel, where full scale of the reports is `scale`.
pub fn effects(wheel: Wheel<f32>, scale: Scale) -> (EffectsPort, EffectsWire) {
    let (pools, incoming) = RingBuffer::new(POOLS);
    let (samples, taken) = RingBuffer::new(SAMPLES);
    let port = EffectsPort { player: Player::new(wheel, scale), incoming, abandoned: false, samples, watch: None };
    (port, EffectsWire { pools, samples: taken })
}

impl EffectsPort {
    /// The same with the loop that a host closes, found and kept quiet.
    #[must_use]
    pub fn watching(self, game: GameLoop<f64>) -> Self {
        let state = game.start();
        EffectsPort { watch: Some(Box::new(Watch { game, state })), ..self }
    }

    /// The torque of the effects beside the world's, in the sample that is taken at `now`, in ns by the loop's clock.
    pub(crate) fn sample(&mut self, beside: ExternalTorqueInput<f64>, now: u64) -> f64 {
        for _ in 0..POOLS {
            match self.incoming.pop() {
                Ok(pool) if self.watch.is_some() => self.player.hear(&pool),
                Ok(pool) => self.player.replace(&pool),
                Err(_) => break,
            }
        }
        if !self.abandoned && self.incoming.is_abandoned() {
            self.abandoned = true;
            self.player.stop_all();
        }
        let ExternalTorqueInput { ready, position, velocity, torque } = beside;
        let narrow =
            ExternalTorqueInput { ready, position: position as f32, velocity: velocity as f32, torque: torque as f32 };
        let (given, playing, game) = match self.watch.as_deref_mut() {
            None => {
                let (given, playing) = self.player.sample(narrow, now / 1000);
                (given, playing, GameReport::NOTHING)
            }
            Some(Watch { game, state }) => {
                let (mut given, playing) = self.player.sample_with(narrow, now / 1000, |heard| {
                    let HostLevel { level, changed, torque } = heard;
                    let heard = HostLevel { level: level.into(), changed, torque: torque.into() };
                    game.step(state, position, heard) as f32
                });
                game.commanded(state, torque + f64::from(given.torque));
                // What is added is not what the host has asked for.
                given.asked -= state.report().torque as f32;
                (given, playing, *state.report())
            }
        };
        let _ = self.samples.push(EffectsSample { sampled: now, position, playing, world: torque, given, game });
        f64::from(given.torque)
    }
}
