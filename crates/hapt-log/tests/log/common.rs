//! Random worlds, and their logs.

use hapt_log::{Header, Log, LogWriter, Origin};
use hapt_model::{Source, World};
use hapt_sim::{Row, Simulation};
use proptest::prelude::*;

/// The notes' wheel, a step and a release.
pub const WHEEL: &str = r#"
loop.period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
limit = "822.25 N mm"
[bodies.wheel]
inertia = "0.02580123 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "1.018592 N m/rad"
[scenarios.step]
duration = "0.05 s"
hand = { kind = "step", to = "45 deg", release = "0.02 s" }
"#;

pub fn world(text: &str) -> World {
    World::read(&Source::from_text("w.toml", text), &[]).unwrap()
}

pub fn header(text: &str) -> Header {
    Header { world_text: text.into(), device: "sim".into(), ..Header::default() }
}

/// Every row of a world's first scenario.
pub fn rows(world: &World) -> Vec<Row> {
    let mut run = Simulation::new(world, &world.scenarios[0]).unwrap();
    let mut rows = Vec::new();
    // A run may diverge: its rows end there.
    while let Some(Ok(row)) = run.next() {
        rows.push(row.clone());
    }
    rows
}

/// The log of these rows.
pub fn logged(text: &str, rows: &[Row]) -> Vec<u8> {
    let mut writer = LogWriter::new(Vec::new(), &world(text), &header(text), Origin::Run).unwrap();
    for row in rows {
        writer.write_row(row).unwrap();
    }
    writer.finish().unwrap()
}

/// The bits of all values of all samples of a log, as far as it can be read.
pub fn bits(log: &mut Log<&[u8]>) -> Vec<Vec<u64>> {
    let mut all = Vec::new();
    while let Some(sample) = log.next().unwrap() {
        all.push(sample.values.iter().map(|x| x.to_bits()).collect());
    }
    all
}

/// Worlds with one to three bodies in a row from the puck: springs, dampers, a wall, detents and friction; every estimator and output;
/// counts, levels and a delay; a hand that steps, oscillates, pushes or grips.
pub fn worlds() -> impl Strategy<Value = String> {
    let sampling = (
        prop::sample::select(vec!["zoh", "trapezoidal", "rk4", "tustin", "foh", "semi-implicit-euler"]),
        prop::sample::select(vec!["exact", "difference", "low-pass", "foaw", "foaw-best", "kalman", "levant"]),
        prop::sample::select(vec!["0.5 ms", "1 ms", "3 ms"]),
        prop::sample::select(vec!["0 ms", "0.3 ms", "1 ms"]),
        prop::sample::select(vec![1, 1, 4]),
    );
    let device = (any::<bool>(), any::<bool>(), any::<bool>(), 0.1f64..5.0, any::<bool>());
    let bodies = prop::collection::vec((1e-3f64..0.1, 0.1f64..5.0, 0.0f64..0.01, -1.0f64..1.0), 0..3);
    let hand = prop::sample::select(vec![
        r#"{ kind = "step", to = "45 deg", at = "10 ms" }"#,
        r#"{ kind = "sine", amplitude = "30 deg", frequency = "3 Hz", release = "50 ms" }"#,
        r#"{ kind = "torque", moves = { kind = "ramp", to = "0.2 N m", over = "30 ms" } }"#,
        r#"{ kind = "grip", stiffness = "3 N m/rad", damping = "0.01 N m s/rad", moves = { kind = "step", to = "20 deg" } }"#,
    ]);
    let laws = prop::collection::vec(0usize..5, 0..3);
    (sampling, device, bodies, laws, hand).prop_map(|(sampling, device, bodies, laws, hand)| {
        let (method, estimator, period, delay, every) = sampling;
        let every = if bodies.is_empty() || ["tustin", "foh"].contains(&method) { 1 } else { every };
        let (encoder, levels, friction, limit, handle) = device;
        let mut text = format!(
            "loop = {{ period = \"{period}\", method = \"{method}\", estimator = \"{estimator}\", cutoff = \"50 Hz\", acceleration = 1e3, delay = \"{delay}\", bodies_every = {every} }}\n\
             [device]\ninertia = \"6.4e-4 kg m^2\"\ndamping = \"1e-3 N m s/rad\"\nlimit = {limit:?}\n"
        );
        text += if encoder { "encoder = 4000\n" } else { "" };
        text += if levels { "levels = 2048\n" } else { "" };
        text += if friction { "friction = \"5 N mm\"\n" } else { "" };
        text += if handle { "handle = { inertia = 3e-4, stiffness = 20, damping = 1e-3 }\n" } else { "" };
        for (i, (inertia, _, _, velocity)) in bodies.iter().enumerate() {
            text += &format!("[bodies.b{i}-x]\ninertia = {inertia:?}\nvelocity = {velocity:?}\n");
        }
        let mut before = "puck".to_string();
        for (i, (_, stiffness, damping, _)) in bodies.iter().enumerate() {
            let between = format!("between = [\"{before}\", \"b{i}-x\"]");
            text += &format!("[[couplings]]\nkind = \"spring\"\n{between}\nstiffness = {stiffness:?}\n");
            text += &format!("[[couplings]]\nkind = \"damper\"\n{between}\ndamping = {damping:?}\n");
            before = format!("b{i}-x");
        }
        for law in laws {
            text += "[[couplings]]\nbetween = [\"puck\", \"ground\"]\n";
            text += [
                "kind = \"wall\"\nside = \"above\"\nat = \"10 deg\"\nstiffness = 8\ndamping = 1e-3\n",
                "kind = \"detent\"\ntorque = \"20 N mm\"\npitch = \"15 deg\"\n",
                "kind = \"friction\"\ntorque = \"10 N mm\"\n",
                "kind = \"constant\"\ntorque = \"10 N mm\"\n",
                "kind = \"friction\"\ncoulomb = 0.01\nstribeck = 0.015\nstribeck_velocity = 0.1\nbristle_stiffness = 5\nbristle_damping = 0.01\nviscous = 0.001\n",
            ][law];
        }
        text + &format!("[scenarios.test]\nduration = \"0.15 s\"\nhand = {hand}\n")
    })
}
