//! In place of an encoder: a puck that swings to and fro by itself, 1 rad there and 1 rad back, 0.1 mrad a sample.

/// Its farthest from 0, in rad.
const FARTHEST: f32 = 0.5;
/// The displacement of a sample, in rad.
const STEP: f32 = 1e-4;

/// The puck.
pub struct Swing {
    position: f32,
    step: f32,
}

impl Swing {
    /// At 0.
    pub const START: Swing = Swing { position: 0.0, step: STEP };

    /// Its position at the next sample, in rad.
    pub fn next(&mut self) -> f32 {
        if self.position.abs() > FARTHEST {
            self.step = if self.position > 0.0 { -STEP } else { STEP };
        }
        self.position += self.step;
        self.position
    }
}
