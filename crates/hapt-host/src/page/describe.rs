//! The description of a world for the page.

use hapt_model::{Coupling, Drive, Hand, Law, Shape, Side, World};
use hapt_sim::Measures;

use crate::config::WorldConfig;
use crate::frames::columns_of;
use crate::keys::{end, kind};
use crate::messages::{BodyInfo, CouplingInfo, LawNumbers, ScenarioInfo, Units, WorldInfo};

/// Describes the world of a session.
pub fn describe(config: &WorldConfig) -> WorldInfo {
    let world = &config.world;
    let motion = world.motion;
    let (worlds, place) = config.worlds();
    WorldInfo {
        generation: config.generation,
        title: world.title.as_ref().unwrap_or(&config.source().name).clone(),
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
        couplings: (world.couplings.iter().enumerate()).map(|(index, of)| coupling(world, index, of)).collect(),
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
fn coupling(world: &World, index: usize, coupling: &Coupling) -> CouplingInfo {
    // One number for both frictions: the level when sliding.
    let name = |name| if name == "coulomb" { "torque" } else { name };
    let mut law = coupling.law;
    let numbers = law.quantities().map(|quantity| (name(quantity.name), *quantity.value)).collect();
    CouplingInfo {
        kind: kind(coupling),
        between: [coupling.first, coupling.second].map(|of| end(world, of).into()),
        key: format!("couplings.{index}"),
        numbers: LawNumbers(numbers),
        side: coupling.law.side().map(Side::name),
        depth: depth(coupling),
    }
}

/// Places in a pitch of a texture at which a page draws it.
const DEPTHS: u32 = 24;

/// [`CouplingInfo::depth`].
fn depth(coupling: &Coupling) -> Option<Vec<f64>> {
    let Law::Texture { pitch, phase, .. } = coupling.law else { return None };
    let stored = |i| coupling.stored(phase + pitch * f64::from(i) / f64::from(DEPTHS), 0.0);
    let energies: Vec<f64> = (0..DEPTHS).map(stored).collect();
    let low = energies.iter().copied().fold(f64::INFINITY, f64::min);
    let high = energies.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Some(energies.iter().map(|energy| if high > low { (high - energy) / (high - low) } else { 0.0 }).collect())
}
