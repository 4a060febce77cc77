//! The files of an Arduino library in addition to the C file and its header.

use hapt_core::{Estimator, Spec};

use crate::About;
use crate::compose::units;
use crate::names::{Prefix, comment};
use crate::template::Facts;

/// The sketch that makes a SimpleFOC board a motor drive of a loop on a computer: the same for every world.
pub const DRIVE_SKETCH: &str = include_str!("parts/arduino/simplefoc_drive.ino");

/// The other files of an Arduino library, each with its place in the library's folder: its description, and examples for SimpleFOC with the
/// loop on the board and on a computer, for an H-bridge, and for Hapkit.
pub fn library(about: &About, prefix: &Prefix, spec: &Spec) -> [(String, String); 5] {
    let mut facts = Facts::default();
    facts.set("exact", spec.estimator == Estimator::Exact);
    facts.text("prefix", prefix.as_str());
    facts.text("title", comment(&about.title));
    facts.text("arm", if about.is_certified { "arm" } else { "arm_uncertified" });
    facts.text("period_us", (1e6 * spec.period).round());
    // A turn of 4096 counts, where the world has no encoder.
    facts.text("count", format!("{:?}", spec.count.unwrap_or(core::f64::consts::TAU / 4096.0)));
    units(&mut facts, about.is_linear);
    let fill = |part: &str| prefix.rename(&facts.fill(part));
    [
        ("library.properties".to_owned(), fill(include_str!("parts/arduino/library.properties"))),
        ("examples/h_bridge/h_bridge.ino".to_owned(), fill(include_str!("parts/arduino/h_bridge.ino"))),
        ("examples/hapkit/hapkit.ino".to_owned(), fill(include_str!("parts/arduino/hapkit.ino"))),
        ("examples/simplefoc/simplefoc.ino".to_owned(), fill(include_str!("parts/arduino/simplefoc.ino"))),
        ("examples/simplefoc_drive/simplefoc_drive.ino".to_owned(), DRIVE_SKETCH.to_owned()),
    ]
}
