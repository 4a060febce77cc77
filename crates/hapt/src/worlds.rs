//! `hapt worlds`: the built-in worlds, by name and title.

use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_model::World;

use crate::failure::Failure;
use hapt_model::builtin;

pub fn run() -> Result<ExitCode, Failure> {
    let mut text = String::new();
    for name in builtin::names() {
        let world = World::read(&builtin::source(&name)?, &[])?;
        text += &format!("{name:<28} {}\n", world.title.as_deref().unwrap_or_default());
    }
    text +=
        "\nThey go wherever a world file does: hapt sim @notes/euler, hapt check @notes/euler --set loop.period=2ms\n";
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}
