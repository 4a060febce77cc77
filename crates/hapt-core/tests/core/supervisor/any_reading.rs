//! Random readings and requests.

use hapt_core::Body;
use hapt_testing::prelude::*;

use super::*;

proptest! {
    /// A sample that continues the last one takes the fast path, and an announced one the slow path; an announcement that is not accepted
    /// sends the sample there too. Its output and the whole state are the same.
    #[test]
    fn an_announcement_that_is_not_believed_changes_nothing(
        samples in proptest::collection::vec((any::<u64>(), 0u8..8, -1.0..1.0f64, 0u32..20, 0u8..200), 600),
        (energy, heat, slew) in (1e-4..1e-2f64, 0.1..0.8f64, 0.003..0.03f64),
        (delay, brake, trips) in (0.0..3e-3f64, 0.0..1e-2f64, any::<(bool, bool, bool)>()),
    ) {
        let bodies = [Body { inertia: 1e-3, position: 0.1, velocity: 0.0 }];
        let couplings = [SPRING[0], Coupling { second: End::Body(0), ..SPRING[0] }];
        let soft = [Coupling { law: Law::Spring { stiffness: 0.2 * K, rest: 0.0 }, ..SPRING[0] }];
        let spec = Spec { method: Method::ForwardEuler, output: Output::Start, bodies: &bodies, couplings: &couplings, ..WORLD };
        let limits = Limits {
            energy, slew, delay, brake, stuck: 5e-3, jump: 0.009, overspeed: 9.0,
            motor: Heat { rms: heat, time: 0.1 }, announcements: false,
            link_faults: trips.0, world_trips: trips.1, port_trips: trips.2, ..LIMITS
        };
        let next = Guard::<f32>::new(&limits, &Spec { couplings: &soft, ..spec });
        let mut guards = [(); 2].map(|()| Guard::<f32>::new(&limits, &spec));
        let (mut position, mut speed) = (0.0, 0.0);
        for (bits, how, by, missed, choice) in samples {
            speed = 0.9 * speed + 2e-3 * by;
            // Now and then it rests.
            position += if how == 7 { 0.0 } else { speed };
            let mut now = Reading { missed: u32::from(missed == 2), velocity: (speed / T) as f32, ..reading(position) };
            let wild = f32::from_bits(bits as u32);
            match how {
                0 if bits % 13 == 0 => now.position = wild,
                1 if bits % 13 == 0 => now.late = wild,
                2 if bits % 13 == 0 => now.silent = wild,
                3 if bits % 13 == 0 => now.velocity = wild,
                _ => {}
            }
            let request = match choice {
                0 => Some(Request::Stop),
                1 => Some(Request::Disarm),
                2..=40 => Some(Request::Arm),
                41..=60 => Some(Request::Clear),
                _ => None,
            };
            let [short, long] = [false, true].map(|announced| {
                let guard = &mut guards[usize::from(announced)];
                if choice == 100 {
                    (guard.world, guard.supervisor, guard.state) = (next.world, next.supervisor, next.state);
                    guard.watch.swap(guard.world.period(), guard.world.period());
                }
                (guard.step(&Reading { announced, ..now }, request), guard.watch, guard.state)
            });
            // As text a NaN is equal to itself.
            prop_assert!(short == long || format!("{short:?}") == format!("{long:?}"), "{short:?}\n{long:?}");
        }
    }

    /// For any reading and request the torque is finite, and within the motor's limit for any limits of the supervisor. Without arming
    /// since the last fault, the only torque is that of the brake.
    #[test]
    fn no_reading_and_no_request_makes_a_torque_that_may_not_be(
        samples in proptest::collection::vec((any::<u64>(), 0u8..8, -1.0..1.0f64, 0u32..3, 0u8..40), 400),
        (pulse, torque, brake) in (0.0..5.0f64, 0.1..5.0f64, prop_oneof![Just(0.0), 0.0..1.0f64]),
        motor in 0.05..0.8f64,
    ) {
        let limits = Limits { pulse, torque, brake, ..LIMITS };
        let mut guard = Guard::<f64>::new(&limits, &Spec { limit: Some(motor), ..WORLD });
        let mut position = 0.0;
        let mut may = false;
        for (bits, how, by, missed, choice) in samples {
            position += 0.01 * by;
            let mut now = Reading { missed: u32::from(missed == 2), ..reading(position) };
            match how {
                0 if bits % 7 == 0 => now.position = f64::from_bits(bits),
                1 if bits % 7 == 0 => now.late = f64::from_bits(bits),
                2 if bits % 7 == 0 => now.silent = f64::from_bits(bits),
                3 if bits % 7 == 0 => now.velocity = f64::from_bits(bits),
                _ => {}
            }
            let request = match choice {
                0 => Some(Request::Stop),
                1 => Some(Request::Disarm),
                2..=8 => Some(Request::Arm),
                9..=12 => Some(Request::Clear),
                _ => None,
            };
            let before = guard.watch.phase;
            let guarded = guard.step(&now, request);
            may = match guarded.phase {
                Phase::FadingIn if before == Phase::Disarmed => request == Some(Request::Arm),
                Phase::Disarmed | Phase::Faulted => false,
                _ => may,
            };
            prop_assert!(guarded.output.abs() <= motor * (1.0 + 1e-12), "{} of {motor}, {:?}", guarded.output, guarded);
            let brakes = brake > 0.0 && guarded.phase == Phase::Faulted;
            prop_assert!(may || brakes || guarded.output == 0.0);
            prop_assert!(before != Phase::Faulted || matches!(guarded.phase, Phase::Faulted | Phase::Disarmed));
            prop_assert!(before != Phase::Faulted || guarded.phase == Phase::Faulted || request == Some(Request::Clear));
            prop_assert_eq!(guarded.phase == Phase::Faulted, guarded.phase == Phase::Faulted && guarded.reason.is_some());
        }
    }
}
