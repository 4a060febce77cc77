//! The notes' wheel in C as the notes compute it, and the lines of the exported C that do the same: a table of docs/notes.md.

use std::fmt::Write;
use std::fs;

use anyhow::{Context, Result, ensure};
use hapt_core::SafetyProfile;
use hapt_export_c::{About, Float, Prefix, export};
use hapt_model::{Source, World};

/// The lecture's program, which a test of hapt-export-c runs together with the exported one.
const LECTURE: &str = "crates/hapt-export-c/tests/export_c/lecture.c";
const WORLD: &str = "worlds/notes/damped.toml";

/// The beginning of a line of the lecture, the contents of the lines of the exported C, and their difference.
struct Pair {
    lecture: &'static str,
    exported: &'static [&'static str],
    differs: &'static str,
}

const PAIRS: [Pair; 9] = [
    Pair {
        lecture: "double b = T * k;",
        exported: &["/* port_puck */"],
        differs: "b is computed once, by hapt: the numbers are -k and -b",
    },
    Pair {
        lecture: "double omega_z =",
        exported: &["return (position - state->last_position) * world->sample_rate;"],
        differs: "times 1/T; 0 at the first sample, which has none before it",
    },
    Pair {
        lecture: "double torque =",
        exported: &["wheel_real torque = world->port_offset", "torque += world->port_bodies[0][i]"],
        differs: "the opposite sign: this is the torque on the puck, the printed one is that on the virtual wheel",
    },
    Pair {
        lecture: "double d_theta =",
        exported: &["/* state */", "dx += world->state[j][0][0][i]"],
        differs: "T A of (2.8) and (2.20), by columns",
    },
    Pair {
        lecture: "double d_omega =",
        exported: &["/* input_new */", "dv += world->input_new[0][1][i] * position", "dv += world->state[j][0][1][i]"],
        differs: "T B of (2.8) and (2.20); the row of A is added below it",
    },
    Pair {
        lecture: "theta_w = theta_w + T",
        exported: &["wheel_add(&state->now, (wheel_real)1, &state->change);"],
        differs: "the change is kept, and added at the next sample: a world that is changed, or steps less often, needs it",
    },
    Pair {
        lecture: "omega_w = omega_w + T",
        exported: &["x->velocity[i] += factor * y->velocity[i];"],
        differs: "both from the old state: theta_w from the new omega_w would be symplectic Euler",
    },
    Pair { lecture: "last_z = z;", exported: &["state->last_position = position;"], differs: "nothing" },
    Pair {
        lecture: "return torque;",
        exported: &["sample.command = wheel_command(world, sample.torque);", "self->output = output;"],
        differs: "held within the motor's limit, which the notes' \"software limit\" only names; then the supervisor, whose torque the motor gets",
    },
];

/// The table in Markdown. Errors where a line of either is not there, or there more than once.
pub fn table() -> Result<String> {
    let world = World::read(&Source::open(WORLD)?, &["loop.estimator=difference".into()])?;
    let about = About { title: world.title.clone().unwrap_or_default(), ..About::default() };
    let limits = world.board_limits(SafetyProfile::Uncertified);
    let prefix = Prefix::new("wheel")?;
    let exported = export(&world.spec(), &limits, &about, &prefix, "wheel.h", Float::F64)?.source;
    let lecture = fs::read_to_string(LECTURE).context(LECTURE)?;
    has_the_worlds_numbers(&world, &lecture)?;
    let mut body: Vec<&str> = lecture.lines().filter(|line| line.starts_with("    ")).collect();
    let mut text = String::from("| the lecture | the exported C | what differs |\n| --- | --- | --- |\n");
    for Pair { lecture, exported: theirs, differs } in PAIRS {
        let at = body.iter().position(|line| line.trim_start().starts_with(lecture));
        let line = body.remove(at.with_context(|| format!("{LECTURE} has no line {lecture}"))?);
        let lines: Result<Vec<String>> = theirs.iter().map(|part| one(&exported, part)).collect();
        writeln!(text, "| {} | {} | {differs} |", code(line), lines?.join("<br>"))?;
    }
    ensure!(body.is_empty(), "{LECTURE} has a line that the table lacks: {body:?}");
    Ok(text)
}

/// The one line of a text that contains `part`.
fn one(text: &str, part: &str) -> Result<String> {
    let found: Vec<&str> = text.lines().filter(|line| line.contains(part)).collect();
    ensure!(found.len() == 1, "the exported C has {} lines with {part}, where the table shows one", found.len());
    Ok(code(found[0]))
}

fn code(line: &str) -> String {
    let words: Vec<&str> = line.split_whitespace().collect();
    format!("`{}`", words.join(" "))
}

/// Whether the program's T, k and J_w are those of the world.
fn has_the_worlds_numbers(world: &World, lecture: &str) -> Result<()> {
    let stiffness =
        world.couplings.iter().find_map(|coupling| coupling.law.spring()).context("the world has a spring")?;
    let inertia = world.bodies.first().context("the world has a wheel")?.inertia;
    for (name, wanted) in [("T", world.sampling.period), ("k", stiffness), ("J_w", inertia)] {
        let given = lecture.split_once(&format!(" {name} = ")).and_then(|(_, rest)| rest.split([',', ';']).next());
        let given: f64 = given.with_context(|| format!("{LECTURE} has no {name}"))?.parse()?;
        ensure!((given / wanted - 1.0).abs() < 1e-12, "{LECTURE}: {name} is {given}, and in {WORLD} {wanted}");
    }
    Ok(())
}
