//! A recording as a device: it returns recorded positions and ignores torques.

use crate::{Device, Failure, Position};

/// Positions, one per period.
///
/// ```
/// use hapt_core::SafetyProfile;
/// use hapt_model::{Source, World};
/// use hapt_rt::{Cycle, Failure, Moment, Plan, Position, Replay};
///
/// let file = r#"
/// loop.period = "1 ms"
/// device.inertia = "6.4e-4 kg m^2"
/// [[couplings]]
/// kind = "spring"
/// between = ["puck", "ground"]
/// stiffness = "0.5 N m/rad"
/// "#;
/// let world = World::read(&Source::from_text("spring.toml", file), &[])?;
/// let recorded = [0.0, 0.1, 0.2].map(|position| Position { position, velocity: 0.0, announced: false });
/// let plan = Plan::new(&world, SafetyProfile::Simulated)?;
/// let mut cycle = Cycle::new(Box::new(plan), Box::new(Replay::new(recorded.to_vec())));
/// for (sample, position) in [0.0, 0.1, 0.2].into_iter().enumerate() {
///     cycle.pass(u32::from(sample > 0));
///     let record = cycle.sample(&Moment::default(), None)?;
///     assert_eq!(record.torque, -0.5 * position);
///     assert_eq!(record.output, 0.0, "disarmed");
/// }
/// cycle.pass(1);
/// assert_eq!(cycle.sample(&Moment::default(), None).unwrap_err(), Failure::Ended);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
