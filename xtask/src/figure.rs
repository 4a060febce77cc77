//! The README's picture: the notes' growth and its cure, drawn from the runs' CSV.

use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use kuva::prelude::*;

const PICTURE: &str = "docs/images/growth.svg";

/// Torque in N·mm over time in s.
type Curve = Vec<(f64, f64)>;

/// Runs a world of the notes with the command line and reads back the torque that its loop asks for.
fn torque(name: &str) -> Result<Curve> {
    let out = Path::new("target/figure").join(name);
    let status = Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--release", "--package", "hapt", "--", "sim"])
        .arg(format!("worlds/notes/{name}.toml"))
        .args(["--scenario", "step", "--out"])
        .arg(&out)
        .output()?;
    ensure!(status.status.success(), "{}", String::from_utf8_lossy(&status.stderr));
    let text = fs::read_to_string(out.join("step.csv"))?;
    let mut lines = text.lines();
    let header: HashMap<&str, usize> =
        lines.next().context("no header")?.split(',').enumerate().map(|(i, name)| (name, i)).collect();
    let column = |name: &str| header.get(name).copied().with_context(|| format!("no column {name}"));
    let (time, torque) = (column("time_s")?, column("torque_Nm")?);
    let point = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        Ok((
            fields.get(time).context("short line")?.parse()?,
            1e3 * fields.get(torque).context("short line")?.parse::<f64>()?,
        ))
    };
    lines.map(point).collect()
}

/// What a picture 8 cm wide can show of 10 000 samples: the smallest and the largest of each stretch, in their order.
fn extremes(curve: &Curve, stretches: usize) -> Curve {
    let length = curve.len().div_ceil(stretches);
    let extremes = |part: &[(f64, f64)]| {
        let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let mut ends: Vec<(f64, f64)> =
            [part.iter().min_by(by), part.iter().max_by(by)].into_iter().flatten().copied().collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        ends
    };
    curve.chunks(length).flat_map(extremes).collect()
}

fn picture() -> Result<String> {
    let line = |curve: Curve, color: &str, width: f64| {
        LinePlot::new().with_data(curve).with_color(color).with_stroke_width(width)
    };
    // Okabe and Ito's vermillion and blue: told apart by every eye.
    let euler = line(extremes(&torque("euler")?, 400), "#d55e00", 1.2).with_legend("forward Euler");
    let damped = line(extremes(&torque("damped")?, 400), "#0072b2", 1.2).with_legend("forward Euler, b = Tk");
    let limit = |side: f64| line(vec![(0.0, side * 822.25), (10.0, side * 822.25)], "#555555", 1.0).with_dashed();
    let plots: Vec<Plot> =
        vec![euler.into(), damped.into(), limit(1.0).with_legend("motor's limit").into(), limit(-1.0).into()];
    let layout = Layout::auto_from_plots(&plots)
        .with_title("The notes' virtual wheel: a step of 45°, held")
        .with_x_label("time (s)")
        .with_y_label("torque asked of the motor (N·mm)")
        .with_width(820.0)
        .with_height(380.0);
    Ok(kuva::render_to_svg(plots, layout))
}

pub fn write() -> Result<()> {
    fs::create_dir_all("docs/images")?;
    fs::write(PICTURE, picture()?).context(PICTURE)?;
    println!("wrote {PICTURE}");
    Ok(())
}

/// Whether the picture is the one that today's code draws.
pub fn is_current() -> Result<()> {
    ensure!(fs::read_to_string(PICTURE)? == picture()?, "{PICTURE} is not current: run cargo xtask figure");
    Ok(())
}
