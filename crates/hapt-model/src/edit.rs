//! The text of a world file with its overrides written into it.

use toml::de::DeValue;

use crate::document::{Document, Node, Value};
use crate::error::Error;
use crate::keys;
use crate::overrides::Override;
use crate::quantity::split_tolerance;
use crate::source::Source;
use crate::world::World;
use crate::write::text;

impl Source {
    /// The text of a world file that reads as this one does with `sets`. Comments, order and units stay where only values change and keys are
    /// added; where that does not give the same world, the text is [`World::to_toml`].
    ///
    /// ```
    /// use hapt_model::Source;
    ///
    /// let file = "loop.period = \"1 ms\" # the clock\n[device]\ninertia = \"6.4e-4 kg m^2\"\n";
    /// let text = Source::from_text("free.toml", file).edited(&["loop.period=2 ms".into(), "device.damping=1e-3".into()])?;
    /// assert_eq!(text, "loop.period = \"2 ms\" # the clock\n[device]\ndamping = 1e-3\ninertia = \"6.4e-4 kg m^2\"\n");
    /// # Ok::<(), hapt_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`World::read`].
    pub fn edited(&self, sets: &[String]) -> Result<String, Error> {
        let world = World::read(self, sets)?;
        let mut edited = self.clone();
        for set in sets {
            let Some(text) = edit(&edited, set) else { return Ok(world.to_toml()) };
            edited.text = text;
        }
        // This detects changes that an edit by spans cannot express.
        let is_same = World::read(&edited, &[]).is_ok_and(|read| read == world);
        Ok(if is_same { edited.text } else { world.to_toml() })
    }
}

/// The file's text with one override; `None`: it has no place there.
fn edit(source: &Source, set: &str) -> Option<String> {
    let document = Document::parse(source, "").ok()?;
    let Override { names, value } = Override::split(set)?;
    let (name, above) = names.split_last()?;
    let file = &source.text;
    let (mut node, mut header) = (&document.root, String::new());
    for (depth, step) in above.iter().enumerate() {
        let next = match &node.value {
            Value::Table(entries) => entries.iter().find(|entry| entry.key == *step).map(|entry| &entry.node),
            Value::Array(items) => items.get(step.parse::<usize>().ok()?),
            _ => None,
        };
        header = if header.is_empty() { step.to_string() } else { format!("{header}.{step}") };
        match next {
            Some(next) => node = next,
            // A table that is absent goes to the end.
            None if depth == 0 && above.len() == 1 && keys::named_by_the_user(step).is_none() => {
                return Some(format!("{}\n[{header}]\n{name} = {}\n", ended(file), literal(value)));
            }
            None => return None,
        }
    }
    match &node.value {
        Value::Table(entries) => match entries.iter().find(|entry| entry.key == *name) {
            Some(entry) => replaced(file, &entry.node, value),
            None => inserted(file, node, &names.join("."), name, value),
        },
        // Another coupling.
        Value::Array(items) if items.len().to_string() == *name => {
            let DeValue::Table(table) = DeValue::parse(value).ok()?.into_inner() else { return None };
            let mut lines: Vec<_> = table.iter().map(|(key, item)| (key.get_ref(), item.span())).collect();
            lines.sort_by_key(|(_, span)| span.start);
            let line =
                |(key, span): (_, std::ops::Range<usize>)| format!("{key} = {}\n", value.get(span).unwrap_or_default());
            Some(format!("{}\n[[{header}]]\n{}", ended(file), lines.into_iter().map(line).collect::<String>()))
        }
        _ => None,
    }
}

/// The text with its last line ended.
fn ended(file: &str) -> String {
    if file.is_empty() || file.ends_with('\n') { file.to_string() } else { format!("{file}\n") }
}

/// A value as in a file: numbers and tables unchanged, all else as text.
fn literal(value: &str) -> String {
    match DeValue::parse(value) {
        Ok(parsed) if parsed.span() == (0..value.len()) => value.to_string(),
        _ => text(value),
    }
}

/// Replaces a value; a number without a tolerance keeps the present one.
fn replaced(file: &str, node: &Node, value: &str) -> Option<String> {
    let span = node.place.span.clone();
    let kept = match &node.value {
        Value::Text(before) if split_tolerance(value).is_none() => split_tolerance(before).map(|(_, width)| width),
        Value::Table(_) => return None,
        _ => None,
    };
    let value = kept.map_or_else(|| literal(value), |width| text(&format!("{value} ± {width}")));
    Some(format!("{}{value}{}", file.get(..span.start)?, file.get(span.end..)?))
}

/// Adds a key that its table does not have.
fn inserted(file: &str, table: &Node, path: &str, name: &str, value: &str) -> Option<String> {
    let span = table.place.span.clone();
    let (here, value) = (file.get(span.clone())?, literal(value));
    if here.starts_with('[') {
        let line = span.start + file.get(span.start..)?.find('\n').map_or(file.len() - span.start, |end| end + 1);
        return Some(format!("{}{name} = {value}\n{}", ended(file.get(..line)?), file.get(line..)?));
    }
    if here.starts_with('{') && here.ends_with('}') {
        let inside = here.get(1..here.len() - 1)?.trim_end();
        let comma = if inside.trim().is_empty() || inside.ends_with(',') { "" } else { "," };
        return Some(format!(
            "{}{{{inside}{comma} {name} = {value} }}{}",
            file.get(..span.start)?,
            file.get(span.end..)?
        ));
    }
    // The table has only keys with points at the top of the file.
    let top = path.split('.').count() == 2 && !path.starts_with("couplings");
    top.then(|| format!("{path} = {value}\n{file}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "# the notes' wheel\ntitle = \"wheel\"\nloop.period = \"1 ms\"  # sampled\n\n[device]\ninertia = \"6.4e-4 kg m^2\"\n\
                        damping = \"1.2e-3 N m s/rad ± 20 %\" # measured\n\n[bodies.wheel]\ninertia = \"0.02 kg m^2\"\n\n[[couplings]]\nkind = \"spring\"\n\
                        between = [\"puck\", \"wheel\"]\nstiffness = \"17 N mm/deg\" # k\n";

    fn edited(file: &str, sets: &[&str]) -> String {
        let source = Source::from_text("w.toml", file);
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        let text = source.edited(&sets).unwrap();
        let anew = World::read(&Source::from_text("w.toml", text.clone()), &[]).unwrap();
        assert_eq!(anew, World::read(&source, &sets).unwrap(), "{text}");
        text
    }

    #[test]
    fn a_changed_value_stands_in_its_place_and_comments_stay() {
        let text = edited(FILE, &["couplings.0.stiffness=20 N mm/deg", "loop.period=2 ms", "loop.period=3 ms"]);
        assert_eq!(text, FILE.replace("17 N mm/deg", "20 N mm/deg").replace("\"1 ms\"", "\"3 ms\""));
        assert_eq!(edited(FILE, &[]), FILE);
    }

    #[test]
    fn a_tolerance_stays_with_its_number() {
        let text = edited(FILE, &["device.damping=2e-3 N m s/rad"]);
        assert!(text.contains("damping = \"2e-3 N m s/rad ± 20 %\" # measured"), "{text}");
    }

    #[test]
    fn a_key_that_the_file_omits_is_added_to_its_table() {
        for (set, line) in [
            ("loop.method=zoh", "loop.method = \"zoh\"\n# the notes'"),
            ("device.limit=0.5 N m", "[device]\nlimit = \"0.5 N m\"\n"),
            ("couplings.0.rest=3 deg", "[[couplings]]\nrest = \"3 deg\"\n"),
            ("safety.fade=0.2 s", "\n[safety]\nfade = \"0.2 s\"\n"),
        ] {
            let text = edited(FILE, &[set]);
            assert!(text.contains(line) && text.contains("# measured"), "{text}");
        }
        let inline = "loop = { period = \"1 ms\" } # here\ndevice = { inertia = 1e-3, }\n";
        let text = edited(inline, &["loop.method=zoh"]);
        assert!(text.contains("{ period = \"1 ms\", method = \"zoh\" } # here"), "{text}");
    }

    #[test]
    fn another_coupling_is_added_behind_the_last() {
        let set = "couplings.1={ kind = \"damper\", between = [\"wheel\", \"ground\"], damping = \"1e-3 N m s/rad\" }";
        let text = edited(FILE, &[set, "couplings.1.damping=2e-3 N m s/rad"]);
        assert!(
            text.ends_with(
                "\n[[couplings]]\nkind = \"damper\"\nbetween = [\"wheel\", \"ground\"]\ndamping = \"2e-3 N m s/rad\"\n"
            ),
            "{text}"
        );
        let none = "loop.period = 1e-3\ndevice.inertia = 1e-3\nbodies.wheel.inertia = 1\n";
        edited(none, &[&set.replace("couplings.1", "couplings.0")]);
    }

    #[test]
    fn what_has_no_place_is_written_anew() {
        // A table behind a name of its own, which no edit of a span reaches.
        let text = edited(
            "device.inertia = 1e-3\n\"loop\".period = 1e-3\nbodies = { a.inertia = 1 }\n",
            &["bodies.a.inertia=2", "loop.method=rk4"],
        );
        assert!(text.contains("rk4"), "{text}");
    }
}
