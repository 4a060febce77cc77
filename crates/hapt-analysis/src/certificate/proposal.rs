//! Remedies as lines to paste into the world file, in the file's own units.

use hapt_model::keys::{Measure, in_samples};
use hapt_model::{Coupling, Dimension, Error, Parameter, Source, World, parameters, parse_quantity};

use crate::certificate::check::Check;
use crate::certificate::remedies::Remedies;

/// To which side a value is rounded, so that it still certifies.
#[derive(Clone, Copy)]
enum Side {
    Up,
    Down,
}

/// What can be said of a certificate's remedies.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// What the remedies are: any of them by itself makes it certified, or is a margin.
    pub heading: &'static str,
    /// One after the other.
    pub remedies: Vec<Remedy>,
}

impl Proposal {
    /// All lines, a block a remedy: where one of them takes several lines, an empty one parts it from the next, and where it takes several
    /// keys its head says that they belong together.
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

/// One change that certifies by itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Remedy {
    /// Keys and their values as they are written, all of them together; empty for what no key holds, a new coupling.
    pub sets: Vec<(String, String)>,
    /// Lines for the world file, with where they belong.
    pub lines: Vec<String>,
    /// Whether it takes several keys, or several couplings, all of them together.
    pub is_joint: bool,
}

impl Remedy {
    /// The key at `path` as `value`, which are written as `assignment`; `place` is for people.
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

/// What would make the world certified, or the margins of one that is; `None` where there are none to give.
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
        list.push(Remedy::key("device.damping", file.value("device.damping", damping, Side::Up), place));
    }
    if let Some(period) = remedies.period_s {
        list.push(Remedy::key("loop.period", file.value("loop.period", period, Side::Down), "in [loop]"));
    }
    if let Some(delay) = remedies.delay_s.filter(|delay| *delay > 0.0 || !check.certified) {
        list.push(Remedy::key("loop.delay", file.value("loop.delay", delay, Side::Down), "in [loop]"));
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
            softer.and(&path, file.value(&path, scale * value, Side::Down), &format!("in couplings.{i}{all}"));
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
            dampers.lines.push(format!("damping = \"{} {unit}\"", rounded(damping, Side::Up)));
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

/// The key in which a coupling's stiffness is, and its value.
fn stiffness((i, coupling): (usize, &Coupling)) -> Option<(usize, &'static str, f64)> {
    let mut law = coupling.law;
    law.strength().map(|strength| (i, strength.name, *strength.value))
}

/// The file's keys as they are written.
struct File<'a> {
    world: &'a World,
    parameters: Vec<Parameter>,
}

impl File<'_> {
    /// `value unit`, in the unit that stands there already; a bare number where there is none.
    fn value(&self, path: &str, si: f64, side: Side) -> String {
        let measure = self.world.key(path).and_then(|key| key.takes.quantity());
        let Some(dimension) = measure.map(|(measure, _)| measure.dimension(self.world.motion)) else {
            return rounded(si, side);
        };
        let written = self.parameters.iter().find(|parameter| parameter.path == path).map(|p| unit(&p.written));
        let own = written
            .filter(|unit| !unit.is_empty())
            .and_then(|unit| Some((size(&unit, dimension, self.world)?, unit)))
            .map(|(size, unit)| (unit, size));
        let (unit, size) = own.unwrap_or_else(|| (dimension.symbol(), 1.0));
        format!("{} {unit}", rounded(si / size, side))
    }
}

/// What 1 `unit` is in SI; `None` where it has another dimension. A sample is as long as the world's period.
pub fn size(unit: &str, dimension: Dimension, world: &World) -> Option<f64> {
    let one = format!("1 {unit}");
    match in_samples(&one) {
        Some(samples) => (dimension == Dimension::TIME).then_some(samples * world.sampling.period),
        None => parse_quantity(&one, dimension).ok(),
    }
}

/// The unit in "17.8 N mm/deg".
pub fn unit(written: &str) -> String {
    let number = |c: char| c.is_ascii_digit() || matches!(c, '.' | '+' | '-' | '_');
    let rest = written.trim().trim_start_matches(number);
    // The exponent of "1.2e-3 N".
    let rest = match rest.strip_prefix(['e', 'E']) {
        Some(exponent) if exponent.starts_with(|c: char| number(c)) => exponent.trim_start_matches(number),
        _ => rest,
    };
    rest.trim().to_string()
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

/// Four digits, to the safe side.
fn rounded(x: f64, side: Side) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let step = 10f64.powf(x.abs().log10().floor() - 3.0);
    let steps = match side {
        Side::Up => (x / step * (1.0 - 1e-12)).ceil(),
        Side::Down => (x / step * (1.0 + 1e-12)).floor(),
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
        assert_eq!(rounded(5.092_96e-4, Side::Up), "0.0005093");
        assert_eq!(rounded(5.092_01e-4, Side::Up), "0.0005093");
        assert_eq!(rounded(41.239_9, Side::Down), "41.23");
        assert_eq!(rounded(41.0, Side::Up), "41");
        assert_eq!(rounded(41.0, Side::Down), "41");
    }
}
