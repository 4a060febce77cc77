//! `hapt check`: the certificate, and remedies.

use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_model::{Source, System};

use crate::args::CheckArgs;
use crate::colour;
use crate::failure::Failure;
use crate::output;
use crate::world::{Loaded, files, source};
use crate::worst::{begin, write};

pub fn run(args: &CheckArgs) -> Result<ExitCode, Failure> {
    let source = source(&args.world.path)?;
    if hapt_model::is_network(&source) {
        if args.proof.is_some() {
            let message = "--proof: a network has no proof file; expected a world, such as that of one of its stations";
            return Err(Failure::input(message));
        }
        return check_network(&source, args);
    }
    let loaded = Loaded::of(source, &args.world)?;
    output::apart(&output::given(&[("--proof", &args.proof)]), &files(&args.world.path, &loaded.world))?;
    // An invalid output file is reported before the work.
    let draft = args.proof.as_deref().map(begin).transpose()?;
    let mut check = hapt_analysis::check(&loaded.world)?;
    if !args.no_remedies {
        check.remedies = Some(hapt_analysis::remedies(&loaded.world)?);
    }
    if let Some((path, draft)) = args.proof.as_deref().zip(draft) {
        let proof = hapt_analysis::proof(&loaded.world, &check)?;
        let json = serde_json::to_string_pretty(&proof).map_err(|error| Failure::System(error.to_string()))?;
        write([((path, draft), json + "\n")].into_iter())?;
    }
    let text = if args.json {
        let json = serde_json::to_string_pretty(&check).map_err(|error| Failure::System(error.to_string()))?;
        json + "\n"
    } else {
        let proposed = match &check.remedies {
            Some(remedies) => {
                hapt_analysis::proposal(&loaded.world, &loaded.source, &args.world.sets, &check, remedies)?
            }
            None => None,
        };
        check.text(loaded.title(), &loaded.world.sampling, proposed.as_ref(), args.why)
    };
    print(&text, check.certified.holds())
}

/// The same of a network.
fn check_network(source: &Source, args: &CheckArgs) -> Result<ExitCode, Failure> {
    let network = System::read(source, &args.world.sets)?;
    let check = hapt_analysis::check_network(&network)?.with_remedies(&network, !args.no_remedies)?;
    let text = if args.json {
        serde_json::to_string_pretty(&check).map_err(|error| Failure::System(error.to_string()))? + "\n"
    } else {
        check.text(network.title.as_deref().unwrap_or(&source.name), args.why)
    };
    print(&text, check.certified)
}

/// Prints a certificate; its exit code.
pub fn print(text: &str, certified: bool) -> Result<ExitCode, Failure> {
    let mut out = stdout().lock();
    out.write_all(colour::for_stdout(text).as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(if certified { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
