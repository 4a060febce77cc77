//! Boundaries of stability and passivity in a plane of two parameters.

pub mod d_decomposition;
pub mod z_width;
