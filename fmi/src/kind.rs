//! The part of a world that is in an FMU.

hapt_model::named! {
    /// The part of a world that is in an FMU.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Kind {
        /// The loop without its device: from the puck's motion to the torque on it.
        Loop => "loop",
        /// The loop on its exact device: from the hand's torque to the columns of a run.
        Whole => "whole",
    }
}
