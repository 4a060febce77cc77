//! Devices that are richer than the model: the fit to the torque, in open and closed loops.

use fastrand::Rng;
use hapt_identify::{Known, Record, TorqueFit, fit_torque};

use crate::rig::counted;

/// A lever on a cable, with what real ones have beside inertia, damping and friction.
#[derive(Clone, Copy, Debug)]
struct Lever {
    inertia: f64,
    damping: f64,
    /// To one side and to the other.
    friction: [f64; 2],
    cable: f64,
    cogging: f64,
    gravity: f64,
    /// In s.
    delay: f64,
    sign: f64,
    /// A loop that holds it: stiffness and damping of a virtual spring to a moving target; 0: open.
    loop_stiffness: f64,
}

const PERIOD: f64 = 5e-4;

impl Lever {
    fn new(rng: &mut Rng) -> Self {
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        Lever {
            inertia: 1e-3 * between(0.5, 3.0),
            damping: 1e-3 * between(1.0, 8.0),
            friction: [between(0.015, 0.03), between(0.015, 0.03)],
            cable: between(0.0, 0.1),
            cogging: between(0.0, 4e-3),
            gravity: between(0.0, 0.01),
            delay: between(0.0, 2e-3),
            sign: if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 },
            loop_stiffness: if between(0.0, 1.0) < 0.5 { 0.0 } else { between(0.5, 2.0) },
        }
    }

    /// Torques and positions over a time in s, in small steps of the exact equation.
    fn record(&self, duration: f64, rng: &mut Rng) -> Record {
        let (mut z, mut v, mut drift) = (0.1, 0.0, 0.0);
        let samples = (duration / PERIOD) as usize;
        let (mut seen, mut torques) = (Vec::new(), Vec::new());
        let (mut level, mut left) = (0.0, 0);
        let late = (self.delay / PERIOD) as usize;
        let phases: Vec<f64> = (0..4).map(|_| std::f64::consts::TAU * rng.f64()).collect();
        for k in 0..samples {
            let t = k as f64 * PERIOD;
            if left == 0 {
                left = rng.usize(60..240);
                level = 0.1 * (2.0 * rng.f64() - 1.0);
            }
            left -= 1;
            drift = 0.999 * drift + 3e-4 * (rng.f64() - 0.5);
            let target: f64 = phases
                .iter()
                .enumerate()
                .map(|(i, p)| 0.25 * (6.0 * (i as f64 + 1.0) * t + p).sin() / (i as f64 + 1.0))
                .sum();
            let command = if self.loop_stiffness > 0.0 {
                self.loop_stiffness * (target - z) - 0.02 * v
            } else {
                level - 0.15 * z
            };
            seen.push(z);
            torques.push(self.sign * command);
            let motor = self.sign * torques[k.saturating_sub(late)];
            for _ in 0..10 {
                let dt = 0.1 * PERIOD;
                let other = motor + drift + self.cogging * (11.0 * z).sin() - self.gravity * z.sin() - self.cable * z;
                let friction = if v > 0.0 { self.friction[0] } else { self.friction[1] };
                let free = v + dt * (other - self.damping * v) / self.inertia;
                let brake = dt * friction / self.inertia;
                v = if free.abs() <= brake { 0.0 } else { free - brake * free.signum() };
                z += dt * v;
            }
        }
        let seen = counted(&seen, 20_000.0, 0.3, rng);
        Record::new((0..samples).map(|k| k as f64 * PERIOD).collect(), seen, torques).unwrap()
    }
}

fn fit(record: &Record) -> TorqueFit {
    fit_torque(record, &Known::default()).unwrap()
}

#[test]
fn nine_in_ten_intervals_of_rich_devices_hold_their_inertia_and_no_sign_is_wrong() {
    let (mut told, mut held, mut all) = (0, 0, 0);
    for seed in hapt_testing::seeds(40) {
        let mut rng = Rng::with_seed(seed);
        let lever = Lever::new(&mut rng);
        let found = fit(&lever.record(4.0, &mut rng));
        all += 1;
        if let Some(inertia) = found.inertia {
            told += 1;
            held += i32::from(inertia.covers(lever.inertia));
        }
        assert!(found.sign.is_none_or(|sign| sign == lever.sign), "seed {seed}: {lever:?}");
    }
    assert!(10 * told >= 7 * all, "{told} of {all} are told");
    assert!(10 * held >= 9 * told - 10, "{held} of {told} intervals hold the inertia");
}

/// With a spring to a place that stands still, the torque says nothing that the position does not: a fit would find the loop's law.
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
}

/// Records of real levers, where they are at hand: the lab's inertia is 1.58e-3 kg m², by a frequency response.
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
        assert!(inertia.covers(1.584e-3) && inertia.high < 3.5e-3, "{name}: {inertia:?}");
        assert!(found.sign.is_none_or(|sign| sign == 1.0), "{name}");
    }
}
