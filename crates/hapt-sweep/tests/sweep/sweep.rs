//! A sweep's cells are the worlds of files with these numbers.

use hapt_model::{Source, World};
use hapt_sim::{Simulation, Summary};
use hapt_sweep::{Error, Measure, Rows, Sweep, Ticks};
use hapt_testing::prelude::*;

const WHEEL: &str = r#"
[loop]
period = "1 ms"
method = "forward-euler"
output = "start"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
encoder = 4000
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "17.8 N mm/deg"
[[couplings]]
kind = "damper"
between = ["wheel", "ground"]
damping = "compensating"
[scenarios.let-go]
duration = "0.3 s"
hand = { kind = "step", to = "45 deg", release = "0.1 s" }
"#;

fn sweep(axes: &[&str], measures: &[Measure]) -> Result<Sweep, Error> {
    let axes: Vec<String> = axes.iter().map(ToString::to_string).collect();
    Sweep::new(&Source::from_text("wheel.toml", WHEEL), &[], &axes, measures, None)
}

fn message(axes: &[&str], measures: &[Measure]) -> String {
    sweep(axes, measures).unwrap_err().to_string()
}

/// The measures by a world that is read from its file with the values as overrides.
fn one_by_one(sets: &[String]) -> [Option<f64>; 5] {
    let world = World::read(&Source::from_text("wheel.toml", WHEEL), sets).unwrap();
    let scenario = &world.scenarios[0];
    let mut run = Simulation::new(&world, scenario).unwrap();
    let mut summary = Summary::new(&world, &run);
    while let Some(row) = run.next() {
        summary.add(row.unwrap());
    }
    let check = hapt_analysis::check(&world).unwrap();
    let certified = f64::from(u8::from(check.certified.holds()));
    let loops = [check.held.growth_per_s, check.free.growth_per_s, check.passivity.required_damping, Some(certified)];
    [Some(summary.peak_torque), loops[0], loops[1], loops[2], loops[3]]
}

proptest! {
    #![proptest_config(hapt_testing::cases(24))]

    #[test]
    fn a_cell_is_the_world_of_its_numbers(
        period in (1e-4..2e-3f64, 2e-3..5e-3f64),
        stiffness in (0.1..2.0f64, 2.0..9.0f64),
        counts in 2..5u64,
        log in any::<bool>(),
    ) {
        let end = if log { ":log" } else { "" };
        let axes = [
            format!("loop.period={:?}..{:?}:{counts}{end}", period.0, period.1),
            format!("couplings.0.stiffness={:?}..{:?}:3", stiffness.1, stiffness.0),
            "device.encoder=1000..4000:2".to_string(),
        ];
        let axes: Vec<&str> = axes.iter().map(String::as_str).collect();
        let sweep = sweep(&axes, &[Measure::PeakTorque, Measure::HeldGrowth, Measure::FreeGrowth, Measure::RequiredDamping, Measure::Certified]).unwrap();
        let rows = sweep.rows(0..sweep.cells());
        prop_assert_eq!(rows.iter().len() as u64, counts * 6);
        for (cell, row) in rows.iter().enumerate() {
            let values: Vec<f64> = row[..3].iter().map(|v| v.unwrap()).collect();
            // The last axis varies fastest.
            prop_assert_eq!(values[2], [1000.0, 4000.0][cell % 2]);
            let sets = [
                format!("loop.period={:?}", values[0]),
                format!("couplings.0.stiffness={:?}", values[1]),
                format!("device.encoder={}", values[2]),
            ];
            prop_assert_eq!(&row[3..], one_by_one(&sets));
        }
        prop_assert_eq!(rows[0][0], Some(period.0));
        prop_assert_eq!(rows.iter().last().unwrap()[0], Some(period.1));
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(24))]

    /// With short axes and with one that is too long to keep, over any stretch and any number of threads.
    #[test]
    fn lines_are_the_rows_as_text(
        counts in (1u64..8, 1u64..40, prop_oneof![1u64..50, 100_000u64..100_001]),
        log in any::<bool>(),
        (from, length) in (0.0..1.0f64, 1u64..3000),
        threads in 1usize..4,
        verdicts in any::<bool>(),
    ) {
        let log = if log { ":log" } else { "" };
        let (stiffnesses, periods, inertias) = counts;
        let axes = [
            format!("couplings.0.stiffness=0.1..2:{stiffnesses}"),
            format!("loop.period=0.1ms..3ms:{periods}{log}"),
            format!("bodies.wheel.inertia=1e-3..1:{inertias}{log}"),
        ];
        let axes = axes.each_ref().map(String::as_str);
        let measures = [Measure::HeldGrowth, Measure::HeldVerdict];
        let measures = &measures[usize::from(verdicts)..];
        let sweep = sweep(&axes, measures).unwrap();
        let first = (from * (sweep.cells() - 1) as f64) as u64;
        let cells = first..(first + length).min(sweep.cells());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let lines = pool.install(|| sweep.lines(&Ticks::new(&sweep.grid), cells.clone()));
        let (mut text, mut missing) = (String::new(), vec![0; measures.len()]);
        for row in &sweep.rows(cells) {
            hapt_sweep::table::line(row, &mut text);
            missing.iter_mut().zip(&row[3..]).for_each(|(count, value)| *count += u64::from(value.is_none()));
        }
        prop_assert_eq!(lines.text.concat(), text);
        prop_assert_eq!(lines.missing, missing);
    }
}

#[test]
fn equal_steps_and_equal_ratios_have_exact_ends() {
    let sweep = sweep(&["loop.period=1ms..9ms:5", "device.damping=1e-3..1e-1:3:log"], &[Measure::HeldGrowth]).unwrap();
    let periods: Vec<f64> = (0..5).map(|i| sweep.grid.axes[0].value(i)).collect();
    for (i, period) in periods.iter().enumerate() {
        assert!((period - (0.001 + 0.002 * i as f64)).abs() < 1e-17);
    }
    assert_eq!(periods[4], 0.009);
    let damping: Vec<f64> = (0..3).map(|i| sweep.grid.axes[1].value(i)).collect();
    assert!((damping[1] - 1e-2).abs() < 1e-17 && damping[2] == 1e-1);
}

#[test]
fn one_value_is_the_first() {
    let sweep = sweep(&["loop.period=2ms..9ms:1"], &[Measure::HeldGrowth]).unwrap();
    assert_eq!(sweep.rows(0..1)[0][0], Some(0.002));
}

#[test]
fn rows_are_bit_identical_for_any_number_of_threads() {
    let sweep = sweep(&["loop.period=0.2ms..5ms:37"], &[Measure::PeakTorque, Measure::FinalEnergy]).unwrap();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| sweep.rows(0..37))
    };
    let bits = |rows: Rows| -> Vec<Option<u64>> { rows.iter().flatten().map(|x| x.map(f64::to_bits)).collect() };
    assert_eq!(bits(on(1)), bits(on(5)));
}

#[test]
fn a_damped_puck_settles_when_its_closed_form_does() {
    // A torque of 1 on an inertia with damping: ẋ = (1 - e^{-t b/J})/b. A spring to ground instead: critically damped,
    // x - x_end = -(1 + ωt) e^{-ωt} x_end, within 2 % from ωt = 5.8339 on.
    let file = r#"
        loop.period = "0.1 ms"
        device = { inertia = 1e-3, damping = 0.02 }
        scenarios.push = { duration = 3, hand = { kind = "grip", stiffness = 0.1, moves = { kind = "step", to = 1, at = 0.5 } } }
    "#;
    let source = Source::from_text("w.toml", file);
    let axes = ["device.damping=0.02..0.02:1".to_string()];
    let sweep = Sweep::new(&source, &[], &axes, &[Measure::SettlingTime], None).unwrap();
    let time = sweep.rows(0..1)[0][1].unwrap();
    assert!((time - 5.833_92 / 10.0).abs() < 2e-4, "{time}");
}

#[test]
fn an_undamped_motion_has_no_settling_time_and_a_puck_at_rest_has_zero() {
    let still = "loop.period = 1e-3\ndevice.inertia = 1e-3\nscenarios.s = { duration = 1, hand = { kind = \"torque\", moves = { kind = \"step\", to = 0 } } }";
    let time = |file: &str| {
        let axes = ["loop.period=1e-3..1e-3:1".to_string()];
        let sweep = Sweep::new(&Source::from_text("w", file), &[], &axes, &[Measure::SettlingTime], None).unwrap();
        sweep.rows(0..1)[0][1]
    };
    assert_eq!(time(still), Some(0.0));
    let swinging = WHEEL.replace(", release = \"0.1 s\"", "");
    assert_eq!(time(&swinging), None);
}

#[test]
fn nothing_has_settled_before_the_hands_last_event() {
    let times = |at: f64| {
        let file = format!(
            "loop.period = 1e-3\ndevice.inertia = 1e-3\n[bodies.b]\ninertia = 1e-3\nvelocity = 1\n[[couplings]]\nkind = \"spring\"\n\
             between = [\"puck\", \"b\"]\nstiffness = 1\n[[couplings]]\nkind = \"damper\"\nbetween = [\"b\", \"ground\"]\ndamping = 0.02\n\
             [scenarios.s]\nduration = 1\nhand = {{ kind = \"step\", to = 1, at = {at} }}"
        );
        // Enough values for a whole batch of lanes, and for single runs.
        [1, 16].map(|count| {
            let most = if count == 1 { 0.0 } else { 0.1 };
            let axes = [format!("device.damping=0..{most}:{count}")];
            let measures = [Measure::SettlingTime, Measure::PeakTorque];
            let sweep = Sweep::new(&Source::from_text("w", file.as_str()), &[], &axes, &measures, None).unwrap();
            sweep.rows(0..count as u64).iter().map(|row| row[1]).collect::<Vec<_>>()
        })
    };
    for late in [5.0, 1.0] {
        assert!(times(late).iter().flatten().all(Option::is_none), "{late}");
    }
    assert!(times(0.0).iter().flatten().all(|time| time.is_some_and(|time| time > 0.0)));
}

#[test]
fn a_run_that_diverges_has_no_peak_and_is_no_error() {
    let sweep = sweep(
        &["loop.period=1ms..100ms:2", "couplings.1.damping=0..0:1", "scenarios.let-go.duration=400..400:1"],
        &[Measure::PeakTorque],
    )
    .unwrap();
    let rows = sweep.rows(0..2);
    assert!(rows[0][3].is_some());
    assert_eq!(rows[1][3], None);
}

#[test]
fn invalid_axes_are_refused_with_what_would_be_right() {
    let held = [Measure::HeldGrowth];
    let cases: &[(&[&str], &str)] = &[
        (&["loop.period"], "expected KEY=FROM..TO:N"),
        (&["loop.period=1ms..2ms"], "expected KEY=FROM..TO:N"),
        (&["loop.period=1ms:5"], "expected KEY=FROM..TO:N"),
        (&["loop.period=1ms..2ms:0"], "\"0\" is not a number of values"),
        (&["loop.period=1ms..2ms:many"], "\"many\" is not a number of values"),
        (&["loop.period=0ms..2ms:5"], "is not above 0"),
        (&["loop.period=1ms..2kg:5"], "is a mass"),
        (&["loop.period=1ms..-2ms:5"], "above 0"),
        (&["device.damping=0..1:5:log"], "equal ratios need both ends on one side of 0"),
        (&["bodies.wheel.position=-1..1:5:log"], "equal ratios need both ends on one side of 0"),
        (&["loop.window=1..2:3"], "1.5 is not a whole number"),
        (&["loop.method=1..2:3"], "method"),
        (&["loop.perod=1ms..2ms:3"], "perod"),
        (&["couplings.7.stiffness=1..2:3"], "couplings.7"),
        (&["loop.period=1ms..2ms:3", "loop.period=1ms..2ms:3"], "varied twice"),
        (&["loop.period=1ms..2ms:99999999999"], "more than 10000000000 cells"),
        (&["loop.period=1ms..2ms:200000", "device.damping=1..2:200000"], "more than 10000000000 cells"),
        (&[], "a sweep varies 1 to 8 keys"),
        (&["loop.delay=0..3000s:3"], "more than a million periods"),
    ];
    for (axes, part) in cases {
        let refusal = message(axes, &held);
        assert!(refusal.contains(part), "{axes:?}: {refusal}");
    }
    assert!(message(&["loop.period=1ms..2ms:3"], &[]).contains("nothing to measure"));
    assert!(message(&["loop.period=1e-9..1ms:3"], &[Measure::SettlingTime]).contains("keeps every sample"));
}
