//! The description of a world for the page.

use hapt_model::{Drive, Hand, Shape, World};
use hapt_sim::Measures;
use serde_json::{Value, json};

use crate::config::WorldConfig;
use crate::frames::columns_of;
use crate::keys::{end, kind};
use crate::messages::{BodyInfo, ScenarioInfo, Units, WorldInfo};

/// Describes the world of a session.
pub fn describe(config: &WorldConfig) -> WorldInfo {
    let world = &config.world;
    let motion = world.motion;
    let (worlds, place) = config.worlds();
    WorldInfo {
        generation: config.generation,
        title: worlds[place].title.clone(),
        worlds,
        place,
        motion: motion.name(),
        units: Units {
            position: Measures::Position.unit(motion),
            velocity: Measures::Velocity.unit(motion),
            effort: Measures::Effort.unit(motion),
        },
        period_s: world.sampling.period,
        step_s: world.sampling.step(),
        limit: world.device.limit,
        device: config.device().into(),
        bodies: (world.names.iter().zip(&world.bodies))
            .map(|(name, body)| BodyInfo { name: name.clone(), inertia: body.inertia })
            .collect(),
        couplings: (0..world.couplings.len()).map(|index| coupling(world, index)).collect(),
        scenarios: (world.scenarios.iter())
            .map(|scenario| ScenarioInfo {
                name: scenario.name.clone(),
                duration_s: scenario.duration,
                hand: hand(&scenario.hand),
            })
            .collect(),
        keys: config.keys().to_vec(),
        changes: config.changes().to_vec(),
        columns: columns_of(world),
    }
}

fn hand(hand: &Hand) -> &'static str {
    match &hand.drive {
        Drive::Position(Shape::Step { .. }) => "step",
        Drive::Position(Shape::Ramp { .. }) => "ramp",
        Drive::Position(Shape::Sine { .. }) => "sine",
        Drive::Position(Shape::Path { .. }) => "path",
        Drive::Torque(_) => "torque",
        Drive::Grip { .. } => "grip",
    }
}

/// A coupling, with the numbers for drawing it.
fn coupling(world: &World, index: usize) -> Value {
    let Some(coupling) = world.couplings.get(index) else { return Value::Null };
    let ends = [end(world, coupling.first), end(world, coupling.second)];
    let mut info = json!({ "kind": kind(coupling), "between": ends, "key": format!("couplings.{index}") });
    // One number for both frictions: the level when sliding.
    let mut law = coupling.law;
    for quantity in law.quantities() {
        info[if quantity.name == "coulomb" { "torque" } else { quantity.name }] = json!(*quantity.value);
    }
    if let Some(waveform) = coupling.law.waveform() {
        (info["sine"], info["cosine"]) = (json!(waveform.sine), json!(waveform.cosine));
    }
    if let Some(side) = coupling.law.side() {
        info["side"] = json!(side.name());
    }
    info
}
