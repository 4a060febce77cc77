//! Warnings about bare numbers that no usual device has.

use std::fs;
use std::path::{Path, PathBuf};

use hapt_model::keys::KEYS;
use hapt_model::{Source, System, World, is_network, parameters};

/// All TOML files of these folders.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "toml") {
            found.push(path);
        }
    }
}

/// The repository's worlds and networks.
fn all() -> Vec<Source> {
    let (root, mut found) = (Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")), Vec::new());
    for folder in ["worlds", "networks", "bench/worlds", "docs/course", "web/test/worlds"] {
        files(&root.join(folder), &mut found);
    }
    // The course's folders have questions too.
    let read = |path: &PathBuf| Source::open(path).ok().filter(|source| System::read(source, &[]).is_ok());
    let sources: Vec<Source> = found.iter().filter_map(read).collect();
    assert!(sources.len() > 60, "{} worlds", sources.len());
    sources
}

/// The usual sizes of the key at a path, whose quantity has this unit.
fn usual(path: &str, unit: &str, world: &World) -> Option<(f64, f64)> {
    let is_same = |pattern: &str| {
        let (a, b): (Vec<_>, Vec<_>) = (pattern.split('.').collect(), path.split('.').collect());
        a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| *a == "*" || a == b)
    };
    let rows = KEYS.iter().filter(|key| is_same(key.path) && key.motion.is_none_or(|only| only == world.motion));
    let mut rows = rows.filter(|key| {
        key.takes.quantity().is_some_and(|(measure, _)| measure.dimension(world.motion).symbol() == unit)
    });
    rows.find_map(|key| key.usual(world.motion))
}

#[test]
fn no_world_of_the_repository_is_doubted() {
    for source in all() {
        let system = System::read(&source, &[]).unwrap();
        assert_eq!(system.warnings(&source, &[]), Vec::<String>::new(), "{}", source.name);
    }
}

/// For every quantity of every world: a hundred times beyond the usual range, a bare number gives a warning, and one with a unit never
/// does.
#[test]
fn a_bare_number_far_from_what_is_usual_is_doubted_and_one_with_a_unit_is_not() {
    let mut doubted = 0;
    for source in all().into_iter().filter(|source| !is_network(source)).step_by(4) {
        let world = World::read(&source, &[]).unwrap();
        for parameter in parameters(&source, &[]).unwrap().into_iter().filter(|p| p.given && p.si.is_some()) {
            let Some((least, largest)) = usual(&parameter.path, &parameter.unit, &world) else { continue };
            for number in [1e2 * largest, 1e-2 * least].into_iter().filter(|number| *number > 0.0) {
                let read = |value: String| {
                    let sets = [format!("{}={value}", parameter.path)];
                    World::read(&source, &sets).ok().map(|world| world.warnings(&source, &sets))
                };
                // Other keys may not allow it: the number of samples of a scenario is bounded.
                let Some(bare) = read(format!("{number:e}")) else { continue };
                assert!(bare.len() == 1 && bare[0].starts_with(&format!("{} = ", parameter.path)), "{number} {bare:?}");
                assert_eq!(read(format!("{number:e} {}", parameter.unit)), Some(vec![]), "{}", parameter.path);
                doubted += 1;
            }
        }
    }
    assert!(doubted > 100, "{doubted}");
}

#[test]
fn a_doubt_names_the_unit_that_was_probably_meant() {
    let text = "[loop]\nperiod = \"1 ms\"\n[device]\ninertia = \"1e-4 kg m^2\"\n[[couplings]]\nkind = \"detent\"\n\
                between = [\"puck\", \"ground\"]\ntorque = \"5 N mm\"\npitch = \"15 deg\"\n";
    let source = Source::from_text("knob.toml", text);
    let warnings = |set: &str| {
        let sets = [set.to_string()];
        World::read(&source, &sets).unwrap().warnings(&source, &sets)
    };
    for (set, warning) in [
        (
            "loop.period=2",
            "loop.period = 2 is 2 s; usual values are 10 us to 100 ms. Was 2 ms meant? Write loop.period = \"2 ms\"",
        ),
        (
            "couplings.0.pitch=15",
            "couplings.0.pitch = 15 is 15 rad; usual values are at most 13 rad. Was 15 deg meant? Write couplings.0.pitch = \"15 deg\"",
        ),
        (
            "device.inertia=640",
            "device.inertia = 640 is 640 kg m^2; usual values are 0.01 g cm^2 to 10 kg m^2. Was 640 g cm^2 meant? Write device.inertia = \"640 g cm^2\"",
        ),
        (
            "couplings.0.torque=8500",
            "couplings.0.torque = 8500 is 8500 N m; usual values are 0.001 N mm to 100 N m. Was 8500 N mm meant? Write couplings.0.torque = \"8500 N mm\"",
        ),
        (
            "loop.period=1e-7",
            "loop.period = 1e-7 is 1e-7 s; usual values are 10 us to 100 ms. Write it with its unit, such as loop.period = \"1 ms\"",
        ),
    ] {
        assert_eq!(warnings(set), [warning]);
    }
    for set in [
        "loop.period=0.002",
        "loop.period=0.45",
        "loop.period=2 s",
        "loop.delay=0",
        "couplings.0.pitch=0.26",
        "loop.delay=150 samples",
    ] {
        assert_eq!(warnings(set), Vec::<String>::new(), "{set}");
    }
}
