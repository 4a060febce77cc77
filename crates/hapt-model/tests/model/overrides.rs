//! `--set KEY=VALUE`: the same keys, the same checks.

use hapt_model::{Drive, Shape, Source, World};

const WORLD: &str = r#"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
[bodies.wheel]
inertia = "0.02 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "1 N m/rad"
[[couplings]]
kind = "damper"
between = ["puck", "wheel"]
damping = "1 N m s/rad"
[scenarios.step]
duration = "1 s"
hand = { kind = "step", to = "45 deg" }
"#;

fn set(sets: &[&str]) -> Result<World, String> {
    let sets: Vec<String> = sets.iter().map(|set| set.to_string()).collect();
    World::read(&Source::from_text("w.toml", WORLD), &sets).map_err(|error| error.to_string())
}

#[test]
fn a_value_set_is_the_same_value_in_the_file() {
    for (set_value, from, to) in [
        ("loop.period=2ms", "\"1 ms\"", "\"2ms\""),
        ("loop.period=0.002", "\"1 ms\"", "0.002"),
        ("loop.period = \"2 ms\"", "\"1 ms\"", "\"2 ms\""),
        ("loop.method=tustin", "[loop]", "[loop]\nmethod = \"tustin\""),
        ("bodies.wheel.inertia=0.04 kg m^2", "\"0.02 kg m^2\"", "\"0.04 kg m^2\""),
        ("bodies.wheel.position=45°", "[bodies.wheel]", "[bodies.wheel]\nposition = \"45°\""),
        ("couplings.0.stiffness=3", "\"1 N m/rad\"", "3"),
        ("couplings.1.damping=compensating", "\"1 N m s/rad\"", "\"compensating\""),
        (
            "couplings.1.between=[\"wheel\", \"ground\"]",
            "[\"puck\", \"wheel\"]\ndamping",
            "[\"wheel\", \"ground\"]\ndamping",
        ),
        ("scenarios.step.hand.to=1 rev", "\"45 deg\"", "\"1 rev\""),
        (
            "scenarios.step.hand={ kind = \"sine\", amplitude = \"1 rad\", frequency = \"2 Hz\" }",
            "{ kind = \"step\", to = \"45 deg\" }",
            "{ kind = \"sine\", amplitude = \"1 rad\", frequency = \"2 Hz\" }",
        ),
        ("title=Wheel = good", "[loop]", "title = \"Wheel = good\"\n[loop]"),
        ("title=1984", "[loop]", "title = \"1984\"\n[loop]"),
        ("device.limit=800 N mm", "[device]", "[device]\nlimit = \"800 N mm\""),
    ] {
        let in_file = WORLD.replacen(from, to, 1);
        assert_ne!(in_file, WORLD);
        let in_file = World::read(&Source::from_text("w.toml", in_file), &[]).map_err(|error| error.to_string());
        assert!(in_file.is_ok(), "{in_file:?}");
        assert_eq!(set(&[set_value]), in_file, "{set_value}");
    }
}

#[test]
fn the_last_of_a_key_wins_and_later_ones_see_the_earlier() {
    assert_eq!(set(&["loop.period=2ms", "loop.period=3ms"]).unwrap().sampling.period, 0.003);
    assert_eq!(set(&["loop.period=nonsense", "loop.period=3ms"]).unwrap().sampling.period, 0.003);
    let world = set(&["scenarios.step.hand={kind='ramp', over=1, to=2}", "scenarios.step.hand.to=3"]).unwrap();
    assert_eq!(world.scenarios[0].hand.drive, Drive::Position(Shape::Ramp { to: 3.0, at: 0.0, over: 1.0 }));
}

#[test]
fn whole_tables_can_be_set_where_the_file_has_none() {
    let sets: Vec<String> = ["loop.period=1ms", "device.inertia=1", "bodies={a={inertia=1}}", "bodies.a.inertia=2"]
        .map(String::from)
        .into();
    let world = World::read(&Source::from_text("w.toml", ""), &sets).unwrap();
    assert_eq!((world.sampling.period, world.bodies[0].inertia), (0.001, 2.0));
}

#[test]
fn mistakes_are_shown_in_the_override() {
    assert_eq!(
        set(&["loop.method=zoh", "loop.period=1 kg"]).unwrap_err(),
        "loop.period: \"1 kg\" is a mass (kg); expected a time (s), such as \"1 ms\"\n \
         --> --set:1:13\n  |\n1 | loop.period=1 kg\n  |             ^^^^"
    );
    assert_eq!(
        set(&["loop.perid=1 ms"]).unwrap_err(),
        "loop.perid: unknown key; did you mean \"period\"?\n --> --set:1:6\n  |\n1 | loop.perid=1 ms\n  |      ^^^^^"
    );
    assert_eq!(
        set(&["scenarios.step.hand={kind='step', too=1}"]).unwrap_err(),
        "scenarios.step.hand.too: unknown key; did you mean \"to\"?\n --> --set:1:35\n  |\n\
         1 | scenarios.step.hand={kind='step', too=1}\n  |                                   ^^^"
    );
    for (wrong, message) in [
        ("loop.period", "\"loop.period\" is not KEY=VALUE, such as loop.period=2ms"),
        ("", "\"\" is not KEY=VALUE, such as loop.period=2ms"),
        ("=1", "a name is missing between the points of the key"),
        ("loop..period=1", "loop.: a name is missing between the points of the key"),
        ("bodies.whel.inertia=1", "bodies.whel: the world has no body \"whel\"; did you mean \"wheel\"?"),
        ("bodies.x={inertia=1}", "bodies.x: the world has no body \"x\""),
        ("scenarios.stp.duration=1", "scenarios.stp: the world has no scenario \"stp\"; did you mean \"step\"?"),
        ("couplings.2.stiffness=1", "couplings.2: \"2\" is not a whole number from 0 to 1"),
        ("couplings.-1.stiffness=1", "couplings.-1: \"-1\" is not a whole number from 0 to 1"),
        ("couplings.spring.stiffness=1", "couplings.spring: \"spring\" is not a whole number from 0 to 1"),
        (
            "couplings.1.stiffness=1",
            "couplings.1.stiffness: not a key of kind \"damper\" but of \"spring\", \"wall\", \"dead-band\" or \"integral\"; \"damper\" takes kind, between, damping, limit",
        ),
        ("loop.period.x=1", "loop.period.x: \"period\" has no keys below it"),
        (
            "loop.period=",
            "loop.period: \"\" does not begin with a finite number; expected a time (s), such as \"1 ms\"",
        ),
        ("loop.period={a=1}", "loop.period: a table stands here; expected a time (s) above 0, such as \"1 ms\""),
        ("a.b.c.d.e.f=1", "\"a.b.c.d.e.f\" has 6 names; no key has more than 5"),
        ("loop=5", "loop: 5 is a number; expected a table of keys"),
        ("lop.period=1", "lop: unknown key; did you mean \"loop\"?"),
        (
            "device.encoder=nan",
            "device.encoder: nan is not a whole number; expected a whole number from 1 to 9007199254740992",
        ),
        ("loop.period=inf", "loop.period: inf is not a finite number; expected a time (s), such as \"1 ms\""),
        ("loop.period=1e-400", "loop.period: 1e-400 is not a finite number; expected a time (s), such as \"1 ms\""),
    ] {
        assert_eq!(set(&[wrong]).unwrap_err().lines().next(), Some(message), "{wrong}");
    }
}

#[test]
fn a_key_of_a_hundred_thousand_names_is_refused_and_takes_no_stack() {
    let deep = format!("{}a=1", "a.".repeat(100_000));
    let message = std::thread::Builder::new()
        .stack_size(256 << 10)
        .spawn(move || set(&[&deep]).unwrap_err())
        .unwrap()
        .join()
        .unwrap();
    assert!(message.contains("has 100001 names; no key has more than 5"), "{}", &message[..200]);
}

#[test]
fn a_thousand_overrides_are_the_most() {
    let sets = vec!["loop.period=1 ms"; 1001];
    assert!(set(&sets[..1000]).is_ok());
    assert_eq!(set(&sets).unwrap_err(), "--set: 1001 overrides are too many: the limit is 1000");
}

/// A sweep or a slider that changes a number does not reduce its uncertainty.
#[test]
fn a_number_keeps_its_tolerance_until_another_is_given() {
    let read = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        let file = "loop.period = 1e-3\ndevice = { inertia = 1e-3, damping = \"2e-3 ± 5e-4 N m s/rad\" }\n";
        World::read(&Source::from_text("w", file), &sets).unwrap().device
    };
    let damping = |sets: &[&str]| (read(sets).damping, read(sets).tolerances.damping);
    assert_eq!(damping(&[]), (2e-3, 0.25));
    assert_eq!(damping(&["device.damping=4e-3 N m s/rad"]), (4e-3, 0.25));
    assert_eq!(damping(&["device.damping=4e-3", "device.damping=1e-3"]), (1e-3, 0.25));
    assert_eq!(damping(&["device.damping=4e-3 N m s/rad ± 10 %", "device.damping=1e-3"]), (1e-3, 0.1));
    assert_eq!(damping(&["device.damping=4e-3 N m s/rad ± 0 %"]), (4e-3, 0.0));
    assert_eq!(read(&[]).damping_range(), [1.5e-3, 2.5e-3]);
    assert_eq!(read(&["device.lag=1 ms +- 50 %"]).lag_range(), [0.5e-3, 1.5e-3]);
}

/// An absent key follows the given one, also where a sweep changes it.
#[test]
fn the_longest_interval_and_the_largest_delay_follow_period_and_delay() {
    let read = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        let file = "loop = { period = 1e-3, delay = \"0.5 samples\" }\ndevice.inertia = 1e-3\n";
        World::read(&Source::from_text("w", file), &sets).unwrap()
    };
    let times = |world: &World| (world.sampling.interval_max_s(), world.sampling.delay_max_s());
    let mut world = read(&[]);
    assert!(world.sampling.is_even());
    assert!(world.set_number("loop.period", 4e-3));
    assert_eq!(times(&world), (4e-3, 2e-3));
    let mut world = read(&["loop.interval_max=3 ms", "loop.delay_max=0.75 samples"]);
    assert_eq!(times(&world), (3e-3, 0.75e-3));
    assert!(!world.sampling.is_even());
    assert!(world.set_number("loop.period", 4e-3));
    assert_eq!(times(&world), (4e-3, 3e-3), "the samples are never nearer than the period on average");
}
