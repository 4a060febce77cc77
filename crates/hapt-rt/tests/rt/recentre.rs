//! A knob that friction holds next to its detent, in the running loop: the motor's torque falls to 0.

use hapt_core::{Phase, SafetyProfile};
use hapt_rt::{Cycle, Plan, SimulatedDevice};

use crate::common::{armed, sample, world};

const FRICTION: f64 = 1e-3;

fn knob(recentre: &str, phase: &str) -> String {
    format!(
        "[loop]\nperiod = \"0.25 ms\"\nestimator = \"difference\"\n{recentre}[device]\ninertia = \"30 g cm^2\"\n\
         damping = \"4e-5 N m s/rad\"\nfriction = {FRICTION}\nlimit = \"40 N mm\"\nencoder = 16384\n\
         [[couplings]]\nkind = \"detent\"\nbetween = [\"puck\", \"ground\"]\ntorque = \"5 N mm\"\npitch = \"8.2258 deg\"\nphase = \"{phase}\"\n"
    )
}

/// The torque at rest after arming, that after two seconds, and how far the origin went.
fn run(recentre: &str, phase: &str) -> [f64; 3] {
    let world = world(&knob(recentre, phase));
    let (device, _hands) = SimulatedDevice::new(&world);
    let mut cycle = Cycle::new(Box::new(Plan::new(&world, SafetyProfile::Simulated).unwrap()), Box::new(device));
    armed(&mut cycle);
    let first = (0..400).map(|_| sample(&mut cycle, false, None)).last().unwrap();
    let mut last = first;
    for _ in 0..8000 {
        last = sample(&mut cycle, false, None);
        assert_eq!((last.phase, last.position), (Phase::Running, first.position), "{:?}", last.reason);
    }
    [first.output, last.output, last.zero - first.zero]
}

#[test]
fn the_motor_lets_go_of_a_knob_that_friction_holds_beside_its_detent() {
    let count = std::f64::consts::TAU / 16384.0;
    let least = 3.0 * count * std::f64::consts::TAU * 5e-3 / 8.2258_f64.to_radians();
    for (phase, sign) in [("0.25 deg", 1.0), ("-0.25 deg", -1.0)] {
        let [first, last, _] = run("", phase);
        assert_eq!(first, last, "its origin stays");
        assert!(sign * first > 2.0 * least && sign * first < FRICTION, "{first}");
        let [first, last, slip] = run("recentre = \"0.3 s\"\n", phase);
        assert!(sign * first > 2.0 * least && sign * last > 0.0 && sign * last <= least, "{first} {last} {least}");
        // The detent goes to the knob, by whole counts.
        assert!(sign * slip < 0.0 && (slip / count - (slip / count).round()).abs() < 1e-9, "{slip}");
    }
}
