//! The documented example, and the meaning of the keys.

use std::f64::consts::{FRAC_PI_4, PI};

use hapt_model::{
    Body, Coupling, Damping, Device, Drive, End, EstimatorKind, Hand, Law, Method, Motion, Output, Sampling, Scenario,
    Shape, Side, Source, World,
};

const EXAMPLE: &str = r#"
title  = "Virtual wheel on a torsional spring"
motion = "rotary"                       # "rotary" (default) or "linear"

[loop]
period    = "1 ms"
method    = "zoh"                       # section 4; "zoh" is the default
output    = "end"                       # which state makes the torque: "start", "middle" or "end" of the step (section 3)
advance   = 0                           # "end" only: further steps ahead, puck held still (whole samples; for a known delay)
delay     = "0 ms"                      # from the sample to the moment the motor torque changes
# filter  = "100 Hz"                    # bodies and couplings see the position behind one pole; absent: none
# recentre = "1 s"                      # the time for which the puck rests before the origin slips to it; absent: it stays
estimator = "exact"                     # puck velocity: "exact", "difference", "low-pass", "foaw", "foaw-best"
cutoff    = "50 Hz"                     # low-pass only
every     = 1                           # difference only: over so many samples
window    = 16                          # foaw only: the largest window, in samples

[device]
inertia  = "6.4e-4 kg m^2"              # the puck's J_z (mass, where linear); required
damping  = "1.2e-3 N m s/rad"           # viscous, default 0
friction = "5 N mm"                     # Coulomb, default 0; sticks while at rest and |net torque| <= friction
limit    = "822.25 N mm"                # largest torque the motor may be asked for; absent: none
encoder  = 4000                         # counts per revolution (linear: "5 um", the count's size); absent: ideal
levels   = 2048                         # torque resolution, even: steps of 2 limit/levels; needs a limit; absent: ideal

[bodies.wheel]
inertia  = "0.4503 N mm/(deg/s^2)"      # mass, where linear
position = "0 deg"                      # initial, default 0
velocity = "0 deg/s"

[[couplings]]
kind      = "spring"
between   = ["puck", "wheel"]
stiffness = "17.7778 N mm/deg"
rest      = "0 deg"                     # q at which the spring is slack, default 0

# With forward Euler, and only there, this damper undoes the method's growth (the notes' b = Tk):
#   [[couplings]]
#   kind = "damper"
#   between = ["puck", "wheel"]           # or ["wheel", "ground"]
#   damping = "compensating"

[scenarios.step]
duration = "10 s"
hand     = { kind = "step", to = "45 deg", at = "0 s" }
"#;

const LEAST: &str = "loop = { period = 0.001 }\ndevice = { inertia = 1 }\n";

fn read(text: &str) -> World {
    World::read(&Source::from_text("world.toml", text), &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn least_with(more: &str) -> World {
    read(&format!("{LEAST}{more}"))
}

fn near(given: f64, wanted: f64) -> bool {
    (given - wanted).abs() <= 4.0 * f64::EPSILON * wanted.abs()
}

#[test]
fn the_documented_example_reads_to_its_numbers() {
    let world = read(EXAMPLE);
    assert_eq!(world.title.as_deref(), Some("Virtual wheel on a torsional spring"));
    assert_eq!(world.motion, Motion::Rotary);
    let sampling = Sampling { cutoff: Some(50.0), ..Sampling::new(0.001) };
    assert_eq!(world.sampling, sampling);
    let device = Device {
        damping: 1.2e-3,
        friction: 0.005,
        limit: Some(0.82225),
        encoder: Some(4000.0),
        levels: Some(2048),
        ..Device::new(6.4e-4)
    };
    assert_eq!(world.device, device);
    assert_eq!(world.names, ["wheel"]);
    assert!(near(world.bodies[0].inertia, 0.4503e-3 * 180.0 / PI));
    assert_eq!((world.bodies[0].position, world.bodies[0].velocity), (0.0, 0.0));
    let [Coupling { first: End::Puck, second: End::Body(0), law: Law::Spring { stiffness, rest }, limit: None }] =
        world.couplings[..]
    else {
        panic!("{:?}", world.couplings)
    };
    assert!(near(stiffness, 17.7778e-3 * 180.0 / PI) && rest == 0.0);
    let hand = Hand { drive: Drive::Position(Shape::Step { to: FRAC_PI_4, at: 0.0 }), release: None };
    assert_eq!(
        world.scenarios,
        [Scenario { name: "step".to_string(), duration: 10.0, hand, timing: Default::default() }]
    );
}

#[test]
fn the_notes_damper_joins_the_example() {
    let damper = "[[couplings]]\nkind = \"damper\"\nbetween = [\"wheel\", \"ground\"]\ndamping = \"compensating\"\n";
    let world = read(&format!("{EXAMPLE}\n{damper}").replace("\"zoh\"  ", "\"forward-euler\""));
    assert_eq!(world.sampling.method, Method::ForwardEuler);
    let law = Law::Damper { damping: Damping::Compensating };
    assert_eq!(world.couplings[1], Coupling { first: End::Body(0), second: End::Ground, law, limit: None });
}

#[test]
fn what_is_absent_has_its_default() {
    let world =
        least_with("[scenarios.s]\nduration = 1\nhand = { kind = \"grip\", moves = { kind = \"step\", to = 1 } }");
    let sampling = Sampling {
        period: 0.001,
        method: Method::Zoh,
        output: Output::End,
        advance: 0,
        bodies_every: 1,
        interval_max: None,
        delay: hapt_model::Delay::Seconds(0.0),
        delay_max: None,
        filter: None,
        recentre: None,
        estimator: EstimatorKind::Exact,
        cutoff: None,
        acceleration: None,
        every: 1,
        window: 16,
    };
    assert_eq!((world.title, world.motion, &world.sampling), (None, Motion::Rotary, &sampling));
    assert_eq!(Sampling::new(0.001), sampling);
    let device = Device {
        inertia: 1.0,
        damping: 0.0,
        friction: 0.0,
        lag: 0.0,
        tolerances: Default::default(),
        limit: None,
        encoder: None,
        levels: None,
        drive: Default::default(),
        handle: None,
        friction_backward: None,
        friction_by_position: None,
        stribeck: None,
        stops: None,
        torque: Default::default(),
    };
    assert_eq!((&world.device, &Device::new(1.0)), (&device, &device));
    let moves = Shape::Step { to: 1.0, at: 0.0 };
    assert_eq!(
        world.scenarios[0].hand.drive,
        Drive::Grip { inertia: 0.0, damping: 0.0, stiffness: 0.0, moves, switching: None }
    );
}

#[test]
fn the_output_follows_the_method_when_absent() {
    for method in Method::ALL {
        let world = read(&format!("loop = {{ period = 1, method = {:?} }}\ndevice.inertia = 1", method.name()));
        let first = method.takes_new_sample_first();
        assert_eq!(world.sampling.output, if first { Output::Start } else { Output::End }, "{method:?}");
    }
}

#[test]
fn a_linear_world_takes_lengths_and_forces_and_a_sine_still_has_an_angle() {
    let world = read(
        r#"
motion = "linear"
loop.period = "1 ms"
device = { inertia = "100 g", damping = "2 N s/m", friction = "5 mN", limit = "10 N", encoder = "5 µm", levels = 16 }
bodies.mass = { inertia = "0.5 kg", position = "1 cm", velocity = "20 mm/s" }
[[couplings]]
kind = "spring"
between = ["puck", "mass"]
stiffness = "0.5 N/mm"
[scenarios.push]
duration = "1 s"
hand = { kind = "torque", moves = { kind = "sine", amplitude = "3 N", frequency = "2 Hz", phase = "90 deg" } }
[scenarios.slide]
duration = "1 s"
hand = { kind = "sine", amplitude = "3 mm", frequency = "2 Hz", phase = "90 deg", release = "0.5 s" }
"#,
    );
    let device = Device {
        damping: 2.0,
        friction: 0.005,
        limit: Some(10.0),
        encoder: Some(5e-6),
        levels: Some(16),
        ..Device::new(0.1)
    };
    assert_eq!(world.device, device);
    assert_eq!(world.count(), Some(5e-6));
    assert_eq!(world.bodies, [Body { inertia: 0.5, position: 0.01, velocity: 0.02 }]);
    assert_eq!(world.couplings[0].law, Law::Spring { stiffness: 500.0, rest: 0.0 });
    let sine = |amplitude| Shape::Sine { amplitude, frequency: 2.0, phase: PI / 2.0 };
    assert_eq!(world.scenarios[0].hand, Hand { drive: Drive::Torque(sine(3.0)), release: None });
    assert_eq!(world.scenarios[1].hand, Hand { drive: Drive::Position(sine(0.003)), release: Some(0.5) });
}

#[test]
fn every_coupling_reads() {
    let world = least_with(
        r#"
[bodies]
a = { inertia = "1 kg m^2" }
b = { inertia = "1 N m s^2/rad" }
[[couplings]]
kind = "wall"
between = ["puck", "ground"]
side = "below"
at = "-10 deg"
stiffness = "2 N m/rad"
[[couplings]]
kind = "detent"
between = ["puck", "ground"]
torque = "50 N mm"
pitch = "0.1 rev"
[[couplings]]
kind = "friction"
between = ["puck", "ground"]
torque = "5 mNm"
[[couplings]]
kind = "friction"
between = ["puck", "ground"]
coulomb = 1
stribeck = 2
stribeck_velocity = "1 rpm"
bristle_stiffness = 3
bristle_damping = 4
viscous = 5
[[couplings]]
kind = "constant"
between = ["a", "b"]
torque = "-0.1 J"
[[couplings]]
kind = "spring"
between = ["puck", "a"]
stiffness = 2
limit = "300 N mm"
[[couplings]]
kind = "damper"
between = ["a", "b"]
damping = 2
limit = 1
"#,
    );
    let tau = 2.0 * PI;
    let laws: Vec<Law> = world.couplings.iter().map(|coupling| coupling.law).collect();
    assert_eq!(
        laws,
        [
            Law::Wall { side: Side::Below, at: (-10f64).to_radians(), stiffness: 2.0, damping: 0.0 },
            Law::Detent { torque: 0.05, pitch: 0.1 * tau, phase: 0.0 },
            Law::Coulomb { torque: 0.005 },
            Law::Lugre {
                coulomb: 1.0,
                stribeck: 2.0,
                stribeck_velocity: tau / 60.0,
                bristle_stiffness: 3.0,
                bristle_damping: 4.0,
                viscous: 5.0
            },
            Law::Constant { torque: -0.1 },
            Law::Spring { stiffness: 2.0, rest: 0.0 },
            Law::Damper { damping: Damping::Fixed(2.0) },
        ]
    );
    let limits: Vec<Option<f64>> = world.couplings.iter().map(|coupling| coupling.limit).collect();
    assert_eq!(limits, [None, None, None, None, None, Some(0.3), Some(1.0)]);
    assert_eq!((world.couplings[4].first, world.couplings[4].second), (End::Body(0), End::Body(1)));
}

#[test]
fn bodies_couplings_and_scenarios_keep_the_order_of_the_file() {
    let world = read(
        r#"
[scenarios.z.hand]
kind = "step"
to = 1
[scenarios.a]
duration = 1
hand = { kind = "step", to = 1 }
[bodies.second]
inertia = 1
[scenarios.z]
duration = 1
[bodies.first]
inertia = 2
[loop]
period = 1
[device]
inertia = 1
"#,
    );
    assert_eq!(world.names, ["second", "first"]);
    let names: Vec<&str> = world.scenarios.iter().map(|scenario| scenario.name.as_str()).collect();
    assert_eq!(names, ["a", "z"], "a table stands where its own header does");
}

#[test]
fn whole_numbers_may_be_written_as_floats_and_in_other_bases() {
    let world =
        read("loop = { period = 1, window = 0x20, advance = 3.0 }\ndevice = { inertia = 1, encoder = 4_000.0 }");
    assert_eq!((world.sampling.window, world.sampling.advance, world.device.encoder), (32, 3, Some(4000.0)));
}

#[test]
fn a_body_may_be_compensated_to_ground_for_all_its_springs_but_the_puck_only_for_those_between() {
    let world = |damper: &str| {
        let text = format!(
            "{LEAST}bodies.w.inertia = 1\ncouplings = [{{ kind = \"spring\", between = [\"w\", \"puck\"], stiffness = 1 }}, \
             {{ kind = \"damper\", between = {damper}, damping = \"compensating\" }}]"
        );
        World::read(&Source::from_text("w", text), &[])
    };
    for damper in ["[\"puck\", \"w\"]", "[\"w\", \"puck\"]", "[\"w\", \"ground\"]", "[\"ground\", \"w\"]"] {
        assert!(world(damper).is_ok(), "{damper}");
    }
    assert!(world("[\"puck\", \"ground\"]").is_err());
}

#[test]
fn limits_are_inclusive() {
    let bodies: String = (0..32).map(|index| format!("bodies.b{index}.inertia = 1\n")).collect();
    let couplings = "[[couplings]]\nkind = \"constant\"\nbetween = [\"puck\", \"ground\"]\ntorque = 1\n".repeat(64);
    let world = least_with(&format!("{bodies}{couplings}"));
    assert_eq!((world.bodies.len(), world.couplings.len()), (32, 64));
    // 10^10 samples: t = 0 to 9,999,999.999 s at 1 ms.
    let world = least_with("[scenarios.long]\nduration = 9999999.999\nhand = { kind = \"step\", to = 1 }");
    assert_eq!(world.scenarios[0].duration, 9_999_999.999);
    assert_eq!(
        read("loop = { period = 1, delay = 1e6, advance = 1000, window = 256 }\ndevice.inertia = 1").sampling.delay_s(),
        1e6
    );
}

#[test]
fn a_scenario_is_found_by_its_name_and_a_near_name_is_suggested() {
    let hand = "hand = { kind = \"step\", to = 1 }";
    let world = least_with(&format!("[scenarios.push]\nduration = 1\n{hand}\n[scenarios.hold]\nduration = 1\n{hand}"));
    assert_eq!(world.scenario("push").map(|scenario| scenario.duration), Ok(1.0));
    let message = |name: &str| world.scenario(name).unwrap_err().to_string();
    assert_eq!(message("psuh"), "the world has no scenario \"psuh\"; did you mean \"push\"?");
    assert_eq!(message("swing"), "the world has no scenario \"swing\"; it has \"push\" and \"hold\"");
    assert_eq!(
        least_with("").scenario("x").unwrap_err().to_string(),
        "the world has no scenario \"x\"; it has none at all"
    );
}

#[test]
fn path_files_are_read_beside_the_world_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.csv"), "time_s,puck_deg\n0,0\n1,180\n").unwrap();
    std::fs::write(folder.path().join("t.csv"), "time_s,torque_mNm\n0,7\n").unwrap();
    let text = format!(
        "{LEAST}[scenarios.p]\nduration = 1\nhand = {{ kind = \"path\", file = \"p.csv\" }}\n\
         [scenarios.t]\nduration = 1\nhand = {{ kind = \"torque\", moves = {{ kind = \"path\", file = \"t.csv\" }} }}\n"
    );
    let file = folder.path().join("w.toml");
    std::fs::write(&file, text).unwrap();
    let world = World::read(&Source::open(&file).unwrap(), &[]).unwrap();
    let path = |file: &str, points: &[(f64, f64)]| Shape::Path { file: file.to_string(), points: points.to_vec() };
    assert_eq!(world.scenarios[0].hand.drive, Drive::Position(path("p.csv", &[(0.0, 0.0), (1.0, PI)])));
    assert_eq!(world.scenarios[1].hand.drive, Drive::Torque(path("t.csv", &[(0.0, 0.007)])));
}

#[test]
fn a_delay_in_samples_follows_the_period_and_one_in_seconds_stays() {
    let delayed = |delay: &str, sets: &[&str]| {
        let text = format!("loop = {{ period = \"2 ms\", delay = {delay} }}\ndevice.inertia = 1");
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        World::read(&Source::from_text("w", text), &sets).map(|world| world.sampling)
    };
    let seconds = |delay: &str, sets: &[&str]| delayed(delay, sets).unwrap().delay_s();
    assert_eq!(seconds("\"1.5 samples\"", &[]), 3e-3);
    assert_eq!(seconds("\"1.5 samples\"", &["loop.period=4 ms"]), 6e-3);
    assert_eq!(seconds("\"3 ms\"", &["loop.period=4 ms"]), 3e-3);
    assert_eq!(seconds("0", &["loop.delay=2.5samples"]), 5e-3);
    assert_eq!(delayed("\"1 sample\"", &[]).unwrap().delay, hapt_model::Delay::Samples(1.0));
    for (key, value) in [
        ("period", "2 samples"),
        ("cutoff", "2 samples"),
        ("delay", "-1 samples"),
        ("delay", "1e7 samples"),
        ("delay", "samples"),
    ] {
        let refused = delayed("0", &[&format!("loop.{key}={value}")]);
        assert!(refused.is_err(), "{key} = {value}");
    }
}

#[test]
fn a_delay_in_samples_is_listed_as_written_and_in_seconds() {
    let source = Source::from_text("w", "loop = { period = 0.004, delay = \"2.5 samples\" }\ndevice.inertia = 1");
    let list = hapt_model::parameters(&source, &[]).unwrap();
    let delay = list.iter().find(|parameter| parameter.path == "loop.delay").unwrap();
    assert_eq!((delay.written.as_str(), delay.si, delay.unit.as_str()), ("2.5 samples", Some(0.01), "s"));
}
