//! Writing a log.

use std::collections::BTreeMap;
use std::io::{self, Write};

use hapt_core::SafetyProfile;
use hapt_model::World;
use hapt_rt::{Change, Record, Snapshot};
use hapt_sim::Row;

use crate::Sample;
use crate::descriptor::{MESSAGE, descriptor};
use crate::mcap_writer::McapWriter;
use crate::schema::{Column, Kind, columns, record_values, row_values};
use crate::{state, wire};

/// The one topic of a log.
pub const TOPIC: &str = "/hapt/sample";

/// Bytes of samples per chunk.
const CHUNK: usize = 256 << 10;

/// The header of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// The world file as it was read.
    pub world_text: String,
    /// Its overrides, each as `KEY=VALUE`.
    pub overrides: Vec<String>,
    /// The certificate in the format of `hapt check --json`, where there is one.
    pub certificate_json: Option<String>,
    /// The device as on the command line: `sim`.
    pub device: String,
    /// The profile of the supervisor.
    pub profile: SafetyProfile,
    /// The scenario, where one ran.
    pub scenario: Option<String>,
    /// The version of hapt whose core computed the samples.
    pub version: String,
    /// The number of its first plan, as in records.
    pub plan: u32,
    /// Whether the loop was at the ends of links, whose torque is in its records.
    pub linked: bool,
}

impl Default for Header {
    fn default() -> Self {
        Header {
            world_text: String::new(),
            overrides: Vec::new(),
            certificate_json: None,
            device: String::new(),
            profile: SafetyProfile::Simulated,
            scenario: None,
            version: env!("CARGO_PKG_VERSION").into(),
            plan: 0,
            linked: false,
        }
    }
}

/// The value of `change` in the metadata of a channel whose world the puck entered; a world that followed has none.
pub(crate) const ENTERS: &str = "enters";

/// The origin of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A run of the simulation: times count from its start.
    Run,
    /// A loop in real time: the time of its first sample in ns since 1970.
    Live(u64),
}

/// Writes a log. Each chunk reaches `out` in one write: everything up to the last flush stays readable.
pub struct LogWriter<W: Write> {
    mcap: McapWriter<W>,
    origin: Origin,
    channel: u16,
    kinds: Vec<Kind>,
    bodies: usize,
    linked: bool,
    plan: u32,
    period: f64,
    /// The sample and time from which the times of the present plan count.
    since: (u64, f64),
    /// The time of the first record.
    first: Option<f64>,
    sequence: u32,
    /// Bytes since the last flush.
    pending: usize,
    message: Vec<u8>,
    values: Vec<f64>,
    row: Row,
}

impl<W: Write> LogWriter<W> {
    /// Writes the header; samples of `world` follow.
    ///
    /// # Errors
    /// Those of `out`, here and below.
    pub fn new(out: W, world: &World, header: &Header, origin: Origin) -> io::Result<Self> {
        let mut mcap = McapWriter::new(out, &format!("hapt {}", env!("CARGO_PKG_VERSION")))?;
        let time = match origin {
            Origin::Run => 0,
            Origin::Live(epoch) => epoch,
        };
        mcap.attach(time, "world.toml", "application/toml", header.world_text.as_bytes())?;
        if let Some(json) = &header.certificate_json {
            mcap.attach(time, "certificate.json", "application/json", json.as_bytes())?;
        }
        let live = origin != Origin::Run;
        let mut values = BTreeMap::from([
            ("version".to_string(), header.version.clone()),
            ("device".to_string(), header.device.clone()),
            ("guarding".to_string(), header.profile.name().to_string()),
            ("motion".to_string(), world.motion.name().to_string()),
        ]);
        values.extend(header.scenario.as_ref().map(|name| ("scenario".to_string(), name.clone())));
        values.extend(header.overrides.iter().enumerate().map(|(i, set)| (format!("override.{i}"), set.clone())));
        values.extend(
            columns(world, live, header.linked)
                .into_iter()
                .map(|column| (format!("unit.{}", column.name), column.unit.to_string())),
        );
        mcap.metadata("hapt", &values)?;
        let mut writer = LogWriter {
            mcap,
            origin,
            channel: 0,
            kinds: Vec::new(),
            bodies: 0,
            linked: header.linked,
            plan: header.plan,
            period: 0.0,
            since: (0, 0.0),
            first: None,
            sequence: 0,
            pending: 0,
            message: Vec::new(),
            values: Vec::new(),
            row: Row::default(),
        };
        writer.begin(header.plan, world, Change::Follows)?;
        Ok(writer)
    }

    /// Starts the samples of another world, which replaces the last in this way: a new channel, on the same topic.
    pub fn begin(&mut self, plan: u32, world: &World, change: Change) -> io::Result<()> {
        let live = self.origin != Origin::Run;
        let columns = columns(world, live, self.linked);
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        // The world of the loop in SI, without files and overrides.
        let text = World { scenarios: Vec::new(), ..world.clone() }.to_toml();
        let mut metadata = BTreeMap::from([
            ("plan".to_string(), plan.to_string()),
            ("origin".to_string(), if live { "live" } else { "run" }.to_string()),
            ("columns".to_string(), names.join(",")),
            ("world".to_string(), text),
        ]);
        if change == Change::Enters {
            metadata.insert("change".to_string(), ENTERS.to_string());
        }
        let schema = self.mcap.schema(MESSAGE, "protobuf", &descriptor(&columns))?;
        self.channel = self.mcap.channel(schema, TOPIC, "protobuf", &metadata)?;
        self.kinds = columns.iter().map(|column: &Column| column.kind).collect();
        (self.bodies, self.plan, self.period) = (world.bodies.len(), plan, world.sampling.period);
        Ok(())
    }

    /// Writes a row of a run.
    pub fn write_row(&mut self, row: &Row) -> io::Result<()> {
        let mut values = std::mem::take(&mut self.values);
        row_values(row, &mut values);
        let written = self.write((row.time * 1e9).round() as u64, &values);
        self.values = values;
        written
    }

    /// Writes a record of the loop, of the last started plan; before it `snapshot`, if there is one of this sample.
    pub fn write_record(&mut self, record: &Record, snapshot: Option<&Snapshot>) -> io::Result<()> {
        let Origin::Live(epoch) = self.origin else {
            return Err(io::Error::other("a record of the loop in the log of a run"));
        };
        let (sample, time) = self.since;
        let time = time + record.sample.saturating_sub(sample) as f64 * self.period;
        let (mut row, mut values) = (std::mem::take(&mut self.row), std::mem::take(&mut self.values));
        record_values(record, time, self.bodies, self.linked, &mut row, &mut values);
        let elapsed = time - *self.first.get_or_insert(time);
        let log_time = epoch.saturating_add((elapsed * 1e9).round() as u64);
        let snapshot_written = snapshot.map_or(Ok(()), |snapshot| self.write_snapshot(log_time, snapshot));
        let written = snapshot_written.and_then(|()| self.write(log_time, &values));
        (self.row, self.values) = (row, values);
        written
    }

    /// Writes the loop's state before the next sample, which is taken at `log_time`.
    pub fn write_snapshot(&mut self, log_time: u64, snapshot: &Snapshot) -> io::Result<()> {
        let data = state::write(snapshot).map_err(io::Error::other)?;
        let name = format!("{}{}", state::NAME, snapshot.sample);
        // Earlier samples are flushed with it.
        self.flush()?;
        self.mcap.attach(log_time, &name, "application/octet-stream", &data)
    }

    /// The plan whose samples are written.
    pub fn plan(&self) -> u32 {
        self.plan
    }

    /// As [`LogWriter::begin`], from the sample `sample` on: times continue from there, with the new period.
    pub fn begin_at(&mut self, sample: u64, plan: u32, world: &World, change: Change) -> io::Result<()> {
        let (from, time) = self.since;
        self.since = (sample, time + sample.saturating_sub(from) as f64 * self.period);
        self.begin(plan, world, change)
    }

    /// Copies a sample of another log, with its world where it differs, and with the snapshot before it.
    pub fn write_sample(&mut self, sample: &Sample) -> io::Result<()> {
        if self.plan != sample.plan.number {
            self.begin(sample.plan.number, &sample.plan.world, sample.plan.change)?;
        }
        if let Some(snapshot) = sample.snapshot {
            self.write_snapshot(sample.log_time, snapshot)?;
        }
        self.write(sample.log_time, sample.values)
    }

    /// Writes the values of all columns.
    pub fn write(&mut self, log_time: u64, values: &[f64]) -> io::Result<()> {
        self.message.clear();
        for ((value, kind), field) in values.iter().zip(&self.kinds).zip(1..) {
            match kind {
                Kind::Number => wire::number(&mut self.message, field, *value),
                Kind::Count | Kind::Choice(_) => wire::count(&mut self.message, field, *value as u64),
            }
        }
        self.mcap.message(self.channel, self.sequence, log_time, &self.message);
        self.sequence = self.sequence.wrapping_add(1);
        self.pending += self.message.len() + 31;
        if self.pending >= CHUNK { self.flush() } else { Ok(()) }
    }

    /// Ends the chunk and writes it.
    pub fn flush(&mut self) -> io::Result<()> {
        self.pending = 0;
        self.mcap.flush()
    }

    /// Bytes of samples since the last flush.
    pub fn pending(&self) -> usize {
        self.pending
    }

    /// Writes the index and returns the output.
    pub fn finish(self) -> io::Result<W> {
        self.mcap.finish()
    }
}
