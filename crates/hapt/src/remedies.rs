//! Remedies as lines to paste into the world file, in the file's own units.

use hapt_analysis::{Check, Remedies};
use hapt_model::keys::Takes;
use hapt_model::{Law, Parameter, World, parameters, parse_quantity};

use crate::failure::Failure;
use crate::people;
use crate::world::Loaded;

/// To which side a value is rounded, so that it still certifies.
#[derive(Clone, Copy)]
enum Side {
    Up,
    Down,
}

/// What can be said of a certificate's remedies: a heading, and under it lines to paste.
pub struct Proposal {
    pub heading: &'static str,
    pub lines: Vec<String>,
}

/// What would make the world certified, or the margins of one that is; `None` where there are none to give.
pub fn proposal(
    loaded: &Loaded,
    sets: &[String],
    check: &Check,
    remedies: &Remedies,
) -> Result<Option<Proposal>, Failure> {
    let world = &loaded.world;
    let file = File { world, parameters: parameters(&loaded.source, sets)? };
    let mut lines = Vec::new();
    let mut line = |assignment: String, place: String| {
        lines.push(if place.is_empty() { assignment } else { format!("{assignment:<40}  # {place}") });
    };
    let at = |table: &str| format!("in [{table}]");
    if let Some(damping) = remedies.device_damping {
        line(file.assignment("device.damping", damping, Side::Up), at("device"));
    }
    if let Some(period) = remedies.period_s {
        line(file.assignment("loop.period", period, Side::Down), at("loop"));
    }
    if let Some(delay) = remedies.delay_s.filter(|delay| *delay > 0.0 || !check.certified) {
        line(file.assignment("loop.delay", delay, Side::Down), at("loop"));
    }
    if let Some(advance) = remedies.advance {
        line(format!("advance = {advance}"), at("loop"));
    }
    if let Some(output) = remedies.output {
        line(format!("output = {output:?}"), at("loop"));
    }
    if let Some(scale) = remedies.stiffness_scale {
        let stiff = |law: &Law| matches!(law, Law::Spring { .. } | Law::Wall { .. } | Law::Detent { .. });
        for (i, coupling) in world.couplings.iter().enumerate().filter(|(_, coupling)| stiff(&coupling.law.unclamped()))
        {
            let (key, value) = match coupling.law.unclamped() {
                Law::Spring { stiffness, .. } | Law::Wall { stiffness, .. } => ("stiffness", stiffness),
                Law::Detent { torque, .. } => ("torque", torque),
                _ => continue,
            };
            let all = if world.couplings.len() > 1 {
                format!(", all of them times {}", people::number(scale))
            } else {
                String::new()
            };
            let assignment = file.assignment(&format!("couplings.{i}.{key}"), scale * value, Side::Down);
            line(assignment, format!("in couplings.{i}{all}"));
        }
    }
    if let Some(damping) = remedies.ground_damping.filter(|damping| *damping > 0.0) {
        for name in &world.names {
            line("[[couplings]]".into(), "a new one, for each body".into());
            line("kind = \"damper\"".into(), String::new());
            line(format!("between = [{name:?}, \"ground\"]"), String::new());
            line(format!("damping = \"{} {}\"", rounded(damping, Side::Up), unit_of_damping(world)), String::new());
        }
    }
    let heading = match (check.certified, lines.is_empty()) {
        (true, true) => return Ok(None),
        (false, true) => "none found: no single number makes this loop certified",
        (true, false) => "certified as far as each of these, one at a time",
        (false, false) => "any one of these makes it certified",
    };
    Ok(Some(Proposal { heading, lines }))
}

fn unit_of_damping(world: &World) -> String {
    hapt_model::keys::Measure::Damping.dimension(world.motion).symbol()
}

/// The file's keys as they are written.
struct File<'a> {
    world: &'a World,
    parameters: Vec<Parameter>,
}

impl File<'_> {
    /// `key = "value unit"`, in the unit that stands there already.
    fn assignment(&self, path: &str, si: f64, side: Side) -> String {
        let name = path.rsplit('.').next().unwrap_or_default();
        let measure = self.world.key(path).and_then(|key| match key.takes {
            Takes::Quantity(measure, _) | Takes::QuantityOr(measure, ..) => Some(measure),
            _ => None,
        });
        let Some(dimension) = measure.map(|measure| measure.dimension(self.world.motion)) else {
            return format!("{name} = {}", rounded(si, side));
        };
        let written = self.parameters.iter().find(|parameter| parameter.path == path).map(|p| unit(&p.written));
        let own = written
            .filter(|unit| !unit.is_empty())
            .and_then(|unit| parse_quantity(&format!("1 {unit}"), dimension).ok().map(|size| (unit, size)));
        let (unit, size) = own.unwrap_or_else(|| (dimension.symbol(), 1.0));
        format!("{name} = \"{} {unit}\"", rounded(si / size, side))
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
    people::number(steps * step)
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
