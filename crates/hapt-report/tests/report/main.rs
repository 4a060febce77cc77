//! Reports as files.

mod common;
mod pages;
