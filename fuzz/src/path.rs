//! A path's CSV file, next to a world that follows it.

use std::path::PathBuf;
use std::sync::LazyLock;

use hapt_model::{Drive, Shape, Source, World};

use crate::messages;

/// A folder that only this process uses, in memory where there is one.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let memory = PathBuf::from("/dev/shm");
    let folder = if memory.is_dir() { memory } else { std::env::temp_dir() };
    let folder = folder.join(format!("hapt-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    folder
});

/// The first byte selects positions or torques, rotary or linear; the others are the file. Times increase, and every
/// number is finite.
pub fn run(bytes: &[u8]) -> u64 {
    let (&first, rest) = bytes.split_first().unwrap_or((&0, &[]));
    let motion = if first & 1 == 0 { "rotary" } else { "linear" };
    let path = "{ kind = \"path\", file = \"p.csv\" }";
    let hand = if first & 2 == 0 { path.to_string() } else { format!("{{ kind = \"torque\", moves = {path} }}") };
    let text = format!(
        "motion = \"{motion}\"\nloop.period = 1\ndevice.inertia = 1\n[scenarios.s]\nduration = 1\nhand = {hand}\n"
    );
    if let Err(error) = std::fs::write(FOLDER.join("p.csv"), rest) {
        panic!("{}: {error}", FOLDER.display());
    }
    let source = Source { folder: FOLDER.clone(), ..Source::from_text("w.toml", text) };
    match World::read(&source, &[]) {
        Err(error) => messages::judged(&error),
        Ok(world) => {
            let Some(Drive::Position(Shape::Path { points, .. }) | Drive::Torque(Shape::Path { points, .. })) =
                world.scenarios.first().map(|scenario| &scenario.hand.drive)
            else {
                panic!("no path was read");
            };
            assert!(!points.is_empty());
            assert!(points.iter().all(|(time, value)| time.is_finite() && value.is_finite()));
            assert!(points.windows(2).all(|pair| pair[0].0 < pair[1].0));
            messages::outcome(&(first & 3, points.len().min(5)))
        }
    }
}
