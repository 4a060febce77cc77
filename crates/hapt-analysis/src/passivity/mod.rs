//! The damping that a loop requires against every passive hand, what counts and levels require, and the worst hand.

pub(crate) mod curve;
pub(crate) mod kalman;
pub mod quantisation;
pub(crate) mod required;
pub(crate) mod supremum;
pub(crate) mod timing;
pub(crate) mod two_rates;
pub(crate) mod within;
pub mod worst_grip;

pub use required::Cause;
