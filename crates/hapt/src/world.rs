//! The world that a command works on.

use hapt_model::{Source, World};

use crate::args::WorldArgs;
use crate::failure::Failure;

/// A world and what people call it.
pub struct Loaded {
    pub name: String,
    pub world: World,
}

/// Reads the world file, or standard input for `-`, with its overrides.
pub fn load(args: &WorldArgs) -> Result<Loaded, Failure> {
    let source = if args.path.as_os_str() == "-" { Source::stdin()? } else { Source::open(&args.path)? };
    let world = World::read(&source, &args.sets)?;
    Ok(Loaded { name: source.name, world })
}

impl Loaded {
    /// Its title, or else its file's name.
    pub fn title(&self) -> &str {
        self.world.title.as_deref().unwrap_or(&self.name)
    }
}
