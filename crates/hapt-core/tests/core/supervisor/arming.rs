//! Arming a real device: its zero, and the pulse that tests the sign of the motor.

use hapt_core::Reason;

use super::*;

for_both! {
    the_position_where_a_real_device_is_armed_is_zero
    a_pulse_tells_the_motors_sign
}

fn the_position_where_a_real_device_is_armed_is_zero<F: Real>() {
    let limits = Limits { zero_where_armed: true, ..LIMITS };
    let mut guard = Guard::<F>::running(&limits, &WORLD, 3.0);
    assert_eq!(guard.watch.output, F::ZERO);
    assert!((guard.at(3.02).sample.puck.position.to_f64() - 0.02).abs() < 1e-6);
    assert_eq!(guard.watch.offset.to_f64(), 3.0);
}

/// Arms on a free puck that feels `motor` times the torque and is seen `encoder` times as far; returns how it ends.
fn armed<F: Real>(motor: f64, encoder: f64) -> (Phase, Option<Reason>, f64) {
    let limits = Limits { pulse: 0.05, friction: 0.0, zero_where_armed: true, ..LIMITS };
    let count = std::f64::consts::TAU / 4000.0;
    let mut guard = Guard::<F>::new(&limits, &Spec { count: Some(count), ..WORLD });
    let (mut position, mut velocity, mut farthest) = (0.0_f64, 0.0, 0.0_f64);
    for k in 0..2000 {
        let seen = encoder * (position / count).round() * count;
        let guarded = guard.step(&reading(seen), (k == 30).then_some(Request::Arm));
        if matches!(guarded.phase, Phase::Running | Phase::Faulted) {
            return (guarded.phase, guarded.reason, farthest);
        }
        velocity += T * motor * guarded.output.to_f64() / limits.inertia;
        position += T * velocity;
        farthest = farthest.max(position.abs());
    }
    unreachable!("it never ended");
}

fn a_pulse_tells_the_motors_sign<F: Real>() {
    let (phase, reason, farthest) = armed::<F>(1.0, 1.0);
    assert_eq!((phase, reason), (Phase::Running, None));
    assert!(farthest < 0.1, "{farthest} rad");
    for (motor, encoder) in [(-1.0, 1.0), (1.0, -1.0)] {
        assert_eq!(armed::<F>(motor, encoder).1, Some(Reason::Reversed));
    }
    // No motor, no encoder, or a hand in the way: no answer.
    for (motor, encoder) in [(0.0, 1.0), (1.0, 0.0), (0.05, 1.0)] {
        assert_eq!(armed::<F>(motor, encoder).1, Some(Reason::Stuck));
    }
}
