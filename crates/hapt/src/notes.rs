//! `hapt` without a command: the notes' wheel under four loops, in one table.

use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_model::{System, builtin};
use hapt_sim::{Run, SystemSummary};

use crate::failure::Failure;
use crate::format;
use crate::sim::rows;

/// The names of the loops, and their built-in worlds.
const LOOPS: [(&str, &str); 4] = [
    ("forward Euler", "@notes/euler"),
    ("forward Euler, b = Tk", "@notes/damped"),
    ("trapezoidal", "@notes/trapezoidal"),
    ("hapt's default (zoh)", "@notes/default"),
];

const NEXT: &str = "
The motor takes up to 822.25 N mm. Forward Euler grows into that; the others keep the swing as it is.
`hapt live` opens this wheel in a browser, in real time: grab it.

Next:
  hapt check @notes/euler                           why, and up to which period a loop holds
  hapt sim @notes/euler --out out                   every sample, as out/step.csv
  hapt sim @notes/euler --set loop.period=0.2ms     the same with a shorter period
  hapt worlds                                       the other built-in worlds
  hapt init wheel                                   a world file of your own, to start from
  hapt design --travel '45 deg' --torque '800 N mm' --frequency '1 Hz' > wheel.toml
  hapt --help
";

pub fn run() -> Result<ExitCode, Failure> {
    let mut table = String::from(
        "The notes' virtual wheel, 1 Hz, 17.78 N mm/deg: a step of 45 deg, held for 10 s, 1 ms a sample\n\n",
    );
    table += "loop                     growth per s     peak torque    first clipped          verdict\n";
    for (name, world) in LOOPS {
        let system = System::read(&builtin::source(world)?, &[])?;
        let held = hapt_analysis::check(&system.stations[0].world)?.held;
        for scenario in system.scenarios() {
            let mut run = Run::new(&system, scenario)?;
            let mut summary = SystemSummary::new(&system, &run);
            rows(&mut run, scenario, |row| {
                summary.add(row);
                Ok::<(), Failure>(())
            })??;
            let summary = &summary.stations[0];
            let clipped = match summary.first_clipped {
                Some((sample, time)) => format!("sample {sample} ({})", format::time(time)),
                None => "never".into(),
            };
            let growth = format::rate(held.growth_per_s.unwrap_or(f64::NEG_INFINITY));
            let peak = format::effort(summary.peak_torque, system.motion);
            table += &format!("{name:<24} {growth:<16} {peak:<14} {clipped:<22} {}\n", held.verdict.name());
        }
    }
    let mut out = stdout().lock();
    out.write_all(table.as_bytes())
        .and_then(|()| out.write_all(NEXT.as_bytes()))
        .and_then(|()| out.flush())
        .map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}
