//! The description of a board.

use hapt_core::{Phase, Reason};
use hapt_wire::Hello;

/// A board's description of itself, from the handshake.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Board {
    /// Its name.
    pub name: String,
    /// Its firmware's version.
    pub firmware: String,
    /// The hash of the core's source in it.
    pub core: u32,
    /// The hash of the world that it runs.
    pub world: Option<u32>,
    /// Bodies, couplings, and the longest FOAW window.
    pub room: [u8; 3],
    /// Whether it has no encoder and takes a sample at each [`hapt_wire::Command::Sample`].
    pub externally_clocked: bool,
    /// The phase of its supervisor.
    pub phase: Option<Phase>,
    /// The reason of a fault or a fade-out.
    pub reason: Option<Reason>,
}

impl Board {
    /// A note for the user where its core differs from this program's.
    pub fn note(&self) -> Option<&'static str> {
        (self.core != hapt_core::SOURCE).then_some(
            "the board's core was built from another source than this hapt's; its torques may differ from hapt's",
        )
    }

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
