//! The limits of an input: about a second of processor time, and memory in proportion to its size.

use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::BTreeMap;
use std::hint::black_box;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

use crate::Target;

/// For one input, however long. The builds that drive the targets check overflow and, under libFuzzer, every address.
const SECOND: Duration = Duration::from_secs(1);
/// Entries of a map that are filled in about a second: where that takes longer, an input may too.
const ENTRIES: u32 = 500_000;
/// An input that has not come back by then never will.
const HANG: Duration = Duration::from_secs(30);
/// Bytes that a target may hold at once for any input: tables, a few copies, messages.
const MEMORY: usize = 4 << 20;
/// And for each byte of its input: the parser's tree of `a=[1,1,1,...` is the widest.
const MEMORY_PER_BYTE: usize = 512;

/// Counts what is held at once.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static PEAK_BYTES: AtomicUsize = AtomicUsize::new(0);

fn took(bytes: usize) {
    PEAK_BYTES.fetch_max(HELD.fetch_add(bytes, Relaxed) + bytes, Relaxed);
}

// SAFETY: every call goes to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        took(layout.size());
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both are there while one is copied to the other.
        took(size);
        HELD.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Runs a target on an input, within its limits.
///
/// # Panics
/// Beyond them, and when the target does.
pub fn judged(target: &Target, input: &[u8]) -> u64 {
    let held = HELD.load(Relaxed);
    PEAK_BYTES.store(held, Relaxed);
    let (outcome, took) = timed(target, input);
    let most = PEAK_BYTES.load(Relaxed).saturating_sub(held);
    let allowed = MEMORY + MEMORY_PER_BYTE * input.len();
    assert!(most <= allowed, "{} bytes of input held {most} bytes at once; {allowed} are allowed", input.len());
    // A single slow run proves nothing, and the time of other programs does not count: a slow input takes processor time in every run, and
    // more than a fixed piece of work of the same kind takes beside it.
    if took > SECOND {
        let is_slow = || timed(target, input).1 > spent(filled_map).1.max(SECOND);
        assert!((0..4).any(|_| !is_slow()), "{} bytes of input took {took:?}", input.len());
    }
    outcome
}

fn timed(target: &Target, input: &[u8]) -> (u64, Duration) {
    let _under_way = UnderWay::new();
    spent(|| (target.run)(input))
}

/// The result of `work` and its processor time.
fn spent<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let (start, before) = (Instant::now(), processor());
    let result = work();
    let took = before.zip(processor()).map(|(before, after)| after.saturating_sub(before));
    (result, took.unwrap_or_else(|| start.elapsed()))
}

/// What readers do: text, memory and comparisons.
fn filled_map() {
    let key = |i: u32| i.wrapping_mul(2_654_435_761).to_string();
    black_box((0..ENTRIES).map(|i| (key(i), i)).collect::<BTreeMap<_, _>>());
}

/// Processor time of this thread, to a hundredth of a second; `None` where the system does not report it.
fn processor() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/stat").ok()?;
    // After the name, which may hold anything: state is field 3, utime and stime are 14 and 15.
    let fields = text.rsplit_once(')')?.1.split_whitespace().skip(11).take(2);
    let ticks: Vec<u64> = fields.map_while(|field| field.parse().ok()).collect();
    (ticks.len() == 2).then(|| Duration::from_millis(10 * ticks.iter().sum::<u64>()))
}

/// While it lives, an input is being run; a panic ends it too.
struct UnderWay;

impl UnderWay {
    fn new() -> UnderWay {
        STARTED.store(now(), Relaxed);
        UnderWay
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        STARTED.store(0, Relaxed);
    }
}

/// When the present input was begun, in ms; 0: there is none.
static STARTED: AtomicU64 = AtomicU64::new(0);

fn now() -> u64 {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    START.elapsed().as_millis() as u64 + 1
}

/// Calls `hung` from a thread of its own when an input does not come back.
pub fn watch(hung: impl Fn() + Send + 'static) {
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(HANG / 10);
            let started = STARTED.load(Relaxed);
            if started > 0 && now() - started > HANG.as_millis() as u64 {
                hung();
            }
        }
    });
}
