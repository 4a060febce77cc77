//! Position, velocity and torque of a run over time.

use hapt_model::Motion;

use crate::extremes::{Extremes, Point, Stretches};
use crate::figure::{Axis, Bands, Figure, Panel, Style};
use crate::svg::Width;
use crate::ticks::number;
use crate::units;

/// The largest number of clipped intervals; more are joined.
const CLIPPED: usize = 200;

/// The data of a run's figures; their size does not depend on its length.
///
/// ```
/// use hapt_model::{Source, World};
/// use hapt_report::{Traces, Width};
/// use hapt_sim::Simulation;
///
/// let file = r#"
/// loop.period = "1 ms"
/// device.inertia = "6.4e-4 kg m^2"
/// [[couplings]]
/// kind = "spring"
/// between = ["puck", "ground"]
/// stiffness = "0.5 N m/rad"
/// [scenarios.turn]
/// duration = "1 s"
/// hand = { kind = "sine", amplitude = "30 deg", frequency = "2 Hz" }
/// "#;
/// let world = World::read(&Source::from_text("spring.toml", file), &[])?;
/// let mut traces = Traces::new(world.motion, &world.names, world.device.limit);
/// let mut run = Simulation::new(&world, world.scenario("turn")?)?;
/// while let Some(row) = run.next() {
///     let row = row?;
///     traces.add(row.time, [(row.puck, row.puck_velocity)], row.torque, row.applied);
/// }
/// let figure = traces.figure("a spring", None, Width::Wide, Width::Wide.stretches());
/// assert_eq!(figure.panels.len(), 3, "position, velocity and torque over time");
/// assert!(figure.svg(Width::Wide, true).starts_with("<svg"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Traces {
    motion: Motion,
    names: Vec<String>,
    limit: Option<f64>,
    positions: Vec<Extremes>,
    velocities: Vec<Extremes>,
    commanded: Extremes,
    applied: Extremes,
    clipped: Stretches,
    span: Option<(f64, f64)>,
    /// Rows outside of this interval are omitted, in s.
    window: (f64, f64),
}

hapt_model::named! {
    /// A quantity that [`Traces::overlay`] draws, from the top down. Its name is that of the command line.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Signal {
        /// The positions of puck and bodies.
        Position => "position",
        /// The velocities of puck and bodies.
        Velocity => "velocity",
        /// The motor's command and its applied torque; linear: the force.
        Torque => "torque",
    }
}

/// The predicted bounds of an oscillation about `centre`: ± `size` e^{growth (t - from)}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    /// N·m; linear: N.
    pub centre: f64,
    /// The size at `from`, in the same unit.
    pub size: f64,
    /// In s.
    pub from: f64,
    /// In 1/s.
    pub growth: f64,
}

/// One signal of every run on common axes, in units suitable for all. Torques are the applied ones.
fn overlaid(signal: Signal, runs: &[(String, Traces)], room: usize) -> Panel {
    let motion = runs.first().map_or(Motion::Rotary, |(_, traces)| traces.motion);
    let mut curves: Vec<(String, &Extremes)> = Vec::new();
    for (run, traces) in runs {
        let states = match signal {
            Signal::Position => &traces.positions,
            Signal::Velocity => &traces.velocities,
            Signal::Torque => {
                curves.push((run.clone(), &traces.applied));
                continue;
            }
        };
        curves.extend(traces.names.iter().zip(states).map(|(name, state)| (format!("{run}: {name}"), state)));
    }
    let size = largest(curves.iter().map(|(_, curve)| *curve));
    let (name, unit) = match signal {
        Signal::Position => ("position", units::position(motion, size)),
        Signal::Velocity => ("velocity", units::velocity(motion, size)),
        Signal::Torque => (units::effort_name(motion), units::effort(motion, size)),
    };
    let spans = || runs.iter().filter_map(|(_, traces)| traces.span);
    let (from, to) = spans().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (a, b)| (low.min(a), high.max(b)));
    let (from, to) = if from <= to { (from, to) } else { (0.0, 1.0) };
    let time = units::time(to);
    let ranges = curves.iter().filter_map(|(_, curve)| curve.range()).flat_map(|(low, high)| [low, high]);
    let mut panel = Panel::new(
        "",
        Axis::from_to("time", time.name, from * time.per_si, to * time.per_si),
        Axis::around(name, unit.name, ranges.map(|x| x * unit.per_si)),
    );
    for (i, (name, curve)) in curves.iter().enumerate() {
        panel.curve(name, Style::Signal(i), scaled(curve.points(room), time.per_si, unit.per_si));
    }
    panel
}

impl Traces {
    /// The traces of a puck and these bodies; `limit` is the motor's.
    pub fn new(motion: Motion, bodies: &[String], limit: Option<f64>) -> Self {
        let names: Vec<String> = std::iter::once("puck".to_string()).chain(bodies.iter().cloned()).collect();
        let room = Width::Wide.stretches();
        let each = vec![Extremes::new(room); names.len()];
        Traces {
            motion,
            names,
            limit,
            positions: each.clone(),
            velocities: each,
            commanded: Extremes::new(room),
            applied: Extremes::new(room),
            clipped: Stretches::new(CLIPPED),
            span: None,
            window: (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    /// Keeps the rows from the first of these times to the second, both inclusive, in s.
    pub fn within(self, window: (f64, f64)) -> Self {
        Traces { window, ..self }
    }

    /// Whether no row was added.
    pub fn is_empty(&self) -> bool {
        self.span.is_none()
    }

    /// Rotary or linear.
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// The figure of several runs of one motion, each with its name, a panel for each of these signals. A single run is drawn as by
    /// [`Traces::figure`].
    pub fn overlay(title: &str, runs: &[(String, Traces)], signals: &[Signal], width: Width) -> Figure {
        Traces::overlay_with(title, runs, signals, width.stretches())
    }

    /// The same, with this number of intervals per curve.
    pub(crate) fn overlay_with(title: &str, runs: &[(String, Traces)], signals: &[Signal], room: usize) -> Figure {
        let of = |traces: &Traces, signal: Signal| match signal {
            Signal::Position => traces.states("position", &traces.positions, units::position, room),
            Signal::Velocity => traces.states("velocity", &traces.velocities, units::velocity, room),
            Signal::Torque => traces.efforts(None, room),
        };
        let alt = |(name, traces): &(String, Traces)| match runs.len() {
            1 => traces.alt(None),
            _ => format!("{name}: {}", traces.alt(None)),
        };
        let alt = runs.iter().map(alt).collect::<Vec<_>>().join(" ");
        let panels = match runs {
            [(_, traces)] => signals.iter().map(|signal| of(traces, *signal)).collect(),
            _ => signals.iter().map(|signal| overlaid(*signal, runs, room)).collect(),
        };
        Figure { title: title.into(), alt, panels, columns: 1 }
    }

    /// Adds a row in SI: position and velocity of the puck and each body, the command and the applied torque.
    pub fn add(&mut self, time: f64, states: impl IntoIterator<Item = Point>, commanded: f64, applied: f64) {
        if !(self.window.0..=self.window.1).contains(&time) {
            return;
        }
        for ((position, velocity), (x, v)) in self.positions.iter_mut().zip(&mut self.velocities).zip(states) {
            position.add(time, x);
            velocity.add(time, v);
        }
        self.commanded.add(time, commanded);
        self.applied.add(time, applied);
        if let Some(limit) = self.limit {
            self.clipped.add(time, commanded.abs() > limit);
        }
        self.span = Some((self.span.map_or(time, |span| span.0), time));
    }

    /// From the first row to the last, in s.
    pub fn span(&self) -> (f64, f64) {
        self.span.unwrap_or((0.0, 1.0))
    }

    /// Three panels above each other.
    pub fn figure(&self, title: &str, envelope: Option<Envelope>, width: Width, room: usize) -> Figure {
        let room = room.min(width.stretches());
        let panels = vec![
            self.states("position", &self.positions, units::position, room),
            self.states("velocity", &self.velocities, units::velocity, room),
            self.efforts(envelope, room),
        ];
        Figure { title: title.into(), alt: self.alt(envelope), panels, columns: 1 }
    }

    /// The torque under the name `title`, on an axis that includes ± `size` (in SI), unless the torque would then be invisible.
    pub fn torque_panel(&self, title: &str, size: f64, width: Width) -> Panel {
        let mut panel = self.efforts(None, width.stretches());
        let unit = units::effort(self.motion, self.largest_effort());
        // With ten times larger torques the bounds would be invisible.
        if size <= 10.0 * self.largest_effort() {
            let least = 1.06 * size * unit.per_si;
            (panel.y.low, panel.y.high) = (panel.y.low.min(-least), panel.y.high.max(least));
            panel.title = title.into();
        } else {
            panel.title = format!("{title} (own scale)");
        }
        panel
    }

    /// The largest |command|, or the motor's limit, in SI.
    pub fn largest_effort(&self) -> f64 {
        largest([&self.commanded, &self.applied]).max(self.limit.unwrap_or(0.0))
    }

    fn time_axis(&self) -> (Axis, f64) {
        let (from, to) = self.span();
        let unit = units::time(to);
        (Axis::from_to("time", unit.name, from * unit.per_si, to * unit.per_si), unit.per_si)
    }

    fn states(&self, name: &str, signals: &[Extremes], unit: fn(Motion, f64) -> units::Unit, room: usize) -> Panel {
        let unit = unit(self.motion, largest(signals));
        let (time, seconds) = self.time_axis();
        let ranges = signals.iter().filter_map(Extremes::range).flat_map(|(low, high)| [low, high]);
        let mut panel = Panel::new("", time, Axis::around(name, unit.name, ranges.map(|x| x * unit.per_si)));
        for (i, (signal, name)) in signals.iter().zip(&self.names).enumerate() {
            panel.curve(name, Style::Signal(i), scaled(signal.points(room), seconds, unit.per_si));
        }
        panel
    }

    fn efforts(&self, envelope: Option<Envelope>, room: usize) -> Panel {
        let unit = units::effort(self.motion, self.largest_effort());
        let (time, seconds) = self.time_axis();
        let range = [&self.commanded, &self.applied].into_iter().filter_map(|signal| signal.range());
        let limits = self.limit.map(|limit| (-limit, limit));
        let values = range.chain(limits).flat_map(|(low, high)| [low, high]);
        let axis = Axis::around(units::effort_name(self.motion), unit.name, values.map(|x| x * unit.per_si));
        let mut panel = Panel::new("", time, axis);
        let (from, to) = self.span();
        // Without clipping both coincide: the broad curve is visible behind the other.
        panel.curve("applied", Style::Beneath, scaled(self.applied.points(room), seconds, unit.per_si));
        panel.curve("asked for", Style::Signal(0), scaled(self.commanded.points(room), seconds, unit.per_si));
        if let Some(limit) = self.limit {
            for side in [-limit, limit] {
                panel.curve("limit", Style::Limit, scaled(vec![(from, side), (to, side)], seconds, unit.per_si));
            }
        }
        for side in [-1.0, 1.0] {
            let Some(envelope) = envelope else { continue };
            let point = |i: usize| {
                let t = envelope.from + (to - envelope.from) * i as f64 / 80.0;
                (t, envelope.centre + side * envelope.size * (envelope.growth * (t - envelope.from)).exp())
            };
            panel.curve(
                "predicted ±e^(growth·t)",
                Style::Predicted,
                scaled((0..=80).map(point).collect(), seconds, unit.per_si),
            );
        }
        let list = self.clipped.list().iter().map(|&(from, to)| (from * seconds, to * seconds)).collect();
        panel.bands = Some(Bands { name: "clipped".into(), list });
        panel
    }

    fn alt(&self, envelope: Option<Envelope>) -> String {
        let (from, to) = self.span();
        let range = |signal: &Extremes, unit: units::Unit| {
            let (low, high) = signal.range().unwrap_or((0.0, 0.0));
            format!("{} to {} {}", number(low * unit.per_si, 4), number(high * unit.per_si, 4), unit.name)
        };
        let each = |signals: &[Extremes], unit: units::Unit| {
            let all = self.names.iter().zip(signals).take(6);
            all.map(|(name, signal)| format!("{name} {}", range(signal, unit))).collect::<Vec<_>>().join(", ")
        };
        let mut alt = format!(
            "Position, velocity and {} over time, {} to {}. Positions: {}. Velocities: {}. Asked of the motor: {}.",
            units::effort_name(self.motion),
            units::say_time(from),
            units::say_time(to),
            each(&self.positions, units::position(self.motion, largest(&self.positions))),
            each(&self.velocities, units::velocity(self.motion, largest(&self.velocities))),
            range(&self.commanded, units::effort(self.motion, self.largest_effort())),
        );
        if let Some(limit) = self.limit {
            alt += &format!(" The motor's limit is {}", units::say_effort(limit, self.motion));
            alt += &match self.clipped.list().first() {
                Some(&(first, _)) => format!(" and is first asked to be exceeded at {}.", units::say_time(first)),
                None => " and is never exceeded.".into(),
            };
        }
        if let Some(envelope) = envelope {
            let course = match envelope.growth {
                growth if growth > 1e-9 => "widens",
                growth if growth < -1e-9 => "narrows",
                _ => "keeps its width",
            };
            alt += &format!(" The predicted envelope {course}.");
        }
        alt
    }
}

fn largest<'a>(signals: impl IntoIterator<Item = &'a Extremes>) -> f64 {
    let size = |(low, high): (f64, f64)| low.abs().max(high.abs());
    signals.into_iter().filter_map(Extremes::range).map(size).fold(0.0, f64::max)
}

pub(crate) fn scaled(points: Vec<Point>, x: f64, y: f64) -> Vec<Point> {
    points.into_iter().map(|(a, b)| (a * x, b * y)).collect()
}
