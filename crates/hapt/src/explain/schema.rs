//! `hapt explain schema`: the JSON schema of world files.

use std::io::{Write, stdout};
use std::process::ExitCode;

use crate::failure::Failure;

pub fn run() -> Result<ExitCode, Failure> {
    let mut out = stdout().lock();
    out.write_all(hapt_model::schema().as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}
