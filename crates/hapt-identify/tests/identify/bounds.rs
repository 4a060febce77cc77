//! Devices with so little damping, friction or delay, and encoders with so few counts, that the least squares may lie below 0.

use std::f64::consts::TAU;

use fastrand::Rng;
use hapt_identify::{Identified, Interval, Known, Record, identify};
use hapt_plant::VirtualDevice;
use hapt_plant::spec::DeviceSpec;

use crate::rig::{WHEEL, counted, motion, steps, times};

/// Inertia, damping, friction, delay.
const NAMES: [&str; 4] = ["inertia", "damping", "friction", "delay"];

/// A device that hardly damps, and its counts a revolution.
fn light(rng: &mut Rng) -> (DeviceSpec, f64) {
    let mut within = |low: f64, high: f64| low * (high / low).powf(rng.f64());
    let (inertia, counts) = (within(1e-4, 1e-2), within(200.0, 1000.0).round());
    let damping = inertia / within(3.0, 900.0);
    let rig = DeviceSpec { damping, ..DeviceSpec::new(2e-3, inertia) };
    (rig, counts)
}

/// How many intervals cover the truth, of how many; and the same of those whose value is 0.
#[derive(Debug, Default)]
struct Coverage {
    all: [(u32, u32); 4],
    at_0: [(u32, u32); 4],
}

impl Coverage {
    fn add(&mut self, found: &Identified, rig: &DeviceSpec) {
        let intervals = [found.inertia, found.damping, found.friction, found.delay];
        let truth = [rig.inertia, rig.damping, rig.friction, rig.delay];
        for (i, (interval, truth)) in intervals.into_iter().zip(truth).enumerate() {
            let Some(interval) = interval else { continue };
            let is_covered = u32::from(interval.covers(truth));
            self.all[i] = (self.all[i].0 + is_covered, self.all[i].1 + 1);
            if interval.value == 0.0 {
                assert!(interval.high > 0.0, "an empty interval of {}: {interval:?}", NAMES[i]);
                self.at_0[i] = (self.at_0[i].0 + is_covered, self.at_0[i].1 + 1);
            }
        }
    }

    /// At least this part is covered, of all and of those at 0, and enough are at 0.
    #[track_caller]
    fn holds(&self, part: f64, least_at_0: u32) {
        for (i, (covered, of)) in self.all.into_iter().chain(self.at_0).enumerate() {
            // A few intervals hardly show the coverage.
            let holds = of < 15 || f64::from(covered) >= part * f64::from(of);
            assert!(holds, "{}: {covered} of {of}: {self:?}", NAMES[i % 4]);
        }
        let at_0: u32 = self.at_0.iter().map(|of| of.1).sum();
        assert!(at_0 >= least_at_0, "few values are 0: {self:?}");
    }
}

#[test]
fn intervals_at_0_cover_the_truth_of_devices_that_hardly_move() {
    let mut coverage = Coverage::default();
    let seeds = hapt_testing::seeds(80);
    let records = seeds.end as u32;
    for seed in seeds {
        let mut rng = Rng::with_seed(seed);
        let (mut rig, counts) = light(&mut rng);
        // Steps that move the puck by some counts to some tens of counts.
        let size = rig.inertia * TAU / counts * 800.0 * 10f64.powf(rng.f64());
        rig.friction = 0.01 * size * rng.f64();
        rig.delay = 2.0 * rig.period * rng.f64();
        let samples = 500;
        let torques = steps(&mut rng, samples, size);
        let noise = 0.5 + rng.f64();
        let seen = counted(&motion(&rig, &torques), counts, noise, &mut rng);
        // A record that determines nothing of a puck is rejected.
        let Ok(record) = Record::new(times(&rig, samples), seen, torques) else { continue };
        if let Ok(found) = identify(&record, &Known::default()) {
            coverage.add(&found, &rig);
        }
    }
    coverage.holds(0.93, records * 3 / 8);
}

#[test]
fn intervals_at_0_cover_the_truth_of_wheels_that_ring_on_a_virtual_spring() {
    let mut coverage = Coverage::default();
    let seeds = hapt_testing::seeds(40);
    let records = seeds.end as u32;
    for seed in seeds {
        let mut rng = Rng::with_seed(seed);
        let (mut rig, counts) = light(&mut rng);
        let count = TAU / counts;
        let stiffness = rig.inertia * (TAU * (1.0 + 7.0 * rng.f64())).powi(2);
        let rest = (20.0 + 200.0 * rng.f64()) * count;
        // The oscillation stops where the friction balances the spring.
        rig.friction = 0.02 * stiffness * rest * rng.f64();
        let mut device = VirtualDevice::new(&rig);
        let mut sample = |_| {
            let seen = (device.puck().0 / count).round() * count;
            let torque = -stiffness * (seen - rest);
            device.command(torque);
            device.travel();
            (seen, torque)
        };
        let samples = 750;
        let (seen, torques) = (0..samples).map(&mut sample).unzip();
        let record = Record::new(times(&rig, samples), seen, torques).unwrap();
        if let Ok(found) = identify(&record, &Known::default()) {
            coverage.add(&found, &rig);
        }
    }
    // The only error of the positions is that of counts.
    coverage.holds(0.9, records * 3 / 4);
}

/// The wheel, and a drive that adds this much torque per velocity at each sample.
fn driven_on(gain: f64) -> Identified {
    let mut rng = Rng::with_seed(1);
    let torques = steps(&mut rng, 3000, 0.08);
    let mut device = VirtualDevice::new(&WHEEL);
    let step = |torque: &f64| {
        let (z, v) = device.puck();
        device.command(torque + gain * v);
        device.travel();
        z
    };
    let positions: Vec<f64> = torques.iter().map(step).collect();
    let seen = counted(&positions, 1000.0, 0.7, &mut rng);
    identify(&Record::new(times(&WHEEL, 3000), seen, torques).unwrap(), &Known::default()).unwrap()
}

#[test]
fn a_damping_that_is_surely_below_0_is_refused_with_a_reason() {
    let says = |found: &Identified| found.warnings().iter().any(|line| line.contains("damping below 0"));
    let found = driven_on(0.5 * WHEEL.damping);
    assert!(found.damping.is_some_and(|x: Interval| x.low > 0.0) && !says(&found), "{found:?}");
    let found = driven_on(1.5 * WHEEL.damping);
    assert!(found.damping.is_none() && says(&found), "{found:?}");
}
