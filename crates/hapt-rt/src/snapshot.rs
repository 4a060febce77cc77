//! Everything that a loop goes on with, so that it can go on again.

use hapt_core::{Contacts, Memory, State, SupervisorState, Vector};

use crate::plan::PlanState;

/// A loop as it stands before a sample. With its plan's world and what the loop is told from there on, it makes the same torques again.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// The sample before which it was taken, as records count them.
    pub sample: u64,
    /// The plan that takes that sample, as records count them.
    pub plan: u32,
    /// The world's.
    pub state: PlanState,
    /// The supervisor's.
    pub watch: SupervisorState<f64>,
}

impl Snapshot {
    /// Room for one; nothing has moved in it yet.
    pub const EMPTY: Self = {
        const NOWHERE: Vector<f64, 32> = Vector { position: [0.0; 32], velocity: [0.0; 32] };
        let contacts = Contacts { torques: [0.0; 64], unsettled: 0 };
        let memory = Memory { last: None, counts: [0.0; 257], newest: 0, older: 0 };
        let state = State { now: NOWHERE, change: NOWHERE, bristles: [0.0; 64], contacts, memory };
        Snapshot { sample: 0, plan: 0, state, watch: SupervisorState::START }
    };
}
