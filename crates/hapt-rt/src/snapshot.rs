//! The state of a loop between two samples, from which it can continue.

use hapt_core::{ControllerState, State, SupervisorState};

use crate::plan::PlanState;

/// The state of a loop before a sample. With its plan's world and the readings from then on, a replay reproduces the torques.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// The sample before which it was taken, as records count them.
    pub sample: u64,
    /// The plan that takes that sample, as records count them.
    pub plan: u32,
    /// The state of the controller.
    pub state: PlanState,
}

impl Snapshot {
    /// An empty snapshot, to be filled.
    pub const EMPTY: Self = {
        let state = ControllerState { world: State::EMPTY, supervisor: SupervisorState::START };
        Snapshot { sample: 0, plan: 0, state }
    };
}
