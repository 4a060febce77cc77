//! Stations joined by links: how they run, and what the check asks of them. Random networks are in `cargo xtask truth`.

use hapt_analysis::check_network;
use hapt_model::{Network, Source};
use hapt_sim::NetworkRun;

/// Two equal wheels, joined by a spring of K over a way that takes nearly all of the age, one of them pushed for a moment.
fn pair(stiffness: f64, damping: f64, more: &str) -> Network {
    let mut source = Source::from_text(
        "pair.toml",
        format!(
            "stations = {{ left = {{ world = \"pushed.toml\" }}, right = {{ world = \"wheel.toml\" }} }}\n[[links]]\nkind = \"spring\"\n\
             between = [\"left\", \"right\"]\nstiffness = {stiffness}\ndelay = \"18 ms\"\nage_max = \"20 ms\"\n{more}"
        ),
    );
    let wheel = format!("loop.period = \"1 ms\"\ndevice = {{ inertia = 1e-3, damping = {damping} }}\n");
    let hand = "hand = { kind = \"torque\", moves = { kind = \"path\", file = \"push.csv\" } }";
    source.files.insert("push.csv".into(), "time_s,torque_Nm\n0,0\n0.2,0\n0.21,0.05\n0.22,0\n".into());
    source.files.insert("pushed.toml".into(), format!("{wheel}[scenarios.all]\nduration = \"6 s\"\n{hand}\n"));
    source.files.insert("wheel.toml".into(), wheel);
    Network::read(&source, &[]).unwrap()
}

/// The largest speeds of the first wheel from 1 s to 2 s, and from 5 s on.
fn speeds(network: &Network) -> [f64; 2] {
    let mut run = NetworkRun::new(network, "all").unwrap();
    let mut speeds = [0.0f64; 2];
    while let Some(row) = run.next() {
        let row = row.unwrap().row;
        let at = if row.time >= 5.0 { Some(1) } else { ((1.0..2.0).contains(&row.time)).then_some(0) };
        if let Some(at) = at {
            speeds[at] = speeds[at].max(row.puck_velocity.abs());
        }
    }
    speeds
}

#[test]
fn two_wheels_on_a_late_spring_ring_below_what_is_asked_of_them_and_not_at_it() {
    let required = |network: &Network| check_network(network).unwrap().stations[0].required_damping.unwrap();
    let asked = required(&pair(1.0, 0.0, ""));
    // K (T/2 + A): the own hold, and half of the ages of both.
    assert!((asked - (0.5e-3 + 20e-3)).abs() < 1e-12, "{asked}");
    // Below, the wheels swing against each other, ever faster.
    let [early, late] = speeds(&pair(1.0, 0.3 * asked, ""));
    assert!(late > 2.0 * early, "{early} and {late} rad/s");
    let [early, late] = speeds(&pair(1.0, asked, ""));
    assert!(late < 0.1 * early, "{early} and {late} rad/s");
}

#[test]
fn the_largest_stiffness_and_age_are_where_the_network_is_passive_no_longer() {
    for damping in [0.005, 0.02, 0.1] {
        let network = pair(0.01, damping, "");
        let check = check_network(&network).unwrap();
        let most = check.links[0].stiffness_max.unwrap();
        // K (T/2 + A) = b
        assert!((most * 20.5e-3 / damping - 1.0).abs() < 1e-6, "{most}");
        assert!((check.remedies.stiffness_scale.unwrap() * 0.01 / most - 1.0).abs() < 1e-6);
        for (part, passive) in [(1.0, true), (1.0 + 1e-6, false)] {
            let check = check_network(&pair(most * part, damping, "")).unwrap();
            assert_eq!(check.stations.iter().all(|station| station.passive), passive, "{part}");
        }
        let ages = check.remedies.age_scale.unwrap() * 20e-3;
        assert!((0.01 * (0.5e-3 + ages) / damping - 1.0).abs() < 1e-6, "{ages}");
    }
}

#[test]
fn a_strong_device_takes_a_part_of_what_is_asked_of_a_weak_one() {
    let mut network = pair(1.0, 0.0, "");
    let alone = 0.5e-3 + 20e-3;
    // (b_1 - K a)(b_2 - K a) = (K A)²
    let share = |weak: f64| 0.5e-3 + 20e-3 * 20e-3 / (weak - 0.5e-3);
    for part in [0.2, 0.5, 0.9] {
        let weak = part * alone;
        for (more, passive) in [(1e-6, true), (-1e-6, false)] {
            network.stations[0].world.device.damping = weak;
            network.stations[1].world.device.damping = share(weak) * (1.0 + more);
            let check = check_network(&network).unwrap();
            assert_eq!(check.stations.iter().all(|station| station.passive), passive, "{part} {more}");
            let least = check.remedies.device_damping[1].1.unwrap();
            assert!((least / share(weak) - 1.0).abs() < 1e-6, "{least}");
        }
    }
}

#[test]
fn a_link_without_messages_lets_go_and_no_torque_is_left() {
    let network = pair(1.0, 0.05, "loss = 1\n");
    let mut run = NetworkRun::new(&network, "all").unwrap();
    while let Some(row) = run.next() {
        assert_eq!(row.unwrap().link, 0.0);
    }
    // One way is enough: an end that hears nothing says so, or says nothing.
    let network = pair(1.0, 0.05, "loss = 0.9\nseed = 3\n");
    let mut run = NetworkRun::new(&network, "all").unwrap();
    let (mut acting, mut silent) = (0, 0);
    while let Some(row) = run.next() {
        let link = row.unwrap().link;
        *(if link == 0.0 { &mut silent } else { &mut acting }) += 1;
    }
    assert!(silent > 0 && run.let_go().flatten().sum::<u64>() > 0, "{acting} {silent}");
}

#[test]
fn the_same_network_gives_the_same_rows_again() {
    let network = pair(1.0, 0.05, "loss = 0.3\nseed = 7\n");
    let rows = || {
        let mut run = NetworkRun::new(&network, "all").unwrap();
        let mut rows = Vec::new();
        while let Some(row) = run.next() {
            let row = row.unwrap();
            rows.push((row.station, row.link.to_bits(), row.row.puck.to_bits()));
        }
        rows
    };
    let (one, other) = (rows(), rows());
    assert!(one.len() == 2 * 6001 && one == other);
}

/// A wheel whose link has no stiffness is the wheel alone, to the bit.
#[test]
fn a_station_without_links_runs_as_its_world_alone() {
    let network = pair(0.0, 0.005, "");
    let station = &network.stations[0];
    let mut alone = hapt_sim::Simulation::new(&station.world, &station.world.scenarios[0]).unwrap();
    let mut run = NetworkRun::new(&network, "all").unwrap();
    while let Some(row) = run.next() {
        let row = row.unwrap();
        if row.station == 0 {
            assert_eq!(row.row, alone.next().unwrap().unwrap());
        }
    }
    assert!(alone.next().is_none());
}
