//! The recorder: a thread below the loop that writes down what the loop did.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use hapt_model::World;
use hapt_rt::{Engine, Record, Snapshot};

use crate::Error;
use crate::complete::Complete;
use crate::writer::{Header, LogWriter, Origin};

/// Records that may wait for the disk: 16 s of a loop at 1 kHz, some 12 MB.
const WAITING: usize = 1 << 14;
/// What is not written by then is, however little it is.
const PATIENCE: Duration = Duration::from_secs(1);
/// So many samples in a row without a loss, and a gap is over.
const CALM: u32 = 256;

/// Writes the log of a running loop, on a thread of its own. Sending a record never waits: a record without room in the queue is lost, and
/// counted.
///
/// ```no_run
/// use hapt_log::{Header, Recorder};
/// use hapt_model::{Source, World};
///
/// let source = Source::open("wheel.toml")?;
/// let world = World::read(&source, &[])?;
/// let header = Header { world_text: source.text.clone(), device: "sim".into(), ..Header::default() };
/// let recorder = Recorder::start("run.mcap", &world, header)?;
/// // Each record of the loop: recorder.send(&record);
/// let summary = recorder.finish()?;
/// println!("{} samples, {} lost", summary.written, summary.lost);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Recorder {
    path: PathBuf,
    queue: Option<SyncSender<Entry>>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    /// The sample after the last that was sent.
    next: Cell<Option<u64>>,
    /// Samples sent since the last gap, where no snapshot has come behind it; else `None`.
    since_gap: Cell<Option<u32>>,
}

/// What waits to be written.
#[allow(clippy::large_enum_variant)] // Nearly all are records: a box for each would be an allocation a sample.
enum Entry {
    Record(Record),
    /// Before the record of its sample.
    Snapshot(Box<Snapshot>),
}

/// How a recorder is doing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecorderState {
    /// Samples that the system has taken: whatever happens to this process, they stay.
    pub written: u64,
    /// Samples that are in no file.
    pub lost: u64,
    /// Why nothing is written any more.
    pub error: Option<String>,
}

/// A log that has been finished.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Summary {
    /// The file.
    pub path: PathBuf,
    /// Its samples.
    pub written: u64,
    /// Those that are not in it.
    pub lost: u64,
}

#[derive(Default)]
struct Shared {
    written: AtomicU64,
    lost: AtomicU64,
    error: Mutex<Option<String>>,
    /// Worlds whose samples are to come.
    plans: Mutex<BTreeMap<u32, World>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Recorder {
    /// Starts a log of `world`, the plan of number [`Header::plan`], in a new file at `path`.
    ///
    /// # Errors
    /// [`Error::Write`] for a file that cannot be made or takes nothing.
    pub fn start(path: impl AsRef<Path>, world: &World, header: Header) -> Result<Self, Error> {
        let path = path.as_ref();
        let failed = |error: io::Error| Error::Write { path: path.display().to_string(), error: error.to_string() };
        Recorder::start_in(File::create(path).map_err(failed)?, path, world, header)
    }

    /// The same in a file that is open, and empty; `path` is what it is called. At every moment between two writes it ends as an MCAP file
    /// does, so that any reader reads it, whatever becomes of this process.
    ///
    /// # Errors
    /// [`Error::Write`] for a file that takes nothing.
    pub fn start_in(file: File, path: impl AsRef<Path>, world: &World, header: Header) -> Result<Self, Error> {
        // Only what is on a disk can be gone back in.
        if file.metadata().is_ok_and(|there| there.is_file()) {
            Recorder::start_on(Complete::new(file), path, world, header)
        } else {
            Recorder::start_on(BufWriter::with_capacity(1 << 16, file), path, world, header)
        }
    }

    /// The same on anything that takes bytes; `path` is what it is called.
    pub fn start_on<W: Write + Send + 'static>(
        out: W,
        path: impl AsRef<Path>,
        world: &World,
        header: Header,
    ) -> Result<Self, Error> {
        let path = path.as_ref().to_path_buf();
        let failed = |error: io::Error| Error::Write { path: path.display().to_string(), error: error.to_string() };
        let epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64;
        let (queue, records) = sync_channel(WAITING);
        let shared = Arc::new(Shared::default());
        let mut writer = LogWriter::new(out, world, &header, Origin::Live(epoch)).map_err(failed)?;
        // What cannot be written at all is known before the first sample.
        writer.flush().map_err(failed)?;
        let (to, name) = (Arc::clone(&shared), path.display().to_string());
        let thread = std::thread::Builder::new().name("recorder".into()).spawn(move || {
            stand_back();
            if let Err(error) = write(writer, &records, &to) {
                *lock(&to.error) = Some(format!("cannot write {name}: {error}"));
                // Nobody waits for room that nothing will make.
                while let Ok(entry) = records.recv() {
                    to.lost.fetch_add(u64::from(matches!(entry, Entry::Record(_))), Ordering::Relaxed);
                }
            }
        });
        let thread = Some(thread.map_err(failed)?);
        let (next, since_gap) = (Cell::new(None), Cell::new(None));
        Ok(Recorder { queue: Some(queue), shared, thread, path, next, since_gap })
    }

    /// Says whose samples those of plan `number` are; before the first of them is sent.
    pub fn plan(&self, number: u32, world: &World) {
        lock(&self.shared.plans).insert(number, world.clone());
    }

    /// Takes a record; false where there is no room, or no file any more. Never waits for the disk.
    pub fn send(&self, record: &Record) -> bool {
        let sent = self.push(Entry::Record(*record));
        if !sent {
            self.shared.lost.fetch_add(1, Ordering::Relaxed);
        }
        let follows =
            self.next.get().is_none_or(|next| (next..=next + u64::from(record.missed)).contains(&record.sample));
        self.next.set(Some(record.sample + 1));
        self.since_gap.set(match self.since_gap.get() {
            since if sent && follows => since.map(|since| since.saturating_add(1)),
            _ => Some(0),
        });
        sent && lock(&self.shared.error).is_none()
    }

    /// Takes a snapshot, before the record of its sample is sent: a replay can begin there. Never waits for the disk.
    pub fn send_snapshot(&self, snapshot: Box<Snapshot>) -> bool {
        let sent = self.push(Entry::Snapshot(snapshot));
        if sent {
            self.since_gap.set(None);
        }
        sent
    }

    /// Takes a record that has just left `engine`, and the snapshots that have. Behind a gap it orders one, once samples come through
    /// again: a replay goes on from there.
    pub fn follow(&self, engine: &mut Engine, record: &Record) {
        while let Ok(snapshot) = engine.snapshots.pop() {
            self.send_snapshot(snapshot);
        }
        self.send(record);
        if self.since_gap.get().is_some_and(|since| since >= CALM) && engine.snapshot() {
            self.since_gap.set(Some(0));
        }
    }

    fn push(&self, entry: Entry) -> bool {
        self.queue.as_ref().is_some_and(|queue| queue.try_send(entry).is_ok())
    }

    /// How it is doing.
    pub fn state(&self) -> RecorderState {
        RecorderState {
            written: self.shared.written.load(Ordering::Relaxed),
            lost: self.shared.lost.load(Ordering::Relaxed),
            error: lock(&self.shared.error).clone(),
        }
    }

    /// Writes what waits, and the end of the log.
    ///
    /// # Errors
    /// [`Error::Write`]: what was written before stays, and can be read.
    pub fn finish(mut self) -> Result<Summary, Error> {
        self.join();
        let RecorderState { written, lost, error } = self.state();
        match error {
            None => Ok(Summary { path: self.path.clone(), written, lost }),
            Some(error) => {
                let path = self.path.display().to_string();
                let error = error.trim_start_matches(&format!("cannot write {path}: ")).to_string();
                Err(Error::Write { path, error })
            }
        }
    }

    fn join(&mut self) {
        drop(self.queue.take());
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            lock(&self.shared.error).get_or_insert_with(|| "the recorder has ended early".into());
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.join();
    }
}

/// Writes what comes, until nobody sends any more.
fn write<W: Write>(mut writer: LogWriter<W>, entries: &Receiver<Entry>, shared: &Shared) -> io::Result<()> {
    let mut waiting = 0;
    // By their samples, whose records are still to come.
    let mut snapshots = BTreeMap::new();
    let mut due = Instant::now() + PATIENCE;
    let end = loop {
        let next = match entries.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok(Entry::Snapshot(snapshot)) => {
                snapshots.insert(snapshot.sample, snapshot);
                continue;
            }
            Ok(Entry::Record(record)) => Ok(record),
            Err(error) => Err(error),
        };
        // Those of a plan before are still on their way when a log begins just after a change.
        if let Ok(record) = &next
            && record.plan >= writer.plan()
        {
            if record.plan != writer.plan() {
                let world = lock(&shared.plans).remove(&record.plan);
                let world = world.ok_or_else(|| {
                    io::Error::other(format!("the samples of plan {} came before its world", record.plan))
                });
                let begun = world.and_then(|world| writer.begin_at(record.sample, record.plan, &world));
                if let Err(error) = begun {
                    break Err(error);
                }
            }
            waiting += 1;
            // Those of samples before it were lost with them.
            snapshots.retain(|sample, _| *sample >= record.sample);
            let snapshot = snapshots.remove(&record.sample);
            if let Err(error) = writer.write_record(record, snapshot.as_deref()) {
                break Err(error);
            }
        }
        let ended = matches!(next, Err(RecvTimeoutError::Disconnected));
        // The writer flushes by itself when a chunk is full.
        if Instant::now() >= due || ended {
            if let Err(error) = writer.flush() {
                break Err(error);
            }
            due = Instant::now() + PATIENCE;
        }
        if writer.pending() == 0 {
            shared.written.fetch_add(waiting, Ordering::Relaxed);
            waiting = 0;
        }
        if ended {
            break writer.finish().map(drop);
        }
    };
    shared.lost.fetch_add(waiting, Ordering::Relaxed);
    end
}

/// The recorder runs when nobody else wants to.
fn stand_back() {
    #[cfg(target_os = "linux")]
    {
        // Whoever may not step back stays where everybody is.
        let _ = rustix::process::setpriority_process(Some(rustix::thread::gettid()), 10);
    }
}
