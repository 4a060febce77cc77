//! The common functions of the tests of pictures.

use crate::figure::{Axis, Figure, Panel, Style};

/// A curve in a panel under this title.
pub fn figure(title: &str) -> Figure {
    let mut panel = Panel::new("", Axis::from_to("time", "s", 0.0, 1.0), Axis::from_to("torque", "N mm", -1.0, 1.0));
    panel.curve("asked for", Style::Signal(0), vec![(0.0, -0.9), (1.0, 0.9)]);
    Figure { title: title.into(), alt: String::new(), panels: vec![panel], columns: 1 }
}
