//! The counts of `cargo xtask truth`.

use super::{Claim, Counts, OPEN_SAMPLES};

/// The counts in Markdown.
pub fn table(found: &mut Counts, seed: u64) -> String {
    let mut text = format!(
        "{} random loops (seed {seed}), {} samples of the real core on the exact device; {} without an answer (numbers out of range).\n\n\
         | called | loops | ran as called | too slow to see | contradicted |\n| --- | --- | --- | --- | --- |\n",
        found.loops, found.samples, found.unanswered
    );
    for (name, claim) in found.claims().into_iter().take(8) {
        let Claim { loops, confirmed, slow, contradicted } = *claim;
        text += &format!("| {name} | {loops} | {confirmed} | {slow} | {contradicted} |\n");
    }
    let refused = found.refused;
    found.reach.sort_by(f64::total_cmp);
    text += &format!(
        "\nOf {} loops called not passive, all linear, a passive hand of a mass and a spring breaks {} ({:.1} %); no hand that was tried breaks the other {}.\n",
        refused.loops,
        refused.confirmed,
        100.0 * refused.confirmed as f64 / refused.loops.max(1) as f64,
        refused.slow
    );
    let open = found.unproved;
    text += &format!(
        "Of {} nonlinear loops called passive and not proved, with counts, levels, an exact velocity or a constant torque, a motion of \
         {OPEN_SAMPLES} samples draws energy from {} ({:.1} %).\n",
        open.loops,
        open.confirmed,
        100.0 * open.confirmed as f64 / open.loops.max(1) as f64
    );
    let (open, friction) = (found.open, found.by_friction);
    text += &format!(
        "Of {} nonlinear loops that are open, random hands or such a motion draw energy from {} ({:.1} %). Of the {} loops that are passive by friction \
         up to a speed, motions at 1.5 times it draw energy from {} ({:.1} %).\n",
        open.loops,
        open.confirmed,
        100.0 * open.confirmed as f64 / open.loops.max(1) as f64,
        friction.loops,
        found.faster,
        100.0 * found.faster as f64 / friction.loops.max(1) as f64
    );
    let at = |part: f64| found.reach.get((part * found.reach.len().saturating_sub(1) as f64).round() as usize);
    if let (Some(low), Some(middle), Some(high)) = (at(0.1), at(0.5), at(0.9)) {
        text += &format!(
            "Where a finite damping is asked for, such a hand breaks the loop up to {middle:.3} of it at the median of {} loops, \
             {low:.3} and {high:.3} at the tenths.\n",
            found.reach.len()
        );
    }
    text += &found.near.table();
    text
}
