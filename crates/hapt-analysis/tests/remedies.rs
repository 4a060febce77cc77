//! Remedies are what they say: each certifies the world by itself, and a hundredth beyond it does not.

use hapt_analysis::{is_certified, remedies};
use hapt_model::{Coupling, Damping, End, Law, Source, World};
use proptest::prelude::*;

fn wheel(sets: &[String]) -> World {
    let file = r#"
        [loop]
        period = "1 ms"
        [device]
        inertia = "6.4e-4 kg m^2"
        damping = "1.2e-3 N m s/rad"
        [bodies.wheel]
        inertia = 0.0258
        [[couplings]]
        kind = "spring"
        between = ["puck", "wheel"]
        stiffness = 1
        [[couplings]]
        kind = "damper"
        between = ["wheel", "ground"]
        damping = 0
        [[couplings]]
        kind = "wall"
        between = ["puck", "ground"]
        side = "above"
        at = 1
        stiffness = 0
    "#;
    World::read(&Source::from_text("w", file), sets).unwrap()
}

fn with(world: &World, change: impl FnOnce(&mut World)) -> bool {
    let mut world = world.clone();
    change(&mut world);
    is_certified(&world)
}

fn scaled(world: &mut World, factor: f64) {
    for coupling in &mut world.couplings {
        match &mut coupling.law {
            Law::Spring { stiffness, .. } | Law::Wall { stiffness, .. } => *stiffness *= factor,
            _ => {}
        }
    }
}

fn grounded(world: &mut World, damping: f64) {
    let law = Law::Damper { damping: Damping::Fixed(damping) };
    world.couplings.push(Coupling { first: End::Body(0), second: End::Ground, law });
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn each_remedy_certifies_alone_and_a_hundredth_beyond_it_nothing_does(
        method in prop::sample::select(vec!["zoh", "trapezoidal", "backward-euler", "forward-euler", "semi-implicit-euler", "rk4"]),
        output in prop::sample::select(vec!["start", "middle", "end"]),
        stiffness in 0.05..20.0f64,
        damping in prop_oneof![Just(0.0), 1e-5..1e-2f64],
        wall in prop_oneof![Just(0.0), 0.1..5.0f64],
        delay in prop_oneof![3 => Just(0.0), 1 => 0.0..3e-3f64],
        estimator in prop::sample::select(vec!["exact", "difference"]),
    ) {
        let sets = [
            format!("loop.method={method}"), format!("loop.output={output}"), format!("loop.delay={delay:?}"),
            format!("loop.estimator={estimator}"), format!("couplings.0.stiffness={stiffness:?}"),
            format!("couplings.1.damping={damping:?}"), format!("couplings.2.stiffness={wall:?}"),
        ];
        let world = wheel(&sets);
        let certified = is_certified(&world);
        let found = remedies(&world).unwrap();
        prop_assert!(!certified || (found.advance, found.output) == (None, None));
        if let Some(b) = found.device_damping {
            prop_assert!(with(&world, |w| w.device.damping = b), "{b}");
            prop_assert!(b == 0.0 || !with(&world, |w| w.device.damping = b / 1.01), "{b}");
        }
        if let Some(g) = found.ground_damping {
            prop_assert!(with(&world, |w| grounded(w, g)), "{g}");
            prop_assert!(g == 0.0 || !with(&world, |w| grounded(w, g / 1.01)), "{g}");
        }
        if let Some(period) = found.period_s {
            prop_assert!(with(&world, |w| w.sampling.period = period), "{period}");
            prop_assert!(!with(&world, |w| w.sampling.period = 1.01 * period), "{period}");
        }
        if let Some(delay) = found.delay_s {
            prop_assert!(with(&world, |w| w.sampling.delay = hapt_model::Delay::Seconds(delay)), "{delay}");
            prop_assert!(!with(&world, |w| w.sampling.delay = hapt_model::Delay::Seconds(1.01 * delay + 1e-6 * w.sampling.period * 2.0)), "{delay}");
        }
        if let Some(factor) = found.stiffness_scale {
            prop_assert!(with(&world, |w| scaled(w, factor)), "{factor}");
            prop_assert!(!with(&world, |w| scaled(w, 1.01 * factor)), "{factor}");
        }
        if let Some(advance) = found.advance {
            prop_assert!(with(&world, |w| w.sampling.advance = advance));
        }
    }
}

#[test]
fn the_bare_spring_costs_half_its_stiffness_times_the_period() {
    // Colgate and Schenkel: b > KT/2, at END on a lossless body the same.
    let world = wheel(&["couplings.0.stiffness=4".into()]);
    assert!(!is_certified(&world));
    let found = remedies(&world).unwrap();
    assert!((found.device_damping.unwrap() / 2e-3 - 1.0).abs() < 1e-6);
    assert!((found.stiffness_scale.unwrap() / 0.6 - 1.0).abs() < 1e-6);
    assert!((found.period_s.unwrap() / 0.6e-3 - 1.0).abs() < 1e-6);
    assert!(found.stiffness_scale.unwrap() <= 0.6 && found.period_s.unwrap() <= 0.6e-3);
}

#[test]
fn a_torque_from_the_start_of_the_step_is_mended_by_its_end() {
    let world = wheel(&["loop.output=start".into()]);
    let found = remedies(&world).unwrap();
    assert_eq!((found.device_damping, found.output), (None, Some("end")));
    assert!(found.ground_damping.is_some());
}

#[test]
fn a_whole_sample_of_delay_is_mended_by_a_step_ahead() {
    let world = wheel(&["loop.delay=0.001".into(), "couplings.0.stiffness=0.5".into()]);
    assert!(!is_certified(&world));
    assert_eq!(remedies(&world).unwrap().advance, Some(1));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    /// What is certified of a loop whose delay is in samples is what is certified of the same delay in seconds at each period.
    #[test]
    fn the_longest_period_carries_a_delay_in_samples_along(samples in 0.0..3.0f64, stiffness in 0.1..4.0f64) {
        let sets = [
            format!("loop.delay={samples:?} samples"), "loop.estimator=difference".into(), "couplings.0.stiffness=0".into(),
            format!("couplings.2.stiffness={stiffness:?}"),
        ];
        let world = wheel(&sets);
        let at = |period: f64| {
            with(&world, |w| {
                w.sampling.period = period;
                w.sampling.delay = hapt_model::Delay::Seconds(samples * period);
            })
        };
        let longest = remedies(&world).unwrap().period_s.unwrap();
        prop_assert!(at(longest) && !at(1.01 * longest), "{longest}");
        // b > K (T/2 + delay) of a bare wall, and a part of a sample costs a little more.
        let most = 1.2e-3 / stiffness / (0.5 + samples);
        prop_assert!((0.8..1.001).contains(&(longest / most)), "{longest} {most}");
    }
}

/// What `hapt check` prints of a world's remedies.
fn printed(text: &str) -> Vec<String> {
    let source = Source::from_text("world.toml", text);
    let world = World::read(&source, &[]).unwrap();
    let (check, found) = (hapt_analysis::check(&world).unwrap(), remedies(&world).unwrap());
    hapt_analysis::proposal(&world, &source, &[], &check, &found).unwrap().unwrap().lines()
}

#[test]
fn a_remedy_of_several_keys_is_one_block_and_says_so() {
    let head = "[loop]\nperiod = 1e-3\nestimator = \"difference\"\n[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\n";
    let spring = |stiffness: f64| {
        format!("[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = {stiffness}\n")
    };
    let one = printed(&format!("{head}{}", spring(4.0)));
    assert!(one.iter().all(|line| !line.is_empty() && !line.starts_with('#')), "{one:?}");
    assert!(one[0].starts_with("damping = ") && one[0].contains("a property of the hardware"), "{one:?}");
    let two = printed(&format!("{head}{}{}", spring(4.0), spring(2.0)));
    let blocks: Vec<&[String]> = two.split(|line| line.is_empty()).collect();
    let joint: Vec<&&[String]> = blocks.iter().filter(|block| block.len() > 1).collect();
    assert_eq!(joint.len(), 1, "{two:?}");
    assert_eq!((joint[0].len(), joint[0][0].as_str()), (3, "# all of these together:"));
    assert!(joint[0][1..].iter().all(|line| line.starts_with("stiffness = ")), "{two:?}");
    // Every other block is one line, a remedy by itself.
    assert!(blocks.iter().filter(|block| block.len() == 1).all(|block| block[0].contains(" = ")), "{two:?}");
}
