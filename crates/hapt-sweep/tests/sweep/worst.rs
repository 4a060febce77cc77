//! No hand draws energy from certified worlds; from refused ones some hand does.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use hapt_analysis::{Status, is_certified, passivity, required_damping};
use hapt_model::{
    Body, Coupling, Damping, Drive, End, Hand, Law, Method, Output, Scenario, Shape, Side, Source, World,
};
use hapt_sweep::worst::{
    Error, Exploit, WorstOfWorld, best_motion, drawn, most_runs_of_world, search_world, work_motion,
};
use hapt_testing::prelude::*;
use proptest::sample::select;

/// The Michigan wheel without limit, encoder or friction, at 1 ms.
fn bare() -> World {
    let file = "[loop]\nperiod = \"1 ms\"\n[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\n";
    World::read(&Source::from_text("bare.toml", file), &[]).unwrap()
}

fn to_ground(law: Law) -> Coupling {
    Coupling { first: End::Puck, second: End::Ground, law, limit: None }
}

fn spring(stiffness: f64) -> World {
    World { couplings: vec![to_ground(Law::Spring { stiffness, rest: 0.0 })], ..bare() }
}

fn search(world: &World) -> Result<WorstOfWorld, Error> {
    search_world(world, &|_| ControlFlow::Continue(()))
}

/// Nothing but an integral term or an assist at the puck: the loop grows by itself, and there is no spring by which a hand's is chosen.
#[test]
fn the_hand_of_a_loop_without_a_spring_is_one_that_a_file_can_have() {
    let laws = [Law::Integral { stiffness: 2.0, time: 1.5, rest: 0.0 }, Law::Assist { torque: 0.1, velocity: 0.03 }];
    for (law, limit) in [(laws[0], Some(0.9)), (laws[0], None), (laws[1], None)] {
        let world = World { couplings: vec![Coupling { limit, ..to_ground(law) }], ..bare() };
        let worst = search(&world).unwrap();
        assert!(worst.hand.to.is_finite() && worst.drawn.moved.is_finite(), "{law:?}: {worst:?}");
        let shown = World { scenarios: vec![worst.scenario], ..world };
        World::read(&Source::from_text("worst.toml", shown.to_toml()), &[]).unwrap();
    }
}

#[test]
fn a_hand_draws_from_a_refused_spring_and_none_from_a_certified_one() {
    let limit = 2.0 * bare().device.damping / bare().sampling.period;
    for part in [0.5, 0.98] {
        let worst = search(&spring(part * limit)).unwrap();
        assert!(worst.is_certified() && !worst.broken && !worst.drew && worst.linear.is_none(), "{worst:?}");
    }
    for part in [1.02, 1.5, 4.0] {
        let (world, seen) = (spring(part * limit), AtomicUsize::new(0));
        let worst = search_world(&world, &|runs| {
            seen.store(runs, Relaxed);
            ControlFlow::Continue(())
        })
        .unwrap();
        assert!(!worst.is_certified() && worst.broken, "{worst:?}");
        // The number of runs is within the announced bound.
        assert!((1..=most_runs_of_world(&world).unwrap()).contains(&seen.load(Relaxed)), "{seen:?}");
        let breaking = worst.gap.breaking_damping.unwrap();
        assert!((breaking / worst.gap.required_damping.unwrap() - 1.0).abs() < 1e-3, "{:?}", worst.gap);
        // The loop is linear, so the run shows the growth: a million times the hand's initial energy, unless that takes too long.
        assert!(worst.drew && worst.drawn.gain > worst.hand.energy(), "{worst:?}");
    }
}

#[test]
fn a_search_ends_where_its_watch_ends_it() {
    let seen = AtomicUsize::new(0);
    let ended = search_world(&spring(1.0), &|runs| {
        seen.store(runs, Relaxed);
        if runs < 5 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    assert_eq!((ended, seen.load(Relaxed)), (Err(Error::Interrupted), 5));
}

#[test]
fn the_scenario_reproduces_the_result_of_the_search() {
    let mut world = spring(4.0);
    world.device.limit = Some(0.8);
    let worst = search(&world).unwrap();
    assert!(worst.broken && worst.drew);
    let again = drawn(&world, &worst.scenario, worst.hand.energy()).unwrap();
    assert!((again.gain - worst.drawn.gain).abs() < 1e-9 * worst.drawn.turnover, "{again:?} {worst:?}");
    // Also through the text of a file.
    let file = World { scenarios: vec![worst.scenario.clone()], ..world }.to_toml();
    let read = World::read(&Source::from_text("worst.toml", &file), &[]).unwrap();
    let third = drawn(&read, read.scenario("worst").unwrap(), worst.hand.energy()).unwrap();
    assert_eq!(third, again);
    // The hand's gain is supplied by motor and initial energy: the ledger of the run closes.
    assert_eq!(search(&read).unwrap(), search(&read).unwrap(), "the search is deterministic");
}

/// A hand whose spring throws the puck beyond `safety.overspeed` before the second sample ends its run at the first.
#[test]
fn a_run_that_ends_at_its_first_sample_is_still_a_scenario() {
    for overspeed in [1e-9, 1e-3, 1.0] {
        let mut world = spring(1e-4);
        world.safety.overspeed = Some(overspeed);
        let worst = search(&world).unwrap();
        assert!(worst.scenario.duration >= world.sampling.period, "{overspeed}: {worst:?}");
        let file = World { scenarios: vec![worst.scenario.clone()], ..world }.to_toml();
        let read = World::read(&Source::from_text("worst.toml", &file), &[]).unwrap();
        let again = drawn(&read, read.scenario("worst").unwrap(), worst.hand.energy()).unwrap();
        assert!(
            (again.gain - worst.drawn.gain).abs() <= 1e-9 * worst.drawn.turnover,
            "{overspeed}: {again:?} {worst:?}"
        );
    }
}

#[test]
fn a_hand_pressed_against_a_wall_draws_energy_from_it() {
    let wall = |stiffness, damping| Law::Wall { side: hapt_model::Side::Above, at: 0.3, stiffness, damping };
    let mut world = World { couplings: vec![to_ground(wall(8.0, 0.0))], ..bare() };
    world.device.limit = Some(0.8);
    let worst = search(&world).unwrap();
    assert!(!worst.is_certified() && worst.broken && worst.drew, "{worst:?}");
    world.couplings = vec![to_ground(wall(2.0, 1e-4))];
    world.sampling.estimator = hapt_model::EstimatorKind::Difference;
    let worst = search(&world).unwrap();
    assert!(worst.is_certified() && !worst.broken, "{worst:?}");
}

#[test]
fn a_body_without_a_coupling_to_the_puck_gives_a_hand_no_energy() {
    // With a motor's limit, whose part over a stiffness of 0 gives the amplitude.
    for couplings in
        [vec![], vec![Coupling { first: End::Body(0), ..to_ground(Law::Spring { stiffness: 1.0, rest: 0.0 }) }]]
    {
        let mut world = World { couplings, ..bare() };
        world.bodies.push(Body { inertia: 1e-3, position: 0.0, velocity: 0.0 });
        world.names.push("b".into());
        world.device.limit = Some(0.8);
        let worst = search(&world).unwrap();
        assert!(!worst.broken && !worst.drew && worst.runs > 0, "{worst:?}");
    }
}

#[test]
fn the_work_of_a_constant_torque_is_not_drawn() {
    let mut world = World { couplings: vec![to_ground(Law::Constant { torque: 0.1 })], ..bare() };
    assert!(is_certified(&world));
    let worst = search(&world).unwrap();
    assert!(!worst.broken && worst.drawn.gain <= 0.0, "{worst:?}");
    world.couplings.push(to_ground(Law::Spring { stiffness: 8.0, rest: 0.0 }));
    assert!(search(&world).unwrap().broken);
}

/// Every world of the repository that no friction makes slow to run, and a wall with some.
#[test]
fn worlds_and_templates_have_the_result_of_their_certificate() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let folders = ["../../worlds/notes", "../../worlds/devices", "../hapt/templates"];
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(root.join(folder)).unwrap());
    let all = files.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "toml"));
    let mut paths: Vec<PathBuf> = all.collect();
    paths.sort();
    let read = |path: PathBuf| (World::read(&Source::open(&path).unwrap(), &[]).unwrap(), path);
    let quick = |(world, path): &(World, PathBuf)| world.device.friction == 0.0 || path.ends_with("wall.toml");
    let worlds: Vec<(World, PathBuf)> = paths.into_iter().map(read).filter(quick).collect();
    let some = hapt_testing::seeds(worlds.len() as u64).count();
    let (step, mut looked) = (worlds.len() / some, 0);
    for (world, path) in worlds.into_iter().step_by(step) {
        looked += 1;
        let worst = search(&world).unwrap();
        let proved = passivity(&world).unwrap().proved;
        assert!(!(worst.is_certified() && worst.broken && proved.holds()), "{}: {worst:?}", path.display());
        assert!(worst.is_certified() || worst.broken || !proved.holds(), "{}: {worst:?}", path.display());
        let numbers = [worst.drawn.gain, worst.scenario.duration, worst.hand.to, worst.hand.grip.stiffness];
        assert!(numbers.iter().all(|x| x.is_finite()) && worst.scenario.duration > 0.0, "{}", path.display());
    }
    assert!(looked >= some && some > 0, "{looked} of {some}");
}

fn world() -> impl Strategy<Value = World> {
    let log = |decades: std::ops::Range<f64>| decades.prop_map(|d| 10f64.powf(d));
    let methods = select(vec![Method::Zoh, Method::Trapezoidal, Method::BackwardEuler, Method::SemiImplicitEuler]);
    (methods, log(-3.0..-1.0), log(-1.0..1.0), log(-1.0..1.0), log(-4.0..-2.5), log(-4.0..-2.5)).prop_map(
        |(method, inertia, own, spring, damper, loss)| {
            let mut world = bare();
            world.sampling.method = method;
            world.sampling.output = if method == Method::SemiImplicitEuler { Output::Middle } else { Output::End };
            world.sampling.estimator = hapt_model::EstimatorKind::Difference;
            world.names = vec!["wheel".into()];
            world.bodies = vec![Body { inertia, position: 0.0, velocity: 0.0 }];
            let tie = |first, second, law| Coupling { first, second, law, limit: None };
            let fixed = |damping| Law::Damper { damping: Damping::Fixed(damping) };
            world.couplings = vec![
                tie(End::Puck, End::Body(0), Law::Spring { stiffness: own, rest: 0.0 }),
                tie(End::Puck, End::Ground, Law::Spring { stiffness: spring, rest: 0.0 }),
                tie(End::Puck, End::Body(0), fixed(damper)),
                tie(End::Body(0), End::Ground, fixed(loss)),
            ];
            world
        },
    )
}

proptest! {
    #![proptest_config(hapt_testing::cases_from(11, 24))]

    #[test]
    fn no_hand_draws_at_a_hundredth_more_than_the_required_damping(world in world()) {
        let mut world = world;
        let Some(required) = required_damping(&world).unwrap() else { return Ok(()) };
        world.device.damping = 1.01 * required;
        prop_assume!(is_certified(&world));
        let worst = search(&world).unwrap();
        prop_assert!(!worst.broken && !worst.drew, "{worst:?}");
        prop_assert!(worst.gap.breaking_damping.is_none_or(|b| b <= required));
    }

    #[test]
    fn a_hand_draws_at_half_of_the_required_damping(world in world()) {
        let mut world = world;
        let Some(required) = required_damping(&world).unwrap() else { return Ok(()) };
        world.device.damping = 0.5 * required;
        let worst = search(&world).unwrap();
        prop_assert!(!worst.is_certified() && worst.broken, "{worst:?}");
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases_from(13, 4))]

    /// A damper requires most damping at half of the sampling rate, where a mass on a spring reaches 8/π² of that. The motion with the largest work
    /// of the motor moves in straight lines from sample to sample, and reaches nearly all of it.
    #[test]
    fn a_hand_draws_at_nineteen_twentieths_of_the_required_damping(
        k in 0.2..2.0f64, damping in 1e-3..5e-3f64, delay in 0.0..2.5f64, whole in any::<bool>(), part in 0.88..0.95f64,
    ) {
        let mut world = spring(k);
        world.couplings.push(to_ground(fixed(damping)));
        world.sampling.estimator = hapt_model::EstimatorKind::Difference;
        world.sampling.delay = hapt_model::Delay::Samples(if whole { delay.round() } else { 0.0 });
        world.device.damping = part * required_damping(&world).unwrap().unwrap();
        let worst = search(&world).unwrap();
        prop_assert!(worst.status == Status::Refuted && worst.broken && worst.drew, "{worst:?}");
        let again = drawn(&world, &worst.scenario, 1e6 * worst.drawn.gain).unwrap();
        prop_assert!((again.gain - worst.drawn.gain).abs() <= 1e-9 * worst.drawn.turnover, "{again:?} {:?}", worst.drawn);
    }

    /// Friction stops the loop in the runs of the tried hands; a larger motion still grows.
    #[test]
    fn a_linear_loop_that_grows_is_broken_also_where_the_run_decays(part in 1.1..2.0f64, friction in 0.05..0.2f64) {
        let mut world = spring(part * 2.0 * bare().device.damping / bare().sampling.period);
        world.device.friction = friction;
        let worst = search(&world).unwrap();
        prop_assert!(worst.linear.is_some() && worst.broken && worst.status == Status::Refuted, "{worst:?}");
    }

    /// Friction that falls with the speed is a negative damping for slow motions, and gives no hand energy.
    #[test]
    fn no_hand_draws_from_a_certified_loop_with_falling_friction(
        part in 0.7..0.99f64, friction in 1e-3..0.01f64, torque in 1e-3..0.05f64, velocity in 0.05..5.0f64, backward in 0.5..2.0f64,
    ) {
        let mut world = spring(part * 2.0 * bare().device.damping / bare().sampling.period);
        (world.device.friction, world.device.friction_backward) = (friction, Some(backward * friction));
        world.device.stribeck = Some(hapt_model::Stribeck { torque, velocity });
        world.device.encoder = Some(1e6);
        let worst = search(&world).unwrap();
        prop_assert!(worst.is_certified() && !worst.broken && !worst.drew, "{worst:?}");
    }

    /// Friction that changes with the position gives no hand energy, and only its least level makes up for missing damping up to a speed.
    #[test]
    fn no_hand_draws_from_a_loop_that_the_least_friction_of_all_positions_certifies(
        part in 1.1..2.0f64, friction in 0.005..0.05f64, share in 0.0..0.6f64, pitch in 0.05..7.0f64,
    ) {
        let mut world = spring(part * 2.0 * bare().device.damping / bare().sampling.period);
        let waveform = hapt_model::Waveform { sine: [1.0, 0.0, 0.0, 0.0], cosine: [0.0, 0.5, 0.0, 0.0] };
        (world.device.friction, world.device.friction_by_position) =
            (friction, Some(hapt_model::FrictionByPosition { share, pitch, phase: 0.0, waveform }));
        let most = passivity(&world).unwrap().speed_max.unwrap();
        let mut even = world.clone();
        even.device.set_friction(friction * (1.0 - 1.5 * share));
        prop_assert!((most / passivity(&even).unwrap().speed_max.unwrap() - 1.0).abs() < 1e-9);
        world.safety.overspeed = Some(0.999 * most);
        let worst = search(&world).unwrap();
        prop_assert!(worst.is_certified() && !worst.broken && !worst.drew, "{worst:?}");
    }

    /// A stop returns no more energy than it received.
    #[test]
    fn no_hand_draws_from_a_certified_loop_between_stops(
        part in 0.7..0.99f64, low in 0.0..0.2f64, high in 0.0..0.2f64, stiffness in 1.0..500.0f64, damping in 0.0..0.05f64,
    ) {
        let mut world = spring(part * 2.0 * bare().device.damping / bare().sampling.period);
        world.device.stops = Some(hapt_model::Stops { low: Some(-low), high: Some(high), stiffness, damping });
        let worst = search(&world).unwrap();
        prop_assert!(worst.is_certified() && !worst.broken && !worst.drew, "{worst:?}");
    }

    /// The supervisor removes the torque from a puck that is faster than friction can cover.
    #[test]
    fn no_hand_draws_from_a_loop_that_friction_certifies_up_to_a_speed(
        part in 1.1..2.0f64, friction in 0.005..0.05f64, more in 0.0..3.0f64, back in any::<bool>(),
    ) {
        let mut world = spring(part * 2.0 * bare().device.damping / bare().sampling.period);
        let levels = [friction, (1.0 + more) * friction];
        (world.device.friction, world.device.friction_backward) =
            if back { (levels[1], Some(levels[0])) } else { (levels[0], Some(levels[1])) };
        let most = passivity(&world).unwrap().speed_max.unwrap();
        world.safety.overspeed = Some(0.999 * most);
        let worst = search(&world).unwrap();
        prop_assert!(worst.linear.is_some() && worst.is_certified() && !worst.broken && !worst.drew, "{worst:?}");
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases_from(14, 12))]

    /// For any linear loop the motion requires no more damping than the certificate, and for springs and dampers without bodies nearly as much: the
    /// real core gives energy in each repetition up to that damping.
    #[test]
    fn the_motion_of_most_work_requires_the_damping_of_the_certificate(
        k in 0.2..2.0f64, damping in 0.0..5e-3f64, delay in 0.0..3.0f64, times in 0..3u32,
    ) {
        let mut world = spring(k);
        world.couplings.push(to_ground(fixed(damping)));
        world.sampling.estimator = hapt_model::EstimatorKind::Difference;
        let delay = [0.0, delay.round(), delay][times as usize];
        world.sampling.delay = hapt_model::Delay::Samples(delay);
        let required = required_damping(&world).unwrap().unwrap();
        let worst = work_motion(&world, 1_000).unwrap();
        let part = worst.demand / required;
        prop_assert!(part <= 1.0 + 1e-9 && part > 0.97, "{part} of {required}");
        prop_assert!(worst.draws(&world, 0.96 * required, &mut 0) && !worst.draws(&world, 1.001 * required, &mut 0));
    }
}

/// A wall that is pressed at the start, its torque `samples` late, on a device with just the required damping, and a push.
fn pressed(stiffness: f64, depth: f64, samples: u32, push: f64) -> (World, Scenario) {
    let wall = Law::Wall { side: Side::Above, at: -depth, stiffness, damping: 0.0 };
    let mut world = World { couplings: vec![to_ground(wall)], ..bare() };
    let period = world.sampling.period;
    world.sampling.delay = hapt_model::Delay::Seconds(f64::from(samples) * period);
    world.device.damping = required_damping(&world).unwrap().unwrap() * (1.0 + 1e-9);
    let hand = Hand { drive: Drive::Torque(Shape::Step { to: push, at: 0.0 }), release: None };
    (world, Scenario { name: "push".into(), duration: 1000.0 * period, hand, timing: Default::default() })
}

proptest! {
    #![proptest_config(hapt_testing::cases_from(7, 200))]

    #[test]
    fn no_hand_draws_more_from_a_pressed_wall_with_a_delay_than_it_stores_and_the_delay_supplies(
        stiffness in 0.1..50.0, depth in 0.0..0.3, samples in 0u32..6, push in -3.0..3.0,
    ) {
        let (world, scenario) = pressed(stiffness, depth, samples, push);
        let answer = passivity(&world).unwrap();
        prop_assert!(answer.passive.holds() && answer.proved.holds());
        let drawn = drawn(&world, &scenario, 0.0).unwrap();
        prop_assert!(!drawn.is_gain(0.0), "{drawn:?}");
    }
}

#[test]
fn a_delay_supplies_the_work_of_its_first_samples() {
    let stored = |stiffness: f64, depth: f64| 0.5 * stiffness * depth * depth;
    let (world, scenario) = pressed(28.0, 0.14, 3, 2.4);
    let lent = drawn(&world, &scenario, 0.0).unwrap();
    // More than the stored energy: without the delay's work this would count as a gain.
    assert!(lent.gain <= 0.0 && lent.gain + lent.supplied > stored(28.0, 0.14), "{lent:?}");
    let (world, scenario) = pressed(28.0, 0.14, 0, 2.4);
    let at_once = drawn(&world, &scenario, 0.0).unwrap();
    assert!(at_once.gain <= 0.0 && (at_once.supplied - stored(28.0, 0.14)).abs() < 1e-12, "{at_once:?}");
}

fn fixed(damping: f64) -> Law {
    Law::Damper { damping: Damping::Fixed(damping) }
}

/// The kind of the motion of `samples` samples that draws; asserts that its scenario reproduces it.
fn moved(world: &World, samples: usize) -> Option<Exploit> {
    let found = best_motion(world, samples).unwrap().0?;
    let had = 1e6 * found.drawn.gain;
    let again = drawn(world, &found.scenario, had).unwrap();
    assert!((again.gain - found.drawn.gain).abs() <= 1e-9 * found.drawn.turnover, "{again:?} {:?}", found.drawn);
    Some(found.motion.trick)
}

proptest! {
    #![proptest_config(hapt_testing::cases_from(12, 6))]

    /// Without bodies friction decides, on both sides of the friction that counts, dampers and levels require.
    #[test]
    fn a_dither_draws_energy_where_friction_does_not_cover_counts_and_levels(
        k in 0.5..20.0f64, damping in 0.0..5e-3f64, counts in 500.0..2e4f64, step in 0.0..1.0f64, spare in 1.05..2.0f64, late in 0..3u32, which in 0..3usize,
    ) {
        let mut world = spring(k);
        world.couplings.push(to_ground(fixed(damping)));
        world.sampling.estimator = hapt_model::EstimatorKind::Difference;
        world.sampling.delay = hapt_model::Delay::Samples(f64::from(late));
        world.device.damping = required_damping(&world).unwrap().unwrap() * spare;
        if which != 1 { world.device.encoder = Some(counts.round()); }
        let count = std::f64::consts::TAU / counts.round();
        if which != 0 {
            let levels = 2.0 * (20.0 / (k * count * (0.1 + step))).round().max(1.0);
            (world.device.limit, world.device.levels) = (Some(10.0), Some(levels as u32));
        }
        let least = |world: &World| {
            let count = world.count().unwrap_or(0.0);
            let step = world.device.levels.map_or(0.0, |levels| 20.0 / f64::from(levels));
            0.5 * k * count + damping * count / world.sampling.period + 0.5 * step
        };
        // The errors of counts, dampers and levels do not coincide where the torque is late.
        world.device.friction = if late > 0 || which == 2 { 0.3 } else { 0.6 } * least(&world);
        world.device.friction_backward = Some((if late > 0 { 1.0 } else { spare }) * world.device.friction);
        prop_assert!(!passivity(&world).unwrap().proved.holds());
        prop_assert_eq!(moved(&world, 6000), Some(Exploit::Dither));
        // A larger friction in one direction changes nothing.
        let levels = [1.000001 * least(&world), spare * least(&world)];
        (world.device.friction, world.device.friction_backward) = (levels[which % 2], Some(levels[1 - which % 2]));
        let cut = late == 0 || damping == 0.0 || world.device.limit.is_none();
        prop_assert!(passivity(&world).unwrap().proved.holds() || !cut, "{:?}", passivity(&world).unwrap().not_proved);
        prop_assert_eq!(moved(&world, 6000), None);
    }

    /// A body that counts excite, damped or not, with any friction of the puck beyond that required for its own counts.
    #[test]
    fn counts_pump_a_damped_body_and_the_hand_draws_it(
        k in 0.5..5.0f64, swing in 50.0..300.0f64, ratio in 0.0..0.02f64, counts in 1000.0..1e4f64,
        friction in 1.0..2.0f64, behind in any::<bool>(),
    ) {
        let mut world = bare();
        world.sampling.estimator = hapt_model::EstimatorKind::Difference;
        let inertia = k * (swing * world.sampling.period / std::f64::consts::TAU).powi(2);
        world.names = vec!["wheel".into()];
        world.bodies = vec![Body { inertia, position: 0.0, velocity: 0.0 }];
        let tie = |first, second, law| Coupling { first, second, law, limit: None };
        let ends = if behind { (End::Body(0), End::Puck) } else { (End::Puck, End::Body(0)) };
        world.couplings = vec![
            tie(ends.0, ends.1, Law::Spring { stiffness: k, rest: 0.0 }),
            tie(End::Body(0), End::Ground, fixed(2.0 * ratio * (k * inertia).sqrt())),
        ];
        world.device.damping = required_damping(&world).unwrap().unwrap() * 1.1;
        world.device.encoder = Some(counts.round());
        world.device.friction = 0.5 * k * world.count().unwrap() * friction;
        let answer = passivity(&world).unwrap();
        prop_assert!(answer.passive.holds() && !answer.proved.holds());
        prop_assert_eq!(moved(&world, 20_000), Some(Exploit::Pump));
    }

    /// The exact velocity at a sample does not determine the displacement until the next. In 4000 samples a weaker damper gives less than the puck's
    /// own energy, which the search does not count.
    #[test]
    fn a_reversal_within_a_sample_draws_energy_from_an_exact_velocity(damping in 2e-3..1e-2f64, k in 0.0..2.0f64, spare in 1.0..3.0f64, friction in 0.0..1e-3f64) {
        let mut world = spring(k);
        world.couplings.push(to_ground(fixed(damping)));
        world.device.damping = required_damping(&world).unwrap().unwrap() * spare;
        prop_assume!(world.device.damping < 4.0 * damping);
        world.device.friction = friction;
        prop_assert!(!passivity(&world).unwrap().proved.holds());
        prop_assert_eq!(moved(&world, 4000), Some(Exploit::Reverse));
        world.sampling.estimator = hapt_model::EstimatorKind::Difference;
        prop_assert!(passivity(&world).unwrap().proved.holds());
        prop_assert_eq!(moved(&world, 4000), None);
    }

    /// The motor lacks a part of the constant until its lag is over: that work counts as initial energy of the loop.
    #[test]
    fn no_hand_draws_from_a_constant_behind_a_lag(torque in 0.1..8.0f64, lag in 0.5..20.0f64, period in 0.5..4.0f64, inertia in 2e-5..1e-3f64) {
        let mut world = World { couplings: vec![to_ground(Law::Constant { torque })], ..bare() };
        (world.device.lag, world.device.inertia, world.sampling.period) = (lag * 1e-3, inertia, period * 1e-3);
        let worst = search(&world).unwrap();
        prop_assert!(worst.is_certified() && !worst.drew, "{worst:?}");
    }

    /// A constant torque at a body without a spring supplies unbounded energy; with a spring its energy is bounded.
    #[test]
    fn a_constant_at_a_body_without_a_spring_is_an_unbounded_source(
        k in 0.5..5.0f64, torque in 0.02..0.2f64, held in any::<bool>(), toward in any::<bool>(),
    ) {
        let mut world = bare();
        world.sampling.estimator = hapt_model::EstimatorKind::Difference;
        world.names = vec!["wheel".into()];
        world.bodies = vec![Body { inertia: 0.01, position: 0.0, velocity: 0.0 }];
        let tie = |second, law| Coupling { first: End::Body(0), second, law, limit: None };
        world.couplings = vec![
            tie(End::Puck, Law::Spring { stiffness: k, rest: 0.0 }),
            tie(End::Ground, Law::Constant { torque: if toward { torque } else { -torque } }),
        ];
        if held {
            world.couplings.push(tie(End::Ground, Law::Spring { stiffness: k, rest: 0.0 }));
            world.couplings.push(tie(End::Ground, fixed(0.01)));
        }
        world.device.damping = required_damping(&world).unwrap().unwrap() * 1.1;
        prop_assert!(!passivity(&world).unwrap().proved.holds());
        prop_assert_eq!(moved(&world, 20_000), (!held).then_some(Exploit::Follow));
    }
}
