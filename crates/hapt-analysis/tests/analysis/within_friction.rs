//! Torques that the device's friction takes, (T76): integral terms with a limit and friction between puck and ground.
//!
//! A hand that prescribes the path z(t) of the puck gets ∫τ dz - b ∫ż² dt - f ∫|dz|, apart from the energy that it exchanges with the
//! puck's inertia. Starting from rest at the rest of all springs it may never get any: hands with a prescribed path are the worst case of
//! all passive hands.

use hapt_analysis::{Status, check, is_certified, passivity, uneven};
use hapt_core::Loop;
use hapt_model::{
    Body, Compensated, Compensation, Coupling, Delay, End, EstimatorKind, Law, Method, Output, Side, World,
};
use hapt_testing::prelude::*;

use crate::common::*;

type Room = Loop<f64, 2, 8, 32>;

/// A hand's motion from one sample to the next: the interval, the arrival of the command in it, and the displacements before and after
/// that.
#[derive(Clone, Copy, Debug)]
struct Part {
    interval: f64,
    late: f64,
    travels: [f64; 2],
}

/// The most energy that the hand has got at any time of the path, J.
fn drawn(world: &World, path: impl IntoIterator<Item = Part>) -> f64 {
    let core = Room::new(&world.spec()).unwrap();
    let mut state = core.start();
    let (b, f) = (world.device.damping, world.device.least_friction());
    let (mut z, mut held, mut work, mut most) = (0.0, 0.0, 0.0_f64, 0.0_f64);
    for Part { interval, late, travels } in path {
        let command = core.step(&mut state, z, 0.0).command;
        for (travel, time, torque) in [(travels[0], late, held), (travels[1], interval - late, command)] {
            if time > 0.0 {
                work += torque * travel - b * travel * travel / time - f * travel.abs();
                z += travel;
                most = most.max(work);
            }
        }
        held = command;
    }
    most
}

/// SplitMix64.
struct Rng(u64);

impl Rng {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }
}

fn uniform(rng: &mut Rng, from: f64, to: f64) -> f64 {
    from + (to - from) * (rng.next() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Paths that may draw energy: to and fro across a sample, slow turns, waiting next to the rest and moving fast across it, random walks.
fn path(world: &World, rng: &mut Rng, samples: usize) -> Vec<Part> {
    let sampling = &world.sampling;
    let kind = rng.next() % 4;
    let size = 10_f64.powf(uniform(rng, -6.0, -0.5));
    let turn = uniform(rng, 2.0, 400.0).floor() as usize;
    let wait = uniform(rng, 1.0, 300.0).floor() as usize;
    let strike = 1 + (rng.next() % 8) as usize;
    let mut z = 0.0;
    (0..samples)
        .map(|k| {
            let shortest = sampling.interval_min_s().max(sampling.delay_max_s());
            let interval = uniform(rng, shortest, sampling.interval_max_s());
            let late = uniform(rng, sampling.delay_s(), sampling.delay_max_s());
            let to = match kind {
                0 => size * if k % 2 == 0 { 1.0 } else { -1.0 },
                1 => size * (std::f64::consts::TAU * k as f64 / turn as f64).sin(),
                2 => {
                    let (half, at) = (k / (wait + strike), k % (wait + strike));
                    let moved = (at as f64 - wait as f64 + 1.0).max(0.0) / strike as f64;
                    size * (1.0 - 2.0 * moved) * if half % 2 == 0 { 1.0 } else { -1.0 }
                }
                _ => z + size * uniform(rng, -1.0, 1.0),
            };
            let travel = to - z;
            let first = travel * uniform(rng, -0.5, 1.5);
            z = to;
            let travels = if late > 0.0 && late < interval {
                [first, travel - first]
            } else if late > 0.0 {
                [travel, 0.0]
            } else {
                [0.0, travel]
            };
            Part { interval, late, travels }
        })
        .collect()
}

fn integral(stiffness: f64, time: f64, limit: f64, flip: bool) -> Coupling {
    let ends = if flip { [End::Ground, End::Puck] } else { [End::Puck, End::Ground] };
    Coupling { limit: Some(limit), ..Law::Integral { stiffness, time, rest: 0.0 }.between(ends[0], ends[1]) }
}

fn friction(torque: f64) -> Coupling {
    Law::Coulomb { torque }.between(End::Puck, End::Ground)
}

fn acceleration(inertia: f64, cutoff: f64) -> Coupling {
    Law::Acceleration { inertia, cutoff }.between(End::Puck, End::Ground)
}

fn assist(torque: f64, velocity: f64) -> Coupling {
    Law::Assist { torque, velocity }.between(End::Ground, End::Puck)
}

prop_compose! {
    /// A world with torques within friction, with `share` of the friction that they, counts and levels require.
    fn within(share: std::ops::Range<f64>)(
        k in 0.0..5.0_f64, b in 0.0..0.01_f64, wall in prop::option::of((0.0..2.0_f64, 0.0..0.003_f64)), gain in 0.5..500.0_f64, time in 0.01..1.0_f64,
        limits in [1e-3..0.1_f64, 1e-3..0.1_f64, 1e-3..0.1_f64, 1e-3..0.1_f64], which in 1..16_u8, flip: bool, speed in -4.0..1.0_f64,
        late in prop_oneof![Just(0.0), 0.0..1.0_f64, Just(1.0)], more in prop_oneof![Just(0.0), 0.0..0.5_f64], longest in prop_oneof![Just(None), (1.0..1.5_f64).prop_map(Some)],
        encoder in prop::option::of(500.0..2e4_f64), levels in prop::option::of(100..2000_u32), foaw: bool, share in share,
    ) -> World {
        let mut couplings = vec![spring(End::Puck, End::Ground, k), damper(End::Puck, End::Ground, b)];
        couplings.extend(wall.map(|(stiffness, damping)| {
            Law::Wall { side: Side::Above, at: 0.05, stiffness, damping }.between(End::Puck, End::Ground)
        }));
        couplings.extend((which & 1 > 0).then(|| integral(gain * time, time, limits[0], flip)));
        couplings.extend((which & 2 > 0).then(|| friction(limits[1])));
        couplings.extend((which & 4 > 0).then(|| assist(limits[2], 10_f64.powf(speed))));
        couplings.extend((which & 8 > 0).then(|| Coupling { limit: Some(limits[3]), ..acceleration(1e-5 * gain, 1.0 / time) }));
        let mut world = Bench::of(couplings).world(Method::Zoh, Output::End, 1e-3);
        world.sampling.delay = Delay::Seconds(late * 1e-3);
        world.sampling.delay_max = (more > 0.0).then_some(Delay::Seconds((late + more * (1.0 - late)) * 1e-3));
        world.sampling.interval_max = longest.map(|longest| longest * 1e-3);
        if foaw {
            // A damping with it has no proof.
            for coupling in &mut world.couplings {
                match &mut coupling.law {
                    Law::Damper { damping } => *damping = hapt_model::Damping::Fixed(0.0),
                    Law::Wall { damping, .. } => *damping = 0.0,
                    _ => {}
                }
            }
            world.sampling.estimator = EstimatorKind::Foaw;
        }
        world.device.encoder = encoder.map(f64::round);
        (world.device.limit, world.device.levels) = (levels.map(|_| 10.0), levels.map(|half| 2 * half));
        let taken: f64 = (0..4).filter(|i| which >> i & 1 > 0).map(|i| limits[i]).sum();
        let stiffness = k + wall.map_or(0.0, |wall| wall.0);
        let damping = b + wall.map_or(0.0, |wall| wall.1);
        let count = world.count().unwrap_or(0.0);
        let levels = levels.map_or(0.0, |half| 10.0 / f64::from(2 * half));
        let rounded = 0.5 * stiffness * count + damping * count / 1e-3 + levels;
        world.device.set_friction(share * taken + rounded * (1.0 + 1e-9));
        world
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(300))]

    /// With the damping that it requires, the loop gives no energy along these paths, at any times.
    #[test]
    fn what_friction_takes_no_hand_gets(mut world in within(1.0 + 1e-12..1.0 + 2e-12), seed in any::<u64>()) {
        let required = uneven(&world).unwrap().required_damping;
        prop_assert!(required.is_some(), "{:?}", uneven(&world).unwrap().not_proved);
        world.device.damping = required.unwrap() * (1.0 + 1e-12);
        // A motor that saturates may require more.
        while !uneven(&world).unwrap().proved.holds() && world.device.damping < 1e3 {
            world.device.damping *= 1.2;
        }
        let found = uneven(&world).unwrap();
        prop_assert!(found.passive.holds() && found.proved.holds(), "{:?}", found.not_proved);
        prop_assert!(found.passive.theorems().iter().any(|theorem| theorem.id == "within-friction"));
        let mut rng = Rng(seed);
        for _ in 0..12 {
            let path = path(&world, &mut rng, 1500);
            let travelled: f64 = path.iter().map(|part| part.travels[0].abs() + part.travels[1].abs()).sum();
            let got = drawn(&world, path);
            prop_assert!(got <= 1e-9 * world.device.friction * travelled, "{got} J over {travelled}");
        }
    }

    /// Less friction is not enough: some path draws energy.
    #[test]
    fn with_less_friction_a_hand_gets_some(
        limit in 1e-3..0.1_f64, share in 0.0..0.9_f64, gain in 1.0..100.0_f64, is_integral in any::<bool>(),
    ) {
        let coupling = if is_integral { integral(gain * 0.1, 0.1, limit, false) } else { friction(limit) };
        let mut world = Bench::of(vec![coupling]).world(Method::Zoh, Output::End, 1e-3);
        (world.device.damping, world.device.friction) = (1e-3, share * limit);
        let found = check(&world).unwrap();
        prop_assert!(found.status == Status::Refuted && !found.passivity.passive.holds());
        // It waits until the integral is full, and goes across the rest while it is.
        let full = limit / gain;
        let speed = 0.25 * (1.0 - share) * limit / world.device.damping;
        let size = (0.05 * speed * full).sqrt();
        let strike = ((2.0 * size / speed / 1e-3).ceil() as usize).max(1);
        let wait = (2.5 * full / size / 1e-3).ceil() as usize + 1 + strike;
        let to_and_fro = |k: usize| {
            let (half, at) = (k / (wait + strike), k % (wait + strike));
            let step = 2.0 * size / strike as f64;
            let travel = match (half, at) {
                // To the first place as fast as across.
                (0, at) if at < strike => 0.5 * step,
                (_, at) if at < wait => 0.0,
                (half, _) => if half % 2 == 0 { -step } else { step },
            };
            Part { interval: 1e-3, late: 0.0, travels: [0.0, travel] }
        };
        let dither = |k: usize| {
            let size = 0.1 * (1.0 - share) * limit * 1e-3 / world.device.damping;
            Part { interval: 1e-3, late: 0.0, travels: [0.0, if k.is_multiple_of(2) { size } else { -size }] }
        };
        let got = if is_integral {
            drawn(&world, (0..8 * (wait + strike)).map(to_and_fro))
        } else {
            drawn(&world, (0..100).map(dither))
        };
        prop_assert!(got > 0.0);
    }

    /// The rest of the friction makes up for counts and for missing damping, as on a device that has only this rest.
    #[test]
    fn the_rest_is_that_of_a_device_with_the_rest_of_the_friction(
        world in within(0.5..3.0), part in 0.2..2.0_f64, overspeed in 0.01..100.0_f64, back in any::<bool>(),
    ) {
        let mut world = world;
        world.safety.overspeed = Some(overspeed);
        world.device.damping = part * passivity(&world).unwrap().required_damping.unwrap_or(1e-3);
        if back {
            world.device.friction_backward = Some(world.device.friction);
            world.device.friction *= 2.0;
        }
        let torques: Vec<usize> = (0..world.couplings.len())
            .filter(|i| matches!(world.couplings[*i].law, Law::Integral { .. } | Law::Coulomb { .. } | Law::Assist { .. } | Law::Acceleration { .. }))
            .collect();
        let taken: f64 = torques.iter().map(|i| match world.couplings[*i].law {
            Law::Coulomb { torque } | Law::Assist { torque, .. } => torque,
            _ => world.couplings[*i].limit.unwrap(),
        }).sum();
        let mut rest = world.clone();
        for i in torques.into_iter().rev() {
            rest.couplings.remove(i);
        }
        let left = world.device.least_friction() - taken;
        rest.device.set_friction(left.max(0.0));
        let (found, of_rest) = (passivity(&world).unwrap(), passivity(&rest).unwrap());
        if left < 0.0 {
            prop_assert!(!found.passive.holds());
        } else {
            prop_assert_eq!(found.required_damping, of_rest.required_damping);
            prop_assert_eq!((found.passive.holds(), found.speed_max, &found.not_proved), (of_rest.passive.holds(), of_rest.speed_max, &of_rest.not_proved));
            prop_assert_eq!(uneven(&world).unwrap().required_damping, uneven(&rest).unwrap().required_damping);
        }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// A compensation of friction is passive up to the least friction, with any estimator; from a larger one a hand at
    /// constant velocity draws energy.
    #[test]
    fn a_compensation_of_friction_is_passive_up_to_the_least_friction(
        friction in 1e-3..0.1_f64, tolerance in 0.0..0.9_f64, share in 0.0..1.0_f64, velocity in 1e-3..10.0_f64, k in 0.0..2.0_f64,
        estimator in prop::sample::select(vec![EstimatorKind::Exact, EstimatorKind::Difference, EstimatorKind::LowPass, EstimatorKind::Foaw]),
    ) {
        let mut world = Bench::of(vec![spring(End::Puck, End::Ground, k)]).world(Method::Zoh, Output::End, 1e-3);
        (world.sampling.estimator, world.sampling.cutoff) = (estimator, Some(50.0));
        (world.device.friction, world.device.tolerances.friction) = (friction, tolerance);
        let compensation = world.device.compensation(Compensation { of: Compensated::Friction, share, velocity: Some(velocity), cutoff: None }).unwrap();
        if share > 0.0 {
            let (of, found) = world.device.compensated_by(&compensation).unwrap();
            prop_assert!(of == Compensated::Friction && (found - share).abs() < 1e-12);
        }
        world.couplings.push(compensation);
        let found = check(&world).unwrap();
        if share < (1.0 - tolerance) * (1.0 - 1e-12) {
            prop_assert!(found.certified.holds() && is_certified(&world), "{:?}", found.uneven);
            prop_assert_eq!(found.passivity.required_damping, Some(0.5e-3 * k));
        } else if share > (1.0 - tolerance) * (1.0 + 1e-12) {
            prop_assert!(!found.certified.holds() && !is_certified(&world));
            let why = &found.uneven.not_proved;
            prop_assert!(why.iter().any(|why| why.contains("at the puck give up to")), "{why:?}");
        }
    }

    /// A friction, an assist and an acceleration of 0 change no claim, as a compensation of friction with a share of 0.
    #[test]
    fn a_torque_of_0_changes_no_claim(
        inertia in 1e-3..1e-2_f64, k in 0.01..1.0_f64, [forward, backward] in [0.0..0.1_f64, 0.0..0.1_f64], velocity in 1e-2..10.0_f64,
        estimator in prop::sample::select(vec![EstimatorKind::Exact, EstimatorKind::Difference, EstimatorKind::LowPass, EstimatorKind::Foaw]),
        zeros in prop::sample::select(vec![[true, false, false], [false, true, false], [true, true, true], [false, false, true]]), limit in prop::option::of(1e-3..0.1_f64),
    ) {
        let body = Body { inertia, position: 0.0, velocity: 0.0 };
        let bench = Bench { bodies: vec![body], couplings: vec![spring(End::Puck, End::Body(0), k)] };
        let mut world = bench.world(Method::Zoh, Output::End, 1e-3);
        (world.sampling.estimator, world.sampling.cutoff) = (estimator, Some(50.0));
        (world.device.friction, world.device.friction_backward) = (forward, Some(backward));
        let mut same = world.clone();
        let none = Coupling { limit, ..acceleration(0.0, 10.0) };
        same.couplings.extend([friction(0.0), assist(0.0, velocity), none].into_iter().zip(zeros).filter_map(|(zero, is_there)| is_there.then_some(zero)));
        prop_assert_eq!(passivity(&same).unwrap(), passivity(&world).unwrap());
        prop_assert_eq!(uneven(&same).unwrap(), uneven(&world).unwrap());
        prop_assert_eq!(is_certified(&same), is_certified(&world));
    }

    /// A hand at constant velocity draws the torque beyond the friction.
    #[test]
    fn a_steady_hand_draws_what_is_more_than_friction(torque in 1e-3..0.1_f64, share in 0.0..0.9_f64, part in 0.01..0.9_f64) {
        let damping = 1e-3;
        let velocity = part * (1.0 - share) * torque / damping;
        let mut world = Bench::of(vec![assist(torque, velocity)]).world(Method::Zoh, Output::End, 1e-3);
        (world.device.damping, world.device.friction) = (damping, share * torque);
        prop_assert!(!check(&world).unwrap().certified.holds());
        let steady = (0..100).map(|_| Part { interval: 1e-3, late: 0.0, travels: [0.0, velocity * (1.0 + 1e-9) * 1e-3] });
        prop_assert!(drawn(&world, steady) > 0.0);
    }
}

proptest! {
    /// Torques that friction takes keep no large motion going: a world has the status of its rest on the friction that they leave, also where
    /// eigenvalues, which have no friction, grow.
    #[test]
    fn torques_within_friction_change_no_status(
        (gain, limit, spare) in (0.1..100.0_f64, 1e-3..0.5_f64, 0.0..0.5_f64), (k, b) in (1e-2..1e3_f64, 0.0..1e-2_f64),
        at in 0usize..4, uneven in any::<bool>()
    ) {
        let laws = vec![
            Law::Wall { side: Side::Above, at: 0.05, stiffness: k, damping: b }.between(End::Puck, End::Ground),
            integral(gain, 0.01, limit, false),
        ];
        let mut world = Bench::of(laws).world(Method::Zoh, Output::End, 1e-3);
        world.sampling.estimator =
            [EstimatorKind::LowPass, EstimatorKind::Difference, EstimatorKind::Foaw, EstimatorKind::Kalman][at];
        world.sampling.cutoff = Some(50.0);
        world.sampling.interval_max = uneven.then_some(1.5e-3);
        (world.device.inertia, world.device.damping, world.device.friction) = (1e-3, 0.01, limit + spare);
        let mut rest = world.clone();
        rest.couplings.remove(1);
        rest.device.friction = world.device.friction - limit;
        let (whole, alone) = (check(&world).unwrap(), check(&rest).unwrap());
        prop_assert_eq!(whole.status, alone.status, "{}\n{}", whole.headline(), alone.headline());
        prop_assert_eq!(whole.headline().contains("not safe to let go"), alone.headline().contains("not safe to let go"));
    }
}
