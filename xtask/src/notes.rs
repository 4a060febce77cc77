//! The notes' numbers, computed: the tables of docs/notes.md.

use std::f64::consts::{FRAC_PI_4, PI, TAU};
use std::fmt::Write;
use std::fs;

use anyhow::{Context, Result, ensure};
use hapt_analysis::{Design, check, closed_form};
use hapt_model::{Source, World};
use hapt_sim::{Simulation, Summary};

use crate::{lecture, marked};

const PAGE: &str = "docs/notes.md";

/// The table in Markdown: the results of runs, next to those of formulas.
pub fn table() -> Result<String> {
    let wheel = Design::new(FRAC_PI_4, 0.8, 1.0, 1e-3)?;
    let (k, j, omega, period) = (wheel.stiffness, wheel.inertia, TAU, 1e-3);
    let degree = 1e3 * PI / 180.0;
    let mut rows = vec![
        ("k", format!("{:.4} N·mm/deg = {k:.6} N·m/rad", k * degree), DESIGN),
        ("J_w", format!("{:.7} N·mm/(deg/s²) = {j:.8} kg·m²", j * degree), DESIGN),
        ("b = Tk at T = 1 ms", format!("{:.6e} N·m·s/rad", wheel.compensating_damping), DESIGN),
    ];

    let euler = world("euler")?;
    let growth = check(&euler)?.held.growth_per_s.context("forward Euler grows")?;
    let formula = closed_form::forward_euler_growth(omega, period);
    ensure!((growth - formula).abs() < 1e-12, "growth {growth}, formula {formula}");
    rows.push((
        "growth under forward Euler, ln(1 + ω²T²)/(2T)",
        format!("{growth:.7} 1/s"),
        "`hapt check worlds/notes/euler.toml`",
    ));

    let limit = euler.device.limit.context("the device has a limit")?;
    let (sample, _) = run(&euler)?.first_clipped.context("forward Euler runs into the limit")?;
    let formula = closed_form::forward_euler_exceeds(k, FRAC_PI_4, omega, period, limit);
    ensure!(formula == Some(sample), "first clipped sample {sample}, formula {formula:?}");
    rows.push((
        "first sample beyond 822.25 N·mm, predicted and met",
        format!("{sample}, at {:.3} s", sample as f64 * period),
        "`hapt sim worlds/notes/euler.toml`",
    ));

    let damped = world("damped")?;
    let held = check(&damped)?.held;
    let amplitude = closed_form::compensated_amplitude(45.0, omega, period).context("ωT < 2")?;
    rows.push(("amplitude with b = Tk, z0/cos(φ/2)", format!("{amplitude:.6} deg"), "`cargo xtask notes`"));
    rows.push(("|λ| with b = Tk", format!("{}", held.spectral_radius), "`hapt check worlds/notes/damped.toml`"));
    let critical = held.critical_period_s.context("b = Tk has a critical period")?;
    rows.push((
        "critical period with b = Tk, 2/ω",
        format!("{:.3} ms", 1e3 * critical),
        "`hapt check worlds/notes/damped.toml`",
    ));

    let released = closed_form::released_frequency_hz(k, 6.4e-4, j);
    rows.push(("released: √(k(1/J_z + 1/J_w))/2π", format!("{released:.4} Hz"), "`cargo xtask notes`"));
    let pole = (k * (1.0 / 6.4e-4 - 1.0 / j)).sqrt();
    rows.push((
        "released with the printed sign: real pole √(k(1/J_z - 1/J_w))",
        format!("{pole:.3} 1/s, e-fold in {:.1} ms", 1e3 / pole),
        "`cargo xtask notes`",
    ));

    let mut text = String::from("| number | value | printed by |\n| --- | --- | --- |\n");
    for (name, value, command) in rows {
        writeln!(text, "| {} | {value} | {command} |", name.replace('|', "\\|"))?;
    }
    Ok(text)
}

const DESIGN: &str = "`hapt design --travel '45 deg' --torque '800 N mm' --frequency '1 Hz'`";

/// A world of the notes.
pub fn world(name: &str) -> Result<World> {
    Ok(World::read(&Source::open(format!("worlds/notes/{name}.toml"))?, &[])?)
}

/// Its first scenario, run.
fn run(world: &World) -> Result<Summary<'_>> {
    let scenario = world.scenarios.first().context("a scenario")?;
    let mut run = Simulation::new(world, scenario)?;
    let mut summary = Summary::new(world, &run);
    while let Some(row) = run.next() {
        summary.add(row?);
    }
    Ok(summary)
}

/// The page with its table made anew.
pub fn page() -> Result<String> {
    let page = marked::replaced(&fs::read_to_string(PAGE).context(PAGE)?, "cargo xtask notes", &table()?)?;
    marked::replaced(&page, "cargo xtask notes: in C", &lecture::table()?)
}

pub fn write() -> Result<()> {
    fs::write(PAGE, page()?).context(PAGE)
}

/// Whether the page's numbers are those of today's code.
pub fn is_current() -> Result<()> {
    ensure!(fs::read_to_string(PAGE)? == page()?, "{PAGE} is not current: run cargo xtask notes --write");
    Ok(())
}

/// Whether every test that the page names, as `folder/file.rs: name`, is there.
pub fn names_real_tests() -> Result<()> {
    let page = fs::read_to_string(PAGE)?;
    let mut named = 0;
    for code in page.split('`').skip(1).step_by(2) {
        let Some((file, name)) = code.split_once(".rs:") else { continue };
        let (folder, file) = file.split_once('/').with_context(|| format!("no folder in {code}"))?;
        let path = match folder {
            "export_c" => format!("crates/hapt-export-c/tests/export_c/{file}.rs"),
            "cli" => format!("crates/hapt/tests/cli/{file}.rs"),
            name => format!("crates/hapt-{name}/tests/{name}/{file}.rs"),
        };
        let source = fs::read_to_string(&path).with_context(|| path.clone())?;
        ensure!(source.contains(&format!("fn {}(", name.trim())), "{path} has no test {}", name.trim());
        named += 1;
    }
    ensure!(named > 20, "only {named} tests are named: the page is not read right");
    Ok(())
}
