//! A world file's bytes.

use hapt_model::{Source, World};

use crate::messages;

/// A world is read or refused; what is read is written back and reads as the same.
pub fn run(bytes: &[u8]) -> u64 {
    let read = Source::from_bytes("w.toml", bytes.to_vec()).and_then(|source| World::read(&source, &[]));
    match read {
        Err(error) => messages::judged(&error),
        Ok(world) => {
            let file = world.to_toml();
            let again = World::read(&Source::from_text("again.toml", file.as_str()), &[]);
            assert_eq!(again.as_ref(), Ok(&world), "{file}");
            messages::outcome(&(
                world.couplings.len(),
                world.bodies.len(),
                world.scenarios.len(),
                world.sampling.method as u8,
            ))
        }
    }
}
