//! Mistakes about time: the loop, its uneven samples, timings and recordings.

use super::check;
use hapt_core::{SafetyProfile, WhenLate};
use hapt_model::{Source, World};

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
        (
            "period = 1\nbodies_every = 0",
            "loop.bodies_every: 0 is out of range; expected a whole number from 1 to 1000",
        ),
        (
            "period = 1\nmethod = \"foh\"\nbodies_every = 2",
            "loop.bodies_every: 2 samples a step go with the methods that hold the puck over it, and \"foh\" does not",
        ),
        (
            "period = 1\nadvance = 1\nbodies_every = 2",
            "loop.bodies_every: 2 samples a step go without loop.advance; expected 1",
        ),
        (
            "period = 1\nbodies_every = 2",
            "loop.bodies_every: 2 samples a step, and this world has no bodies; expected 1",
        ),
        ("period = 1\nwindow = 257", "loop.window: 257 is out of range; expected a whole number from 1 to 256"),
        ("period = 1\nevery = 257", "loop.every: 257 is out of range; expected a whole number from 1 to 256"),
        ("period = 1\nevery = 0", "loop.every: 0 is out of range; expected a whole number from 1 to 256"),
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
            "period = 1\nestimator = \"kalman\"",
            "loop.cutoff: missing; expected a frequency (Hz) above 0, such as \"50 Hz\"",
        ),
        (
            "period = 1\nestimator = \"levant\"\ncutoff = 50",
            "loop.acceleration: missing; expected an angular acceleration (rad/s^2) above 0, such as \"10 rad/s^2\"",
        ),
        (
            "period = 1\nacceleration = \"50 rad/s\"",
            "loop.acceleration: \"50 rad/s\" is an angular velocity (rad/s); expected an angular acceleration (rad/s^2), such as \"10 rad/s^2\"",
        ),
        (
            "period = 1\ncutoff = \"50 rad/s\"",
            "loop.cutoff: \"50 rad/s\" is an angular velocity (rad/s); expected a frequency (Hz), such as \"50 Hz\"",
        ),
        (
            "period = 1\nfilter = \"0 Hz\"",
            "loop.filter: \"0 Hz\" is not above 0; expected a frequency (Hz) above 0, such as \"50 Hz\"",
        ),
        (
            "period = 0.01\nrecentre = \"15 ms\"",
            "loop.recentre: 0.015 s is below two periods, and the origin slips in many samples; expected 0.02 s or more",
        ),
        (
            "period = 0.01\nrecentre = \"1 s\"\n[device.motor]\nratio = 2\nfriction = 0.01\n[device.friction_by_position]\nshare = 1\npitch = \"1 rev\"\nsine = [1]",
            "loop.recentre: the origin slips under torques within the device's friction, and at some positions it has none; expected a smaller \
             device.friction_by_position.share",
        ),
        (
            "period = 0.01\nrecentre = \"1 s\"",
            "loop.recentre: the origin slips under torques within the device's friction, and it has none; expected device.friction",
        ),
        (
            "period = 1\nrecentre = \"10 s\"\n[[compensation]]\nof = \"gravity\"\n[device.gravity]\ntorque = 1",
            "loop.recentre: a [[compensation]] counts from the device's own position, and the origin would slip away from it; expected one of both",
        ),
        (
            "period = 1\nrecentre = \"10 s\"\n[[couplings]]\nkind = \"constant\"\nbetween = [\"puck\", \"ground\"]\ntorque = 1",
            "loop.recentre: the origin slips to where the torque of springs, walls and detents is 0, and a constant torque at the puck would carry it along; expected one of both",
        ),
        ("period = 1\npreiod = 1", "loop.preiod: unknown key; did you mean \"period\"?"),
        (
            "period = 1\ncolour = 1",
            "loop.colour: unknown key; loop takes period, method, output, advance, bodies_every, delay, delay_max, interval_max, filter, recentre, estimator, cutoff, acceleration, every, window",
        ),
        (
            "period = 1\ninertia = 1",
            "loop.inertia: unknown key here; it belongs in device; \
             loop takes period, method, output, advance, bodies_every, delay, delay_max, interval_max, filter, recentre, estimator, cutoff, acceleration, every, window",
        ),
    ];
    check(&table, |given| format!("[loop]\n{given}\n[device]\ninertia = 1\n"));
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
                 device.friction, device.friction_backward, device.lag",
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
            // The value of the key in 0.1.0.
            ("\"5 ms\"", &format!("safety.late: \"5 ms\" is a time, which safety.stall takes; {late}")),
            ("0.005", &format!("safety.late: 0.005 is a time, which safety.stall takes; {late}")),
            ("true", &format!("safety.late: true is a boolean; {late}")),
        ],
        |given| format!("[loop]\nperiod = \"2 ms\"\n[device]\ninertia = 1\n[safety]\nlate = {given}\n"),
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
    // No fault within the certified times.
    assert_eq!(limits(&["loop.interval_max=3 ms"], false).stall, 5e-3);
    assert!((limits(&["loop.interval_max=30 ms"], false).stall - 29e-3).abs() < 1e-12);
    assert_eq!(limits(&["loop.interval_max=30 ms", "safety.stall=2 ms"], false).stall, 2e-3);
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
    let message = |csv: &str| read(csv).unwrap_err().lines().take(2).collect::<Vec<_>>().join("");
    assert_eq!(
        message("time_s\n0\n0.002\n0.0015\n"),
        "scenarios.a.timing.file: 0.0015 s does not come after 0.002 s; times must increase --> t.csv:4:1"
    );
    assert_eq!(
        message("time_s\n0\n0.005\n"),
        "scenarios.a.timing.file: an interval of 0.005 s is beyond the longest that the loop states, 0.004 s; a larger loop.interval_max \
         would allow it --> t.csv:3:1"
    );
    assert_eq!(
        message("time_s,delay_s\n0,0.002\n"),
        "scenarios.a.timing.file: a delay of 0.002 s is not between loop.delay, 0.0 s, and loop.delay_max, 0.001 s --> t.csv:2:1"
    );
    assert_eq!(
        message("time_s\n0\n0.002\n"),
        "scenarios.a.timing.file: the recording lasts 0.002 s, and the scenario 0.006 s; a duration of 0.002 s is the longest --> w.toml:6:38"
    );
    assert!(message("time\n0\n").starts_with("scenarios.a.timing.file: a recording of samples begins with its header"));
    assert!(message("time_s\n0\n").starts_with("scenarios.a.timing.file: the file ends here"));
    assert!(message("time_s\n0\nx\n").contains("is not finite numbers"));
}
