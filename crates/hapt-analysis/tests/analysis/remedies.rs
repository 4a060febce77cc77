//! Remedies are what they say: each certifies the world by itself, and a hundredth beyond it does not. Margins are the ends of
//! intervals without gaps.

use hapt_analysis::{Verdict, certified_interval, check, is_certified, quick_check, remedies};
use hapt_model::{Coupling, Damping, Delay, End, Law, Source, World};
use hapt_testing::prelude::*;

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
    world.couplings.push(Coupling { first: End::Body(0), second: End::Ground, law, limit: None });
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    /// `is_certified` ends its work where `check` continues.
    #[test]
    fn the_short_way_to_a_verdict_is_that_of_the_check(
        method in prop::sample::select(vec!["zoh", "trapezoidal", "backward-euler", "forward-euler", "semi-implicit-euler", "rk4"]),
        output in prop::sample::select(vec!["start", "middle", "end"]),
        stiffness in 0.05..20.0f64,
        damping in prop_oneof![Just(0.0), 1e-5..1e-2f64],
        wall in prop_oneof![Just(0.0), 0.1..5.0f64],
        delay in prop_oneof![3 => Just(0.0), 1 => 0.0..3e-3f64],
        lag in prop_oneof![2 => Just(0.0), 1 => 0.0..1e-3f64],
        stretch in prop_oneof![Just(1.0), 1.0..1.6f64],
        tolerance in prop_oneof![Just(0.0), 1.0..30.0f64],
        estimator in prop::sample::select(vec!["exact", "difference"]),
    ) {
        let sets = [
            format!("loop.method={method}"), format!("loop.output={output}"), format!("loop.delay={delay:?}"),
            format!("loop.estimator={estimator}"), format!("couplings.0.stiffness={stiffness:?}"),
            format!("couplings.1.damping={damping:?}"), format!("couplings.2.stiffness={wall:?}"), format!("device.lag={lag:?}"),
            format!("loop.interval_max={:?}", 1e-3 * stretch), format!("device.damping=1.2e-3 N m s/rad ± {tolerance:?} %"),
        ];
        let mut world = wheel(&sets);
        // With a device that needs more damping, and with one that just has enough.
        let found = check(&world).unwrap();
        prop_assert_eq!(is_certified(&world), found.certified.holds());
        for more in [0.5, 0.999, 1.0 - 1e-7, 1.0 + 1e-7, 1.001, 2.0, 30.0] {
            let both = found.uneven.required_damping.zip(found.passivity.required_damping);
            let Some(least) = both.map(|(uneven, even)| uneven.max(even)) else { continue };
            world.device.damping = more * least / (1.0 - 1e-2 * tolerance);
            prop_assert_eq!(is_certified(&world), quick_check(&world).unwrap().certified.holds(), "{}", more);
        }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(20))]

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
            prop_assert!(with(&world, |w| w.sampling.delay = Delay::Seconds(delay)), "{delay}");
            prop_assert!(!with(&world, |w| w.sampling.delay = Delay::Seconds(1.01 * delay + 1e-6 * w.sampling.period * 2.0)), "{delay}");
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

/// A file takes numbers up to 1e30: KT/2 beyond them is no remedy.
#[test]
fn a_remedy_is_a_number_that_a_file_takes() {
    for (period, is_taken) in [(1.0, true), (10.0, false)] {
        let file = format!(
            "[loop]\nperiod = {period}\nestimator = \"difference\"\n[device]\ninertia = 1\n\
             [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = 1e30\n"
        );
        let world = World::read(&Source::from_text("w.toml", file), &[]).unwrap();
        assert_eq!(remedies(&world).unwrap().device_damping.is_some(), is_taken, "{period}");
    }
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
    #![proptest_config(hapt_testing::cases(12))]

    /// A loop whose delay is in samples has the same certificate as one with the same delay in seconds at each period.
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
                w.sampling.delay = Delay::Seconds(samples * period);
            })
        };
        let longest = remedies(&world).unwrap().period_s.unwrap();
        prop_assert!(at(longest) && !at(1.01 * longest), "{longest}");
        // b > K (T/2 + delay) of a bare wall, and a fraction of a sample requires a little more.
        let most = 1.2e-3 / stiffness / (0.5 + samples);
        prop_assert!((0.8..1.001).contains(&(longest / most)), "{longest} {most}");
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// The file of a world takes the period that a remedy or a margin names, with the other times and the device as they are.
    #[test]
    fn the_file_takes_the_longest_period(
        samples in prop_oneof![Just(0.0), 0.0..3.0f64], latest in prop::option::of(1.0..4.0f64), recentre in prop::option::of(2.0..20.0f64),
        longest in prop::option::of(1.0..3.0f64), stop in prop::option::of(10.0..1e5f64), stiffness in 0.01..3.0f64,
    ) {
        let file = "loop.period = 1e-3\nloop.estimator = \"difference\"\ndevice = { inertia = 6.4e-4, damping = 1.2e-3, friction = 0.01 }\n\
                    [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\n";
        let read = |sets: &[String]| World::read(&Source::from_text("w", file), sets).unwrap();
        let mut sets = vec![format!("loop.delay={samples:?} samples"), format!("couplings.0.stiffness={stiffness:?}")];
        sets.extend(latest.map(|latest| format!("loop.delay_max={:?}", 1e-3 * latest * samples.max(0.1))));
        sets.extend(longest.map(|longest| format!("loop.interval_max={:?}", 1e-3 * longest)));
        sets.extend(recentre.filter(|_| samples == 0.0).map(|recentre| format!("loop.recentre={:?}", 1e-3 * recentre)));
        sets.extend(stop.map(|stiffness| format!("device.stops={{ high = 0.5, stiffness = {stiffness:?} }}")));
        let found = remedies(&read(&sets)).unwrap();
        if let Some(period) = found.period_s {
            sets.push(format!("loop.period={period:?}"));
            prop_assert!(is_certified(&read(&sets)), "{sets:?}");
        }
    }
}

/// The remedies of a world in the output of `hapt check`.
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

/// A loop on the notes' device, its springs and dampers from the puck to ground or to a body.
fn random(rng: &mut Rng) -> World {
    let period = rng.log(-3.5, -2.5);
    let method = rng.of(["zoh", "trapezoidal", "backward-euler", "semi-implicit-euler", "forward-euler", "rk4"]);
    let output = rng.of(["start", "middle", "end", "end"]);
    let estimator = rng.of(["exact", "difference", "low-pass\"\ncutoff = \"50 Hz"]);
    let delay = match rng.below(3) {
        0 => 0.0,
        1 => (1 + rng.below(4)) as f64 * period,
        _ => 6.0 * rng.unit() * period,
    };
    let advance = if output == "end" { rng.below(3) } else { 0 };
    let inertia = rng.log(-5.0, -2.0);
    let mut file = format!(
        "[loop]\nperiod = {period}\nmethod = \"{method}\"\noutput = \"{output}\"\nestimator = \"{estimator}\"\ndelay = {delay}\n\
         advance = {advance}\n[device]\ninertia = {inertia}\ndamping = 1\n"
    );
    let bodies = rng.below(3);
    (0..bodies).for_each(|i| file += &format!("[bodies.b{i}]\ninertia = {}\n", inertia * rng.log(-1.0, 2.0)));
    let mut required = 0.0;
    for i in 0..=bodies {
        let (first, second) = match i {
            0 => ("puck".to_string(), "ground"),
            _ => (format!("b{}", i - 1), rng.of(["puck", "puck", "ground"])),
        };
        let stiffness = inertia * (rng.log(-2.0, 0.0) / period).powi(2);
        let kind = rng.of(["kind = \"spring\"", "kind = \"spring\"", "kind = \"wall\"\nside = \"above\"\nat = 0.1"]);
        file += &format!("[[couplings]]\n{kind}\nbetween = [\"{first}\", \"{second}\"]\nstiffness = {stiffness}\n");
        let damping = stiffness * period * rng.log(-2.0, 0.5);
        if rng.below(2) == 0 {
            file += &format!(
                "[[couplings]]\nkind = \"damper\"\nbetween = [\"{first}\", \"{second}\"]\ndamping = {damping}\n"
            );
        }
        required += stiffness * (0.5 * period + delay) + damping;
    }
    let mut world = World::read(&Source::from_text("w", file), &[]).unwrap();
    world.device.damping = required * rng.log(-0.3, 0.7);
    world
}

/// The same numbers in every run.
struct Rng(u64);

impl Rng {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn log(&mut self, from: f64, to: f64) -> f64 {
        10f64.powf(from + (to - from) * self.unit())
    }

    fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    fn of<T: Copy, const N: usize>(&mut self, all: [T; N]) -> T {
        all[self.below(N)]
    }
}

#[test]
fn a_margin_is_the_end_of_an_interval_that_is_certified_all_through() {
    let mut judged = 0;
    for seed in hapt_testing::seeds(100) {
        let world = random(&mut Rng(seed));
        if !is_certified(&world) {
            continue;
        }
        judged += 1;
        let found = remedies(&world).unwrap();
        let (period, delay) = (world.sampling.period, world.sampling.delay_s());
        type Change = fn(&mut World, f64);
        let margins: [(&str, f64, Option<f64>, f64, Change); 3] = [
            ("period_s", period, found.period_s, 30.0 * period, |w, period| w.sampling.period = period),
            ("delay_s", delay, found.delay_s, delay + 40.0 * period, |w, delay| {
                w.sampling.delay = Delay::Seconds(delay)
            }),
            ("stiffness_scale", 1.0, found.stiffness_scale, 30.0, scaled),
        ];
        for (name, now, end, far, change) in margins {
            let certified = |x: f64| with(&world, |w| change(w, x));
            assert!(end.is_some() || found.reasons.contains_key(name), "{seed}: {name}: {found:?}");
            let last = end.unwrap_or(far);
            assert!(last >= now, "{seed}: {name} {last} below {now}");
            for i in 0..=60 {
                let x = now + (last - now) * f64::from(i) / 60.0;
                assert!(certified(x), "{seed}: {name} from {now} to {end:?}, but not at {x}");
            }
            if let Some(end) = end {
                // A delay within 1e-6 of a whole sample is that sample.
                let beyond = if name == "delay_s" { 2e-6 * period } else { 0.0 };
                assert!(!certified(end * (1.0 + 2e-6) + beyond), "{seed}: {name} {end} goes on");
            }
        }
    }
    assert!(judged > 0);
}

/// The same loop with all its times times `factor`: the same motion, later. Stiffnesses stay.
fn slower(world: &World, factor: f64) -> World {
    let mut world = world.clone();
    world.sampling.period *= factor;
    world.sampling.delay = Delay::Seconds(factor * world.sampling.delay_s());
    world.sampling.cutoff = world.sampling.cutoff.map(|cutoff| cutoff / factor);
    world.device.inertia *= factor * factor;
    world.device.damping *= factor;
    for body in &mut world.bodies {
        body.inertia *= factor * factor;
    }
    for coupling in &mut world.couplings {
        if let Law::Damper { damping: Damping::Fixed(damping) } = &mut coupling.law {
            *damping *= factor;
        }
    }
    world
}

#[test]
fn a_touch_of_the_circle_is_no_critical_period() {
    // At each half period of the oscillation of an undamped body the puck does not move it. Nothing grows before or after it.
    let world = random(&mut Rng(1224));
    let found = check(&world).unwrap().free.critical_period_s.unwrap();
    let touch = std::f64::consts::PI * (7.933988656333276e-5f64 / 0.03378691847475031).sqrt();
    assert!(found > 2.5 * touch, "{found} {touch}");
    for part in [0.999, 1.0, 1.001, 1.5, 2.0, 2.001, 0.999 * found / touch, 1.001 * found / touch] {
        let mut world = world.clone();
        world.sampling.period = part * touch;
        let verdict = quick_check(&world).unwrap().free.verdict;
        assert_eq!(verdict == Verdict::Unstable, part * touch > found, "{part}");
    }
}

#[test]
fn seconds_are_a_choice() {
    for seed in hapt_testing::seeds(60) {
        let world = random(&mut Rng(seed));
        let found = check(&world).unwrap();
        // Powers of two, which round nothing.
        for factor in [1.0 / 1024.0, 1024.0] {
            let other = check(&slower(&world, factor)).unwrap();
            assert_eq!(found.status, other.status, "{seed}: {factor}");
            let near = |name: &str, one: Option<f64>, other: Option<f64>, scale: f64| match (one, other) {
                (Some(one), Some(other)) => {
                    assert!((scale * one - other).abs() <= 1e-6 * other.abs(), "{seed}: {name} {one} {other}");
                }
                (one, other) => assert_eq!(one, other, "{seed}: {name}, all times {factor} times"),
            };
            near("held", found.held.critical_period_s, other.held.critical_period_s, factor);
            near("free", found.free.critical_period_s, other.free.critical_period_s, factor);
            // A mode that decays by less than 1e-9 a second counts as undamped: then no damping is enough instead of an absurd one.
            let sensible = |damping: Option<f64>, device: f64| damping.filter(|damping| *damping < 1e3 * device);
            let [one, other] = [(&found, world.device.damping), (&other, factor * world.device.damping)]
                .map(|(found, device)| sensible(found.passivity.required_damping, device));
            near("damping", one, other, factor);
        }
    }
}

#[test]
fn a_margin_passes_no_gap_between_whole_samples_of_delay() {
    // Nothing damps the wheel: at two samples it is certified, at one and a half nothing is.
    let world = wheel(&["loop.delay=0.002".into(), "loop.advance=2".into(), "couplings.0.stiffness=0.2".into()]);
    assert!(is_certified(&world) && !with(&world, |w| w.sampling.delay = Delay::Seconds(1.5e-3)));
    let found = remedies(&world).unwrap();
    let near = |found: Option<f64>, wanted: f64| (found.unwrap() / wanted - 1.0).abs() < 2e-6;
    assert!(near(found.period_s, 1e-3) && near(found.delay_s, 2e-3), "{found:?}");
}

#[test]
fn a_margin_of_the_delay_goes_on_as_long_as_the_certificate_does_or_says_how_far_it_was_looked() {
    // b = (KT/4)(q + √(q² + 4a(1 - a))), q = 1 + 2(d + a), for a spring to ground.
    let spring = |stiffness: f64| {
        let file = format!(
            "[loop]\nperiod = 1e-3\n[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\n\
             [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = {stiffness}\n"
        );
        World::read(&Source::from_text("w", file), &[]).unwrap()
    };
    for stiffness in [0.4, 0.031, 0.02, 0.007] {
        let delay = remedies(&spring(stiffness)).unwrap().delay_s.unwrap() / 1e-3;
        let (a, q) = (delay.fract(), 1.0 + 2.0 * delay);
        let required = 0.25 * stiffness * 1e-3 * (q + (q * q + 4.0 * a * (1.0 - a)).sqrt());
        assert!((required / 1.2e-3 - 1.0).abs() < 1e-5, "{stiffness}: {delay} samples, {required}");
    }
    let found = remedies(&spring(0.002)).unwrap();
    assert!(found.delay_s.is_none() && found.reasons["delay_s"].contains("500 samples"), "{found:?}");
}

#[test]
fn a_margin_without_an_end_is_not_the_delay() {
    // A damper without a spring requires the same at every period.
    let file = "[loop]\nperiod = 2e-3\ndelay = 1e-3\nestimator = \"difference\"\n[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\n";
    let world = World::read(&Source::from_text("w", file), &[]).unwrap();
    let found = remedies(&world).unwrap();
    assert!(found.period_s.is_none() && found.reasons["period_s"].contains("no end"), "{found:?}");
}

/// A spring to ground, its numbers as a file writes them.
fn spring_file(stiffness: &str, damping: &str, period: &str, rest: &str) -> Source {
    let file = format!(
        "[loop]\nperiod = \"{period}\"\n{rest}\n[device]\ninertia = 6.4e-4\ndamping = \"{damping}\"\n\
         [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = \"{stiffness}\"\n"
    );
    Source::from_text("spring.toml", file)
}

/// The changes that `check` proposes, as keys with their values.
fn proposed(source: &Source) -> Vec<Vec<(String, String)>> {
    let world = World::read(source, &[]).unwrap();
    let (check, found) = (quick_check(&world).unwrap(), remedies(&world).unwrap());
    let all = hapt_analysis::proposal(&world, source, &[], &check, &found).unwrap().unwrap();
    all.remedies.into_iter().map(|remedy| remedy.sets).filter(|sets| !sets.is_empty()).collect()
}

proptest! {
    #![proptest_config(hapt_testing::cases(256))]

    /// A compensation in parallel with a coupling: each proposed change is of a key that the file has, and certifies the file; a smaller
    /// share is among them if the coupling leaves some of the damping.
    #[test]
    fn too_much_of_a_compensation_is_mended_by_a_smaller_share(
        torque in 0.05..0.5_f64, share in 0.3..1.0_f64, part in 0.2..0.9_f64, of_spring in 0.0..0.9_f64, with_body in any::<bool>(),
    ) {
        // The compensation and the spring require their stiffness times half a period.
        let damping = 0.5e-3 * torque * share * part;
        let body = if with_body { "[bodies]\nball = { inertia = \"0.01 kg m^2\" }\n" } else { "" };
        let file = format!(
            "[loop]\nperiod = \"1 ms\"\nestimator = \"difference\"\n[device]\ninertia = 0.01\ndamping = {damping}\n\
             friction = \"1 mN m\"\nlimit = \"2 N m\"\n{body}[device.gravity]\ntorque = {torque}\n\
             [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = {}\n\
             [[compensation]]\nof = \"gravity\"\nshare = {share}\n",
            of_spring * part * share * torque
        );
        let source = Source::from_text("arm.toml", file);
        prop_assert!(!hapt_analysis::is_certified(&World::read(&source, &[]).unwrap()));
        let all = proposed(&source);
        for sets in &all {
            let sets: Vec<String> = sets.iter().map(|(key, value)| format!("{key}={value}")).collect();
            let world = World::read(&source, &sets);
            prop_assert!(world.is_ok(), "{sets:?} {:?}", world.err());
            prop_assert!(hapt_analysis::is_certified(&world.unwrap()), "{sets:?}");
        }
        let is_share = |sets: &&Vec<(String, String)>| sets.len() == 1 && sets[0].0 == "compensation.0.share";
        let smaller: Vec<&Vec<(String, String)>> = all.iter().filter(is_share).collect();
        prop_assert_eq!(smaller.len(), 1, "{:?}", all);
        let most = 2e3 * damping / torque - of_spring * part * share;
        let proposed: f64 = digits(&smaller[0][0].1).parse().unwrap();
        prop_assert!(proposed <= most && proposed > most * (1.0 - 1e-3), "{proposed} {most}");
    }
}

/// The number of a value with its unit.
fn digits(value: &str) -> &str {
    value.split(' ').next().unwrap()
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    /// b = KT/2 of a bare spring: where two of them are round, so is the third, for any result of the search.
    #[test]
    fn an_edge_at_a_round_number_is_printed_as_that_number(
        stiffness in 1..1000u32, half in 1..100u32, softer in 2..40u32, shift in -2..3i32,
    ) {
        // Decimals, which no binary number meets: a stiffness in tenths, and a period of twice as many microseconds.
        let decimal = |n: u32, shift: i32| format!("{n}e{shift}").parse::<f64>().unwrap();
        let (k, t, b) = (decimal(stiffness, shift - 1), decimal(2 * half, -6), decimal(stiffness * half, shift - 7));
        let value = |sets: &[Vec<(String, String)>], key: &str| {
            let found = sets.iter().flatten().find(|(path, _)| path == key);
            found.map(|(_, value)| digits(value).parse::<f64>().unwrap())
        };
        for factor in [1.0 / f64::from(softer), f64::from(softer)] {
            let k_now = format!("{} N m/rad", k * factor);
            let found = proposed(&spring_file(&k_now, &format!("{b} N m s/rad"), &format!("{t} s"), ""));
            prop_assert_eq!(value(&found, "couplings.0.stiffness"), Some(k));
            let found = proposed(&spring_file(&format!("{k} N m/rad"), &format!("{b} N m s/rad"), &format!("{} s", t * factor), ""));
            prop_assert_eq!(value(&found, "loop.period"), Some(t));
            let b_now = format!("{} N m s/rad", b / factor);
            let found = proposed(&spring_file(&format!("{k} N m/rad"), &b_now, &format!("{t} s"), ""));
            prop_assert_eq!(value(&found, "device.damping"), Some(b));
        }
    }

    /// In the units of the file, for any units.
    #[test]
    fn a_printed_number_is_certified_and_the_edge_is_at_most_a_millionth_beyond(
        stiffness in 0.01..50.0f64, damping in 0.05..20.0f64, period in 0.2..5.0f64, delay in prop_oneof![Just(0.0), 0.0..4.0f64],
        longest in prop_oneof![Just(1.0), 1.0..2.0f64],
    ) {
        let timing = format!("delay = \"{delay} ms\"\ninterval_max = \"{} ms\"", period * longest);
        let source = spring_file(&format!("{stiffness} N mm/deg"), &format!("{damping} N mm s/rad"), &format!("{period} ms"), &timing);
        for sets in proposed(&source) {
            let [(path, value)] = &sets[..] else { panic!("{sets:?}") };
            let (number, unit) = value.split_once(' ').unwrap();
            let at = |x: f64| World::read(&source, &[format!("{path}={x} {unit}")]).map(|world| is_certified(&world));
            let printed: f64 = number.parse().unwrap();
            prop_assert_eq!(at(printed).ok(), Some(true), "{} = {}", path, value);
            // A delay within a millionth of a whole sample is that sample.
            let beyond = if path.starts_with("loop.delay") { 2e-6 * period } else { 0.0 };
            let further = if path == "device.damping" { printed * (1.0 - 1.1e-6) } else { printed * (1.0 + 1.1e-6) + beyond };
            prop_assert!(at(further) .ok() != Some(true), "{path} = {value} goes on");
        }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(12))]

    /// For the wall of a certified wheel: the ends of the interval and all between them are certified, and a thousandth beyond an end that
    /// is not that of the search is not.
    #[test]
    fn an_interval_around_a_number_is_certified_all_through_and_no_further(
        wall in 0.01..0.2_f64,
        spring in 0.1..1.0_f64,
        damping in 1e-5..1e-3_f64,
        parts in prop::array::uniform8(0.0..1.0_f64),
    ) {
        let mut world = wheel(&["loop.output=end".into(), format!("couplings.0.stiffness={spring}")]);
        grounded(&mut world, damping);
        let set = |w: &mut World, x: f64| {
            if let Law::Wall { stiffness, .. } = &mut w.couplings[2].law {
                *stiffness = x;
            }
        };
        set(&mut world, wall);
        let found = certified_interval(&world, wall, 100.0, set).unwrap();
        prop_assert_eq!(found.is_some(), is_certified(&world));
        let Some([low, high]) = found else { return Ok(()) };
        prop_assert!(low <= wall && wall <= high);
        for x in parts.map(|part| low * (high / low).powf(part)).into_iter().chain([low, high]) {
            prop_assert!(with(&world, |w| set(w, x)), "{x} of {low} to {high}");
        }
        for (end, beyond) in [(low, 0.999 * low), (high, 1.001 * high)] {
            let is_searched = end > wall / 100.0 && end < wall * 100.0;
            prop_assert!(!is_searched || !with(&world, |w| set(w, beyond)), "{end} goes on");
        }
    }
}

#[test]
fn no_interval_is_certified_around_a_number_that_is_not() {
    let set = |w: &mut World, x: f64| scaled(w, x);
    let world = wheel(&["couplings.2.stiffness=1000".into()]);
    assert!(!is_certified(&world) && certified_interval(&world, 1.0, 10.0, set).unwrap().is_none());
    let world = wheel(&["couplings.0.stiffness=0.1".into()]);
    assert!(is_certified(&world));
    for (now, ratio) in [(0.0, 10.0), (-1.0, 10.0), (f64::NAN, 10.0), (1.0, 0.5), (1.0, f64::INFINITY)] {
        assert!(certified_interval(&world, now, ratio, set).unwrap().is_none(), "{now} {ratio}");
    }
}
