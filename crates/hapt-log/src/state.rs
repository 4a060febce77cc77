//! A loop's state among its samples: an attachment before the sample that goes on from it.
//!
//! ```text
//! version  sample, plan, the world's state, the supervisor's
//! u8       postcard
//! ```
//!
//! Doubles stand there with all of their bits. The form is that of today's core: a state of another version is left alone, and the
//! samples behind it are as if it were not there.

use hapt_core::{ControllerState, SupervisorState};
use hapt_rt::Snapshot;
use hapt_sim::DesktopState;

/// It changes whenever the bytes after it mean something else.
const VERSION: u8 = 2;

/// How the names of such attachments begin; the sample's number follows.
pub(crate) const NAME: &str = "state-";

/// A snapshot as bytes.
pub(crate) fn write(snapshot: &Snapshot) -> postcard::Result<Vec<u8>> {
    let Snapshot { sample, plan, state: ControllerState { world, supervisor } } = snapshot;
    postcard::to_extend(&(VERSION, sample, plan, world, supervisor), Vec::new())
}

/// A snapshot from its bytes; `None` where they are of another version, or none.
pub(crate) fn read(bytes: &[u8]) -> Option<Snapshot> {
    // Before the rest is looked at, which may be anything then.
    let (VERSION, rest) = postcard::take_from_bytes::<u8>(bytes).ok()? else { return None };
    let (snapshot, rest) = postcard::take_from_bytes::<(u64, u32, DesktopState, SupervisorState<f64>)>(rest).ok()?;
    let (sample, plan, world, supervisor) = snapshot;
    rest.is_empty().then_some(Snapshot { sample, plan, state: ControllerState { world, supervisor } })
}
