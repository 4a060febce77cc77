//! Remedies as lines to paste into the world file, in the file's own units.

use hapt_model::keys::Measure;
use hapt_model::{Coupling, Error, Parameter, Source, World, parameters, unit, unit_size};

use crate::certificate::check::Check;
use crate::certificate::is_certified;
use crate::certificate::remedies::Remedies;
use crate::certificate::rounding::{Certified, NEAR_IN_FILE, candidates};
pub use crate::text::number;

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
    /// Keys with their values as written; a new coupling is `couplings.N` with its table, N one beyond the last.
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
    let file = File { world, source, sets, parameters: parameters(source, sets)? };
    let mut list = Vec::new();
    let later = |delay: &f64| *delay > 0.0 || !check.certified.holds();
    let numbers = [
        (
            remedies.device_damping,
            "device.damping",
            Certified::Above,
            "in [device]: a property of the hardware, which a number in the file does not change",
        ),
        (remedies.period_s, "loop.period", Certified::Below, "in [loop]"),
        (remedies.delay_s.filter(later), "loop.delay", Certified::Below, "in [loop]"),
        (remedies.interval_max_s, "loop.interval_max", Certified::Below, "in [loop]: how late a sample may be"),
        (remedies.delay_max_s.filter(later), "loop.delay_max", Certified::Below, "in [loop]"),
    ];
    for (si, path, side, place) in numbers {
        let value = si.and_then(|si| file.value(path, si, side));
        list.extend(value.map(|value| Remedy::key(path, value, place)));
    }
    if let Some(advance) = remedies.advance {
        list.push(Remedy::key("loop.advance", advance.to_string(), "in [loop]"));
    }
    if let Some(output) = remedies.output {
        list.push(Remedy::key("loop.output", output.to_string(), "in [loop]"));
    }
    if let Some(estimator) = remedies.estimator {
        list.push(Remedy::key("loop.estimator", estimator.to_string(), "in [loop]"));
    }
    if let Some(speed) = remedies.overspeed {
        let value = file.value("safety.overspeed", speed, Certified::Below);
        list.extend(value.map(|value| {
            Remedy::key("safety.overspeed", value, "in [safety]: below it the device's friction makes up for damping")
        }));
    }
    if let Some(scale) = remedies.compensation_scale {
        let shares = file.keys(|i, coupling| {
            let (_, share) = world.device.compensated_by(coupling)?;
            if i >= file.own() {
                return Some(("share", share));
            }
            // A coupling of the file that does the same.
            if let Some(limit) = coupling.limit {
                return Some(("limit", limit));
            }
            let mut law = coupling.law;
            let strongest = law.quantities().find(|quantity| ["torque", "inertia"].contains(&quantity.name))?;
            Some((strongest.name, *strongest.value))
        });
        list.extend(file.scaled(&shares, scale));
    }
    if let Some(scale) = remedies.stiffness_scale {
        let strengths = file.keys(|i, coupling| {
            let mut law = coupling.law;
            let strength = law.strength()?;
            let share = world.device.compensated_by(coupling).filter(|_| i >= file.own());
            Some(share.map_or((strength.name, *strength.value), |(_, share)| ("share", share)))
        });
        // If every strength is that of a compensation, the remedy above is the same.
        if remedies.compensation_scale.is_none() || strengths.iter().any(|(table, ..)| table.starts_with("couplings."))
        {
            list.extend(file.scaled(&strengths, scale));
        }
    }
    if let Some(damping) = remedies.ground_damping.filter(|damping| *damping > 0.0) {
        let unit = Measure::Damping.dimension(world.motion).symbol();
        let mut dampers = Remedy::default();
        for (name, index) in world.names.iter().zip(file.own()..) {
            let value = format!("{} {unit}", written(damping));
            let table = format!("{{ kind = \"damper\", between = [{name:?}, \"ground\"], damping = {value:?} }}");
            dampers.sets.push((format!("couplings.{index}"), table));
            dampers.lines.push(format!("{:<40}  # a new one, for each body", "[[couplings]]"));
            dampers.lines.push("kind = \"damper\"".into());
            dampers.lines.push(format!("between = [{name:?}, \"ground\"]"));
            dampers.lines.push(format!("damping = {value:?}"));
        }
        dampers.is_joint = world.names.len() > 1;
        list.push(dampers);
    }
    let heading = match (check.certified.holds(), list.is_empty()) {
        (true, true) => return Ok(None),
        (false, true) => "none found: none of the numbers that were tried makes this loop certified",
        (true, false) => "certified as far as each of these, one at a time",
        (false, false) => "any one of these makes it certified",
    };
    Ok(Some(Proposal { heading, remedies: list }))
}

/// The keys of the file as written.
struct File<'a> {
    world: &'a World,
    source: &'a Source,
    sets: &'a [String],
    parameters: Vec<Parameter>,
}

impl File<'_> {
    /// How many couplings the file itself has: those of its compensations follow them.
    fn own(&self) -> usize {
        let indices = self.parameters.iter().filter_map(|parameter| {
            let (index, _) = parameter.path.strip_prefix("couplings.")?.split_once('.')?;
            index.parse::<usize>().ok()
        });
        indices.max().map_or(0, |last| last + 1)
    }

    /// The key of each coupling that `of` names, with its value: the table's path, the whole path, and the number.
    fn keys<'k>(&self, of: impl Fn(usize, &Coupling) -> Option<(&'k str, f64)>) -> Vec<(String, String, f64)> {
        let own = self.own();
        let key = |(i, coupling): (usize, &Coupling)| {
            let (name, value) = of(i, coupling)?;
            let table = if i < own { format!("couplings.{i}") } else { format!("compensation.{}", i - own) };
            Some((table.clone(), format!("{table}.{name}"), value))
        };
        self.world.couplings.iter().enumerate().filter_map(key).collect()
    }

    /// These numbers times `scale`, all of them together.
    fn scaled(&self, numbers: &[(String, String, f64)], scale: f64) -> Option<Remedy> {
        let all = if numbers.len() > 1 { format!(", all of them times {}", number(scale)) } else { String::new() };
        let keys: Vec<(String, f64)> = numbers.iter().map(|(_, path, value)| (path.clone(), scale * value)).collect();
        let mut softer = Remedy::default();
        for ((table, path, _), value) in numbers.iter().zip(self.values(&keys, Certified::Below)?) {
            softer.and(path, value, &format!("in {table}{all}"));
        }
        softer.is_joint = softer.sets.len() > 1;
        (!softer.lines.is_empty()).then_some(softer)
    }

    /// `value unit`, in the unit that the file uses; a bare number where it uses none. The number is the roundest next to `si` with which
    /// the file, read anew, is certified; `None` where no number certifies it, as one beyond the key's range.
    fn value(&self, path: &str, si: f64, side: Certified) -> Option<String> {
        self.values(&[(path.to_string(), si)], side)?.pop()
    }

    /// The same of keys that change together: each takes its roundest number, then its next, until all together are certified.
    fn values(&self, keys: &[(String, f64)], side: Certified) -> Option<Vec<String>> {
        if keys.is_empty() {
            return None;
        }
        let units: Vec<(String, f64)> = keys.iter().map(|(path, _)| self.unit(path)).collect();
        let own = |((_, si), (_, size)): (&(String, f64), &(String, f64))| si / size;
        let mut rounder: Vec<_> = keys.iter().zip(&units).map(|key| candidates(own(key), side, NEAR_IN_FILE)).collect();
        let together = std::iter::from_fn(|| rounder.iter_mut().map(Iterator::next).collect::<Option<Vec<f64>>>());
        let exact = keys.iter().zip(&units).map(own).collect();
        together.chain([exact]).find_map(|numbers| {
            let text =
                |(x, (unit, _)): (&f64, &(String, f64))| format!("{} {unit}", written(*x)).trim_end().to_string();
            let texts: Vec<String> = numbers.iter().zip(&units).map(text).collect();
            let sets = keys.iter().zip(&texts).map(|((path, _), text)| format!("{path}={text}"));
            let sets: Vec<String> = self.sets.iter().cloned().chain(sets).collect();
            let mut anew = World::read(self.source, &sets).ok()?;
            // The certificate may be about another device than the session's.
            if !keys.iter().any(|(path, _)| path.starts_with("device.")) {
                anew.device = self.world.device.clone();
            }
            is_certified(&anew).then_some(texts)
        })
    }

    /// The unit of a key and its size in SI.
    fn unit(&self, path: &str) -> (String, f64) {
        let measure = self.world.key(path).and_then(|key| key.takes.quantity());
        let Some(dimension) = measure.map(|(measure, _)| measure.dimension(self.world.motion)) else {
            return (String::new(), 1.0);
        };
        let own = self.parameters.iter().find(|parameter| parameter.path == path).map(|p| unit(&p.written));
        own.filter(|unit| !unit.is_empty())
            .and_then(|unit| Some((unit_size(&unit, dimension, self.world)?, unit)))
            .map_or_else(|| (dimension.symbol().to_string(), 1.0), |(size, unit)| (unit, size))
    }
}

/// All digits that a number has, without an exponent where it is neither large nor small.
fn written(x: f64) -> String {
    if x == 0.0 || (1e-4..1e9).contains(&x.abs()) { format!("{x}") } else { format!("{x:e}") }
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
}
