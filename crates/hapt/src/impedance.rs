//! `hapt impedance`: the rendered impedance against frequency, and the Z-width of a device.

use std::fmt::{Display, Write as _};
use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_analysis::impedance::rendered::{Element, Elements, Impedance, Nominal, Resonance, Row, columns, suffixes};
use hapt_analysis::z_width::WallSearch;
use hapt_analysis::{Slopes, ZWidth};
use hapt_model::keys::Measure;
use hapt_model::{Dimension, EstimatorKind, Motion};
use hapt_report::figure::Figure;
use rayon::prelude::*;
use serde_json::json;

use crate::args::{ImpedanceArgs, SlopesArg};
use crate::failure::Failure;
use crate::format;
use crate::messages;
use crate::output;
use crate::picture::FigureFile;
use crate::progress::Progress;
use crate::world::{Loaded, files, load};

/// The most rows.
const MAX_ROWS: usize = 100_000;
/// The most dampers of a Z-width, each of which is a search.
const MOST_DAMPERS: usize = 2_000;
/// The approximate number of printed rows.
const PRINTED: usize = 14;

pub fn run(args: &ImpedanceArgs) -> Result<ExitCode, Failure> {
    let most = if args.z_width { MOST_DAMPERS } else { MAX_ROWS };
    if args.points == Some(0) || args.points.is_some_and(|points| points > most) {
        let given = args.points.unwrap_or_default();
        return Err(Failure::input(format!("--points {given}: expected 1 to {most}")));
    }
    if let Some(out) = &args.out {
        output::format("--out", out, &["csv"])?;
    }
    let file = FigureFile::of("--plot", args.plot.as_deref(), &args.figure)?;
    let loaded = load(&args.world)?;
    let outputs = [("--out", &args.out), ("--plot", &args.plot)];
    output::apart(&output::given(&outputs), &files(&args.world.path, &loaded.world))?;
    let (csv, figure, json, text) = if args.z_width { width(args, &loaded)? } else { frequencies(args, &loaded)? };
    // Both are written before either is put in its place.
    let csv = args.out.as_deref().map(|target| output::draft(target, csv.as_bytes())).transpose()?;
    let figure = args.plot.as_deref().map(|target| file.draft(target, &figure)).transpose()?;
    for (target, draft) in [(&args.out, csv), (&args.plot, figure)] {
        if let (Some(target), Some(draft)) = (target, draft) {
            let path = draft.finish().map_err(|error| Failure::write(target.display(), error))?;
            messages::say(format_args!("wrote {}", path.display()));
        }
    }
    let printed = match (args.json, &args.out) {
        (true, _) => json,
        (false, Some(_)) => String::new(),
        (false, None) => text,
    };
    let mut out = stdout().lock();
    out.write_all(printed.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}

fn pretty(value: &serde_json::Value) -> Result<String, Failure> {
    let json = serde_json::to_string_pretty(value).map_err(|error| Failure::System(error.to_string()))?;
    Ok(json + "\n")
}

/// The units' names of stiffness, damping and inertia.
fn units(motion: Motion) -> [String; 3] {
    [Measure::Stiffness, Measure::Damping, Measure::Inertia].map(|measure| measure.dimension(motion).symbol())
}

/// CSV, figure, JSON and text.
type Drawn = (String, Figure, String, String);

/// Of an impedance against frequency.
fn frequencies(args: &ImpedanceArgs, loaded: &Loaded) -> Result<Drawn, Failure> {
    let world = &loaded.world;
    let slopes = match args.slopes {
        SlopesArg::Steep => Slopes::Steep,
        SlopesArg::Flat => Slopes::Flat,
    };
    let felt = Impedance::new(world, &slopes)?;
    let nyquist = felt.nyquist_hz();
    let [from, to] = [("--from", &args.from), ("--to", &args.to)];
    let ends = [frequency(from.0, from.1.as_deref())?, frequency(to.0, to.1.as_deref())?];
    let [low, high] = felt.range(ends, [from.0, to.0]).map_err(Failure::input)?;
    let rows = felt.rows(low, high, args.points.unwrap_or(200));
    let (nominal, resonances) = (felt.nominal(), felt.resonances());
    let figure = hapt_report::felt::impedance(loaded.title(), &rows, &resonances, felt.device(), world.motion);
    let [inertia, damping] = felt.device();
    let json = json!({
        "period_s": world.sampling.period,
        "nyquist_hz": nyquist,
        "asked": nominal,
        "resonances": resonances,
        "device": { "inertia": inertia, "damping": damping },
        "rows": rows,
        "notes": felt.notes(),
    });
    let text = text(loaded, &felt, &nominal, &resonances, low, high);
    Ok((csv(&rows, world.motion), figure, pretty(&json)?, text))
}

fn frequency(flag: &str, text: Option<&str>) -> Result<Option<f64>, Failure> {
    text.map(|text| format::positive(flag, text, Dimension::FREQUENCY)).transpose()
}

fn csv(rows: &[Row], motion: Motion) -> String {
    let mut text = columns(motion).join(",") + "\n";
    for row in rows {
        let cells: Vec<String> = row.numbers().map(|x| x.map_or(String::new(), |x| format!("{x:?}"))).collect();
        text += &(cells.join(",") + "\n");
    }
    text
}

fn loop_line(loaded: &Loaded) -> String {
    let sampling = &loaded.world.sampling;
    let (method, output, estimator) = (sampling.method.name(), sampling.output.name(), sampling.estimator.name());
    let (period, late) = (format::time(sampling.period), format::late(sampling));
    format!(
        "loop      {method} at {period} a sample, torque from the {output} of the step{late}, velocity {estimator}\n"
    )
}

fn text(
    loaded: &Loaded,
    felt: &Impedance,
    nominal: &[Nominal],
    resonances: &[Resonance],
    low: f64,
    high: f64,
) -> String {
    let units = units(loaded.world.motion);
    let mut text = format!("{}\n\n{}", loaded.title(), loop_line(loaded));
    if nominal.is_empty() {
        text += "asked     nothing: couplings at the puck are felt neither in slow motion nor at rest\n";
    }
    for nominal in nominal {
        let (name, unit) = match nominal.element {
            Element::Stiffness => ("stiffness", &units[0]),
            Element::Damping => ("damping", &units[1]),
            Element::Inertia => ("inertia", &units[2]),
        };
        let up = |hz: Option<f64>| match hz {
            None => "at every frequency".to_string(),
            Some(hz) if hz <= 0.11 * felt.low_hz() => "at none that was looked at".to_string(),
            Some(hz) => format!("up to {} Hz", format::number(hz)),
        };
        let value = format::number(nominal.value);
        let _ = writeln!(text, "asked     {name} {value} {unit}: rendered to 10 % {}", up(nominal.from_nominal_hz));
        let _ = writeln!(
            text,
            "ideal     of the differential equations: its {name} is rendered to 10 % {}",
            up(nominal.from_ideal_hz)
        );
    }
    for resonance in resonances.iter().take(6) {
        let how = match resonance.damping_ratio {
            0.0 => "undamped: there the puck stands as if clamped".to_string(),
            ratio if ratio < 0.0 => format!("growing, damping ratio {}", format::number(ratio)),
            ratio => format!("damping ratio {}", format::number(ratio)),
        };
        let _ = writeln!(text, "resonance {} Hz with the puck held, {how}", format::number(resonance.frequency_hz));
    }
    if resonances.len() > 6 {
        let _ = writeln!(text, "resonance and {} more above", resonances.len() - 6);
    }
    let [inertia, damping] = felt.device();
    let _ = writeln!(
        text,
        "device    adds inertia {} {} and damping {} {} to all that stands below",
        format::number(inertia),
        units[2],
        format::number(damping),
        units[1]
    );
    if let (Some(rendered), Some(whole)) = (felt.row(low).rendered, felt.row(low).whole) {
        let feeds = if whole.damping < 0.0 { ": it feeds the hand" } else { "" };
        let _ = writeln!(
            text,
            "slowly    at {} Hz the loop damps by {} {}, with the device by {}{feeds}",
            rounded(low),
            rounded(rendered.damping),
            units[1],
            rounded(whole.damping)
        );
    }
    for note in felt.notes() {
        let _ = writeln!(text, "note      {note}");
    }
    text += "\n";
    let [k, b, j] = ["stiffness", "damping", "inertia"];
    line(&mut text, "", [&"rendered", &"", &"", &"ideal", &"", &""]);
    line(&mut text, "frequency", [&k, &b, &j, &k, &b, &j]);
    line(&mut text, "Hz", [&units[0], &units[1], &units[2], &units[0], &units[1], &units[2]]);
    for hz in printed(low, high) {
        let row = felt.row(hz);
        let parts = |of: Option<Elements>| match of {
            Some(e) => [e.stiffness, e.damping, e.inertia].map(rounded),
            None => ["unbounded", "", ""].map(String::from),
        };
        let ([k, b, j], [ki, bi, ji]) = (parts(row.rendered), parts(row.ideal));
        line(&mut text, &rounded(hz), [&k, &b, &j, &ki, &bi, &ji]);
    }
    text
}

fn line(text: &mut String, first: &str, cells: [&dyn Display; 6]) {
    let cells: String = cells.iter().map(|cell| format!(" {:>11}", cell.to_string())).collect();
    *text += format!("{first:<9}{cells}").trim_end();
    *text += "\n";
}

/// Four digits.
fn rounded(x: f64) -> String {
    format!("{x:.3e}").parse().map_or_else(|_| x.to_string(), |x: f64| format::number(x + 0.0))
}

/// Round frequencies from `low` to `high`, and `high`.
fn printed(low: f64, high: f64) -> Vec<f64> {
    let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let ladder = |steps: &[f64]| -> Vec<f64> {
        let all = powers.clone().flat_map(|power| steps.iter().map(move |step| step * 10f64.powi(power)));
        all.filter(|hz| *hz >= low * (1.0 - 1e-9) && *hz < high * (1.0 - 1e-9)).chain([high]).collect()
    };
    let fine = ladder(&[1.0, 2.0, 5.0]);
    if fine.len() > PRINTED { ladder(&[1.0]) } else { fine }
}

/// Of a Z-width.
fn width(args: &ImpedanceArgs, loaded: &Loaded) -> Result<Drawn, Failure> {
    let world = &loaded.world;
    let walls = WallSearch::new(world)?;
    let dampers = walls.dampers(args.points.unwrap_or(80));
    let mut progress = Progress::new("z-width", "dampers", dampers.len() as u64, 0);
    let mut edges = Vec::with_capacity(dampers.len());
    // The same for every number of threads.
    for some in dampers.chunks(2 * rayon::current_num_threads()) {
        let found: Result<Vec<_>, _> = some.par_iter().map(|damping| walls.edge(*damping)).collect();
        edges.extend(found?);
        progress.reached(edges.len() as u64);
    }
    let found = walls.width(edges)?;
    let [stiffness, damping, _] = suffixes(world.motion);
    let mut csv = format!("{damping},passive_{stiffness},stable_{stiffness},counts_{stiffness}\n");
    let cell = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:?}"));
    for edge in &found.edges {
        let _ = writeln!(csv, "{:?},{},{},{}", edge.damping, cell(edge.passive), cell(edge.stable), cell(found.counts));
    }
    let figure = hapt_report::felt::z_width(loaded.title(), &found, world.motion);
    Ok((csv, figure, pretty(&json!(found))?, width_text(loaded, &found)))
}

fn width_text(loaded: &Loaded, found: &ZWidth) -> String {
    let world = &loaded.world;
    let [k, b, _] = units(world.motion);
    let mut text =
        format!("{}: a spring and a damper from the puck to ground\n\n{}", loaded.title(), loop_line(loaded));
    let first = found.edges.first();
    let number = |edge: Option<f64>| format::number(edge.unwrap_or(0.0));
    let _ = writeln!(
        text,
        "passive   up to {} {k} without a damper, and up to {} {b} without a spring",
        number(first.and_then(|edge| edge.passive)),
        format::number(found.passive_damping)
    );
    let stiffest = found.edges.iter().filter_map(|edge| Some((edge.stable?, edge.damping)));
    let (most, with_damping) = stiffest.fold((0.0, 0.0), |best, edge| if edge.0 > best.0 { edge } else { best });
    let _ = writeln!(
        text,
        "stable    hands-off, up to {} {k} without a damper, and up to {} {b} without a spring; about {} {k} beside {} {b} at most",
        number(first.and_then(|edge| edge.stable)),
        format::number(found.stable_damping),
        rounded(most),
        rounded(with_damping)
    );
    if let Some(counts) = found.counts {
        let _ = writeln!(
            text,
            "counts    friction and damping of the device absorb the encoder's up to {} {k}",
            format::number(counts)
        );
    }
    if world.sampling.estimator == EstimatorKind::Exact {
        text += "note      stable with the true velocity, which no encoder has, but passive with its difference: name the estimator\n";
    }
    let _ = writeln!(text, "\n{:>12} {:>12} {:>12}\n{b:>12} {k:>12} {k:>12}", "damper", "passive", "stable");
    let every = found.edges.len().div_ceil(PRINTED).max(1);
    for (i, edge) in found.edges.iter().enumerate() {
        let last = i + 1 == found.edges.len();
        let cell = |value: Option<f64>| value.map_or("none".to_string(), rounded);
        if i % every == 0 || last {
            let _ =
                writeln!(text, "{:>12} {:>12} {:>12}", rounded(edge.damping), cell(edge.passive), cell(edge.stable));
        }
    }
    text
}
