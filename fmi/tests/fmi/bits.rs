//! Steps of whole periods are bit-identical to a run.

use hapt_fmi::{Kind, Version};
use hapt_model::{World, builtin};
use hapt_sim::{BODY_SIGNALS, Row, SIGNALS, Simulation};

use crate::fmu::{Fmu, WHEEL, world};

const VERSIONS: [Version; 2] = [Version::Two, Version::Three];

fn rows(world: &World, scenario: &str) -> Vec<Row> {
    let mut run = Simulation::new(world, world.scenario(scenario).unwrap()).unwrap();
    let mut rows = Vec::new();
    while let Some(row) = run.next() {
        rows.push(row.unwrap().clone());
    }
    rows
}

/// The columns after time.
fn columns(row: &Row) -> Vec<f64> {
    let own = SIGNALS[1..].iter().map(|signal| (signal.get)(row));
    own.chain(row.pairs().flat_map(|(position, velocity)| [position, velocity])).collect()
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn the_loop_on_its_device_under_a_hands_torque_is_the_run_of_that_hand() {
    for sets in [
        &[][..],
        &["loop.delay=0 ms"],
        &["loop.delay=2.5 samples", "device.friction=0"],
        &["loop.method=tustin", "loop.output=start", "couplings.1.damping=0"],
        &["device.handle.inertia=2e-4", "device.handle.stiffness=20"],
    ] {
        let world = world(WHEEL, sets);
        let fmu = Fmu::new(Kind::Whole, &world);
        let expected = rows(&world, "push");
        for version in VERSIONS {
            let instance = fmu.instance(version);
            instance.start(0.0);
            for (k, row) in expected.iter().enumerate() {
                assert_eq!(bits(&instance.outputs()), bits(&columns(row)), "{version:?} {sets:?} row {k}");
                instance.set("hand_torque_Nm", if k < 200 { 0.06 } else { 0.0 });
                assert!(instance.step(k as f64 * 1e-3, 1e-3), "{}", instance.message());
            }
        }
    }
}

/// A loop without its device, with the puck of a run as input, gives the run's torque in each step that begins with a sample.
#[test]
fn every_builtin_worlds_loop_fed_with_a_runs_puck_is_that_run() {
    let mut seen = 0;
    for name in builtin::names() {
        let world = World::read(&builtin::source(&name).unwrap(), &[]).unwrap();
        let Some(scenario) = world.scenarios.first() else { continue };
        let fmu = Fmu::new(Kind::Loop, &world);
        let inputs = [1, 2];
        let instance = fmu.instance(VERSIONS[seen % 2]);
        instance.start(0.0);
        let period = world.sampling.period;
        for (k, row) in rows(&world, &scenario.name).iter().enumerate().take(1000) {
            assert!(instance.set_all(&inputs, &[row.puck, row.puck_velocity]));
            let ahead = instance.outputs();
            assert!(instance.step(k as f64 * period, period), "{}", instance.message());
            let mut all = columns(row);
            all.drain(..2);
            all.remove(4);
            assert_eq!(all.len(), 4 + BODY_SIGNALS.len() * world.bodies.len());
            assert_eq!(bits(&instance.outputs()), bits(&all), "{name} row {k}");
            assert_eq!(bits(&ahead), bits(&all), "{name} row {k}, before its step");
        }
        seen += 1;
    }
    assert!(seen >= 10, "{seen} worlds");
}

/// Times are not summed: a million samples later an instant is still the product of sample and period.
#[test]
fn an_importer_that_adds_up_its_steps_gets_every_sample_once() {
    let world = world(WHEEL, &["loop.period=0.1 ms", "loop.delay=0 ms"]);
    let fmu = Fmu::new(Kind::Loop, &world);
    let [added, counted] = [fmu.instance(Version::Two), fmu.instance(Version::Three)];
    added.start(0.0);
    counted.start(0.0);
    let mut time = 0.0;
    for k in 0..200_000_u64 {
        let puck = [(k as f64 * 1e-4).sin(), 0.0];
        for instance in [&added, &counted] {
            assert!(instance.set_all(&[1, 2], &puck));
        }
        assert!(added.step(time, 1e-4), "{}", added.message());
        assert!(counted.step(k as f64 * 1e-4, 1e-4), "{}", counted.message());
        time += 1e-4;
        assert_eq!(added.get("torque_Nm").to_bits(), counted.get("torque_Nm").to_bits(), "step {k}");
    }
    assert!(time != 20.0);
}
