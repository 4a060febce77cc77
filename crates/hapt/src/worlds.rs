//! `hapt worlds`: the built-in worlds, by name, verdict and title.

use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_analysis::Status;
use hapt_model::{World, builtin};

use crate::failure::Failure;

pub fn run() -> Result<ExitCode, Failure> {
    let mut text = String::new();
    for name in builtin::names() {
        let world = World::read(&builtin::source(&name)?, &[])?;
        let verdict = match hapt_analysis::check(&world)?.status {
            Status::Certified => "certified",
            Status::Open => "not proved",
            Status::Refuted => "refuted",
        };
        text += &format!("{name:<28} {verdict:<11} {}\n", world.title.as_deref().unwrap_or_default());
    }
    text += "\nThey go wherever a world file does: hapt sim @notes/euler, hapt check @notes/euler --set loop.period=2ms\n\
             Refuted: some motion or hand breaks the loop. Not proved: no theorem covers it. hapt check says why.\n";
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}
