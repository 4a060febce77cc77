//! What the tests of this crate share.

/// A wheel on a spring.
pub const WHEEL: &str = r#"title = "wheel"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
limit = "822.25 N mm"
[bodies.wheel]
inertia = "0.02580123 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "17.8 N mm/deg"
[scenarios.step]
duration = "0.5 s"
hand = { kind = "step", to = "45 deg" }
"#;
