//! Linear loops that lack a little damping: does `hapt worst` break them? It tries a mass on a spring, with which the loop grows, and the
//! motion for which the motor's work is largest, to which the real core on the exact device then gives energy in each repetition.

use std::ops::AddAssign;

use hapt_model::World;
use hapt_sweep::worst::work_motion;

/// Parts of the required damping.
const PARTS: [f64; 3] = [0.9, 0.95, 0.99];
/// Samples of the motion, without and with bodies.
const SAMPLES: [&[usize]; 2] = [&[100, 300, 1_000], &[300, 3_000]];
const BODIES: [&str; 3] = ["none", "one", "two or three"];
const TIMES: [&str; 2] = ["at once", "delayed"];

/// How many of one class, and how many of these a mass on a spring breaks, and it or a motion.
type Class = (u64, [(u64, u64); PARTS.len()]);

/// By bodies and times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Near([[Class; TIMES.len()]; BODIES.len()]);

impl AddAssign for Near {
    fn add_assign(&mut self, other: Self) {
        for (sum, more) in self.0.as_flattened_mut().iter_mut().zip(other.0.as_flattened()) {
            sum.0 += more.0;
            for (sum, more) in sum.1.iter_mut().zip(more.1) {
                *sum = (sum.0 + more.0, sum.1 + more.1);
            }
        }
    }
}

impl Near {
    /// The result of one loop, for which `required` is enough, and which a mass on a spring breaks up to `breaking`.
    pub fn of(world: &World, required: f64, breaking: f64, taken: &mut u64) -> Near {
        let lengths = SAMPLES[usize::from(!world.bodies.is_empty())];
        let mut motions: Vec<_> = lengths.iter().filter_map(|samples| work_motion(world, *samples)).collect();
        motions.sort_by(|a, b| b.demand.total_cmp(&a.demand));
        let broken = PARTS.map(|part| {
            let damping = part * required;
            let grip = breaking > damping;
            let is_broken = grip || motions.iter().any(|of| of.demand > damping && of.draws(world, damping, taken));
            (u64::from(grip), u64::from(is_broken))
        });
        let mut near = Near::default();
        let time = usize::from(world.sampling.delay_s() > 0.0);
        near.0[world.bodies.len().min(2)][time] = (1, broken);
        near
    }

    /// In Markdown.
    pub fn table(&self) -> String {
        let mut text = String::from(
            "\nLinear loops with a part of the damping that they require, broken by a mass on a spring / by it or by the motion of most work:\n\n\
             | bodies | torque | loops | 0.9 | 0.95 | 0.99 |\n| --- | --- | --- | --- | --- | --- |\n",
        );
        for (row, bodies) in self.0.iter().zip(BODIES) {
            for ((loops, broken), times) in row.iter().zip(TIMES) {
                let share = |n: u64| format!("{:.1} %", 100.0 * n as f64 / (*loops).max(1) as f64);
                text += &format!("| {bodies} | {times} | {loops} |");
                for (grip, all) in broken {
                    text += &format!(" {} / {} |", share(*grip), share(*all));
                }
                text.push('\n');
            }
        }
        text
    }
}
