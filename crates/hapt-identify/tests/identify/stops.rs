//! End stops, found where a record runs into them.

use fastrand::Rng;
use hapt_identify::{Comparison, Identified, Interval, Known, Record, Verdict, against, identify};
use hapt_plant::VirtualDevice;
use hapt_plant::spec::{DeviceSpec, Stops, Stribeck};

use crate::against::claims;
use crate::rig::{WHEEL, counted, motion, steps, times};

/// A random device between stops, and a record that runs into both.
pub fn stopped(rng: &mut Rng) -> (DeviceSpec, Record) {
    stopped_for(rng, 3000)
}

/// The same with this number of samples.
fn stopped_for(rng: &mut Rng, samples: usize) -> (DeviceSpec, Record) {
    let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
    let inertia = between(3e-4, 2e-3);
    let (rate, friction, delay) = (between(1.0, 8.0), between(2e-3, 8e-3), between(0.1e-3, 4e-3));
    let stiffness = inertia * between(80.0, 400.0).powi(2);
    let damping = 2.0 * between(0.05, 0.8) * (stiffness * inertia).sqrt();
    let stops = Stops { low: Some(-between(0.2, 1.0)), high: Some(between(0.2, 1.0)), stiffness, damping };
    let rig = DeviceSpec { delay, inertia, damping: rate * inertia, friction, stops: Some(stops), ..WHEEL };
    let mut torques = steps(rng, samples, 100.0 * inertia);
    torques[0] = 0.0;
    let seen = counted(&motion(&rig, &torques), 20_000.0, 0.7, rng);
    (rig, Record::new(times(&rig, samples), seen, torques).unwrap())
}

#[test]
fn stops_that_a_record_runs_into_are_found() {
    let (mut all, mut found, mut determined, mut covered) = (0, 0, 0, 0);
    for seed in hapt_testing::seeds(40) {
        let (rig, record) = stopped(&mut Rng::with_seed(seed));
        all += 1;
        let Ok(answer) = identify(&record, &Known::default()) else { continue };
        if answer.stops.is_none() {
            continue;
        }
        found += 1;
        for (interval, truth) in numbers(&answer, &rig) {
            determined += 1;
            covered += u32::from(interval.covers(truth));
            assert!((interval.value / truth - 1.0).abs() < 0.2 || interval.covers(truth), "{rig:?}: {answer:?}");
        }
    }
    // A start that is too far off ends in a local minimum, and a fit that does not explain the record gives no result.
    assert!(10 * found >= 8 * all, "{found} of {all}");
    assert!(10 * covered >= 9 * determined, "{covered} of {determined}");
}

/// A device with one stop at a random side, and a record that runs into it one to three times.
fn touched(rng: &mut Rng) -> (DeviceSpec, Record) {
    loop {
        let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
        let inertia = between(3e-4, 2e-3);
        let (rate, friction, delay) = (between(1.0, 8.0), between(2e-3, 8e-3), between(0.1e-3, 4e-3));
        let stiffness = inertia * between(80.0, 400.0).powi(2);
        let damping = 2.0 * between(0.05, 0.8) * (stiffness * inertia).sqrt();
        let lag = if rng.bool() { 0.0 } else { 4e-3 * rng.f64() };
        let free = DeviceSpec { delay, lag, inertia, damping: rate * inertia, friction, ..WHEEL };
        let mut torques = steps(rng, 3000, 100.0 * inertia);
        torques[0] = 0.0;
        // The stop is somewhere in the range of a motion without stops.
        let path = motion(&free, &torques);
        let (low, high) = path.iter().fold((0.0f64, 0.0f64), |a, z| (a.0.min(*z), a.1.max(*z)));
        let (part, is_high) = (rng.f64(), rng.bool());
        let none = Stops { low: None, high: None, stiffness, damping };
        let stops =
            if is_high { Stops { high: Some(part * high), ..none } } else { Stops { low: Some(part * low), ..none } };
        let rig = DeviceSpec { stops: Some(stops), ..free };
        let path = motion(&rig, &torques);
        if (1..=3).contains(&touches(&path, &stops)) {
            let seen = counted(&path, 20_000.0, 0.7, rng);
            return (rig, Record::new(times(&rig, 3000), seen, torques).unwrap());
        }
    }
}

/// A stop is determined where the puck turns in it once, and no other one; and the record agrees with the file of its own device.
#[test]
fn one_stop_that_a_record_touches_once_or_twice_is_found() {
    let (mut all, mut found, mut determined, mut covered) = (0, 0, 0, 0);
    for seed in hapt_testing::seeds(40) {
        let (rig, record) = touched(&mut Rng::with_seed(900 + seed));
        let truth = rig.stops.unwrap();
        let compared = against(&record, &claims(&rig, 0.0), false).unwrap();
        assert!(compared.agrees(), "seed {seed}: {:?} {:?}", compared.wrong, compared.numbers);
        all += 1;
        let Ok(answer) = identify(&record, &Known::default()) else { continue };
        let Some(stops) = answer.stops else { continue };
        found += 1;
        assert_eq!([stops.low, stops.high].map(|x| x.is_some()), [truth.low, truth.high].map(|x| x.is_some()));
        for (interval, truth) in numbers(&answer, &rig) {
            determined += 1;
            covered += u32::from(interval.covers(truth));
        }
    }
    assert!(100 * found >= 95 * all, "{found} of {all}");
    assert!(10 * covered >= 9 * determined, "{covered} of {determined}");
}

/// Each impact multiplies the error before it, and a long record has hundreds of them: it determines more than a short one all the same,
/// and agrees with the file of its own device.
#[test]
fn a_long_record_with_many_impacts_agrees_with_its_own_file() {
    let (mut all, mut found) = (0, 0);
    for seed in hapt_testing::seeds(6) {
        let (rig, record) = stopped_for(&mut Rng::with_seed(300 + seed), 20_000);
        let compared = against(&record, &claims(&rig, 0.0), false).unwrap();
        assert!(compared.agrees(), "seed {seed}: {:?} {:?}", compared.wrong, compared.numbers);
        all += 1;
        let Some(answer) = identify(&record, &Known::default()).ok().filter(|answer| answer.stops.is_some()) else {
            continue;
        };
        found += 1;
        let inertia = answer.inertia.unwrap();
        assert!((inertia.value / rig.inertia - 1.0).abs() < 0.01, "seed {seed}: {inertia:?}");
    }
    assert!(4 * found >= 3 * all, "{found} of {all}");
}

/// A record that turns round before the stops determines none, also where torques turn it round hard.
#[test]
fn stops_that_no_record_reaches_are_not_told() {
    for seed in hapt_testing::seeds(12) {
        let mut rng = Rng::with_seed(seed);
        let torques: Vec<f64> = (0..3000).map(|k| if (k / 40) % 2 == 0 { 0.3 } else { -0.3 }).collect();
        let stops = Stops { low: Some(-100.0), high: Some(100.0), stiffness: 30.0, damping: 0.01 };
        let rig = DeviceSpec { stops: Some(stops), damping: 1e-3 * (1.0 + rng.f64()), ..WHEEL };
        let seen = counted(&motion(&rig, &torques), 4000.0, 0.7, &mut rng);
        let answer = identify(&Record::new(times(&rig, 3000), seen, torques).unwrap(), &Known::default()).unwrap();
        assert_eq!(answer.stops, None, "seed {seed}");
    }
}

/// A random device with a lag between one or two stops, coupled to a wheel that oscillates, and a record of it.
fn swung(rng: &mut Rng) -> (DeviceSpec, Record) {
    let samples = 4000;
    let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
    let inertia = between(2e-4, 4e-3);
    let (rate, friction) = (between(0.3, 4.0), between(1e-3, 1e-2));
    let (stiffness, ratio) = (between(5.0, 300.0), between(0.03, 1.0));
    let [low, high] = [-between(0.2, 0.8), between(0.2, 0.8)];
    let (wheel, spring, ground) = (between(0.005, 0.05), between(0.5, 3.0), between(0.5, 5.0));
    let mut velocity = between(10.0, 40.0);
    let sides = [rng.u8(0..3) != 0, rng.u8(0..3) != 0];
    let stops = Stops {
        low: Some(low).filter(|_| sides[0] || !sides[1]),
        high: Some(high).filter(|_| sides[1]),
        stiffness,
        damping: 2.0 * ratio * (stiffness * inertia).sqrt(),
    };
    let [lag, delay] = [rng.u8(0..3), rng.u8(0..3)].map(|x| 1e-3 * f64::from(x));
    let damping = rate * inertia;
    let rig = DeviceSpec { delay, lag, inertia, damping, friction, stops: Some(stops), ..WHEEL };
    let (mut device, mut place) = (VirtualDevice::new(&rig), 0.0);
    let (mut seen, mut torques) = (Vec::new(), Vec::new());
    for _ in 0..samples {
        let position = counted(&[device.puck().0], 20_000.0, 0.7, rng)[0];
        let torque = spring * (place - position);
        velocity -= rig.period * (torque + ground * place) / wheel;
        place += rig.period * velocity;
        seen.push(position);
        torques.push(torque);
        device.command(torque);
        device.travel();
    }
    (rig, Record::new(times(&rig, samples), seen, torques).unwrap())
}

/// The number of times that a motion enters a stop.
fn touches(positions: &[f64], stops: &Stops) -> usize {
    let is_in = |z: f64| stops.low.is_some_and(|low| z < low) || stops.high.is_some_and(|high| z > high);
    positions.windows(2).filter(|pair| !is_in(pair[0]) && is_in(pair[1])).count()
}

/// The numbers of a result, lag and delay together, with their truths.
pub fn numbers(found: &Identified, rig: &DeviceSpec) -> Vec<(Interval, f64)> {
    let (stops, truth) = (found.stops.unwrap(), rig.stops.unwrap());
    let pairs = [
        (found.inertia, Some(rig.inertia)),
        (found.damping, Some(rig.damping)),
        (found.friction, Some(rig.friction)),
        (found.late, Some(rig.delay + rig.lag)),
        (stops.low, truth.low),
        (stops.high, truth.high),
        (Some(stops.stiffness), Some(truth.stiffness)),
        (Some(stops.damping), Some(truth.damping)),
    ];
    pairs.into_iter().filter_map(|(interval, truth)| interval.zip(truth)).collect()
}

/// A motor's lag with one stop or two: the intervals from a record in a closed loop cover the device, and the comparison with its file
/// agrees.
#[test]
fn a_device_with_a_lag_and_one_stop_or_two_agrees_with_its_own_file() {
    let (mut all, mut agree, mut found, mut determined, mut covered) = (0, 0, 0, 0, 0);
    for seed in hapt_testing::seeds(24) {
        let (rig, record) = swung(&mut Rng::with_seed(500 + seed));
        let truth = rig.stops.unwrap();
        if touches(record.positions(), &truth) < 3 {
            continue;
        }
        all += 1;
        agree += u32::from(against(&record, &claims(&rig, 0.0), false).unwrap().agrees());
        let Ok(answer) = identify(&record, &Known::default()) else { continue };
        if answer.stops.is_none() {
            continue;
        }
        found += 1;
        for (interval, truth) in numbers(&answer, &rig) {
            determined += 1;
            covered += u32::from(interval.covers(truth));
        }
    }
    assert!(all > 0, "no record runs into its stops");
    assert!(10 * agree >= 9 * all, "{agree} of {all} agree");
    assert!(10 * found >= 8 * all, "{found} of {all} are found");
    assert!(10 * covered >= 9 * determined, "{covered} of {determined} hold");
}

/// The comparison starts from the file, then from the device that is identified from the record only: a file that is far off is
/// contradicted in its wrong numbers, and only in these.
#[test]
fn a_file_that_is_far_off_is_contradicted_in_its_numbers() {
    let (mut all, mut named) = (0, 0);
    for seed in hapt_testing::seeds(10) {
        let (rig, record) = stopped(&mut Rng::with_seed(700 + seed));
        let stops = rig.stops.map(|stops| Stops { stiffness: 4.0 * stops.stiffness, ..stops });
        let file = DeviceSpec { inertia: 2.0 * rig.inertia, delay: rig.delay + 5e-3, stops, ..rig };
        let found = against(&record, &claims(&file, 0.0), false).unwrap();
        assert!(!found.agrees(), "seed {seed}");
        all += 1;
        let wrong: Vec<&str> =
            found.numbers.iter().filter(|x| x.verdict == Verdict::Contradicts).map(|x| x.name).collect();
        let is_off = |name: &&str| ["inertia", "delay", "delay and lag", "stop stiffness"].contains(name);
        let is_named = found.wrong.is_none() && ["inertia", "stop stiffness"].iter().all(|name| wrong.contains(name));
        assert!(found.wrong.is_some() || wrong.iter().all(is_off), "seed {seed}: {wrong:?}");
        named += u32::from(is_named);
    }
    assert!(10 * named >= 8 * all, "{named} of {all}");
}

#[test]
fn a_file_is_compared_in_its_stops() {
    let (mut all, mut missed) = (0, 0);
    for seed in hapt_testing::seeds(16) {
        let mut rng = Rng::with_seed(100 + seed);
        let (rig, record) = stopped(&mut rng);
        let stops = rig.stops.unwrap();
        let verdicts = |stops: Option<Stops>| {
            let found = against(&record, &claims(&DeviceSpec { stops, ..rig }, 0.0), false).unwrap();
            let of = |verdict: Verdict| -> Vec<&str> {
                found.numbers.iter().filter(|number| number.verdict == verdict).map(|number| number.name).collect()
            };
            (of(Verdict::Agrees), of(Verdict::Contradicts), found.wrong.is_some())
        };
        all += 1;
        let (agrees, wrong, unexplained) = verdicts(Some(stops));
        if unexplained {
            missed += 1;
            continue;
        }
        assert!(wrong.is_empty(), "seed {seed}: {wrong:?}");
        for name in ["low stop", "high stop", "stop stiffness"] {
            assert!(agrees.contains(&name), "seed {seed}: {agrees:?}");
        }
        let (off, name) = match seed % 4 {
            0 => (Stops { high: stops.high.map(|x| 1.1 * x), ..stops }, "high stop"),
            1 => (Stops { low: stops.low.map(|x| 1.1 * x), ..stops }, "low stop"),
            2 => (Stops { stiffness: 1.5 * stops.stiffness, ..stops }, "stop stiffness"),
            _ => (Stops { low: None, ..stops }, "low stop"),
        };
        let (_, wrong, unexplained) = verdicts(Some(off));
        assert!(unexplained || wrong == [name], "seed {seed}, {name}: {wrong:?}");
        missed += i32::from(unexplained);
    }
    assert!(8 * missed <= all, "{missed} of {all}");
}

/// Free motion beyond a stop of the file contradicts it; motion that does not reach it does not.
#[test]
fn a_stop_that_the_record_passes_is_contradicted() {
    let mut rng = Rng::with_seed(4);
    let torques = steps(&mut rng, 3000, 0.1);
    let seen = counted(&motion(&WHEEL, &torques), 4000.0, 0.7, &mut rng);
    let most = seen.iter().fold(f64::NEG_INFINITY, |most, z| most.max(*z));
    let record = Record::new(times(&WHEEL, 3000), seen, torques).unwrap();
    for (high, verdict) in [(0.5 * most, Verdict::Contradicts), (1.5 * most, Verdict::NotDetermined)] {
        let stops = Stops { low: None, high: Some(high), stiffness: 50.0, damping: 0.05 };
        let found = against(&record, &claims(&DeviceSpec { stops: Some(stops), ..WHEEL }, 0.0), false).unwrap();
        let stop = found.numbers.iter().find(|number| number.name == "high stop").unwrap();
        assert_eq!(stop.verdict, verdict, "{high}: {:?}", found.numbers);
        assert!(stop.reason.is_some());
    }
}

#[test]
fn a_file_is_compared_in_its_stribeck_friction() {
    let (mut all, mut determined, mut named) = (0, 0, 0);
    for seed in hapt_testing::seeds(12) {
        let mut rng = Rng::with_seed(seed);
        let fall = Stribeck { torque: 6e-3 * (1.0 + rng.f64()), velocity: 1.0 + 2.0 * rng.f64() };
        let rig = DeviceSpec { stribeck: Some(fall), damping: 2e-3, friction: 8e-3, ..WHEEL };
        let torques = steps(&mut rng, 4000, 0.04);
        let seen = counted(&motion(&rig, &torques), 40_000.0, 0.7, &mut rng);
        let record = Record::new(times(&rig, 4000), seen, torques).unwrap();
        let found = |stribeck: Option<Stribeck>| {
            against(&record, &claims(&DeviceSpec { stribeck, ..rig }, 0.0), false).unwrap()
        };
        all += 1;
        let right = found(Some(fall));
        assert!(right.agrees(), "seed {seed}: {:?} {:?}", right.wrong, right.numbers);
        let of =
            |found: &Comparison, name: &str| found.numbers.iter().find(|number| number.name == name).unwrap().verdict;
        if of(&right, "stribeck torque") != Verdict::Agrees {
            continue;
        }
        determined += 1;
        let off = found(Some(Stribeck { torque: 2.0 * fall.torque, ..fall }));
        let is_named = off.wrong.is_none() && of(&off, "stribeck torque") == Verdict::Contradicts;
        assert!(!off.agrees(), "seed {seed}: {:?}", off.numbers);
        named += i32::from(is_named);
        assert!(!found(None).agrees(), "seed {seed}");
    }
    assert!(10 * determined >= 8 * all && 10 * named >= 8 * determined, "{named} of {determined} of {all}");
}
