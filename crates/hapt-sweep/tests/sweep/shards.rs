//! A table of any kind of world is bit-identical in one piece and in parts: for shards, and for continuation after an interruption.

use hapt_model::Source;
use hapt_sweep::{Measure, Rows, Sweep};
use hapt_testing::prelude::*;

const BASE: &str = r#"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
limit = "0.8 N m"
[bodies.wheel]
inertia = 0.0258
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = 0.8
[scenarios.go]
duration = 0.1
hand = { kind = "step", to = 0.5, at = 0.01, release = 0.04 }
"#;

/// The overrides of each kind of world in addition to the base, and the lines at its end.
const KINDS: [(&str, &[&str], &str); 13] = [
    ("linear", &[], ""),
    ("delays", &["loop.delay=0.37 ms", "scenarios.go.hand.release=0.0403"], ""),
    (
        "three bodies",
        &[],
        "[bodies.nut]\ninertia = 0.01\n[bodies.cap]\ninertia = 0.02\nposition = 0.1\n\
        [[couplings]]\nkind = \"spring\"\nbetween = [\"wheel\", \"nut\"]\nstiffness = 2\n\
        [[couplings]]\nkind = \"damper\"\nbetween = [\"nut\", \"cap\"]\ndamping = 0.01\n",
    ),
    ("counts, levels and dry friction", &["device.encoder=4000", "device.levels=2048", "device.friction=0.005"], ""),
    (
        "wall and detents",
        &["loop.estimator=difference"],
        "[[couplings]]\nkind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nside = \"above\"\nat = 0.3\nstiffness = 2\n\
        [[couplings]]\nkind = \"detent\"\nbetween = [\"puck\", \"ground\"]\ntorque = 0.05\npitch = 0.2\n",
    ),
    (
        "foaw",
        &["loop.estimator=foaw", "device.encoder=4000"],
        "[[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"ground\"]\ndamping = 0.001\n",
    ),
    (
        "friction at a body",
        &[],
        "[[couplings]]\nkind = \"friction\"\nbetween = [\"wheel\", \"ground\"]\ntorque = 0.05\n",
    ),
    (
        "bristles",
        &[],
        "[[couplings]]\nkind = \"friction\"\nbetween = [\"puck\", \"ground\"]\ncoulomb = 0.01\nstribeck = 0.012\n\
        stribeck_velocity = 0.1\nbristle_stiffness = 3\nbristle_damping = 0.001\nviscous = 0.001\n",
    ),
    (
        "a clamped spring",
        &[],
        "[[couplings]]\nkind = \"spring\"\nbetween = [\"wheel\", \"ground\"]\nstiffness = 4\nlimit = 0.2\n",
    ),
    ("lag", &["device.lag=0.3 ms"], ""),
    (
        "uneven time",
        &[
            "loop.interval_max=2.5 ms",
            "loop.delay_max=0.5 ms",
            "scenarios.go.timing.kind=random",
            "scenarios.go.timing.seed=7",
        ],
        "",
    ),
    ("a handle", &["device.handle.inertia=2e-4", "device.handle.stiffness=30", "device.handle.damping=1e-3"], ""),
    (
        "a grip",
        &[
            "scenarios.go.hand.kind=grip",
            "scenarios.go.hand.inertia=1e-3",
            "scenarios.go.hand.damping=0.01",
            "scenarios.go.hand.stiffness=2",
            "scenarios.go.hand.moves.kind=sine",
            "scenarios.go.hand.moves.amplitude=0.3",
            "scenarios.go.hand.moves.frequency=4",
        ],
        "",
    ),
];

const AXES: [&str; 6] = [
    "couplings.0.stiffness=0.1..1e6:9:log",
    "bodies.wheel.inertia=0.001..0.1:7",
    "device.damping=0..0.01:5",
    "device.inertia=1e-4..1e-3:17:log",
    "loop.period=0.5ms..2ms:6",
    "scenarios.go.hand.release=0.005..0.12:8",
];
const MEASURES: [Measure; 5] =
    [Measure::PeakTorque, Measure::FinalEnergy, Measure::SettlingTime, Measure::HeldGrowth, Measure::Certified];

fn bits(rows: &Rows) -> Vec<Option<u64>> {
    rows.iter().flatten().map(|x| x.map(f64::to_bits)).collect()
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    #[test]
    fn a_table_of_any_kind_of_world_is_the_same_in_parts(
        kind in 0..KINDS.len(),
        slow in 0..AXES.len(),
        fast in 0..AXES.len(),
        cuts in prop::array::uniform3(0.0..1.0f64),
    ) {
        prop_assume!(slow != fast);
        let (name, sets, lines) = KINDS[kind];
        // A prescribed step has no keys of a grip, and a grip none of a step.
        let base = if name == "a grip" { BASE.replace(r#"kind = "step", to = 0.5, at = 0.01, "#, "") } else { BASE.into() };
        let source = Source::from_text("w.toml", format!("{base}{lines}"));
        let sets: Vec<String> = sets.iter().map(|set| set.to_string()).collect();
        let axes = [AXES[slow], AXES[fast]].map(String::from);
        let sweep = Sweep::new(&source, &sets, &axes, &MEASURES, None)
            .map_err(|error| TestCaseError::fail(format!("{name}: {error}")))?;
        let all = sweep.cells();
        let mut ends = cuts.map(|cut| (cut * all as f64) as u64).to_vec();
        ends.extend([0, all]);
        ends.sort_unstable();
        let parts: Vec<_> = ends.windows(2).flat_map(|ends| bits(&sweep.rows(ends[0]..ends[1]))).collect();
        prop_assert_eq!(parts, bits(&sweep.rows(0..all)), "{}", name);
    }
}
