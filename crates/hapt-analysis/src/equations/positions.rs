//! A world as it is near one position of the puck.
//!
//! Requirements add the steepest slopes of all couplings, and a wall above and a wall below are never touched at once: the sum may be steeper than
//! the world is anywhere. So a sum proves, and only slopes that one position has refute.

use std::borrow::Cow;

use hapt_model::{Coupling, End, Law, World};

use crate::equations::laws;

/// The world near each position of the puck that differs: without the walls, dead bands and magnets between puck and ground that have no slope
/// there, and with textures that rise as steeply as they do somewhere, not as they fall. A world that has no more slopes than another
/// is left out.
pub(crate) fn at_positions(world: &World) -> Vec<Cow<'_, World>> {
    let ranges = world.couplings.iter().map(steep_over).enumerate().filter(|(_, ranges)| !ranges.is_empty());
    let placed: Vec<(usize, Vec<[f64; 2]>)> = ranges.collect();
    let mut faces: Vec<f64> = placed.iter().flat_map(|(_, ranges)| ranges.concat()).filter(|z| z.is_finite()).collect();
    faces.sort_by(f64::total_cmp);
    faces.dedup();
    // Just above and just below each, so that every part between two of them is seen.
    let positions = faces.iter().flat_map(|face| [face.next_down(), face.next_up()]);
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for z in positions {
        let is_in = |[low, high]: &[f64; 2]| *low < z && z < *high;
        let felt: Vec<usize> =
            placed.iter().filter(|(_, over)| over.iter().any(is_in)).map(|(index, _)| *index).collect();
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
            if placed.iter().any(|(placed, _)| *placed == index) && !felt.contains(&index) {
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

/// The positions of the puck over which a coupling to ground has its steepest slope; none where that is everywhere, and of couplings of other
/// ends.
fn steep_over(coupling: &Coupling) -> Vec<[f64; 2]> {
    match (coupling.first, coupling.second) {
        (End::Puck, End::Ground) => laws::steep_over(&coupling.law),
        (End::Ground, End::Puck) => {
            laws::steep_over(&coupling.law).into_iter().map(|[low, high]| [-high, -low]).collect()
        }
        (End::Puck | End::Ground | End::Body(_), _) => Vec::new(),
    }
}
