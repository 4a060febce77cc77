//! A compiled world's place.

use hapt_core::{Controller, Error, Limits, Spec};

use crate::ROOM;

const B: usize = ROOM[0];
const C: usize = ROOM[1];
const W: usize = ROOM[2];

/// Room for a compiled world and its supervisor. A board has two: the one that runs, and a spare one.
#[derive(Clone, Debug)]
pub struct Slot(pub(crate) Option<Compiled>);

/// A controller with a board's room.
pub(crate) type BoardController = Controller<f32, B, C, W>;

/// A world that can run.
#[derive(Clone, Debug)]
pub(crate) struct Compiled {
    pub hash: u32,
    pub controller: BoardController,
}

impl Slot {
    /// Nothing in it.
    pub const EMPTY: Slot = Slot(None);

    /// The hash of the world in it.
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
