//! The schema, by an independent validator: valid files fit it, and mistakes that a schema can express do not.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use hapt_model::{Source, World, schema};
use jsonschema::Validator;
use serde_json::{Map, Value, json};
use toml::de::{DeTable, DeValue};

static VALIDATOR: LazyLock<Validator> = LazyLock::new(|| {
    let schema: Value = serde_json::from_str(&schema()).unwrap();
    if let Err(error) = jsonschema::draft7::meta::validate(&schema) {
        panic!("{error} at {}", error.instance_path());
    }
    jsonschema::draft7::new(&schema).unwrap()
});

fn json(value: &DeValue<'_>) -> Value {
    match value {
        DeValue::String(text) => json!(text),
        DeValue::Integer(integer) => json!(i64::from_str_radix(integer.as_str(), integer.radix()).unwrap()),
        DeValue::Float(float) => json!(float.as_str().parse::<f64>().unwrap()),
        DeValue::Boolean(boolean) => json!(boolean),
        DeValue::Datetime(date) => json!(date.to_string()),
        DeValue::Array(items) => items.iter().map(|item| json(item.get_ref())).collect(),
        DeValue::Table(entries) => Value::Object(object(entries)),
    }
}

fn object(table: &DeTable<'_>) -> Map<String, Value> {
    table.iter().map(|(key, value)| (key.get_ref().to_string(), json(value.get_ref()))).collect()
}

fn world(text: &str) -> Value {
    Value::Object(object(DeTable::parse(text).unwrap_or_else(|error| panic!("{error}: {text}")).get_ref()))
}

fn files(folder: &str) -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(folder)]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension().is_some_and(|extension| extension == "toml") {
                _ if path.is_dir() => folders.push(path),
                true => found.push(path),
                false => {}
            }
        }
    }
    found
}

#[test]
fn every_world_that_comes_along_fits() {
    let paths = [files("worlds"), files("networks"), files("crates/hapt/templates")].concat();
    assert!(paths.len() >= 24, "{paths:?}");
    for path in paths {
        let world = world(&fs::read_to_string(&path).unwrap());
        let errors: Vec<String> =
            VALIDATOR.iter_errors(&world).map(|error| format!("{}: {error}", error.instance_path())).collect();
        assert!(errors.is_empty(), "{}: {errors:?}", path.display());
    }
}

const ROTARY: &str = "[loop]\nperiod = \"1 ms\"\n[device]\ninertia = \"1 kg m^2\"\n";
const LINEAR: &str = "motion = \"linear\"\n[loop]\nperiod = \"1 ms\"\n[device]\ninertia = \"1 kg\"\n";

/// The texts read and fit.
#[track_caller]
fn fits(text: &str) {
    World::read(&Source::from_text("w.toml", text), &[]).unwrap_or_else(|error| panic!("{error}"));
    let world = world(text);
    if let Some(error) = VALIDATOR.iter_errors(&world).next() {
        panic!("{}: {error}\n{text}", error.instance_path());
    }
}

#[test]
fn what_reads_in_many_spellings_fits() {
    fits(ROTARY);
    fits(LINEAR);
    for coupling in [
        "kind = \"spring\"\nstiffness = \"17.8 N mm/deg\"\nrest = \"-5°\"",
        "kind = \"spring\"\nstiffness = 1\nrest = -0.1",
        "kind = \"damper\"\ndamping = \"1e-3 N·m·s/rad\"",
        "kind = \"wall\"\nside = \"below\"\nat = \"-60 deg\"\nstiffness = \"2 J/rad\"\ndamping = 0",
        "kind = \"detent\"\ntorque = \"8 Nmm\"\npitch = \"0.1 rev\"",
        "kind = \"friction\"\ntorque = \"5 mNm\"",
        "kind = \"friction\"\ncoulomb = 1\nstribeck = 2\nstribeck_velocity = \"1 rpm\"\nbristle_stiffness = 1\n\
         bristle_damping = 0\nviscous = 0",
        "kind = \"constant\"\ntorque = \"-5 N mm\"",
    ] {
        fits(&format!("{ROTARY}[[couplings]]\nbetween = [\"puck\", \"ground\"]\n{coupling}\n"));
    }
    for hand in [
        "kind = \"step\", to = \"45 deg\", release = \"1 s\"",
        "kind = \"sine\", amplitude = \"5 deg\", frequency = \"1 1/s\", phase = \"180 deg\"",
        "kind = \"torque\", moves = { kind = \"ramp\", to = \"15 N mm\", over = \"1.5 s\" }",
        "kind = \"grip\", stiffness = \"2 N m/rad\", moves = { kind = \"step\", to = \"80 deg\" }",
    ] {
        fits(&format!("{ROTARY}[scenarios.a]\nduration = \"1 s\"\nhand = {{ {hand} }}\n"));
    }
    for device in
        ["damping = \"1.2e-3 N m s/rad ± 20 %\"", "damping = \"1.2e-3 ± 0.2e-3 N m s/rad\"", "lag = \"0.1ms+-5%\""]
    {
        fits(&format!("{ROTARY}{device}\n"));
    }
    fits("[loop]\nperiod = 1e-3\ninterval_max = \"1.8 ms\"\ndelay_max = \"0.5 samples\"\n[device]\ninertia = 1\n");
    fits(&format!("{LINEAR}[scenarios.a]\nduration = 1\nhand = {{ kind = \"step\", to = \"20 mm\" }}\n"));
    fits(&format!("{ROTARY}[bodies.w]\ninertia = \"0.45 N mm/(deg/s^2)\"\nvelocity = \"60 rpm\"\n"));
}

/// A mistake, and the key at which an editor shows it.
#[test]
fn what_is_wrong_does_not_fit_and_is_shown_at_its_key() {
    let coupling = |text: &str| format!("{ROTARY}[[couplings]]\nbetween = [\"puck\", \"ground\"]\n{text}\n");
    let hand = |text: &str| format!("{ROTARY}[scenarios.a]\nduration = \"1 s\"\nhand = {{ {text} }}\n");
    let table = [
        (String::new(), ""),
        (ROTARY.replace("1 ms", "1 kg"), "/loop/period"),
        (ROTARY.replace("1 ms", "0 ms"), "/loop/period"),
        (ROTARY.replace("1 ms", "-1 ms"), "/loop/period"),
        (ROTARY.replace("1 ms", "1 sec"), "/loop/period"),
        (ROTARY.replace("1 ms", "1"), "/loop/period"),
        (ROTARY.replace("\"1 ms\"", "0"), "/loop/period"),
        (ROTARY.replace("\"1 ms\"", "true"), "/loop/period"),
        (ROTARY.replace("period", "preiod"), "/loop"),
        (ROTARY.replace("[device]", "method = \"zho\"\n[device]"), "/loop/method"),
        (ROTARY.replace("[device]", "window = 257\n[device]"), "/loop/window"),
        (format!("{ROTARY}levels = 7\nlimit = 1\n"), "/device/levels"),
        (format!("{ROTARY}encoder = \"5 um\"\n"), "/device/encoder"),
        (ROTARY.replace("kg m^2", "kg"), "/device/inertia"),
        (LINEAR.replace("1 kg", "1 kg m^2"), "/device/inertia"),
        (LINEAR.replace("linear", "circular"), "/motion"),
        (format!("colour = 1\n{ROTARY}"), ""),
        (format!("{ROTARY}[bodies.puck]\ninertia = 1\n"), "/bodies"),
        (format!("{ROTARY}[bodies.1st]\ninertia = 1\n"), "/bodies"),
        (format!("{ROTARY}[bodies.w]\n"), "/bodies/w"),
        (coupling("kind = \"sprung\"\nstiffness = 1"), "/couplings/0/kind"),
        (coupling("stiffness = 1"), "/couplings/0"),
        (coupling("kind = \"spring\""), "/couplings/0"),
        (coupling("kind = \"spring\"\nstiffness = \"17.8 N mm\""), "/couplings/0/stiffness"),
        (coupling("kind = \"spring\"\nstiffness = \"-1 N m/rad\""), "/couplings/0/stiffness"),
        (coupling("kind = \"spring\"\nstiffness = \"100 N/m\""), "/couplings/0/stiffness"),
        (coupling("kind = \"spring\"\nstiffness = 1\npitch = 1"), "/couplings/0"),
        (coupling("kind = \"damper\"\ndamping = \"compensated\""), "/couplings/0/damping"),
        (coupling("kind = \"wall\"\nat = 0\nstiffness = 1\nside = \"left\""), "/couplings/0/side"),
        (
            format!("{ROTARY}[[couplings]]\nkind = \"constant\"\ntorque = 1\nbetween = [\"puck\"]"),
            "/couplings/0/between",
        ),
        (hand("kind = \"step\""), "/scenarios/a/hand"),
        (hand("kind = \"step\", to = \"45 mm\""), "/scenarios/a/hand/to"),
        (hand("kind = \"torque\", moves = { kind = \"step\", to = \"45 deg\" }"), "/scenarios/a/hand/moves/to"),
        (hand("kind = \"grip\", moves = { kind = \"step\", to = \"45 N\" }"), "/scenarios/a/hand/moves/to"),
        (hand("kind = \"grip\", moves = { kind = \"torque\", to = 1 }"), "/scenarios/a/hand/moves/kind"),
    ];
    for (text, place) in table {
        assert!(World::read(&Source::from_text("w.toml", text.as_str()), &[]).is_err(), "it reads: {text}");
        let world = world(&text);
        let places: Vec<String> =
            VALIDATOR.iter_errors(&world).map(|error| error.instance_path().to_string()).collect();
        assert!(places.iter().any(|shown| shown == place), "{places:?} and not {place}: {text}");
    }
}

/// The same for a network, which has the motion of its stations' worlds.
#[test]
fn a_mistake_in_a_network_is_shown_at_its_key() {
    let good = "stations.a.world = \"a.toml\"\nstations.b = { world = \"b.toml\", drift = 40, phase = \"1 ms\" }\n[[links]]\n\
        kind = \"spring\"\nbetween = [\"a\", \"b\"]\nstiffness = \"5 N mm/deg\"\nloss = 0.1\nduplicate = 0.1\nage_max = \"20 ms\"\n";
    assert!(VALIDATOR.is_valid(&world(good)));
    assert!(VALIDATOR.is_valid(&world(&good.replace("5 N mm/deg", "5 N/m"))));
    for (from, to, place) in [
        ("5 N mm/deg", "5 N mm", "/links/0/stiffness"),
        ("20 ms", "20 m", "/links/0/age_max"),
        ("spring", "detent", "/links/0/kind"),
        ("age_max", "age", "/links/0"),
        ("phase", "face", "/stations/b"),
        ("world = \"b.toml\"", "world = 3", "/stations/b/world"),
    ] {
        let world = world(&good.replace(from, to));
        let places: Vec<String> =
            VALIDATOR.iter_errors(&world).map(|error| error.instance_path().to_string()).collect();
        assert!(places.iter().any(|shown| shown == place), "{places:?} and not {place}");
    }
}
