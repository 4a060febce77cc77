//! Parameters by dotted path, with the file's checks; derivatives.

use hapt_fmi::{Kind, Version};
use hapt_model::World;

use crate::fmu::{Fmu, Messages, WHEEL, world};

const VERSIONS: [Version; 2] = [Version::Two, Version::Three];

#[test]
fn a_parameter_that_is_set_gives_the_world_of_that_override() {
    for version in VERSIONS {
        let plain = Fmu::new(Kind::Whole, &world(WHEEL, &[]));
        let other = Fmu::new(
            Kind::Whole,
            &world(
                WHEEL,
                &["couplings.0.stiffness=0.5", "loop.period=0.0005", "loop.method=trapezoidal", "device.encoder=500"],
            ),
        );
        let (set, made) = (plain.instance(version), other.instance(version));
        assert!(set.set("couplings.0.stiffness", 0.5) && set.set("loop.period", 5e-4), "{}", set.message());
        assert!(set.set_text("loop.method", "trapezoidal"), "{}", set.message());
        let encoder = plain.reference("device.encoder");
        let status = unsafe {
            match version {
                Version::Two => hapt_fmi::fmi2::fmi2SetInteger(set.c, &encoder, 1, &500),
                Version::Three => hapt_fmi::fmi3::fmi3SetInt64(set.c, &encoder, 1, &500, 1),
            }
        };
        assert_eq!(status, 0, "{}", set.message());
        assert_eq!((set.text("loop.method"), set.get("loop.period")), ("trapezoidal".into(), 5e-4));
        set.start(0.0);
        made.start(0.0);
        for k in 0..200 {
            for instance in [&set, &made] {
                assert!(instance.set("hand_torque_Nm", 0.05) && instance.step(f64::from(k) * 5e-4, 5e-4));
            }
            assert_eq!(set.outputs(), made.outputs(), "row {k}");
        }
    }
}

/// The world continues from its bodies' motion: the torque changes by the effect of the new number, without a jump.
#[test]
fn a_parameter_that_is_tuned_between_two_steps_is_a_bumpless_transfer() {
    for kind in Kind::ALL {
        let fmu = Fmu::new(kind, &world(WHEEL, &["device.friction=0"]));
        let (tuned, plain) = (fmu.instance(Version::Two), fmu.instance(Version::Three));
        for instance in [&tuned, &plain] {
            instance.start(0.0);
            assert!(instance.set_all(&[1], &[0.05]));
        }
        let stiffness = plain.get("couplings.0.stiffness");
        for k in 0..300 {
            if k == 100 {
                assert!(tuned.set("couplings.0.stiffness", stiffness * (1.0 + 1e-6)), "{}", tuned.message());
            }
            assert!(tuned.step(f64::from(k) * 1e-3, 1e-3) && plain.step(f64::from(k) * 1e-3, 1e-3));
            let differ = (tuned.get("torque_Nm") - plain.get("torque_Nm")).abs();
            assert!(differ < 2e-5 && (k >= 99 || differ == 0.0), "{kind:?} {k}: {differ}");
        }
        assert_ne!(tuned.get("wheel_rad"), plain.get("wheel_rad"));
    }
}

/// The device acts on the loop by the puck's motion only: its numbers, set at rest after the start, are those of the file, and the bodies
/// that step at every third sample go on in their step.
#[test]
fn a_number_of_the_device_changes_no_bit_of_the_loop() {
    let sets = ["loop.bodies_every=3", "bodies.wheel.velocity=0.5", "loop.estimator=foaw"];
    let fmu = Fmu::new(Kind::Whole, &world(WHEEL, &sets));
    for (key, value) in [("device.damping", 2e-3), ("device.inertia", 5e-4), ("device.friction", 1e-3)] {
        let (file, tuned) = (fmu.instance(Version::Two), fmu.instance(Version::Three));
        assert!(file.set(key, value), "{}", file.message());
        file.start(0.0);
        tuned.start(0.0);
        assert!(tuned.set(key, value), "{}", tuned.message());
        for k in 0..200 {
            for instance in [&file, &tuned] {
                assert!(instance.set("hand_torque_Nm", 0.05) && instance.step(f64::from(k) * 1e-3, 1e-3));
            }
            assert_eq!(file.outputs(), tuned.outputs(), "{key} row {k}");
        }
    }
}

/// Friction by direction and by position, friction that falls with the speed, gravity, cogging, the motor's lag and end stops: set before the
/// start they equal those of the file, and what the loop compensates follows them.
#[test]
fn the_numbers_of_the_devices_own_torques_are_parameters() {
    let keys = [
        ("device.lag", 2e-3),
        ("device.gravity.torque", 0.02),
        ("device.gravity.phase", 0.4),
        ("device.cogging.torque", 3e-3),
        ("device.cogging.pitch", 0.3),
        ("device.cogging.phase", 0.05),
        ("device.friction", 4e-3),
        ("device.friction_backward", 2e-3),
        ("device.friction_by_position.share", 0.3),
        ("device.friction_by_position.pitch", 0.5),
        ("device.friction_by_position.phase", 0.1),
        ("device.stribeck.torque", 3e-3),
        ("device.stribeck.velocity", 0.5),
        ("device.stops.high", 0.05),
        ("device.stops.stiffness", 20.0),
        ("device.stops.damping", 1e-2),
        ("compensation.0.share", 0.4),
        ("compensation.1.share", 0.6),
        ("compensation.1.velocity", 0.3),
    ];
    // A waveform is no parameter.
    let waveform = ["friction_by_position", "cogging"].map(|of| format!("device.{of}.cosine=[1.0, 0.5]"));
    let fmu = |factor: f64| {
        let sets = keys.map(|(key, value)| format!("{key}={}", factor * value));
        let sets: Vec<&str> = waveform.iter().chain(&sets).map(String::as_str).collect();
        let compensated = r#"
            [[compensation]]
            of = "gravity"
            [[compensation]]
            of = "friction"
            velocity = 0.1
        "#;
        Fmu::new(Kind::Whole, &world(&format!("{WHEEL}{compensated}"), &sets))
    };
    for version in VERSIONS {
        let (made, other) = (fmu(1.0), fmu(1.5));
        let (set, made) = (other.instance(version), made.instance(version));
        for (key, value) in keys {
            assert!(set.set(key, value), "{}", set.message());
        }
        set.start(0.0);
        made.start(0.0);
        let mut differs = false;
        let plain = other.instance(version);
        plain.start(0.0);
        for k in 0..400 {
            let push = if k < 300 { 0.05 } else { -0.05 };
            for instance in [&set, &made, &plain] {
                assert!(instance.set("hand_torque_Nm", push) && instance.step(f64::from(k) * 1e-3, 1e-3));
            }
            assert_eq!(set.outputs(), made.outputs(), "row {k}");
            differs |= set.outputs() != plain.outputs();
        }
        assert!(differs);
    }
}

#[test]
fn a_parameter_set_to_its_own_value_changes_no_bit() {
    let fmu = Fmu::new(Kind::Whole, &world(WHEEL, &[]));
    let (set, plain) = (fmu.instance(Version::Two), fmu.instance(Version::Two));
    set.start(0.0);
    plain.start(0.0);
    for k in 0..100 {
        for name in ["couplings.0.stiffness", "bodies.wheel.inertia", "device.inertia"] {
            assert!(set.set(name, set.get(name)));
        }
        for instance in [&set, &plain] {
            assert!(instance.set("hand_torque_Nm", 0.05) && instance.step(f64::from(k) * 1e-3, 1e-3));
        }
        assert_eq!(set.outputs(), plain.outputs());
    }
}

#[test]
fn the_files_checks_hold_and_their_words_reach_the_logger() {
    let fmu = Fmu::new(Kind::Loop, &world(WHEEL, &[]));
    for version in VERSIONS {
        let instance = fmu.instance(version);
        let refused = |done: bool, words: &str| {
            assert!(!done && instance.message().contains(words), "{words:?} in {:?}", instance.message());
        };
        refused(instance.set("couplings.0.stiffness", -1.0), "couplings.0.stiffness: ");
        refused(instance.set("loop.period", 0.0), "a time (s) above 0");
        refused(instance.set("bodies.wheel.inertia", f64::NAN), "bodies.wheel.inertia");
        refused(instance.set("puck_rad", f64::NAN), "puck_rad is set to NaN, and must be a finite number");
        refused(instance.set("puck_rad", f64::INFINITY), "finite");
        refused(instance.set_text("loop.method", "eulre"), "loop.method: ");
        refused(instance.set("torque_Nm", 1.0), "torque_Nm cannot be set: it is neither an input nor a parameter");
        refused(instance.set_all(&[999], &[1.0]), "there is no value reference 999");
        refused(
            instance.set_text("loop.period", "1 ms"),
            "loop.period is a variable of type Real, and was set as String",
        );
        // All of them, or none on an error.
        let puck = fmu.reference("puck_rad");
        refused(instance.set_all(&[puck, fmu.reference("loop.period")], &[0.5, -1.0]), "loop.period");
        assert_eq!(instance.get("puck_rad"), 0.0);
        instance.start(0.0);
        refused(instance.set("loop.period", 2e-3), "loop.period cannot be set: it is fixed after the initialisation");
        refused(instance.set("couplings.0.stiffness", -1.0), "couplings.0.stiffness: ");
        assert!(instance.set("couplings.0.stiffness", 1.0));
    }
}

/// tustin requires a torque from the start of the step: one value is invalid without the other, and importers set them one by one.
#[test]
fn values_that_only_go_together_may_come_one_after_another_before_the_first_step() {
    let text = WHEEL.split("[[couplings]]\nkind = \"wall\"").next().unwrap();
    let fmu = Fmu::new(Kind::Loop, &world(text, &[]));
    let instance = fmu.instance(Version::Two);
    assert!(instance.set_text("loop.method", "tustin"), "{}", instance.message());
    assert!(instance.set_up(0.0, None) && instance.enter());
    assert!(!instance.exit(), "output = end");
    assert!(instance.message().contains("tustin"), "{}", instance.message());
    assert!(instance.set_text("loop.output", "start"));
    assert!(instance.exit(), "{}", instance.message());
    assert_eq!(instance.text("loop.method"), "tustin");
}

/// Superposition: the outputs of a linear loop differ by the derivative times the difference of the inputs.
#[test]
fn derivatives_are_those_of_the_linear_part() {
    let text = WHEEL.replace("encoder = 4000\nlevels = 2048\n", "").replace("limit = \"822.25 N mm\"\n", "");
    let linear = text.split("[[couplings]]\nkind = \"wall\"").next().unwrap();
    for sets in [
        &[][..],
        &["loop.estimator=difference"],
        &["loop.output=start"],
        &["loop.method=foh", "loop.output=start"],
        &["loop.advance=3"],
    ] {
        let coupling = |of: &str| format!("\n[[couplings]]\nbetween = [\"puck\", \"ground\"]\n{of}\n");
        let damper = coupling("kind = \"damper\"\ndamping = 0.003");
        let integral = match sets {
            ["loop.advance=3"] => String::new(),
            _ => coupling("kind = \"integral\"\nstiffness = 2.0\ntime = 0.05\nrest = 0.1"),
        };
        let fmu = Fmu::new(Kind::Loop, &world(&format!("{linear}{damper}{integral}"), sets));
        let outputs = fmu.outputs();
        let (one, other) = (fmu.instance(Version::Two), fmu.instance(Version::Three));
        one.start(0.0);
        other.start(0.0);
        for k in 0..20 {
            let at = f64::from(k) * 1e-3;
            for instance in [&one, &other] {
                assert!(instance.set_all(&[1, 2], &[at.sin(), at.cos()]) && instance.step(at, 1e-3));
            }
        }
        let (u, seed) = ([0.3, 0.1], [0.02, -0.4]);
        assert!(one.set_all(&[1, 2], &u) && other.set_all(&[1, 2], &[u[0] + seed[0], u[1] + seed[1]]));
        let derivative = one.derivative(&outputs, &[1, 2], &seed).unwrap();
        for ((a, b), d) in one.outputs().iter().zip(other.outputs()).zip(derivative) {
            assert!((b - a - d).abs() < 1e-9 * (1.0 + d.abs()), "{sets:?}: {} {d}", b - a);
        }
        assert!(
            one.derivative(&[1], &[1, 2], &seed).is_none() && one.derivative(&outputs, &outputs[..2], &seed).is_none()
        );
    }
}

#[test]
fn the_adjoint_is_the_transpose() {
    let fmu = Fmu::new(Kind::Loop, &world(WHEEL, &["loop.estimator=difference"]));
    let instance = fmu.instance(Version::Three);
    instance.start(0.0);
    let outputs = fmu.outputs();
    for (place, output) in outputs.iter().enumerate() {
        let row: Vec<f64> = [[1.0, 0.0], [0.0, 1.0]]
            .iter()
            .map(|seed| instance.derivative(&outputs, &[1, 2], seed).unwrap()[place])
            .collect();
        let (seed, mut adjoint) = ([1.0], [f64::NAN; 2]);
        let status = unsafe {
            hapt_fmi::fmi3::fmi3GetAdjointDerivative(
                instance.c,
                output,
                1,
                [1, 2].as_ptr(),
                2,
                seed.as_ptr(),
                1,
                adjoint.as_mut_ptr(),
                2,
            )
        };
        assert_eq!((status, &adjoint[..]), (0, &row[..]));
    }
}

#[test]
fn every_builtin_world_has_its_numbers_for_parameters_and_its_columns_for_outputs() {
    for name in hapt_model::builtin::names() {
        let world = World::read(&hapt_model::builtin::source(&name).unwrap(), &[]).unwrap();
        for kind in Kind::ALL {
            let fmu = Fmu::new(kind, &world);
            let instance = fmu.instance(Version::Three);
            for (reference, variable) in fmu.model.variables.iter().enumerate() {
                if let hapt_fmi::Value::Real(start) = variable.start {
                    let value = instance.get_all(&[reference as u32]).unwrap()[0];
                    assert!(variable.is_output() || value.to_bits() == start.to_bits(), "{name} {}", variable.name);
                }
            }
            assert_eq!(instance.get("loop.period"), world.sampling.period);
            assert_eq!(instance.text("loop.method"), world.sampling.method.name());
            let columns: Vec<String> = hapt_sim::columns(&world).into_iter().map(|column| column.name).collect();
            let own: Vec<&str> =
                fmu.model.variables.iter().filter(|v| v.is_output()).map(|v| v.name.as_str()).collect();
            assert!(own.iter().all(|name| columns.iter().any(|column| column == name)));
            assert!(kind == Kind::Loop || own == columns[1..]);
        }
    }
}

#[test]
fn another_token_or_world_is_refused() {
    let fmu = Fmu::new(Kind::Loop, &world(WHEEL, &[]));
    let other = Fmu::new(Kind::Loop, &world(WHEEL, &["loop.period=2 ms"]));
    let whole = Fmu::new(Kind::Whole, &world(WHEEL, &[]));
    let mut tokens = [&fmu, &other, &whole].map(|fmu| fmu.tokens.clone()).concat();
    tokens.sort_unstable();
    tokens.dedup();
    assert_eq!(tokens.len(), 6);
    for version in VERSIONS {
        let messages = Messages::default();
        assert!(fmu.raw(version, other.token(version), &messages).is_null());
        let message = messages.borrow().concat();
        assert!(message.contains("are not of one export"), "{message}");
    }
}
