//! What a board is.

use hapt_core::{Phase, Reason};
use hapt_wire::Hello;

/// What a board has said of itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Board {
    /// What it is called.
    pub name: String,
    /// Its firmware's version.
    pub firmware: String,
    /// The hash of the core's source in it.
    pub core: u32,
    /// The hash of the world that it runs.
    pub world: Option<u32>,
    /// Bodies, couplings, and the longest FOAW window.
    pub room: [u8; 3],
    /// Whether it has no encoder and takes a sample at each [`hapt_wire::Order::Sample`].
    pub externally_clocked: bool,
    /// Where its supervisor stands.
    pub phase: Option<Phase>,
    /// Why.
    pub reason: Option<Reason>,
}

impl Board {
    pub(crate) fn new(hello: &Hello<'_>) -> Self {
        Board {
            name: hello.board.into(),
            firmware: hello.firmware.into(),
            core: hello.core,
            world: hello.world,
            room: [hello.bodies, hello.couplings, hello.window],
            externally_clocked: hello.externally_clocked,
            phase: Phase::ALL.get(usize::from(hello.phase)).copied(),
            reason: Reason::from_code(hello.reason),
        }
    }
}
