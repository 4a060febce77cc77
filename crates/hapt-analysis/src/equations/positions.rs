//! A world as it is near one position of the puck.
//!
//! Requirements add the steepest slopes of all couplings, and a wall above and a wall below are never touched at once: the sum may be steeper than
//! the world is anywhere. So a sum proves, and only slopes that one position has refute.

use std::borrow::Cow;

use hapt_model::{Coupling, End, Law, Side, World};

use crate::equations::laws;

/// The world near each position of the puck that differs: without the walls, dead bands and magnets between puck and ground that have no slope
/// there, and with textures that rise as steeply as they do somewhere, not as they fall. A world that has no more slopes than another
/// is left out.
pub(crate) fn at_positions(world: &World) -> Vec<Cow<'_, World>> {
    let placed: Vec<usize> = (0..world.couplings.len()).filter(|&i| !faces(&world.couplings[i]).is_empty()).collect();
    let mut faces: Vec<f64> = placed.iter().flat_map(|&i| faces(&world.couplings[i])).collect();
    faces.sort_by(f64::total_cmp);
    faces.dedup();
    // Just above and just below each, so that every part between two of them is seen.
    let positions = faces.iter().flat_map(|face| [face.next_down(), face.next_up()]);
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for z in positions {
        let felt: Vec<usize> = placed.iter().copied().filter(|&i| is_felt(&world.couplings[i], z)).collect();
        let within = |of: &[usize], in_all: &[usize]| of.iter().all(|i| in_all.contains(i));
        if !sets.iter().any(|set| within(&felt, set)) {
            sets.retain(|set| !within(set, &felt));
            sets.push(felt);
        }
    }
    let has_texture = world.couplings.iter().any(|c| matches!(c.law, Law::Texture { .. }));
    if !has_texture && sets.iter().all(|set| set.len() == placed.len()) {
        return vec![Cow::Borrowed(world)];
    }
    if sets.is_empty() {
        sets.push(Vec::new());
    }
    let near = |felt: &Vec<usize>| {
        let mut near = world.clone();
        for (index, coupling) in near.couplings.iter_mut().enumerate() {
            // Replaced in place, so that the others keep their indices.
            if placed.contains(&index) && !felt.contains(&index) {
                *coupling = Law::Constant { torque: 0.0 }.between(coupling.first, coupling.second);
            } else if let Law::Texture { pitch, phase, .. } = coupling.law {
                let torque = pitch / std::f64::consts::TAU * laws::steepest_rise(coupling);
                coupling.law = Law::Detent { torque, pitch, phase };
            }
        }
        Cow::Owned(near)
    };
    sets.iter().map(near).collect()
}

/// -1 where a coupling between puck and ground takes the puck's position with the other sign; `None` for couplings of other ends.
fn sign(coupling: &Coupling) -> Option<f64> {
    match (coupling.first, coupling.second) {
        (End::Puck, End::Ground) => Some(1.0),
        (End::Ground, End::Puck) => Some(-1.0),
        (End::Puck | End::Ground | End::Body(_), _) => None,
    }
}

/// The positions of the puck where the slope of a coupling to ground begins or ends, and a magnet's place.
fn faces(coupling: &Coupling) -> Vec<f64> {
    let Some(sign) = sign(coupling) else { return Vec::new() };
    match coupling.law {
        Law::Wall { at, .. } | Law::Magnet { at, .. } => vec![sign * at],
        Law::DeadBand { rest, width, .. } => vec![sign * (rest - width), sign * (rest + width)],
        _ => Vec::new(),
    }
}

/// Whether a coupling with faces has its steepest slope at the position `z`, which is next to a face.
fn is_felt(coupling: &Coupling, z: f64) -> bool {
    let q = sign(coupling).unwrap_or(0.0) * z;
    match coupling.law {
        Law::Wall { side: Side::Above, at, .. } => q > at,
        Law::Wall { side: Side::Below, at, .. } => q < at,
        Law::DeadBand { rest, width, .. } => q > rest + width || q < rest - width,
        Law::Magnet { at, .. } => (q.next_down()..=q.next_up()).contains(&at),
        _ => true,
    }
}
