//! Arguments of the commands about the usage of hapt.

use std::path::PathBuf;

use clap::Subcommand;

#[derive(Debug, clap::Args)]
pub struct InitArgs {
    /// The folder for world.toml and hapt.schema.json; created if missing.
    #[arg(value_name = "DIR", default_value = ".")]
    pub folder: PathBuf,
    /// The template: spring-mass, wall, detents, damper, inertia, friction, end-stops or two-wheels.
    #[arg(long, value_name = "NAME", default_value = "spring-mass")]
    pub template: String,
}

#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct ExplainArgs {
    /// A term of a message or a verdict, such as growth; default: list the topics.
    #[arg(value_name = "TOPIC")]
    pub topic: Option<String>,
    #[command(subcommand)]
    pub reference: Option<ReferenceCommand>,
}

// Reference texts in addition to the topics. A doc comment would become the command's own.
#[derive(Debug, Subcommand)]
pub enum ReferenceCommand {
    /// Print the JSON schema of world files, with which editors complete keys and check units.
    #[command(after_help = "\
Examples:
  hapt explain schema > hapt.schema.json             as hapt init does")]
    Schema,
    /// Print the manual page, or write a page for each command.
    #[command(after_help = "\
Examples:
  hapt explain man > hapt.1                          then: man -l hapt.1
  hapt explain man --out man                         a page for each command")]
    Man(ManArgs),
    /// Print a shell's completion script.
    #[command(after_help = "\
Examples:
  hapt explain completions bash > hapt.bash          then: . ./hapt.bash
  hapt explain completions fish > hapt.fish          where fish looks")]
    Completions(CompletionsArgs),
    /// Print the licences of everything in this program, with their texts.
    #[command(
        alias = "licenses",
        after_help = "\
Examples:
  hapt explain licences | less
  hapt explain licences > THIRD-PARTY.txt            to go along with it"
    )]
    Licences,
}

#[derive(Debug, clap::Args)]
pub struct CompletionsArgs {
    /// The shell.
    #[arg(value_name = "SHELL", value_enum)]
    pub shell: clap_complete::Shell,
}

#[derive(Debug, clap::Args)]
pub struct ManArgs {
    /// Write hapt.1 and a page for each command into this folder.
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}
