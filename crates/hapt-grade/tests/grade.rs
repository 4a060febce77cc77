//! The course's packs, their keys, and invalid answers.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

/// The exit code and the output of a run.
#[derive(Debug)]
struct Ended {
    code: Option<i32>,
    out: String,
    err: String,
}

impl Ended {
    fn done(self) -> Ended {
        assert_eq!((self.code, self.err.as_str()), (Some(0), ""), "{self:?}");
        self
    }

    fn refused(self, code: i32, words: &[&str]) {
        assert_eq!((self.code, self.out.as_str()), (Some(code), ""), "{self:?}");
        assert!(words.iter().all(|word| self.err.contains(word)), "{words:?}: {self:?}");
    }
}

fn hapt_grade<'a>(at: &Path, args: impl IntoIterator<Item = &'a str>) -> Ended {
    let output = Command::new(env!("CARGO_BIN_EXE_hapt-grade")).args(args).current_dir(at).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// A folder with these files.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let at = TempDir::new().unwrap();
    for (name, text) in files {
        fs::write(at.path().join(name), text).unwrap();
    }
    at
}

/// The lessons: every folder of the course.
fn lessons() -> Vec<PathBuf> {
    let course = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/course").canonicalize().unwrap();
    let mut lessons: Vec<PathBuf> = fs::read_dir(course).unwrap().map(|entry| entry.unwrap().path()).collect();
    lessons.sort();
    assert!(lessons.len() >= 11, "{lessons:?}");
    lessons
}

fn lesson(name: &str) -> PathBuf {
    lessons().into_iter().find(|lesson| lesson.ends_with(name)).unwrap()
}

/// The answer file of a lesson in this folder of tests.
fn kept(lesson: &Path, which: &str) -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/course");
    tests.join(lesson.file_name().unwrap()).join(format!("{which}.toml"))
}

fn grade(pack: &Path, answer: &Path, more: &[&str]) -> Ended {
    let mut args = vec![pack.to_str().unwrap(), answer.to_str().unwrap()];
    args.extend(more);
    hapt_grade(Path::new("."), args)
}

/// The marked questions, each with its id and whether it is right.
fn marked(ended: &Ended) -> Vec<(String, bool)> {
    let table: Value = serde_json::from_str(&ended.out).unwrap_or_else(|error| panic!("{error}: {ended:?}"));
    let row = |row: &Value| (row["id"].as_str().unwrap().to_string(), row["right"].as_bool().unwrap());
    table["questions"].as_array().unwrap().iter().map(row).collect()
}

#[test]
fn the_reference_answers_of_every_lesson_have_full_points() {
    for lesson in lessons() {
        let ended = grade(&lesson, &kept(&lesson, "right"), &["--json"]).done();
        let table: Value = serde_json::from_str(&ended.out).unwrap();
        assert!(table["of"].as_u64() > Some(0) && table["points"] == table["of"], "{}", ended.out);
    }
}

#[test]
fn every_answer_of_a_wrong_file_is_graded_as_wrong() {
    for lesson in lessons() {
        let ended = grade(&lesson, &kept(&lesson, "wrong"), &["--json"]);
        assert_eq!(ended.code, Some(1), "{ended:?}");
        let marked = marked(&ended);
        assert!(!marked.is_empty() && marked.iter().all(|(_, right)| !right), "{marked:?}");
    }
}

#[test]
fn one_wrong_answer_costs_its_own_points_and_no_others() {
    for lesson in lessons() {
        let read = |which| fs::read_to_string(kept(&lesson, which)).unwrap();
        // One answer per line, in the same order in both files.
        let (right, wrong) = (read("right"), read("wrong"));
        assert_eq!(right.lines().count(), wrong.lines().count());
        for (at, line) in wrong.lines().enumerate() {
            let id = line.split(' ').next().unwrap();
            let mut mixed: Vec<&str> = right.lines().collect();
            mixed[at] = line;
            let at = folder(&[("answer.toml", &mixed.join("\n"))]);
            let ended = grade(&lesson, &at.path().join("answer.toml"), &["--json"]);
            assert_eq!(ended.code, Some(1), "{ended:?}");
            assert!(marked(&ended).iter().all(|(of, is_right)| *is_right == (of != id)), "{id}: {ended:?}");
        }
    }
}

#[test]
fn no_answer_earns_no_points_and_the_key_shows_what_was_expected() {
    for lesson in lessons() {
        let at = folder(&[("answer.toml", "")]);
        let ended = grade(&lesson, &at.path().join("answer.toml"), &["--key"]);
        assert_eq!(ended.code, Some(1));
        assert!(ended.out.contains("no answer") && ended.out.contains("expected ") && ended.out.contains("\n0 of "));
    }
}

#[test]
fn the_expected_answers_follow_the_students_numbers() {
    let wall = lesson("wall");
    let at = folder(&[("answer.toml", "")]);
    let answer = at.path().join("answer.toml");
    let expected = |student: &str| grade(&wall, &answer, &["--key", "--student", student]).out;
    let all: std::collections::BTreeSet<String> = ["ada", "bob", "cyd", "dan", "eve"].map(expected).into();
    assert!(all.len() > 1, "{all:?}");
    let questions = hapt_grade(Path::new("."), [wall.to_str().unwrap(), "--student", "ada"]).done();
    assert!(questions.out.contains("--set 'couplings.0.stiffness="), "{}", questions.out);
}

#[test]
fn a_world_file_answers_as_inline_keys_do_and_may_change_the_same_keys() {
    let lesson = lesson("passivity");
    let starter = fs::read_to_string(lesson.join("starter.toml")).unwrap();
    let graded = |world: &str| {
        let at = folder(&[("answer.toml", "wall = \"mine.toml\""), ("mine.toml", world)]);
        let ended = grade(&lesson, &at.path().join("answer.toml"), &["--json"]);
        (marked(&ended).into_iter().find(|(id, _)| id == "wall").unwrap().1, ended.out)
    };
    let faster = starter.replace("period = \"1 ms\"", "period = \"0.5 ms\"");
    assert!(graded(&faster).0, "{}", graded(&faster).1);
    assert!(!graded(&starter).0);
    let (right, out) = graded(&starter.replace("1.2e-3 N m s/rad", "1 N m s/rad"));
    assert!(!right && out.contains("device.damping is not to be changed"), "{out}");
    let (right, out) = graded(&faster.replace("friction = \"5 N mm\"\n", ""));
    assert!(!right && out.contains("device.friction"), "{out}");
}

#[cfg(unix)]
#[test]
fn an_answer_reads_no_file_outside_of_its_folder_and_nothing_but_files() {
    let lesson = lesson("passivity");
    let at = folder(&[("outside.toml", "title = \"no\"")]);
    let inner = at.path().join("inner");
    fs::create_dir(&inner).unwrap();
    std::os::unix::fs::symlink("../outside.toml", inner.join("link.toml")).unwrap();
    std::os::unix::fs::symlink("..", inner.join("up")).unwrap();
    let absolute = at.path().join("outside.toml").display().to_string();
    for (file, why) in [
        ("../outside.toml", "leads out of the folder"),
        (absolute.as_str(), "leads out of the folder"),
        ("/dev/zero", "leads out of the folder"),
        ("link.toml", "symbolic link"),
        ("up/outside.toml", "symbolic link"),
        (".", "leads out of the folder"),
        ("absent.toml", "cannot read"),
    ] {
        cannot_be_read(&lesson, &inner, file, why);
    }
    fs::create_dir(inner.join("folder.toml")).unwrap();
    cannot_be_read(&lesson, &inner, "folder.toml", "is not a file");
    fs::write(inner.join("broken.toml"), "loop.period = \"1 m\"").unwrap();
    cannot_be_read(&lesson, &inner, "broken.toml", "loop.period");
}

/// A row reports an unreadable answer, and the other answers are graded.
fn cannot_be_read(lesson: &Path, inner: &Path, file: &str, why: &str) {
    fs::write(inner.join("answer.toml"), format!("wall = {file:?}\nrequired = 2e-3\n")).unwrap();
    let ended = grade(lesson, &inner.join("answer.toml"), &[]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    let row = |id: &str| ended.out.lines().find(|line| line.trim_start().starts_with(id)).unwrap().to_string();
    assert!(row("wall").contains("cannot be read: ") && row("wall").contains(why), "{ended:?}");
    assert!(row("required").contains("right"), "{ended:?}");
}

/// For any text of a student the table has its own columns.
#[test]
fn no_answer_hides_or_reorders_a_part_of_the_table() {
    let lesson = lesson("passivity");
    let at = folder(&[]);
    for hidden in
        ['\u{202e}', '\u{2066}', '\u{200b}', '\u{200f}', '\u{feff}', '\u{9b}', '\u{61c}', '\u{2028}', '\u{e0041}']
    {
        let path = at.path().join("answer.toml");
        fs::write(&path, format!("required = \"a{hidden}b\"\nwall = \"{hidden}.toml\"\n")).unwrap();
        for more in [&[][..], &["--json"]] {
            let ended = grade(&lesson, &path, more);
            assert!(!ended.out.contains(hidden) && ended.out.contains("a\u{fffd}b"), "{ended:?}");
        }
    }
}

#[test]
fn answers_that_are_too_large_or_malformed_are_wrong_with_their_place() {
    let lesson = lesson("passivity");
    let starter = fs::read_to_string(lesson.join("starter.toml")).unwrap();
    let long = starter.replace("duration = \"2 s\"", "duration = \"20000 s\"");
    let crowded = format!(
        "{starter}{}",
        "\n[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = \"1 N m/rad\"\n".repeat(16)
    );
    let inline = r#"wall = "mine.toml""#;
    let deep = format!("wall.{} = 1", "a.".repeat(5000) + "a");
    for (answer, world, words) in [
        (inline, long.as_str(), ["mine.toml", "samples"]),
        (inline, crowded.as_str(), ["mine.toml", "couplings: 17 are more than the 16"]),
        (inline, "[loop]\nperiod = 5 ms", ["mine.toml", "not TOML"]),
        ("a = [1", "", ["answer.toml:1", "not TOML"]),
        (deep.as_str(), "", ["answer.toml:1", "not TOML"]),
        ("requird = 1", "", ["no question \"requird\"", "required"]),
        (r#"wall = { "loop.period" = "5 kg" }"#, "", ["wall ", "expected a time"]),
        (r#"wall = { "loop.period" = "-1 ms" }"#, "", ["wall ", "loop.period"]),
    ] {
        let at = folder(&[("answer.toml", answer), ("mine.toml", world)]);
        is_a_row(&grade(&lesson, &at.path().join("answer.toml"), &[]), &words);
    }
    let at = folder(&[("answer.toml", &"#".repeat((1 << 20) + 1))]);
    is_a_row(&grade(&lesson, &at.path().join("answer.toml"), &[]), &["larger than 1 MiB"]);
}

/// A world that cannot be read is a wrong answer with its reason, so that all others are graded; an answer file that cannot be read is
/// refused.
fn is_a_row(ended: &Ended, words: &[&str]) {
    let is_row = ended.out.contains("cannot be read");
    assert_eq!(ended.code, Some(if is_row { 1 } else { 2 }), "{ended:?}");
    let all = format!("{}{}", ended.out, ended.err);
    assert!(words.iter().all(|word| all.contains(word)), "{words:?}: {ended:?}");
}

#[test]
fn a_pack_with_a_mistake_is_refused_with_its_name() {
    let question = "title = \"t\"\n[[questions]]\nid = \"a\"\ntext = \"?\"\n";
    let starter = fs::read_to_string(lesson("wall").join("starter.toml")).unwrap();
    for (more, words) in [
        ("", ["pack.toml", "either `from` or `conditions`"]),
        ("from = { measur = \"x\" }", ["pack.toml", "measur"]),
        ("from = { measure = \"x\" }", ["a: ", "the measures are"]),
        ("from = { check = \"/x\" }", ["a: ", "no field"]),
        ("from = { column = { name = \"x\", take = \"last\" } }", ["a: ", "the columns are"]),
        ("from = { value = 1 }\nunit = \"x\"", ["a: ", "unit"]),
        ("from = { value = 1 }\ntolerance = -1", ["pack.toml", "tolerance"]),
    ] {
        let pack = format!("{question}{more}");
        let at = folder(&[("pack.toml", &pack), ("starter.toml", &starter), ("answer.toml", "a = 1")]);
        grade(at.path(), &at.path().join("answer.toml"), &[]).refused(2, &words);
    }
}

#[test]
fn a_question_about_a_network_that_only_a_world_can_answer_is_refused_by_its_name() {
    let starter = "[stations.a]\nworld = \"w.toml\"\n[stations.b]\nworld = \"w.toml\"\n\
                   [[links]]\nkind = \"spring\"\nbetween = [\"a\", \"b\"]\nstiffness = \"0.1 N m/rad\"\nage_max = \"20 ms\"\n";
    let world = "loop.period = \"1 ms\"\ndevice = { inertia = \"6.4e-4 kg m^2\", damping = \"0.02 N m s/rad\" }\n\
                 [scenarios.push]\nduration = \"0.1 s\"\nhand = { kind = \"step\", to = \"10 deg\" }\n";
    let column = |rest: &str| format!("from = {{ column = {{ name = \"puck_rad\", take = \"last\"{rest} }} }}");
    let cases = [
        ("from = { measure = \"peak_torque\" }".to_string(), "is a network"),
        ("from = { key = \"links.0.stiffness\" }".to_string(), "is a network"),
        ("from = { check = \"/passivity/required_damping\" }".to_string(), "no field"),
        (column(""), "needs the `station`"),
        (column(", station = \"c\""), "needs the `station`"),
        (format!("{}\nscenario = \"pull\"", column(", station = \"a\"")), "needs a `scenario`"),
        (column(", station = \"a\"").replace("puck_rad", "puck"), "no column"),
    ];
    for (question, says) in cases {
        let pack = format!("title = \"t\"\n[[questions]]\nid = \"q\"\ntext = \"?\"\n{question}\n");
        let at =
            folder(&[("pack.toml", &pack), ("starter.toml", starter), ("w.toml", world), ("answer.toml", "q = 1")]);
        hapt_grade(at.path(), [".", "answer.toml"]).refused(2, &["q", says]);
    }
    // Existing columns are graded: the first wheel is held at 10°.
    let pack = format!(
        "title = \"t\"\n[[questions]]\nid = \"q\"\ntext = \"?\"\nunit = \"rad\"\n{}\n",
        column(", station = \"a\"")
    );
    let at = folder(&[
        ("pack.toml", &pack),
        ("starter.toml", starter),
        ("w.toml", world),
        ("answer.toml", "q = \"10 deg\""),
    ]);
    hapt_grade(at.path(), [".", "answer.toml"]).done();
}

#[test]
fn a_template_is_a_file_of_answers_with_one_line_per_question() {
    for lesson in lessons() {
        let pack = lesson.to_str().unwrap();
        let template = hapt_grade(Path::new("."), [pack, "--template"]).done().out;
        let right = fs::read_to_string(kept(&lesson, "right")).unwrap();
        let mut filled = template.clone();
        for line in right.lines() {
            let id = line.split(' ').next().unwrap();
            let empty = template.lines().find(|line| line.starts_with(&format!("# {id} = "))).unwrap();
            filled = filled.replace(empty, line);
        }
        let at = folder(&[("empty.toml", &template), ("answer.toml", &filled)]);
        for file in fs::read_dir(kept(&lesson, "right").parent().unwrap()).unwrap() {
            let file = file.unwrap().path();
            fs::copy(&file, at.path().join(file.file_name().unwrap())).unwrap();
        }
        grade(&lesson, &at.path().join("answer.toml"), &[]).done();
        let empty = grade(&lesson, &at.path().join("empty.toml"), &[]);
        assert!(empty.code == Some(1) && empty.out.contains("\n0 of "), "{empty:?}");
    }
}

#[test]
fn the_key_needs_answers_and_a_bad_usage_is_refused() {
    let wall = lesson("wall");
    let wall = wall.to_str().unwrap();
    hapt_grade(Path::new("."), [wall, "--key"]).refused(2, &["ANSWER.toml"]);
    hapt_grade(Path::new("."), [wall, "answer.toml", "--template"]).refused(2, &["--template"]);
    hapt_grade(Path::new("."), ["no-such-pack"]).refused(2, &["no-such-pack", "cannot read"]);
    let help = hapt_grade(Path::new("."), ["--help"]).done().out;
    assert!(help.contains("--student <NAME>") && help.contains("Examples:"), "{help}");
}
