//! The wheel of the notes, in C as the notes compute it, and as it is exported, for the comparison in docs/notes.md.

use std::fs;
use std::process::Command;

use hapt_core::{Body, Coupling, Damping, End, Estimator, Law, Method, Output};
use hapt_export_c::Float;

use crate::bits::{drawn, written};
use crate::compiler::compile;
use crate::worlds::World;

const STIFFNESS: f64 = 0.8 / std::f64::consts::FRAC_PI_4;
const INERTIA: f64 = STIFFNESS / (std::f64::consts::TAU * std::f64::consts::TAU);
const SAMPLES: usize = 3000;

/// The puck turns at 90 °/s for half a second, and then stands.
const MAIN: &str = "#include <stdio.h>\n#include \"w0.c\"\n#include \"lecture.c\"\nint main(void) {\n    static w0_state state;\n    int i;\n    \
    w0_state_init(&state);\n    for (i = 0; i < 3000; i++) {\n        double z = 1.5707963267948966e-3 * (i < 500 ? i : 500);\n        \
    w0_sample sample = w0_state_step(&state, z);\n        double torque = lecture_step(z);\n        \
    printf(\"%.17g %.17g %.17g\\n\", sample.torque, torque, sample.command);\n    }\n    return 0;\n}\n";

#[test]
fn the_exported_wheel_makes_the_lectures_torque_on_the_other_side() {
    let damping = Law::Damper { damping: Damping::Compensating };
    let couplings: Vec<Coupling> = vec![
        Law::Spring { stiffness: STIFFNESS, rest: 0.0 }.between(End::Puck, End::Body(0)),
        damping.between(End::Puck, End::Body(0)),
    ];
    let world = World {
        period: 1e-3,
        method: Method::ForwardEuler,
        output: Output::Start,
        advance: 0,
        bodies_every: 1,
        estimator: Estimator::Difference,
        filter: None,
        count: None,
        limit: Some(0.82225),
        levels: None,
        bodies: vec![Body { inertia: INERTIA, position: 0.0, velocity: 0.0 }],
        couplings,
        ..drawn(1, hapt_testing::cases_from(1, 1)).remove(0)
    };
    let folder = tempfile::tempdir().unwrap();
    let (source, header) = written(&world, 0, Float::F64);
    for (name, text) in
        [("w0.c", source.as_str()), ("w0.h", &header), ("lecture.c", include_str!("lecture.c")), ("main.c", MAIN)]
    {
        fs::write(folder.path().join(name), text).unwrap();
    }
    compile("gcc", &["-std=c99", "-O1", "-o", "program", "main.c"], folder.path());
    let output = Command::new(folder.path().join("program")).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let (mut rows, mut largest, mut clipped) = (0, 0.0_f64, 0);
    for line in text.lines() {
        let numbers: Vec<f64> = line.split(' ').map(|number| number.parse().unwrap()).collect();
        let [exported, lecture, command] = numbers[..] else { panic!("{line}") };
        assert!((exported + lecture).abs() < 1e-11, "sample {rows}: {exported}, the lecture's {lecture}");
        assert!(command.abs() <= 0.82225 && (exported.abs() > 0.82225 || command == exported));
        clipped += usize::from(command != exported);
        largest = largest.max(exported.abs());
        rows += 1;
    }
    assert!(rows == SAMPLES && largest > 0.5, "{rows} rows, up to {largest} N m, {clipped} at the limit");
}
