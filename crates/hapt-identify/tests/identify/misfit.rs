//! The kinds of what the equation of motion leaves: each cause by its own kind, and by no other.

use std::f64::consts::TAU;

use fastrand::Rng;
use hapt_identify::{Kind, Known, Misfit, Record, TorqueFit, fit_torque};
use hapt_model::Waveform;
use hapt_plant::VirtualDevice;
use hapt_plant::spec::{Cogging, DeviceSpec, FrictionByPosition, Gravity, Handle, Stribeck};

use crate::rig::{counted, times};

/// A torque of a device that the equation of motion has not.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cause {
    Cable,
    Gravity,
    Cogging,
    Rubbing,
    Stribeck,
    Shaft,
    Hum,
    Drift,
}

const CAUSES: [Cause; 8] = [
    Cause::Cable,
    Cause::Gravity,
    Cause::Cogging,
    Cause::Rubbing,
    Cause::Stribeck,
    Cause::Shaft,
    Cause::Hum,
    Cause::Drift,
];

impl Cause {
    /// Whether the kind is this one's.
    fn is(self, kind: Kind) -> bool {
        match self {
            Cause::Cable => kind == Kind::Position { times_a_turn: 0 },
            Cause::Gravity => kind == Kind::Position { times_a_turn: 1 },
            Cause::Cogging => matches!(kind, Kind::Position { times_a_turn: 2.. }),
            Cause::Rubbing => matches!(kind, Kind::FrictionByPosition { .. }),
            Cause::Stribeck => kind == Kind::Velocity,
            Cause::Shaft | Cause::Hum => matches!(kind, Kind::Resonance { .. }),
            Cause::Drift => kind == Kind::Drift,
        }
    }
}

/// What a random device with these causes leaves.
fn misfit(seed: u64, causes: &[Cause]) -> Misfit {
    let misfit = fitted(seed, causes).1.misfit;
    let sum: f64 = misfit.kinds.iter().map(|part| part.share).sum();
    assert!((sum / misfit.share - 1.0).abs() < 1e-9, "seed {seed}, {causes:?}: {misfit:?}");
    misfit
}

/// A random device with these causes, and the fit to a record of it.
fn fitted(seed: u64, causes: &[Cause]) -> (DeviceSpec, TorqueFit) {
    let (rig, record) = recorded(seed, causes);
    (rig, fit_torque(&record, &Known::default()).unwrap())
}

/// A random device with these causes, and a record of it.
fn recorded(seed: u64, causes: &[Cause]) -> (DeviceSpec, Record) {
    let mut rng = Rng::with_seed(seed);
    let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
    let inertia = 10f64.powf(between(-4.0, -2.0));
    let largest = inertia * between(60.0, 200.0);
    let mut rig = DeviceSpec {
        damping: inertia * between(0.5, 3.0),
        friction: largest * between(0.05, 0.1),
        delay: between(0.0, 3e-3),
        ..DeviceSpec::new(1e-3, inertia)
    };
    let counts = 10f64.powf(between(3.6, 4.6)).floor();
    let waveform = Waveform { sine: [1.0, 0.0, 0.0, 0.0], cosine: [0.0; 4] };
    let (mut cable, mut drift, mut hum, mut hertz) = (0.0, 0.0, 0.0, 0.0);
    for cause in causes {
        let phase = between(-3.0, 3.0);
        match cause {
            Cause::Cable => cable = largest * between(0.05, 0.2),
            Cause::Gravity => rig.torque.gravity = Some(Gravity { torque: largest * between(0.1, 0.3), phase }),
            Cause::Cogging => {
                let pitch = TAU / between(3.0, 13.0).floor();
                rig.torque.cogging = Some(Cogging { torque: largest * between(0.1, 0.3), pitch, phase, waveform });
            }
            Cause::Rubbing => {
                let pitch = TAU / between(2.0, 11.0).floor();
                rig.friction = largest * between(0.15, 0.3);
                rig.friction_by_position =
                    Some(FrictionByPosition { share: between(0.6, 0.95), pitch, phase, waveform });
            }
            Cause::Stribeck => {
                rig.stribeck = Some(Stribeck { torque: largest * between(0.2, 0.4), velocity: between(1.5, 5.0) });
            }
            Cause::Shaft => {
                let (handle, omega) = (inertia * between(0.3, 1.0), TAU * between(6.0, 20.0));
                let (stiffness, damping) = (handle * omega * omega, 2.0 * between(0.02, 0.1) * handle * omega);
                rig.handle = Some(Handle { inertia: handle, stiffness, damping });
            }
            Cause::Hum => (hum, hertz) = (largest * between(0.1, 0.3), between(5.0, 20.0)),
            Cause::Drift => drift = largest * between(0.2, 0.4) * if phase < 0.0 { -1.0 } else { 1.0 },
        }
    }
    let mut device = VirtualDevice::new(&rig);
    let (mut positions, mut torques, mut level, mut left) = (Vec::new(), Vec::new(), 0.0, 0);
    let samples = 5000;
    for k in 0..samples {
        if left == 0 {
            left = rng.usize(40..200);
            level = 2.0 * rng.f64() - 1.0;
        }
        left -= 1;
        let z = device.puck().0;
        // The command holds the puck near the middle.
        let torque = largest * (level - 0.25 * z).clamp(-1.5, 1.5);
        positions.push(z);
        torques.push(torque);
        let time = k as f64 / samples as f64;
        let other = drift * (time - 0.5) + hum * (TAU * hertz * time * samples as f64 * rig.period).sin();
        device.command(torque - cable * z + other);
        device.travel();
    }
    let positions = counted(&positions, counts, 0.5, &mut rng);
    let record = Record::new(times(&rig, samples), positions, torques).unwrap();
    (rig, record)
}

/// Without a cause the best fit has the device's own numbers, and with any it still has some.
#[test]
fn the_best_fit_of_a_plain_device_has_its_numbers() {
    for seed in 0..10 {
        let (rig, fit) = fitted(seed, &[]);
        let (best, largest) = (fit.best, rig.inertia * 60.0);
        let is_near = |found: f64, value: f64, more: f64| (found - value).abs() < 0.05 * value + more;
        assert!(is_near(best.inertia, rig.inertia, 0.0), "seed {seed}: {best:?}, {rig:?}");
        assert!(is_near(best.friction, rig.friction, 0.01 * largest), "seed {seed}: {best:?}, {rig:?}");
        assert!(is_near(best.damping, rig.damping, 0.2 * rig.damping), "seed {seed}: {best:?}, {rig:?}");
        assert!(is_near(best.offset, 0.0, 0.01 * largest), "seed {seed}: {best:?}, {rig:?}");
    }
    for (seed, cause) in CAUSES.into_iter().enumerate() {
        let best = fitted(seed as u64, &[cause]).1.best;
        assert!(best.inertia > 0.0 && [best.damping, best.friction, best.offset].iter().all(|x| x.is_finite()));
    }
}

/// A known inertia is that of the best fit, and scales its other numbers.
#[test]
fn the_best_fit_has_a_known_inertia() {
    for (seed, cause) in CAUSES.into_iter().enumerate() {
        let (_, record) = recorded(seed as u64, &[cause]);
        let of = |inertia| fit_torque(&record, &Known { inertia, ..Known::default() }).unwrap().best;
        let (free, known) = (of(None), of(Some(0.02)));
        assert!((known.inertia / 0.02 - 1.0).abs() < 1e-12, "{cause:?}: {known:?}");
        for (free_number, known_number) in
            [(free.damping, known.damping), (free.friction, known.friction), (free.offset, known.offset)]
        {
            let error = known_number * free.inertia - free_number * known.inertia;
            assert!(error.abs() <= 1e-12 * (free_number * known.inertia).abs(), "{cause:?}: {free:?}, {known:?}");
        }
    }
}

/// The part of the misfit of each cause, and of kinds that are of none of them.
fn parts(misfit: &Misfit, causes: &[Cause]) -> (Vec<f64>, f64) {
    let of = |is: &dyn Fn(Kind) -> bool| {
        misfit.kinds.iter().filter(|part| is(part.kind)).map(|part| part.share).sum::<f64>() / misfit.share
    };
    let other = |kind: Kind| kind != Kind::Unexplained && causes.iter().all(|cause| !cause.is(kind));
    (causes.iter().map(|cause| of(&|kind| cause.is(kind))).collect(), of(&other))
}

#[test]
fn one_cause_is_the_largest_kind_and_no_other_kind_is_named() {
    let (mut largest, mut without_others, mut all, mut wrong) = (0, 0, 0, Vec::new());
    for (seed, cause) in hapt_testing::seeds(40).flat_map(|seed| CAUSES.map(|cause| (seed, cause))) {
        let misfit = misfit(seed, &[cause]);
        let (_, other) = parts(&misfit, &[cause]);
        all += 1;
        largest += i32::from(cause.is(misfit.kinds[0].kind));
        without_others += i32::from(other < 0.05);
        if other > 0.0 {
            wrong.push((seed, cause, misfit));
        }
    }
    assert!(
        50 * largest >= 49 * all - 50 && 50 * without_others >= 49 * all - 50,
        "{largest}, {without_others} of {all}: {wrong:?}"
    );
}

#[test]
fn two_causes_are_both_named() {
    let (mut named, mut without_others, mut all, mut wrong) = (0, 0, 0, Vec::new());
    for seed in hapt_testing::seeds(160) {
        let (one, more) = (seed as usize % CAUSES.len(), 1 + (seed as usize / CAUSES.len()) % (CAUSES.len() - 1));
        let causes = [CAUSES[one], CAUSES[(one + more) % CAUSES.len()]];
        let misfit = misfit(seed, &causes);
        let (each, other) = parts(&misfit, &causes);
        all += 1;
        named += i32::from(each.iter().all(|part| *part > 0.0));
        without_others += i32::from(other < 0.05);
        wrong.push((seed, causes, each, other));
    }
    wrong.retain(|(_, _, each, other)| *other > 0.0 || each.contains(&0.0));
    assert!(
        10 * named >= 9 * all - 10 && 20 * without_others >= 19 * all - 20,
        "{named}, {without_others} of {all}: {wrong:?}"
    );
}
