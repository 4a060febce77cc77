//! Mistakes about device, handle, bodies and couplings.

use hapt_testing::prelude::*;

use super::{LEAST, check, read};

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
        (
            "device = { inertia = 1, gravity = { torque = 1 } }\ncompensation = [{ of = \"gravity\", share = 1.2 }]",
            "compensation.0.share: 1.2 is above 1; expected a plain number of 0 to 1, such as \"1\"",
        ),
        (
            "device = { inertia = 1, gravity = { torque = 1 } }\ncompensation = [{ of = \"cogging\" }]",
            "compensation.0.of: the device has no cogging to take back; expected a table [device.cogging]",
        ),
        (
            "device = { inertia = 1, gravity = { torque = 1 } }\ncompensation = [{ of = \"gravity\" }, { of = \"gravity\", share = 0.5 }]",
            "compensation.1.of: gravity is compensated already; expected one share of it",
        ),
        (
            "device = { inertia = 1 }\ncompensation = [{ of = \"friction\", velocity = 1 }]",
            "compensation.0.of: the device has no friction to take back; expected device.friction above 0, of both directions and at every position",
        ),
        (
            "device = { inertia = 1, friction = 1 }\ncompensation = [{ of = \"friction\" }]",
            "compensation.0.velocity: missing; expected an angular velocity (rad/s) above 0, such as \"90 deg/s\"",
        ),
        (
            "device = { inertia = 1, gravity = { torque = 1 } }\ncompensation = [{ of = \"gravity\", velocity = 1 }]",
            "compensation.0.velocity: gravity has no velocity: only friction has one",
        ),
        (
            "device = { inertia = 1 }\ncompensation = [{ of = \"inertia\" }]",
            "compensation.0.cutoff: missing; expected a frequency (Hz) above 0, such as \"50 Hz\"",
        ),
        (
            "device = { inertia = 1 }\ncompensation = [{ of = \"inertia\", cutoff = \"2 kHz\" }]",
            "compensation.0.cutoff: 2000 Hz is above the sampling rate; expected 1 Hz at most, since samples show nothing faster",
        ),
        (
            "device = { inertia = 1, friction = 1 }\ncompensation = [{ of = \"friction\", velocity = 1, cutoff = 5 }]",
            "compensation.0.cutoff: friction has no cutoff: only inertia has one",
        ),
        ("motion = \"spherical\"", "motion: \"spherical\" is not known here; expected \"rotary\" or \"linear\""),
        ("title = 5", "title: 5 is a number; expected text in quotes"),
        (
            "period = 1",
            "period: unknown key here; it belongs in loop; \
             the top of the file takes title, motion, loop, device, bodies, couplings, compensation, safety, scenarios",
        ),
        ("devise.inertia = 1", "devise: unknown key; did you mean \"device\"?"),
    ];
    check(&table, |given| format!("{given}\n[loop]\nperiod = 1\n"));
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
                 device.damping, device.friction, device.friction_backward, device.lag",
            ),
            (
                "[device.handle]\ninertia = 1\nstiffness = 1\nlength = 1",
                "device.handle.length: unknown key; device.handle takes inertia, stiffness, damping",
            ),
            (
                "[device.handle]\ninertia = 1\nstiffness = 1\n[bodies.handle]\ninertia = 1",
                "bodies.handle: the columns of this name are those of [device.handle]; the body needs another name",
            ),
            (
                "friction = 0.01\n[device.handle]\ninertia = 1\nstiffness = 2e9",
                "device.handle.stiffness: the shaft swings 126 rad in a period, and beside device.friction at most 100 are simulated; \
                 leave [device.handle] out and add its inertia to device.inertia: to this loop such a shaft is rigid",
            ),
            (
                "friction_backward = 0.01\n[device.handle]\ninertia = 1\nstiffness = 2e9",
                "device.handle.stiffness: the shaft swings 126 rad in a period, and beside device.friction at most 100 are simulated; \
                 leave [device.handle] out and add its inertia to device.inertia: to this loop such a shaft is rigid",
            ),
            ("[device.handle]\ninertia = 1\nstiffness = 2e9", "(it reads)"),
            (
                "friction_backward = \"-1 N mm\"",
                "device.friction_backward: \"-1 N mm\" is negative; expected a torque (N m) of 0 or more, such as \"5 N mm\"",
            ),
            ("friction_backward = \"1 N mm ± 20 %\"", "(it reads)"),
            (
                "friction = 0.01\n[device.friction_by_position]\nshare = 0.5\npitch = \"1 rev\"",
                "device.friction_by_position.sine: missing; expected an array of 1 to 4 plain numbers from -1000 to 1000, such as [0.5, -1]",
            ),
            (
                "[device.friction_by_position]\nshare = 0.3\npitch = \"1 rev\"\nsine = [3.0, 0.0, 0.5]\ncosine = [4.0]",
                "device.friction_by_position.share: 0.3 takes friction below 0 at some positions: the sizes of the harmonics, the roots of sine² + \
                 cosine², add up to 5.5; expected a share of 0.18181818181818182 at most",
            ),
            (
                "friction = 1e7\n[device.friction_by_position]\nshare = 1\npitch = 1e-3\nsine = [1]",
                "device.friction_by_position.share: where friction changes with the position the puck swings or decays by 501 rad in a period, and at \
                 most 100 are simulated; expected a smaller share, a longer pitch, or a shorter loop.period",
            ),
            (
                "friction = 0.01\n[device.friction_by_position]\nshare = 1\npitch = \"1 rev\"\nphase = \"90 deg\"\ncosine = [0.5, 0.5]",
                "(it reads)",
            ),
            (
                "[device.stribeck]\ntorque = 1",
                "device.stribeck.velocity: missing; expected an angular velocity (rad/s) above 0, such as \"90 deg/s\"",
            ),
            (
                "[device.stribeck]\ntorque = 1\nvelocity = 0",
                "device.stribeck.velocity: 0 is not above 0; expected an angular velocity (rad/s) above 0, such as \"90 deg/s\"",
            ),
            (
                "[device.stribeck]\ntorque = -1\nvelocity = 1",
                "device.stribeck.torque: -1 is negative; expected a torque (N m) of 0 or more, such as \"5 N mm\"",
            ),
            (
                "[device.stribeck]\ntorque = \"1 N m ± 20 %\"\nvelocity = 1",
                "device.stribeck.torque: \"1 N m ± 20 %\" has a tolerance, which only these take: device.inertia, \
                 device.damping, device.friction, device.friction_backward, device.lag",
            ),
            (
                "[device.stribeck]\ntorque = 1\nvelocity = 1\ncoulomb = 1",
                "device.stribeck.coulomb: unknown key here; it belongs in couplings.*; device.stribeck takes torque, velocity",
            ),
            (
                "[device.stribeck]\ntorque = 1e6\nvelocity = 1",
                "device.stribeck.velocity: a slow puck speeds up, swings or decays by 2000 rad in a period, and at most 100 are simulated; \
                 expected a larger velocity, or a shorter loop.period",
            ),
            ("[device.stribeck]\ntorque = \"2 N mm\"\nvelocity = \"1 rad/s\"", "(it reads)"),
            (
                "[device.stops]\nstiffness = 1",
                "device.stops.high: low and high are both missing; expected one of them at least, such as high = \"60 deg\"",
            ),
            (
                "[device.stops]\nhigh = 1",
                "device.stops.stiffness: missing; expected a torsional stiffness (N m/rad) above 0, such as \"20 N mm/deg\"",
            ),
            (
                "[device.stops]\nlow = \"5 deg\"\nhigh = \"20 deg\"\nstiffness = 1",
                "device.stops.low: the puck starts at 0, which is in this stop; expected 0 or less",
            ),
            (
                "[device.stops]\nhigh = \"-20 deg\"\nstiffness = 1",
                "device.stops.high: the puck starts at 0, which is in this stop; expected 0 or more",
            ),
            (
                "[device.stops]\nhigh = 1\nstiffness = 0",
                "device.stops.stiffness: 0 is not above 0; expected a torsional stiffness (N m/rad) above 0, such as \"20 N mm/deg\"",
            ),
            (
                "[device.stops]\nhigh = 1\nstiffness = 1\ndamping = -1",
                "device.stops.damping: -1 is negative; expected a torsional damping (N m s/rad) of 0 or more, such as \"1.2e-3 N m s/rad\"",
            ),
            (
                "[device.stops]\nhigh = 1\nstiffness = 1e10",
                "device.stops.stiffness: in a stop the puck swings or decays by 200 rad in a period, and at most 100 are simulated; \
                 expected a smaller stiffness, or a shorter loop.period",
            ),
            (
                "[device.stops]\nhigh = 1\nstiffness = 1\ndamping = 1e6",
                "device.stops.damping: in a stop the puck swings or decays by 2000 rad in a period, and at most 100 are simulated; \
                 expected a smaller damping, or a shorter loop.period",
            ),
            ("[device.stops]\nlow = \"-60 deg\"\nstiffness = \"30 N m/rad\"", "(it reads)"),
        ],
        |given| format!("[loop]\nperiod = \"2 ms\"\n[device]\ninertia = 1\n{given}\n"),
    );
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
            "couplings.0.kind: missing; expected \"spring\", \"damper\", \"wall\", \"detent\", \"dead-band\", \"magnet\", \"texture\", \"friction\", \"integral\", \"assist\", \"acceleration\" or \"constant\"",
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
            "couplings.0.rest: not a key of kind \"wall\" but of \"spring\", \"dead-band\" or \"integral\"; \
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
            "kind = \"integral\"\nbetween = [\"wheel\", \"ground\"]\nstiffness = 1",
            "couplings.0.between: an integral term acts between \"puck\" and \"ground\" only",
        ),
        (
            "kind = \"assist\"\nbetween = [\"puck\", \"wheel\"]\ntorque = 1\nvelocity = 1",
            "couplings.0.between: an assist acts between \"puck\" and \"ground\" only",
        ),
        (
            "kind = \"integral\"\nbetween = [\"puck\", \"ground\"]\nstiffness = 1\ntime = 0",
            "couplings.0.time: 0 is not above 0; expected a time (s) above 0, such as \"1 ms\"",
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
            "couplings.0.limit: not a key of kind \"detent\" but of \"spring\", \"damper\", \"wall\", \"dead-band\", \"integral\" or \"acceleration\"; \
             \"detent\" takes kind, between, torque, pitch, phase",
        ),
    ];
    check(&table, |given| format!("{LEAST}bodies.wheel.inertia = 1\n[[couplings]]\n{given}\n"));
    let couplings = "[[couplings]]\nkind = \"constant\"\n".repeat(65);
    check(&[(&couplings, "couplings: 65 couplings are too many: the limit is 64")], |given| format!("{LEAST}{given}"));
}

/// A world whose friction changes by these numbers.
fn changing(share: f64, sine: &[f64], cosine: &[f64]) -> String {
    let waveform = format!("share = {share:?}\npitch = 1\nsine = {sine:?}\ncosine = {cosine:?}");
    format!("loop.period = 1e-3\n[device]\ninertia = 1\n[device.friction_by_position]\n{waveform}\n")
}

proptest! {
    #![proptest_config(hapt_testing::cases(1000))]

    /// Friction just touches 0 there.
    #[test]
    fn the_largest_share_that_a_message_names_is_taken(
        sine in prop::collection::vec(-1000.0_f64..1000.0, 1..=4), cosine in prop::collection::vec(-1.0_f64..1.0, 1..=4),
    ) {
        let message = read(&changing(1e9, &sine, &cosine)).unwrap_err().to_string();
        let named = message.split("expected a share of ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
        let most: f64 = named.parse().unwrap();
        prop_assert!(read(&changing(most, &sine, &cosine)).is_ok(), "{}", most);
        prop_assert!(read(&changing(most * (1.0 + 1e-6), &sine, &cosine)).is_err(), "{}", most);
    }

    #[test]
    fn sizes_that_add_up_to_one_in_decimals_leave_a_whole_share(cuts in prop::collection::vec(0_u32..=1000, 3)) {
        let mut cuts = [cuts, vec![0, 1000]].concat();
        cuts.sort_unstable();
        let sine: Vec<f64> = cuts.windows(2).map(|pair| f64::from(pair[1] - pair[0]) / 1000.0).collect();
        prop_assert!(read(&changing(1.0, &sine, &[0.0])).is_ok(), "{:?}", sine);
    }
}
