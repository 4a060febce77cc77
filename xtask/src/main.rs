//! The development commands of hapt. `cargo xtask test` is the README's test command; the others make what the documents show.

mod bench;
mod book;
mod campaign;
mod commands;
mod deps;
mod faults;
mod figure;
mod firmware;
mod fmi;
mod fuzz;
mod identify;
mod lecture;
mod licences;
mod links;
mod macos;
mod marked;
mod memory;
mod modules;
mod notes;
mod page;
mod programs;
mod proof;
mod python;
mod random;
mod reference;
mod release;
mod site;
mod spent;
mod steps;
mod test;
mod text;
mod tools;
mod truth;
mod vm;
mod wheel;
mod wheel_games;
mod wheel_latency;
mod windows;

use std::path::PathBuf;

use anyhow::{Result, bail};

const USAGE: &str = "\
cargo xtask test      format, lints, tests, docs, every world file, proofs, documents
                      released: the program of cargo build --release, against the tested one
cargo xtask notes     the notes' numbers as a table; with --write, into docs/notes.md
cargo xtask figure    the documents' pictures, from the runs' CSV, into docs/images
cargo xtask truth     the certificate against brute force, on random loops: [--n N] [--seed S] [--minutes M]; --write: docs/truth.md
cargo xtask proof     the proofs of random worlds before proof/checker.py, and Coq's file: [--n N] [--seed S]
cargo xtask patterns  the same under patterns of intervals and delays
cargo xtask published boundaries that others have published, recomputed
cargo xtask networks  the same of stations joined by links
cargo xtask wheel     random sets of effects on random force-feedback wheels, hands off: [--n N] [--seed S]; --write: docs/wheel.md
                      games: random games that follow the steering late, hands on and off
                      record: a session that iRacing recorded, replayed: [FILE.ibt]; --write: docs/wheel.md
                      latency: from a game's report to the torque, in simulated time
cargo xtask page      the page's core in WebAssembly, into web/core
cargo xtask licences  the licences of what is in the program, into crates/hapt/src/explain/licences.txt
cargo xtask firmware  the firmware on emulated boards: the same bits, instructions a sample, sizes; --write: docs/firmware.md
cargo xtask faults    the supervisor against faults of every kind, and against none: [--n N] [--clean SAMPLES] [--seed S]; with
                      --write, into docs/safety.md
cargo xtask identify  the intervals of hapt identify on random devices: [mixed|guided|quiet|lagging|handle|..] [--n N] [--seed S];
                      --write: docs/identify.md; records, measured: of records of real devices, --write: docs/measured.md
cargo xtask book      checks the book's commands, worlds, outputs and links; --write makes its outputs and tables;
                      --site builds it with mdbook into book/, with interactive worlds
cargo xtask bench     speed beside plain C; --write into docs/performance.md; realtime, or --guards (instruction counts), alone;
                      drive [PYTHON]: an exchange with a motor drive, beside its makers' own library's; python [--short|--write]: the
                      Python package beside the crates and other tools; scale [--short]: a sweep of 1e8 loops in shards; with
                      --write, into docs/python.md
cargo xtask guest     drives and a link on a CAN bus, and a wheel on USB, in an emulated machine; with a line of shell, that
                      link: the link alone; storm: 1000 changes of an effect a second for a minute; conform [CASE,...]: hapt wheel --conform on hapt's own;
                      car: a car game on hapt wheel; --write: docs/wheel.md
cargo xtask fuzz      [--seconds N] random bytes, on stable; --minutes N with libFuzzer; targets by their names, `commands` among them:
                      whole commands on random worlds
cargo xtask python    the Python package: its tests, examples and types
cargo xtask fmi       the FMU's library, and FMUs in FMPy, libcosim and pathsim; --write: the reference results of fmi/reference
cargo xtask windows   the command line for Windows, cross-compiled, under Wine: its tests, every world's bytes, Ctrl-C, an FMU
cargo xtask macos     the command line for macOS: lints and links for both processors; nothing is run
cargo xtask release   archives, wheels, Debian package, crates and site, tried and summed, as a draft on GitHub; --dry-run: this machine's
                      archive, in an empty root, published nowhere; a part: archives [TARGET], wheels [TARGET], debian, crates, site,
                      minutes (a newcomer's; --write: docs/install.md)
cargo xtask memory N  the memory that streaming N samples to CSV takes, such as 1e8";

fn main() -> Result<()> {
    std::env::set_current_dir(root())?;
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["test"] => test::run(),
        ["test", "released"] => test::released(),
        ["bench", ..] => bench::command(&arguments[1..]),
        ["notes"] => {
            print!("{}", notes::table()?);
            Ok(())
        }
        ["notes", "--write"] => notes::write(),
        ["figure"] => figure::write(),
        ["guest"] => vm::devices(),
        ["guest", "link"] => vm::link(),
        ["guest", "storm"] => vm::storm(),
        ["guest", "games"] => vm::games(),
        ["guest", "conform", ref cases @ ..] => vm::conform(cases),
        ["guest", "car", ref arguments @ ..] => wheel_games::drive::command(arguments),
        ["guest", "drive", hapt] => wheel_games::drive::all(hapt),
        ["guest", ref line @ ..] => vm::run(&line.join(" ")),
        ["fuzz", ref arguments @ ..] => fuzz::run(arguments),
        ["memory", samples] => memory::command(samples),
        ["truth", ref arguments @ ..] => truth::command(arguments),
        ["proof", ref arguments @ ..] => proof::command(arguments),
        ["patterns", ref arguments @ ..] => truth::patterns(arguments),
        ["published", ref arguments @ ..] => truth::published::command(arguments),
        ["networks", ref arguments @ ..] => truth::networks(arguments),
        ["wheel", "games", ref arguments @ ..] => wheel_games::command(arguments),
        ["wheel", "record", ref arguments @ ..] => wheel_games::record::command(arguments),
        ["wheel", "latency", ref arguments @ ..] => wheel_latency::command(arguments),
        ["wheel", ref arguments @ ..] => wheel::command(arguments),
        ["page"] => page::build(),
        ["python"] => python::holds(),
        ["fmi"] => fmi::holds(),
        ["fmi", "--write"] => fmi::write(),
        ["windows"] => windows::holds(),
        ["macos"] => macos::holds(),
        ["release", ..] => release::command(&arguments[1..]),
        ["licences"] => licences::write(),
        // The step of the tests, which runs at the same time as others.
        ["firmware", "holds"] => firmware::holds(),
        ["firmware", ref arguments @ ..] => firmware::command(arguments),
        ["faults", ref arguments @ ..] => faults::command(arguments),
        ["identify", ref arguments @ ..] => identify::command(arguments),
        ["book"] => book::check(),
        ["book", "--write"] => book::write(),
        ["book", "--site"] => site::build(),
        _ => bail!("{USAGE}"),
    }
}

/// The workspace's root.
fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..")
}
