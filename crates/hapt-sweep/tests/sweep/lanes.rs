//! The table is bit-identical with and without lanes and values kept from cell to cell.

use hapt_analysis::check;
use hapt_model::keys::Takes;
use hapt_model::{Device, Scenario, Source, World, parameters};
use hapt_sim::{Simulation, Summary};
use hapt_sweep::{Measure, Sweep};
use hapt_testing::prelude::*;

/// Two wheels and a released puck; with a wall no lane can run it.
const WHEELS: &str = r#"
[loop]
period = "1 ms"
estimator = "low-pass"
cutoff = "60 Hz"
delay = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
encoder = 4000
limit = "0.8 N m"
levels = 2048
[bodies.wheel]
inertia = 0.0258
[bodies.nut]
inertia = 0.01
position = 0.1
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = 0.8
[[couplings]]
kind = "damper"
between = ["wheel", "nut"]
damping = 0.002
[[couplings]]
kind = "spring"
between = ["nut", "ground"]
stiffness = 0.3
[[couplings]]
kind = "wall"
between = ["puck", "ground"]
side = "above"
at = 0.3
stiffness = 0
[scenarios.go]
duration = 0.12
hand = { kind = "step", to = 0.5, at = 0.01, release = 0.04 }
"#;

/// The same without the wall, which lanes can run.
fn without_wall() -> String {
    let (before, rest) = WHEELS.split_once("[[couplings]]\nkind = \"wall\"").unwrap();
    before.to_string() + &rest[rest.find("[scenarios").unwrap()..]
}

fn single(world: &World, scenario: &Scenario) -> [Option<f64>; 2] {
    let mut run = Simulation::new(world, scenario).unwrap();
    let mut summary = Summary::new(world, &run);
    while let Some(row) = run.next() {
        match row {
            Ok(row) => summary.add(row),
            Err(_) => return [None; 2],
        }
    }
    [summary.peak_torque, summary.final_energy()].map(|x| Some(x).filter(|x| x.is_finite()))
}

fn bits(row: &[Option<f64>]) -> Vec<Option<u64>> {
    row.iter().map(|x| x.map(f64::to_bits)).collect()
}

const AXES: [&str; 12] = [
    "couplings.0.stiffness=0.1..1e9:7:log",
    "couplings.1.damping=0..0.01:5",
    "bodies.wheel.inertia=0.001..0.1:6",
    "bodies.nut.velocity=-1..1:4",
    "device.damping=0..0.01:5",
    "device.inertia=1e-4..1e-3:9:log",
    "device.encoder=500..8000:3",
    "loop.cutoff=10..100:8",
    "loop.period=0.5ms..2ms:4",
    "loop.delay=0..4ms:5",
    "scenarios.go.hand.release=0..0.2:11",
    "scenarios.go.duration=0.01..0.2:6",
];

/// A device whose torques the loop compensates, for the end of a file with friction.
const COMPENSATED: &str = r#"
    [device.gravity]
    torque = 0.1
    [device.cogging]
    torque = 0.01
    pitch = 0.3
    sine = [1]
    [[compensation]]
    of = "gravity"
    share = 0.5
    [[compensation]]
    of = "cogging"
    [[compensation]]
    of = "friction"
    share = 0.5
    velocity = 0.2
"#;

proptest! {
    #![proptest_config(hapt_testing::cases(40))]

    #[test]
    fn a_cell_is_its_single_run_whatever_its_neighbours(
        slow in 0..AXES.len(),
        fast in 0..AXES.len(),
        wall in any::<bool>(),
        method in prop::sample::select(vec!["forward-euler", "zoh", "tustin", "trapezoidal"]),
        threads in 1..4usize,
        cut in 0.0..1.0f64,
    ) {
        prop_assume!(slow != fast && !(wall && method == "tustin"));
        let text = if wall { WHEELS.to_string() } else { without_wall() };
        let source = Source::from_text("w.toml", &text);
        let axes = [AXES[slow], AXES[fast]].map(String::from);
        let sets = [format!("loop.method={method}")];
        let sweep = Sweep::new(&source, &sets, &axes, &[Measure::PeakTorque, Measure::FinalEnergy], None).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let middle = (cut * sweep.cells() as f64) as u64;
        let parts = pool.install(|| [sweep.rows(0..middle), sweep.rows(middle..sweep.cells())]);
        prop_assert_eq!(parts.iter().flatten().count() as u64, sweep.cells());
        for row in parts.iter().flatten() {
            let mut world = sweep.system.world().unwrap().clone();
            for (axis, value) in sweep.grid.axes.iter().zip(row) {
                prop_assert!(world.set_number(&axis.key, value.unwrap()));
            }
            prop_assert_eq!(bits(&row[2..]), bits(&single(&world, &world.scenarios[0])), "{:?}", row);
        }
    }
}

/// Every number of a world in turn: a measure that is wrongly assumed to be independent of it would keep its old value.
#[test]
fn a_measure_changes_only_with_the_numbers_that_it_depends_on() {
    // A single wheel has its growths from vector lanes.
    let lone = World::read(&Source::from_text("w.toml", without_wall()), &[]).unwrap();
    let mut lone = World { bodies: lone.bodies[..1].to_vec(), names: lone.names[..1].to_vec(), ..lone };
    lone.couplings.retain(|c| [c.first, c.second].iter().all(|end| end.body() != Some(1)));
    let mut seen = [[0; 2]; 4];
    let compensated = World { device: Device { friction: 0.02, ..lone.device.clone() }, ..lone.clone() };
    for text in [WHEELS.to_string(), lone.to_toml(), compensated.to_toml() + COMPENSATED] {
        each_number_in_turn(&text, &mut seen);
    }
    // Each of the three numbers stays along some axes and changes along others.
    assert!(seen[..3].iter().all(|[same, changed]| *same > 2 && *changed > 2), "{seen:?}");
}

/// Counts for each measure the axes along which it stays and changes.
fn each_number_in_turn(text: &str, seen: &mut [[u32; 2]; 4]) {
    let source = Source::from_text("w.toml", text);
    let measures = [Measure::HeldGrowth, Measure::FreeGrowth, Measure::RequiredDamping, Measure::Certified];
    let base = World::read(&source, &[]).unwrap();
    for parameter in parameters(&source, &[]).unwrap() {
        let Some(key) = base.key(&parameter.path) else { continue };
        let axis = match key.takes {
            Takes::Whole { .. } => format!("{}=4..64:2", parameter.path),
            _ => format!("{}=0.0008..0.0021:2", parameter.path),
        };
        let method = "loop.method=forward-euler".to_string();
        let Ok(sweep) = Sweep::new(&source, &[method], std::slice::from_ref(&axis), &measures, None) else { continue };
        let rows = sweep.rows(0..2);
        for row in &rows {
            let mut world = sweep.system.world().unwrap().clone();
            assert!(world.set_number(&parameter.path, row[0].unwrap()));
            let check = check(&world).unwrap();
            let certified = f64::from(u8::from(check.certified.holds()));
            let fresh =
                [check.held.growth_per_s, check.free.growth_per_s, check.passivity.required_damping, Some(certified)];
            assert_eq!(bits(&row[1..]), bits(&fresh), "{axis}");
        }
        for (i, seen) in seen.iter_mut().enumerate() {
            seen[usize::from(rows[0][1 + i] != rows[1][1 + i])] += 1;
        }
    }
}
