//! Random games on random wheels: each computes its torque from the steering angle, late. The motion of the wheel hands-off and the torque
//! hands-on are measured, with hapt's remedy and with the usual ones.

mod car;
pub mod drive;
pub mod record;
mod run;

use std::fmt::Write as _;

use anyhow::{Result, anyhow};
use hapt_report::Width;
use hapt_report::figure::{Axis, Figure, Panel, Style};

use crate::campaign::Campaign;
use crate::random::quantile;
use run::{KICK, Outcome, Pair, Remedy, run};

/// The remedies that are compared.
const REMEDIES: [(&str, Remedy); 4] = [
    ("hapt", Remedy::Hapt),
    ("nothing", Remedy::Nothing),
    ("a damper of 0.3 N·m·s/rad", Remedy::Always(0.3)),
    ("1 N·m·s/rad beyond 2 rad/s", Remedy::Beyond(2.0, 1.0)),
];

/// `cargo xtask wheel games [--n N] [--seed S] [--write]`
pub fn command(words: &[&str]) -> Result<()> {
    let campaign = Campaign::parse(words, false)?;
    let mut text = String::new();
    for (name, answers) in [("the torque is a law of the angle", false), ("the car answers the steering", true)] {
        text += &table(name, &outcomes(campaign.n, campaign.seed, answers)?, campaign.n);
        text += "\n";
    }
    campaign.publish("wheel games", "docs/wheel.md", &text)
}

/// Games in the picture, and the quantity drawn of each: the least value shown, and the axis.
const SHOWN: u64 = 200;
type Drawn = (fn(&Outcome) -> f64, f64, f64, &'static str, &'static str);
const DRAWN: [Drawn; 2] = [
    (|one| one.last, 1e-2, 1e2, "hands off: the wheel's speed 6 s after a kick", "rad/s"),
    (|one| 100.0 * one.extra_torque, 1e-2, 1e2, "hands on: torque beside the game's, of the motor's largest", "%"),
];

/// The picture of docs/wheel.md: the share of games that are faster, and of those that feel more.
pub fn picture() -> Result<String> {
    let all = outcomes(SHOWN, 1, true)?;
    let panel = |(of, least, most, name, unit): Drawn| {
        let x = Axis::logarithmic(name, unit, least, most);
        let mut panel = Panel::new("", x, Axis::from_to("games with more", "%", 0.0, 100.0));
        for (signal, ((name, _), outcomes)) in REMEDIES.into_iter().zip(&all).enumerate() {
            let mut sizes: Vec<f64> = outcomes.iter().map(|one| of(one).clamp(least, most)).collect();
            sizes.sort_by(f64::total_cmp);
            let count = sizes.len() as f64;
            let part = |(at, size): (usize, f64)| (size, 100.0 * (count - at as f64) / count);
            let mut points = vec![(least, 100.0)];
            points.extend(sizes.into_iter().enumerate().map(part));
            panel.curve(name, Style::Signal(signal), points);
        }
        panel
    };
    let [hapt, nothing, ..] = &all;
    let growing = |outcomes: &[Outcome]| outcomes.iter().filter(|one| grows(one)).count();
    let alt = format!(
        "Of {SHOWN} random games with a car that answers the steering, {} grow hands off with hapt and {} with nothing; below, the torque that hands feel beside the game's.",
        growing(hapt),
        growing(nothing)
    );
    let title = "Random games on random wheels, by what is added to them".into();
    Ok(Figure { title, alt, panels: DRAWN.map(panel).into(), columns: 1 }.svg(Width::Wide, true) + "\n")
}

/// For each remedy, the outcome with each pair.
fn outcomes(n: u64, seed: u64, answers: bool) -> Result<[Vec<Outcome>; 4]> {
    let mut all = REMEDIES.map(|_| Vec::new());
    for at in 0..n {
        let pair = Pair::random(seed.wrapping_mul(1_000_003).wrapping_add(at), answers);
        for ((name, remedy), outcomes) in REMEDIES.iter().zip(&mut all) {
            let outcome = run(&pair, *remedy).map_err(|error| anyhow!("{error}"))?;
            if *name == "hapt" && grows(&outcome) {
                eprintln!("grows: {pair:?} {outcome:?}");
            }
            outcomes.push(outcome);
        }
    }
    Ok(all)
}

/// In the last second faster than the kick, by 1 %, and than in the first second.
fn grows(outcome: &Outcome) -> bool {
    outcome.last > 1.01 * outcome.first.max(KICK)
}

fn table(name: &str, outcomes: &[Vec<Outcome>; 4], n: u64) -> String {
    let mut out = format!("| {name} |");
    for (name, _) in REMEDIES {
        let _ = write!(out, " {name} |");
    }
    out += "\n| --- | ---: | ---: | ---: | ---: |\n";
    let mut row = |name: &str, cell: &dyn Fn(&[Outcome]) -> String| {
        let _ = write!(out, "| {name} |");
        for outcomes in outcomes {
            let _ = write!(out, " {} |", cell(outcomes));
        }
        out += "\n";
    };
    let quantile = |outcomes: &[Outcome], of: fn(&Outcome) -> f64, share| quantile(outcomes.iter().map(of), share);
    row("games", &|_| n.to_string());
    row("hands off: faster at the end than at first", &|outcomes| {
        outcomes.iter().filter(|one| grows(one)).count().to_string()
    });
    row("the same, faster than 1 rad/s in the last second", &|outcomes| {
        outcomes.iter().filter(|one| one.last > 1.0).count().to_string()
    });
    for (name, share) in [("hands on: torque beside the game's, median", 0.5), ("in 95 of 100", 0.95)] {
        row(name, &|outcomes| format!("{:.1} %", 100.0 * quantile(outcomes, |one| one.felt, share)));
    }
    row("of the motor's largest torque, in 95 of 100", &|outcomes| {
        format!("{:.1} %", 100.0 * quantile(outcomes, |one| one.extra_torque, 0.95))
    });
    row("hands off: of the level held back, mean", &|outcomes| {
        format!("{:.1} %", 100.0 * outcomes.iter().map(|one| one.held_back).sum::<f64>() / outcomes.len().max(1) as f64)
    });
    out
}
