//! A handle on a flexible shaft: random devices are found again, and a rigid fit reports the shaft.

use fastrand::Rng;
use hapt_identify::{Error, Interval, Known, Record, WithHandle, identify, identify_handle};
use hapt_plant::VirtualDevice;
use hapt_plant::spec::{DeviceSpec, Handle};

/// Steps of random size and length, after a rest.
fn torques(rng: &mut Rng, samples: usize) -> Vec<f64> {
    let mut all = vec![0.0; 60];
    while all.len() < samples {
        let torque = 0.12 * (rng.f64() - 0.5);
        all.extend(std::iter::repeat_n(torque, rng.usize(10..120)));
    }
    all.truncate(samples);
    all
}

pub fn record(spec: &DeviceSpec, rng: &mut Rng, samples: usize) -> Record {
    let times: Vec<u64> = (0..samples as u64).map(|k| k * FINE).collect();
    record_at(spec, rng, &times)
}

/// Parts of a period.
const FINE: u64 = 20;

/// Intervals of 0.4 to 1.6 periods.
fn uneven(rng: &mut Rng, samples: usize) -> Vec<u64> {
    let mut now = 0;
    let next = |_| {
        now += rng.u64(2 * FINE / 5..=8 * FINE / 5);
        now
    };
    (0..samples).map(next).collect()
}

/// A record with samples at these times, in parts of a period.
fn record_at(spec: &DeviceSpec, rng: &mut Rng, times: &[u64]) -> Record {
    let torques = torques(rng, times.len());
    let count = std::f64::consts::TAU / 40_000.0;
    let part = spec.period / FINE as f64;
    let mut device = VirtualDevice::new(&DeviceSpec { period: part, ..*spec });
    let mut positions = Vec::new();
    for (i, torque) in torques.iter().enumerate() {
        let noise = 0.7 * count * (rng.f64() + rng.f64() + rng.f64() - 1.5) * 2.0;
        positions.push(((device.puck().0 + noise) / count).round() * count);
        for _ in times[i]..times.get(i + 1).copied().unwrap_or(times[i]) {
            device.command(*torque);
            device.travel();
        }
    }
    Record::new(times.iter().map(|k| *k as f64 * part).collect(), positions, torques).unwrap()
}

pub fn device(rng: &mut Rng, friction: bool) -> DeviceSpec {
    let (inertia, handle) = (3e-4 + 7e-4 * rng.f64(), 2e-4 + 8e-4 * rng.f64());
    let omega = std::f64::consts::TAU * (20.0 + 40.0 * rng.f64());
    let mass = inertia * handle / (inertia + handle);
    let shaft =
        Handle { inertia: handle, stiffness: mass * omega * omega, damping: mass * omega * (0.01 + 0.05 * rng.f64()) };
    DeviceSpec {
        delay: 3e-3 * rng.f64(),
        damping: 2e-3 + 4e-3 * rng.f64(),
        friction: if friction { 3e-3 * rng.f64() } else { 0.0 },
        handle: Some(shaft),
        ..DeviceSpec::new(1e-3, inertia)
    }
}

/// Each number with its truth; where the lag is not determined, the delay is both together.
fn pairs(found: &WithHandle, truth: &DeviceSpec) -> [(&'static str, Interval, f64); 9] {
    let shaft = truth.handle.unwrap();
    let late = truth.delay + truth.lag;
    let delay = if found.lag.low > 0.0 { truth.delay } else { late };
    [
        ("inertia", found.inertia, truth.inertia),
        ("damping", found.damping, truth.damping),
        ("friction", found.friction, truth.friction),
        ("delay", found.delay, delay),
        ("lag", found.lag, truth.lag),
        ("delay and lag", found.late, late),
        ("handle inertia", found.handle_inertia, shaft.inertia),
        ("stiffness", found.stiffness, shaft.stiffness),
        ("shaft damping", found.shaft_damping, shaft.damping),
    ]
}

#[test]
fn random_devices_are_found_again_within_their_intervals() {
    let (mut numbers, mut inside) = (0, 0);
    // Those with even numbers have friction, half of all have uneven samples, and three of four a lag.
    let seeds = [2, 5, 6, 13, 10, 3, 24, 9];
    let some = hapt_testing::seeds(seeds.len() as u64).end as usize;
    for (place, seed) in seeds.into_iter().enumerate().take(some) {
        let mut rng = Rng::with_seed(seed);
        let truth = device(&mut rng, seed % 2 == 0);
        let lag = if place % 4 == 3 { 0.0 } else { 1e-4 * 50f64.powf(rng.f64()) };
        let truth = DeviceSpec { lag, ..truth };
        let times = if place % 4 < 2 { uneven(&mut rng, 1500) } else { (0..1500).map(|k| k * FINE).collect() };
        let found = identify_handle(&record_at(&truth, &mut rng, &times)).unwrap();
        for (name, x, truth) in pairs(&found, &truth) {
            numbers += 1;
            inside += u32::from(x.covers(truth));
            // For a number that is not determined, the upper end counts.
            let half = (0.5 * (x.high - x.low)).max(x.high - x.value);
            assert!((x.value - truth).abs() <= 2.5 * half, "seed {seed}, {name}: {x:?}, {truth}");
        }
        // A lag of more than a sample is determined.
        assert!(truth.lag < 1.5e-3 || found.lag.low > 0.0, "seed {seed}: {found:?}");
        // Narrow enough to be useful.
        assert!(
            found.stiffness.high < 1.1 * found.stiffness.low
                && found.handle_inertia.high < 1.1 * found.handle_inertia.low
        );
    }
    // The numbers of one device are right or wrong together.
    assert!(some < seeds.len() || inside >= numbers * 5 / 6, "{inside} of {numbers}");
}

/// A handle that rings below the noise is no torque of the position.
#[test]
fn a_handle_is_not_taken_for_a_torque_of_the_position() {
    // A cogging explains the first two to within counts and noise.
    let seeds = [10, 244, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14];
    let some = hapt_testing::seeds(seeds.len() as u64).end as usize;
    for seed in seeds.into_iter().take(some) {
        let mut rng = Rng::with_seed(seed);
        let truth = device(&mut rng, seed % 2 == 0);
        let record = record(&truth, &mut rng, 1500);
        // A large noise hides most of the ringing.
        let noise = 2e-4 * 20f64.powf(rng.f64());
        let noisy = |z: &f64| z + noise * (rng.f64() + rng.f64() + rng.f64() - 1.5) * 2.0;
        let positions = record.positions().iter().map(noisy).collect();
        let record = Record::new(record.times().to_vec(), positions, record.torques().to_vec()).unwrap();
        if let Ok(found) = identify(&record, &Known::default()) {
            assert!(found.terms.is_empty(), "seed {seed}: {:?} of {truth:?}", found.terms);
        }
    }
}

#[test]
fn a_rigid_fit_of_a_shaft_is_not_called_explained_and_names_its_resonance() {
    let mut rng = Rng::with_seed(3);
    let truth = device(&mut rng, false);
    let shaft = truth.handle.unwrap();
    let hz = (shaft.stiffness * (1.0 / truth.inertia + 1.0 / shaft.inertia)).sqrt() / std::f64::consts::TAU;
    let error = identify(&record(&truth, &mut rng, 2000), &Known::default()).unwrap_err();
    let Error::Residual(large) = &error else { panic!("{error}") };
    assert!((large.resonance_hz.unwrap() / hz - 1.0).abs() < 0.05, "{error} {hz}");
    assert!(error.to_string().contains("Hz stands out of them, as of a handle on a flexible shaft"), "{error}");
}
