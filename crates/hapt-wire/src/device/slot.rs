//! A compiled world's place.

use hapt_core::{Error, Limits, Loop, Spec, State, Supervisor};

use crate::ROOM;

const B: usize = ROOM[0];
const C: usize = ROOM[1];
const W: usize = ROOM[2];

/// Room for a world, its supervisor and its state. A board has two: the one that runs, and a spare one.
#[derive(Clone, Debug)]
pub struct Slot(pub(crate) Option<Compiled>);

/// A world that can run.
#[derive(Clone, Debug)]
pub(crate) struct Compiled {
    pub hash: u32,
    pub world: Loop<f32, B, C, W>,
    pub supervisor: Supervisor<f32, B, C>,
    pub state: State<f32, B, C, W>,
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
        let world = Loop::new(spec)?;
        let supervisor = Supervisor::new(limits, spec)?;
        let state = world.start();
        self.0 = Some(Compiled { hash, world, supervisor, state });
        Ok(())
    }
}
