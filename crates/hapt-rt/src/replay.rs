//! A recording as a device: it returns recorded positions and ignores torques.

use crate::{Device, Failure, Position};

/// Positions, one a period.
pub struct Replay {
    positions: Vec<Position>,
    next: usize,
}

impl Replay {
    /// The first position is that of the first sample.
    pub fn new(positions: Vec<Position>) -> Self {
        Replay { positions, next: 0 }
    }
}

impl Device for Replay {
    fn read(&mut self) -> Result<Position, Failure> {
        self.positions.get(self.next).copied().ok_or(Failure::Ended)
    }

    fn write(&mut self, _torque: f64) -> Result<(), Failure> {
        Ok(())
    }

    fn passed(&mut self, periods: u32) {
        self.next = self.next.saturating_add(periods as usize);
    }
}
