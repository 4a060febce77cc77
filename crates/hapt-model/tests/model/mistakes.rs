//! One of each kind of mistake, and what is said about it.

use hapt_core::{SafetyProfile, WhenLate};
use hapt_model::{ErrorKind, Source, World};

const LEAST: &str = "loop = { period = \"1 ms\" }\ndevice = { inertia = 1 }\n";

fn read(text: &str) -> Result<World, hapt_model::Error> {
    World::read(&Source::from_text("w.toml", text), &[])
}

#[track_caller]
fn whole(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

#[track_caller]
fn check(table: &[(&str, &str)], world: impl Fn(&str) -> String) {
    let mut wrong = String::new();
    for (given, message) in table {
        let text = world(given);
        let said = match read(&text) {
            Ok(_) => "(it reads)".to_string(),
            Err(error) => error.to_string().lines().next().unwrap_or_default().to_string(),
        };
        if said != *message {
            wrong += &format!("\n{given}\n    said:   {said}\n    wanted: {message}");
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn a_wrong_dimension_names_both_and_shows_the_place() {
    assert_eq!(
        whole("[loop]\nperiod    = \"1 kg\" # here\n"),
        "loop.period: \"1 kg\" is a mass (kg); expected a time (s), such as \"1 ms\"\n \
         --> w.toml:2:13\n  |\n2 | period    = \"1 kg\" # here\n  |             ^^^^^^"
    );
}

#[test]
fn a_missing_key_is_shown_at_its_tables_header() {
    assert_eq!(
        whole("[loop]\nmethod = \"zoh\"\n"),
        "loop.period: missing; expected a time (s) above 0, such as \"1 ms\"\n --> w.toml:1:1\n  |\n1 | [loop]\n  | ^^^^^^"
    );
    assert_eq!(
        whole(&format!(
            "{LEAST}[[couplings]]\nkind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nat = 0\nstiffness = 1\n"
        )),
        "couplings.0.side: missing; expected \"above\" or \"below\"\n --> w.toml:3:1\n  |\n3 | [[couplings]]\n  | ^^^^^^^^^^^^^"
    );
    assert_eq!(
        whole(""),
        "loop.period: missing; expected a time (s) above 0, such as \"1 ms\"\n --> w.toml:1:1\n  |\n1 |\n  | ^"
    );
}

#[test]
fn text_that_is_not_toml_is_shown_in_the_same_way() {
    let error = read("[loop]\nperiod = 1 ms\n").unwrap_err();
    assert_eq!(error.kind, ErrorKind::Syntax);
    assert_eq!(
        error.to_string(),
        "not TOML: text and quantities stand in straight quotes, such as \"1 ms\"\n \
         --> w.toml:2:10\n  |\n2 | period = 1 ms\n  |          ^^^^"
    );
    assert_eq!(
        whole("[loop]\nperiod = 1\nperiod = 2\n").lines().next(),
        Some("not TOML: duplicate key; a key or a table is given once")
    );
}

#[test]
fn timings() {
    let table = [
        (
            "kind = \"pattern\", intervals = [1, 2.5]",
            "scenarios.a.timing.intervals: an interval of 0.005 s is beyond the longest that the loop states, 0.004 s; a larger \
             loop.interval_max would allow it",
        ),
        (
            "kind = \"pattern\", intervals = [1, 0]",
            "scenarios.a.timing.intervals: 0.0 is not above 0; intervals are in periods",
        ),
        (
            "kind = \"pattern\", intervals = [1, 0.25], delays = [0.5]",
            "scenarios.a.timing.delays: the next sample would be taken after 0.0005 s, before the command arrives after 0.001 s; no \
             interval is shorter than the delay before it",
        ),
        (
            "kind = \"pattern\", intervals = [1], delays = [0.75]",
            "scenarios.a.timing.delays: a delay of 0.0015 s is not between loop.delay, 0.0 s, and loop.delay_max, 0.001 s",
        ),
        (
            "kind = \"pattern\", intervals = [1, 1, 1], delays = [0, 0]",
            "scenarios.a.timing.delays: 2 delays for 3 intervals; expected one, or as many",
        ),
        (
            "kind = \"random\", shortest = \"5 ms\"",
            "scenarios.a.timing.shortest: 0.005 s is above loop.interval_max, 0.004 s",
        ),
        (
            "kind = \"recorded\", file = \"../a.csv\"",
            "scenarios.a.timing.file: \"../a.csv\" leads out of the world file's folder; a file that a world names must be in that folder \
             or below it",
        ),
    ];
    check(&table, |timing| {
        format!(
            "loop = {{ period = \"2 ms\", interval_max = \"4 ms\", delay_max = \"1 ms\" }}\ndevice = {{ inertia = 1 }}\n[scenarios.a]\n\
             duration = 1\nhand = {{ kind = \"step\", to = 1 }}\ntiming = {{ {timing} }}\n"
        )
    });
}

#[test]
fn recordings_of_samples() {
    let read = |csv: &str| {
        let text = "loop = { period = \"2 ms\", interval_max = \"4 ms\", delay_max = \"1 ms\" }\ndevice = { inertia = 1 }\n[scenarios.a]\n\
                    duration = \"6 ms\"\nhand = { kind = \"step\", to = 1 }\ntiming = { kind = \"recorded\", file = \"t.csv\" }\n";
        let mut source = Source::from_text("w.toml", text);
        source.files.insert("t.csv".into(), csv.into());
        World::read(&source, &[]).map_err(|error| error.to_string())
    };
    let timing = read("# a run\ntime_s,delay_s\n5,0\n5.002,1e-3\n5.006,0\n").unwrap().scenarios[0].timing.clone();
    let samples = vec![(5.0, Some(0.0)), (5.002, Some(1e-3)), (5.006, Some(0.0))];
    assert_eq!(timing, hapt_model::Timing::Recorded { file: "t.csv".into(), samples });
    let said = |csv: &str| read(csv).unwrap_err().lines().take(2).collect::<Vec<_>>().join("");
    assert_eq!(
        said("time_s\n0\n0.002\n0.0015\n"),
        "scenarios.a.timing.file: 0.0015 s does not come after 0.002 s; times must increase --> t.csv:4:1"
    );
    assert_eq!(
        said("time_s\n0\n0.005\n"),
        "scenarios.a.timing.file: an interval of 0.005 s is beyond the longest that the loop states, 0.004 s; a larger loop.interval_max \
         would allow it --> t.csv:3:1"
    );
    assert_eq!(
        said("time_s,delay_s\n0,0.002\n"),
        "scenarios.a.timing.file: a delay of 0.002 s is not between loop.delay, 0.0 s, and loop.delay_max, 0.001 s --> t.csv:2:1"
    );
    assert_eq!(
        said("time_s\n0\n0.002\n"),
        "scenarios.a.timing.file: the recording lasts 0.002 s, and the scenario 0.006 s; a duration of 0.002 s is the longest --> w.toml:6:38"
    );
    assert!(said("time\n0\n").starts_with("scenarios.a.timing.file: a recording of samples begins with its header"));
    assert!(said("time_s\n0\n").starts_with("scenarios.a.timing.file: the file ends here"));
    assert!(said("time_s\n0\nx\n").contains("is not finite numbers"));
}

#[test]
fn uneven_time_and_tolerances() {
    let device = |given: &str| format!("[loop]\nperiod = \"2 ms\"\n[device]\n{given}\n");
    check(
        &[
            (
                "inertia = 1\ndamping = \"1 N m s/rad ± 120 %\"",
                "device.damping: \"1 N m s/rad ± 120 %\" has a tolerance beyond 100 %: the number could be negative",
            ),
            (
                "inertia = \"1 kg m^2 ± 100 %\"",
                "device.inertia: \"1 kg m^2 ± 100 %\" has a tolerance of 100 %: the number could be 0; expected less",
            ),
            (
                "inertia = 1\nfriction = \"5 ± 6 N mm\"",
                "device.friction: \"5 ± 6 N mm\" has a tolerance beyond 100 %: the number could be negative",
            ),
            (
                "inertia = 1\nfriction = \"5 N mm +- -20 %\"",
                "device.friction: \"5 N mm +- -20 %\" has the negative tolerance -20 %; expected 0 to 100 %",
            ),
            (
                "inertia = 1\nlag = \"1 ms ± some\"",
                "device.lag: \"1 ms ± some\" has a tolerance that does not read; expected one such as \"1 ms ± 20 %\"",
            ),
            (
                "inertia = 1\nlag = \"1 kg ± 20 %\"",
                "device.lag: \"1 kg\" is a mass (kg); expected a time (s), such as \"1 ms\"",
            ),
            (
                "inertia = 1\nlimit = \"1 N m ± 20 %\"",
                "device.limit: \"1 N m ± 20 %\" has a tolerance, which only these take: device.inertia, device.damping, \
                 device.friction, device.lag",
            ),
            (
                "inertia = 1\nlag = \"-1 ms\"",
                "device.lag: \"-1 ms\" is negative; expected a time (s) of 0 or more, such as \"1 ms\"",
            ),
        ],
        device,
    );
    check(
        &[
            (
                "interval_max = \"1.9 ms\"",
                "loop.interval_max: 0.0019 s is below loop.period, 0.002 s, which the samples have on average; expected 0.002 s or \
                 more",
            ),
            (
                "delay = \"1 sample\"\ndelay_max = \"1.5 ms\"",
                "loop.delay_max: 0.0015 s is below loop.delay, 0.002 s, which is the least delay; expected 0.002 s or more",
            ),
            ("delay_max = \"2e6 samples\"", "loop.delay_max: 2000000.0 samples are more than a million"),
        ],
        |given| format!("[loop]\nperiod = \"2 ms\"\n{given}\n[device]\ninertia = 1\n"),
    );
    let late = "expected \"fault\", \"fade\" or \"count\"";
    check(
        &[
            ("\"never\"", &format!("safety.late: \"never\" is not known here; {late}")),
            ("\"fades\"", "safety.late: \"fades\" is not known here; did you mean \"fade\"?"),
            // What the key took in 0.1.0.
            ("\"5 ms\"", &format!("safety.late: \"5 ms\" is a time, which safety.stall takes; {late}")),
            ("0.005", &format!("safety.late: 0.005 is a time, which safety.stall takes; {late}")),
            ("true", &format!("safety.late: true is a boolean; {late}")),
        ],
        |given| format!("[loop]\nperiod = \"2 ms\"\n[device]\ninertia = 1\n[safety]\nlate = {given}\n"),
    );
}

#[test]
fn handles() {
    check(
        &[
            (
                "[device.handle]\ninertia = 1",
                "device.handle.stiffness: missing; expected a torsional stiffness (N m/rad) above 0, such as \"20 N mm/deg\"",
            ),
            (
                "[device.handle]\nstiffness = 1",
                "device.handle.inertia: missing; expected an inertia (kg m^2) above 0, such as \"6.4e-4 kg m^2\"",
            ),
            ("handle = 1", "device.handle: 1 is a number; expected a table of keys"),
            (
                "[device.handle]\ninertia = 0\nstiffness = 1",
                "device.handle.inertia: 0 is not above 0; expected an inertia (kg m^2) above 0, such as \"6.4e-4 kg m^2\"",
            ),
            (
                "[device.handle]\ninertia = 1\nstiffness = \"1 N m\"",
                "device.handle.stiffness: \"1 N m\" is a torque (N m); expected a torsional stiffness (N m/rad), such as \"20 N mm/deg\"",
            ),
            (
                "[device.handle]\ninertia = 1\nstiffness = \"1 N m/rad ± 20 %\"",
                "device.handle.stiffness: \"1 N m/rad ± 20 %\" has a tolerance, which only these take: device.inertia, \
                 device.damping, device.friction, device.lag",
            ),
            (
                "[device.handle]\ninertia = 1\nstiffness = 1\nlength = 1",
                "device.handle.length: unknown key; device.handle takes inertia, stiffness, damping",
            ),
            (
                "[device.handle]\ninertia = 1\nstiffness = 1\n[bodies.handle]\ninertia = 1",
                "bodies.handle: the columns of this name are those of [device.handle]; the body needs another name",
            ),
        ],
        |given| format!("[loop]\nperiod = \"2 ms\"\n[device]\ninertia = 1\n{given}\n"),
    );
}

#[test]
fn times_that_the_file_does_not_state_are_not_enforced() {
    let limits = |sets: &[&str], board: bool| {
        let text = "loop.period = \"1 ms\"\ndevice.inertia = 1\n";
        let sets: Vec<String> = sets.iter().map(ToString::to_string).collect();
        let world = World::read(&Source::from_text("w.toml", text), &sets).unwrap();
        let profile = SafetyProfile::Certified;
        if board { world.board_limits(profile) } else { world.limits(profile) }
    };
    for board in [false, true] {
        let default = if board { WhenLate::Fault } else { WhenLate::Fade };
        let time = limits(&["safety.late=fault"], board).time;
        assert_eq!((time.interval, time.delay), (f64::INFINITY, f64::INFINITY));
        let stated = limits(&["loop.interval_max=1.8 ms"], board).time;
        assert_eq!((stated.interval, stated.delay, stated.when_late), (1.8e-3, f64::INFINITY, default));
        let stated = limits(&["loop.delay_max=0.4 samples", "safety.late=count"], board).time;
        assert_eq!((stated.interval, stated.delay, stated.when_late), (f64::INFINITY, 0.4e-3, WhenLate::Count));
    }
    // No fault within what is certified.
    assert_eq!(limits(&["loop.interval_max=3 ms"], false).stall, 5e-3);
    assert!((limits(&["loop.interval_max=30 ms"], false).stall - 29e-3).abs() < 1e-12);
    assert_eq!(limits(&["loop.interval_max=30 ms", "safety.stall=2 ms"], false).stall, 2e-3);
}

#[test]
fn the_loop() {
    let table = [
        ("period = \"0 s\"", "loop.period: \"0 s\" is not above 0; expected a time (s) above 0, such as \"1 ms\""),
        (
            "period = 1e-320",
            "loop.period: 1e-320 is below anything physical, 1e-30 in SI; expected a time (s) above 0, such as \"1 ms\"",
        ),
        (
            "period = \"1e31 s\"",
            "loop.period: \"1e31 s\" is beyond anything physical, 1e30 in SI; expected a time (s) above 0, such as \"1 ms\"",
        ),
        (
            "period = 1\ndelay = 1e-320",
            "loop.delay: 1e-320 is below anything physical, 1e-30 in SI; expected a time (s) of 0 or more, such as \"1 ms\", or a number of samples, such as \"1.5 samples\"",
        ),
        (
            "period = 1\ndelay = \"1.5 sampels\"",
            "loop.delay: \"1.5 sampels\" has the unknown unit \"sampels\"; did you mean \"samples\"?",
        ),
        ("period = -1", "loop.period: -1 is not above 0; expected a time (s) above 0, such as \"1 ms\""),
        ("period = \"5\"", "loop.period: \"5\" has no unit; expected a time (s), such as \"1 ms\""),
        ("period = true", "loop.period: true is a boolean; expected a time (s) above 0, such as \"1 ms\""),
        ("period = [1]", "loop.period: an array stands here; expected a time (s) above 0, such as \"1 ms\""),
        ("period = 1979-05-27", "loop.period: 1979-05-27 is a date; expected a time (s) above 0, such as \"1 ms\""),
        ("period = nan", "loop.period: nan is not a finite number; expected a time (s), such as \"1 ms\""),
        (
            "period = \"1e400 s\"",
            "loop.period: \"1e400 s\" is too large for a double; expected a time (s), such as \"1 ms\"",
        ),
        (
            "period = \"1 sec\"",
            "loop.period: \"1 sec\" has the unknown unit \"sec\"; the nearest known one is \"s\"; \
             expected a time (s), such as \"1 ms\"",
        ),
        ("period = 1\nmethod = \"zho\"", "loop.method: \"zho\" is not known here; did you mean \"zoh\"?"),
        (
            "period = 1\nmethod = \"verlet\"",
            "loop.method: \"verlet\" is not known here; expected \"forward-euler\", \"backward-euler\", \"semi-implicit-euler\", \
             \"trapezoidal\", \"zoh\", \"rk4\", \"tustin\" or \"foh\"",
        ),
        (
            "period = 1\nmethod = \"tustin\"\noutput = \"end\"",
            "loop.output: method \"tustin\" has its torque from x_k: the output is \"start\", not \"end\"",
        ),
        (
            "period = 1\nmethod = \"foh\"\nadvance = 1",
            "loop.advance: an advance goes with output \"end\" only, and the output is \"start\"",
        ),
        (
            "period = 1\noutput = \"middle\"\nadvance = 1",
            "loop.advance: an advance goes with output \"end\" only, and the output is \"middle\"",
        ),
        ("period = 1\nadvance = 1001", "loop.advance: 1001 is out of range; expected a whole number from 0 to 1000"),
        ("period = 1\nadvance = -1", "loop.advance: -1 is out of range; expected a whole number from 0 to 1000"),
        ("period = 1\nwindow = 257", "loop.window: 257 is out of range; expected a whole number from 1 to 256"),
        ("period = 1\nwindow = 0", "loop.window: 0 is out of range; expected a whole number from 1 to 256"),
        ("period = 1\nwindow = 2.5", "loop.window: 2.5 is not a whole number; expected a whole number from 1 to 256"),
        ("period = 1\nwindow = \"16\"", "loop.window: \"16\" is text; expected a whole number from 1 to 256"),
        ("period = 1\nwindow = 1e300", "loop.window: 1e300 is out of range; expected a whole number from 1 to 256"),
        ("period = 0.001\ndelay = \"1001 s\"", "loop.delay: 1001.0 s is more than a million periods of 0.001 s"),
        (
            "period = 1\ndelay = \"-1 ms\"",
            "loop.delay: \"-1 ms\" is negative; expected a time (s) of 0 or more, such as \"1 ms\", or a number of samples, such as \"1.5 samples\"",
        ),
        (
            "period = 1\nestimator = \"low-pass\"",
            "loop.cutoff: missing; expected a frequency (Hz) above 0, such as \"50 Hz\"",
        ),
        (
            "period = 1\ncutoff = \"50 rad/s\"",
            "loop.cutoff: \"50 rad/s\" is an angular velocity (rad/s); expected a frequency (Hz), such as \"50 Hz\"",
        ),
        ("period = 1\npreiod = 1", "loop.preiod: unknown key; did you mean \"period\"?"),
        (
            "period = 1\ncolour = 1",
            "loop.colour: unknown key; loop takes period, method, output, advance, delay, delay_max, interval_max, estimator, cutoff, window",
        ),
        (
            "period = 1\ninertia = 1",
            "loop.inertia: unknown key here; it belongs in device; \
             loop takes period, method, output, advance, delay, delay_max, interval_max, estimator, cutoff, window",
        ),
    ];
    check(&table, |given| format!("[loop]\n{given}\n[device]\ninertia = 1\n"));
}

#[test]
fn the_device_and_the_top() {
    let table = [
        (
            "device.damping = 1",
            "device.inertia: missing; expected an inertia (kg m^2) above 0, such as \"6.4e-4 kg m^2\"",
        ),
        (
            "device.inertia = \"1 kg\"",
            "device.inertia: \"1 kg\" is a mass (kg); expected an inertia (kg m^2), such as \"6.4e-4 kg m^2\"",
        ),
        (
            "motion = \"linear\"\ndevice.inertia = \"1 kg m^2\"",
            "device.inertia: \"1 kg m^2\" is an inertia (kg m^2); expected a mass (kg), such as \"0.5 kg\"",
        ),
        (
            "device = { inertia = 1, limit = \"1 N m/rad\" }",
            "device.limit: \"1 N m/rad\" is a torsional stiffness (N m/rad); expected a torque (N m), such as \"5 N mm\"",
        ),
        (
            "device = { inertia = 1, levels = 8 }",
            "device.levels: levels divide the range of the motor: they need device.limit",
        ),
        (
            "device = { inertia = 1, limit = 1, levels = 7 }",
            "device.levels: 7 is odd; expected an even whole number from 2 to 4294967295",
        ),
        (
            "device = { inertia = 1, encoder = \"5 um\" }",
            "device.encoder: \"5 um\" is text; expected a whole number from 1 to 9007199254740992",
        ),
        (
            "motion = \"linear\"\ndevice = { inertia = 1, encoder = \"5 deg\" }",
            "device.encoder: \"5 deg\" is an angle (rad); expected a length (m), such as \"5 mm\"",
        ),
        ("device = 5", "device: 5 is a number; expected a table of keys"),
        ("motion = \"spherical\"", "motion: \"spherical\" is not known here; expected \"rotary\" or \"linear\""),
        ("title = 5", "title: 5 is a number; expected text in quotes"),
        (
            "period = 1",
            "period: unknown key here; it belongs in loop; \
             the top of the file takes title, motion, loop, device, bodies, couplings, safety, scenarios",
        ),
        ("devise.inertia = 1", "devise: unknown key; did you mean \"device\"?"),
    ];
    check(&table, |given| format!("{given}\n[loop]\nperiod = 1\n"));
}

#[test]
fn bodies() {
    let table = [
        ("puck.inertia = 1", "bodies: \"puck\" cannot name a body: it is taken, as are \"ground\" and \"measured\""),
        (
            "\"my wheel\".inertia = 1",
            "bodies: \"my wheel\" cannot name a body: a letter and then letters, digits, _ and - can",
        ),
        ("1.inertia = 1", "bodies: \"1\" cannot name a body: a letter and then letters, digits, _ and - can"),
        ("\"\".inertia = 1", "bodies: \"\" cannot name a body: a letter and then letters, digits, _ and - can"),
        (
            "w.position = 1",
            "bodies.w.inertia: missing; expected an inertia (kg m^2) above 0, such as \"6.4e-4 kg m^2\"",
        ),
        (
            "w.inertia = 0",
            "bodies.w.inertia: 0 is not above 0; expected an inertia (kg m^2) above 0, such as \"6.4e-4 kg m^2\"",
        ),
        (
            "w = { inertia = 1, velocity = \"1 rev\" }",
            "bodies.w.velocity: \"1 rev\" is an angle (rad); expected an angular velocity (rad/s), such as \"90 deg/s\"",
        ),
        ("w = 1", "bodies.w: 1 is a number; expected a table of keys"),
    ];
    check(&table, |given| format!("{LEAST}[bodies]\n{given}\n"));
    let bodies: String = (0..33).map(|index| format!("b{index}.inertia = 1\n")).collect();
    check(&[(&bodies, "bodies: 33 bodies are too many: the limit is 32")], |given| format!("{LEAST}[bodies]\n{given}"));
}

#[test]
fn couplings() {
    let table = [
        (
            "",
            "couplings.0.kind: missing; expected \"spring\", \"damper\", \"wall\", \"detent\", \"dead-band\", \"magnet\", \"texture\", \"friction\" or \"constant\"",
        ),
        ("kind = \"sprign\"", "couplings.0.kind: \"sprign\" is not known here; did you mean \"spring\"?"),
        (
            "kind = \"spring\"\nstiffness = 1",
            "couplings.0.between: missing; expected a pair of ends, such as [\"puck\", \"wheel\"]",
        ),
        (
            "kind = \"spring\"\nstiffness = 1\nbetween = [\"puck\"]",
            "couplings.0.between: an array of 1 stands here; expected a pair of ends, such as [\"puck\", \"wheel\"]",
        ),
        (
            "kind = \"spring\"\nstiffness = 1\nbetween = [\"puck\", 1]",
            "couplings.0.between: an end is text in quotes; expected a pair of ends, such as [\"puck\", \"wheel\"]",
        ),
        (
            "kind = \"spring\"\nstiffness = 1\nbetween = [\"puck\", \"whel\"]",
            "couplings.0.between: \"whel\" is not a body of this world; did you mean \"wheel\"?",
        ),
        (
            "kind = \"spring\"\nstiffness = 1\nbetween = [\"puck\", \"flap\"]",
            "couplings.0.between: \"flap\" is not a body of this world; an end is \"puck\", \"ground\" or \"wheel\"",
        ),
        (
            "kind = \"spring\"\nstiffness = 1\nbetween = [\"puck\", \"puck\"]",
            "couplings.0.between: both ends are \"puck\"; a coupling is between two different ones",
        ),
        (
            "kind = \"spring\"\nbetween = [\"puck\", \"wheel\"]\nstiffness = \"5 N m\"",
            "couplings.0.stiffness: \"5 N m\" is a torque (N m); expected a torsional stiffness (N m/rad), \
             such as \"20 N mm/deg\"",
        ),
        (
            "kind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nrest = 0",
            "couplings.0.rest: not a key of kind \"wall\" but of \"spring\" or \"dead-band\"; \
             \"wall\" takes kind, between, stiffness, damping, side, at, limit",
        ),
        (
            "kind = \"damper\"\nbetween = [\"puck\", \"ground\"]",
            "couplings.0.damping: missing; expected a torsional damping (N m s/rad) of 0 or more, \
             such as \"1.2e-3 N m s/rad\", or \"compensating\"",
        ),
        (
            "kind = \"damper\"\nbetween = [\"puck\", \"wheel\"]\ndamping = \"compensating\"",
            "couplings.0.damping: there is no spring between the puck and wheel to compensate",
        ),
        (
            "kind = \"damper\"\nbetween = [\"ground\", \"wheel\"]\ndamping = \"compensating\"",
            "couplings.0.damping: there is no spring at wheel to compensate",
        ),
        (
            "kind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nside = \"above\"\nat = 0\nstiffness = 1\ndamping = \"compensating\"",
            "couplings.0.damping: \"compensating\" does not begin with a finite number; \
             expected a torsional damping (N m s/rad), such as \"1.2e-3 N m s/rad\"",
        ),
        (
            "kind = \"detent\"\nbetween = [\"puck\", \"ground\"]\ntorque = 1\npitch = 0",
            "couplings.0.pitch: 0 is not above 0; expected an angle (rad) above 0, such as \"45 deg\"",
        ),
        (
            "kind = \"friction\"\nbetween = [\"puck\", \"ground\"]",
            "couplings.0.torque: friction has either torque (Coulomb) or all of coulomb, stribeck, stribeck_velocity, \
             bristle_stiffness, bristle_damping, viscous (LuGre)",
        ),
        (
            "kind = \"friction\"\nbetween = [\"puck\", \"ground\"]\ntorque = 1\nviscous = 1",
            "couplings.0.viscous: torque (Coulomb friction) and viscous (LuGre friction) do not go together",
        ),
        (
            "kind = \"friction\"\nbetween = [\"puck\", \"ground\"]\ncoulomb = 1\nstribeck = 1",
            "couplings.0.stribeck_velocity: missing; expected an angular velocity (rad/s) above 0, such as \"90 deg/s\"",
        ),
        (
            "kind = \"friction\"\nbetween = [\"puck\", \"wheel\"]\ncoulomb = 1\nstribeck = 1\nstribeck_velocity = 1\n\
             bristle_stiffness = 1\nbristle_damping = 0\nviscous = 0",
            "couplings.0.kind: LuGre friction at a body does not go with method \"zoh\"; \
             use \"forward-euler\", \"semi-implicit-euler\" or \"rk4\"",
        ),
        (
            "kind = \"spring\"\nbetween = [\"puck\", \"wheel\"]\nstiffness = 1\nlimit = 0",
            "couplings.0.limit: 0 is not above 0; expected a torque (N m) above 0, such as \"5 N mm\"",
        ),
        (
            "kind = \"detent\"\nbetween = [\"puck\", \"wheel\"]\ntorque = 1\npitch = 1\nlimit = 1",
            "couplings.0.limit: not a key of kind \"detent\" but of \"spring\", \"damper\", \"wall\" or \"dead-band\"; \
             \"detent\" takes kind, between, torque, pitch, phase",
        ),
    ];
    check(&table, |given| format!("{LEAST}bodies.wheel.inertia = 1\n[[couplings]]\n{given}\n"));
    let couplings = "[[couplings]]\nkind = \"constant\"\n".repeat(65);
    check(&[(&couplings, "couplings: 65 couplings are too many: the limit is 64")], |given| format!("{LEAST}{given}"));
}

#[test]
fn scenarios_and_hands() {
    let table = [
        (
            "hand = { kind = \"step\", to = 1 }",
            "scenarios.s.duration: missing; expected a time (s) above 0, such as \"1 ms\"",
        ),
        ("duration = 1", "scenarios.s.hand: missing; expected a table of keys"),
        (
            "duration = \"1 Ms\"\nhand = { kind = \"step\", to = 1 }",
            "scenarios.s.duration: \"1 Ms\" has the unknown unit \"Ms\"; the nearest known one is \"ms\"; \
             expected a time (s), such as \"1 ms\"",
        ),
        (
            "duration = \"1e7 s\"\nhand = { kind = \"step\", to = 1 }",
            "scenarios.s.duration: 10000000.0 s at a period of 0.001 s is 1.0000000001e10 samples; at most 1e10 are allowed",
        ),
        (
            "duration = 1\nhand = { to = 1 }",
            "scenarios.s.hand.kind: missing; expected \"step\", \"ramp\", \"sine\", \"path\", \"torque\" or \"grip\"",
        ),
        (
            "duration = 1\nhand = { kind = \"ramp\", to = 1 }",
            "scenarios.s.hand.over: missing; expected a time (s) above 0, such as \"1 ms\"",
        ),
        (
            "duration = 1\nhand = { kind = \"step\", to = 1, over = 1 }",
            "scenarios.s.hand.over: not a key of kind \"step\" but of \"ramp\"; \"step\" takes kind, release, to, at",
        ),
        (
            "duration = 1\nhand = { kind = \"step\", to = 1, release = -1 }",
            "scenarios.s.hand.release: -1 is negative; expected a time (s) of 0 or more, such as \"1 ms\"",
        ),
        (
            "duration = 1\nhand = { kind = \"torque\", to = 1 }",
            "scenarios.s.hand.to: not a key of kind \"torque\" but of \"step\" or \"ramp\"; \"torque\" takes kind, release, moves",
        ),
        ("duration = 1\nhand = { kind = \"torque\" }", "scenarios.s.hand.moves: missing; expected a table of keys"),
        (
            "duration = 1\nhand = { kind = \"torque\", moves = { kind = \"step\", to = \"45 deg\" } }",
            "scenarios.s.hand.moves.to: \"45 deg\" is an angle (rad); expected a torque (N m), such as \"5 N mm\"",
        ),
        (
            "duration = 1\nhand = { kind = \"grip\", moves = { kind = \"step\", to = \"1 N m\" } }",
            "scenarios.s.hand.moves.to: \"1 N m\" is a torque (N m); expected an angle (rad), such as \"45 deg\"",
        ),
        (
            "duration = 1\nhand = { kind = \"grip\", inertia = 0, moves = { kind = \"step\", to = 1 } }",
            "scenarios.s.hand.inertia: 0 is not above 0; expected an inertia (kg m^2) above 0, such as \"6.4e-4 kg m^2\"",
        ),
        (
            "duration = 1\nhand = { kind = \"grip\", moves = { kind = \"step\", to = 1, release = 1 } }",
            "scenarios.s.hand.moves.release: unknown key here; it belongs in scenarios.*.hand; \
             scenarios.s.hand.moves takes kind, to, at",
        ),
        (
            "duration = 1\nhand = { kind = \"grip\", moves = { kind = \"torque\" } }",
            "scenarios.s.hand.moves.kind: \"torque\" is not known here; expected \"step\", \"ramp\", \"sine\" or \"path\"",
        ),
        (
            "duration = 1\nhand = { kind = \"grip\", hold = 1, moves = { kind = \"step\", to = 1 } }",
            "scenarios.s.hand.hold: stands without open: a hand that opens and takes hold again has both",
        ),
        (
            "duration = 1\nhand = { kind = \"grip\", open = 1, moves = { kind = \"step\", to = 1 } }",
            "scenarios.s.hand.open: stands without hold: a hand that opens and takes hold again has both",
        ),
        (
            "duration = 1\nhand = { kind = \"grip\", hold = 0, open = 1, moves = { kind = \"step\", to = 1 } }",
            "scenarios.s.hand.hold: 0 is not above 0; expected a time (s) above 0, such as \"1 ms\"",
        ),
        (
            "duration = 1\nhand = { kind = \"grip\", hold = 1e-12, open = 1e-12, moves = { kind = \"step\", to = 1 } }",
            "scenarios.s.hand.hold: a hand that holds for 1e-12 s and opens for 1e-12 s takes hold 5e11 times in 1.0 s; at most \
             1e10 are allowed",
        ),
        (
            "duration = 1\nhand = { kind = \"path\", file = \"/etc/passwd\" }",
            "scenarios.s.hand.file: \"/etc/passwd\" leads out of the world file's folder; a file that a world names must be in that folder or below it",
        ),
        (
            "duration = 1\nhand = { kind = \"path\", file = \"no.csv\" }",
            "scenarios.s.hand.file: cannot read \"no.csv\" beside the world file: No such file or directory (os error 2)",
        ),
    ];
    check(&table, |given| format!("{LEAST}[scenarios.s]\n{given}\n"));
    check(&[("\"a b\"", "scenarios: \"a b\" cannot name a scenario: letters, digits, _ and - can")], |given| {
        format!("{LEAST}[scenarios.{given}]\nduration = 1\n")
    });
}

#[test]
fn a_mistake_in_a_path_file_is_shown_there() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.csv"), "time_s,puck_deg\n0,0\n0,1\n").unwrap();
    let text = format!("{LEAST}[scenarios.s]\nduration = 1\nhand = {{ kind = \"path\", file = \"p.csv\" }}\n");
    let source = Source { folder: folder.path().into(), ..Source::from_text("w.toml", text) };
    let shown = folder.path().join("p.csv").display().to_string();
    assert_eq!(
        World::read(&source, &[]).unwrap_err().to_string().replace(&shown, "p.csv"),
        "scenarios.s.hand.file: 0.0 s does not come after 0.0 s; times must increase\n --> p.csv:3:1\n  |\n3 | 0,1\n  | ^"
    );
}

#[test]
fn the_ways_of_other_systems_with_lines_do_not_move_the_caret() {
    assert_eq!(
        whole("\u{feff}[loop]\r\n\tperiod = \"1 kg\"\r\n").lines().skip(1).collect::<Vec<_>>(),
        [" --> w.toml:2:11", "  |", "2 |     period = \"1 kg\"", "  |              ^^^^^^"]
    );
}

#[test]
fn a_mistake_of_a_megabyte_makes_a_short_message() {
    let long = "x".repeat(1_000_000);
    for text in [
        format!("{long} = 1"),
        format!("loop.period = \"{long}\""),
        format!("loop.period = \"1 {long}\""),
        format!("loop.method = \"{long}\""),
        format!("title = {long}"),
        format!("loop.period = 1{}", "0".repeat(1_000_000)),
        format!("{LEAST}bodies.\"{long} \".inertia = 1"),
    ] {
        let message = whole(&text);
        assert!(message.len() < 2000, "{} bytes", message.len());
    }
    let error = read(&"#".repeat((1 << 20) + 1)).unwrap_err();
    assert_eq!(error.to_string(), "w.toml is larger than 1 MiB, the most that a world file may have");
}
