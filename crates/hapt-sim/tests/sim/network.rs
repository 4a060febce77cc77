//! Stations joined by links: their runs, and the damping that the check requires of them. Random networks are in `cargo xtask truth`.

mod channel;
mod damping;

use hapt_analysis::check_network;
use hapt_model::{Source, System};
use hapt_sim::Run;

/// Two equal wheels, joined by a spring of K over a channel whose delay is nearly the largest age; one of them is pushed briefly.
fn pair(stiffness: f64, damping: f64, more: &str) -> System {
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
    System::read(&source, &[]).unwrap()
}

/// The largest speeds of the first wheel from 1 s to 2 s, and from 5 s on.
fn speeds(network: &System) -> [f64; 2] {
    let mut run = Run::new(network, "all").unwrap();
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
fn two_wheels_on_a_delayed_spring_ring_below_the_required_damping_and_not_at_it() {
    let required = |network: &System| check_network(network).unwrap().stations[0].required_damping.unwrap();
    let required = required(&pair(1.0, 0.0, ""));
    // K (T/2 + A): the own hold, and half of the ages of both.
    assert!((required - (0.5e-3 + 20e-3)).abs() < 1e-12, "{required}");
    // Below, the wheels swing against each other, ever faster.
    let [early, late] = speeds(&pair(1.0, 0.3 * required, ""));
    assert!(late > 2.0 * early, "{early} and {late} rad/s");
    let [early, late] = speeds(&pair(1.0, required, ""));
    assert!(late < 0.1 * early, "{early} and {late} rad/s");
}

#[test]
fn the_largest_stiffness_and_age_are_the_limits_of_passivity() {
    for damping in [0.005, 0.02, 0.1] {
        let network = pair(0.01, damping, "");
        let check = check_network(&network).unwrap();
        let most = check.links[0].stiffness_max.unwrap();
        // K (T/2 + A) = b
        assert!((most * 20.5e-3 / damping - 1.0).abs() < 1e-6, "{most}");
        assert!((check.remedies.as_ref().unwrap().stiffness_scale.unwrap() * 0.01 / most - 1.0).abs() < 1e-6);
        for (part, passive) in [(1.0, true), (1.0 + 1e-6, false)] {
            let check = check_network(&pair(most * part, damping, "")).unwrap();
            assert_eq!(check.stations.iter().all(|station| station.passive), passive, "{part}");
        }
        let ages = check.remedies.as_ref().unwrap().age_scale.unwrap() * 20e-3;
        assert!((0.01 * (0.5e-3 + ages) / damping - 1.0).abs() < 1e-6, "{ages}");
    }
}

#[test]
fn a_strongly_damped_device_supplies_a_part_of_the_damping_required_of_a_weak_one() {
    let mut network = pair(1.0, 0.0, "");
    let equal = 0.5e-3 + 20e-3;
    // (b_1 - K a)(b_2 - K a) = (K A)²
    let share = |weak: f64| 0.5e-3 + 20e-3 * 20e-3 / (weak - 0.5e-3);
    for part in [0.2, 0.5, 0.9] {
        let weak = part * equal;
        for (more, passive) in [(1e-6, true), (-1e-6, false)] {
            network.stations[0].world.device.damping = weak;
            network.stations[1].world.device.damping = share(weak) * (1.0 + more);
            let check = check_network(&network).unwrap();
            assert_eq!(check.stations.iter().all(|station| station.passive), passive, "{part} {more}");
            let least = check.remedies.as_ref().unwrap().device_damping[1].1.unwrap();
            assert!((least / share(weak) - 1.0).abs() < 1e-6, "{least}");
        }
    }
}

#[test]
fn a_link_without_messages_releases_and_gives_no_torque() {
    let network = pair(1.0, 0.05, "loss = 1\n");
    let mut run = Run::new(&network, "all").unwrap();
    while let Some(row) = run.next() {
        assert_eq!(row.unwrap().link, 0.0);
    }
    // Loss in one direction is enough: an end that receives nothing reports that in its own messages, if those arrive.
    let network = pair(1.0, 0.05, "loss = 0.9\nseed = 3\n");
    let mut run = Run::new(&network, "all").unwrap();
    let (mut acting, mut silent) = (0, 0);
    while let Some(row) = run.next() {
        let link = row.unwrap().link;
        *(if link == 0.0 { &mut silent } else { &mut acting }) += 1;
    }
    assert!(silent > 0 && run.releases().flatten().sum::<u64>() > 0, "{acting} {silent}");
}

/// For any delay and any motion of the hands, a link whose messages all arrive gives the torque of its spring from the first sample on, between
/// its own position and the newest one that has arrived.
#[test]
fn a_link_whose_messages_all_arrive_is_its_spring() {
    for (late, hand) in [(0, "step"), (3, "step"), (17, "step"), (5, "sine")] {
        let hand = match hand {
            "step" => "{ kind = \"step\", to = 0.3, at = 0 }",
            _ => "{ kind = \"sine\", amplitude = 0.4, frequency = 3 }",
        };
        let mut source = Source::from_text(
            "pair.toml",
            format!(
                "stations = {{ left = {{ world = \"moved.toml\" }}, right = {{ world = \"wheel.toml\" }} }}\n[[links]]\nkind = \"spring\"\n\
                 between = [\"left\", \"right\"]\nstiffness = 0.3\ndelay = {}\nage_max = \"20 ms\"\n",
                1e-3 * (f64::from(late) + 0.3)
            ),
        );
        let wheel = "loop.period = \"1 ms\"\ndevice = { inertia = 1e-3, damping = 0.05 }\n";
        source
            .files
            .insert("moved.toml".into(), format!("{wheel}[scenarios.all]\nduration = \"1 s\"\nhand = {hand}\n"));
        source.files.insert("wheel.toml".into(), wheel.into());
        let network = System::read(&source, &[]).unwrap();
        let mut run = Run::new(&network, "all").unwrap();
        let mut seen = [vec![], vec![]];
        while let Some(row) = run.next() {
            let row = row.unwrap();
            seen[row.station].push((row.row.measured, row.link));
        }
        for (own, other) in [(0, 1), (1, 0)] {
            for (k, (measured, link)) in seen[own].iter().enumerate() {
                let received = k.checked_sub(1 + late as usize).map_or(0.0, |before| seen[other][before].0);
                let law = 0.3 * (received - measured);
                assert!((link - law).abs() < 1e-12, "{hand} {late}: {link} N m and not {law} at sample {k}");
            }
        }
        assert_eq!(run.releases().flatten().sum::<u64>(), 0);
    }
}

#[test]
fn the_same_network_gives_the_same_rows_again() {
    let network = pair(1.0, 0.05, "loss = 0.3\nseed = 7\n");
    let rows = || {
        let mut run = Run::new(&network, "all").unwrap();
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

/// A wheel whose link has no stiffness is bit-identical to the wheel without a link.
#[test]
fn a_station_without_links_runs_as_its_world() {
    let network = pair(0.0, 0.005, "");
    let station = &network.stations[0];
    let mut single = hapt_sim::Simulation::new(&station.world, &station.world.scenarios[0]).unwrap();
    let mut run = Run::new(&network, "all").unwrap();
    while let Some(row) = run.next() {
        let row = row.unwrap();
        if row.station == 0 {
            assert_eq!(row.row, single.next().unwrap().unwrap());
        }
    }
    assert!(single.next().is_none());
}

/// Random numbers that are the same in every run.
struct Rng(u64);

impl Rng {
    fn f64(&mut self) -> f64 {
        hapt_sim::uniform(&mut self.0)
    }

    fn usize(&mut self, range: std::ops::Range<usize>) -> usize {
        range.start + (self.f64() * range.len() as f64) as usize
    }

    fn bool(&mut self) -> bool {
        self.f64() < 0.5
    }
}

/// A pair of equal wheels at one period, with a channel of this `delay`, the second's samples `phase` later.
fn even(period: f64, delay: f64, phase: f64, more: [&str; 2]) -> System {
    let mut source = Source::from_text(
        "pair.toml",
        format!(
            "stations = {{ left = {{ world = \"left.toml\" }}, right = {{ world = \"right.toml\", phase = {phase} }} }}\n[[links]]\n\
             kind = \"spring\"\nbetween = [\"left\", \"right\"]\nstiffness = 1\ndelay = {delay}\nage_max = {}\n",
            delay + 20.0 * period
        ),
    );
    for (name, more) in ["left.toml", "right.toml"].into_iter().zip(more) {
        let world = format!("loop.period = {period}\ndevice = {{ inertia = 1e-3, damping = 0.01 }}\n{more}");
        source.files.insert(name.into(), world);
    }
    System::read(&source, &[]).unwrap()
}

fn fixed(network: &System) -> hapt_analysis::FixedRates {
    check_network(network).unwrap().fixed
}

fn requires(network: &System, station: usize) -> f64 {
    fixed(network).required_damping[station].1.unwrap()
}

/// With equal periods and whole delays the remote positions at the two ends are m and n samples old; M = m + n. Both wheels need
/// KT(1/2 + (M + 1)/2).
#[test]
fn at_equal_periods_the_requirement_depends_only_on_the_round_trip() {
    let period = 2e-3;
    for (delay, phase, trip) in
        [(0.0, 0.0, 2.0), (2e-3, 0.0, 2.0), (6e-3, 0.0, 6.0), (0.0, 1e-3, 1.0), (3e-3, 1e-3, 3.0), (5e-3, 0.5e-3, 6.0)]
    {
        let network = even(period, delay, phase, ["", ""]);
        for station in 0..2 {
            let exact = period * (0.5 + 0.5 * (trip + 1.0));
            let required = requires(&network, station);
            assert!((required / exact - 1.0).abs() < 1e-6, "{delay} {phase}: {required} of {exact}");
        }
        let check = fixed(&network);
        assert!(check.exact && check.proved && check.at_hz == Some(0.0), "{check:?}");
    }
}

/// (b_1 - KT/2)(b_2 - KT/2) = (KT (M + 1)/2)²
#[test]
fn at_equal_periods_too_a_strongly_damped_device_supplies_a_part() {
    for weak in [0.0015, 0.002, 0.004] {
        let mut network = even(2e-3, 0.0, 0.0, ["", ""]);
        let strong = 1e-3 + (3e-3f64).powi(2) / (weak - 1e-3);
        for (more, passive) in [(1e-5, true), (-1e-5, false)] {
            network.stations[0].world.device.damping = weak;
            network.stations[1].world.device.damping = strong * (1.0 + more);
            assert_eq!(fixed(&network).passive, Some(passive), "{weak} {more}");
        }
    }
}

/// Also with a delay of a fraction of a sample the requirement is that of the world's own certificate.
#[test]
fn a_link_of_vanishing_stiffness_requires_the_damping_of_the_world() {
    for delay in [0.0, 0.3, 1.0, 1.5, 2.9] {
        for couplings in [
            "stiffness = 2\n",
            "stiffness = 2\n[[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"ground\"]\ndamping = 3e-3\n",
        ] {
            let world = format!(
                "loop.delay = \"{delay} samples\"\n[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\n{couplings}"
            );
            let mut network = even(1e-3, 2e-3, 0.0, [&world, &world]);
            let unlinked = hapt_analysis::required_damping(&network.stations[0].world).unwrap().unwrap();
            for stiffness in [1e-7, 0.0] {
                network.links[0] = network.links[0].with_stiffness(stiffness);
                let required = requires(&network, 0);
                assert!((required / unlinked - 1.0).abs() < 1e-5, "{delay}: {required} and {unlinked} of {world}");
            }
            for station in &mut network.stations {
                station.world.device.damping = 0.99 * unlinked;
            }
            assert_eq!(fixed(&network).passive, Some(false), "without a link too");
        }
    }
}

/// The computed limit against a closed form: the Hermitian part of b/T + K z^-m/(z - 1) of any links at one period, on a fine grid.
#[test]
fn the_limit_is_that_of_the_multivariable_condition_of_colgate_and_schenkel() {
    use nalgebra::{Complex, DMatrix};
    type C = Complex<f64>;
    let mut rng = Rng(7);
    let period = 1e-3;
    for _ in 0..12 {
        let n = 2 + rng.usize(0..3);
        let mut source = Source::from_text("network.toml", "");
        for i in 0..n {
            source.text += &format!("stations.s{i}.world = \"s{i}.toml\"\n");
            let delay = rng.usize(0..3);
            let world = format!("loop = {{ period = {period}, delay = \"{delay} samples\" }}\ndevice.inertia = 1e-3\n");
            source.files.insert(format!("s{i}.toml"), world);
        }
        // Rings too, whose delays no shift of the clocks removes.
        for i in 0..n {
            let (j, stiffness, delay) = ((i + 1) % n, 0.2 + rng.f64(), rng.usize(1..6) as f64 * period);
            if n > 2 || i == 0 {
                source.text += &format!(
                    "[[links]]\nkind = \"spring\"\nbetween = [\"s{i}\", \"s{j}\"]\nstiffness = {stiffness}\ndelay = {delay}\nage_max = 0.02\n"
                );
            }
        }
        let mut network = System::read(&source, &[]).unwrap();
        let required = fixed(&network).required_damping;
        let delay = |at: usize| (network.stations[at].world.sampling.delay_s() / period).round();
        let least = |part: f64| {
            let mut least = f64::INFINITY;
            for step in 1..=1500 {
                let angle = std::f64::consts::PI * f64::from(step) / 1500.0;
                let z = C::from_polar(1.0, angle);
                let mut p = DMatrix::from_element(n, n, C::from(0.0));
                for i in 0..n {
                    p[(i, i)] += required[i].1.unwrap() * part / period;
                }
                for link in &network.links {
                    let [i, j] = link.between;
                    let samples = (link.delay / period).round();
                    for (i, j) in [(i, j), (j, i)] {
                        let own = link.stiffness() * z.powf(-delay(i)) / (z - 1.0);
                        p[(i, i)] += own;
                        p[(i, j)] -= own * z.powf(-samples);
                    }
                }
                let hermitian = (&p + p.adjoint()) * C::from(0.5);
                least = hermitian.symmetric_eigenvalues().min().min(least);
            }
            least * period
        };
        let size = required.iter().map(|of| of.1.unwrap()).fold(0.0, f64::max);
        assert!(
            least(1.0) > -1e-9 * size && least(0.998) < 0.0,
            "{} {} of {size}: {}",
            least(1.0),
            least(0.998),
            source.text
        );
        for (station, (_, required)) in network.stations.iter_mut().zip(&required) {
            station.world.device.damping = required.unwrap();
        }
        assert_eq!(fixed(&network).passive, Some(true), "the dampings that it requires are enough");
    }
}

/// A wall between two equal wheels of a course, 500 N·mm/deg from a position of every 5 ms on a bus.
#[test]
fn the_wall_of_a_lab_requires_many_times_the_damping_of_its_wheels() {
    const DAMPING: f64 = 1.3e-3;
    let lab = |period: f64| {
        let mut source = Source::from_text(
            "wall.toml",
            "stations.left.world = \"lab.toml\"\nstations.right.world = \"lab.toml\"\n[[links]]\nkind = \"wall\"\nside = \"above\"\nat = 0\n\
             between = [\"left\", \"right\"]\nstiffness = \"500 N mm/deg\"\nperiod = \"5 ms\"\ndelay = \"0.25 ms\"\nage_max = \"8 ms\"",
        );
        let world = format!("loop.period = {period}\ndevice = {{ inertia = 4.5e-4, damping = {DAMPING} }}");
        source.files.insert("lab.toml".into(), world);
        System::read(&source, &[]).unwrap()
    };
    let parts = |period| {
        let check = check_network(&lab(period)).unwrap();
        assert_eq!((check.certified, check.fixed.passive), (false, Some(false)));
        [check.fixed.required_damping[0].1.unwrap(), check.stations[0].required_damping.unwrap()].map(|b| b / DAMPING)
    };
    // K (T/2 + A) at arbitrary times. At the lab's own times a loop much faster than the bus requires 65 times the damping, one of 1 ms more.
    let stiffness = 0.5 / 1f64.to_radians();
    for (period, fixed) in [(0.25e-3, 65.6), (1e-3, 94.0)] {
        let [exact, any] = parts(period);
        assert!((exact - fixed).abs() < 0.1, "{exact}");
        assert!((any - stiffness * (0.5 * period + 8e-3) / DAMPING).abs() < 1e-6, "{any}");
    }
}

/// Periods of small ratios, phases, delays of loops and links, links with long send periods.
fn rational(rng: &mut Rng) -> System {
    let n = 2 + rng.usize(0..2);
    let mut source = Source::from_text("network.toml", "");
    for i in 0..n {
        let period = 1e-3 * [1.0, 1.5, 2.0, 3.0][rng.usize(0..4)];
        let (phase, delay) = (period * rng.f64(), if rng.bool() { 0.0 } else { 1.3 * rng.f64() });
        source.text += &format!("stations.s{i} = {{ world = \"s{i}.toml\", phase = {phase} }}\n");
        let world = format!(
            "loop = {{ period = {period}, delay = \"{delay} samples\" }}\ndevice.inertia = {}\n\
             [scenarios.all]\nduration = 4\nhand = {{ kind = \"grip\", inertia = 0.6, stiffness = 0, moves = {{ kind = \"step\", to = 0 }} }}\n",
            1e-3 * (1.0 + rng.f64())
        );
        source.files.insert(format!("s{i}.toml"), world);
    }
    for i in 1..n {
        let seldom = if rng.bool() { String::new() } else { "period = 6e-3\n".into() };
        source.text += &format!(
            "[[links]]\nkind = \"spring\"\nbetween = [\"s{}\", \"s{i}\"]\nstiffness = {}\ndelay = {}\nage_max = 0.04\n{seldom}",
            i - 1,
            0.5 + rng.f64(),
            5e-3 * rng.f64()
        );
    }
    System::read(&source, &[]).unwrap()
}

#[test]
fn fixed_times_require_less_damping_than_arbitrary_times() {
    let mut rng = Rng(3);
    for _ in 0..20 {
        let mut network = rational(&mut rng);
        let check = check_network(&network).unwrap();
        for (station, (name, fixed)) in check.stations.iter().zip(&check.fixed.required_damping) {
            let any = station.required_damping.unwrap();
            assert!(fixed.unwrap() < any && fixed.unwrap() > 0.0, "{name}: {fixed:?} of {any}");
        }
        for (station, (_, fixed)) in network.stations.iter_mut().zip(&check.fixed.required_damping) {
            station.world.device.damping = fixed.unwrap();
        }
        let scale = fixed(&network).stiffness_scale.unwrap();
        assert!((scale - 1.0).abs() < 1e-5, "{scale}");
    }
}
