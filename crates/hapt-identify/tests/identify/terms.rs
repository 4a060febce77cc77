//! Terms of a record, a second torque, and the two estimates of the inertia.

use std::f64::consts::TAU;

use fastrand::Rng;
use hapt_identify::{Kind, Known, Part, Record, Term, TermKind, TorqueFit, fit_torque};
use hapt_model::Waveform;
use hapt_plant::VirtualDevice;
use hapt_plant::spec::{DeviceSpec, DeviceTorque, FrictionByPosition, Gravity};

use crate::lever::{Lever, SCALE};
use crate::rig::{WHEEL, counted, motion, steps, times};

fn fit(record: &Record) -> TorqueFit {
    fit_torque(record, &Known::default()).unwrap()
}

/// With only inertia, damping and friction.
fn plain(rng: &mut Rng) -> Lever {
    Lever {
        cable: 0.0,
        cogging: 0.0,
        gravity: 0.0,
        friction: [0.02; 2],
        sign: 1.0,
        loop_stiffness: 1.5,
        ..Lever::new(rng)
    }
}

fn found(fit: &TorqueFit, is: impl Fn(TermKind) -> bool) -> Option<Term> {
    fit.terms.iter().copied().find(|term| is(term.kind))
}

#[test]
fn a_cable_a_cogging_and_stribecks_friction_are_found_with_their_sizes() {
    let (mut determined, mut held, mut all) = (0, 0, 0);
    for seed in hapt_testing::seeds(8) {
        let mut rng = Rng::with_seed(seed);
        let lever = plain(&mut rng);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        let (cable, cogging, stribeck) = (between(0.15, 0.6), between(0.02, 0.04), between(0.04, 0.06));
        let mut count = |lever: Lever, is: fn(TermKind) -> bool, truth: f64| {
            let fit = fit(&lever.record(5.0, &mut Rng::with_seed(seed)));
            let term = found(&fit, is);
            all += 1;
            determined += i32::from(term.is_some());
            held += i32::from(term.is_some_and(|term| (term.size.value / truth - 1.0).abs() < 0.4));
            assert!(fit.terms.len() < 4, "seed {seed}: {:?}", fit.terms);
        };
        count(Lever { cable, ..lever }, |kind| kind == TermKind::Stiffness, cable);
        count(Lever { cogging, ..lever }, |kind| matches!(kind, TermKind::Turn { times: 10..=12, .. }), cogging);
        count(Lever { stribeck, ..lever }, |kind| matches!(kind, TermKind::Stribeck { .. }), stribeck);
    }
    assert!(10 * determined >= 8 * all && 10 * held >= 7 * all, "{determined} found, {held} of their size, of {all}");
}

#[test]
fn a_device_without_such_terms_is_given_none() {
    let with_terms = hapt_testing::seeds(12).filter(|seed| {
        let mut rng = Rng::with_seed(*seed);
        let lever = plain(&mut rng);
        !fit(&lever.record(4.0, &mut rng)).terms.is_empty()
    });
    let count = with_terms.count();
    assert!(count <= 1, "{count} of 12 devices were given terms that they do not have");
}

#[test]
fn a_hand_that_a_sensor_measures_hides_nothing_and_its_scale_is_told() {
    let (mut determined, mut held, mut scaled, mut all) = (0, 0, 0, 0);
    for seed in hapt_testing::seeds(16) {
        let mut rng = Rng::with_seed(seed);
        let lever = Lever { hand: 0.05, ..Lever::new(&mut rng) };
        let found = fit(&lever.record(4.0, &mut rng));
        assert!(found.sign.is_none_or(|sign| sign == lever.sign), "seed {seed}");
        all += 1;
        let Some(inertia) = found.inertia else { continue };
        determined += 1;
        held += i32::from(inertia.covers(lever.inertia));
        scaled += i32::from(found.force.is_some_and(|force| force.covers(1.0 / SCALE)));
    }
    assert!(10 * determined >= 7 * all, "{determined} of {all}");
    assert!(
        10 * held >= 9 * determined - 10 && 10 * scaled >= 9 * determined - 10,
        "{held} inertias, {scaled} scales of {determined}"
    );
}

/// A hand that moves slowly on a virtual spring shows the spring, whatever the sensor measures.
#[test]
fn the_law_of_a_loop_beside_a_sensor_is_no_device() {
    for seed in hapt_testing::seeds(96) {
        let mut rng = Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        let inertia = between(0.5e-3, 3e-3);
        let rig = DeviceSpec { damping: between(2e-3, 8e-3), friction: 0.02, ..DeviceSpec::new(1e-3, inertia) };
        let (stiffness, hand) = (between(0.05, 0.3), between(0.3, 0.8));
        let waves: Vec<[f64; 3]> = (0..4).map(|_| [between(0.2, 2.0), between(0.0, TAU), between(0.1, 0.3)]).collect();
        let mut device = VirtualDevice::new(&rig);
        let (mut seen, mut torques, mut forces) = (Vec::new(), Vec::new(), Vec::new());
        let (mut before, mut speed) = (0.0, 0.0);
        for t in times(&rig, 2250) {
            let (z, v) = device.puck();
            speed += 0.2 * ((z - before) / 1e-3 - speed);
            before = z;
            let target: f64 = waves.iter().map(|[hz, phase, size]| size * (TAU * hz * t + phase).sin()).sum();
            let (motor, push) = (-stiffness * z - 1e-3 * speed, hand * (target - z) - 2e-3 * v);
            seen.push(z);
            torques.push(motor);
            forces.push(SCALE * push);
            device.command(motor + push);
            device.travel();
        }
        let largest = forces.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        forces.iter_mut().for_each(|force| *force += 4e-3 * largest * (rng.f64() - 0.5));
        let seen = counted(&seen, 20_000.0, 0.3, &mut rng);
        let found = fit(&Record::new(times(&rig, 2250), seen, torques).unwrap().with_force(forces).unwrap());
        assert!(found.inertia.is_none_or(|x| x.covers(inertia)), "seed {seed}: {:?}, {inertia}", found.inertia);
    }
}

/// A record of 100 samples a second has fewer bands, and what the equation leaves of them is no more.
#[test]
fn a_slow_record_has_a_misfit_of_its_own() {
    for seed in hapt_testing::seeds(8) {
        let mut rng = Rng::with_seed(seed);
        let lever = Lever { delay: 0.0, loop_stiffness: 1.0, ..plain(&mut rng) };
        let fast = lever.record(10.0, &mut rng);
        let [times, positions, torques] =
            [fast.times(), fast.positions(), fast.torques()].map(|x| x.iter().copied().step_by(20).collect());
        let slow = fit(&Record::new(times, positions, torques).unwrap());
        assert!(slow.misfit.share < 0.6 && slow.best.inertia > 0.0, "seed {seed}: {:?}", slow.misfit);
        assert!(slow.sign.is_none_or(|sign| sign == lever.sign), "seed {seed}");
    }
}

/// Other torques on the puck make the torque's inertia too small and the motion's too large, where the torque does not respond to the puck.
#[test]
fn in_an_open_loop_the_true_inertia_lies_between_the_torques_and_the_motions() {
    for seed in hapt_testing::seeds(12) {
        let mut rng = Rng::with_seed(seed);
        let lever = Lever { hand: 0.0, loop_stiffness: 0.0, cogging: 0.01, delay: 0.0, ..plain(&mut rng) };
        let found = fit(&lever.record(5.0, &mut rng));
        let (Some(torque), Some(motion)) = (found.inertia_by_torque, found.inertia_by_motion) else { continue };
        assert!(torque.value < motion.value, "seed {seed}: {torque:?}, {motion:?}");
        assert!(torque.low < lever.inertia && lever.inertia < motion.high, "seed {seed}: {torque:?}, {motion:?}");
    }
}

#[test]
fn forces_that_are_no_record_of_one_are_refused() {
    let mut rng = Rng::with_seed(3);
    let record = plain(&mut rng).record(1.0, &mut rng);
    let n = record.times().len();
    for forces in [vec![0.0; n], vec![1.0; n - 1], [vec![f64::NAN], vec![1.0; n - 1]].concat()] {
        assert!(record.clone().with_force(forces).is_err());
    }
}

/// A hand on the lever that is not measured: an inertia that is given all the same is mostly right, and no sign is wrong. None is given where
/// more than a twentieth of the torque goes with nothing.
#[test]
fn a_hand_that_nothing_measures_gives_no_wrong_sign() {
    let (mut determined, mut held) = (0, 0);
    for seed in hapt_testing::seeds(24) {
        let mut rng = Rng::with_seed(seed);
        let lever = Lever { hand: 0.03 + 0.05 * rng.f64(), ..Lever::new(&mut rng) };
        let record = lever.record(4.0, &mut rng);
        let [times, positions, torques] = [record.times(), record.positions(), record.torques()].map(<[f64]>::to_vec);
        let found = fit(&Record::new(times, positions, torques).unwrap());
        assert!(found.sign.is_none_or(|sign| sign == lever.sign), "seed {seed}: {lever:?}");
        let Some(inertia) = found.inertia else { continue };
        let is_strange = |part: &Part| part.kind == Kind::Unexplained && part.share > 0.05;
        assert!(!found.misfit.kinds.iter().any(is_strange), "seed {seed}: {:?}", found.misfit);
        determined += 1;
        held += i32::from(inertia.covers(lever.inertia));
    }
    assert!(10 * held >= 9 * determined - 10, "{held} of {determined}");
}

/// A hand moves a master whose motor renders the inertia of another lever: the torque is the law of a loop, without friction, and its sign is
/// against the device's. What the other lever meets goes with nothing that the record has.
#[test]
fn the_rendered_inertia_of_another_lever_is_not_the_devices() {
    let mut determined = [0, 0];
    for seed in hapt_testing::seeds(24) {
        let mut rng = Rng::with_seed(seed);
        let (inertia, damping) = (2e-4 + 2e-4 * rng.f64(), 2e-3 + 4e-3 * rng.f64());
        let waves: Vec<[f64; 3]> = (0..6)
            .map(|_| [0.01 + 0.03 * rng.f64(), std::f64::consts::TAU * (1.0 + 4.0 * rng.f64()), 7.0 * rng.f64()])
            .collect();
        let sum = |t: f64, order: i32| -> f64 {
            let quarter = std::f64::consts::FRAC_PI_2 * f64::from(order);
            waves.iter().map(|[size, rate, phase]| size * rate.powi(order) * (rate * t + phase + quarter).sin()).sum()
        };
        let times: Vec<f64> = (0..9000).map(|k| 5e-4 * f64::from(k)).collect();
        let law: Vec<f64> = times.iter().map(|t| inertia * sum(*t, 2) + damping * sum(*t, 1)).collect();
        // Of 3 to 4.5 % of the variance, below 8 Hz or so.
        let (mut slow, mut slower) = (0.0, 0.0);
        let other: Vec<f64> = (0..times.len())
            .map(|_| {
                slow += 0.025 * (rng.f64() - 0.5 - slow);
                slower += 0.025 * (slow - slower);
                slower
            })
            .collect();
        let size = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
        let part = (0.03 + 0.015 * rng.f64()).sqrt() * size(&law) / size(&other);
        let positions: Vec<f64> = times.iter().map(|t| (sum(*t, 0) / 2e-5).round() * 2e-5).collect();
        for (i, other_part) in [0.0, part].into_iter().enumerate() {
            let torques = law.iter().zip(&other).map(|(law, other)| law + other_part * other).collect();
            let found = fit(&Record::new(times.clone(), positions.clone(), torques).unwrap());
            determined[i] += i32::from(found.sign.is_some() || found.inertia.is_some());
        }
    }
    // Without anything else the record is that of a free lever of this inertia.
    assert!(determined[0] > 0 && determined[1] == 0, "{determined:?}");
}

/// In a loop a delay is a damping: the interval allows for a delay between those that are tried.
#[test]
fn the_damping_of_a_loop_holds_whatever_its_delay() {
    let (mut determined, mut held) = (0, 0);
    for seed in hapt_testing::seeds(32) {
        let mut rng = Rng::with_seed(seed);
        let (delay, loop_stiffness) = (2e-3 * rng.f64(), 3.0 + 4.0 * rng.f64());
        let lever = Lever { delay, loop_stiffness, ..plain(&mut rng) };
        let Some(damping) = fit(&lever.record(4.0, &mut rng)).damping else { continue };
        determined += 1;
        held += i32::from(damping.covers(lever.damping));
    }
    assert!(determined > 0 && 10 * held >= 9 * determined - 10, "{held} of {determined}");
}

/// A motor on a voltage u gives k/R (u - k ω): with k/R u as the torque, the damping that is found is the device's own.
#[test]
fn a_motors_back_voltage_is_no_damping_of_the_device() {
    for seed in hapt_testing::seeds(8) {
        let mut rng = Rng::with_seed(seed);
        let back = 0.02 + 0.02 * rng.f64();
        let lever = Lever { loop_stiffness: 0.0, delay: 0.0, ..plain(&mut rng) };
        let driven = Lever { damping: lever.damping + back, ..lever };
        let record = driven.record(5.0, &mut rng);
        let known = Known { back_damping: back, ..Known::default() };
        let (with, without) = (fit_torque(&record, &known).unwrap(), fit_torque(&record, &Known::default()).unwrap());
        let (own, all) = (with.damping.unwrap(), without.damping.unwrap());
        assert!(own.covers(lever.damping) && all.covers(driven.damping), "seed {seed}: {own:?} {all:?} {lever:?}");
        assert_eq!(with.inertia, without.inertia);
    }
}

#[test]
fn the_motion_is_foretold_over_a_quarter_second() {
    let mut rng = Rng::with_seed(4);
    let record = Lever { loop_stiffness: 0.0, delay: 0.0, ..plain(&mut rng) }.record(4.0, &mut rng);
    let motion = fit(&record).motion;
    assert_eq!(motion.len(), record.times().len());
    let squares = |of: &dyn Fn(usize) -> f64| (0..motion.len()).map(|i| of(i).powi(2)).sum::<f64>();
    let middle = record.positions().iter().sum::<f64>() / motion.len() as f64;
    let left = squares(&|i| motion[i].1 - record.positions()[i]);
    assert!(left < 0.01 * squares(&|i| record.positions()[i] - middle), "{left}");
}

/// The term is the torque of a motor of sign 1 against the device's torque, whatever the motor's sign is.
#[test]
fn a_cogging_that_is_found_has_the_devices_torque_with_its_sign() {
    let (mut determined, mut right, mut all) = (0, 0, 0);
    for (seed, sign) in hapt_testing::seeds(6).flat_map(|seed| [(seed, 1.0), (seed, -1.0)]) {
        all += 1;
        let mut rng = Rng::with_seed(seed);
        let lever = Lever { cogging: 0.04, sign, ..plain(&mut rng) };
        let record = lever.record(5.0, &mut Rng::with_seed(seed));
        let fit = fit(&record);
        let Some(term) = found(&fit, |kind| matches!(kind, TermKind::Turn { times: 10..=12, .. })) else { continue };
        let TermKind::Turn { times, phase } = term.kind else { continue };
        determined += 1;
        let own = |z: f64| -term.size.value * (f64::from(times) * z + phase).sin();
        let both: f64 = record.positions().iter().map(|z| own(*z) * (11.0 * z).sin()).sum();
        right += i32::from(both > 0.0);
    }
    assert!(2 * determined >= all && right == determined, "{right} of {determined} of {all}");
}

/// The size and the phase are those of the level, for either sign of the motor, and a torque of the position is seldom mistaken for it.
#[test]
fn friction_that_changes_with_the_position_is_found_as_the_level_that_it_is() {
    let (mut determined, mut held, mut mistaken, mut all) = (0, 0, 0, 0);
    for (seed, sign) in hapt_testing::seeds(24).flat_map(|seed| [(seed, 1.0), (seed, -1.0)]) {
        let mut rng = Rng::with_seed(seed);
        let lever = plain(&mut rng);
        let rubbing = lever.friction[0] * (0.5 + 0.4 * rng.f64());
        let fit = fit(&Lever { rubbing, sign, ..lever }.record(4.0, &mut rng));
        all += 1;
        let Some(term) = found(&fit, |kind| matches!(kind, TermKind::FrictionByPosition { .. })) else { continue };
        let TermKind::FrictionByPosition { times, phase } = term.kind else { continue };
        determined += 1;
        let away = (phase - 0.4).sin().abs() < 0.5 && (phase - 0.4).cos() > 0.0;
        held += i32::from(
            (term.size.value / rubbing - 1.0).abs() < 0.4 && (10..=12).contains(&times) && (times != 11 || away),
        );
        mistaken += i32::from(found(&fit, |kind| matches!(kind, TermKind::Turn { .. })).is_some());
    }
    assert!(
        10 * determined >= 6 * all && 10 * held >= 9 * determined,
        "{determined} found, {held} of their size, of {all}"
    );
    assert!(20 * mistaken <= all, "{mistaken} of {all}");
}

/// On a spring the puck travels less than a period: another period would explain it as well.
#[test]
fn friction_by_position_is_not_told_from_less_than_a_period() {
    for seed in hapt_testing::seeds(24) {
        let mut rng = Rng::with_seed(seed);
        let times = 2 + rng.u32(..3);
        let sine = [1.0, 0.0, 0.0, 0.0];
        let by_position = FrictionByPosition {
            share: 0.4 + 0.5 * rng.f64(),
            pitch: TAU / f64::from(times),
            phase: rng.f64(),
            waveform: Waveform { sine, cosine: [0.0; 4] },
        };
        let rig = DeviceSpec { friction: 2e-2, delay: 0.0, friction_by_position: Some(by_position), ..WHEEL };
        let mut device = VirtualDevice::new(&rig);
        let (hertz, size) = (0.8 + 0.6 * rng.f64(), 0.35 * TAU / f64::from(times));
        let (mut positions, mut torques) = (Vec::new(), Vec::new());
        for k in 0..6000 {
            let (z, t) = (device.puck().0, 1e-3 * f64::from(k));
            let torque = 0.3 * (size * (TAU * hertz * t).sin() - z);
            positions.push(z);
            torques.push(torque);
            device.command(torque);
            device.travel();
        }
        let (low, high) = positions.iter().fold((0.0, 0.0), |(low, high): (f64, f64), z| (low.min(*z), high.max(*z)));
        let times: Vec<f64> = (0..6000).map(|k| 1e-3 * f64::from(k)).collect();
        let Some(fit) = fit_torque(&Record::new(times, positions, torques).unwrap(), &Known::default()) else {
            continue;
        };
        for term in &fit.terms {
            if let TermKind::FrictionByPosition { times, .. } = term.kind {
                assert!(f64::from(times) * (high - low) >= TAU, "seed {seed}: {term:?} over {} rad", high - low);
            }
        }
    }
}

/// Over a turn or more, gravity and a constant torque are two torques.
#[test]
fn a_constant_torque_is_told_from_gravity() {
    let (mut determined, mut held, mut all) = (0, 0, 0);
    for seed in hapt_testing::seeds(96) {
        let mut rng = Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        let inertia = 10f64.powf(between(-4.0, -2.0));
        let largest = inertia * between(60.0, 200.0);
        let (friction, offset) = (largest * between(0.02, 0.2), largest * between(-0.05, 0.05));
        let gravity = Gravity { torque: largest * between(0.1, 0.4), phase: between(-3.0, 3.0) };
        let torque = DeviceTorque { gravity: Some(gravity), cogging: None };
        let rig = DeviceSpec { damping: inertia, friction, torque, delay: 0.0, ..DeviceSpec::new(1e-3, inertia) };
        let torques = steps(&mut rng, 4000, largest);
        let moved: Vec<f64> = torques.iter().map(|torque| torque + offset).collect();
        let positions = motion(&rig, &moved);
        if positions.iter().fold(0.0, |most: f64, z| most.max(z.abs())) < TAU {
            continue;
        }
        let positions = counted(&positions, 8000.0, 0.3, &mut rng);
        let fit = fit(&Record::new(times(&rig, 4000), positions, torques).unwrap());
        all += 1;
        let Some(found) = fit.offset else { continue };
        determined += 1;
        held += i32::from(found.covers(offset));
    }
    assert!(
        2 * determined >= all && 20 * held >= 17 * determined && all > 0,
        "{held} hold the truth of {determined} determined, of {all}"
    );
}

/// Over a long gap a position is not known, and its interpolation would have no acceleration.
#[test]
fn a_long_gap_in_the_positions_biases_no_inertia() {
    for seed in hapt_testing::seeds(16) {
        let mut rng = Rng::with_seed(seed);
        let torques = steps(&mut rng, 4000, 0.08);
        let mut positions = counted(&motion(&WHEEL, &torques), 8000.0, 0.3, &mut rng);
        for _ in 0..4 {
            let from = rng.usize(100..3800);
            positions[from..from + 95].fill(f64::NAN);
        }
        let fit = fit(&Record::with_gaps(times(&WHEEL, 4000), positions, torques).unwrap());
        let inertia = fit.inertia.unwrap();
        assert!(
            (inertia.value / WHEEL.inertia - 1.0).abs() < 0.05 && inertia.covers(WHEEL.inertia),
            "seed {seed}: {inertia:?}"
        );
    }
}
