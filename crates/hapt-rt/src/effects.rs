//! The effects of a wheel for games beside the world: a ring with what plays, and what becomes of it at a sample.

use hapt_core::ExternalTorqueInput;
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
}

/// The loop's side of the effects. It reads the newest pool from a ring, and waits for nobody.
pub struct EffectsPort {
    player: Player,
    incoming: Consumer<Pool>,
    /// The host's side is gone.
    abandoned: bool,
    samples: Producer<EffectsSample>,
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
    let port = EffectsPort { player: Player::new(wheel, scale), incoming, abandoned: false, samples };
    (port, EffectsWire { pools, samples: taken })
}

impl EffectsPort {
    /// The torque of the effects beside the world's, in the sample that is taken at `now`, in ns by the loop's clock.
    pub(crate) fn sample(&mut self, beside: ExternalTorqueInput<f64>, now: u64) -> f64 {
        for _ in 0..POOLS {
            match self.incoming.pop() {
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
        let (given, playing) = self.player.sample(narrow, now / 1000);
        let _ = self.samples.push(EffectsSample { sampled: now, position, playing, world: torque, given });
        f64::from(given.torque)
    }
}
