//! The same bits: worlds by every method on every board, and here.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use fastrand::Rng;
use hapt_core::Method;
use hapt_model::{Coupling, End, EstimatorKind, Law, Output, World};

use super::{BOARDS, Extent, has_tools, on_all_boards, qemu, trace};
use crate::notes::world;
use crate::truth::worlds;

/// Samples of each world. Every thousand the supervisor is armed, disarmed, stopped and cleared.
const SHORT: u32 = 4_000;
const FULL: u32 = 100_000;

/// Every board makes this machine's bits: of the notes' worlds, and of nonlinear ones, by every method.
pub fn same(extent: Extent) -> Result<()> {
    if !has_tools()? {
        return Ok(());
    }
    let samples = if extent == Extent::Full { FULL } else { SHORT };
    let cases = cases(samples)?;
    let mut file = samples.to_le_bytes().to_vec();
    let mut wanted = Vec::new();
    for (_, bytes) in &cases {
        file.extend((bytes.len() as u32).to_le_bytes());
        file.extend(bytes);
        let (bare, guarded, _) = trace::sums(bytes, samples).context("a case that this machine refuses")?;
        wanted.push(format!("{:016x} {:016x}", bare.0, guarded.0));
    }
    let all = on_all_boards("bits", |machine, program| qemu(machine, program, &file, &[]))?;
    for ((machine, _, processor), printed) in BOARDS.iter().zip(all) {
        let mut lines = printed.lines();
        for ((name, _), wanted) in cases.iter().zip(&wanted) {
            let got = lines.next().unwrap_or("nothing");
            ensure!(got == wanted, "{machine}: {name}: {got}, where this machine has {wanted}");
        }
        let stack = lines.next().unwrap_or_default();
        println!("        {machine} ({processor}): {} worlds of {samples} samples, {stack} bytes", cases.len());
    }
    Ok(())
}

/// Worlds that fit into a microcontroller, none of which diverges.
fn cases(samples: u32) -> Result<Vec<(String, Vec<u8>)>> {
    let mut cases = Vec::new();
    for path in crate::programs::worlds(Path::new("worlds/notes"))? {
        let name = path.file_stem().context("a name")?.to_string_lossy().into_owned();
        cases.push((name.clone(), bytes(&world(&name)?)?));
    }
    let mut rng = Rng::with_seed(7);
    for method in Method::ALL {
        let mut wheel = world("default")?;
        wheel.sampling.method = method;
        if method.takes_new_sample_first() {
            wheel.sampling.output = Output::Start;
        }
        cases.push((format!("default, {}", method.name()), bytes(&wheel)?));
        let nonlinear = loop {
            let world = worlds::random(&mut rng, true);
            if world.sampling.method != method || world.bodies.is_empty() {
                continue;
            }
            let bytes = bytes(&world)?;
            if trace::sums(&bytes, samples).is_some_and(|(_, _, finite)| finite) {
                break bytes;
            }
        };
        cases.push((format!("nonlinear, {}", method.name()), nonlinear));
    }
    for estimator in [EstimatorKind::Foaw, EstimatorKind::FoawBest, EstimatorKind::Kalman, EstimatorKind::Levant] {
        let mut rough = world("default")?;
        (rough.sampling.cutoff, rough.sampling.acceleration) = (Some(50.0), Some(1000.0));
        (rough.sampling.estimator, rough.device.encoder, rough.device.levels) = (estimator, Some(4000.0), Some(2048));
        let law = Law::Lugre {
            coulomb: 0.05,
            stribeck: 0.08,
            stribeck_velocity: 0.1,
            bristle_stiffness: 20.0,
            bristle_damping: 0.01,
            viscous: 1e-3,
        };
        rough.couplings.push(Coupling { first: End::Puck, second: End::Ground, law, limit: None });
        let law = Law::Detent { torque: 0.1, pitch: 0.2, phase: 0.0 };
        rough.couplings.push(Coupling { first: End::Body(0), second: End::Ground, law, limit: None });
        cases.push((format!("rough, {}", estimator.name()), bytes(&rough)?));
    }
    Ok(cases)
}

/// As hapt-wire writes them.
pub fn bytes(world: &World) -> Result<Vec<u8>> {
    let mut room = [0; 1024];
    Ok(hapt_wire::write(&world.spec(), &mut room)?.to_vec())
}
