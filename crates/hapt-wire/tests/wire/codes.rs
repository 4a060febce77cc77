//! Every code on the wire with its name. Existing boards and logs use these codes: none of them changes, and new ones follow. A
//! variant without a row here does not compile.

use hapt_core::{Body, Coupling, Damping, End, Estimator, Law, Method, Output, Phase, Reason, Side, Spec, WhenLate};
use hapt_plant::spec::{Drive, Shape};
use hapt_wire::{Command, DeviceMessage, Hello, Parameter, Refusal, Telemetry};
use serde::Serialize;

/// The variants of a type, each with its code. A unit variant is written with empty braces, a tuple's field with its number.
macro_rules! codes {
    ($Type:ident { $($code:literal => $Variant:ident { $($fields:tt)* },)+ }) => {{
        #[allow(unused_variables)]
        fn has_a_row(value: &$Type) -> u8 {
            match value {
                $($Type::$Variant { $($fields)* } => $code,)+
            }
        }
        let rows = vec![$(($code as u8, $Type::$Variant { $($fields)* })),+];
        for (code, value) in &rows {
            assert_eq!(has_a_row(value), *code);
        }
        rows
    }};
}

/// The first byte of a value on the wire.
fn are_on_the_wire<T: Serialize + std::fmt::Debug>(rows: Vec<(u8, T)>) {
    for (code, value) in rows {
        let mut room = [0; 256];
        assert_eq!(postcard::to_slice(&value, &mut room).unwrap()[0], code, "{value:?}");
    }
}

fn are_all<T: PartialEq + Copy + std::fmt::Debug>(rows: &[(u8, T)], all: &[T]) {
    assert_eq!(rows.iter().map(|row| row.1).collect::<Vec<_>>(), all);
}

/// A world with one coupling between puck and ground: the law's code follows the two ends, a byte each.
fn law_codes(coupling: Coupling) -> Vec<u8> {
    let with = |couplings: &[Coupling]| {
        let spec = Spec { couplings, ..EMPTY };
        hapt_wire::write(&spec, &mut [0; 256]).unwrap().to_vec()
    };
    let before = with(&[]).len() - 2;
    with(&[coupling])[before + 2..].to_vec()
}

const EMPTY: Spec<'static> = Spec { estimator: Estimator::Difference, limit: Some(0.8), ..Spec::new(1e-3) };

#[test]
fn the_code_of_each_law_is_what_it_always_was() {
    let [stiffness, rest, at, torque, pitch, phase, width, time, velocity, inertia, cutoff] = [1.0; 11];
    let waveform = hapt_core::Waveform::default();
    let [coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous] = [1.0; 6];
    let (damping, side) = (Damping::Fixed(1.0), Side::Above);
    let laws = codes!(Law {
        0 => Spring { stiffness, rest },
        1 => Damper { damping },
        2 => Wall { side, at, stiffness, damping: viscous },
        3 => Detent { torque, pitch, phase },
        4 => Coulomb { torque },
        5 => Lugre { coulomb, stribeck, stribeck_velocity, bristle_stiffness, bristle_damping, viscous },
        6 => Constant { torque },
        8 => DeadBand { stiffness, rest, width },
        9 => Magnet { torque, width, at },
        10 => Texture { torque, pitch, phase, waveform },
        11 => Integral { stiffness, time, rest },
        12 => Assist { torque, velocity },
        13 => Acceleration { inertia, cutoff },
    });
    // One with a limit has code 7, and a second code by its law.
    let mut limited = vec![0, 1, 2, 3, 4, 5].into_iter();
    for (code, law) in laws {
        let coupling = law.between(End::Puck, End::Ground);
        assert_eq!(law_codes(coupling)[0], code, "{law:?}");
        if law.takes_limit() {
            let codes = law_codes(Coupling { limit: Some(1.0), ..coupling });
            assert_eq!(codes[..2], [7, limited.next().unwrap()], "{law:?}");
        }
    }
    assert_eq!(limited.next(), None);
}

/// The bytes of a world of the earlier format, in which a limit is a law.
const LAWS: &str = "\
     01fca9f1d24d62503f0402000100019a9999999999e93f00010ab37bf2b0506b9a3f0000000000000000000000000000000000020000000000000000\
     f83f000000000000d0bf00020001010002000201000000000000e0bf00000000000034407b14ae47e17a843f000200039a9999999999b93f9a999999\
     9999c93f9a9999999999a93f000200047b14ae47e17a943f000200057b14ae47e17a943fb81e85eb51b89e3f9a9999999999b93f0000000000004940\
     9a9999999999a93ffca9f1d24d62503f000200069a9999999999d9bf00020007000000000000000440000000000000c03f000000000000e83f000200\
     070100b81e85eb51b89e3f000000000000e03f000200070200333333333333d33f0000000000003e407b14ae47e17a943f000000000000d03f12e1";

#[test]
fn the_bytes_of_a_world_with_every_law_are_what_they_always_were() {
    let damping = Damping::Fixed(0.03);
    let laws = [
        (Law::Spring { stiffness: 1.5, rest: -0.25 }, None),
        (Law::Damper { damping: Damping::Compensating }, None),
        (Law::Wall { side: Side::Below, at: -0.5, stiffness: 20.0, damping: 0.01 }, None),
        (Law::Detent { torque: 0.1, pitch: 0.2, phase: 0.05 }, None),
        (Law::Coulomb { torque: 0.02 }, None),
        (
            Law::Lugre {
                coulomb: 0.02,
                stribeck: 0.03,
                stribeck_velocity: 0.1,
                bristle_stiffness: 50.0,
                bristle_damping: 0.05,
                viscous: 1e-3,
            },
            None,
        ),
        (Law::Constant { torque: -0.4 }, None),
        (Law::Spring { stiffness: 2.5, rest: 0.125 }, Some(0.75)),
        (Law::Damper { damping }, Some(0.5)),
        (Law::Wall { side: Side::Above, at: 0.3, stiffness: 30.0, damping: 0.02 }, Some(0.25)),
    ];
    let couplings = laws.map(|(law, limit)| Coupling { first: End::Puck, second: End::Body(0), law, limit });
    let bodies = [Body { inertia: 0.0258, position: 0.0, velocity: 0.0 }];
    let mut room = [0; 512];
    let bytes = hapt_wire::write(&Spec { bodies: &bodies, couplings: &couplings, ..EMPTY }, &mut room).unwrap();
    assert_eq!(bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>(), LAWS);
    assert_eq!(hapt_wire::Stored::<1, 10>::read(bytes).unwrap().spec().couplings, couplings);
}

#[test]
fn the_code_of_each_part_of_a_coupling_is_what_it_always_was() {
    let (index, fixed) = (7, 1.0);
    are_on_the_wire(codes!(Damping { 0 => Fixed { 0: fixed }, 1 => Compensating {}, }));
    are_on_the_wire(codes!(Side { 0 => Above {}, 1 => Below {}, }));
    are_on_the_wire(codes!(End { 0 => Puck {}, 1 => Ground {}, 2 => Body { 0: index }, }));
}

#[test]
fn the_code_of_each_method_output_and_estimator_is_what_it_always_was() {
    let methods = codes!(Method {
        0 => ForwardEuler {},
        1 => BackwardEuler {},
        2 => SemiImplicitEuler {},
        3 => Trapezoidal {},
        4 => Zoh {},
        5 => Rk4 {},
        6 => Tustin {},
        7 => Foh {},
    });
    are_all(&methods, &Method::ALL);
    are_on_the_wire(methods);
    let outputs = codes!(Output { 0 => Start {}, 1 => Middle {}, 2 => End {}, });
    are_all(&outputs, &Output::ALL);
    are_on_the_wire(outputs);
    let (cutoff, window, every, acceleration) = (1.0, 16, 2, 1.0);
    are_on_the_wire(codes!(Estimator {
        0 => Exact {},
        1 => Difference {},
        2 => LowPass { cutoff },
        3 => Foaw { window },
        4 => FoawBest { window },
        5 => DifferenceOver { every },
        6 => Kalman { cutoff },
        7 => Levant { acceleration },
    }));
}

#[test]
fn the_code_of_each_hand_and_shape_is_what_it_always_was() {
    let [inertia, damping, stiffness, to, at, over, amplitude, frequency, phase] = [1.0; 9];
    let step = || Shape::Step { to, at };
    let (position, torque, moves, switching) = (step(), step(), step(), None);
    are_on_the_wire(codes!(Drive {
        0 => Position { 0: position },
        1 => Torque { 0: torque },
        2 => Grip { inertia, damping, stiffness, moves, switching },
    }));
    let (file, points) = (String::new(), Vec::new());
    are_on_the_wire(codes!(Shape {
        0 => Step { to, at },
        1 => Ramp { to, at, over },
        2 => Sine { amplitude, frequency, phase },
        3 => Path { file, points },
    }));
}

#[test]
fn the_code_of_each_phase_and_reason_is_what_it_always_was() {
    let phases =
        codes!(Phase { 0 => Disarmed {}, 1 => FadingIn {}, 2 => Running {}, 3 => FadingOut {}, 4 => Faulted {}, });
    are_all(&phases, &Phase::ALL);
    assert!(phases.iter().all(|(code, phase)| *phase as u8 == *code));
    let reasons = codes!(Reason {
        1 => Stop {},
        2 => NotFinite {},
        3 => Jump {},
        4 => Velocity {},
        5 => Stuck {},
        6 => Torque {},
        7 => Slew {},
        8 => Heat {},
        9 => DriverHeat {},
        10 => Overspeed {},
        11 => Late {},
        12 => Link {},
        13 => PortEnergy {},
        14 => WorldEnergy {},
        15 => Reversed {},
        16 => Driver {},
        17 => Uneven {},
    });
    are_all(&reasons, &Reason::ALL);
    assert!(reasons.iter().all(|(code, reason)| reason.code() == *code && Reason::from_code(*code) == Some(*reason)));
}

#[test]
fn the_code_of_each_thing_to_do_where_time_is_not_kept_is_what_it_always_was() {
    let all = codes!(WhenLate { 0 => Fault {}, 1 => Fade {}, 2 => Count {}, });
    are_all(&all, &WhenLate::ALL);
    are_on_the_wire(all);
}

#[test]
fn the_code_of_each_message_is_what_it_always_was() {
    let (protocol, world, length, hash, at, bytes) = (1, 2, 3, 4, 5, &[6][..]);
    let (parameter, value, sample, position, velocity, late, announced) = (7, 8, 9, 10.0, 11.0, 12.0, true);
    are_on_the_wire(codes!(Command {
        0 => Hello { protocol },
        1 => Stop {},
        2 => Heartbeat {},
        3 => Arm { world },
        4 => Disarm {},
        5 => Clear {},
        6 => Begin { length, hash },
        7 => Piece { at, bytes },
        8 => Commit {},
        9 => Get { parameter },
        10 => Set { parameter, value },
        11 => Sample { sample, position, velocity, late, announced },
    }));
    let parameters =
        codes!(Parameter { 0 => Divider {}, 1 => Refused {}, 2 => Missed {}, 3 => MostUsed {}, 4 => Outside {}, });
    are_all(&parameters, &Parameter::ALL);
    assert!(parameters.iter().all(|(code, parameter)| *parameter as u8 == *code));
    let (sequence, why, telemetry) = (13, Refusal::Late, Telemetry::default());
    let hello = Hello {
        protocol,
        firmware: "",
        board: "",
        core: 0,
        world: None,
        bodies: 0,
        couplings: 0,
        window: 0,
        externally_clocked: false,
        sequence,
        sample: 0,
        period: 0,
        phase: 0,
        reason: 0,
    };
    are_on_the_wire(codes!(DeviceMessage {
        0 => Hello { 0: hello },
        1 => Done { sequence },
        2 => Refused { sequence, why },
        3 => Value { sequence, parameter, value },
        4 => Telemetry { 0: telemetry },
    }));
    are_on_the_wire(codes!(Refusal {
        0 => Hello {},
        1 => Sequence {},
        2 => Late {},
        3 => Busy {},
        4 => Piece {},
        5 => Hash {},
        6 => Version {},
        7 => Bytes {},
        8 => Room {},
        9 => World {},
        10 => Period {},
        11 => NoLimit {},
        12 => Exact {},
        13 => Armed {},
        14 => NoWorld {},
        15 => Phase {},
        16 => NotExternallyClocked {},
        17 => Sample {},
        18 => Parameter {},
    }));
}
