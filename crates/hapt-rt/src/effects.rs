//! The effects of a game wheel in addition to the world: a ring of effect pools, and the torque at each sample.

use hapt_core::ExternalTorqueInput;
use hapt_core::wheel::game_loop::{GameLoop, GameLoopState, GameReport, HostLevel};
use hapt_core::wheel::{Given, Wheel};
use hapt_wire::pid::{Player, Pool, Scale};
use rtrb::{Consumer, Producer, RingBuffer};

/// Capacity of the ring of pools.
const POOLS: usize = 8;
/// Capacity of the ring of samples.
const SAMPLES: usize = 256;

/// The effects at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffectsSample {
    /// The time of the sample, in ns by the loop's clock.
    pub sampled: u64,
    /// The wheel's position, rad.
    pub position: f64,
    /// The number of effects that play.
    pub playing: usize,
    /// The world's torque, before the motor's limit, N·m.
    pub world: f64,
    /// The requested and the given torque of the effects, without the world's.
    pub given: Given<f32>,
    /// The loop that the host closes, where it is monitored.
    pub game: GameReport<f64>,
}

/// The monitor of the loop that a host closes, with its counter-measure.
struct Watch {
    game: GameLoop<f64>,
    state: GameLoopState<f64>,
}

/// The loop's side of the effects. It reads the newest pool from a ring, and never blocks.
pub struct EffectsPort {
    player: Player,
    incoming: Consumer<Pool>,
    /// Whether the host's side was dropped.
    abandoned: bool,
    samples: Producer<EffectsSample>,
    watch: Option<Box<Watch>>,
}

/// The host's side of the effects. Dropping it stops them.
pub struct EffectsWire {
    /// The pool after each change. Its times are by the clock of the samples.
    pub pools: Producer<Pool>,
    /// One per sample; samples that find the ring full are lost.
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
    /// The same with a monitor that detects the loop that a host closes, and damps it.
    #[must_use]
    pub fn watching(self, game: GameLoop<f64>) -> Self {
        let state = game.start();
        EffectsPort { watch: Some(Box::new(Watch { game, state })), ..self }
    }

    /// The torque of the effects in addition to the world's, in the sample that is taken at `now`, in ns by the loop's clock.
    pub(crate) fn sample(&mut self, input: ExternalTorqueInput<f64>, now: u64) -> f64 {
        for _ in 0..POOLS {
            match self.incoming.pop() {
                Ok(pool) if self.watch.is_some() => self.player.receive(&pool),
                Ok(pool) => self.player.replace(&pool),
                Err(_) => break,
            }
        }
        if !self.abandoned && self.incoming.is_abandoned() {
            self.abandoned = true;
            self.player.stop_all();
        }
        let ExternalTorqueInput { ready, position, velocity, torque } = input;
        let narrow =
            ExternalTorqueInput { ready, position: position as f32, velocity: velocity as f32, torque: torque as f32 };
        let (given, playing, game) = match self.watch.as_deref_mut() {
            None => {
                let (given, playing) = self.player.sample(narrow, now / 1000);
                (given, playing, GameReport::NOTHING)
            }
            Some(Watch { game, state }) => {
                let (mut given, playing) = self.player.sample_with(narrow, now / 1000, |level| {
                    let HostLevel { level, changed, torque } = level;
                    let level = HostLevel { level: level.into(), changed, torque: torque.into() };
                    game.step(state, position, level) as f32
                });
                game.commanded(state, torque + f64::from(given.torque));
                // The monitor's own torque is not a request of the host.
                given.requested -= state.report().torque as f32;
                (given, playing, *state.report())
            }
        };
        let _ = self.samples.push(EffectsSample { sampled: now, position, playing, world: torque, given, game });
        f64::from(given.torque)
    }
}
