//! Worlds that need no file.

/// The notes' wheel under four loops: name for people, and world file.
pub const WHEELS: [(&str, &str); 4] = [
    ("forward Euler", include_str!("../../../worlds/notes/euler.toml")),
    ("forward Euler, b = Tk", include_str!("../../../worlds/notes/damped.toml")),
    ("trapezoidal", include_str!("../../../worlds/notes/trapezoidal.toml")),
    ("hapt's default (zoh)", include_str!("../../../worlds/notes/default.toml")),
];
