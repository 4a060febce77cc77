//! The limits of an input: a second of processor time, and memory in proportion to its size.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

use crate::Target;

/// For one input, however long. The builds that drive the targets check overflow and, under libFuzzer, every address.
const SECOND: Duration = Duration::from_secs(1);
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
    // On a busy machine a single slow run proves nothing, and the time of other programs does not count: a slow input takes processor time
    // in every run.
    if took > SECOND {
        let quickest = (0..4).map(|_| timed(target, input).1).min().unwrap_or(took);
        assert!(quickest <= SECOND, "{} bytes of input took {quickest:?}", input.len());
    }
    outcome
}

fn timed(target: &Target, input: &[u8]) -> (u64, Duration) {
    let _under_way = UnderWay::new();
    let (start, spent) = (Instant::now(), processor());
    let outcome = (target.run)(input);
    let took = spent.zip(processor()).map(|(before, after)| after.saturating_sub(before));
    (outcome, took.unwrap_or_else(|| start.elapsed()))
}

/// Processor time of this thread, in hundredths of a second; `None` where the system does not report it.
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
