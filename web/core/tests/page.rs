//! A page runs as the simulation does, and a number that is changed in it is the world with that number.

use hapt_core::{Phase, Request, SafetyProfile};
use hapt_model::{Source, World};
use hapt_plant::Grip;
use hapt_sim::{Simulation, world_energy};
use hapt_web::{COLUMNS, OWN, Page, Setup, Slot};

const WHEEL: &str = r#"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
friction = "1 N mm"
limit = "822.25 N mm"
encoder = 4096
[bodies.wheel]
inertia = "0.02580123 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "17.8 N mm/deg"
limit = "500 N mm"
[[couplings]]
kind = "damper"
between = ["puck", "wheel"]
damping = "1e-3 N m s/rad"
[[couplings]]
kind = "wall"
between = ["wheel", "ground"]
side = "above"
at = "80 deg"
stiffness = "1 N m/rad"
damping = "1e-3 N m s/rad"
[[couplings]]
kind = "detent"
between = ["puck", "ground"]
torque = "20 N mm"
pitch = "15 deg"
[[couplings]]
kind = "friction"
between = ["wheel", "ground"]
torque = "2 N mm"
[[couplings]]
kind = "constant"
between = ["wheel", "ground"]
torque = "1 N mm"
[scenarios.step]
duration = "2 s"
hand = { kind = "step", to = "45 deg", at = "0.3 s", release = "1 s" }
"#;

fn world(sets: &[&str]) -> World {
    let sets: Vec<String> = sets.iter().map(|set| set.to_string()).collect();
    World::read(&Source::from_text("wheel.toml", WHEEL), &sets).unwrap()
}

fn bytes(world: &World) -> (Vec<u8>, Vec<u8>) {
    let setup = Setup {
        device: world.device_spec(),
        limits: world.limits(SafetyProfile::Simulated),
        output: world.sampling.output,
        scenarios: world.scenarios.iter().map(|scenario| (scenario.hand.clone(), scenario.duration)).collect(),
    };
    let mut room = [0; 8192];
    (hapt_wire::write(&world.spec(), &mut room).unwrap().to_vec(), postcard::to_allocvec(&setup).unwrap())
}

fn page(world: &World) -> Box<Page> {
    let (world, setup) = bytes(world);
    Page::new(&world, &setup).unwrap()
}

/// So many samples, each with all of its columns; a hand swings the puck about in the middle of them.
fn run(page: &mut Page, samples: u32) -> Vec<[f64; COLUMNS]> {
    let mut rows = Vec::new();
    // Disarmed, it forgets that its numbers were changed: there is nothing to fade over.
    page.run(1);
    page.ask(Request::Arm);
    for sample in 0..samples {
        if sample == samples / 4 {
            page.hold(Some(Grip { inertia: 1e-3, damping: 0.2, stiffness: 6.0 }));
        }
        if (samples / 4..samples / 2).contains(&sample) {
            page.intend(1.5 * (f64::from(sample) * 5e-3).sin());
        }
        if sample == samples / 2 {
            page.hold(None);
        }
        page.run(1);
        rows.push(page.frame()[0]);
    }
    rows
}

#[test]
fn a_scenario_in_a_page_is_the_simulations_once_it_has_faded_in() {
    // The page's torque fades in over 0.1 s, in which nothing happens here: the step comes at 0.3 s.
    let world = world(&["couplings.5.torque=0 N m"]);
    let mut page = page(&world);
    page.ask(Request::Arm);
    assert!(page.begin(0) && !page.begin(1) && page.is_held());
    let mut simulation = Simulation::new(&world, &world.scenarios[0]).unwrap();
    let mut moved = 0.0_f64;
    while let Some(row) = simulation.next() {
        let row = row.unwrap();
        page.run(1);
        let [last, ..] = *page.frame();
        let energy = world_energy(&world, row.puck, &row.bodies, &row.bristles);
        let own = [row.puck, row.puck_velocity, row.measured, row.measured_velocity, row.torque, row.command];
        assert_eq!(last[..6], own, "at {} s", row.time);
        assert_eq!(last[7..OWN + 2], [energy, row.bodies[0].0, row.bodies[0].1], "at {} s", row.time);
        moved = moved.max(row.bodies[0].0);
    }
    assert!(moved > 0.5 && page.phase() == (Phase::Running, None, page.phase().2));
}

#[test]
fn a_number_changed_in_a_page_is_the_world_with_that_number() {
    let changes: [(Slot, usize, f64, &str); 14] = [
        (Slot::Period, 0, 2e-3, "loop.period=2 ms"),
        (Slot::Method, 0, 3.0, "loop.method=trapezoidal"),
        (Slot::Output, 0, 1.0, "loop.output=middle"),
        (Slot::Delay, 0, 1.5e-3, "loop.delay=1.5 ms"),
        (Slot::Stiffness, 0, 2.0, "couplings.0.stiffness=2 N m/rad"),
        (Slot::Stiffness, 2, 0.5, "couplings.2.stiffness=0.5 N m/rad"),
        (Slot::Damping, 1, 0.0, "couplings.1.damping=0 N m s/rad"),
        (Slot::Damping, 2, 0.25, "couplings.2.damping=0.25 N m s/rad"),
        (Slot::Compensating, 1, 0.0, "couplings.1.damping=compensating"),
        (Slot::Torque, 3, 0.0625, "couplings.3.torque=62.5 N mm"),
        (Slot::Torque, 5, -0.125, "couplings.5.torque=-125 N mm"),
        (Slot::Inertia, 0, 0.0625, "bodies.wheel.inertia=0.0625 kg m^2"),
        (Slot::PuckInertia, 0, 1e-3, "device.inertia=1e-3 kg m^2"),
        (Slot::PuckDamping, 0, 0.0078125, "device.damping=0.0078125 N m s/rad"),
    ];
    let unchanged = run(&mut page(&world(&[])), 4000);
    for (slot, index, value, set) in changes {
        let mut changed = page(&world(&[]));
        assert!(changed.set(slot, index, value), "{set}");
        let rows = run(&mut changed, 4000);
        assert_eq!(rows, run(&mut page(&world(&[set])), 4000), "{set}");
        assert_ne!(rows, unchanged, "{set} does something");
    }
}

#[test]
fn what_is_changed_while_it_runs_goes_on_where_it_is_and_without_a_step_of_torque() {
    let mut page = page(&world(&[]));
    run(&mut page, 3000);
    for (slot, index, value) in [(Slot::Period, 0, 1.3e-3), (Slot::Stiffness, 0, 3.0), (Slot::Method, 0, 1.0)] {
        let [before, ..] = *page.frame();
        assert!(page.set(slot, index, value));
        page.run(1);
        let [after, ..] = *page.frame();
        // Within one sample nothing goes far: a speed of v, and a fade of 100 samples.
        let way = 2e-3 * (before[1].abs() + before[9].abs() + 1.0);
        assert!((after[0] - before[0]).abs() < way && (after[8] - before[8]).abs() < way, "{slot:?}");
        assert!((after[6] - before[6]).abs() < 0.05, "{slot:?}: from {} to {} N m", before[6], after[6]);
    }
}

#[test]
fn what_cannot_run_is_refused_and_what_ran_goes_on() {
    let world = world(&[]);
    let (mut refused, mut other) = (page(&world), page(&world));
    for (slot, index, value) in [
        (Slot::Period, 0, 0.0),
        (Slot::Period, 0, 1e-6),
        (Slot::Period, 0, f64::NAN),
        (Slot::Method, 0, 8.0),
        // Nothing is found over these steps, and a wall stands at a body.
        (Slot::Method, 0, 6.0),
        (Slot::Output, 0, 3.0),
        (Slot::Stiffness, 0, -1.0),
        (Slot::Stiffness, 1, 1.0),
        (Slot::Stiffness, 6, 1.0),
        (Slot::Damping, 0, 1.0),
        (Slot::Compensating, 2, 0.0),
        (Slot::Torque, 3, f64::INFINITY),
        (Slot::Inertia, 0, 0.0),
        (Slot::Inertia, 1, 1.0),
        (Slot::PuckInertia, 0, 0.0),
        (Slot::PuckFriction, 0, -1e-3),
        (Slot::Delay, 0, -1e-3),
    ] {
        assert!(!refused.set(slot, index, value), "{slot:?} {index} {value}");
    }
    assert_eq!(run(&mut refused, 2000), run(&mut other, 2000));
    let (mut bytes, setup) = bytes(&world);
    assert!(Page::new(&bytes, &setup[..setup.len() - 1]).is_none());
    bytes[3] ^= 1;
    assert!(Page::new(&bytes, &setup).is_none());
}

#[test]
fn a_frame_keeps_the_extremes_of_its_samples() {
    let (mut whole, mut single) = (page(&world(&[])), page(&world(&[])));
    for page in [&mut whole, &mut single] {
        page.ask(Request::Arm);
        page.begin(0);
    }
    for _ in 0..40 {
        whole.run(17);
        let mut rows = Vec::new();
        for _ in 0..17 {
            single.run(1);
            rows.push(single.frame()[0]);
        }
        let [last, least, greatest] = whole.frame();
        assert_eq!(last, rows.last().unwrap());
        for column in 0..COLUMNS {
            let values = || rows.iter().map(|row| row[column]);
            assert_eq!(least[column], values().fold(f64::INFINITY, f64::min));
            assert_eq!(greatest[column], values().fold(f64::NEG_INFINITY, f64::max));
        }
    }
}
