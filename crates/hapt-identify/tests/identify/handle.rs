//! A handle on a flexible shaft: random devices are found again, and a rigid fit names the shaft.

use fastrand::Rng;
use hapt_identify::{Error, Interval, Known, Record, identify, identify_handle};
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
    let torques = torques(rng, samples);
    let count = std::f64::consts::TAU / 40_000.0;
    let mut device = VirtualDevice::new(spec);
    let mut positions = Vec::new();
    for torque in &torques {
        let noise = 0.7 * count * (rng.f64() + rng.f64() + rng.f64() - 1.5) * 2.0;
        positions.push(((device.puck().0 + noise) / count).round() * count);
        device.command(*torque);
        device.travel();
    }
    let times = (0..samples).map(|k| k as f64 * spec.period).collect();
    Record::new(times, positions, torques).unwrap()
}

pub fn device(rng: &mut Rng, friction: bool) -> DeviceSpec {
    let (inertia, handle) = (3e-4 + 7e-4 * rng.f64(), 2e-4 + 8e-4 * rng.f64());
    let omega = std::f64::consts::TAU * (20.0 + 40.0 * rng.f64());
    let mass = inertia * handle / (inertia + handle);
    let shaft =
        Handle { inertia: handle, stiffness: mass * omega * omega, damping: mass * omega * (0.01 + 0.05 * rng.f64()) };
    DeviceSpec {
        period: 1e-3,
        delay: 3e-3 * rng.f64(),
        lag: 0.0,
        inertia,
        damping: 2e-3 + 4e-3 * rng.f64(),
        friction: if friction { 3e-3 * rng.f64() } else { 0.0 },
        handle: Some(shaft),
    }
}

#[test]
fn random_devices_are_found_again_within_their_intervals() {
    let (mut numbers, mut inside) = (0, 0);
    // Those with even numbers have friction.
    let seeds = [2, 3, 42, 5, 6, 13, 10, 24];
    let some = hapt_testing::seeds(seeds.len() as u64).end as usize;
    for seed in seeds.into_iter().take(some) {
        let mut rng = Rng::with_seed(seed);
        let truth = device(&mut rng, seed % 2 == 0);
        let shaft = truth.handle.unwrap();
        let found = identify_handle(&record(&truth, &mut rng, 1500)).unwrap();
        let pairs = [
            (found.inertia, truth.inertia),
            (found.damping, truth.damping),
            (found.friction, truth.friction),
            (found.delay, truth.delay),
            (found.handle_inertia, shaft.inertia),
            (found.stiffness, shaft.stiffness),
            (found.shaft_damping, shaft.damping),
        ];
        for (i, (Interval { value, low, high }, truth)) in pairs.into_iter().enumerate() {
            numbers += 1;
            inside += u32::from((low..=high).contains(&truth));
            let half = 0.5 * (high - low);
            assert!(
                (value - truth).abs() <= 2.5 * half.max(high - value),
                "seed {seed}, number {i}: {value} in {low}..{high}, {truth}"
            );
        }
        // Narrow enough to be worth something.
        assert!(
            found.stiffness.high < 1.1 * found.stiffness.low
                && found.handle_inertia.high < 1.1 * found.handle_inertia.low
        );
    }
    // The numbers of one device are right or wrong together.
    assert!(some < seeds.len() || inside >= numbers * 5 / 6, "{inside} of {numbers}");
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

#[test]
fn uneven_samples_are_refused() {
    let mut rng = Rng::with_seed(1);
    let even = record(&device(&mut rng, false), &mut rng, 1000);
    let times = even.times().iter().enumerate().map(|(i, t)| t + if i % 7 == 3 { 2e-4 } else { 0.0 }).collect();
    let uneven = Record::new(times, even.positions().to_vec(), even.torques().to_vec()).unwrap();
    assert!(matches!(identify_handle(&uneven), Err(Error::Uneven { sample: 3 })));
}
