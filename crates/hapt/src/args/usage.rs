//! Arguments of the commands about the usage of hapt.

use std::path::PathBuf;

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
pub struct ExplainArgs {
    /// A term of a message or a verdict, such as growth; default: list the topics.
    #[arg(value_name = "TOPIC")]
    pub topic: Option<String>,
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
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, clap::Args)]
pub struct GradeArgs {
    /// The folder of the pack, with pack.toml and its starter world.
    #[arg(value_name = "PACK")]
    pub pack: PathBuf,
    /// The answers, a TOML file with one `id = "value unit"` a line; default: print the questions.
    #[arg(value_name = "ANSWER.toml")]
    pub answer: Option<PathBuf>,
    /// The name or number of a student, which chooses the starter's numbers.
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    pub student: Option<String>,
    /// Show the expected answers.
    #[arg(long)]
    pub key: bool,
    /// Print the table as JSON.
    #[arg(long)]
    pub json: bool,
}
