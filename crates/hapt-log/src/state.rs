//! A loop's state in a log: an attachment before the sample that continues from it.
//!
//! ```text
//! version  sample, plan, the world's state, the supervisor's
//! u8       postcard
//! ```
//!
//! Doubles keep all of their bits. The format is that of the present core: a state of another version is ignored.

use hapt_core::{ControllerState, SupervisorState};
use hapt_rt::Snapshot;
use hapt_sim::DesktopState;

/// The version of the format.
const VERSION: u8 = 6;

/// The prefix of such attachments' names; the sample's number follows.
pub(crate) const NAME: &str = "state-";

/// A snapshot as bytes.
pub(crate) fn write(snapshot: &Snapshot) -> postcard::Result<Vec<u8>> {
    let Snapshot { sample, plan, state: ControllerState { world, supervisor } } = snapshot;
    postcard::to_extend(&(VERSION, sample, plan, world, supervisor), Vec::new())
}

/// A snapshot from its bytes; `None` where they are of another version, or invalid.
pub(crate) fn read(bytes: &[u8]) -> Option<Snapshot> {
    // Checked first, as other versions have other contents.
    let (VERSION, rest) = postcard::take_from_bytes::<u8>(bytes).ok()? else { return None };
    let (snapshot, rest) = postcard::take_from_bytes::<(u64, u32, DesktopState, SupervisorState<f64>)>(rest).ok()?;
    let (sample, plan, world, supervisor) = snapshot;
    rest.is_empty().then_some(Snapshot { sample, plan, state: ControllerState { world, supervisor } })
}
