//! Processor time.

use std::fs;

/// Ticks a second in /proc: the same on every Linux.
const TICKS: f64 = 100.0;

/// Processor time of this process and of the children that it has waited for, in s; `None` without /proc.
pub fn processor() -> Option<f64> {
    let text = fs::read_to_string("/proc/self/stat").ok()?;
    // After the name, which may hold anything: state is field 3, utime, stime, cutime and cstime are 14 to 17.
    let fields = text.rsplit_once(')')?.1.split_whitespace().skip(11).take(4);
    let ticks: Vec<f64> = fields.map_while(|field| field.parse().ok()).collect();
    (ticks.len() == 4).then(|| ticks.iter().sum::<f64>() / TICKS)
}
