//! `hapt explain licences`: the dependencies of the program and their licences.

use std::io::{Write, stdout};
use std::process::ExitCode;

use crate::failure::Failure;

/// Made by `cargo xtask licences`.
const TEXT: &str = include_str!("licences.txt");

pub fn run() -> Result<ExitCode, Failure> {
    let mut out = stdout().lock();
    out.write_all(TEXT.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}
