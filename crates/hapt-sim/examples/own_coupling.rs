//! A coupling that hapt has no law for: a spring that stiffens with its deflection, -k q - c q³, added to the loop's torque.
//!
//! `cargo run -p hapt-sim --example own_coupling`
//!
//! The certificate covers the world only. The steepest slope of the own coupling, k + 3 c q², has to be within what the certificate
//! allows at the puck: here the world contains a spring of that stiffness when it is checked.

use std::error::Error;

use hapt_core::Loop;
use hapt_model::{Coupling, End, Law, Source, World};
use hapt_sim::{VirtualDevice, rows, script};

/// A device with a hand that turns it to 45° and releases it.
const WORLD: &str = r#"
[loop]
period = "1 ms"

[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
limit = "800 N mm"

[scenarios.release]
duration = "2 s"
hand = { kind = "ramp", to = "45 deg", over = "0.2 s", release = "0.5 s" }
"#;

/// N·m/rad, and N·m/rad³.
const LINEAR: f64 = 0.05;
const CUBIC: f64 = 0.2;
/// The largest deflection that the loop may meet, in rad.
const LARGEST: f64 = 1.0;

fn main() -> Result<(), Box<dyn Error>> {
    let world = World::read(&Source::from_text("device.toml", WORLD), &[])?;
    let mut steepest = world.clone();
    let stiffness = LINEAR + 3.0 * CUBIC * LARGEST * LARGEST;
    steepest.couplings.push(Coupling {
        first: End::Puck,
        second: End::Ground,
        law: Law::Spring { stiffness, rest: 0.0 },
        limit: None,
    });
    println!("with a spring as steep: {}", hapt_analysis::check(&steepest)?.verdict_sentence());

    let scenario = world.scenario("release")?;
    let period = world.sampling.period;
    let compiled = Loop::<f64, 1, 1, 1>::new(&world.spec())?;
    let mut state = compiled.start();
    let mut device = VirtualDevice::new(&world.device_spec());
    device.begin(&mut script(scenario, period));
    let limit = world.device.limit.unwrap_or(f64::INFINITY);
    println!("time, s   position, rad   command, N m");
    for k in 0..rows(scenario.duration, period) {
        if k > 0 {
            device.travel();
        }
        let (position, velocity) = device.puck();
        let sample = compiled.step(&mut state, position, velocity);
        let own = -LINEAR * position - CUBIC * position.powi(3);
        let command = (sample.command + own).clamp(-limit, limit);
        device.command(command);
        if k % 200 == 0 {
            println!("{:7.1} {position:15.4} {command:14.4}", k as f64 * period);
        }
    }
    Ok(())
}
