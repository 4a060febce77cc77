//! The right answers, computed from a world or a network.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use hapt_analysis::Design;
use hapt_model::{Dimension, Source, System, World, parse_quantity};
use hapt_sim::{Run, station_columns};
use hapt_sweep::{Measure, Sweep};
use serde_json::Value;

use super::pack::{Of, Take};
use crate::failure::Failure;

/// The limits of a graded world: far beyond a lesson's, and fast to compute.
const MAX_BODIES: usize = 8;
const MAX_COUPLINGS: usize = 16;
const MAX_SAMPLES: f64 = 1e6;
const MAX_PERIODS: f64 = 64.0;
/// The time limit of one value.
const TIME_LIMIT: Duration = Duration::from_secs(60);

const MAX_STATIONS: usize = 16;

/// A world or a network whose values are requested.
pub struct Subject<'a> {
    pub source: &'a Source,
    pub sets: Vec<String>,
    pub scenario: Option<&'a str>,
}

impl Subject<'_> {
    /// The system, where it is within the limits.
    pub fn system(&self) -> Result<System, Failure> {
        let system = System::read(self.source, &self.sets)?;
        self.most_of("stations", system.stations.len(), MAX_STATIONS)?;
        for station in &system.stations {
            self.within_limits(&station.world)?;
        }
        Ok(system)
    }

    /// The same, where it has no links.
    fn world(&self) -> Result<System, Failure> {
        let system = self.system()?;
        if system.world().is_none() {
            let name = &self.source.name;
            let message =
                format!("{name}: is a network; of it there are fields of hapt check, and columns of a station");
            return Err(Failure::input(message));
        }
        Ok(system)
    }

    fn most(&self, what: &str, is: f64, most: f64) -> Result<(), Failure> {
        if is <= most {
            return Ok(());
        }
        let name = &self.source.name;
        Err(Failure::input(format!("{name}: {what}: {is:.0} are more than the {most:.0} that hapt-grade takes")))
    }

    #[allow(clippy::cast_precision_loss)] // Counts of a file of 1 MiB.
    fn most_of(&self, what: &str, is: usize, most: usize) -> Result<(), Failure> {
        self.most(what, is as f64, most as f64)
    }

    fn within_limits(&self, world: &World) -> Result<(), Failure> {
        let sampling = &world.sampling;
        self.most_of("bodies", world.bodies.len(), MAX_BODIES)?;
        self.most_of("couplings", world.couplings.len(), MAX_COUPLINGS)?;
        self.most("samples of delay", sampling.delay_max_s() / sampling.period, MAX_PERIODS)?;
        self.most("periods of interval_max", sampling.interval_max_s() / sampling.period, MAX_PERIODS)?;
        for scenario in &world.scenarios {
            let samples = scenario.duration / sampling.period;
            self.most(&format!("samples of the scenario {}", scenario.name), samples, MAX_SAMPLES)?;
        }
        Ok(())
    }

    /// The value that `of` names, in SI; null where it does not exist.
    pub fn value(&self, of: &Of) -> Result<Value, Failure> {
        let number = |value: Option<f64>| value.map_or(Value::Null, Value::from);
        match of {
            Of::Value(value) => Ok(value.clone()),
            Of::Key(key) => Ok(number(self.world()?.number(key))),
            Of::Measure(name) => self.measure(name).map(number),
            Of::Check(pointer) => self.check(pointer),
            Of::Column { name, take, station } => {
                self.column(&self.system()?, station.as_deref(), name, *take).map(Value::from)
            }
            Of::Design { travel, torque, frequency, period, gives } => {
                let read = |text: &str, dimension| parse_quantity(text, dimension).map_err(Failure::input);
                let design = Design::new(
                    read(travel, Dimension::ANGLE)?,
                    read(torque, Dimension::TORQUE)?,
                    read(frequency, Dimension::FREQUENCY)?,
                    read(period, Dimension::TIME)?,
                )?;
                field(&design, &format!("/{gives}"))
            }
        }
    }

    fn measure(&self, name: &str) -> Result<Option<f64>, Failure> {
        let system = self.world()?;
        let known = Measure::ALL.into_iter().find(|measure| measure.name() == name);
        let measure = known.ok_or_else(|| {
            let names = Measure::ALL.map(Measure::name).join(", ");
            Failure::input(format!("no measure {name:?}; the measures are {names}"))
        })?;
        if !measure.of_a_run() {
            return in_time(|| measure.of_the_loop(&system));
        }
        // A sweep of one cell, over the period at its own value.
        let period = system.stations[0].world.sampling.period;
        let own = format!("loop.period={period}..{period}:1");
        let sweep = Sweep::new(self.source, &self.sets, &[own], &[measure], self.scenario)?;
        let begun = Instant::now();
        let rows = sweep.rows_until(0..1, &|| begun.elapsed() > TIME_LIMIT);
        let rows = rows.ok_or_else(too_long)?;
        Ok(rows.iter().next().and_then(|row| row.last().copied().flatten()))
    }

    fn check(&self, pointer: &str) -> Result<Value, Failure> {
        let system = self.system()?;
        let wanted = pointer.contains("/remedies");
        field(&in_time(|| hapt_analysis::check_system(&system, wanted))??, pointer)
    }

    /// A column of a run; of a network, that of a station.
    fn column(&self, system: &System, station: Option<&str>, name: &str, take: Take) -> Result<f64, Failure> {
        let names: Vec<&str> = system.stations.iter().map(|station| station.name.as_str()).collect();
        let named = || names.iter().position(|known| Some(*known) == station);
        let at = if system.world().is_some() { Some(0) } else { named() }.ok_or_else(|| {
            Failure::input(format!("the question needs the `station` of its column; there is {}", names.join(", ")))
        })?;
        let all = system.scenarios();
        let scenario = match (self.scenario, all.as_slice()) {
            (Some(name), _) if all.contains(&name) => name,
            (None, [scenario]) => scenario,
            (_, _) => {
                let (kind, list) = (system.kind(), all.join(", "));
                return Err(Failure::input(format!("the question needs a `scenario` of the {kind}: {list}")));
            }
        };
        let names: Vec<String> = station_columns(system, at).into_iter().map(|column| column.name).collect();
        let column = place(&names, name)?;
        let system = hapt_analysis::played(system, scenario)?;
        let mut run = Run::new(&system, scenario)?;
        let begun = Instant::now();
        let (mut series, mut values) = (Vec::new(), Vec::new());
        while let Some(row) = run.next() {
            let row = row?;
            if row.station == at {
                row.numbers(&mut values);
                series.extend(values.get(column));
            }
            if begun.elapsed() > TIME_LIMIT {
                return Err(too_long());
            }
        }
        Ok(take.of(&series))
    }
}

/// The place of a column among these.
fn place(names: &[String], name: &str) -> Result<usize, Failure> {
    let at = names.iter().position(|known| known == name);
    at.ok_or_else(|| Failure::input(format!("no column {name:?}; the columns are {}", names.join(", "))))
}

impl Take {
    fn of(self, series: &[f64]) -> f64 {
        #[allow(clippy::cast_precision_loss)] // At most a million samples.
        let mean = |sum: f64| sum / series.len().max(1) as f64;
        match self {
            Take::First => series.first().copied().unwrap_or_default(),
            Take::Last => series.last().copied().unwrap_or_default(),
            Take::Least => series.iter().copied().fold(f64::INFINITY, f64::min),
            Take::Largest => series.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            Take::Peak => series.iter().fold(0.0, |most, x| x.abs().max(most)),
            Take::Mean => mean(series.iter().sum()),
            Take::Rms => mean(series.iter().map(|x| x * x).sum()).sqrt(),
        }
    }
}

fn field(of: &impl serde::Serialize, pointer: &str) -> Result<Value, Failure> {
    let tree = serde_json::to_value(of).map_err(|error| Failure::System(error.to_string()))?;
    let found = tree.pointer(pointer).cloned();
    found.ok_or_else(|| Failure::input(format!("no field {pointer:?}, such as /passivity/required_damping")))
}

fn too_long() -> Failure {
    let seconds = TIME_LIMIT.as_secs();
    Failure::input(format!("a value takes longer than the {seconds} s that hapt-grade gives it; take a smaller world"))
}

/// The result of an analysis, which is ended at its time limit.
fn in_time<T>(work: impl FnOnce() -> T) -> Result<T, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let (done, ends) = channel::<()>();
    let clock = thread::spawn({
        let stop = Arc::clone(&stop);
        move || {
            let begun = Instant::now();
            while ends.recv_timeout(Duration::from_millis(50)) == Err(RecvTimeoutError::Timeout) {
                if begun.elapsed() > TIME_LIMIT {
                    stop.store(true, Ordering::Relaxed);
                }
            }
        }
    });
    let result = hapt_analysis::until(&stop, work);
    drop(done);
    let _ = clock.join();
    result.ok_or_else(too_long)
}
