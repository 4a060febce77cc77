//! `hapt explain completions` and `hapt explain man`: shell completions and manual pages from the definition of the command line.

use std::io::{self, Write, stdout};
use std::path::Path;
use std::process::ExitCode;

use clap::{Command, CommandFactory};
use clap_mangen::Man;

use crate::args::{Args, CompletionsArgs, ManArgs};
use crate::failure::Failure;
use crate::messages;
use crate::output::{self, Draft};

pub fn completions(args: &CompletionsArgs) -> Result<ExitCode, Failure> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Args::command(), "hapt", &mut text);
    print(&text)
}

pub fn man(args: &ManArgs) -> Result<ExitCode, Failure> {
    // Without the commands of `help`, which are copies of the others.
    let mut command = Args::command().disable_help_subcommand(true);
    command.build();
    match &args.out {
        Some(folder) => {
            output::folder("--out", folder)?;
            write_pages(&command, "hapt", folder)?;
            Ok(ExitCode::SUCCESS)
        }
        None => print(&page(&command, "hapt").map_err(Failure::stdout)?),
    }
}

/// The page of this command and, each in its own file, those of the commands below it.
fn write_pages(command: &Command, name: &str, folder: &Path) -> Result<(), Failure> {
    let target = folder.join(format!("{name}.1"));
    let write = || {
        let mut draft = Draft::new(target.clone())?;
        draft.write_all(&page(command, name)?)?;
        draft.finish()
    };
    write().map_err(|error| Failure::write(target.display(), error))?;
    messages::say(format_args!("wrote {}", target.display()));
    for below in command.get_subcommands() {
        write_pages(below, &format!("{name}-{}", below.get_name()), folder)?;
    }
    Ok(())
}

fn page(command: &Command, name: &str) -> io::Result<Vec<u8>> {
    let mut page = Vec::new();
    Man::new(command.clone().display_name(name)).render(&mut page)?;
    Ok(page)
}

fn print(text: &[u8]) -> Result<ExitCode, Failure> {
    let mut out = stdout().lock();
    out.write_all(text).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}
