//! The linearised equations of a world and its loop: matrices of motion, one sample, the closed loop.

pub(crate) mod closed_loop;
pub mod continuous;
pub(crate) mod delay;
pub mod discrete;
pub mod estimator;
pub(crate) mod grip;
pub(crate) mod laws;
pub(crate) mod modal;
pub(crate) mod port;
pub(crate) mod positions;
pub(crate) mod puck;
pub(crate) mod shaft;
pub(crate) mod slopes;
pub(crate) mod structure;
