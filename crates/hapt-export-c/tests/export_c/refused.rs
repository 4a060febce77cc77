//! Worlds and names that C does not take, and texts that would end a comment.

use hapt_core::{Body, End, Law, Method, Output};
use hapt_export_c::{About, Error, Float, Prefix, export};
use hapt_testing::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

use crate::worlds::{World, world};

/// A wheel on a spring, in the limits of some world.
fn wheel() -> World {
    let some = world(Method::Zoh).new_tree(&mut TestRunner::new(hapt_testing::cases_from(1, 1))).unwrap().current();
    World {
        method: Method::Zoh,
        output: Output::End,
        advance: 0,
        bodies_every: 1,
        count: None,
        limit: Some(1.0),
        levels: None,
        bodies: vec![Body { inertia: 0.0258, position: 0.0, velocity: 0.0 }],
        couplings: vec![Law::Spring { stiffness: 1.0186, rest: 0.0 }.between(End::Puck, End::Body(0))],
        ..some
    }
}

fn written(world: &World, about: &About, float: Float) -> Result<hapt_export_c::Exported, Error> {
    export(&world.spec(), &world.limits, about, &Prefix::new("wheel").unwrap(), "wheel.h", float)
}

#[test]
fn a_world_of_nine_bodies_is_refused_and_one_of_eight_is_written() {
    let mut wheel = wheel();
    wheel.bodies = vec![wheel.bodies[0]; 8];
    assert!(written(&wheel, &About::default(), Float::F32).is_ok());
    wheel.bodies.push(wheel.bodies[0]);
    let refused = written(&wheel, &About::default(), Float::F32).unwrap_err();
    assert_eq!(refused, Error::Core(hapt_core::Error::TooManyBodies { given: 9, room: 8 }));
}

#[test]
fn a_number_that_float_loses_is_refused_by_name_and_double_has_it() {
    let mut wheel = wheel();
    wheel.couplings[0] = Law::Wall { side: hapt_core::Side::Above, at: 1e-50, stiffness: 1.0, damping: 0.0 }
        .between(End::Puck, End::Ground);
    let refused = written(&wheel, &About::default(), Float::F32).unwrap_err();
    assert_eq!(refused, Error::Number { name: "at", given: 1e-50 });
    assert!(written(&wheel, &About::default(), Float::F64).is_ok());
}

#[test]
fn only_names_of_ones_own_begin_the_names_in_c() {
    for (given, name) in [("wheel", "wheel"), ("My-Knob", "my_knob"), ("a.b", "a_b"), ("x1", "x1")] {
        assert_eq!(Prefix::new(given).unwrap().as_str(), name);
    }
    for given in [
        "",
        "int",
        "FLT",
        "double",
        "_x",
        "1x",
        "a__b",
        "rad\u{e4}",
        "a/b",
        "atomic",
        "new",
        "x_",
        "m",
        &"a".repeat(25),
    ] {
        assert!(matches!(Prefix::new(given), Err(Error::Prefix { .. })), "{given}");
    }
}

#[test]
fn an_uncertified_world_says_so_in_its_first_line_and_is_armed_by_another_name() {
    let wheel = wheel();
    for is_certified in [true, false] {
        let about = About { title: "A wheel".to_owned(), is_certified, ..About::default() };
        let written = written(&wheel, &about, Float::F32).unwrap();
        for text in [&written.source, &written.header] {
            assert_eq!(text.lines().next().unwrap().contains("NOT CERTIFIED"), !is_certified);
            assert_eq!(text.contains("wheel_arm_uncertified("), !is_certified);
            assert_eq!(text.contains("wheel_arm("), is_certified);
        }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(256))]

    #[test]
    fn no_title_and_no_name_ends_a_comment_or_a_line(title in "\\PC*|[*/?\\\\\n\r\u{202e}@a-z]*", name in "[*/?\\\\\n@n_]*") {
        let about = About { title, bodies: vec![name.clone()], couplings: vec![name], ..About::default() };
        let plain = written(&wheel(), &About { bodies: vec!["x".to_owned()], couplings: vec!["x".to_owned()], ..About::default() }, Float::F32).unwrap();
        let written = written(&wheel(), &about, Float::F32).unwrap();
        let counts = |text: &str| [text.matches("/*").count(), text.matches("*/").count(), text.lines().count()];
        prop_assert_eq!(counts(&written.source), counts(&plain.source));
        prop_assert_eq!(counts(&written.header), counts(&plain.header));
        let bad = |c: char| c == '\u{202e}' || c == '\\' || (c.is_control() && c != '\n');
        prop_assert!(!written.source.split("#include").next().unwrap().contains(bad));
    }
}
