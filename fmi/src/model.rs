//! A world as the data of an FMU: its text, its variables, and the token that identifies both.

use hapt_model::{Source, World};
use sha1::{Digest, Sha1};

use crate::variable::{Variable, variables};
use crate::{Kind, Version, named};

/// The file of the world in an FMU's resources.
pub const WORLD: &str = "world.toml";

/// The world of an FMU.
#[derive(Clone, Debug)]
pub struct Model {
    /// Whether the loop is without its device or on it.
    pub kind: Kind,
    /// The world file, which needs no other file.
    pub source: Source,
    /// The world of that file.
    pub world: World,
    /// All variables; the value reference of each is its index.
    pub variables: Vec<Variable>,
    /// The guid (FMI 2.0) or instantiation token (3.0): a hash of everything that determines the variables and the behaviour.
    pub token: String,
}

impl Model {
    /// The world without its scenarios.
    ///
    /// # Errors
    /// In a sentence: the core refuses the world.
    pub fn new(kind: Kind, version: Version, world: &World) -> Result<Model, String> {
        let world = World { scenarios: Vec::new(), ..world.clone() };
        Model::of_text(kind, version, world.to_toml())
    }

    /// The world of an FMU's resources, whose token is `token`.
    ///
    /// # Errors
    /// In a sentence: another token, or a text that is no world.
    pub fn open(version: Version, token: &str, text: String) -> Result<Model, String> {
        let kind = Kind::ALL.into_iter().find(|kind| token_of(*kind, version, &text) == token);
        let kind = kind.ok_or_else(|| {
            format!(
                "the guid (instantiation token) {token:?} is not that of resources/{WORLD}: model description, world and library \
                 are not of one export"
            )
        })?;
        Model::of_text(kind, version, text)
    }

    fn of_text(kind: Kind, version: Version, text: String) -> Result<Model, String> {
        let token = token_of(kind, version, &text);
        let source = Source::from_text(WORLD, text);
        let world = World::read(&source, &[]).map_err(|error| named(&error))?;
        hapt_sim::check(&world).map_err(|error| error.to_string())?;
        let variables = variables(kind, &world, &source).map_err(|error| named(&error))?;
        Ok(Model { kind, source, world, variables, token })
    }
}

/// 40 hexadecimal digits.
fn token_of(kind: Kind, version: Version, text: &str) -> String {
    let mut hash = Sha1::new();
    for part in [env!("CARGO_PKG_VERSION"), version.number(), kind.name(), text] {
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
