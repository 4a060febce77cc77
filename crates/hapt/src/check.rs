//! `hapt check`: the certificate, and remedies.

use std::process::ExitCode;

use hapt_analysis::{SystemCheck, check_system, proof};

use crate::answer::{answer, begin, pretty, write};
use crate::args::CheckArgs;
use crate::failure::Failure;
use crate::output;
use crate::world::{inputs, read_system, source};

pub fn run(args: &CheckArgs) -> Result<ExitCode, Failure> {
    let source = source(&args.world.path)?;
    let system = read_system(&source, &args.world.sets)?;
    if args.proof.is_some() && system.world().is_none() {
        let message = "--proof: a network has no proof file; expected a world, such as that of one of its stations";
        return Err(Failure::input(message));
    }
    output::apart(&output::given(&[("--proof", &args.proof)]), &inputs(&args.world.path, &system))?;
    // An invalid output file is reported before the work.
    let draft = args.proof.as_deref().map(begin).transpose()?;
    let check = check_system(&system, !args.no_remedies)?;
    if let (Some(draft), Some(world), SystemCheck::World(check)) = (draft, system.world(), &check) {
        write([(draft, pretty(&proof(world, check)?)?)].into_iter())?;
    }
    let text = match args.json {
        true => pretty(&check)?,
        false => check.text(&system, system.title_or(&source), args.why)?,
    };
    answer(&text, check.is_certified())
}
