//! Devices that are richer than the model: the fit to the torque, in open and closed loops.

use fastrand::Rng;
use hapt_identify::{Kind, Known, Part, Record, TorqueFit, fit_torque};

use crate::lever::{Lever, PERIOD};
use crate::rig::counted;

fn fit(record: &Record) -> TorqueFit {
    fit_torque(record, &Known::default()).unwrap()
}

#[test]
fn nine_in_ten_intervals_of_rich_devices_hold_their_inertia_and_no_sign_is_wrong() {
    let (mut determined, mut held, mut all) = (0, 0, 0);
    for seed in hapt_testing::seeds(40) {
        let mut rng = Rng::with_seed(seed);
        let lever = Lever::new(&mut rng);
        let found = fit(&lever.record(4.0, &mut rng));
        all += 1;
        if let Some(inertia) = found.inertia {
            determined += 1;
            held += i32::from(inertia.covers(lever.inertia));
        }
        assert!(found.sign.is_none_or(|sign| sign == lever.sign), "seed {seed}: {lever:?}");
    }
    assert!(10 * determined >= 7 * all, "{determined} of {all} are determined");
    assert!(10 * held >= 9 * determined - 10, "{held} of {determined} intervals hold the inertia");
}

/// With a spring to a fixed position, the torque depends only on the position: a fit would find the loop's law.
#[test]
fn a_loops_own_law_is_not_taken_for_the_device() {
    for seed in hapt_testing::seeds(8) {
        let mut rng = Rng::with_seed(seed);
        let lever = Lever { loop_stiffness: 1.0, ..Lever::new(&mut rng) };
        let record = lever.record(4.0, &mut rng);
        let torques = record.positions().iter().map(|z| -1.3 * z).collect();
        let record = Record::new(record.times().to_vec(), record.positions().to_vec(), torques).unwrap();
        let found = fit(&record);
        assert_eq!((found.inertia, found.sign), (None, None), "seed {seed}");
    }
}

#[test]
fn one_frequency_does_not_tell_an_inertia_from_a_spring() {
    for seed in hapt_testing::seeds(8) {
        let mut rng = Rng::with_seed(seed);
        let (turns, phase) = (2.0 + 4.0 * rng.f64(), 6.0 * rng.f64());
        let times: Vec<f64> = (0..4000).map(|k| f64::from(k) * PERIOD).collect();
        let at = |t: &f64| (std::f64::consts::TAU * turns * t + phase).sin();
        let positions = counted(&times.iter().map(at).collect::<Vec<_>>(), 20_000.0, 0.3, &mut rng);
        let torques = times.iter().map(|t| -0.4 * at(&(t - 0.011))).collect();
        let found = fit(&Record::new(times, positions, torques).unwrap());
        assert!(found.sign.is_none() && found.inertia.is_none_or(|x| x.low == 0.0), "seed {seed}: {:?}", found.inertia);
    }
}

#[test]
fn two_halves_of_one_record_agree() {
    let (mut agree, mut all) = (0, 0);
    for seed in hapt_testing::seeds(20) {
        let mut rng = Rng::with_seed(seed);
        let lever = Lever::new(&mut rng);
        let record = lever.record(5.0, &mut rng);
        let half = |range: std::ops::Range<usize>| {
            let [times, positions, torques] =
                [record.times(), record.positions(), record.torques()].map(|x| x[range.clone()].to_vec());
            fit(&Record::new(times, positions, torques).unwrap()).inertia
        };
        let n = record.times().len();
        if let (Some(one), Some(other)) = (half(0..n / 2), half(n / 2..n)) {
            all += 1;
            agree += i32::from(one.low <= other.high && other.low <= one.high);
        }
    }
    assert!(10 * agree >= 9 * all - 5, "{agree} of {all}");
}

#[test]
fn what_the_equation_leaves_is_named_by_its_kind() {
    let mut rng = Rng::with_seed(5);
    let plain = Lever {
        cable: 0.0,
        gravity: 0.0,
        cogging: 0.0,
        delay: 0.0,
        sign: 1.0,
        loop_stiffness: 1.0,
        ..Lever::new(&mut rng)
    };
    let largest = |lever: Lever, rng: &mut Rng| fit(&lever.record(4.0, rng)).misfit.kinds[0].kind.word();
    assert_eq!(largest(Lever { cable: 0.5, ..plain }, &mut rng), "position");
    assert_eq!(largest(Lever { cogging: 0.05, ..plain }, &mut rng), "position");
    let rubbing = Lever { rubbing: 0.9 * plain.friction[0], ..plain };
    let Part { kind, .. } = fit(&rubbing.record(4.0, &mut rng)).misfit.kinds[0];
    assert!(matches!(kind, Kind::FrictionByPosition { times_a_turn: 10..=12 }), "{kind:?}");
    assert!(kind.remedy().contains("device.friction_by_position"));
}

/// Records of real levers, where they are available: the lab's inertia is 1.58e-3 kg m², by a frequency response.
#[test]
fn the_levers_of_a_lab_have_the_labs_inertia_in_their_intervals() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/tue");
    for name in ["m1-e-free", "m2-a-free", "m2-d-free"] {
        let Ok(text) = std::fs::read_to_string(format!("{folder}/{name}.csv")) else {
            println!("skipped: {folder}/{name}.csv is not there");
            continue;
        };
        let columns = hapt_identify::Columns::parse("position=slave_rad,torque=slave_motor_Nm").unwrap();
        let ([times, positions, torques], _) = columns.read(&text).unwrap();
        let found = fit(&Record::new(times, positions, torques).unwrap());
        let inertia = found.inertia.unwrap();
        assert!(inertia.covers(1.584e-3) && inertia.high < 5e-3, "{name}: {inertia:?}");
        assert!(found.sign.is_none_or(|sign| sign == 1.0), "{name}");
    }
}

/// Stretches of a second of the levers that move freely, where they are available.
#[test]
fn stretches_of_a_labs_levers_agree_with_each_other_and_with_the_lab() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/tue");
    let (mut determined, mut held, mut found) = (0, 0, Vec::new());
    for name in ["m1-a-free", "m1-e-free", "m2-a-free", "m2-d-free"] {
        let Ok(text) = std::fs::read_to_string(format!("{folder}/{name}.csv")) else {
            println!("skipped: {folder}/{name}.csv is not there");
            continue;
        };
        let columns = hapt_identify::Columns::parse("position=slave_rad,torque=slave_motor_Nm").unwrap();
        let (lists, _) = columns.read(&text).unwrap();
        for second in 0..lists[0].len() / 2000 {
            let [times, positions, torques] = [0, 1, 2].map(|i| lists[i][second * 2000..(second + 1) * 2000].to_vec());
            let Some(inertia) = fit(&Record::new(times, positions, torques).unwrap()).inertia else { continue };
            determined += 1;
            held += i32::from(inertia.covers(1.584e-3));
            found.push(inertia);
        }
    }
    let pairs = found.iter().enumerate().flat_map(|(i, one)| found[..i].iter().map(move |other| (one, other)));
    let (mut agree, mut all) = (0, 0);
    for (one, other) in pairs {
        all += 1;
        agree += i32::from(one.low <= other.high && other.low <= one.high);
    }
    assert!(
        10 * held >= 9 * determined && 10 * agree >= 9 * all,
        "{held} of {determined} hold it, {agree} of {all} agree"
    );
}

/// A device that does not respond to the torque, moved by another cause.
#[test]
fn a_puck_that_another_moves_is_told_no_inertia() {
    for seed in hapt_testing::seeds(8) {
        let mut rng = Rng::with_seed(seed);
        let record = Lever { hand: 0.08, loop_stiffness: 0.0, ..Lever::new(&mut rng) }.record(4.0, &mut rng);
        let strange: Vec<f64> = record.positions().iter().rev().map(|z| 0.1 * z).collect();
        let found = fit(&Record::new(record.times().to_vec(), record.positions().to_vec(), strange).unwrap());
        assert!(found.sign.is_none() && found.inertia.is_none(), "seed {seed}: {:?}", found.inertia);
    }
}
