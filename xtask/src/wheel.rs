//! Random sets of effects on random force-feedback wheels, hands-off: rendered by hapt, compared with rendering by differences of
//! positions.

use std::fmt::Write as _;

use anyhow::{Result, anyhow};
use fastrand::Rng;
use hapt_core::wheel::{Device, Effect, Sides, Timing, Wheel};
use hapt_plant::{VirtualDevice, spec::DeviceSpec};
use hapt_report::Width;
use hapt_report::figure::{Axis, Figure, Panel, Style};

use crate::campaign::Campaign;
use crate::random::{log_between, quantile};

/// Seconds of a run.
const DURATION: f64 = 4.0;
/// The kick, rad/s.
const KICK: f64 = 2.0;

/// The motion of a free wheel after a kick.
#[derive(Clone, Copy, Default)]
struct Course {
    /// Degrees, back and forth.
    travelled: f64,
    /// The largest speed of the last second, rad/s.
    last: f64,
    /// The largest speed of the whole run.
    fastest: f64,
}

/// `cargo xtask wheel [--n N] [--seed S] [--write]`
pub fn command(words: &[&str]) -> Result<()> {
    let campaign = Campaign::parse(words, false)?;
    let courses = courses(campaign.n, campaign.seed)?;
    campaign.publish("wheel", "docs/wheel.md", &table(&courses, campaign.n))
}

/// Each random set, as hapt renders it and by differences.
fn courses(n: u64, seed: u64) -> Result<[Vec<Course>; 2]> {
    let mut courses = [Vec::new(), Vec::new()];
    for at in 0..n {
        let mut rng = Rng::with_seed(seed.wrapping_mul(1_000_003).wrapping_add(at));
        let (spec, count) = device(&mut rng);
        let effects = effects(&mut rng);
        courses[0].push(rendered(&spec, count, &effects)?);
        courses[1].push(differenced(&spec, count, &effects));
    }
    Ok(courses)
}

/// Sets in the picture.
const SHOWN: u64 = 2000;

/// The picture of docs/wheel.md: the share of sets that travel farther than an angle in degrees.
pub fn picture() -> Result<String> {
    let courses = courses(SHOWN, 1)?;
    let x = Axis::logarithmic("degrees travelled in 4 s after a kick, hands off", "", 1.0, 1e5);
    let mut panel = Panel::new("", x, Axis::logarithmic("sets of effects that travel farther", "%", 0.05, 100.0));
    let mut parts = Vec::new();
    for ((name, signal), all) in [("hapt", 0), ("differences", 1)].into_iter().zip(courses) {
        let mut travelled: Vec<f64> = all.iter().map(|course| course.travelled.max(1.0)).collect();
        travelled.sort_by(f64::total_cmp);
        let count = travelled.len() as f64;
        parts.push(format!("with {name} at most {:.0} degrees", travelled.last().copied().unwrap_or_default()));
        // As a staircase: all of them travel farther than the shortest travel.
        let mut points = vec![(1.0, 100.0)];
        for (at, degrees) in travelled.into_iter().enumerate() {
            points.push((degrees, 100.0 * (count - at as f64) / count));
        }
        panel.curve(name, Style::Signal(signal), points);
    }
    let title = "Random sets of effects on random wheels".into();
    let alt = format!("Of {SHOWN} random sets of effects, the part that travels farther: {}.", parts.join(", "));
    Ok(Figure { title, alt, panels: vec![panel], columns: 1 }.svg(Width::Wide, true) + "\n")
}

/// A wheel, and the angle of a count.
fn device(rng: &mut Rng) -> (DeviceSpec, f64) {
    let period = log_between(rng, 2.5e-4, 2e-3);
    let inertia = log_between(rng, 1e-3, 0.1);
    let damping = log_between(rng, 2e-3, 0.1);
    let counts = log_between(rng, 4e3, 4e6).round();
    let delay = rng.f64() * period;
    // Every second wheel has none.
    let friction = if rng.bool() { 0.0 } else { log_between(rng, 1e-3, 0.1) };
    let spec = DeviceSpec { delay, damping, friction, ..DeviceSpec::new(period, inertia) };
    (spec, std::f64::consts::TAU / counts)
}

/// One to six conditions about the middle, as strong as those of games: their largest torque is 5 N·m.
fn effects(rng: &mut Rng) -> Vec<Effect<f64>> {
    let one = |rng: &mut Rng| match rng.u8(0..4) {
        0 => Effect::Spring(Sides::even(log_between(rng, 0.1, 300.0), 5.0)),
        1 => Effect::Damper(Sides::even(log_between(rng, 1e-2, 10.0), 5.0)),
        2 => Effect::Friction(Sides::even(log_between(rng, 1e-2, 5.0), 5.0)),
        _ => Effect::Inertia(Sides::even(log_between(rng, 1e-4, 0.1), 5.0)),
    };
    (0..rng.usize(1..7)).map(|_| one(rng)).collect()
}

/// Hands-off, with the torque of a counted position.
fn course(spec: &DeviceSpec, count: f64, mut torque: impl FnMut(f64) -> f64) -> Course {
    let mut wheel = VirtualDevice::new(spec);
    wheel.set_out((0.0, KICK), (0.0, 0.0));
    let samples = (DURATION / spec.period) as usize;
    let (mut course, mut before) = (Course::default(), 0.0);
    for k in 0..samples {
        let (position, velocity) = wheel.puck();
        course.travelled += (position - before).abs().to_degrees();
        course.fastest = course.fastest.max(velocity.abs());
        if 4 * k >= 3 * samples {
            course.last = course.last.max(velocity.abs());
        }
        before = position;
        wheel.command(torque((position / count + 0.5).floor() * count));
        wheel.travel();
    }
    course
}

fn rendered(spec: &DeviceSpec, count: f64, effects: &[Effect<f64>]) -> Result<Course> {
    let timing = Timing { delay: spec.delay, ..Timing::even(spec.period) };
    let device = Device { friction: spec.friction, count, ..Device::ideal(timing, spec.damping, 5.0) };
    let wheel = Wheel::<f64>::new(&device).map_err(|error| anyhow!("{error}"))?;
    let mut state = wheel.start();
    Ok(course(spec, count, |position| wheel.step(&mut state, position, effects, 0).torque))
}

/// The difference of positions for the velocity, of velocities for the acceleration, and no bound but the largest torque.
fn differenced(spec: &DeviceSpec, count: f64, effects: &[Effect<f64>]) -> Course {
    let (mut last, mut before) = (0.0, KICK);
    course(spec, count, |position| {
        let velocity = (position - last) / spec.period;
        let acceleration = (velocity - before) / spec.period;
        (last, before) = (position, velocity);
        let bounded = |sides: &Sides<f64>, x: f64| -(sides.above * x).clamp(-sides.most_below, sides.most_above);
        let all = effects.iter().map(|effect| match effect {
            Effect::Spring(sides) => bounded(sides, position),
            Effect::Damper(sides) => bounded(sides, velocity),
            Effect::Inertia(sides) => bounded(sides, acceleration),
            Effect::Friction(sides) if velocity == 0.0 => 0.0 * sides.above,
            Effect::Friction(sides) => bounded(sides, velocity.signum()),
            Effect::Torque(torque) => *torque,
        });
        all.sum::<f64>().clamp(-5.0, 5.0)
    })
}

fn table(courses: &[Vec<Course>; 2], n: u64) -> String {
    let mut out = String::from("| hands off, after a kick of 2 rad/s | hapt | differences |\n| --- | ---: | ---: |\n");
    let count = |of: fn(&Course) -> bool| courses.each_ref().map(|all| all.iter().filter(|course| of(course)).count());
    let mut row = |name: &str, [ours, differences]: [String; 2]| {
        let _ = writeln!(out, "| {name} | {ours} | {differences} |");
    };
    row("sets of effects", [n.to_string(), n.to_string()]);
    let counted = |of| count(of).map(|count| count.to_string());
    row("faster than the kick at any time, by 1 %", counted(|course| course.fastest > 1.01 * KICK));
    row("the same in the fourth second", counted(|course| course.last > 1.01 * KICK));
    for (name, share) in [("degrees travelled, median", 0.5), ("in 95 of 100", 0.95), ("at most", 1.0)] {
        row(
            name,
            courses.each_ref().map(|all| format!("{:.0}", quantile(all.iter().map(|course| course.travelled), share))),
        );
    }
    out
}
