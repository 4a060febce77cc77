//! Networks of stations: edges against closed forms and against the check, cells against the check and the run alone.

use hapt_analysis::check_network;
use hapt_model::{Network, Source, System};
use hapt_sweep::boundary::{Boundary, Claim, Edge};
use proptest::prelude::*;

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

/// K T (1/2 + (M + 1)/2) = b at whole delays of M samples for the round trip; the way to a sample is its delay, or a period at least.
#[test]
fn the_edge_at_fixed_times_is_a_staircase_over_the_delay() {
    let source = pair(0.005, "stiffness = 0.2\nage_max = '20 ms'");
    let found = claim(&source, ["links.0.delay=0.5ms..2.5ms", "links.0.stiffness=0.2..4"], Edge::Fixed);
    let points: Vec<[f64; 2]> = found.pieces.iter().flat_map(|piece| &piece.points).map(|point| point.values).collect();
    for way in 1..=2 {
        // Between two whole delays a message waits for the next sample.
        let stiffness = 0.005 / (1e-3 * (0.5 + (f64::from(2 * way) + 1.0) / 2.0));
        let on_step = points.iter().filter(|[delay, _]| (delay - 1e-3 * (f64::from(way) - 0.5)).abs() < 0.3e-3);
        let seen = on_step
            .map(|[_, k]| (k / stiffness - 1.0).abs())
            .fold((0, 0.0), |(n, most), left| (n + 1, f64::max(most, left)));
        assert!(seen.0 > 3 && seen.1 < 1e-5, "{way}: {seen:?} {stiffness}");
    }
}

/// A network of three in a row with random numbers.
fn row(numbers: &[f64; 8]) -> Source {
    let [b0, b1, b2, k0, k1, age, spring, delay] = numbers;
    let mut source = Source::from_text(
        "row.toml",
        format!(
            "stations.a.world = 'a.toml'\nstations.b.world = 'b.toml'\nstations.c.world = 'c.toml'\n\
             [[links]]\nkind = 'spring'\nbetween = ['a', 'b']\nstiffness = {k0}\ndelay = {delay}\nage_max = {age}\n\
             [[links]]\nkind = 'wall'\nside = 'above'\nat = 0.1\nbetween = ['b', 'c']\nstiffness = {k1}\ndelay = {delay}\nage_max = {age}\n"
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

fn network(system: System) -> Network {
    match system {
        System::Network(network) => network,
        System::World(_) => panic!("the file has stations"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2, ..ProptestConfig::default() })]

    /// A little to each side of every point of both edges `check` says what the edge says.
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
        let source = row(&[b0, b1, b2, k0, k1, age, spring, delay]);
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
fn there_is_no_edge_at_fixed_times_where_none_are_fixed() {
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
