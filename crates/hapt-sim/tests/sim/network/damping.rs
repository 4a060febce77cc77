//! Links with damping, and the power that rounded positions generate.

use hapt_analysis::check_network;
use hapt_model::{Source, System};
use hapt_sim::Run;

use super::{Rng, pair};

/// A link to a wheel that is held at 0 is the coupling of its kind to ground, with the damping of a wall at the same positions, up to the rounding of a
/// sum.
#[test]
fn a_damped_link_to_a_wheel_that_is_held_is_the_coupling_to_ground() {
    for (law, keys) in [
        ("wall", "side = \"above\"\nat = -0.05\n"),
        ("wall", "side = \"below\"\nat = 0.1\nlimit = 0.02\n"),
        ("wall", "side = \"above\"\nat = 0.02\n"),
        ("spring", "rest = 0.03\n"),
    ] {
        for estimator in ["difference", "low-pass"] {
            let cutoff = if estimator == "low-pass" { "cutoff = 40\n" } else { "" };
            let world = |more: &str, hand: &str| {
                format!(
                    "[loop]\nperiod = 1e-3\nestimator = \"{estimator}\"\n{cutoff}[device]\ninertia = 1e-3\ndamping = 0.05\n{more}\n\
                     [scenarios.all]\nduration = 1\nhand = {hand}\n"
                )
            };
            let moved = "{ kind = \"sine\", amplitude = 0.2, frequency = 3 }";
            let damper = |ends: &str| format!("[[couplings]]\nkind = \"damper\"\nbetween = {ends}\ndamping = 0.004\n");
            let coupling = match law {
                "spring" => format!(
                    "[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = 0.4\n{keys}{}",
                    damper("[\"puck\", \"ground\"]")
                ),
                _ => format!(
                    "[[couplings]]\nkind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nstiffness = 0.4\ndamping = 0.004\n{keys}"
                ),
            };
            let single_world =
                hapt_model::World::read(&Source::from_text("w.toml", world(&coupling, moved)), &[]).unwrap();
            let mut source = Source::from_text(
                "pair.toml",
                format!(
                    "stations = {{ left = {{ world = \"moved.toml\" }}, right = {{ world = \"held.toml\" }} }}\n[[links]]\nkind = \"{law}\"\n\
                     between = [\"left\", \"right\"]\nstiffness = 0.4\ndamping = 0.004\nage_max = \"20 ms\"\n{keys}"
                ),
            );
            source.files.insert("moved.toml".into(), world("", moved));
            source.files.insert("held.toml".into(), world("", "{ kind = \"step\", to = 0, at = 0 }"));
            let network = System::read(&source, &[]).unwrap();
            let mut run = Run::new(&network, "all").unwrap();
            let mut single = hapt_sim::Simulation::new(&single_world, &single_world.scenarios[0]).unwrap();
            let (mut last, mut sample, mut pushed) = (0.0, 0, false);
            while let Some(row) = run.next() {
                let row = row.unwrap();
                if row.station == 0 {
                    let torque = single.next().unwrap().unwrap().torque;
                    // A velocity needs two messages.
                    assert!(
                        sample < 3 || (row.link - torque).abs() < 1e-12,
                        "{keys} {sample}: {} and {torque}",
                        row.link
                    );
                    (last, sample, pushed) = (row.link, sample + 1, pushed || torque != 0.0);
                } else if sample > 3 {
                    // The other end has the opposite torque, a sample later.
                    assert!((row.link + last).abs() < 0.02, "{keys}: {} after {last}", row.link);
                }
            }
            assert!(pushed && single.next().is_none());
        }
    }
}

/// A pair with the estimator, stiffness and damping.
fn damped(estimator: &str, stiffness: f64, damping: f64) -> System {
    let mut network = pair(stiffness, 0.05, &format!("damping = {damping}\n"));
    for station in &mut network.stations {
        station.world = hapt_model::World::read(
            &station.source,
            &[format!("loop.estimator={estimator}"), "loop.cutoff=40".to_string()]
                [..if estimator == "low-pass" { 2 } else { 1 }],
        )
        .unwrap();
    }
    network
}

#[test]
fn the_damping_that_a_links_damping_requires_is_that_of_its_velocity_estimates() {
    for estimator in ["difference", "low-pass"] {
        let check = check_network(&damped(estimator, 0.0, 0.01)).unwrap();
        // (T64): D for the own velocity, and D √(9/8 · 4) for the other's.
        let required = check.stations[0].required_damping.unwrap();
        assert!((required / (0.01 * (1.0 + 4.5f64.sqrt())) - 1.0).abs() < 1e-9, "{required}");
        let both = check_network(&damped(estimator, 1.0, 0.01)).unwrap();
        assert!((both.stations[0].required_damping.unwrap() - required - 20.5e-3).abs() < 1e-9);
        let scale = check.remedies.as_ref().unwrap().damping_scale.unwrap();
        assert!((0.01 * scale * (1.0 + 4.5f64.sqrt()) / 0.05 - 1.0).abs() < 1e-6, "{scale}");
        for (part, passive) in [(1.0, true), (1.0 + 1e-6, false)] {
            let check = check_network(&damped(estimator, 0.0, 0.01 * scale * part)).unwrap();
            assert_eq!(check.stations.iter().all(|station| station.passive), passive, "{part}");
        }
        assert!(check.fixed.passive.is_none() && check.fixed.not_proved[0].contains("is damped"), "{:?}", check.fixed);
        assert!(check_network(&damped(estimator, 1.0, 0.0)).unwrap().remedies.unwrap().damping_scale.is_none());
    }
    // An instantaneous velocity has no bound: nothing is proved.
    for estimator in ["exact", "foaw"] {
        let check = check_network(&damped(estimator, 0.1, 1e-9)).unwrap();
        assert!(!check.certified && check.stations.iter().all(|station| station.required_damping.is_none()));
        assert!(check.stations[0].not_proved[0].contains("estimator"), "{:?}", check.stations[0].not_proved);
    }
}

/// Wheels joined only by a damper reach a common speed; a damping that exceeds every device's is not certified.
#[test]
fn a_damper_joins_the_speeds_of_two_wheels_and_a_huge_one_is_not_certified() {
    let mut network = damped("difference", 0.0, 0.02);
    for station in &mut network.stations {
        station.world.device.damping = 0.0;
    }
    let mut run = Run::new(&network, "all").unwrap();
    let mut last = [0.0; 2];
    while let Some(row) = run.next() {
        let row = row.unwrap();
        last[row.station] = row.row.puck_velocity;
    }
    // p = 5e-4 N m s of the push, less the momentum that each damper removes before the other's velocity has arrived: p = 2 v (J + D · 18 ms).
    let speed = 5e-4 / (2.0 * (1e-3 + 0.02 * 18e-3));
    assert!(last.iter().all(|last| (last / speed - 1.0).abs() < 1e-3), "{last:?} and {speed}");
    let mut huge = damped("difference", 1.0, 0.0);
    huge.links[0].damping = f64::MAX;
    assert!(!check_network(&huge).unwrap().certified);
    let mut run = Run::new(&huge, "all").unwrap();
    // The run ends with an error, or the link releases.
    while let Some(Ok(row)) = run.next() {
        assert!(row.link.is_finite());
    }
}

/// Hands that draw energy from rounding: the left one moves with the error's torque, and the right one reverses that by a step across half of a `step`
/// before the left one moves back. Their motion begins at 0.
fn with_rounding_hands(network: System, step: f64, speed: f64) -> System {
    let (leg, travel, late) = (0.4, 0.4 * speed, 20e-3);
    let (mut left, mut right) = ("time_s,puck_rad\n0,0\n".to_string(), "time_s,puck_rad\n0,0\n".to_string());
    for k in 1..12 {
        let time = f64::from(k) * leg;
        let up = k % 2 == 1;
        left += &format!("{time},{}\n", if up { 0.0 } else { travel });
        let half = 0.5 * step + if up { 0.02 } else { -0.02 } * step;
        right += &format!("{},{half}\n{},{half}\n", time - late + 2e-3, time + leg - late - 2e-3);
    }
    with_paths(network, [left, right])
}

/// The network with the scenario `paths`, in which hands move along these points.
fn with_paths(mut network: System, paths: [String; 2]) -> System {
    for (station, path) in network.stations.iter_mut().zip(paths) {
        station.source.files.insert("hand.csv".into(), path);
        station.source.text += "[scenarios.paths]\nduration = 4.4\nhand = { kind = \"path\", file = \"hand.csv\" }\n";
        let set = format!("loop.estimator={}", station.world.sampling.estimator.name());
        station.world = hapt_model::World::read(&station.source, &[set]).unwrap();
    }
    network
}

/// Hands that shake the wheels against each other, by a step there and back in each period: the velocities that the dampers use are those of past
/// steps. So the own velocity generates power as a damping of -D, and so does the other's. (T64) requires 3.1 D, since messages may be lost.
#[test]
fn shaking_hands_draw_energy_below_twice_the_damping_of_the_link() {
    let points = |k: u32, step: f64| format!("{},{}\n", 0.1 + 1e-3 * f64::from(k), step * f64::from(k % 2));
    let path = |step| (0..4000).fold("time_s,puck_rad\n0,0\n".to_string(), |path, k| path + &points(k, step));
    let mut network = with_paths(damped("difference", 0.0, 0.01), [path(1e-3), path(-1e-3)]);
    let required = check_network(&network).unwrap().stations[0].required_damping.unwrap();
    for (damping, draws) in [(0.9 * 0.02, true), (1.1 * 0.02, false), (required, false)] {
        for station in &mut network.stations {
            station.world.device.damping = damping;
        }
        let mut run = Run::new(&network, "paths").unwrap();
        let mut summary = hapt_sim::SystemSummary::new(&network, &run);
        while let Some(row) = run.next() {
            summary.add(&row.unwrap());
        }
        // 2 (2 D - b) v² for 4 s.
        let drawn = 2.0 * (0.02 - damping) * 4.0;
        assert_eq!(summary.had() > 0.0, draws, "{damping}: {} J", summary.had());
        assert!((summary.had() / drawn - 1.0).abs() < 0.05, "{damping}: {} and {drawn} J", summary.had());
    }
}

/// Messages that round positions: by (T65) all hands draw at most a bounded power times the time, and friction of K/2 times a step covers it.
#[test]
fn rounded_positions_generate_no_more_power_than_their_bound() {
    let step = 0.01;
    let mut rng = Rng(7);
    for damping in [0.0, 0.0, 0.0, 0.0, 0.0005, 0.002] {
        let mut network = damped("difference", 1.0, damping);
        let required = check_network(&network).unwrap().stations[0].required_damping.unwrap();
        let over = required * (0.05 + 0.3 * rng.f64());
        // Each end has K/2 of a step, and D of one in a period; the equal wheels have an excess of `over`.
        let torque = step * (0.5 + damping / 1e-3);
        network = with_rounding_hands(network, step, 0.25 * step / (required + over));
        for station in &mut network.stations {
            station.world.device.damping = required + over;
        }
        let check = check_network(&network).unwrap();
        let bound = hapt_analysis::rounded(&network, &check, step).unwrap();
        assert!((bound.torque[0] / torque - 1.0).abs() < 1e-9);
        let power = bound.power.unwrap();
        assert!((power / (0.5 * torque * torque / over) - 1.0).abs() < 1e-6, "{power}");
        let drawn = |step: f64| {
            let mut run = Run::new(&network, "paths").unwrap().rounding(step);
            let mut summary = hapt_sim::SystemSummary::new(&network, &run);
            while let Some(row) = run.next() {
                let row = row.unwrap();
                let time = row.row.time;
                summary.add(&row);
                let most = if step > 0.0 { power * time } else { 1e-9 };
                assert!(summary.had() <= most + summary.blur(), "{} J at {time} s, {step}", summary.had());
            }
            summary.had()
        };
        // With rounding the hands draw net energy, without it they do not.
        let (rounded, exact) = (drawn(step), drawn(0.0));
        assert!(damping > 0.0 || rounded > 1e-3 * power * 4.4 && exact < 0.0, "{rounded} and {exact} J of {power} W");
        // With just the required damping it is unbounded; with enough friction it is 0.
        for station in &mut network.stations {
            station.world.device.damping = required * (1.0 - 1e-9);
        }
        let edge = check_network(&network).unwrap();
        assert_eq!(hapt_analysis::rounded(&network, &edge, step).unwrap().power, None);
        for station in &mut network.stations {
            station.world.device.friction = torque * (1.0 + 1e-9);
        }
        assert_eq!(hapt_analysis::rounded(&network, &edge, step).unwrap().power, Some(0.0));
    }
}
