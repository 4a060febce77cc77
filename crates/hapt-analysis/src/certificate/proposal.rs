//! Remedies as lines to paste into the world file, in the file's own units.

use hapt_model::keys::Measure;
use hapt_model::{Coupling, Error, Parameter, Source, World, parameters, unit, unit_size};

use crate::certificate::check::Check;
use crate::certificate::remedies::Remedies;

/// The direction of rounding that keeps a value certified.
#[derive(Clone, Copy)]
enum Rounding {
    Up,
    Down,
}

/// The remedies of a world, ready to present.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The heading: remedies, or margins.
    pub heading: &'static str,
    /// The remedies, in order.
    pub remedies: Vec<Remedy>,
}

impl Proposal {
    /// All lines, one block per remedy. If any block has several lines, an empty line separates the blocks. A block of several keys
    /// begins with a comment that they belong together.
    pub fn lines(&self) -> Vec<String> {
        let parted = self.remedies.iter().any(|remedy| remedy.lines.len() > 1);
        let mut lines = Vec::new();
        for remedy in &self.remedies {
            if parted && !lines.is_empty() {
                lines.push(String::new());
            }
            if remedy.is_joint {
                lines.push("# all of these together:".into());
            }
            lines.extend(remedy.lines.iter().cloned());
        }
        lines
    }
}

/// A single change that makes the world certified.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Remedy {
    /// Keys with their values as written; empty for a new coupling.
    pub sets: Vec<(String, String)>,
    /// Lines for the world file, with where they belong.
    pub lines: Vec<String>,
    /// Whether it consists of several keys or couplings that must change together.
    pub is_joint: bool,
}

impl Remedy {
    /// The key at `path` as `value`; `place` is a comment.
    fn key(path: &str, value: String, place: &str) -> Self {
        let mut remedy = Remedy::default();
        remedy.and(path, value, place);
        remedy
    }

    fn and(&mut self, path: &str, value: String, place: &str) {
        let name = path.rsplit('.').next().unwrap_or_default();
        let quoted = if value.parse::<f64>().is_ok() { value.clone() } else { format!("{value:?}") };
        self.lines.push(format!("{:<40}  # {place}", format!("{name} = {quoted}")));
        self.sets.push((path.to_string(), value));
    }
}

/// The remedies of a world, or the margins of a certified one; `None` where a certified world has no margins.
///
/// # Errors
/// As [`World::read`], when `source` and `sets` are not what the world was read from.
pub fn proposal(
    world: &World,
    source: &Source,
    sets: &[String],
    check: &Check,
    remedies: &Remedies,
) -> Result<Option<Proposal>, Error> {
    let file = File { world, parameters: parameters(source, sets)? };
    let mut list = Vec::new();
    if let Some(damping) = remedies.device_damping {
        let place = "in [device]: a property of the hardware, which a number in the file does not change";
        list.push(Remedy::key("device.damping", file.value("device.damping", damping, Rounding::Up), place));
    }
    if let Some(period) = remedies.period_s {
        list.push(Remedy::key("loop.period", file.value("loop.period", period, Rounding::Down), "in [loop]"));
    }
    if let Some(delay) = remedies.delay_s.filter(|delay| *delay > 0.0 || !check.certified) {
        list.push(Remedy::key("loop.delay", file.value("loop.delay", delay, Rounding::Down), "in [loop]"));
    }
    if let Some(longest) = remedies.interval_max_s {
        let value = file.value("loop.interval_max", longest, Rounding::Down);
        list.push(Remedy::key("loop.interval_max", value, "in [loop]: how late a sample may be"));
    }
    if let Some(longest) = remedies.delay_max_s.filter(|delay| *delay > 0.0 || !check.certified) {
        list.push(Remedy::key("loop.delay_max", file.value("loop.delay_max", longest, Rounding::Down), "in [loop]"));
    }
    if let Some(advance) = remedies.advance {
        list.push(Remedy::key("loop.advance", advance.to_string(), "in [loop]"));
    }
    if let Some(output) = remedies.output {
        list.push(Remedy::key("loop.output", output.to_string(), "in [loop]"));
    }
    if let Some(scale) = remedies.stiffness_scale {
        let stiff: Vec<(usize, &str, f64)> = world.couplings.iter().enumerate().filter_map(stiffness).collect();
        let all = if stiff.len() > 1 { format!(", all of them times {}", number(scale)) } else { String::new() };
        let mut softer = Remedy::default();
        for (i, key, value) in stiff {
            let path = format!("couplings.{i}.{key}");
            softer.and(&path, file.value(&path, scale * value, Rounding::Down), &format!("in couplings.{i}{all}"));
        }
        softer.is_joint = softer.sets.len() > 1;
        list.extend(Some(softer).filter(|softer| !softer.lines.is_empty()));
    }
    if let Some(damping) = remedies.ground_damping.filter(|damping| *damping > 0.0) {
        let unit = Measure::Damping.dimension(world.motion).symbol();
        let mut dampers = Remedy::default();
        for name in &world.names {
            dampers.lines.push(format!("{:<40}  # a new one, for each body", "[[couplings]]"));
            dampers.lines.push("kind = \"damper\"".into());
            dampers.lines.push(format!("between = [{name:?}, \"ground\"]"));
            dampers.lines.push(format!("damping = \"{} {unit}\"", rounded(damping, Rounding::Up)));
        }
        dampers.is_joint = world.names.len() > 1;
        list.push(dampers);
    }
    let heading = match (check.certified, list.is_empty()) {
        (true, true) => return Ok(None),
        (false, true) => "none found: no single number makes this loop certified",
        (true, false) => "certified as far as each of these, one at a time",
        (false, false) => "any one of these makes it certified",
    };
    Ok(Some(Proposal { heading, remedies: list }))
}

/// The key that holds the stiffness of a coupling, and its value.
fn stiffness((i, coupling): (usize, &Coupling)) -> Option<(usize, &'static str, f64)> {
    let mut law = coupling.law;
    law.strength().map(|strength| (i, strength.name, *strength.value))
}

/// The keys of the file as written.
struct File<'a> {
    world: &'a World,
    parameters: Vec<Parameter>,
}

impl File<'_> {
    /// `value unit`, in the unit that the file uses; a bare number where it uses none.
    fn value(&self, path: &str, si: f64, rounding: Rounding) -> String {
        let measure = self.world.key(path).and_then(|key| key.takes.quantity());
        let Some(dimension) = measure.map(|(measure, _)| measure.dimension(self.world.motion)) else {
            return rounded(si, rounding);
        };
        let written = self.parameters.iter().find(|parameter| parameter.path == path).map(|p| unit(&p.written));
        let own = written
            .filter(|unit| !unit.is_empty())
            .and_then(|unit| Some((unit_size(&unit, dimension, self.world)?, unit)))
            .map(|(size, unit)| (unit, size));
        let (unit, size) = own.unwrap_or_else(|| (dimension.symbol(), 1.0));
        format!("{} {unit}", rounded(si / size, rounding))
    }
}

/// Six significant digits, no trailing zeros.
pub fn number(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let exponent = x.abs().log10().floor();
    if !(-4.0..=8.0).contains(&exponent) {
        // 5.64400e-7 is 5.644e-7.
        let text = format!("{x:.5e}");
        return match text.split_once('e') {
            Some((digits, power)) => format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.')),
            None => text,
        };
    }
    let text = format!("{x:.*}", (5.0 - exponent).max(0.0) as usize);
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

/// Four digits, rounded to the safe side.
fn rounded(x: f64, rounding: Rounding) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let step = 10f64.powf(x.abs().log10().floor() - 3.0);
    let steps = match rounding {
        Rounding::Up => (x / step * (1.0 - 1e-12)).ceil(),
        Rounding::Down => (x / step * (1.0 + 1e-12)).floor(),
    };
    number(steps * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_is_what_stands_behind_the_number() {
        for (written, wanted) in [
            ("17.8 N mm/deg", "N mm/deg"),
            ("1.2e-3 N m s/rad", "N m s/rad"),
            ("2ms", "ms"),
            ("0.001", ""),
            ("-1E+3 mm", "mm"),
        ] {
            assert_eq!(unit(written), wanted);
        }
    }

    #[test]
    fn a_remedy_is_rounded_to_the_safe_side() {
        assert_eq!(rounded(5.092_96e-4, Rounding::Up), "0.0005093");
        assert_eq!(rounded(5.092_01e-4, Rounding::Up), "0.0005093");
        assert_eq!(rounded(41.239_9, Rounding::Down), "41.23");
        assert_eq!(rounded(41.0, Rounding::Up), "41");
        assert_eq!(rounded(41.0, Rounding::Down), "41");
    }
}
