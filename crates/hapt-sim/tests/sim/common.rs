//! Worlds built in code, and the rows of runs.

use hapt_model::*;
use hapt_sim::{Row, Simulation};

/// The Michigan wheel without friction, encoder or limit, at 1 ms, and nothing virtual.
pub fn bare() -> World {
    World::new(Sampling::new(1e-3), Device { damping: 1.2e-3, ..Device::new(6.4e-4) })
}

/// The notes' stiffness and inertia: 1 Hz, 800 N·mm at 45°.
pub const STIFFNESS: f64 = 1.0185916357881302;
pub const INERTIA: f64 = 0.02580122754655959;

/// The notes' virtual wheel on its torsional spring.
pub fn wheel(method: Method, output: Output) -> World {
    let mut world = bare();
    world.sampling.method = method;
    world.sampling.output = output;
    world.names = vec!["wheel".into()];
    world.bodies = vec![Body { inertia: INERTIA, position: 0.0, velocity: 0.0 }];
    world.couplings = vec![spring(End::Puck, End::Body(0), STIFFNESS)];
    world
}

pub fn spring(first: End, second: End, stiffness: f64) -> Coupling {
    Coupling { first, second, law: Law::Spring { stiffness, rest: 0.0 }, limit: None }
}

pub fn scenario(duration: f64, drive: Drive, release: Option<f64>) -> Scenario {
    Scenario { name: "test".into(), duration, hand: Hand { drive, release }, timing: Default::default() }
}

pub fn step(to: f64, at: f64) -> Drive {
    Drive::Position(Shape::Step { to, at })
}

/// Every row of a run.
pub fn rows(world: &World, scenario: &Scenario) -> Vec<Row> {
    let mut run = Simulation::new(world, scenario).unwrap();
    let mut rows = Vec::new();
    while let Some(row) = run.next() {
        rows.push(row.unwrap().clone());
    }
    assert_eq!(rows.len() as u64, run.rows());
    rows
}
