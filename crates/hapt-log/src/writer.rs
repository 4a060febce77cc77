//! A log, written.

use std::collections::BTreeMap;
use std::io::{self, Write};

use hapt_core::SafetyProfile;
use hapt_model::World;
use hapt_rt::{Record, Snapshot};
use hapt_sim::Row;
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, McapError, WriteOptions};

use crate::Sample;
use crate::descriptor::{MESSAGE, descriptor};
use crate::schema::{Column, Kind, columns, record_values, row_values};
use crate::{state, wire};

/// The one topic of a log.
pub const TOPIC: &str = "/hapt/sample";

/// Bytes of samples at which a chunk is ended.
const CHUNK: usize = 256 << 10;

/// What goes with the samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// The world file as it was read.
    pub world_text: String,
    /// What was set over it, each as `KEY=VALUE`.
    pub overrides: Vec<String>,
    /// The certificate as `hapt check --json` prints it, where there is one.
    pub certificate_json: Option<String>,
    /// As on the command line: `sim`.
    pub device: String,
    /// How the supervisor guarded it.
    pub profile: SafetyProfile,
    /// The scenario that ran, where one did.
    pub scenario: Option<String>,
    /// hapt's, whose core made the numbers.
    pub version: String,
    /// The number of the world that it begins with, as records count them.
    pub plan: u32,
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
        }
    }
}

/// Where the samples come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A run of the simulation: times count from its start.
    Run,
    /// A loop in real time: its first sample here was taken so many nanoseconds after 1970 began.
    Live(u64),
}

/// Writes a log. Each chunk reaches `out` whole, and in one piece of time: what was flushed can be read, whatever comes.
pub struct LogWriter<W: Write> {
    mcap: mcap::Writer<NoSeek<W>>,
    origin: Origin,
    channel: u16,
    kinds: Vec<Kind>,
    bodies: usize,
    plan: u32,
    period: f64,
    /// A record's sample and its time, from which the others of its plan count.
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
    /// Writes what goes with the samples, to be followed by those of `world`.
    ///
    /// # Errors
    /// Those of `out`, here and below.
    pub fn new(out: W, world: &World, header: &Header, origin: Origin) -> io::Result<Self> {
        let options = WriteOptions::new()
            .compression(None)
            .chunk_size(None)
            // A chunk is held in memory and written when it is whole.
            .disable_seeking(true)
            .library(format!("hapt {}", env!("CARGO_PKG_VERSION")));
        let mut mcap = mcap::Writer::with_options(NoSeek::new(out), options).map_err(failed)?;
        let time = match origin {
            Origin::Run => 0,
            Origin::Live(epoch) => epoch,
        };
        let mut attach = |name: &str, kind: &str, text: &str| {
            let data = text.as_bytes().into();
            let (name, media_type) = (name.to_string(), kind.to_string());
            mcap.attach(&Attachment { log_time: time, create_time: time, name, media_type, data }).map_err(failed)
        };
        attach("world.toml", "application/toml", &header.world_text)?;
        if let Some(json) = &header.certificate_json {
            attach("certificate.json", "application/json", json)?;
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
            columns(world, live).into_iter().map(|column| (format!("unit.{}", column.name), column.unit.to_string())),
        );
        mcap.write_metadata(&Metadata { name: "hapt".into(), metadata: values }).map_err(failed)?;
        let mut writer = LogWriter {
            mcap,
            origin,
            channel: 0,
            kinds: Vec::new(),
            bodies: 0,
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
        writer.begin(header.plan, world)?;
        Ok(writer)
    }

    /// From here on the samples are those of another world: a channel of its own, on the same topic.
    pub fn begin(&mut self, plan: u32, world: &World) -> io::Result<()> {
        let live = self.origin != Origin::Run;
        let columns = columns(world, live);
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        // What the loop was compiled from, in SI: it needs no file and no override beside it.
        let text = World { scenarios: Vec::new(), ..world.clone() }.to_toml();
        let metadata = BTreeMap::from([
            ("plan".to_string(), plan.to_string()),
            ("origin".to_string(), if live { "live" } else { "run" }.to_string()),
            ("columns".to_string(), names.join(",")),
            ("world".to_string(), text),
        ]);
        let schema = self.mcap.add_schema(MESSAGE, "protobuf", &descriptor(&columns)).map_err(failed)?;
        self.channel = self.mcap.add_channel(schema, TOPIC, "protobuf", &metadata).map_err(failed)?;
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

    /// Writes a record of the loop, which is of the plan that was begun last; before it `snapshot`, where one was taken just then.
    pub fn write_record(&mut self, record: &Record, snapshot: Option<&Snapshot>) -> io::Result<()> {
        let Origin::Live(epoch) = self.origin else {
            return Err(io::Error::other("a record of the loop in the log of a run"));
        };
        let (sample, time) = self.since;
        let time = time + record.sample.saturating_sub(sample) as f64 * self.period;
        let (mut row, mut values) = (std::mem::take(&mut self.row), std::mem::take(&mut self.values));
        record_values(record, time, self.bodies, &mut row, &mut values);
        let elapsed = time - *self.first.get_or_insert(time);
        let log_time = epoch.saturating_add((elapsed * 1e9).round() as u64);
        let said = snapshot.map_or(Ok(()), |snapshot| self.write_snapshot(log_time, snapshot));
        let written = said.and_then(|()| self.write(log_time, &values));
        (self.row, self.values) = (row, values);
        written
    }

    /// Writes how the loop stood before the sample that is written next, which is taken at `log_time`.
    pub fn write_snapshot(&mut self, log_time: u64, snapshot: &Snapshot) -> io::Result<()> {
        let data = state::write(snapshot).map_err(io::Error::other)?.into();
        let (name, media_type) = (format!("{}{}", state::NAME, snapshot.sample), "application/octet-stream".into());
        // What stands before it in the file is handed on with it.
        self.flush()?;
        let attachment = Attachment { log_time, create_time: log_time, name, media_type, data };
        self.mcap.attach(&attachment).map_err(failed)
    }

    /// The plan whose samples are written.
    pub fn plan(&self) -> u32 {
        self.plan
    }

    /// The same as [`LogWriter::begin`], from the sample `sample` on: times go on from there, with the new period.
    pub fn begin_at(&mut self, sample: u64, plan: u32, world: &World) -> io::Result<()> {
        let (from, time) = self.since;
        self.since = (sample, time + sample.saturating_sub(from) as f64 * self.period);
        self.begin(plan, world)
    }

    /// Writes a sample of another log, with its world where that is another, and with the snapshot before it.
    pub fn write_sample(&mut self, sample: &Sample) -> io::Result<()> {
        if self.plan != sample.plan.number {
            self.begin(sample.plan.number, &sample.plan.world)?;
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
        let header =
            MessageHeader { channel_id: self.channel, sequence: self.sequence, log_time, publish_time: log_time };
        self.mcap.write_to_known_channel(&header, &self.message).map_err(failed)?;
        self.sequence = self.sequence.wrapping_add(1);
        self.pending += self.message.len() + 31;
        if self.pending >= CHUNK { self.flush() } else { Ok(()) }
    }

    /// Ends the chunk and hands it to the system.
    pub fn flush(&mut self) -> io::Result<()> {
        self.pending = 0;
        self.mcap.flush().map_err(failed)
    }

    /// Bytes of samples that no flush has handed on.
    pub fn pending(&self) -> usize {
        self.pending
    }

    /// Writes the index and gives the output back.
    pub fn finish(mut self) -> io::Result<W> {
        self.mcap.finish().map_err(failed)?;
        let mut out = self.mcap.into_inner().into_inner();
        out.flush()?;
        Ok(out)
    }
}

/// The system's own error where the cause is one.
fn failed(error: McapError) -> io::Error {
    if let McapError::Io(error) = error { error } else { io::Error::other(error) }
}
