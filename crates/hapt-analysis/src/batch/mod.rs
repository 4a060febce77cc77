//! Batches of held loops of one body, decided together in vector lanes.

pub mod loops;
pub mod variants;
