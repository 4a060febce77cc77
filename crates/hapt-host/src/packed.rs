//! Packs a world for a board.

use hapt_core::{Loop, SafetyProfile, Supervisor};
use hapt_model::World;
use hapt_wire::{LARGEST, ROOM, pack};

/// Packs a world for a board, after checking it in the board's single precision and size.
///
/// # Errors
/// In a sentence: the world exceeds the board's size, or the core refuses it.
pub fn packed(world: &World, profile: SafetyProfile) -> Result<Vec<u8>, String> {
    let (spec, limits) = (world.spec(), world.board_limits(profile));
    let refused = |error| format!("on a board: {error}");
    Loop::<f32, { ROOM[0] }, { ROOM[1] }, { ROOM[2] }>::new(&spec).map_err(refused)?;
    Supervisor::<f32, { ROOM[0] }, { ROOM[1] }>::new(&limits, &spec).map_err(refused)?;
    pack(&spec, &limits, &mut [0; LARGEST]).map(<[u8]>::to_vec).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::world;

    #[test]
    fn a_world_too_large_for_a_board_is_refused_before_it_is_sent() {
        let mut world = world();
        let bytes = packed(&world, SafetyProfile::Certified).unwrap();
        assert!(bytes.len() < LARGEST && bytes != packed(&world, SafetyProfile::Uncertified).unwrap());
        let body = world.bodies[0];
        while world.bodies.len() <= ROOM[0] {
            world.bodies.push(body);
            world.names.push(format!("more{}", world.bodies.len()));
        }
        let error = packed(&world, SafetyProfile::Certified).unwrap_err();
        assert!(error.starts_with("on a board: ") && error.contains('4'), "{error}");
    }
}
