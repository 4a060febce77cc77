//! A scenario's run, collected while it streams.

use hapt_analysis::continuous::piecewise_at_bodies;
use hapt_analysis::{Check, Continuous, Slopes, SystemCheck};
use hapt_model::{Motion, Station, System, World};
use hapt_sim::{Ledger, Row, Signal, Simulation, StationRow, SystemSummary, world_energy};
use serde_json::Value;

use crate::extremes::Extremes;
use crate::figure::{Axis, Figure, Panel, Style};
use crate::recorded::{CurveStyle, Recorded, Trace, moving, torque};
use crate::svg::Width;
use crate::traces::{Envelope, Traces, scaled};
use crate::units;

/// The data of one scenario for a page; their size does not depend on its length.
#[derive(Clone, Debug)]
pub struct Run<'s> {
    pub(crate) system: &'s System,
    /// The scenario's name.
    pub name: String,
    /// The scenario's duration, in s.
    pub duration: f64,
    /// The run in a few numbers.
    pub summary: SystemSummary<'s>,
    /// The signals of each station.
    pub traces: Vec<Traces>,
    /// The number of releases of each end of each link.
    pub releases: Vec<[u64; 2]>,
    /// The reason of an early end, if any.
    pub failure: Option<String>,
    /// Of each station of a network, the torque of its links.
    pub(crate) links: Vec<Extremes>,
    /// The energies of a world.
    energies: [Extremes; ENERGIES.len()],
    /// Of each station, positions and velocities of the puck and each body, and both torques; then of a world the energies, and room for
    /// both bounds that are predicted; of a network the torque of its links.
    pub(crate) recorded: Vec<Recorded>,
    swing: Option<Swing>,
}

/// The energies, and the names of their columns.
const ENERGIES: [(&str, &str); 8] = [
    ("stored by the world", "energy_J"),
    ("given by the hand", "hand_J"),
    ("given by the motor", "motor_J"),
    ("taken by damping", "damping_J"),
    ("taken by friction", "friction_J"),
    ("given by gravity and cogging", "field_J"),
    ("taken by the stops", "stops_J"),
    ("taken by the shaft", "shaft_J"),
];
/// The number of torques: command and applied torque.
const TORQUES: usize = 2;
/// The number of bounds of a prediction.
const BOUNDS: usize = 2;
/// The torques of a network's station: these, and that of its links.
const LINKED: usize = TORQUES + 1;

/// The first turn of the held world's slowest mode, from which the predicted envelope starts.
#[derive(Clone, Debug)]
struct Swing {
    continuous: Continuous,
    growth: f64,
    from: f64,
    turn: f64,
    centre: Option<f64>,
    size: f64,
}

impl<'s> Run<'s> {
    /// Before the first row of `run`, a run of the scenario `name`; `check` is the certificate of the same system.
    pub fn new(system: &'s System, name: &str, run: &hapt_sim::Run, check: &SystemCheck) -> Self {
        let swing = match (check, system.world()) {
            (SystemCheck::World(check), Some(world)) => {
                let still = run.stations().next().and_then(Simulation::still_from);
                still.and_then(|from| Swing::new(world, check, from))
            }
            _ => None,
        };
        let signal = || Extremes::new(Width::Wide.stretches());
        let traces = |Station { world, .. }: &Station| Traces::new(world.motion, &world.names, world.device.limit);
        let linked = system.stations.iter().filter(|_| system.world().is_none());
        let others = if system.world().is_some() { TORQUES + ENERGIES.len() + BOUNDS } else { LINKED };
        let columns = |station: &Station| 2 * (station.world.bodies.len() + 1) + others;
        Run {
            system,
            name: name.into(),
            duration: system
                .scenario(name)
                .into_iter()
                .flatten()
                .map(|scenario| scenario.duration)
                .next()
                .unwrap_or(0.0),
            summary: SystemSummary::new(system, run),
            traces: system.stations.iter().map(traces).collect(),
            releases: Vec::new(),
            failure: None,
            links: linked.map(|_| signal()).collect(),
            recorded: system.stations.iter().map(|station| Recorded::new(columns(station))).collect(),
            energies: std::array::from_fn(|_| signal()),
            swing,
        }
    }

    /// Adds the next row.
    pub fn add(&mut self, of: &StationRow<'_>) {
        self.summary.add(of);
        let row = of.row;
        let torque = if of.is_linked { row.torque + of.link } else { row.torque };
        let states = std::iter::once((row.puck, row.puck_velocity)).chain(row.bodies.iter().copied());
        self.traces[of.station].add(row.time, states.clone(), torque, row.applied);
        let recorded = states.flat_map(|(position, velocity)| [position, velocity]).chain([torque, row.applied]);
        let Some(world) = self.system.world() else {
            self.recorded[of.station].add(row.time, recorded.chain([of.link]));
            return self.links[of.station].add(row.time, of.link);
        };
        let stored = world_energy(world, row.puck, &row.bodies, &row.bristles);
        let Ledger { hand, motor, field, damping, friction, stops, shaft } = row.ledger;
        let values = [stored, hand, motor, damping, friction, field, stops, shaft];
        for (signal, value) in self.energies.iter_mut().zip(values) {
            signal.add(row.time, value);
        }
        self.recorded[of.station].add(row.time, recorded.chain(values).chain([f64::NAN; BOUNDS]));
        if let Some(swing) = &mut self.swing {
            swing.add(row);
        }
    }

    /// The run of a world for the plots of a page, in about `bytes` bytes; `name` is the name of its files.
    pub(crate) fn plots(&self, world: &World, name: &str, bytes: usize) -> Value {
        let motion = world.motion;
        let [positions, velocities] = moving(world);
        let first = 2 * positions.len();
        let mut torques = vec![
            torque(motion, "asked for", first, Signal::TORQUE, CurveStyle::Signal(0)),
            torque(motion, "applied", first + 1, Signal::APPLIED, CurveStyle::Dashed(1)),
        ];
        let mut recorded = self.recorded[0].clone();
        let bounds = first + TORQUES + ENERGIES.len();
        if let Some(Envelope { centre, size, from, growth }) = self.envelope() {
            let effort = match motion {
                Motion::Rotary => "Nm",
                Motion::Linear => "N",
            };
            for (column, (end, side)) in (bounds..).zip([("low", -1.0), ("high", 1.0)]) {
                recorded.set(column, |time| centre + side * size * (growth * (time - from)).exp());
                let (name, file) = ("predicted".into(), format!("predicted_{end}_{effort}"));
                torques.push(Trace { name, column, file, style: CurveStyle::Predicted });
            }
        }
        let energies = ENERGIES.iter().enumerate().filter(|(i, _)| {
            // Energies that are always 0 are left out, as in the figure.
            *i == 0 || recorded.size(first + TORQUES + i) > 0.0
        });
        let energies: Vec<Trace> = energies
            .map(|(i, (name, file))| Trace {
                name: (*name).into(),
                column: first + TORQUES + i,
                file: (*file).into(),
                style: CurveStyle::Signal(i),
            })
            .collect();
        let limits: Vec<f64> = world.device.limit.iter().flat_map(|limit| [*limit, -limit]).collect();
        let panels = [
            recorded.panel("position", positions, |size| units::position(motion, size), &[]),
            recorded.panel("velocity", velocities, |size| units::velocity(motion, size), &[]),
            recorded.panel(units::effort_name(motion), torques, |size| units::effort(motion, size), &limits),
            recorded.panel("energy", energies, units::energy, &[]),
        ];
        recorded.data(name, &panels, bytes)
    }

    /// The bounds that the analysis predicts for the torque, where the puck is held still and the world is linear: the growth is
    /// predicted, the size is that of the first turn of the slowest mode.
    pub fn envelope(&self) -> Option<Envelope> {
        self.swing.as_ref().and_then(Swing::envelope)
    }

    /// Position, velocity and torque over time.
    pub fn motion(&self, width: Width, room: usize) -> Figure {
        self.traces[0].figure(
            &format!("{}: motion and {}", self.name, units::effort_name(self.system.motion)),
            self.envelope(),
            width,
            room,
        )
    }

    /// The stored energy of the world, and the works of hand, motor and all of the device, over time.
    pub fn energy(&self, width: Width, room: usize) -> Figure {
        let ranges: Vec<(f64, f64)> = self.energies.iter().map(|signal| signal.range().unwrap_or((0.0, 0.0))).collect();
        let size = |&(low, high): &(f64, f64)| low.abs().max(high.abs());
        let unit = units::energy(ranges.iter().map(size).fold(0.0, f64::max));
        let (from, to) = self.traces[0].span();
        let seconds = units::time(to);
        let x = Axis::from_to("time", seconds.name, from * seconds.per_si, to * seconds.per_si);
        let y = Axis::around(
            "energy",
            unit.name,
            ranges.iter().flat_map(|&(low, high)| [low * unit.per_si, high * unit.per_si]),
        );
        let mut panel = Panel::new("", x, y);
        let mut parts = Vec::new();
        for (i, ((name, _), signal)) in ENERGIES.iter().zip(&self.energies).enumerate() {
            if i > 0 && ranges.get(i).map_or(0.0, size) == 0.0 {
                continue;
            }
            let points = signal.points(room.min(width.stretches()));
            let last = points.last().map_or(0.0, |point| point.1);
            parts.push(format!("{name} {}", unit.say(last, 4)));
            panel.curve(name, Style::Signal(i), scaled(points, seconds.per_si, unit.per_si));
        }
        let alt = format!("Energy over time. At the end: {}.", parts.join(", "));
        Figure { title: format!("{}: energy", self.name), alt, panels: vec![panel], columns: 1 }
    }
}

impl Swing {
    fn new(world: &World, check: &Check, from: f64) -> Option<Self> {
        let growth = check.held.growth_per_s?;
        let slowest = check.held.modes.first()?.frequency_hz;
        if !piecewise_at_bodies(&world.couplings).is_empty() || slowest <= 0.0 {
            return None;
        }
        let continuous = Continuous::new(&world.bodies, &world.couplings, &Slopes::Flat).ok()?;
        Some(Swing { continuous, growth, from, turn: 1.0 / slowest, centre: None, size: 0.0 })
    }

    fn add(&mut self, row: &Row) {
        let since = row.time - self.from;
        if since < -1e-12 || since > self.turn {
            return;
        }
        let centre = match self.centre {
            Some(centre) => centre,
            None => self.rest(row.puck).unwrap_or(f64::NAN),
        };
        self.centre = Some(centre);
        self.size = self.size.max((row.torque - centre).abs() * (-self.growth * since).exp());
    }

    /// The torque on the puck, held at z, when the bodies have come to rest: K w = f - K_z z.
    fn rest(&self, z: f64) -> Option<f64> {
        let n = self.continuous.bodies();
        let (k, f) = (&self.continuous.stiffness, &self.continuous.force);
        let right = f.rows(0, n) - k.view((0, n), (n, 1)) * z;
        let bodies = k.view((0, 0), (n, n)).into_owned().lu().solve(&right)?;
        let pull = k.view((n, 0), (1, n)) * bodies;
        let torque = f[n] - pull[(0, 0)] - k[(n, n)] * z;
        torque.is_finite().then_some(torque)
    }

    fn envelope(&self) -> Option<Envelope> {
        let centre = self.centre.filter(|centre| centre.is_finite())?;
        let Swing { size, from, growth, .. } = *self;
        (size > 0.0).then_some(Envelope { centre, size, from, growth })
    }
}
