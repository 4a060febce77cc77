//! The fit against hapt-plant's exact device, which shares no code with it.

use std::f64::consts::TAU;

use fastrand::Rng;
use hapt_identify::{Columns, Error, Identified, Known, Puck, Record, identify};
use hapt_plant::VirtualDevice;
use hapt_plant::spec::DeviceSpec;
use hapt_testing::prelude::*;

use crate::rig::{WHEEL, counted, motion, steps, times};

fn record(rig: &DeviceSpec, seed: u64, samples: usize, counts: f64, noise: f64) -> Record {
    let mut rng = Rng::with_seed(seed);
    let torques = steps(&mut rng, samples, 0.08);
    let seen = counted(&motion(rig, &torques), counts, noise, &mut rng);
    Record::new(times(rig, samples), seen, torques).unwrap()
}

/// Every interval that covers the truth, by name.
fn covered(found: &Identified, rig: &DeviceSpec) -> [bool; 4] {
    let of = |interval: Option<hapt_identify::Interval>, truth| interval.is_some_and(|x| x.covers(truth));
    [
        of(found.inertia, rig.inertia),
        of(found.damping, rig.damping),
        of(found.friction, rig.friction),
        of(found.delay, rig.delay),
    ]
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    #[test]
    fn the_puck_goes_where_the_exact_device_goes(
        seed in any::<u64>(), inertia in 1e-4..1e-2f64, rate in 0.0..30.0f64, friction in 0.0..0.05f64, delay in 0.0..8e-3f64,
        lag in prop_oneof![Just(0.0), 5e-5..2e-2f64],
    ) {
        let rig = DeviceSpec { lag, delay, damping: rate * inertia, friction, ..DeviceSpec::new(1e-3, inertia) };
        let mut torques = steps(&mut Rng::with_seed(seed), 1500, 0.1);
        torques[0] = 0.0; // What is held before the first command.
        let truth = motion(&rig, &torques);
        let puck =
            Puck { gain: inertia.recip(), damping: rate, friction: friction / inertia, delay, offset: 0.0, position: 0.0, velocity: 0.0, lag };
        let size = truth.iter().fold(1e-3, |size: f64, z| size.max(z.abs()));
        for (k, (z, truth)) in puck.positions(&times(&rig, 1500), &torques).iter().zip(&truth).enumerate() {
            prop_assert!((z - truth).abs() < 1e-9 * size, "sample {k}: {z} and {truth}");
        }
    }

    #[test]
    fn the_sensitivities_are_the_slopes_of_the_positions(seed in any::<u64>(), friction in 1.0..40.0f64, first in 0usize..100,
        lag in prop_oneof![Just(0.0), 2e-4..2e-2f64],
    ) {
        let samples = 800;
        let torques = steps(&mut Rng::with_seed(seed), samples, 0.08);
        let times = times(&WHEEL, samples);
        let puck = Puck { gain: 1500.0, damping: 2.0, friction, delay: 2.37e-3, offset: 3.0, position: 0.3, velocity: 0.7, lag };
        let positions = |puck: &Puck| {
            let mut positions = Vec::new();
            puck.follow(&times, &torques, first, |_, z, _| positions.push(z));
            positions
        };
        let mut slopes = Vec::new();
        puck.follow(&times, &torques, first, |_, _, s| slopes.push(*s));
        let steps = [1e-3, 1e-5, 1e-5, 1e-8, 1e-5, 1e-5, 1e-5, 1e-5 * lag * lag];
        for i in 0..if lag > 0.0 { 8 } else { 7 } {
            let moved = |by: f64| {
                let mut p = puck.parameters();
                p[i] += by * steps[i];
                positions(&Puck::from_parameters(p))
            };
            let (up, down) = (moved(1.0), moved(-1.0));
            let size = slopes.iter().map(|s| s[i].abs()).fold(0.0, f64::max);
            // Where a step of the parameter adds or removes a rest, the positions have a corner.
            let off = (0..up.len()).filter(|&k| {
                let slope = (up[k] - down[k]) / (2.0 * steps[i]);
                (slope - slopes[k][i]).abs() > 1e-3 * size + 1e-6
            });
            prop_assert!(off.count() * 20 < up.len(), "parameter {i}");
        }
    }
}

#[test]
fn without_noise_the_device_is_found_to_many_digits() {
    let torques = steps(&mut Rng::with_seed(1), 3000, 0.08);
    let record = Record::new(times(&WHEEL, 3000), motion(&WHEEL, &torques), torques).unwrap();
    let found = identify(&record, &Known::default()).unwrap();
    let values = [found.inertia, found.damping, found.friction, found.delay].map(|x| x.unwrap().value);
    for (value, truth) in values.into_iter().zip([WHEEL.inertia, WHEEL.damping, WHEEL.friction, WHEEL.delay]) {
        assert!((value / truth - 1.0).abs() < 1e-6, "{value} is {truth}");
    }
    assert_eq!(found.counts, None);
    assert_eq!(found.warnings(), Vec::<String>::new());
}

#[test]
fn a_motor_of_the_other_sign_is_the_same_device() {
    let rig = DeviceSpec { delay: 0.0, ..WHEEL };
    let right = record(&rig, 3, 3000, 4000.0, 0.7);
    let mirrored: Vec<f64> = right.torques().iter().map(|torque| -torque).collect();
    let wrong = Record::new(right.times().to_vec(), right.positions().to_vec(), mirrored).unwrap();
    let (right, wrong) = (identify(&right, &Known::default()).unwrap(), identify(&wrong, &Known::default()).unwrap());
    assert_eq!(right.sign.unwrap().value, 1.0);
    assert_eq!(wrong.sign.unwrap().value, -1.0);
    let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    near(right.inertia.unwrap().value, wrong.inertia.unwrap().value);
    near(right.damping.unwrap().high, wrong.damping.unwrap().high);
}

#[test]
fn a_known_inertia_gives_the_motors_gain() {
    // The motor gives 80 % of the commanded torque.
    let mut rng = Rng::with_seed(5);
    let commanded = steps(&mut rng, 4000, 0.1);
    let given: Vec<f64> = commanded.iter().map(|torque| 0.8 * torque).collect();
    let seen = counted(&motion(&WHEEL, &given), 4000.0, 0.7, &mut rng);
    let record = Record::new(times(&WHEEL, 4000), seen, commanded).unwrap();
    let known = Known { inertia: Some(WHEEL.inertia), ..Known::default() };
    let found = identify(&record, &known).unwrap();
    assert!(found.gain.unwrap().covers(0.8), "{:?}", found.gain);
    assert_eq!(covered(&found, &WHEEL), [true; 4], "{found:?}");
    // Without it everything is per unit of commanded torque.
    let found = identify(&record, &Known::default()).unwrap();
    assert!(found.inertia.unwrap().covers(WHEEL.inertia / 0.8), "{:?}", found.inertia);
    assert_eq!(found.gain, None);
}

#[test]
fn a_coast_down_shows_damping_and_friction_over_inertia() {
    // Spun up by the motor, and then no torque.
    let mut torques = vec![0.06; 300];
    torques.resize(4000, 0.0);
    let positions =
        counted(&motion(&DeviceSpec { delay: 0.0, ..WHEEL }, &torques), 4000.0, 0.7, &mut Rng::with_seed(2));
    let record = Record::new(times(&WHEEL, 3700), positions[300..].to_vec(), vec![0.0; 3700]).unwrap();
    let found = identify(&record, &Known::default()).unwrap();
    assert_eq!((found.inertia, found.damping, found.sign, found.delay), (None, None, None, None));
    let [damping, friction] = found.rates.map(Option::unwrap);
    assert!(damping.covers(WHEEL.damping / WHEEL.inertia), "{damping:?}");
    assert!(friction.covers(WHEEL.friction / WHEEL.inertia), "{friction:?}");
    let known = Known { inertia: Some(WHEEL.inertia), ..Known::default() };
    let found = identify(&record, &known).unwrap();
    assert!(found.damping.unwrap().covers(WHEEL.damping) && found.friction.unwrap().covers(WHEEL.friction));
}

#[test]
fn a_rest_on_one_count_is_one_measurement() {
    // Without noise the puck rests on the same count for ever; the intervals do not shrink by that.
    let mut torques = steps(&mut Rng::with_seed(12), 2000, 0.08);
    torques.resize(2500, 0.0);
    let rig = DeviceSpec { delay: 1e-3, ..WHEEL };
    let seen = counted(&motion(&rig, &torques), 4000.0, 0.0, &mut Rng::with_seed(0));
    let found = identify(&Record::new(times(&rig, 2500), seen.clone(), torques.clone()).unwrap(), &Known::default());
    let found = found.unwrap().friction.unwrap();
    let mut seen = seen;
    seen.resize(20_000, seen[2499]);
    torques.resize(20_000, 0.0);
    let longer = identify(&Record::new(times(&rig, 20_000), seen, torques).unwrap(), &Known::default());
    let longer = longer.unwrap().friction.unwrap();
    assert!(((longer.high - longer.low) / (found.high - found.low) - 1.0).abs() < 1e-3, "{longer:?} {found:?}");
}

#[test]
fn a_position_that_was_not_measured_costs_no_more_than_itself() {
    let width = |x: Option<hapt_identify::Interval>| x.map_or(0.0, |x| x.high - x.low);
    for seed in hapt_testing::seeds(16) {
        let whole = record(&WHEEL, seed, 3000, 4000.0, 0.7);
        let (times, torques) = (whole.times().to_vec(), whole.torques().to_vec());
        let mut rng = Rng::with_seed(!seed);
        let seen = whole.positions().iter().map(|z| if rng.u8(..16) == 0 { f64::NAN } else { *z }).collect();
        let holed = Record::with_gaps(times, seen, torques).unwrap();
        let [whole, holed] = [whole, holed].map(|record| identify(&record, &Known::default()).unwrap());
        // One measurement in sixteen is missing: the numbers stay, and the intervals stay of their size.
        for (a, b) in [(whole.inertia, holed.inertia), (whole.damping, holed.damping), (whole.delay, holed.delay)] {
            let ratio = width(b) / width(a);
            assert!((0.5..2.0).contains(&ratio), "seed {seed}: {a:?}, with gaps {b:?}");
            let apart = a.zip(b).map_or(f64::INFINITY, |(a, b)| (a.value - b.value).abs());
            assert!(apart < 0.5 * width(a).max(width(b)), "seed {seed}: {a:?}, with gaps {b:?}");
        }
        assert_eq!(holed.counts, whole.counts, "seed {seed}");
    }
}

#[test]
fn uneven_times_are_what_they_are() {
    let full = record(&DeviceSpec { delay: 2e-3, ..WHEEL }, 9, 4000, 4000.0, 0.7);
    // Positions at a third of the samples, at random; but every torque's step is kept.
    let mut rng = Rng::with_seed(4);
    let keep: Vec<usize> =
        (0..4000).filter(|&k| k == 0 || full.torques()[k] != full.torques()[k - 1] || rng.u8(..3) == 0).collect();
    let of = |list: &[f64]| keep.iter().map(|&k| list[k]).collect::<Vec<_>>();
    let thin = Record::new(of(full.times()), of(full.positions()), of(full.torques())).unwrap();
    let found = identify(&thin, &Known::default()).unwrap();
    let truth = [WHEEL.inertia, WHEEL.damping, WHEEL.friction, 2e-3];
    for (interval, truth) in [found.inertia, found.damping, found.friction, found.delay].into_iter().zip(truth) {
        let x = interval.unwrap();
        // Four standard errors.
        assert!((x.value - truth).abs() < 2.0 * (x.high - x.value), "{x:?} {truth}");
    }
}

#[test]
fn a_push_in_one_direction_does_not_tell_friction_from_inertia() {
    // One long push determines only the torque less the friction, over the inertia.
    let rig = DeviceSpec { damping: 20e-3, delay: 0.0, ..WHEEL };
    let torques: Vec<f64> =
        (0..2000).map(|k| if k < 100 { 0.0 } else { 0.1 + 1e-3 * (0.05 * k as f64).sin() }).collect();
    let seen = counted(&motion(&rig, &torques), 4000.0, 0.7, &mut Rng::with_seed(8));
    let found = identify(&Record::new(times(&rig, 2000), seen, torques).unwrap(), &Known::default()).unwrap();
    let pairs: Vec<_> = found.correlated.iter().map(|pair| pair.names).collect();
    assert!(pairs.contains(&["inertia", "friction"]), "{found:?}");
    assert!(
        found.warnings().iter().any(|line| line.contains("separates inertia from friction")),
        "{:?}",
        found.warnings()
    );
    // An experiment with both directions does.
    let good = identify(&record(&rig, 1, 3000, 4000.0, 0.7), &Known::default()).unwrap();
    assert!(good.correlated.is_empty() && good.condition < 0.1 * found.condition, "{good:?}");
}

#[test]
fn a_spring_that_nobody_knows_of_is_found_or_leaves_more_than_noise() {
    // The puck is on a real spring, which the puck's own equation does not contain.
    let mut rng = Rng::with_seed(6);
    let torques = steps(&mut rng, 1500, 0.08);
    let mut device = VirtualDevice::new(&WHEEL);
    let positions: Vec<f64> = torques
        .iter()
        .map(|torque| {
            let z = device.puck().0;
            device.command(torque - 0.02 * z);
            device.travel();
            z
        })
        .collect();
    let seen = counted(&positions, 4000.0, 0.7, &mut rng);
    let found = identify(&Record::new(times(&WHEEL, 1500), seen, torques).unwrap(), &Known::default());
    let is_spring = |term: &hapt_identify::Term| term.kind == hapt_identify::TermKind::Stiffness;
    let spring = found.as_ref().ok().and_then(|found| found.terms.iter().find(|term| is_spring(term)).copied());
    if let Some(spring) = spring {
        assert!((spring.size.value / 0.02 - 1.0).abs() < 0.1, "{spring:?}");
        return;
    }
    let says = found.map(|found| found.warnings());
    assert!(
        matches!(says, Err(Error::Unexplained | Error::Residual(_)))
            || says.as_ref().is_ok_and(|lines| lines[0].contains("no independent noise")),
        "{says:?}"
    );
}

#[test]
fn what_is_no_experiment_is_refused() {
    let good = record(&WHEEL, 1, 600, 4000.0, 0.7);
    let new = |times: &[f64], positions: &[f64], torques: &[f64]| {
        Record::new(times.to_vec(), positions.to_vec(), torques.to_vec())
    };
    let (t, z, u) = (good.times(), good.positions(), good.torques());
    assert_eq!(new(&t[..599], z, u), Err(Error::Lengths { times: 599, positions: 600, torques: 600 }));
    assert!(matches!(new(&t[..100], &z[..100], &u[..100]), Err(Error::Short { samples: 100, .. })));
    // Milliseconds in a column of seconds.
    let slow: Vec<f64> = (0..t.len()).map(|k| 5.0 * k as f64).collect();
    assert!(matches!(new(&slow, z, u), Err(Error::Sparse { apart }) if (apart - 5.0).abs() < 1e-9));
    assert_eq!(new(t, &[0.0; 600], u), Err(Error::Still { values: 1 }));
    assert_eq!(new(t, z, &[0.5; 600]), Err(Error::Constant { torque: 0.5 }));
    // The squares of these would be 0.
    let tiny: Vec<f64> = (0..600).map(|i| if i % 20 < 10 { 1e-200 } else { -1e-200 }).collect();
    assert_eq!(new(t, z, &tiny), Err(Error::Constant { torque: 1e-200 }));
    let mut back = t.to_vec();
    back[7] = back[6];
    assert_eq!(new(&back, z, u), Err(Error::Times { sample: 7, time: t[6], before: t[6] }));
    let mut torn = z.to_vec();
    torn[9] = f64::INFINITY;
    assert_eq!(new(t, &torn, u), Err(Error::NotFinite { sample: 9, what: "position", value: f64::INFINITY }));
    // A motion that does not depend on the torque.
    let swing: Vec<f64> = t.iter().map(|t| (30.0 * t).sin()).collect();
    let unrelated = new(t, &swing, u).unwrap();
    assert_eq!(identify(&unrelated, &Known::default()), Err(Error::Unexplained));
}

#[test]
fn columns_are_found_by_their_names_and_read_in_their_units() {
    let text = "# a log\ntime (ms);Angle [deg];current_A;tau_mNm\n0;180;1;5\n2.5;-90;1;-7\n";
    let (rows, motion) = Columns::default().read(text).unwrap();
    let half = std::f64::consts::FRAC_PI_2;
    let near = |a: &[f64], b: [f64; 2]| assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15), "{a:?} {b:?}");
    near(&rows[0], [0.0, 2.5e-3]);
    near(&rows[1], [2.0 * half, -half]);
    near(&rows[2], [5e-3, -7e-3]);
    assert_eq!(motion, hapt_model::Motion::Rotary);
    let named = Columns { counts: Some(400.0), ..Columns::parse("time=t_s,position=enc_counts,torque=u_Nm").unwrap() };
    let (rows, _) = named.read("u_Nm,t_s,enc_counts\n0.5,0,100\n").unwrap();
    // A column that is only named by them is found.
    let unnamed = Columns { counts: Some(400.0), ..Columns::default() };
    let (plain, _) = unnamed.read("torque_Nm\tt_s\tcounts\n0.5\t0\t100\n0.6\t1\t101\n").unwrap();
    assert_eq!(plain[1][0], rows[1][0]);
    near(&rows[1], [half; 2]);
    let spring = Columns { spring: Some(2.0), ..Columns::default() };
    let (rows, motion) = spring.read("t_s,position_mm\n0,5\n").unwrap();
    assert_eq!((rows[2][0], motion), (-0.01, hapt_model::Motion::Linear));
}

proptest! {
    #![proptest_config(hapt_testing::cases(32))]

    #[test]
    fn no_table_panics(text in "(time_s|t_ms|[a-z_]{1,8}),(puck_rad|pos_mm|[a-z_()]{1,9}),(tau_Nm|u)\n([-+0-9.e,;\t nai]{0,30}\n){0,8}") {
        let _ = Columns::default().read(&text);
    }

    #[test]
    fn no_record_panics(seed in any::<u64>(), wild in any::<bool>()) {
        let mut rng = Rng::with_seed(seed);
        let mut number = |likely: f64| match rng.u8(..20) {
            0 => 0.0,
            1 if wild => 10f64.powi(rng.i32(-300..300)),
            _ => likely * (rng.f64() - 0.5),
        };
        let mut time = -1.0;
        let times = (0..400).map(|_| { time += number(6e-3).abs().clamp(1e-9, 1.0); time }).collect();
        let positions = (0..400).map(|_| number(1.0)).collect();
        let torques = (0..400).map(|_| number(1.0)).collect();
        if let Ok(record) = Record::new(times, positions, torques)
            && let Ok(found) = identify(&record, &Known::default())
        {
            let _ = found.warnings();
        }
    }
}

#[test]
fn a_wheel_that_rings_on_a_virtual_spring_shows_its_inertia() {
    for seed in hapt_testing::seeds(30) {
        let mut rng = Rng::with_seed(seed);
        let mut within = |from: f64, to: f64| from * (to / from).powf(rng.f64());
        let (inertia, stiffness) = (within(3e-4, 3e-3), within(0.3, 3.0));
        let rig =
            DeviceSpec { delay: 0.0, inertia, damping: within(5e-4, 3e-3), friction: within(1e-3, 5e-3), ..WHEEL };
        let (rest, count) = (within(0.3, 1.0), TAU / within(2e3, 2e4));
        let mut device = VirtualDevice::new(&rig);
        let mut sample = |_| {
            let seen = (device.puck().0 / count).round() * count;
            let torque = -stiffness * (seen - rest);
            device.command(torque);
            device.travel();
            (seen, torque)
        };
        let (seen, torques) = (0..2000).map(&mut sample).unzip();
        let found = identify(&Record::new(times(&rig, 2000), seen, torques).unwrap(), &Known::default()).unwrap();
        let found = found.inertia.unwrap();
        // Delay and damping look alike here; the period depends on neither.
        assert!((found.value / inertia - 1.0).abs() < 0.01, "seed {seed}: {found:?} is {inertia}");
    }
}
