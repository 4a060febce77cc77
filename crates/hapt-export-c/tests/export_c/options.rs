//! The same C under other options: sanitizers, C++, contraction, and options that would change the bits.

use std::fs;
use std::mem::discriminant;
use std::process::Command;

use hapt_core::{
    Body, CertifiedTime, Controller, Damping, End, Estimator, Heat, Law, Limits, Method, Output, Phase, Reading,
    Reason, Request,
};
use hapt_export_c::{About, Float, Prefix, library};
use hapt_testing::laws::goes_to_bodies;

use crate::bits::{BODIES, COUNTS, COUPLINGS, agree, drawn, fed, readings, some, worlds, written};
use crate::compiler::{BOARDS, SANITIZERS, compile, compilers, has_board};
use crate::worlds::World;

#[test]
fn no_sample_does_what_c_leaves_undefined() {
    for (i, worlds) in worlds(some(1)).chunks(8).enumerate() {
        agree(worlds, [Float::F32, Float::F64][i % 2], "gcc", &SANITIZERS);
    }
}

/// The energy of a linear coupling is booked after the last one that has a place in the state.
#[test]
fn linear_couplings_behind_a_friction_at_a_body_read_nothing_beyond_the_state() {
    let some = drawn(1, hapt_testing::cases_from(1, 1)).remove(0);
    for method in Method::ALL {
        let friction = Law::Lugre {
            coulomb: 0.02,
            stribeck: 0.03,
            stribeck_velocity: 0.1,
            bristle_stiffness: 20.0,
            bristle_damping: 0.01,
            viscous: 0.001,
        };
        let mut couplings = vec![friction.between(End::Puck, End::Body(0))];
        couplings.retain(|coupling| coupling.goes_with(method));
        if couplings.is_empty() {
            continue;
        }
        for torque in [0.01, -0.02, 0.03] {
            couplings.push(Law::Constant { torque }.between(End::Body(0), End::Ground));
            couplings.push(Law::Damper { damping: Damping::Fixed(torque.abs()) }.between(End::Body(0), End::Puck));
        }
        let world = World {
            method,
            output: if method.takes_new_sample_first() { Output::Start } else { Output::End },
            advance: 0,
            bodies_every: 1,
            bodies: vec![Body { inertia: 0.01, position: 0.1, velocity: 0.0 }],
            couplings,
            ..some.clone()
        };
        agree(&[world], Float::F32, "gcc", &SANITIZERS);
    }
}

/// A puck that rests again and again next to its detents, under torques that the friction holds.
#[test]
fn an_origin_that_slips_in_c_slips_by_the_cores_bits() {
    let some = drawn(1, hapt_testing::cases_from(1, 1)).remove(0);
    let never = f64::INFINITY;
    let heat = Heat { rms: never, time: 1.0 };
    let estimators =
        [Estimator::Difference, Estimator::Kalman { cutoff: 50.0 }, Estimator::Levant { acceleration: 100.0 }];
    let worlds = estimators.into_iter().flat_map(|estimator| [(estimator, None), (estimator, Some(1e-4))]);
    for (i, (estimator, count)) in worlds.enumerate() {
        let limits = Limits {
            velocity: never,
            jump: never,
            overspeed: never,
            stuck: never,
            torque: never,
            slew: never,
            motor: heat,
            driver: heat,
            time: CertifiedTime::NOT_STATED,
            port_trips: true,
            pulse: 0.0,
            friction: 0.5,
            fade: 4e-3,
            energy: 1.0,
            recentre: 5e-3,
            link: 1.0,
            delay: 0.0,
            ..some.limits
        };
        let detent = Law::Detent { torque: 0.05, pitch: 0.3, phase: 0.02 };
        let world = World {
            period: 1e-3,
            method: Method::Zoh,
            output: Output::End,
            advance: 0,
            bodies_every: 1,
            estimator,
            filter: None,
            count,
            limit: Some(1.0),
            levels: None,
            bodies: Vec::new(),
            couplings: vec![detent.between(End::Puck, End::Ground)],
            limits,
        };
        let controller = Controller::<f64, BODIES, COUPLINGS, COUNTS>::new(&world.spec(), &world.limits).unwrap();
        let (mut state, mut slips, mut before) = (controller.start(), 0, 0.0);
        for row in readings(&world, 1, false) {
            let safe = fed(&controller, &mut state, &world, &row);
            slips += i32::from(safe.phase == Phase::Running && state.supervisor.offset != before);
            before = state.supervisor.offset;
        }
        assert!(slips > 50, "the origin slips at {slips} samples only");
        agree(std::slice::from_ref(&world), [Float::F32, Float::F64][i % 2], "gcc", &SANITIZERS);
        agree(&[world], [Float::F64, Float::F32][i % 2], "gcc", &["-O2"]);
    }
}

/// gcc contracts a product and a sum to one rounding where the processor can, unless it is disabled: the file disables it.
#[test]
#[cfg(target_arch = "x86_64")]
fn a_processor_that_contracts_products_and_sums_gives_the_same_bits() {
    if is_x86_with_fma() {
        let worlds = worlds(3);
        for compiler in compilers() {
            agree(&worlds, Float::F32, compiler, &["-O2", "-std=gnu99", "-march=haswell"]);
            agree(&worlds, Float::F64, compiler, &["-O2", "-std=gnu99", "-march=haswell"]);
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn is_x86_with_fma() -> bool {
    std::arch::is_x86_feature_detected!("fma") && std::arch::is_x86_feature_detected!("avx2")
}

#[test]
fn options_that_change_the_bits_are_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let (source, header) = written(&worlds(1)[0], 0, Float::F32);
    fs::write(folder.path().join("w0.c"), source).unwrap();
    fs::write(folder.path().join("w0.h"), header).unwrap();
    let ends = |compiler: &str, option: &str| {
        let arguments = ["-std=c99", "-fsyntax-only", option, "w0.c"];
        Command::new(compiler).args(arguments).current_dir(folder.path()).output().unwrap().status.success()
    };
    for compiler in compilers() {
        assert!(ends(compiler, "-O3"));
        for option in ["-ffast-math", "-Ofast", "-ffinite-math-only"] {
            assert!(!ends(compiler, option), "{compiler} {option}");
        }
    }
}

/// `-Werror`: as C, and as C++, every world compiles without a warning.
#[test]
fn every_world_is_c_and_cpp_without_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let worlds = worlds(some(3));
    let mut names = Vec::new();
    for (i, world) in worlds.iter().enumerate() {
        let (source, header) = written(world, i, [Float::F32, Float::F64][i % 2]);
        fs::write(folder.path().join(format!("w{i}.c")), source).unwrap();
        fs::write(folder.path().join(format!("w{i}.h")), header).unwrap();
        names.push(format!("w{i}.c"));
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    for compiler in compilers() {
        compile(compiler, &[&["-std=c99", "-pedantic", "-fsyntax-only"], &names[..]].concat(), folder.path());
        compile(compiler, &[&["-x", "c++", "-std=c++11", "-fsyntax-only"], &names[..]].concat(), folder.path());
    }
    for name in names {
        let source = fs::read_to_string(folder.path().join(name)).unwrap();
        let includes: Vec<&str> = source.lines().filter(|line| line.starts_with("#include")).collect();
        assert_eq!(includes.len(), 1, "{includes:?}");
        let words = ["malloc", "printf", "math.h", "//if", "//end", "hapt_", "HAPT_", "(void)unused"];
        assert!(!words.iter().any(|word| source.contains(word)) && !source.contains(" @"), "{name}");
    }
}

/// The sketches against the names that they use of Arduino and SimpleFOC.
#[test]
fn the_sketches_of_an_arduino_library_are_cpp() {
    let (folder, has_board) = (tempfile::tempdir().unwrap(), has_board());
    for (i, world) in worlds(6).iter().enumerate() {
        let about = About { title: "a\nworld".to_owned(), is_certified: i.is_multiple_of(2), ..About::default() };
        let prefix = Prefix::new(&format!("w{i}")).unwrap();
        let (_, header) = written(world, i, Float::F32);
        fs::write(folder.path().join(format!("w{i}.h")), header).unwrap();
        fs::write(folder.path().join("Arduino.h"), ARDUINO).unwrap();
        fs::write(folder.path().join("SimpleFOC.h"), SIMPLE_FOC).unwrap();
        let [(properties, text), sketches @ ..] = library(&about, &prefix, &world.spec());
        assert_eq!(properties, "library.properties");
        let keys: Vec<&str> = text.lines().map(|line| line.split_once('=').expect("a key and a value").0).collect();
        let wanted = [
            "name",
            "version",
            "author",
            "maintainer",
            "sentence",
            "paragraph",
            "category",
            "url",
            "architectures",
            "includes",
        ];
        assert_eq!(keys, wanted);
        for (place, sketch) in sketches {
            let name = place.rsplit('/').next().unwrap();
            // An example has its folder's name.
            assert_eq!(place, format!("examples/{0}/{0}.ino", name.strip_suffix(".ino").unwrap()));
            fs::write(folder.path().join(name), sketch).unwrap();
            let arguments = ["-x", "c++", "-std=c++11", "-fsyntax-only", "-I.", "-include", "Arduino.h", name];
            compile("g++", &arguments, folder.path());
            for board in BOARDS.into_iter().filter(|_| has_board) {
                let common = ["-x", "c++", "-std=c++11", "-Os", "-mthumb", "-ffreestanding", "-fno-exceptions", "-I."];
                let file = ["-include", "Arduino.h", "-c", name, "-o", "sketch.o"];
                compile("arm-none-eabi-g++", &[&common[..], board.flags, &file].concat(), folder.path());
            }
        }
    }
}

const ARDUINO: &str = include_str!("../arduino/Arduino.h");
const SIMPLE_FOC: &str = include_str!("../arduino/SimpleFOC.h");

/// Each of them has to occur, or its comparison would be empty.
#[test]
fn the_random_worlds_have_every_method_estimator_law_and_reason() {
    let worlds = drawn(320, hapt_testing::cases_from(1, 1));
    let has = |holds: &dyn Fn(&World) -> bool| worlds.iter().any(holds);
    for method in Method::ALL {
        assert!(has(&|world| world.method == method && !world.bodies.is_empty()), "{method:?}");
    }
    let windowed = |world: &World| world.count.is_some();
    assert!(has(&|world| matches!(world.estimator, Estimator::Foaw { .. }) && windowed(world)));
    assert!(has(&|world| matches!(world.estimator, Estimator::FoawBest { .. }) && windowed(world)));
    assert!(has(&|world| matches!(world.estimator, Estimator::LowPass { .. })));
    assert!(has(&|world| matches!(world.estimator, Estimator::DifferenceOver { .. })));
    assert!(has(&|world| matches!(world.estimator, Estimator::Kalman { .. })));
    assert!(has(&|world| matches!(world.estimator, Estimator::Levant { .. })));
    assert!(has(&|world| world.filter.is_some() && world.method.takes_new_sample_first() && !world.bodies.is_empty()));
    assert!(has(&|world| world.estimator == Estimator::Exact));
    assert!(has(&|world| world.advance > 0 && !world.bodies.is_empty()) && has(&|world| world.bodies_every > 1));
    for law in Law::ALL.into_iter().filter(|law| !law.is_compensating()) {
        let is_one = |coupling: &hapt_core::Coupling| discriminant(&coupling.law) == discriminant(&law);
        let is_found = |coupling: &hapt_core::Coupling| coupling.is_at_body() && coupling.linear().is_none();
        assert!(has(&|world| world.couplings.iter().any(is_one)), "{law:?}");
        let may_be_found = goes_to_bodies(&law) && law.constant().is_none();
        let holds =
            |world: &World| world.method.finds_torques() && world.couplings.iter().any(|c| is_one(c) && is_found(c));
        assert_eq!(has(&holds), may_be_found, "{law:?}");
    }
    assert!(has(&|world| world.couplings.iter().any(|coupling| coupling.law.has_bristle() && coupling.is_at_body())));

    assert!(has(&|world| world.couplings.iter().any(|coupling| coupling.law.integrates() && coupling.limit.is_some())));
    let assists = |coupling: &hapt_core::Coupling| matches!(coupling.law, Law::Assist { .. });
    let integrates = |coupling: &hapt_core::Coupling| coupling.law.integrates();
    assert!(has(&|world| world.couplings.iter().any(assists) && world.couplings.iter().any(integrates)));
    assert!(has(&|world| world.couplings.iter().any(assists) && !world.couplings.iter().any(integrates)));

    let mut seen = [false; 18];
    for (i, world) in worlds.iter().enumerate() {
        let controller = Controller::<f64, BODIES, COUPLINGS, COUNTS>::new(&world.spec(), &world.limits).unwrap();
        let mut state = controller.start();
        for [position, velocity, late, missed, silent, request, delay, trip] in
            readings(world, i as u64 + 1, i % 3 != 0)
        {
            if !delay.is_nan() {
                state.commanded(delay);
            }
            if trip > 0.0 {
                state.trip(Reason::Driver);
            }
            let reading = Reading { position, velocity, announced: false, late, missed: missed as u32, silent };
            let request = [None, Some(Request::Arm), Some(Request::Disarm), Some(Request::Stop), Some(Request::Clear)]
                [request as usize];
            let output = controller.step(&mut state, &reading, request);
            for reason in [output.reason, output.warning].into_iter().flatten() {
                seen[usize::from(reason.code())] = true;
            }
        }
    }
    let missing: Vec<Reason> = Reason::ALL.into_iter().filter(|reason| !seen[usize::from(reason.code())]).collect();
    assert!(missing.is_empty(), "{missing:?}");
}
