//! Steps of the bodies whose iteration for the nonlinear torques does not converge: counted, and none with one body.

use hapt_model::{Source, World};
use hapt_sim::{Simulation, Summary};

/// How many of 1000 steps have not settled, at `period` in s.
fn unsettled(bodies: &[(f64, f64, f64)], detents: &[([&str; 2], f64, f64, f64)], period: f64) -> u32 {
    let mut file = format!("loop.period = {period}\ndevice.inertia = 1\n");
    for (i, (inertia, position, velocity)) in bodies.iter().enumerate() {
        file += &format!("[bodies.b{i}]\ninertia = {inertia}\nposition = {position}\nvelocity = {velocity}\n");
    }
    for ([first, second], torque, pitch, phase) in detents {
        file +=
            &format!("[[couplings]]\nkind = \"detent\"\nbetween = [\"{first}\", \"{second}\"]\ntorque = {torque}\n");
        file += &format!("pitch = {pitch}\nphase = {phase}\n");
    }
    let duration = 1000.0 * period;
    file += &format!("[scenarios.all]\nduration = {duration}\nhand = {{ kind = \"step\", to = 0 }}\n");
    let world = World::read(&Source::from_text("w.toml", file), &[]).unwrap();
    let mut run = Simulation::new(&world, &world.scenarios[0]).unwrap();
    let mut summary = Summary::new(&world, &run);
    while let Some(row) = run.next() {
        summary.add(row.unwrap());
    }
    summary.unsettled
}

#[test]
fn the_iteration_for_three_detents_of_one_body_converges_in_every_step() {
    let ground = |at| [at, "ground"];
    let detents = [(ground("b0"), 0.5, 0.31, 0.1), (ground("b0"), 0.7, 0.23, 0.0), (["puck", "b0"], 0.4, 0.17, 0.05)];
    let stiffness: f64 = detents.iter().map(|(_, torque, pitch, _)| std::f64::consts::TAU * torque / pitch).sum();
    for radians in [1.0, 2.5, 4.0, 10.0] {
        let period = radians / (stiffness / 2e-3_f64).sqrt();
        assert_eq!(unsettled(&[(2e-3, -0.14, -2.9)], &detents, period), 0, "{radians} rad a step");
    }
}

#[test]
fn steps_of_several_bodies_that_do_not_converge_are_counted() {
    let bodies = [(0.00202, -0.1375, -2.893), (0.00404, -0.0375, 1.446)];
    let detents = [
        (["b0", "ground"], 0.483, 0.3886, 0.36),
        (["b1", "ground"], 0.398, 0.11867, 0.312),
        (["b0", "b1"], 0.8136, 0.13079, 0.31),
        (["b1", "b0"], 0.3807, 0.29452, 0.309),
    ];
    assert!(unsettled(&bodies, &detents, 0.0196) > 0);
    assert_eq!(unsettled(&bodies, &detents, 0.005), 0);
}
