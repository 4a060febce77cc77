//! Numerical methods that know nothing of loops: matrices, eigenvalues, roots, series, searches.

pub(crate) mod crossing;
pub(crate) mod hessenberg;
pub(crate) mod jacobi;
pub(crate) mod matrix;
pub mod nelder_mead;
pub(crate) mod polynomial;
pub(crate) mod rayleigh;
pub(crate) mod series;
