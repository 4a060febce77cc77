//! Numbers of networks by their keys.

use hapt_model::{Source, System, World};

/// A number set by its path is the number that an override of that path would have been read as.
#[test]
fn every_number_of_a_network_is_where_its_override_goes() {
    let text = r#"
        [stations.left]
        world = "w.toml"
        phase = "0.3 ms"
        drift = -500
        [stations.right]
        world = "w.toml"
        [[links]]
        kind = "spring"
        between = ["left", "right"]
        stiffness = 0.2
        delay = "1 ms"
        age_max = "30 ms"
        [[links]]
        kind = "wall"
        between = ["left", "right"]
        stiffness = 0.2
        side = "above"
        at = 0.5
        delay = "1 ms"
        delay_max = "2 ms"
        age_max = "30 ms"
    "#;
    let mut source = Source::from_text("pair.toml", text);
    let world =
        "loop = { period = \"1 ms\", interval_max = \"1.3 ms\" }\ndevice = { inertia = 1e-3, damping = 0.02 }\n";
    source.files.insert("w.toml".into(), world.into());
    let system = System::read(&source, &[]).unwrap();
    let paths = [
        ("stations.left.phase", 1e-3),
        ("stations.left.drift", 800.0),
        ("stations.left.drift", -900.0),
        ("stations.left.loop.period", 1.1e-3),
        ("stations.left.loop.interval_max", 1.7e-3),
        ("stations.left.device.damping", 0.5),
        ("stations.right.loop.delay", 0.4e-3),
        ("links.0.stiffness", 0.7),
        ("links.0.rest", -0.1),
        ("links.0.limit", 2.0),
        ("links.0.period", 7e-3),
        ("links.0.delay", 3e-3),
        ("links.1.delay_max", 4e-3),
        ("links.1.loss", 0.3),
        ("links.1.duplicate", 0.2),
        ("links.1.seed", 7.0),
        ("links.1.at", 0.25),
        ("links.0.damping", 0.01),
        ("links.1.damping", 0.02),
        ("links.1.age_max", 0.05),
    ];
    for (path, value) in paths {
        assert!(system.key(path).is_some(), "{path}");
        let mut changed = system.clone();
        assert!(changed.set_number(path, value), "{path}");
        let of = |system: &System| {
            let mut system = system.clone();
            system.stations.iter_mut().for_each(|station| station.sets.clear());
            system
        };
        let read = System::read(&source, &[format!("{path}={value}")]).unwrap();
        assert_eq!(of(&changed), of(&read), "{path}");
        assert!((changed.number(path).unwrap() - value).abs() < 1e-12 * value.abs(), "{path}");
    }
    // Written and read again it is the same.
    let network = &system;
    let mut written = Source::from_text("pair.toml", network.to_toml(&["left.toml".into(), "right.toml".into()]));
    for station in &network.stations {
        written.files.insert(format!("{}.toml", station.name), station.stated_world().to_toml());
    }
    let read = System::read(&written, &[]).unwrap();
    assert_eq!((&read.links, read.stations.len()), (&network.links, 2));
    for (read, own) in read.stations.iter().zip(&network.stations) {
        assert_eq!((&read.world, read.phase), (&own.world, own.phase));
        assert!((read.drift - own.drift).abs() < 1e-15);
    }
    for path in ["links.0.at", "links.2.stiffness", "links.0.kind", "stations.left.world", "loop.period"] {
        assert!(system.key(path).is_none() && system.number(path).is_none(), "{path}");
        assert!(!system.clone().set_number(path, 1.0), "{path}");
    }
}

#[test]
fn a_key_that_no_network_has_is_answered_with_the_one_that_was_meant() {
    let link =
        "[[links]]\nkind = \"wall\"\nbetween = [\"a\", \"b\"]\nstiffness = 1\nside = \"above\"\nat = 0\nage_max = 1";
    let text = format!("[stations]\na.world = \"w.toml\"\nb.world = \"w.toml\"\n{link}\n");
    let mut source = Source::from_text("pair.toml", text);
    source.files.insert("w.toml".into(), "loop.period = 1e-3\ndevice = { inertia = 1e-3, damping = 0.02 }\n".into());
    assert!(System::read(&source, &[]).is_ok());
    for (set, expected) in [
        (
            "loop.period=1ms",
            "loop: unknown key here; a station's own is stations.NAME.loop.period; the top of the file takes title,",
        ),
        (
            "scenarios.s.duration=1",
            "scenarios: unknown key here; a station's own is stations.NAME.scenarios.s.duration; ",
        ),
        ("links.0.damping=-1", "links.0.damping: -1"),
        ("links.0.damping=1 N m/rad", "links.0.damping: "),
    ] {
        let message = System::read(&source, &[set.to_string()]).unwrap_err().to_string();
        assert!(message.starts_with(expected), "{message}");
    }
}

#[test]
fn a_network_has_a_station() {
    let link = "kind = \"spring\"\nbetween = [\"a\", \"b\"]\nstiffness = 1\nage_max = 1\n";
    for links in ["links = []\n".to_string(), format!("[[links]]\n{link}")] {
        let text = format!("stations = {{}}\n{links}");
        let error = System::read(&Source::from_text("pair.toml", text), &[]).unwrap_err().to_string();
        assert_eq!(
            error.lines().next(),
            Some("stations: the network has no station; expected at least one, such as [stations.left] with its world")
        );
    }
    let mut source = Source::from_text("pair.toml", "stations.a.world = \"w.toml\"\nlinks = []\n");
    source.files.insert("w.toml".into(), "loop.period = 1e-3\ndevice.inertia = 1e-3\n".into());
    assert!(System::read(&source, &[]).is_ok());
    let error = System::read(&source, &["stations={}".to_string()]).unwrap_err().to_string();
    let shown = error.lines().skip(1).collect::<Vec<_>>();
    assert_eq!(shown, [" --> --set:1:10", "  |", "1 | stations={}", "  |          ^^"]);
}

/// The memory and the look-ahead of a network's run are bounded.
#[test]
fn times_of_stations_and_links_beyond_any_network_are_refused_by_their_keys() {
    let read = |period: &str, station: &str, link: &str| {
        let text = format!(
            "[stations.left]\nworld = \"w.toml\"\n{station}\n[stations.right]\nworld = \"w.toml\"\n[[links]]\nkind = \"spring\"\n\
             between = [\"left\", \"right\"]\nstiffness = 0.2\n{link}\n"
        );
        let mut source = Source::from_text("pair.toml", text);
        let world = format!("loop = {{ period = \"{period}\" }}\ndevice = {{ inertia = 1e-3, damping = 0.02 }}\n");
        source.files.insert("w.toml".into(), world);
        System::read(&source, &[]).map_err(|error| error.to_string().lines().next().unwrap().to_string())
    };
    let age = "age_max = 1000";
    let cases = [
        ("phase = 1000", "age_max = 1", None),
        (
            "phase = \"1e9 s\"",
            "age_max = 1",
            Some("stations.left.phase: 1000000000.0 s is longer than in any network; expected 1000.0 s or less"),
        ),
        ("", &format!("delay = 998\ndelay_max = 1000\n{age}"), None),
        (
            "",
            &format!("delay = 1e6\n{age}"),
            Some("links.0.delay: 1000000.0 s is longer than in any network; expected 1000.0 s or less"),
        ),
        (
            "",
            &format!("delay_max = 1001\n{age}"),
            Some("links.0.delay_max: 1001.0 s is longer than in any network; expected 1000.0 s or less"),
        ),
        (
            "",
            "age_max = 1e4",
            Some("links.0.age_max: 10000.0 s is longer than in any network; expected 1000.0 s or less"),
        ),
        (
            "",
            &format!("period = 1e5\n{age}"),
            Some("links.0.period: 100000.0 s is longer than in any network; expected 1000.0 s or less"),
        ),
    ];
    for (station, link, expected) in cases {
        assert_eq!(read("1 ms", station, link).err().as_deref(), expected, "{station} {link}");
    }
    let message = "links.0.delay: left sends every 1e-5 s, so that 90000000 messages are under way; at most 1000000 can be; expected \
                   10.0 s or less, or a longer period";
    assert_eq!(read("10 us", "", &format!("delay = 900\n{age}")).err().as_deref(), Some(message));
    assert!(read("10 us", "", &format!("delay = 900\nperiod = \"1 ms\"\n{age}")).is_ok());
}

#[test]
fn a_world_file_is_one_station_without_links_whose_keys_have_no_prefix() {
    let file = "title = \"w\"\n[loop]\nperiod = \"1 ms\"\ninterval_max = \"2 ms\"\n[device]\ninertia = \"6.4e-4 kg m^2\"\n\
                [scenarios.push]\nduration = \"1 s\"\nhand = { kind = \"step\", to = \"10 deg\" }\n";
    let source = Source::from_text("w.toml", file);
    let sets = ["device.damping=0.01".to_string()];
    let mut system = System::read(&source, &sets).unwrap();
    let mut world = World::read(&source, &sets).unwrap();
    assert_eq!((system.kind(), system.title.as_deref(), system.scenarios()), ("world", Some("w"), vec!["push"]));
    assert_eq!((system.stations.len(), system.links.len(), system.world()), (1, 0, Some(&world)));
    for key in ["loop.period", "loop.interval_max", "device.damping", "scenarios.push.duration"] {
        assert_eq!((system.number(key), system.key(key)), (world.number(key), world.key(key)), "{key}");
        assert_eq!((system.set_number(key, 0.003), world.set_number(key, 0.003)), (true, true), "{key}");
        assert_eq!(system.world(), Some(&world), "{key}");
    }
    for key in ["phase", "drift", "links.0.stiffness", "stations..loop.period"] {
        assert!(system.key(key).is_none() && system.number(key).is_none() && !system.set_number(key, 1.0), "{key}");
    }
    assert_eq!(system.world(), Some(&world));
    assert!(System::read_network(&source, &[]).is_err(), "it has no stations");
}

#[test]
fn no_station_of_a_network_is_without_a_name() {
    let mut source = Source::from_text("n.toml", "stations.\"\".world = \"w.toml\"\n");
    source.files.insert("w.toml".into(), "loop.period = '1 ms'\ndevice.inertia = 1e-3\n".into());
    let error = System::read(&source, &[]).unwrap_err().to_string();
    assert!(error.contains("stations"), "{error}");
}

#[test]
fn a_station_whose_origin_slips_is_refused() {
    let mut source = Source::from_text("n.toml", "stations.a.world = \"w.toml\"\nlinks = []\n");
    let world = "loop = { period = '1 ms', recentre = '1 s' }\ndevice = { inertia = 1e-3, friction = 1e-3 }\n";
    source.files.insert("w.toml".into(), world.into());
    let error = System::read(&source, &[]).unwrap_err().to_string();
    assert!(error.contains("stations.a.world: w.toml has loop.recentre, and links count"), "{error}");
}
