//! Storage of a compiled world.

use hapt_core::{Controller, Error, Limits, Spec};

use crate::ROOM;

const B: usize = ROOM[0];
const C: usize = ROOM[1];
const W: usize = ROOM[2];

/// Storage of a compiled world and its supervisor. A board has two: one runs, the other is spare.
#[derive(Clone, Debug)]
pub struct WorldStorage(pub(crate) Option<Compiled>);

/// A controller with a board's capacity.
pub(crate) type BoardController = Controller<f32, B, C, W>;

/// A world that can run.
#[derive(Clone, Debug)]
pub(crate) struct Compiled {
    pub hash: u32,
    pub controller: BoardController,
}

impl WorldStorage {
    /// Empty.
    pub const EMPTY: WorldStorage = WorldStorage(None);

    /// The hash of its world.
    pub fn hash(&self) -> Option<u32> {
        self.0.as_ref().map(|compiled| compiled.hash)
    }

    /// Compiles a world into it; on an error it is empty.
    pub(crate) fn compile(&mut self, hash: u32, spec: &Spec, limits: &Limits) -> Result<(), Error> {
        self.0 = None;
        self.0 = Some(Compiled { hash, controller: Controller::new(spec, limits)? });
        Ok(())
    }
}
