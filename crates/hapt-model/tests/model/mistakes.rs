//! One of each kind of mistake, and its message.

mod scenarios;
mod time;
mod world;

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
        let found = match read(&text) {
            Ok(_) => "(it reads)".to_string(),
            Err(error) => error.to_string().lines().next().unwrap_or_default().to_string(),
        };
        if found != *message {
            wrong += &format!("\n{given}\n    said:   {found}\n    wanted: {message}");
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
