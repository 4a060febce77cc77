//! `check --json`: its shape, and its numbers where a closed form is known.

use std::f64::consts::TAU;
use std::path::Path;

use serde_json::Value;

use crate::common::{WHEEL, every_world, hapt, hapt_reads, near, shipped};

/// The `check` of a world: exit code and JSON.
fn checked(world: &str, args: &[&str]) -> (i32, Value) {
    let ended = hapt_reads(Path::new("."), world, ["check", "-", "--json"].iter().chain(args));
    assert_eq!(ended.err, "");
    (ended.code.unwrap(), serde_json::from_str(&ended.out).unwrap())
}

/// A virtual world without a device: this loop, and these bodies and couplings.
fn world(sampling: &str, rest: &str) -> String {
    format!("[loop]\n{sampling}\n[device]\ninertia = 1e-3\n{rest}")
}

/// A wheel of 1 kg m² on a spring to the puck, its damper to ground.
fn swing(name: &str, stiffness: f64, damping: &str) -> String {
    format!(
        "[bodies.{name}]\ninertia = 1\n\
         [[couplings]]\nkind = \"spring\"\nbetween = [\"{name}\", \"puck\"]\nstiffness = {stiffness:?}\n\
         [[couplings]]\nkind = \"damper\"\nbetween = [\"ground\", \"{name}\"]\ndamping = {damping}\n"
    )
}

#[track_caller]
fn keys(value: &Value, wanted: &[&str]) {
    let mut given: Vec<&str> = value.as_object().unwrap().keys().map(String::as_str).collect();
    let mut wanted = wanted.to_vec();
    given.sort_unstable();
    wanted.sort_unstable();
    assert_eq!(given, wanted);
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// (re, im, abs) of every eigenvalue.
fn eigenvalues(json: &Value) -> Vec<(f64, f64, f64)> {
    let list = json["held"]["eigenvalues"].as_array().unwrap();
    list.iter().map(|e| (number(&e["re"]), number(&e["im"]), number(&e["abs"]))).collect()
}

/// The fields that are printed today, and no others.
#[test]
fn the_fields_are_those_of_the_contract() {
    for path in every_world() {
        let ended = hapt(Path::new("."), ["check".as_ref(), path.as_os_str(), "--json".as_ref()]);
        let json: Value = serde_json::from_str(&ended.out).unwrap();
        keys(
            &json,
            &[
                "period_s",
                "method",
                "output",
                "held",
                "free",
                "passivity",
                "uneven",
                "quantisation",
                "remedies",
                "certified",
                "status",
                "theorems",
                "notes",
            ],
        );
        assert!(number(&json["period_s"]) > 0.0);
        assert!(json["method"].is_string() && json["output"].is_string());
        assert!(json["notes"].as_array().unwrap().iter().all(Value::is_string));

        let passivity = &json["passivity"];
        keys(
            passivity,
            &["required_damping", "device_damping", "at_hz", "passive", "speed_max", "proved", "not_proved"],
        );
        let enough = passivity["required_damping"].as_f64().is_some_and(|b| b <= number(&passivity["device_damping"]));
        assert!(passivity["passive"] == false || enough, "{json}");
        assert_eq!(passivity["proved"], passivity["not_proved"].as_array().unwrap().is_empty());
        keys(&json["quantisation"], &["max_stiffness", "ok"]);
        let uneven = &json["uneven"];
        keys(
            uneven,
            &[
                "interval_s",
                "interval_max_s",
                "delay_s",
                "lag_s",
                "required_damping",
                "passive",
                "speed_max",
                "proved",
                "not_proved",
                "free",
            ],
        );
        let patterns = &uneven["free"];
        keys(patterns, &["verdict", "by", "pattern", "reason"]);
        let grows = json["free"]["verdict"] == "unstable";
        assert!(["proved", "broken", "open"].iter().any(|verdict| patterns["verdict"] == *verdict), "{json}");
        assert!(!(grows && patterns["verdict"] == "proved"), "{json}");
        assert!(json["certified"] == false || patterns["verdict"] == "proved", "{json}");
        if patterns["verdict"] == "broken" {
            keys(&patterns["pattern"], &["intervals_s", "delays_s", "growth_per_s"]);
        }
        // Where a world states no times, uneven samples are its even ones.
        if number(&uneven["interval_max_s"]) > number(&json["period_s"]) {
            assert!(number(&uneven["required_damping"]) >= number(&passivity["required_damping"]), "{json}");
        } else {
            for key in ["required_damping", "passive", "proved", "not_proved"] {
                assert_eq!(uneven[key], passivity[key], "{key}");
            }
        }
        let mut names =
            vec!["device_damping", "ground_damping", "period_s", "delay_s", "advance", "output", "stiffness_scale"];
        // A stated bound can have another value.
        if number(&uneven["interval_max_s"]) > number(&json["period_s"]) {
            names.extend(["interval_max_s", "delay_max_s"]);
        }
        let own = |key: &&str| json["remedies"].get(key).is_some();
        names.extend(["estimator", "overspeed", "reasons"].into_iter().filter(own));
        keys(&json["remedies"], &names);
        let holds = |of: &str| json[of]["verdict"] != "unstable";
        assert!(json["certified"] == false || holds("held") && holds("free") && enough);
        let status = ["certified", "open", "refuted"].into_iter().find(|status| json["status"] == *status);
        assert_eq!(json["certified"], status.unwrap() == "certified");
        let claims =
            json["theorems"].as_array().unwrap().iter().flat_map(|theorem| theorem["claims"].as_array().unwrap());
        let claimed = |claim: &str| claims.clone().any(|made| made == claim);
        assert!(json["certified"] == false || ["held", "free", "passive"].into_iter().all(claimed), "{json}");
        if json["certified"] == true {
            assert_eq!((&json["remedies"]["advance"], &json["remedies"]["output"]), (&Value::Null, &Value::Null));
        }
        let without =
            hapt(Path::new("."), ["check".as_ref(), path.as_os_str(), "--json".as_ref(), "--no-remedies".as_ref()]);
        let without: Value = serde_json::from_str(&without.out).unwrap();
        assert_eq!((&without["remedies"], &without["certified"]), (&Value::Null, &json["certified"]));

        let held = &json["held"];
        let lists = ["eigenvalues", "modes"];
        let critical = ["critical_period_s", "critical_period_reason"];
        for part in [held, &json["free"]] {
            keys(part, &[&lists[..], &critical, &["spectral_radius", "growth_per_s", "verdict"]].concat());
        }
        for eigenvalue in held["eigenvalues"].as_array().unwrap() {
            keys(eigenvalue, &["re", "im", "abs"]);
            let (re, im) = (number(&eigenvalue["re"]), number(&eigenvalue["im"]));
            near(number(&eigenvalue["abs"]), re.hypot(im), 1e-14);
        }
        for mode in held["modes"].as_array().unwrap() {
            keys(mode, &["frequency_hz", "damping_ratio", "discrete_frequency_hz", "discrete_damping_ratio"]);
            assert!(mode.as_object().unwrap().values().all(|x| x.is_null() || x.is_f64()));
        }
        let radius = number(&held["spectral_radius"]);
        assert_eq!(radius, eigenvalues(&json).iter().fold(0.0, |most: f64, e| most.max(e.2)));
        match held["growth_per_s"].as_f64() {
            Some(growth) => {
                // The eigenvalues are those of a step of the bodies.
                let text = std::fs::read_to_string(&path).unwrap();
                let every = text.lines().find_map(|line| line.strip_prefix("bodies_every")?.split('=').nth(1));
                let every: f64 = every.map_or(1.0, |n| n.split('#').next().unwrap().trim().parse().unwrap());
                let wanted = radius.ln() / (every * number(&json["period_s"]));
                assert!((growth - wanted).abs() < 1e-12 / number(&json["period_s"]), "{growth:e} {wanted:e}");
            }
            None => assert!(held["growth_per_s"].is_null() && radius == 0.0),
        }
        let (period, reason) = (&held["critical_period_s"], &held["critical_period_reason"]);
        match reason.as_str() {
            None => assert!(reason.is_null() && number(period) > 0.0, "{held}"),
            Some(reason) => assert!(period.is_null() && ["never", "unbounded"].contains(&reason), "{held}"),
        }
    }
}

#[test]
fn the_loop_is_named_with_its_defaults() {
    for (args, method, output, period) in [
        (&[][..], "zoh", "end", 0.001),
        (&["--set", "loop.method=foh"], "foh", "start", 0.001),
        (&["--set", "loop.method=tustin", "--set", "loop.period=0.5ms"], "tustin", "start", 0.0005),
        (&["--set", "loop.output=middle", "--set", "loop.method=rk4"], "rk4", "middle", 0.001),
    ] {
        let (_, json) = checked(WHEEL, args);
        assert_eq!((&json["method"], &json["output"]), (&method.into(), &output.into()));
        assert_eq!(number(&json["period_s"]), period);
    }
}

#[test]
fn forward_eulers_eigenvalues_are_one_plus_and_minus_j_omega_t() {
    let x = TAU * 1e-3;
    let json = hapt(Path::new("."), ["check", &shipped("notes/euler.toml"), "--json"]);
    assert_eq!((json.code, json.err.as_str()), (Some(1), ""));
    let json: Value = serde_json::from_str(&json.out).unwrap();
    let held = &json["held"];
    let radius = x.hypot(1.0);
    for ((re, im, abs), sign) in eigenvalues(&json).into_iter().zip([1.0, -1.0]) {
        assert_eq!(re, 1.0);
        near(im, sign * x, 1e-14);
        near(abs, radius, 1e-15);
    }
    assert_eq!(eigenvalues(&json).len(), 2);
    near(number(&held["spectral_radius"]), radius, 1e-15);
    near(number(&held["growth_per_s"]), (x * x).ln_1p() / 2e-3, 1e-12);
    assert_eq!(held["verdict"], "unstable");
    assert_eq!((&held["critical_period_s"], &held["critical_period_reason"]), (&Value::Null, &"never".into()));

    let mode = &held["modes"][0];
    let (ln, arg) = ((x * x).ln_1p() / 2.0, x.atan());
    near(number(&mode["frequency_hz"]), 1.0, 1e-14);
    assert_eq!(number(&mode["damping_ratio"]), 0.0);
    near(number(&mode["discrete_frequency_hz"]), ln.hypot(arg) / (TAU * 1e-3), 1e-13);
    near(number(&mode["discrete_damping_ratio"]), -ln / ln.hypot(arg), 1e-11);
    assert_eq!(held["modes"].as_array().unwrap().len(), 1);
}

#[test]
fn a_world_without_bodies_has_nothing_to_be_unstable() {
    let wall = "[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = 1\n";
    for rest in ["", wall] {
        let (code, json) = checked(&world("period = 1e-3", rest), &[]);
        assert_eq!(code == 0, json["certified"].as_bool().unwrap());
        let held = &json["held"];
        assert_eq!((&held["eigenvalues"], &held["modes"]), (&Value::Array(vec![]), &Value::Array(vec![])));
        assert_eq!(number(&held["spectral_radius"]), 0.0);
        assert_eq!((&held["growth_per_s"], &held["verdict"]), (&Value::Null, &"stable".into()));
        assert_eq!((&held["critical_period_s"], &held["critical_period_reason"]), (&Value::Null, &"unbounded".into()));
    }
}

#[test]
fn the_largest_eigenvalue_comes_first() {
    let two = [swing("slow", 4.0, "0"), swing("fast", 100.0, "0")].concat();
    let (code, json) = checked(&world("period = 0.01\nmethod = \"forward-euler\"", &two), &[]);
    assert_eq!(code, 1);
    for ((re, im, _), wanted) in eigenvalues(&json).into_iter().zip([0.1, -0.1, 0.02, -0.02]) {
        assert!((re - 1.0).abs() < 1e-15);
        near(im, wanted, 1e-13);
    }
    assert_eq!(eigenvalues(&json).len(), 4);
}

#[test]
fn equal_eigenvalues_stand_by_their_angle_upwards_the_positive_one_of_a_pair_first() {
    let two = [swing("fast", 100.0, "0"), swing("slow", 4.0, "0")].concat();
    let (code, json) = checked(&world("period = 0.01\nmethod = \"trapezoidal\"", &two), &[]);
    assert_eq!((code, &json["held"]["verdict"]), (1, &"marginal".into()));
    let given = eigenvalues(&json);
    assert_eq!(given.len(), 4);
    for ((re, im, abs), (x, sign)) in given.into_iter().zip([(0.02_f64, 1.0), (0.02, -1.0), (0.1, 1.0), (0.1, -1.0)]) {
        near(abs, 1.0, 1e-15);
        near(im.atan2(re), sign * 2.0 * (x / 2.0).atan(), 1e-13);
    }
    // Modes are in the order of their frequency, for any order of the bodies.
    for (mode, omega) in json["held"]["modes"].as_array().unwrap().iter().zip([2.0, 10.0]) {
        near(number(&mode["frequency_hz"]), omega / TAU, 1e-14);
        near(number(&mode["discrete_frequency_hz"]), 2.0 * (omega * 0.005_f64).atan() / 0.01 / TAU, 1e-13);
    }
}

#[test]
fn the_exact_hold_keeps_frequency_and_damping_ratio() {
    let (code, json) = checked(&world("period = 0.01", &swing("w", 25.0, "2")), &[]);
    assert_eq!((code, &json["held"]["verdict"]), (1, &"stable".into()));
    let mode = &json["held"]["modes"][0];
    near(number(&mode["frequency_hz"]), 5.0 / TAU, 1e-14);
    near(number(&mode["discrete_frequency_hz"]), 5.0 / TAU, 1e-12);
    near(number(&mode["damping_ratio"]), 0.2, 1e-14);
    near(number(&mode["discrete_damping_ratio"]), 0.2, 1e-12);
    near(number(&json["held"]["growth_per_s"]), -1.0, 1e-12);
    let reason = (&json["held"]["critical_period_s"], &json["held"]["critical_period_reason"]);
    assert_eq!(reason, (&Value::Null, &"unbounded".into()));
}

#[test]
fn the_critical_period_is_where_the_verdict_changes() {
    // |1 + sT| = 1 at T = 2ζ/ω, ω = 5 rad/s, ζ = 0.2; with b = Tk it is the semi-implicit scheme, at T = 2/ω.
    for (damping, critical) in [("2", 0.08), ("\"compensating\"", 0.4)] {
        let text = world("period = 0.01\nmethod = \"forward-euler\"", &swing("w", 25.0, damping));
        let json = checked(&text, &[]).1;
        let found = number(&json["held"]["critical_period_s"]);
        near(found, critical, 1e-12);
        assert!(json["held"]["critical_period_reason"].is_null());
        for (factor, unstable) in [(0.999, false), (1.001, true)] {
            let json = checked(&text, &["--set", &format!("loop.period={:?}", found * factor)]).1;
            assert_eq!(json["held"]["verdict"] == "unstable", unstable, "{json}");
        }
    }
}

#[test]
fn a_mode_that_no_longer_swings_in_the_loop_has_no_discrete_numbers() {
    let text = world("period = 0.45\nmethod = \"semi-implicit-euler\"", &swing("w", 25.0, "0"));
    let (code, json) = checked(&text, &[]);
    assert_eq!(code, 1);
    assert!(eigenvalues(&json).iter().all(|&(re, im, _)| im == 0.0 && re < 0.0), "{json}");
    let mode = &json["held"]["modes"][0];
    near(number(&mode["frequency_hz"]), 5.0 / TAU, 1e-14);
    assert_eq!((&mode["discrete_frequency_hz"], &mode["discrete_damping_ratio"]), (&Value::Null, &Value::Null));
    // And one that never swings is no mode.
    let (_, json) = checked(&world("period = 0.01", &swing("w", 25.0, "20")), &[]);
    assert_eq!(json["held"]["modes"], Value::Array(vec![]));
    assert_eq!(eigenvalues(&json).len(), 2);
}

#[test]
fn a_body_that_nothing_ties_is_marginal_and_what_is_gone_after_a_sample_is_not_listed() {
    let free = "[bodies.w]\ninertia = 2\n";
    let dragged = format!("{free}[[couplings]]\nkind = \"damper\"\nbetween = [\"w\", \"ground\"]\ndamping = 200\n");
    for (rest, listed) in [(free, 2), (&dragged, 1)] {
        let (code, json) = checked(&world("period = 0.01\nmethod = \"forward-euler\"", rest), &[]);
        assert_eq!((code, &json["held"]["verdict"]), (0, &"marginal".into()));
        assert_eq!(eigenvalues(&json), vec![(1.0, 0.0, 1.0); listed]);
        assert_eq!(number(&json["held"]["growth_per_s"]), 0.0);
        assert!(json["notes"][0].as_str().unwrap().contains("body w"), "{json}");
    }
}

#[test]
fn no_number_is_printed_as_minus_zero() {
    for path in every_world() {
        let ended = hapt(Path::new("."), ["check".as_ref(), path.as_os_str(), "--json".as_ref()]);
        assert!(!ended.out.contains("-0.0,") && !ended.out.contains("-0.0\n"), "{}", ended.out);
    }
}
