//! A run in a lane is bit-identical to the single run.

use crate::common::*;
use hapt_model::*;
use hapt_sim::{LANES, Outcome, Simulation, Summary, run_batch};
use hapt_testing::prelude::*;

/// Numbers for worlds that share a seed and differ in a lane.
struct Dice(u64);

impl Dice {
    /// On [0, 1): Steele, Lea and Flood's SplitMix.
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.roll() * n as f64) as usize
    }

    fn chance(&mut self, p: f64) -> bool {
        self.roll() < p
    }

    fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.roll()
    }
}

/// A nonlinear coupling, its law by `kind`.
fn nonlinear(kind: usize, number: &mut Dice) -> (Law, Option<f64>) {
    let (torque, stiffness, at) = (number.between(0.001, 0.1), number.between(0.1, 20.0), number.between(-0.5, 0.5));
    let (width, damping) = (number.between(0.01, 0.3), number.between(0.0, 0.01));
    let law = match kind {
        0 => Law::Wall { side: Side::Above, at, stiffness, damping },
        1 => Law::Detent { torque, pitch: width, phase: at },
        2 => Law::DeadBand { stiffness, rest: at, width },
        3 => Law::Coulomb { torque },
        4 => Law::Lugre {
            coulomb: torque,
            stribeck: 1.5 * torque,
            stribeck_velocity: 0.1,
            bristle_stiffness: stiffness,
            bristle_damping: damping,
            viscous: 1e-3,
        },
        5 => Law::Damper { damping: Damping::Fixed(damping) },
        _ => Law::Spring { stiffness, rest: at },
    };
    let clamped = matches!(law, Law::Damper { .. } | Law::Spring { .. });
    (law, clamped.then_some(torque))
}

/// What all lanes have in common, by `seed`, with the numbers of one of them, by `lane`.
fn world(seed: u64, lane: u64, runaway: bool) -> World {
    let (shape, number) = (&mut Dice(seed), &mut Dice(seed ^ (lane + 1).wrapping_mul(0x2545_f491_4f6c_dd1d)));
    let mut world = bare();
    let sampling = &mut world.sampling;
    sampling.method = Method::ALL[shape.below(8)];
    sampling.output =
        if sampling.method.takes_new_sample_first() { Output::Start } else { Output::ALL[shape.below(3)] };
    sampling.advance = if sampling.output == Output::End { shape.below(3) as u32 } else { 0 };
    sampling.estimator = EstimatorKind::ALL[shape.below(EstimatorKind::ALL.len())];
    sampling.window = 1 + number.below(20) as u32;
    sampling.cutoff = Some(number.between(20.0, 200.0));
    sampling.acceleration = Some(10_f64.powf(number.between(0.0, 4.0)));
    // Periods differ, and with them the rows; delays are the same number of samples in most lanes.
    sampling.period = if shape.chance(0.5) { 1e-3 } else { number.between(0.5e-3, 2e-3) };
    let samples = if shape.chance(0.5) { 0.0 } else { shape.below(4) as f64 };
    let samples = if number.chance(0.1) { number.between(0.0, 3.0) } else { samples };
    sampling.delay = Delay::Seconds(samples * sampling.period);
    let device = &mut world.device;
    device.inertia *= number.between(0.5, 2.0);
    device.damping *= number.between(0.0, 2.0);
    device.encoder = shape.chance(0.5).then(|| number.between(100.0, 8000.0));
    device.limit = shape.chance(0.5).then(|| number.between(0.1, 1.0));
    device.levels = (device.limit.is_some() && shape.chance(0.5)).then(|| 2 * (1 + number.below(1000) as u32));
    // Properties of the device that its lane advances separately.
    let mut some = |of: (f64, f64)| if number.chance(0.15) { number.between(of.0, of.1) } else { 0.0 };
    (device.friction, device.lag) = (some((1e-3, 0.05)), some((1e-4, 5e-3)));
    device.friction_backward = Some(some((1e-3, 0.05))).filter(|backward| *backward > 0.0);
    let changes = FrictionByPosition {
        share: some((0.1, 0.5)),
        pitch: 0.3,
        phase: 0.1,
        waveform: Waveform { sine: [1.0, 0.0, 0.0, 0.0], cosine: [0.5, 0.3, 0.0, 0.0] },
    };
    device.friction_by_position = Some(changes).filter(|changes| changes.share > 0.0);
    device.stribeck =
        Some(Stribeck { torque: some((1e-3, 0.05)), velocity: 1.0 }).filter(|stribeck| stribeck.torque > 0.0);
    let stops = Stops { low: None, high: Some(some((0.01, 0.3))), stiffness: 20.0, damping: 0.0 };
    device.stops = Some(stops).filter(|stops| stops.high > Some(0.0));
    let handle = Handle { inertia: some((1e-4, 1e-3)), stiffness: 20.0, damping: some((0.0, 1e-3)) };
    device.handle = (handle.inertia > 0.0).then_some(handle);
    let gravity = Gravity { torque: some((1e-3, 0.1)), phase: 1.0 };
    device.torque.gravity = (gravity.torque > 0.0).then_some(gravity);

    let n = shape.below(5);
    let new_sample_first = world.sampling.method.takes_new_sample_first();
    for i in 0..n {
        let (position, velocity) = (number.between(-1.0, 1.0), number.between(-1.0, 1.0));
        world.names.push(format!("b{i}"));
        world.bodies.push(Body { inertia: number.between(0.002, 0.05), position, velocity });
    }
    let end = |i: usize| {
        if i < n {
            End::Body(i)
        } else if i == n {
            End::Puck
        } else {
            End::Ground
        }
    };
    for _ in 0..shape.below(7) {
        let first = shape.below(n + 1);
        let second = first + 1 + shape.below(n + 1 - first);
        let law = match shape.below(5) {
            0 => Law::Damper { damping: Damping::Fixed(number.between(0.0, 0.01)) },
            1 if !new_sample_first => Law::Constant { torque: number.between(-0.1, 0.1) },
            _ if runaway && lane == 5 => Law::Spring { stiffness: 1e8, rest: 1.0 },
            _ => Law::Spring { stiffness: number.between(0.1, 5.0), rest: number.between(-0.2, 0.2) },
        };
        world.couplings.push(Coupling { first: end(first), second: end(second), law, limit: None });
    }
    if shape.chance(0.3) && world.couplings.iter().any(|c| matches!(c.law, Law::Spring { .. })) {
        let spring = *world.couplings.iter().find(|c| matches!(c.law, Law::Spring { .. })).unwrap();
        world.couplings.push(Coupling { law: Law::Damper { damping: Damping::Compensating }, ..spring });
    }

    // Two rates in all lanes or in none.
    if shape.chance(0.3) {
        world.sampling.bodies_every = 2 + shape.below(4) as u32;
        if hapt_sim::check(&world).is_err() {
            world.sampling.bodies_every = 1;
        }
    }

    // Nonlinear couplings, the same in all lanes or different in each.
    if shape.chance(0.6) {
        let linear = world.couplings.clone();
        let kinds = &mut Dice(if shape.chance(0.5) { seed } else { seed ^ lane });
        for _ in 0..kinds.below(3).min(8 - linear.len()) {
            let first = kinds.below(n + 1);
            let second = first + 1 + kinds.below(n + 1 - first);
            let (law, limit) = nonlinear(kinds.below(7), number);
            world.couplings.push(Coupling { first: end(first), second: end(second), law, limit });
        }
        if hapt_sim::check(&world).is_err() {
            world.couplings = linear;
        }
    }
    let period = world.sampling.period;
    // On a sample, or between two.
    let between = shape.chance(0.5);
    let mut time = |most: usize| {
        let after = if between && number.chance(0.7) { number.roll() } else { 0.0 };
        (number.below(most) as f64 + after) * period
    };
    let (at, over, release) = (time(100), time(100) + period, time(300));
    let mut t = 0.0;
    let times = [(); 6].map(|()| {
        t += time(60) + period;
        t
    });
    let [hold, open] = [time(100) + period, time(50) + period];
    let release = Some(release).filter(|_| shape.chance(0.6));
    let duration = if shape.chance(0.5) { 300.0 * period } else { 0.3 };
    let to = number.between(-1.0, 1.0);
    let mut moves = |size: f64| match number.below(4) {
        0 => Shape::Ramp { to: size * to, at, over },
        1 => {
            Shape::Sine { amplitude: size * to, frequency: number.between(0.5, 20.0), phase: number.between(-3.0, 3.0) }
        }
        2 => Shape::Path { file: "p.csv".into(), points: times.map(|t| (t, size * number.between(-1.0, 1.0))).into() },
        _ => Shape::Step { to: size * to, at },
    };
    let drive = match shape.below(6) {
        0..3 => Drive::Position(moves(1.0)),
        3 => Drive::Torque(moves(0.1)),
        4 => Drive::Torque(Shape::Step { to: 0.1 * to, at }),
        _ => {
            let moves = moves(1.0);
            let switching = number.chance(0.3).then_some(Switching { hold, open });
            let (damping, stiffness) = (number.between(0.0, 0.02), number.between(0.1, 5.0));
            Drive::Grip { inertia: number.between(0.0, 1e-3), damping, stiffness, moves, switching }
        }
    };
    let mut scenario = scenario(duration, drive, release);
    if number.chance(0.15) && world.sampling.delay_s() < period {
        world.sampling.interval_max = Some(number.between(1.0, 2.0) * period);
        scenario.timing = Timing::Random { seed: number.below(1000) as u32, shortest: None };
    }
    world.scenarios = vec![scenario];
    world
}

fn worlds(of: impl Fn(u64) -> World) -> Box<[World; LANES]> {
    Box::new(std::array::from_fn(|lane| of(lane as u64)))
}

/// The single run; `None` where it stops being finite.
fn single(world: &World) -> Option<Outcome> {
    let mut run = Simulation::new(world, &world.scenarios[0]).unwrap();
    let mut summary = Summary::new(world, &run);
    while let Some(row) = run.next() {
        summary.add(row.ok()?);
    }
    Some(Outcome { peak_torque: summary.peak_torque, final_energy: summary.final_energy() })
}

fn bits(outcome: Option<Outcome>) -> Option<[u64; 2]> {
    outcome.map(|run| [run.peak_torque.to_bits(), run.final_energy.to_bits()])
}

proptest! {
    #![proptest_config(hapt_testing::cases(160))]

    #[test]
    fn a_lane_is_bit_identical_to_the_single_run(seed in any::<u64>(), runaway in any::<bool>()) {
        let worlds = worlds(|lane| world(seed, lane, runaway));
        let outcomes = run_batch(&worlds.each_ref(), 0, &|| false);
        prop_assert!(outcomes.is_some(), "these worlds fit: {:#?}", worlds[0]);
        for (lane, (world, outcome)) in worlds.iter().zip(outcomes.unwrap()).enumerate() {
            prop_assert_eq!(bits(outcome), bits(single(world)), "lane {}: {:#?}", lane, world);
        }
    }
}

/// Under forward Euler a stiff spring makes one lane diverge to infinity, and no other.
#[test]
fn a_lane_that_diverges_does_not_change_the_others() {
    let of = |lane: u64| {
        let mut world = wheel(Method::ForwardEuler, Output::Start);
        world.scenarios = vec![scenario(1.0, step(0.5, 0.0), Some(0.25))];
        let stiffness = if lane == 3 { 1e6 } else { STIFFNESS * (1.0 + 0.01 * lane as f64) };
        world.couplings[0].law = Law::Spring { stiffness, rest: 0.0 };
        world
    };
    let worlds = worlds(of);
    let outcomes = run_batch(&worlds.each_ref(), 0, &|| false).unwrap();
    for (lane, (world, outcome)) in worlds.iter().zip(outcomes).enumerate() {
        assert_eq!(outcome.is_none(), lane == 3);
        assert_eq!(bits(outcome), bits(single(world)), "lane {lane}");
    }
}

#[test]
fn a_batch_ends_when_it_is_cancelled() {
    let of = |lane: u64| {
        let mut world = wheel(Method::Zoh, Output::End);
        world.scenarios = vec![scenario(20.0, step(0.5, 0.0), Some(0.25 + 1e-4 * lane as f64))];
        world
    };
    let worlds = worlds(of);
    let samples = (20.0 / worlds[0].sampling.period) as u32;
    let calls = std::cell::Cell::new(0);
    let after = |times: u32| {
        calls.set(0);
        run_batch(&worlds.each_ref(), 0, &|| {
            calls.set(calls.get() + 1);
            calls.get() == times
        })
        .unwrap()
    };
    assert!(after(u32::MAX).iter().all(Option::is_some));
    assert_eq!(calls.get(), samples / 4096 + 1);
    assert_eq!(after(3).iter().flatten().count(), 0);
    assert_eq!(calls.get(), 3);
}

/// Loops in lanes may differ in their numbers and nonlinear couplings; devices may differ in everything.
#[test]
fn a_loop_of_another_kind_does_not_fit_a_batch() {
    let fit = |change: &dyn Fn(&mut World, u64)| {
        let of = |lane| {
            let mut world = wheel(Method::Zoh, Output::End);
            world.scenarios = vec![scenario(0.1, step(0.5, 0.0), Some(0.05))];
            change(&mut world, lane);
            world
        };
        run_batch(&worlds(of).each_ref(), 0, &|| false).is_some()
    };
    let of_puck = |law| Coupling { first: End::Puck, second: End::Ground, law, limit: None };
    assert!(fit(&|_, _| ()));
    assert!(fit(&|world, lane| if lane == 7 {
        world.couplings.push(of_puck(Law::Coulomb { torque: 0.1 }))
    }));
    assert!(!fit(&|world, _| world.couplings = vec![of_puck(Law::Coulomb { torque: 0.1 }); 9]));
    assert!(!fit(&|world, lane| if lane == 7 {
        world.sampling.method = Method::Tustin;
        world.sampling.output = Output::Start
    }));
    assert!(!fit(&|world, lane| world.device.encoder = (lane == 7).then_some(4000.0)));
    assert!(!fit(
        &|world, lane| world.sampling.estimator = [EstimatorKind::Exact, EstimatorKind::Difference][lane as usize % 2]
    ));
    let foaw = |world: &mut World, window| {
        (world.sampling.estimator, world.sampling.window) = (EstimatorKind::Foaw, window);
        world.device.encoder = Some(4000.0);
    };
    assert!(fit(&|world, lane| foaw(world, 1 + lane as u32)));
    assert!(!fit(&|world, _| foaw(world, 33)));
    assert!(!fit(&|world, _| world.bodies = vec![world.bodies[0]; 5]));
    assert!(fit(&|world, lane| if lane == 7 {
        world.device.friction = 1e-3
    }));
    // A timing that does not suit the loop is refused as in a single run, and the worst pattern has to be found before.
    assert!(!fit(&|world, _| world.scenarios[0].timing = Timing::Worst));
}
