//! The stiffest stable wall of the paddle under both filters, without a hand and with hands, compared with the authors' observations.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

use anyhow::Result;
use hapt_analysis::{Grip, gripped_growth, nelder_mead};
use hapt_model::{Source, World};
use rayon::prelude::*;

use super::{Device, LAB_DAMPING, PERIOD, RATIO};

/// The stiffest wall that the authors felt as stable, N m/deg, at each damping, N m s/deg, by the cutoff of both filters, Hz.
const DAMPINGS: [f64; 8] = [0.0, 1e-5, 5e-5, 1e-4, 5e-4, 1e-3, 5e-3, 1e-2];
const WALLS: [(f64, [f64; 8]); 3] = [
    (10.0, [0.1, 0.2, 0.25, 0.25, 0.35, 0.2, 0.0, 0.0]),
    (50.0, [0.05, 0.09, 0.06, 0.06, 0.2, 0.25, 0.08, 0.0]),
    (100.0, [0.01, 0.01, 0.025, 0.03, 0.14, 0.15, 0.1, 0.0]),
];
/// Stiffnesses that are tried, N m/deg.
const STIFFNESSES: [f64; 2] = [1e-4, 2.0];

/// The loop inside the wall. Both filters are first-order. That of the velocity is the estimator's. That of the position is before both
/// terms; in a linear loop it is equivalent to the same filter after them: the motor's lag.
fn wall(device: &Device, cutoff: f64, stiffness: f64, damping: f64) -> Result<World> {
    let lag = (TAU * cutoff).recip() - PERIOD;
    let file = format!(
        "loop = {{ period = \"350 us\", estimator = \"low-pass\", cutoff = {:e}, delay = {:e} }}\n\
         [device]\ninertia = {:e}\ndamping = {:e}\nlag = {lag:e}\n\
         [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = \"{stiffness} N m/deg\"\n\
         [[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"ground\"]\ndamping = \"{damping} N m s/deg\"\n",
        (TAU * lag).recip(),
        device.delay,
        device.inertia,
        device.damping
    );
    Ok(World::read(&Source::from_text("wall.toml", file), &[])?)
}

/// The stiffest wall that stays stable with a hand, N m/deg; 0: none does.
fn stiffest(device: &Device, cutoff: f64, damping: f64, hand: &Grip) -> Result<f64> {
    let mut world = wall(device, cutoff, 1.0, damping)?;
    let [low, high] = STIFFNESSES.map(|x| x * 180.0 / PI);
    let mut grows = |k: f64| -> Result<bool> {
        world.set_number("couplings.0.stiffness", k);
        Ok(gripped_growth(&world, hand)?.is_some_and(|growth| growth > 0.0))
    };
    // The edge of the interval from the softest on.
    const N: usize = 16;
    let at = |i: usize| low * (high / low).powf(i as f64 / N as f64);
    let Some(first) = (0..=N).find_map(|i| grows(at(i)).map(|grows| grows.then_some(i)).transpose()) else {
        return Ok(high * PI / 180.0);
    };
    let first = first?;
    if first == 0 {
        return Ok(0.0);
    }
    let (mut stable, mut unstable) = (at(first - 1), at(first));
    while unstable / stable > 1.05 {
        let middle = (stable * unstable).sqrt();
        if grows(middle)? { unstable = middle } else { stable = middle }
    }
    Ok(stable * PI / 180.0)
}

/// Hands that a paddle may be held by: inertias in kg m², dampings in N m s/rad, stiffnesses in N m/rad, from a light touch to a firm grip.
const HANDS: [[f64; 3]; 3] = [[1e-5, 3e-4, 1e-3], [3e-3, 0.02, 0.1], [1.0, 10.0, 100.0]];

/// The table of walls next to those of the authors.
pub(super) fn walls(device: Device) -> Result<String> {
    // The authors compensated the friction, and the damping is the data sheet's.
    let with = |delay: f64| Device { damping: RATIO * RATIO * LAB_DAMPING, delay, ..device };
    let table = |delay: f64, hand: &Grip| -> Result<Vec<[f64; 8]>> {
        let of = |(cutoff, _): &(f64, [f64; 8])| -> Result<[f64; 8]> {
            let cell = |b: &f64| stiffest(&with(delay), *cutoff, *b, hand);
            let all: Vec<f64> = DAMPINGS.par_iter().map(cell).collect::<Result<_>>()?;
            Ok(std::array::from_fn(|i| all[i]))
        };
        WALLS.iter().map(of).collect()
    };
    // Where there is no stable wall, a soft one takes its place.
    let off = |walls: &[[f64; 8]]| -> f64 {
        let pairs = walls.iter().zip(&WALLS).flat_map(|(row, wall)| row.iter().zip(&wall.1));
        let squares: Vec<f64> = pairs.map(|(a, b)| (a.max(1e-3) / b.max(1e-3)).ln().powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt().exp()
    };
    let hand = |x: &[f64]| Grip { inertia: x[0].exp(), damping: x[1].exp(), stiffness: x[2].exp() };
    let miss = |delay: f64, x: &[f64]| table(delay, &hand(x)).map_or(f64::NAN, |walls| -off(&walls).ln());
    // From a light and from a heavy hand on.
    let starts = [[1e-4f64.ln(), 0.02f64.ln(), 1f64.ln()], [3e-3f64.ln(), 0.1f64.ln(), 5f64.ln()]];
    let at_once = starts.map(|x| nelder_mead::maximise(x, [1.0; 3], 60, |x| miss(0.0, x)));
    let late = starts.map(|[m, b, k]| {
        nelder_mead::maximise([m, b, k, 1e-3f64.ln()], [1.0, 1.0, 1.0, 0.5], 80, |x| miss(x[3].exp(), x))
    });
    let better = |a: f64, b: f64| usize::from(b > a);
    let best = hand(&at_once[better(at_once[0].1, at_once[1].1)].0);
    let late = late[better(late[0].1, late[1].1)].0;
    let (late_hand, delay) = (hand(&late), late[3].exp());
    let none = table(0.0, &Grip::default())?;
    let held = table(0.0, &best)?;
    let late = table(delay, &late_hand)?;
    let ranges = [0.0, delay].map(|delay| of_hands(&|hand| table(delay, hand)));
    let ranges = ranges.into_iter().collect::<Result<Vec<_>>>()?;
    let mut text = String::from(
        "| | hand: inertia, kg m² | damping, N m s/rad | stiffness, N m/rad | delay, ms | off by a factor of, rms |\n\
         | --- | --- | --- | --- | --- | --- |\n",
    );
    for (name, hand, delay, walls) in
        [("no hand", &Grip::default(), 0.0, &none), ("one hand", &best, 0.0, &held), ("late", &late_hand, delay, &late)]
    {
        let Grip { inertia, damping, stiffness } = hand;
        let off = off(walls);
        writeln!(text, "| {name} | {inertia:.5} | {damping:.3} | {stiffness:.2} | {:.2} | {off:.1} |", 1e3 * delay)?;
    }
    let [low, high] = [0, 2].map(|end| HANDS.map(|of| of[end].to_string()));
    writeln!(
        text,
        "\nHands of {} to {} kg m², {} to {} N m s/rad and {} to {} N m/rad, {} of them and none, reach from the softest to the stiffest of the \
         rows of their name. Of the authors' {} walls {} are within them at once, and {} with the delay of {:.2} ms.\n",
        low[0],
        high[0],
        low[1],
        high[1],
        low[2],
        high[2],
        HANDS.iter().map(|of| of.len()).product::<usize>(),
        WALLS.iter().map(|wall| wall.1.len()).sum::<usize>(),
        within(&ranges[0]),
        within(&ranges[1]),
        1e3 * delay,
    )?;
    text += "| filters, Hz | |";
    for b in DAMPINGS {
        write!(text, " B = {b} |")?;
    }
    text += "\n| --- | --- |";
    text += &" --- |".repeat(DAMPINGS.len());
    text.push('\n');
    for (i, wall) in WALLS.iter().enumerate() {
        let cell = |k: &f64| match *k {
            0.0 => "0".to_string(),
            k if k < 1e-3 => "< 0.001".into(),
            k => format!("{k:.3}"),
        };
        for (name, row) in [("the authors", &wall.1), ("no hand", &none[i]), ("one hand", &held[i]), ("late", &late[i])]
        {
            let cells: Vec<String> = row.iter().map(cell).collect();
            writeln!(text, "| {} | {name} | {} |", wall.0, cells.join(" | "))?;
        }
        for (name, range) in ["hands", "hands, late"].into_iter().zip(&ranges) {
            let cells: Vec<String> = range[i].iter().map(|ends| ends.map(|k| cell(&k)).join(" to ")).collect();
            writeln!(text, "| {} | {name} | {} |", wall.0, cells.join(" | "))?;
        }
    }
    Ok(text)
}

/// The softest and the stiffest of each wall.
type Ranges = Vec<[[f64; 2]; 8]>;

/// Over all hands of [`HANDS`], and none.
fn of_hands(table: &dyn Fn(&Grip) -> Result<Vec<[f64; 8]>>) -> Result<Ranges> {
    let mut ranges: Ranges = WALLS.iter().map(|_| [[f64::INFINITY, f64::NEG_INFINITY]; 8]).collect();
    let [masses, dampers, springs] = HANDS;
    let all = (0..masses.len() * dampers.len() * springs.len()).map(|i| Grip {
        inertia: masses[i % 3],
        damping: dampers[i / 3 % 3],
        stiffness: springs[i / 9],
    });
    for hand in all.chain([Grip::default()]) {
        for (range, row) in ranges.iter_mut().zip(table(&hand)?) {
            range.iter_mut().zip(row).for_each(|(ends, k)| *ends = [ends[0].min(k), ends[1].max(k)]);
        }
    }
    Ok(ranges)
}

/// How many of the authors' walls are within the ranges.
fn within(ranges: &Ranges) -> usize {
    let pairs = ranges.iter().zip(&WALLS).flat_map(|(range, wall)| range.iter().zip(&wall.1));
    pairs.filter(|(ends, k)| (ends[0]..=ends[1]).contains(*k)).count()
}
