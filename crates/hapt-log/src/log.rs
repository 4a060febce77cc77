//! Reading a log.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::Arc;

use hapt_core::SafetyProfile;
use hapt_core::{Reading, Request};
use hapt_model::{Source, World};
use hapt_rt::{Change, Snapshot};
use hapt_sim::{Row, SIGNALS};

use crate::Error;
use crate::container::{Channel, Container, Ending, Item, MAGIC, Message};
use crate::schema::{Column, LIVE_COLUMNS, columns, link_column, request};
use crate::state;
use crate::wire::{self, Value};
use crate::writer::{ENTERS, Header, Origin, TOPIC};

/// A reader of a log: its header, and then its samples in order.
///
/// ```no_run
/// let mut log = hapt_log::Log::open("run.mcap")?;
/// println!("recorded on {}", log.header.device);
/// while let Some(sample) = log.next()? {
///     // One value for each of the plan's columns.
///     println!("{} {:?}", sample.log_time, sample.values);
/// }
/// # Ok::<(), hapt_log::Error>(())
/// ```
pub struct Log<R> {
    /// The world, the device and the scenario of the samples.
    pub header: Header,
    /// Whether the samples come from a simulation or from a loop in real time.
    pub origin: Origin,
    container: Container<R>,
    /// The plans by their channel's number.
    plans: BTreeMap<u16, Arc<LoggedPlan>>,
    plan: Arc<LoggedPlan>,
    /// The first message, read with the header.
    first: Option<Message>,
    values: Vec<f64>,
    /// The last snapshot before a sample.
    snapshot: Option<Snapshot>,
    done: Option<Ending>,
}

/// A world with samples in a log.
#[derive(Clone, Debug, PartialEq)]
pub struct LoggedPlan {
    /// Its number, as in records.
    pub number: u32,
    /// Whether the samples are those of a loop in real time.
    pub live: bool,
    /// Whether its loop was at the ends of links: their torque is the last column.
    pub linked: bool,
    /// The world, without its scenarios.
    pub world: World,
    /// How it replaced the previous world.
    pub change: Change,
    /// The columns of its samples.
    pub columns: Vec<Column>,
    /// The column of each field, from field 1 on; `None` for an unknown column.
    places: Vec<Option<usize>>,
}

/// One sample.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// The plan that made it.
    pub plan: &'a Arc<LoggedPlan>,
    /// In ns: since 1970 for a loop in real time, since the start for a run.
    pub log_time: u64,
    /// The values of all columns.
    pub values: &'a [f64],
    /// The loop's state before it, where the log contains one.
    pub snapshot: Option<&'a Snapshot>,
}

/// The inputs of the loop at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs {
    /// k.
    pub sample: u64,
    /// The number of its plan.
    pub plan: u32,
    /// The reading of the device and the clock.
    pub reading: Reading<f64>,
    /// The request of a user, if any.
    pub request: Option<Request>,
    /// The code of the supervisor's phase after the sample.
    pub phase: u64,
    /// The code of its reason, 0 for none.
    pub reason: u64,
    /// The torque command to the motor, after the supervisor.
    pub output: f64,
    /// From the sample to the completed write of that command to the device, in s.
    pub computation: f64,
    /// The torque of the links; `None` without them.
    pub link: Option<f64>,
}

impl Log<BufReader<File>> {
    /// Opens a log and reads its header.
    ///
    /// # Errors
    /// [`Error::Unreadable`], [`Error::Foreign`] for a file that is not a log of hapt or was cut before its first sample, [`Error::World`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        Log::read(BufReader::with_capacity(1 << 16, File::open(path)?))
    }
}

impl<R: Read> Log<R> {
    /// Reads a log from any reader.
    pub fn read(from: R) -> Result<Self, Error> {
        let foreign = |words: String| Err(Error::Foreign(words));
        let Some(mut container) = Container::new(from)? else {
            return foreign("it is not a log: it does not begin as an MCAP file does".into());
        };
        let (mut header, mut metadata) = (Header { version: String::new(), ..Header::default() }, None);
        let (mut plans, mut topics, mut snapshot) = (BTreeMap::new(), Vec::new(), None);
        while let Some(item) = container.next()? {
            match item {
                Item::Metadata { name, values } if name == "hapt" => metadata = Some(values),
                Item::Attachment { name, data } if name.starts_with(state::NAME) => snapshot = state::read(&data),
                Item::Attachment { name, data } => {
                    let text = String::from_utf8_lossy(&data).into_owned();
                    match name.as_str() {
                        "world.toml" => header.world_text = text,
                        "certificate.json" => header.certificate_json = Some(text),
                        _ => {}
                    }
                }
                Item::Channel(channel) => {
                    if topics.len() <= 5 {
                        topics.push(channel.topic.clone());
                    }
                    if let Some(plan) = LoggedPlan::new(&channel)? {
                        plans.insert(channel.id, Arc::new(plan));
                    }
                }
                Item::Message(message) => {
                    let Some(plan) = plans.get(&message.channel).cloned() else { continue };
                    // A program that rewrites a log may put the metadata after the samples: they are then unknown.
                    header.fill(&metadata.unwrap_or_default(), &plan);
                    let origin = if plan.live { Origin::Live(message.log_time) } else { Origin::Run };
                    let (first, values) = (Some(message), Vec::new());
                    return Ok(Log { header, origin, container, plans, plan, first, values, snapshot, done: None });
                }
                Item::Metadata { .. } => {}
            }
        }
        let ending = container.ending().cloned().unwrap_or(Ending::Whole);
        if ending == Ending::Whole && metadata.is_some() {
            foreign("it holds no sample".into())
        } else if metadata.is_some() || (topics.is_empty() && ending != Ending::Whole) {
            foreign(format!("it holds no sample: {ending}"))
        } else if topics.is_empty() {
            foreign("it is an MCAP file, but not a log of hapt: it has no topic".into())
        } else {
            topics.truncate(5);
            let topics: Vec<String> = topics.iter().map(|topic| topic.chars().take(40).collect()).collect();
            foreign(format!("it is an MCAP file, but not a log of hapt: its topics are {topics:?}, expected {TOPIC:?}"))
        }
    }

    /// The plan of the next sample, or of the last.
    pub fn plan(&self) -> &Arc<LoggedPlan> {
        &self.plan
    }

    /// Whether the samples are those of a loop in real time.
    pub fn is_live(&self) -> bool {
        self.origin != Origin::Run
    }

    /// The end of the log, once [`Log::next`] has returned `None`.
    pub fn ending(&self) -> &Ending {
        self.done.as_ref().unwrap_or(&Ending::Whole)
    }

    /// The next sample; `None` at the end of the readable part. The plan follows the samples.
    ///
    /// # Errors
    /// [`Error::Unreadable`] and, for another world, [`Error::World`].
    #[allow(clippy::should_implement_trait)] // The sample is borrowed.
    pub fn next(&mut self) -> Result<Option<Sample<'_>>, Error> {
        let message = match self.first.take() {
            Some(message) => message,
            None => loop {
                if self.done.is_some() {
                    return Ok(None);
                }
                match self.container.next()? {
                    None => self.done = self.container.ending().cloned(),
                    Some(Item::Channel(channel)) => {
                        if let Some(plan) = LoggedPlan::new(&channel)? {
                            self.plans.insert(channel.id, Arc::new(plan));
                        }
                    }
                    Some(Item::Attachment { name, data }) if name.starts_with(state::NAME) => {
                        self.snapshot = state::read(&data);
                    }
                    Some(Item::Message(message)) if self.plans.contains_key(&message.channel) => break message,
                    Some(_) => {}
                }
            },
        };
        if let Some(plan) = self.plans.get(&message.channel) {
            self.plan = Arc::clone(plan);
        }
        let Some(()) = self.plan.decode(self.container.data(&message), &mut self.values) else {
            self.container.damaged("a sample does not match its channel's schema");
            self.done = self.container.ending().cloned();
            return Ok(None);
        };
        let sample = Sample { plan: &self.plan, log_time: message.log_time, values: &self.values, snapshot: None };
        let is_its = |snapshot: &&Snapshot| sample.inputs().is_some_and(|inputs| inputs.is_after(snapshot));
        Ok(Some(Sample { snapshot: self.snapshot.as_ref().filter(is_its), ..sample }))
    }
}

impl Header {
    fn fill(&mut self, values: &BTreeMap<String, String>, plan: &LoggedPlan) {
        let text = |key: &str| values.get(key).cloned();
        self.version = text("version").unwrap_or_default();
        self.device = text("device").unwrap_or_default();
        let profile = text("guarding");
        let named = SafetyProfile::ALL.into_iter().find(|one| profile.as_deref() == Some(one.name()));
        self.profile = named.unwrap_or(SafetyProfile::Simulated);
        self.scenario = text("scenario");
        self.overrides = (0..).map_while(|i: u32| text(&format!("override.{i}"))).collect();
        (self.plan, self.linked) = (plan.number, plan.linked);
    }
}

impl LoggedPlan {
    /// The index among a sample's values of the first column that only a loop in real time has.
    pub(crate) fn live_columns(&self) -> usize {
        self.columns.len().saturating_sub(LIVE_COLUMNS + usize::from(self.linked))
    }

    /// The plan of a channel; `None` for one of another program.
    fn new(channel: &Channel) -> Result<Option<Self>, Error> {
        if channel.topic != TOPIC || channel.encoding != "protobuf" {
            return Ok(None);
        }
        let text = |key: &str| {
            channel
                .metadata
                .get(key)
                .ok_or_else(|| Error::Foreign(format!("its channel {TOPIC} does not say its {key}")))
        };
        let live = text("origin")? == "live";
        let number = text("plan")?.parse().map_err(|_| Error::Foreign("its plan has no number".into()))?;
        let source = Source::from_text("the log's world", text("world")?.as_str());
        let world = World::read(&source, &[]).map_err(|error| Error::World(error.to_string()))?;
        let names: Vec<&str> = text("columns")?.split(',').collect();
        let linked = live && names.contains(&link_column(&world).name.as_str());
        let columns = columns(&world, live, linked);
        let place = |name: &&str| columns.iter().position(|column| column.name == *name);
        let places: Vec<Option<usize>> = names.iter().map(place).collect();
        let missing = |column: &&Column| !names.contains(&column.name.as_str());
        if let Some(column) = columns.iter().find(missing) {
            let name = &column.name;
            return Err(Error::Foreign(format!("it has no column {name}, which every log of such a world has")));
        }
        let enters = channel.metadata.get("change").is_some_and(|change| change == ENTERS);
        let change = if enters { Change::Enters } else { Change::Follows };
        Ok(Some(LoggedPlan { number, live, linked, world, change, columns, places }))
    }

    /// The values of a message, in the order of the columns.
    fn decode(&self, mut message: &[u8], values: &mut Vec<f64>) -> Option<()> {
        values.clear();
        values.resize(self.columns.len(), 0.0);
        while !message.is_empty() {
            let (field, value) = wire::take(&mut message)?;
            let index = usize::try_from(field.checked_sub(1)?).ok()?;
            let Some(Some(place)) = self.places.get(index).copied() else { continue };
            *values.get_mut(place)? = match value {
                Value::Double(x) => x,
                Value::Varint(x) => x as f64,
                Value::Other => return None,
            };
        }
        Some(())
    }
}

impl Sample<'_> {
    /// Writes the sample into a row of a run; fields that a log lacks stay unchanged.
    pub fn fill(&self, row: &mut Row) {
        let at = |place: usize| self.values.get(place).copied().unwrap_or(0.0);
        row.time = at(0);
        (row.puck, row.puck_velocity) = (at(1), at(2));
        (row.measured, row.measured_velocity) = (at(3), at(4));
        (row.torque, row.command, row.applied) = (at(5), at(6), at(7));
        let bodies = self.plan.world.bodies.len();
        row.bodies.clear();
        let pair = |i: usize| (at(SIGNALS.len() + 2 * i), at(SIGNALS.len() + 2 * i + 1));
        row.bodies.extend((0..bodies).map(pair));
        row.handle = (self.plan.world.device.handle.is_some() && !self.plan.live).then(|| pair(bodies));
    }

    /// The inputs of a loop in real time; `None` in the log of a run.
    pub fn inputs(&self) -> Option<Inputs> {
        let live = self.values.get(self.plan.live_columns()..)?.first_chunk::<LIVE_COLUMNS>();
        let live = live.filter(|_| self.plan.live)?;
        let [output, sample, plan, phase, reason, request_code, announced, late, missed, silent, _latency, computation] =
            *live;
        Some(Inputs {
            sample: sample as u64,
            plan: plan as u32,
            reading: Reading {
                position: *self.values.get(1)?,
                velocity: *self.values.get(2)?,
                announced: announced != 0.0,
                late,
                missed: missed as u32,
                silent,
            },
            request: request(request_code),
            phase: phase as u64,
            reason: reason as u64,
            output,
            computation,
            link: self.values.last().copied().filter(|_| self.plan.linked),
        })
    }
}

impl Inputs {
    /// Whether the snapshot was taken just before this sample.
    fn is_after(&self, snapshot: &Snapshot) -> bool {
        (self.sample, self.plan) == (snapshot.sample, snapshot.plan)
    }
}

/// Whether these are the first bytes of a log.
pub fn is_log(first: &[u8]) -> bool {
    first.starts_with(&MAGIC)
}
