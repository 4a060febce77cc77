//! A world built in Rust: a flywheel on springs of several stiffnesses, simulated and certified.
//!
//! `cargo run -p hapt-sim --example flywheel`

use std::error::Error;

use hapt_model::{Body, Coupling, Drive, End, Hand, Law, Scenario, Shape, Source, World};
use hapt_sim::{Simulation, Summary};

/// The loop and the device, with the defaults of world files.
const DEVICE: &str = r#"
[loop]
period = "1 ms"

[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
limit = "822.25 N mm"
"#;

fn main() -> Result<(), Box<dyn Error>> {
    let device = World::read(&Source::from_text("device.toml", DEVICE), &[])?;
    println!("stiffness, N m/rad   peak torque, N m   certified");
    for stiffness in [0.5, 1.0, 2.0, 4.0] {
        // Everything is in SI: kg m^2, rad, N m.
        let mut world = device.clone();
        world.names.push("wheel".into());
        world.bodies.push(Body { inertia: 0.0258, position: 0.0, velocity: 0.0 });
        world.couplings.push(Coupling {
            first: End::Puck,
            second: End::Body(0),
            law: Law::Spring { stiffness, rest: 0.0 },
            limit: None,
        });
        // A hand that turns the puck by 0.4 rad in a tenth of a second, and holds it there.
        let turn = Shape::Ramp { to: 0.4, at: 0.0, over: 0.1 };
        let hand = Hand { drive: Drive::Position(turn), release: None };
        let scenario = Scenario { name: "turn".into(), duration: 1.0, hand, timing: Default::default() };

        let mut run = Simulation::new(&world, &scenario)?;
        let mut summary = Summary::new(&world, &run);
        while let Some(row) = run.next() {
            summary.add(row?);
        }
        let certified = hapt_analysis::check(&world)?.certified.holds();
        println!("{stiffness:18.1} {:18.3}   {certified}", summary.peak_torque);
    }
    Ok(())
}
