//! Overrides, one a line.

use hapt_model::{Source, World};

use crate::messages;

/// The overrides of a world with a row of every sort; and of a bare file, where they add tables.
pub fn run(bytes: &[u8]) -> u64 {
    let text = String::from_utf8_lossy(bytes);
    let sets: Vec<String> = text.split('\n').map(str::to_string).collect();
    let read = |file: &str| match World::read(&Source::from_text("w.toml", file), &sets) {
        Err(error) => messages::judged(&error),
        Ok(world) => {
            messages::outcome(&(world.sampling.method as u8, world.couplings.len(), world.device.levels.is_some()))
        }
    };
    read(EVERYTHING).wrapping_mul(31) ^ read("")
}

/// A world with a row of every sort.
pub const EVERYTHING: &str = r#"title = "everything"
motion = "rotary"
[loop]
period = "1 ms"
method = "rk4"
output = "end"
advance = 2
estimator = "low-pass"
cutoff = "50 Hz"
window = 8
delay = "0.5 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
friction = "5 N mm"
friction_backward = "4 N mm"
limit = "0.8 N m"
encoder = 4000
levels = 2048
[device.stops]
low = "-60 deg"
high = "60 deg"
stiffness = "30 N m/rad"
damping = "0.01 N m s/rad"
[device.friction_by_position]
share = 0.2
pitch = "1 rev"
phase = "5 deg"
cosine = [1.0, 0.5]
[device.stribeck]
torque = "1 N mm"
velocity = "1 rad/s"
[bodies.wheel]
inertia = "0.4503 N mm/(deg/s^2)"
position = "1 deg"
velocity = "2 rpm"
[bodies.tail]
inertia = "12 g cm^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "17.7778 N mm/deg"
rest = "-1°"
[[couplings]]
kind = "damper"
between = ["wheel", "puck"]
damping = "compensating"
[[couplings]]
kind = "wall"
between = ["wheel", "ground"]
side = "below"
at = "-10 deg"
stiffness = 10
damping = 0.1
[[couplings]]
kind = "detent"
between = ["puck", "ground"]
pitch = "15 deg"
torque = "8 N mm"
phase = "1 deg"
[[couplings]]
kind = "friction"
between = ["tail", "wheel"]
coulomb = 0.1
stribeck = 0.2
stribeck_velocity = "0.1 rad/s"
bristle_stiffness = 100
bristle_damping = 1
viscous = 0
[[couplings]]
kind = "friction"
between = ["puck", "ground"]
torque = "1 mN m"
[[couplings]]
kind = "constant"
between = ["tail", "ground"]
torque = -1e-3
[scenarios.turn]
duration = "0.1 s"
hand = { kind = "sine", amplitude = "5 deg", frequency = "1 Hz", phase = "90 deg", release = "0.05 s" }
[scenarios.lead]
duration = "0.1 s"
hand = { kind = "grip", inertia = 1e-3, damping = 0.1, stiffness = 3, moves = { kind = "ramp", to = "5 deg", at = 0.01, over = "0.05 s" } }
[scenarios.push]
duration = 1
hand = { kind = "torque", moves = { kind = "step", to = "1 N cm", at = "2 us" } }
"#;
