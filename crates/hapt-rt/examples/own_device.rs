//! A custom device in the loop: implement the two functions of [`Device`].
//!
//! Here it is a motor simulated in a few lines, so that the example runs anywhere, and [`Cycle`] takes the samples one after the other.
//! With hardware, `read` reads the encoder, `write` sets the current, and [`hapt_rt::Engine`] takes the samples on its own thread.
//!
//! For a microcontroller that runs the loop itself there is a template: `firmware/template`.
//!
//! `cargo run -p hapt-rt --example own_device`

use std::error::Error;

use hapt_core::{Request, SafetyProfile};
use hapt_model::{Source, World};
use hapt_rt::{Cycle, Device, Failure, Moment, Plan, Position};

/// A spring to ground, and a motor that starts a fifth of a radian away from the spring's rest.
const WORLD: &str = r#"
[loop]
period = "1 ms"
estimator = "difference"

[device]
inertia = "6.4e-4 kg m^2"
damping = "6e-3 N m s/rad"
limit = "0.8 N m"

[[couplings]]
kind = "spring"
between = ["puck", "ground"]
stiffness = "0.5 N m/rad"
"#;

/// A motor with an encoder: J dω/dt = torque - b ω.
struct Motor {
    /// kg m^2.
    inertia: f64,
    /// N m s/rad.
    damping: f64,
    /// s.
    period: f64,
    /// rad.
    position: f64,
    /// rad/s.
    velocity: f64,
    /// N m, held until the next sample.
    torque: f64,
}

impl Device for Motor {
    fn read(&mut self) -> Result<Position, Failure> {
        // The loop estimates the velocity where the device does not measure it.
        Ok(Position { position: self.position, velocity: 0.0, announced: false })
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        self.torque = torque;
        Ok(())
    }

    /// Advances the simulated motor; with hardware this function is not needed.
    fn passed(&mut self, periods: u32) {
        for _ in 0..periods {
            let acceleration = (self.torque - self.damping * self.velocity) / self.inertia;
            self.velocity += acceleration * self.period;
            self.position += self.velocity * self.period;
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let world = World::read(&Source::from_text("spring.toml", WORLD), &[])?;
    let (inertia, damping) = (world.device.inertia, world.device.damping);
    let period = world.sampling.period;
    let motor = Motor { inertia, damping, period, position: 0.2, velocity: 0.0, torque: 0.0 };
    let plan = Plan::new(&world, SafetyProfile::Simulated)?;
    let mut cycle = Cycle::new(Box::new(plan), Box::new(motor));
    println!("time, s   phase        position, rad   torque, N m");
    for sample in 0..1000_u32 {
        let periods = u32::from(sample > 0);
        cycle.pass(periods);
        // A loop begins disarmed. Armed, its torque fades in.
        let request = (sample == 10).then_some(Request::Arm);
        let record = cycle.sample(&Moment { periods, ..Moment::default() }, request)?;
        if sample % 100 == 0 {
            let time = f64::from(sample) * period;
            println!(
                "{time:7.3}   {:11}  {:13.4} {:13.4}",
                format!("{:?}", record.phase),
                record.position,
                record.output
            );
        }
    }
    Ok(())
}
