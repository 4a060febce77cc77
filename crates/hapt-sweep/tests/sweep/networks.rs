//! Networks of stations: edges against closed forms and against the check, cells against the check and the single run.

use std::ops::ControlFlow;

use hapt_analysis::check_network;
use hapt_model::{Source, System};
use hapt_sim::Run;
use hapt_sweep::boundary::{Boundary, Claim, Edge};
use hapt_sweep::worst::search_network;
use hapt_sweep::{Error, Measure, Shard, Sweep, Ticks};
use hapt_testing::prelude::*;

/// Two equal wheels at 1 ms on a link, without delay of their loops.
fn pair(damping: f64, link: &str) -> Source {
    let mut source = Source::from_text(
        "pair.toml",
        format!(
            "stations.left.world = 'wheel.toml'\nstations.right.world = 'wheel.toml'\n[[links]]\nkind = 'spring'\n\
             between = ['left', 'right']\n{link}\n"
        ),
    );
    let wheel = format!("loop.period = '1 ms'\ndevice = {{ inertia = 1e-3, damping = {damping} }}\n");
    source.files.insert("wheel.toml".into(), wheel);
    source
}

fn claim(source: &Source, axes: [&str; 2], edge: Edge) -> Claim {
    let axes = axes.map(String::from);
    let mut boundary = Boundary::new(source, &[], &axes, &[edge]).unwrap();
    let claim = boundary.claims.remove(0);
    assert!(claim.pieces.iter().all(|piece| piece.failed == 0) && claim.undecided.is_none(), "{claim:?}");
    claim
}

/// (T53) of equal stations: K (T/2 + age_max) = b.
#[test]
fn the_edge_of_two_equal_wheels_for_any_clocks_is_a_hyperbola() {
    let source = pair(0.005, "stiffness = 0.2\nage_max = '20 ms'");
    let found = claim(&source, ["links.0.stiffness=0.05..1", "links.0.age_max=4ms..60ms"], Edge::Passive);
    assert_eq!(found.pieces.len(), 1);
    assert!(found.pieces[0].points.len() > 30);
    for point in &found.pieces[0].points {
        let [stiffness, age] = point.values;
        assert!((stiffness * (0.5e-3 + age) / 0.005 - 1.0).abs() < 1e-9, "{:?}", point.values);
    }
}

/// K T (1/2 + (M + 1)/2) = b at whole delays of M samples for the round trip; each direction takes its delay, at least a period.
#[test]
fn the_edge_at_fixed_times_is_a_staircase_over_the_delay() {
    let source = pair(0.005, "stiffness = 0.2\nage_max = '20 ms'");
    let found = claim(&source, ["links.0.delay=0.5ms..2.5ms", "links.0.stiffness=0.2..4"], Edge::Fixed);
    let points: Vec<[f64; 2]> = found.pieces.iter().flat_map(|piece| &piece.points).map(|point| point.values).collect();
    for messages in 1..=2 {
        // Between two whole delays a message waits for the next sample.
        let stiffness = 0.005 / (1e-3 * (0.5 + (f64::from(2 * messages) + 1.0) / 2.0));
        let on_step = points.iter().filter(|[delay, _]| (delay - 1e-3 * (f64::from(messages) - 0.5)).abs() < 0.3e-3);
        let seen = on_step
            .map(|[_, k]| (k / stiffness - 1.0).abs())
            .fold((0, 0.0), |(n, most), left| (n + 1, f64::max(most, left)));
        assert!(seen.0 > 3 && seen.1 < 1e-5, "{messages}: {seen:?} {stiffness}");
    }
}

const WALL: &str = "kind = 'wall'\nside = 'above'\nat = 0.1";

/// A network of three in a row with random numbers, its second link of a law.
fn row(numbers: &[f64; 8], law: &str) -> Source {
    let [b0, b1, b2, k0, k1, age, spring, delay] = numbers;
    let mut source = Source::from_text(
        "row.toml",
        format!(
            "stations.a.world = 'a.toml'\nstations.b.world = 'b.toml'\nstations.c.world = 'c.toml'\n\
             [[links]]\nkind = 'spring'\nbetween = ['a', 'b']\nstiffness = {k0}\ndelay = {delay}\nage_max = {age}\n\
             [[links]]\n{law}\nbetween = ['b', 'c']\nstiffness = {k1}\ndelay = {delay}\nage_max = {age}\n"
        ),
    );
    for (name, damping, period) in [("a.toml", b0, "1 ms"), ("b.toml", b1, "2 ms"), ("c.toml", b2, "1 ms")] {
        let world = format!(
            "loop = {{ period = '{period}', estimator = 'difference' }}\ndevice = {{ inertia = 1e-3, damping = {damping} }}\n\
             [[couplings]]\nkind = 'spring'\nbetween = ['puck', 'ground']\nstiffness = {spring}\n"
        );
        source.files.insert(name.into(), world);
    }
    source
}

fn network(system: System) -> System {
    assert!(system.world().is_none(), "the file has stations");
    system
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2, ..ProptestConfig::default() })]

    /// Slightly to each side of every point of both edges the verdict of `check` is that of the edge.
    #[test]
    fn an_edge_of_a_network_is_where_its_check_changes(
        dampings in prop::array::uniform3(0.004..0.02f64),
        stiff in prop::array::uniform2(0.05..0.4f64),
        age in 12e-3..40e-3f64,
        spring in 0.0..1.0f64,
        delay in 0.2e-3..3e-3f64,
    ) {
        let [b0, b1, b2] = dampings;
        let [k0, k1] = stiff;
        let source = row(&[b0, b1, b2, k0, k1, age, spring, delay], WALL);
        for (axes, edge) in [
            (["links.0.stiffness=0.01..4:log", "stations.b.device.damping=0.001..0.05"], Edge::Passive),
            (["links.0.stiffness=0.01..4:log", "links.1.delay=0..6ms"], Edge::Fixed),
        ] {
            let boundary = Boundary::new(&source, &[], &axes.map(String::from), &[edge]).unwrap();
            let points: Vec<_> = boundary.claims[0].pieces.iter().flat_map(|piece| &piece.points).collect();
            for point in points.iter().step_by(points.len() / 8 + 1) {
                let holds = [-1e-4, 1e-4].map(|far| {
                    let place = [0, 1].map(|i| (point.place[i] + far * point.beyond[i]).clamp(1e-6, 1.0 - 1e-6));
                    let check = check_network(&network(boundary.plane.at(place))).unwrap();
                    match edge {
                        Edge::Fixed => check.fixed.passive == Some(true),
                        _ => check.stations.iter().all(|station| station.passive),
                    }
                });
                prop_assert_eq!(holds, [true, false], "{:?} of {:?}", point, edge);
            }
        }
    }
}

#[test]
fn there_is_no_edge_at_fixed_times_for_varying_times() {
    let edges = |link: &str, axes: [&str; 2]| {
        let boundary = Boundary::new(&pair(0.005, link), &[], &axes.map(String::from), &[]).unwrap();
        let [passive, fixed] = &boundary.claims[..] else { panic!("{} claims", boundary.claims.len()) };
        assert!(passive.edge == Edge::Passive && passive.undecided.is_none());
        assert!(fixed.pieces.is_empty() && fixed.everywhere.is_none());
        fixed.undecided.clone().unwrap()
    };
    let ages = "links.0.age_max=4ms..60ms";
    let reason = edges("stiffness = 0.2\nage_max = '20 ms'\nloss = 0.1", ["links.0.stiffness=0.05..1", ages]);
    assert!(reason.contains("are lost"), "{reason}");
    let reason = edges("stiffness = 0.2\nage_max = '20 ms'", ["stations.left.loop.period=1ms..2ms", ages]);
    assert!(reason.contains("stations.left.loop.period"), "{reason}");
}

/// A push at the left wheel, with messages that are late and lost.
fn pushed() -> Source {
    let link = "stiffness = 0.2\ndelay = '0.5 ms'\ndelay_max = '6 ms'\nloss = 0.2\nage_max = '20 ms'";
    let mut source = pair(0.005, link);
    let push = "[scenarios.push]\nduration = '0.2 s'\n\
        hand = { kind = 'grip', inertia = 1e-3, stiffness = 2, moves = { kind = 'step', to = 0.3, at = '50 ms' } }\n";
    source.text = source.text.replacen("wheel.toml", "push.toml", 1);
    let wheel = source.files["wheel.toml"].clone();
    source.files.insert("push.toml".into(), format!("{wheel}{push}"));
    source
}

const AXES: [&str; 2] = ["links.0.stiffness=0.05..0.4:5", "stations.right.device.damping=1e-3..2e-2:4"];

/// Every number of a cell is bit-identical to that of the check and of the run of the network with the cell's overrides.
#[test]
fn a_cell_of_a_network_is_its_check_and_its_single_run() {
    let source = pushed();
    let measures: Vec<Measure> = Measure::of(&System::read(&source, &[]).unwrap()).collect();
    let sweep = Sweep::new(&source, &[], &AXES.map(String::from), &measures, None).unwrap();
    let rows = sweep.rows(0..sweep.cells());
    for row in &rows {
        let sets = [("links.0.stiffness", row[0]), ("stations.right.device.damping", row[1])];
        let sets = sets.map(|(key, value)| format!("{key}={:?}", value.unwrap()));
        let network = System::read(&source, &sets).unwrap();
        let check = check_network(&network).unwrap();
        let mut run = Run::new(&network, "push").unwrap();
        let (mut hands, mut times, mut drawn, mut peak) = ([0.0; 2], [-1.0; 2], 0.0f64, 0.0f64);
        while let Some(row) = run.next() {
            let row = row.unwrap();
            peak = peak.max((row.row.torque + row.link).abs());
            hands[row.station] = row.row.ledger.hand;
            times[row.station] = row.row.time;
            if times[0] == times[1] {
                drawn = drawn.max(-(hands[0] + hands[1]));
            }
        }
        let margin = check.stations.iter().map(|of| of.device_damping - of.required_damping.unwrap());
        let flag = |holds: bool| Some(f64::from(u8::from(holds)));
        for (measure, value) in measures.iter().zip(&row[2..]) {
            let expected = match measure {
                Measure::PeakTorque => Some(peak),
                Measure::EnergyDrawn => Some(drawn),
                Measure::Releases => Some(run.releases().flatten().sum::<u64>() as f64),
                Measure::Certified => flag(check.certified),
                Measure::DampingMargin => margin.clone().min_by(f64::total_cmp),
                Measure::StiffnessScale => check.remedies.as_ref().unwrap().stiffness_scale,
                Measure::FixedPassive => check.fixed.passive.and_then(flag),
                other => panic!("{} is of a world", other.name()),
            };
            assert_eq!(value.map(f64::to_bits), expected.map(f64::to_bits), "{} of {sets:?}", measure.name());
        }
    }
    // Both verdicts occur, and certified cells have the required damping.
    let at = |measure: Measure| 2 + measures.iter().position(|of| *of == measure).unwrap();
    let certified: Vec<bool> = rows.iter().map(|row| row[at(Measure::Certified)] == Some(1.0)).collect();
    assert!(certified.contains(&true) && certified.contains(&false));
    assert!(rows.iter().zip(&certified).all(|(row, is)| *is == (row[at(Measure::DampingMargin)].unwrap() >= 0.0)));
}

#[test]
fn shards_of_a_network_are_its_table() {
    let sweep = Sweep::new(&pushed(), &[], &AXES.map(String::from), &[Measure::PeakTorque, Measure::Certified], None);
    let sweep = sweep.unwrap();
    let ticks = Ticks::new(&sweep.grid);
    let lines = |cells| sweep.lines(&ticks, cells).text.concat();
    let whole = lines(0..sweep.cells());
    assert_eq!(whole.lines().count(), 20);
    let shards: String =
        ["0/3", "1/3", "2/3"].map(|i| lines(i.parse::<Shard>().unwrap().cells(sweep.cells()))).concat();
    assert_eq!(shards, whole);
}

#[test]
fn a_measure_of_the_other_kind_of_file_is_refused_with_the_available_ones() {
    let sweep = |measure, scenario| {
        Sweep::new(&pushed(), &[], &AXES.map(String::from), &[measure], scenario).map(|_| ()).unwrap_err().to_string()
    };
    let message = sweep(Measure::RequiredDamping, None);
    assert!(message.contains("required_damping is no measure of a network") && message.contains("damping_margin"));
    let message = sweep(Measure::PeakTorque, Some("pull"));
    assert!(message.contains("no station's world has a scenario \"pull\"; there is push"), "{message}");
    let axes = ["loop.period=1ms..2ms:2".to_string()];
    let wheel = Source::from_text("w.toml", "loop.period = '1 ms'\ndevice.inertia = 1e-3\n");
    let refused = Sweep::new(&wheel, &[], &axes, &[Measure::Releases], None);
    assert!(matches!(refused, Err(Error::Measure(message)) if message.contains("let_go is no measure of a world")));
}

/// Devices with this part of the damping that the certificate requires of them.
fn damped(source: &Source, part: f64) -> System {
    let mut network = System::read(source, &[]).unwrap();
    let check = check_network(&network).unwrap();
    for (station, check) in network.stations.iter_mut().zip(&check.stations) {
        station.world.device.damping = part * check.required_damping.unwrap();
    }
    assert_eq!(check_network(&network).unwrap().certified, part > 1.0);
    network
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1, ..ProptestConfig::default() })]

    /// From a network that is certified no hands draw, with the messages of the file or as late as the ages allow; with a quarter less of
    /// the damping some do.
    #[test]
    fn the_worst_hands_together_draw_from_refused_networks_and_never_from_certified_ones(
        stiff in prop::array::uniform2(0.05..0.4f64),
        age in 25e-3..40e-3f64,
        spring in 0.0..0.5f64,
        delay in 0.2e-3..3e-3f64,
    ) {
        let of = |network: &System| search_network(network, &|_| ControlFlow::Continue(())).unwrap();
        let source = |law| row(&[0.1, 0.1, 0.1, stiff[0], stiff[1], age, spring, delay], law);
        let safe = of(&damped(&source(WALL), 1.0 + 1e-6));
        prop_assert!(safe.certified && !safe.broken && safe.drawn.gain <= safe.drawn.blur, "{:?}", safe.drawn);
        prop_assert!(safe.breaking_part.is_none_or(|part| part < 1.0));
        let source = source("kind = 'spring'");
        let worst = of(&damped(&source, 0.75));
        prop_assert!(!worst.certified && worst.broken && worst.late, "{:?}", worst);
        // Its numbers are those of the run of its network, which has only this scenario.
        let mut run = Run::new(&worst.network, "worst").unwrap();
        let (mut hands, mut most) = ([0.0; 3], 0.0f64);
        while let Some(Ok(row)) = run.next() {
            hands[row.station] = row.row.ledger.hand;
            most = most.max(-hands.iter().sum::<f64>());
        }
        prop_assert!(most >= worst.drawn.gain && worst.drawn.gain > 0.0, "{} {}", most, worst.drawn.gain);
    }
}
