//! The FMU's functions as an importer calls them, in both versions of the standard.
#![allow(unsafe_code)] // The functions of C.

mod bits;
mod calls;
mod fmu;
mod parameters;
mod states;
mod steps;
mod written;
