//! The recorder: a thread of lower priority that writes the log of a loop.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use hapt_model::World;
use hapt_rt::{Change, Engine, Record, Snapshot};

use crate::Error;
use crate::complete::Complete;
use crate::writer::{Header, LogWriter, Origin};

/// The queue's capacity in records: 16 s of a loop at 1 kHz, about 12 MB.
const WAITING: usize = 1 << 14;
/// The longest time between flushes.
const FLUSH_INTERVAL: Duration = Duration::from_secs(1);
/// The number of consecutive samples without a loss that ends a gap.
const GAP_END_SAMPLES: u32 = 256;

/// Writes the log of a running loop, on its own thread. Sending a record never blocks: a record that finds the queue full is lost, and
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
    /// The sample after the last one sent.
    next: Cell<Option<u64>>,
    /// Samples sent since the last gap, while no snapshot has followed it; else `None`.
    since_gap: Cell<Option<u32>>,
}

/// An entry of the queue.
#[allow(clippy::large_enum_variant)] // Nearly all are records: a box for each would be an allocation per sample.
enum Entry {
    Record(Record),
    /// Before the record of its sample.
    Snapshot(Box<Snapshot>),
}

/// The state of a recorder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecorderState {
    /// Samples written to the system: they survive a crash of this process.
    pub written: u64,
    /// Lost samples.
    pub lost: u64,
    /// The error that ended the writing.
    pub error: Option<String>,
}

/// A finished log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Summary {
    /// The file.
    pub path: PathBuf,
    /// The number of its samples.
    pub written: u64,
    /// The number of lost samples.
    pub lost: u64,
}

#[derive(Default)]
struct Shared {
    written: AtomicU64,
    lost: AtomicU64,
    error: Mutex<Option<String>>,
    /// Worlds of later samples.
    plans: Mutex<BTreeMap<u32, (World, Change)>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Recorder {
    /// Starts a log of `world`, the plan of number [`Header::plan`], in a new file at `path`.
    ///
    /// # Errors
    /// [`Error::Write`] for a file that cannot be created or written.
    pub fn start(path: impl AsRef<Path>, world: &World, header: Header) -> Result<Self, Error> {
        let path = path.as_ref();
        let failed = |error: io::Error| Error::Write { path: path.display().to_string(), error: error.to_string() };
        // Truncated only after the lock is taken.
        let file = OpenOptions::new().write(true).create(true).truncate(false).open(path).map_err(failed)?;
        let name = path.to_path_buf();
        if file.metadata().is_ok_and(|there| there.is_file()) {
            hold(&file).and_then(|()| file.set_len(0)).map_err(failed)?;
        }
        Recorder::start_in(file, name, world, header)
    }

    /// Starts a log in an open, empty file of the name `path`, which it holds ([`is_recorded`]). Between any two writes it ends as a
    /// complete MCAP file, so that it stays readable after a crash of this process.
    ///
    /// # Errors
    /// [`Error::Write`] for a file that cannot be written, or is being written as a log already.
    pub fn start_in(file: File, path: impl AsRef<Path>, world: &World, header: Header) -> Result<Self, Error> {
        // Only regular files can seek.
        if file.metadata().is_ok_and(|there| there.is_file()) {
            hold(&file).map_err(|error| Error::Write {
                path: path.as_ref().display().to_string(),
                error: error.to_string(),
            })?;
            Recorder::start_on(Complete::new(file), path, world, header)
        } else {
            Recorder::start_on(BufWriter::with_capacity(1 << 16, file), path, world, header)
        }
    }

    /// Starts a log on any writer; `path` is its name in messages.
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
        // An output that cannot be written fails before the first sample.
        writer.flush().map_err(failed)?;
        let (to, name) = (Arc::clone(&shared), path.display().to_string());
        let thread = std::thread::Builder::new().name("recorder".into()).spawn(move || {
            lower_priority();
            if let Err(error) = write(writer, &records, &to) {
                *lock(&to.error) = Some(format!("cannot write {name}: {error}"));
                // Unblocks senders after an error.
                while let Ok(entry) = records.recv() {
                    to.lost.fetch_add(u64::from(matches!(entry, Entry::Record(_))), Ordering::Relaxed);
                }
            }
        });
        let thread = Some(thread.map_err(failed)?);
        let (next, since_gap) = (Cell::new(None), Cell::new(None));
        Ok(Recorder { queue: Some(queue), shared, thread, path, next, since_gap })
    }

    /// Announces the world of plan `number`, and how it replaces the last one, before its first sample is sent.
    pub fn plan(&self, number: u32, world: &World, change: Change) {
        lock(&self.shared.plans).insert(number, (world.clone(), change));
    }

    /// Queues a record; false where the queue is full, or the writing has ended. Never waits for the disk.
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

    /// Queues a snapshot, before the record of its sample: a replay can begin there. Never waits for the disk.
    pub fn send_snapshot(&self, snapshot: Box<Snapshot>) -> bool {
        let sent = self.push(Entry::Snapshot(snapshot));
        if sent {
            self.since_gap.set(None);
        }
        sent
    }

    /// Queues a record of `engine`, and its snapshots. After a gap it requests a snapshot, once samples are consecutive again: a replay
    /// continues from there.
    pub fn follow(&self, engine: &mut Engine, record: &Record) {
        while let Ok(snapshot) = engine.snapshots.pop() {
            self.send_snapshot(snapshot);
        }
        self.send(record);
        if self.since_gap.get().is_some_and(|since| since >= GAP_END_SAMPLES) && engine.snapshot() {
            self.since_gap.set(Some(0));
        }
    }

    fn push(&self, entry: Entry) -> bool {
        self.queue.as_ref().is_some_and(|queue| queue.try_send(entry).is_ok())
    }

    /// Its state.
    pub fn state(&self) -> RecorderState {
        RecorderState {
            written: self.shared.written.load(Ordering::Relaxed),
            lost: self.shared.lost.load(Ordering::Relaxed),
            error: lock(&self.shared.error).clone(),
        }
    }

    /// Writes the queue and the end of the log.
    ///
    /// # Errors
    /// [`Error::Write`]: earlier samples stay readable.
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
            lock(&self.shared.error).get_or_insert_with(|| "the recorder's thread has ended early".into());
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.join();
    }
}

/// Locks a file up to the end of this process, or of its last handle, so that no other recorder replaces it meanwhile. On other systems
/// than Unix a locked file could not be read, and an open one cannot be replaced. On file systems without locks this has no effect.
fn hold(file: &File) -> io::Result<()> {
    if !cfg!(unix) {
        return Ok(());
    }
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(io::Error::other(RECORDED)),
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

/// The meaning of [`is_recorded`], as the end of a message.
pub const RECORDED: &str = "another run is writing its log there; give another name";

/// Whether a recorder of any process is writing this file.
pub fn is_recorded(path: &Path) -> bool {
    let is_file = std::fs::metadata(path).is_ok_and(|there| there.is_file());
    let held = |file: File| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock));
    cfg!(unix) && is_file && File::open(path).is_ok_and(held)
}

/// Writes the queue until all senders are dropped.
fn write<W: Write>(mut writer: LogWriter<W>, entries: &Receiver<Entry>, shared: &Shared) -> io::Result<()> {
    let mut waiting = 0;
    // Snapshots by their samples, whose records follow.
    let mut snapshots = BTreeMap::new();
    let mut due = Instant::now() + FLUSH_INTERVAL;
    let end = loop {
        let next = match entries.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok(Entry::Snapshot(snapshot)) => {
                snapshots.insert(snapshot.sample, snapshot);
                continue;
            }
            Ok(Entry::Record(record)) => Ok(record),
            Err(error) => Err(error),
        };
        // Records of the previous plan may still arrive when a log begins just after a change.
        if let Ok(record) = &next
            && record.plan >= writer.plan()
        {
            if record.plan != writer.plan() {
                let world = lock(&shared.plans).remove(&record.plan);
                let world = world.ok_or_else(|| {
                    io::Error::other(format!("the samples of plan {} came before its world", record.plan))
                });
                let begun =
                    world.and_then(|(world, change)| writer.begin_at(record.sample, record.plan, &world, change));
                if let Err(error) = begun {
                    break Err(error);
                }
            }
            waiting += 1;
            // Snapshots of earlier samples were lost with their records.
            snapshots.retain(|sample, _| *sample >= record.sample);
            let snapshot = snapshots.remove(&record.sample);
            if let Err(error) = writer.write_record(record, snapshot.as_deref()) {
                break Err(error);
            }
        }
        let ended = matches!(next, Err(RecvTimeoutError::Disconnected));
        // The writer flushes automatically when a chunk is full.
        if Instant::now() >= due || ended {
            if let Err(error) = writer.flush() {
                break Err(error);
            }
            due = Instant::now() + FLUSH_INTERVAL;
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

/// Gives the recorder a low priority.
fn lower_priority() {
    #[cfg(target_os = "linux")]
    {
        // Without the permission it keeps the normal priority.
        let _ = rustix::process::setpriority_process(Some(rustix::thread::gettid()), 10);
    }
}
