//! Wall and processor time of the steps of `cargo xtask test`.

use std::fmt;
use std::fs;
use std::time::Instant;

/// What a step shows in the table when it took at least so many seconds of either.
const SHOWN: f64 = 1.0;
/// Ticks a second in /proc: the same on every Linux.
const TICKS: f64 = 100.0;

/// A moment.
#[derive(Clone, Copy)]
pub struct Spent {
    at: Instant,
    processor: f64,
}

/// Seconds between two moments.
#[derive(Clone, Copy, Default)]
pub struct Took {
    pub wall: f64,
    pub processor: f64,
}

impl Spent {
    pub fn now() -> Self {
        Spent { at: Instant::now(), processor: processor().unwrap_or_default() }
    }

    pub fn since(self) -> Took {
        let now = Spent::now();
        Took { wall: now.at.duration_since(self.at).as_secs_f64(), processor: now.processor - self.processor }
    }
}

/// Of this process and of the children that it has waited for, s. `None` where there is no /proc.
///
/// A child beside the steps counts in the step that waits for its end.
fn processor() -> Option<f64> {
    let text = fs::read_to_string("/proc/self/stat").ok()?;
    // After the name, which may hold anything: state is field 3, utime, stime, cutime and cstime are 14 to 17.
    let fields = text.rsplit_once(')')?.1.split_whitespace().skip(11).take(4);
    let ticks: Vec<f64> = fields.map_while(|field| field.parse().ok()).collect();
    (ticks.len() == 4).then(|| ticks.iter().sum::<f64>() / TICKS)
}

/// What took how long, the slowest first.
#[derive(Default)]
pub struct Table(Vec<(String, Took)>);

impl Table {
    pub fn row(&mut self, name: &str, took: Took) {
        self.0.push((name.into(), took));
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut rows: Vec<_> = self.0.iter().collect();
        rows.sort_by(|(_, a), (_, b)| b.processor.max(b.wall).total_cmp(&a.processor.max(a.wall)));
        writeln!(f, "  wall s   processor s")?;
        let mut rest = (0, Took::default());
        for (name, took) in rows {
            if took.wall.max(took.processor) >= SHOWN {
                writeln!(f, "{:8.1} {:12.1}   {name}", took.wall, took.processor)?;
            } else {
                let Took { wall, processor } = rest.1;
                rest = (rest.0 + 1, Took { wall: wall + took.wall, processor: processor + took.processor });
            }
        }
        writeln!(f, "{:8.1} {:12.1}   {} others", rest.1.wall, rest.1.processor, rest.0)
    }
}
