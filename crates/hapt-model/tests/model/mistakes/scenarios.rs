//! Mistakes about scenarios and hands.

use super::{LEAST, check};
use hapt_model::{Source, World};

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
fn a_hand_that_swings_the_puck_thousands_of_radians_in_a_sample_is_refused_beside_friction() {
    let table = [
        (
            "friction = 0.01\n[scenarios.s]\nduration = 1\nhand = { kind = \"grip\", stiffness = 1e10, damping = 0, moves = { kind = \"step\", to = 1 } }",
            "scenarios.s.hand.stiffness: the hand swings 10000 rad in 0.1 s, the longest interval, and beside device.friction at most 3000 \
             are simulated; expected 9.000e8 in SI or less, or a shorter loop.period",
        ),
        (
            "friction = 0.01\n[scenarios.s]\nduration = 1\nhand = { kind = \"torque\", moves = { kind = \"sine\", amplitude = 1, frequency = 5e3 } }",
            "scenarios.s.hand.moves.frequency: the hand swings 3142 rad in 0.1 s, the longest interval, and beside device.friction at most \
             3000 are simulated; expected 4.775e3 Hz or less, or a shorter loop.period",
        ),
        (
            "friction = 0.01\n[scenarios.s]\nduration = 1\nhand = { kind = \"torque\", moves = { kind = \"sine\", amplitude = 1, frequency = 4.77e3 } }",
            "(it reads)",
        ),
        (
            "friction = 0.01\n[scenarios.s]\nduration = 1\nhand = { kind = \"sine\", amplitude = 1, frequency = 5e3 }",
            "(it reads)",
        ),
        (
            "[scenarios.s]\nduration = 1\nhand = { kind = \"grip\", stiffness = 1e10, damping = 0, moves = { kind = \"step\", to = 1 } }",
            "(it reads)",
        ),
    ];
    check(&table, |given| format!("[loop]\nperiod = \"100 ms\"\n[device]\ninertia = 1\n{given}\n"));
}
