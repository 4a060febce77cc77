//! Numerical methods without reference to loops: matrices, eigenvalues, roots, series, searches.

pub(crate) mod balance;
pub(crate) mod crossing;
pub mod eigenvalues;
pub(crate) mod hessenberg;
pub(crate) mod jacobi;
pub(crate) mod last;
pub(crate) mod lmi;
pub mod nelder_mead;
pub(crate) mod phi;
pub(crate) mod polynomial;
pub(crate) mod rayleigh;
pub(crate) mod series;
