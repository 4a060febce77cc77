//! The meaning of a run's columns.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use crate::common::{Table, WHEEL, folder, hapt, near, shipped, simulated};

fn largest(column: &[f64]) -> (usize, f64) {
    let mut found = (0, 0.0);
    for (sample, x) in column.iter().map(|x| x.abs()).enumerate() {
        found = if x > found.1 { (sample, x) } else { found };
    }
    found
}

#[test]
fn the_motor_holds_the_command_from_its_delay_on() {
    for (delay, samples) in [("0", 0), ("0.4 ms", 1), ("1 ms", 1), ("2 ms", 2), ("2.5 ms", 3), ("1.0000000001 ms", 1)] {
        let table = simulated(WHEEL, &["--set", &format!("loop.delay={delay}")]);
        let (command, applied) = (table.column("command_Nm"), table.column("applied_Nm"));
        assert!(command[0] != 0.0);
        assert!(applied[..samples].iter().all(|&x| x == 0.0), "{delay}");
        assert_eq!(applied[samples..], command[..command.len() - samples], "{delay}");
    }
}

#[test]
fn the_command_is_the_torque_in_the_motors_levels_and_within_its_limit() {
    let limit = 0.3;
    for levels in [None, Some(16.0), Some(2048.0)] {
        let mut args = vec!["--set".to_string(), format!("device.limit={limit}")];
        args.extend(levels.iter().flat_map(|levels| ["--set".to_string(), format!("device.levels={levels}")]));
        let table = simulated(WHEEL, &args.iter().map(String::as_str).collect::<Vec<_>>());
        let (torque, command) = (table.column("torque_Nm"), table.column("command_Nm"));
        for (torque, command) in torque.iter().zip(&command) {
            let rounded = levels.map_or(*torque, |levels| {
                let step = 2.0 * limit / levels;
                step * (torque / step + 0.5 + 1e-9).floor()
            });
            assert!((command - rounded.clamp(-limit, limit)).abs() < 1e-15, "{torque} gives {command}");
            assert!(command.abs() <= limit);
        }
        assert!(command.contains(&-limit) && command.iter().any(|x| x.abs() < limit));
    }
}

#[test]
fn the_summarys_peak_is_the_columns() {
    for (world, scenario, column) in [
        ("notes/euler.toml", "step", "torque_Nm"),
        ("notes/resonance.toml", "excite", "torque_Nm"),
        ("notes/spring-mass.toml", "step", "force_N"),
        ("devices/eth-wall.toml", "let-go", "torque_Nm"),
    ] {
        let (world, at) = (shipped(world), folder(&[]));
        hapt(at.path(), ["sim", &world, "--scenario", scenario, "--out", "."]).done();
        let table = Table::read(&at.path().join(format!("{scenario}.csv")));
        let (sample, peak) = largest(&table.column(column));

        let summary = hapt(at.path(), ["sim", &world, "--scenario", scenario]).done().out;
        let line = summary.lines().find_map(|line| line.trim().strip_prefix("peak torque ")).unwrap();
        let (value, time) = line.split_once(" at ").unwrap();
        let (value, unit) = value.trim().split_once(' ').unwrap();
        let size = [("N mm", 1e-3), ("N m", 1.0), ("N", 1.0)].iter().find(|(name, _)| *name == unit).unwrap().1;
        near(value.parse::<f64>().unwrap() * size, peak, 1e-5);
        let (value, unit) = time.split_once(' ').unwrap();
        let size = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6)].iter().find(|(name, _)| *name == unit).unwrap().1;
        near(value.parse::<f64>().unwrap() * size, table.column("time_s")[sample], 1e-5);
    }
}

#[test]
fn the_summary_counts_the_samples_beyond_the_limit_and_fits_the_growth() {
    let (world, at) = (shipped("notes/euler.toml"), folder(&[]));
    hapt(at.path(), ["sim", &world, "--out", "."]).done();
    let torque = Table::read(&at.path().join("step.csv")).column("torque_Nm");
    let over = torque.iter().filter(|x| x.abs() > 0.82225).count();
    let first = torque.iter().position(|x| x.abs() > 0.82225).unwrap();
    let summary = hapt(at.path(), ["sim", &world]).done().out.replace(' ', "");
    assert!(summary.contains(&format!("at{over}of10001samples,firstatsample{first}(")), "{summary}");
    assert!(summary.contains("growth0.0197388persecondfittedtotherun,0.0197388predicted"), "{summary}");
}

#[test]
fn a_wall_pushes_and_never_pulls() {
    for (side, sign) in [("above", 1.0), ("below", -1.0)] {
        // Damping so large that on the way out the damper by itself would pull.
        let wall = format!(
            "[loop]\nperiod = 1e-3\n[device]\ninertia = 1e-3\n\
             [[couplings]]\nkind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nside = \"{side}\"\n\
             at = {at:?}\nstiffness = 2\ndamping = 0.5\n\
             [scenarios.step]\nduration = 2\nhand = {{ kind = \"sine\", amplitude = 1, frequency = 1 }}\n",
            at = 0.25 * sign
        );
        let table = simulated(&wall, &[]);
        let (puck, velocity) = (table.column("puck_rad"), table.column("puck_rad_per_s"));
        let (mut pushed, mut would_pull) = (0, 0);
        for ((q, rate), torque) in puck.iter().zip(&velocity).zip(table.column("torque_Nm")) {
            let (depth, rate) = (sign * q - 0.25, sign * rate);
            let law = if depth > 0.0 { (2.0 * depth + 0.5 * rate).max(0.0) } else { 0.0 };
            assert!(torque * sign <= 0.0, "it pulls by {torque} at {q}");
            assert!((torque * sign + law).abs() < 1e-12, "{torque} is not {law} at {q}");
            pushed += usize::from(law > 0.0);
            would_pull += usize::from(depth > 0.0 && 2.0 * depth + 0.5 * rate < 0.0);
        }
        assert!(pushed > 100 && would_pull > 100, "{pushed} {would_pull}");
    }
}

#[test]
fn what_is_measured_is_the_encoders_count() {
    let sine = WHEEL.replace("kind = \"step\", to = \"45 deg\"", "kind = \"sine\", amplitude = 0.3, frequency = 2");
    let table = simulated(&sine, &["--set", "device.encoder=500", "--set", "loop.estimator=difference"]);
    let (puck, measured) = (table.column("puck_rad"), table.column("measured_rad"));
    for (puck, measured) in puck.iter().zip(&measured) {
        let count = (puck * 500.0 / TAU + 0.5 + 1e-9).floor();
        assert!((measured - count * TAU / 500.0).abs() < 1e-15);
    }
    let velocity = table.column("measured_rad_per_s");
    assert_eq!(velocity[0], 0.0);
    for (pair, velocity) in measured.windows(2).zip(&velocity[1..]) {
        assert!((velocity - (pair[1] - pair[0]) / 1e-3).abs() < 1e-10);
    }
    assert!(measured != puck);
}

#[test]
fn a_row_shows_the_instant_it_is_taken_at() {
    let table = simulated(WHEEL, &["--set", "scenarios.step.hand.at=0.2", "--set", "scenarios.step.hand.release=0.3"]);
    for (sample, time) in table.column("time_s").into_iter().enumerate() {
        assert_eq!(time, sample as f64 * 1e-3);
    }
    let (puck, torque) = (table.column("puck_rad"), table.column("torque_Nm"));
    let (applied, wheel) = (table.column("applied_Nm"), table.column("wheel_rad"));
    let velocity = table.column("puck_rad_per_s");
    assert!(puck[..200].iter().chain(&torque[..200]).chain(&wheel[..=200]).all(|&x| x == 0.0));
    assert_eq!((puck[200], velocity[200]), (PI / 4.0, 0.0));
    assert!(torque[200] < 0.0 && applied[200] == torque[200]);
    assert!(puck[200..=300].iter().all(|&x| x == PI / 4.0), "held until it is let go");
    assert!(puck[301] < puck[300] && velocity[301] < 0.0, "and then it gives way");
}

#[test]
fn a_step_between_two_samples_shows_in_the_row_after_it() {
    let puck = simulated(WHEEL, &["--set", "scenarios.step.hand.at=0.1004"]).column("puck_rad");
    assert_eq!((puck[100], puck[101]), (0.0, PI / 4.0));
}

#[test]
fn the_spring_and_mass_follow_the_notes_formulas() {
    let at = folder(&[]);
    hapt(at.path(), ["sim", &shipped("notes/spring-mass.toml"), "--out", "."]).done();
    let table = Table::read(&at.path().join("step.csv"));
    let (mass, force) = (table.column("mass_m"), table.column("force_N"));
    assert_eq!(table.rows.len(), 3001);
    for (sample, (mass, force)) in mass.into_iter().zip(force).enumerate() {
        let since = sample as f64 * 1e-3 - 0.25;
        let (w, pull) = match sample {
            0..250 => (0.0, 0.0),
            _ => (0.02 * (1.0 - (TAU * since).cos()), -100.0 * 0.02 * (TAU * since).cos()),
        };
        assert!((mass - w).abs() < 1e-12 && (force - pull).abs() < 1e-10, "{sample}: {mass} {force}");
    }
}

#[test]
fn a_duration_is_rounded_to_whole_samples() {
    for (duration, rows) in [("10 ms", 11), ("10.4 ms", 11), ("10.6 ms", 12), ("0.1 ms", 1)] {
        assert_eq!(simulated(WHEEL, &["--set", &format!("scenarios.step.duration={duration}")]).rows.len(), rows);
    }
}

#[test]
fn a_summary_says_what_a_world_without_a_limit_has() {
    let world = WHEEL.replace("limit = \"822.25 N mm\"\n", "");
    let summary = crate::common::hapt_reads(Path::new("."), &world, ["sim", "-"]).done().out;
    assert!(summary.contains("no limit given"), "{summary}");
}
