//! The table: theme, name, and what is typed or fed. Cases on systems, hardware and records are in `systems`.

mod systems;

use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;

use systems::{drives, identify, live, networks, realtime};

/// One bad input.
pub struct Case {
    /// The file of answers that it is in.
    pub theme: &'static str,
    /// The mistake, in a few words.
    pub name: &'static str,
    /// In the folder where the program runs.
    pub files: Vec<(&'static str, Vec<u8>)>,
    /// On standard input.
    pub input: Vec<u8>,
    pub args: Vec<OsString>,
}

impl Case {
    /// As typed, with long arguments and long rows of them cut.
    pub fn typed(&self) -> String {
        let word = |arg: &OsString| {
            let text = arg.to_string_lossy();
            let plain = text.chars().all(|c| c.is_ascii_alphanumeric() || "-_./=:,".contains(c)) && !text.is_empty();
            let shown: String = text.chars().take(60).flat_map(char::escape_debug).collect();
            let shown = if text.chars().count() > 60 { format!("{shown}…") } else { shown };
            if plain { shown } else { format!("'{shown}'") }
        };
        let words: Vec<String> = std::iter::once("hapt".to_string()).chain(self.args.iter().map(word)).collect();
        if words.len() > 12 { format!("{} …", words[..6].join(" ")) } else { words.join(" ") }
    }
}

/// A good world, each key on a line of its own where it can be.
const WORLD: &str = r#"title = "wheel"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
limit = "822.25 N mm"
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "1.02 N m/rad"
[scenarios.step]
duration = "0.5 s"
hand = { kind = "step", to = "45 deg" }
"#;

/// The table under construction.
struct Table {
    theme: &'static str,
    cases: Vec<Case>,
}

impl Table {
    fn add(&mut self, name: &'static str, files: Vec<(&'static str, Vec<u8>)>, args: Vec<OsString>) {
        self.cases.push(Case { theme: self.theme, name, files, input: Vec::new(), args });
    }

    /// A world file of these bytes.
    fn file(&mut self, name: &'static str, bytes: impl Into<Vec<u8>>) {
        self.add(name, vec![("w.toml", bytes.into())], words(&["check", "w.toml"]));
    }

    /// The good world with `from` replaced, at its first place.
    fn edit(&mut self, name: &'static str, from: &str, to: &str) {
        assert!(WORLD.contains(from), "{from}");
        self.file(name, WORLD.replacen(from, to, 1));
    }

    /// The good world with these lines after it.
    fn lines(&mut self, name: &'static str, lines: &str) {
        self.file(name, format!("{WORLD}{lines}\n"));
    }

    /// The good world with an override.
    fn set(&mut self, name: &'static str, set: &str) {
        self.typed(name, &["check", "w.toml", "--set", set]);
    }

    /// The good world is there as w.toml; this is typed.
    fn typed(&mut self, name: &'static str, args: &[&str]) {
        self.add(name, vec![("w.toml", WORLD.into())], words(args));
    }

    /// The hand of the good world follows a file of these bytes.
    fn path(&mut self, name: &'static str, bytes: impl Into<Vec<u8>>) {
        let world = WORLD.replace("kind = \"step\", to = \"45 deg\"", "kind = \"path\", file = \"way.csv\"");
        self.add(name, vec![("w.toml", world.into()), ("way.csv", bytes.into())], words(&["check", "w.toml"]));
    }
}

fn words(args: &[&str]) -> Vec<OsString> {
    args.iter().map(OsString::from).collect()
}

fn utf16(text: &str, order: fn(u16) -> [u8; 2]) -> Vec<u8> {
    text.encode_utf16().flat_map(order).collect()
}

/// Adds the cases of one theme.
type Theme = fn(&mut Table);

/// All cases, theme by theme.
pub fn cases() -> Vec<Case> {
    let mut table = Table { theme: "", cases: Vec::new() };
    let themes: &[(&str, Theme)] = &[
        ("encodings", encodings),
        ("syntax", syntax),
        ("names", names),
        ("numbers", numbers),
        ("quantities", quantities),
        ("sizes", sizes),
        ("overrides", overrides),
        ("paths", paths),
        ("usage", usage),
        ("edges", edges),
        ("networks", networks),
        ("realtime", realtime),
        ("live", live),
        ("identify", identify),
        ("drives", drives),
    ];
    for &(theme, add) in themes {
        table.theme = theme;
        add(&mut table);
    }
    table.cases
}

fn encodings(t: &mut Table) {
    let marked = format!("\u{feff}{WORLD}");
    t.file("UTF-16, little end first, as Notepad's \"Unicode\"", utf16(&marked, u16::to_le_bytes));
    t.file("UTF-16, big end first", utf16(&marked, u16::to_be_bytes));
    t.file("UTF-16 without its mark", utf16(WORLD, u16::to_le_bytes));
    t.file("UTF-32", marked.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect::<Vec<u8>>());
    t.file(
        "Latin-1's degree sign",
        WORLD
            .replace("45 deg", "45\u{1}")
            .into_bytes()
            .iter()
            .map(|&b| if b == 1 { 0xb0 } else { b })
            .collect::<Vec<u8>>(),
    );
    t.file("a byte order mark before a mistake on the first line", "\u{feff}titel = \"wheel\"\n");
    t.file("CRLF, a mistake in the middle", WORLD.replace('\n', "\r\n").replace("1 ms", "1 kg"));
    t.file("CRLF, an open header", WORLD.replace("[loop]", "[loop").replace('\n', "\r\n"));
    t.file("the line ends of old Macs", WORLD.replace('\n', "\r"));
    t.file("a NUL in a value", WORLD.replace("45 deg", "45\0deg"));
    t.file("a NUL after the end", format!("{WORLD}\0"));
    t.file("an escape sequence of terminals in a key", "\"\\u001b[2J\" = 1\n");
    t.file("an escape sequence of terminals in a value", "title = \"\u{1b}[2J\"\n");
    t.edit("a minus sign of typography", "\"45 deg\"", "\"\u{2212}45 deg\"");
    t.edit("a space of typography, which is fine, and a unit that is none", "\"1 ms\"", "\"1\u{a0}msec\"");
    t.edit("quotes of typography", "\"1 ms\"", "\u{201c}1 ms\u{201d}");
    t.file("a program", b"\x7fELF\x02\x01\x01\0\0\0\xff\xfe\0".to_vec());
    t.file("a picture", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec());
}

fn syntax(t: &mut Table) {
    t.file("nothing", "");
    t.file("JSON", "{\"loop\": {\"period\": 0.001}}\n");
    t.file("YAML", "loop:\n  period: 1 ms\n");
    t.edit("an open string", "\"1 ms\"", "\"1 ms");
    t.edit("a quantity without quotes", "\"1 ms\"", "1 ms");
    t.edit("a comma for the point", "\"1.02 N m/rad\"", "1,02");
    t.edit("an open header", "[loop]", "[loop");
    t.edit("an open array", "\"wheel\"]", "\"wheel\"");
    t.edit("a key twice", "period = \"1 ms\"", "period = \"1 ms\"\nperiod = \"2 ms\"");
    t.lines("a table twice", "[device]\nlimit = 1");
    t.lines("dotted keys into a table that has a header", "[loop.more]\n[loop]\nperiod = 1");
    t.lines("a dotted key through a value", "[bodies]\nwheel.inertia.x = 1");
    t.edit("a value, and a table of the same name", "period = \"1 ms\"", "period = \"1 ms\"\nperiod.x = 1");
    t.lines("one table where an array of tables stands", "[couplings]\nkind = \"spring\"");
    t.file("brackets, two hundred thousand deep", format!("a = {}", "[".repeat(200_000)));
    t.file("tables in tables, two hundred thousand deep", format!("a = {}", "{a=".repeat(200_000)));
    t.file("a key of two hundred thousand names", format!("{}a = 1", "a.".repeat(200_000)));
}

fn names(t: &mut Table) {
    t.edit("a misspelt key", "period", "perod");
    t.edit("a key in capitals", "period", "Period");
    t.edit("a misspelt table", "[device]", "[devise]");
    t.edit("a key in the wrong table", "period = ", "inertia = 1\nperiod = ");
    t.edit("a key of another kind", "stiffness = ", "damping = 1\nstiffness = ");
    t.edit("a misspelt kind", "\"spring\"", "\"sprnig\"");
    t.edit("a kind that nothing resembles", "\"spring\"", "\"gravity\"");
    t.edit("a method that nothing resembles", "period = ", "method = \"verlet\"\nperiod = ");
    t.edit("an end that is no body", "\"wheel\"]", "\"whel\"]");
    t.edit("an end of another world", "\"wheel\"]", "\"flywheel\"]");
    t.edit("both ends the same", "\"puck\", \"wheel\"", "\"wheel\", \"wheel\"");
    t.edit("three ends", "\"wheel\"]", "\"wheel\", \"ground\"]");
    t.edit("an end that is a number", "\"wheel\"]", "0]");
    t.lines("an unknown answer to late samples", "[safety]\nlate = \"never\"");
    t.lines("a misspelt answer to late samples", "[safety]\nlate = \"fades\"");
    t.lines("a time that late samples take no more", "[safety]\nlate = \"5 ms\"");
    t.edit("a body called puck", "[bodies.wheel]", "[bodies.puck]");
    t.edit("a body with a space", "[bodies.wheel]", "[bodies.\"my wheel\"]");
    t.edit("a body without a name", "[bodies.wheel]", "[bodies.\"\"]");
    t.edit("a scenario that would leave its folder", "[scenarios.step]", "[scenarios.\"../step\"]");
    t.edit("a required key missing", "period = \"1 ms\"\n", "");
    t.edit("a hand without a kind", "kind = \"step\", ", "");
    t.lines("dampers that compensate each other, and no spring", "[[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"ground\"]\ndamping = \"compensating\"\n[[couplings]]\nkind = \"damper\"\nbetween = [\"ground\", \"puck\"]\ndamping = \"compensating\"");
    t.edit(
        "a hand that moves as a hand that moves",
        "{ kind = \"step\", to = \"45 deg\" }",
        "{ kind = \"grip\", moves = { kind = \"grip\", moves = { kind = \"grip\" } } }",
    );
    t.lines(
        "LuGre friction at a body under the usual method",
        "[[couplings]]\nkind = \"friction\"\nbetween = [\"wheel\", \"ground\"]\ncoulomb = 1\nstribeck = 1\nstribeck_velocity = 1\nbristle_stiffness = 1\nbristle_damping = 0\nviscous = 0",
    );
}

fn numbers(t: &mut Table) {
    t.edit(
        "a hand that opens and never holds",
        "{ kind = \"step\", to = \"45 deg\" }",
        "{ kind = \"grip\", open = \"1 ms\", moves = { kind = \"step\", to = 1 } }",
    );
    t.edit(
        "a hand that switches faster than can be run",
        "{ kind = \"step\", to = \"45 deg\" }",
        "{ kind = \"grip\", hold = 1e-12, open = 1e-12, moves = { kind = \"step\", to = 1 } }",
    );
    t.edit("not a number", "\"1 ms\"", "nan");
    t.edit("infinity", "\"1 ms\"", "inf");
    t.edit("zero where it must be positive", "\"1 ms\"", "0");
    t.edit("minus zero where it must be positive", "\"1 ms\"", "-0.0");
    t.edit("beyond the largest double", "\"1 ms\"", "1e400");
    t.edit("below the smallest double", "\"1 ms\"", "\"1e-400 s\"");
    t.edit("an integer of a thousand digits", "\"1 ms\"", &"9".repeat(1000));
    t.edit(
        "a hexadecimal integer beyond 128 bits",
        "limit = ",
        "encoder = 0xffffffffffffffffffffffffffffffffffff\nlimit = ",
    );
    t.edit("half a level", "limit = ", "levels = 2.5\nlimit = ");
    t.edit("an odd number of levels", "limit = ", "levels = 7\nlimit = ");
    t.edit("more levels than 32 bits count", "limit = ", "levels = 4294967296\nlimit = ");
    t.edit("a negative window", "period = ", "window = -1\nperiod = ");
    t.edit("a date", "\"1 ms\"", "2024-01-01");
    t.edit("true", "\"1 ms\"", "true");
    t.edit("an array", "\"1 ms\"", "[1, \"ms\"]");
    t.edit("a scenario of a hundred years", "\"0.5 s\"", "\"3.2e9 s\"");
    t.edit("a unit of time that is none", "period = ", "delay = \"1 h\"\nperiod = ");
    t.edit("a delay of a million and one periods", "period = ", "delay = \"1001 s\"\nperiod = ");
    t.edit("an inertia out of scale with its spring", "\"0.0258 kg m^2\"", "1e-320");
}

fn quantities(t: &mut Table) {
    t.edit("the wrong dimension", "\"1 ms\"", "\"1 kg\"");
    t.edit("a torque for a stiffness", "\"1.02 N m/rad\"", "\"1.02 N m\"");
    t.edit("a stiffness for a torque", "\"822.25 N mm\"", "\"822.25 N mm/deg\"");
    t.edit("a unit that is none", "\"1 ms\"", "\"1 msec\"");
    t.edit("a unit in the wrong case", "\"1 ms\"", "\"1 MS\"");
    t.edit("a quoted number without a unit", "\"1 ms\"", "\"1\"");
    t.edit("a unit of another kind that is spelled nearly so", "\"1 ms\"", "\"1 min\"");
    t.edit("no number", "\"1 ms\"", "\"ms\"");
    t.edit("two numbers", "\"1 ms\"", "\"1 2 ms\"");
    t.edit("a comma for the point, in quotes", "\"1 ms\"", "\"0,5 ms\"");
    t.edit("a power without its mark", "\"6.4e-4 kg m^2\"", "\"6.4e-4 kg m2\"");
    t.edit("an open parenthesis", "\"6.4e-4 kg m^2\"", "\"6.4e-4 N mm/(deg/s^2\"");
    t.edit("a quotient of nothing", "\"1.02 N m/rad\"", "\"1.02 N m/\"");
    t.edit("a power of a hundred and one", "\"1 ms\"", "\"1 ms^101\"");
    t.edit("parentheses, a thousand deep", "\"1 ms\"", &format!("\"1 {}s\"", "(".repeat(1000)));
    t.edit("an empty text", "\"1 ms\"", "\"\"");
    t.typed(
        "design with the wrong dimension",
        &["design", "--travel", "45 N", "--torque", "1 N m", "--frequency", "1 Hz"],
    );
    t.typed(
        "design of an inertia beyond anything physical",
        &["design", "--travel", "1e300 rad", "--torque", "1 N m", "--frequency", "1 Hz"],
    );
    t.typed("design with no travel", &["design", "--travel", "0", "--torque", "1 N m", "--frequency", "1 Hz"]);
}

fn sizes(t: &mut Table) {
    t.file("a world of more than a mebibyte", "#".repeat((1 << 20) + 1));
    t.file("a key of half a mebibyte", format!("{} = 1", "k".repeat(1 << 19)));
    t.file("a value of half a mebibyte", format!("loop.method = \"{}\"", "v".repeat(1 << 19)));
    t.lines("thirty-three bodies", &(0..32).map(|i| format!("[bodies.b{i}]\ninertia = 1\n")).collect::<String>());
    t.lines(
        "sixty-five couplings",
        &"[[couplings]]\nkind = \"constant\"\nbetween = [\"puck\", \"ground\"]\ntorque = 0\n".repeat(64),
    );
    t.lines("a thousand and one scenarios", &(0..1000).map(|i| format!("[scenarios.s{i}]\n")).collect::<String>());
    t.file(
        "forty thousand tables, half of them opened again",
        (0..40_000)
            .map(|i| if i < 20_000 { format!("[a{i}.b]\n") } else { format!("[a{}]\n", i - 20_000) })
            .collect::<String>(),
    );
    t.cases.push(Case {
        theme: t.theme,
        name: "an endless standard input",
        files: vec![],
        input: vec![b'#'; 1 << 21],
        args: words(&["check", "-"]),
    });
}

fn overrides(t: &mut Table) {
    t.set("no equals sign", "loop.period");
    t.set("nothing", "");
    t.set("no key", "=1");
    t.set("a point too many", "loop..period=1");
    t.set("a body that is not there", "bodies.whel.inertia=1");
    t.set("a coupling that is not there", "couplings.1.rest=0");
    t.set("a coupling by a name", "couplings.spring.rest=0");
    t.set("a key below a value", "loop.period.x=1");
    t.set("a misspelt key", "loop.perod=1");
    t.set("the wrong dimension", "loop.period=2 kg");
    t.set("an open table", "scenarios.step.hand={kind=\"step\"");
    t.set("a value that ends in a line", "loop.period=2 kg\nms");
    t.set("a whole table in place of a number", "loop.period={a=1}");
    t.set("a key of a thousand names", &format!("{}a=1", "a.".repeat(1000)));
    t.set("a lost link that does nothing known", "safety.link_lost=stop");
    t.set("an energy in metres", "safety.energy=5 mm");
    t.set("a fade of no time", "safety.fade=0 s");
    t.set("a limit of safety that is none", "safety.speed=5 rad/s");
    t.set("brackets, a thousand deep", &format!("loop.period={}", "[".repeat(1000)));
    let many: Vec<String> = (0..1001).map(|i| format!("--set=loop.period={}", i + 1)).collect();
    let args: Vec<&str> = ["check", "w.toml"].into_iter().chain(many.iter().map(String::as_str)).collect();
    t.typed("a thousand and one of them", &args);
    let bytes = OsString::from_vec(b"loop.period=\xff".to_vec());
    let args = [words(&["check", "w.toml", "--set"]), vec![bytes]].concat();
    t.add("bytes that are no text", vec![("w.toml", WORLD.into())], args);
}

fn paths(t: &mut Table) {
    t.path("nothing in it", "");
    t.path("no header", "0,0\n1,45\n");
    t.path("a header without points", "time_s,puck_deg\n");
    t.path("points with a semicolon", "time_s;puck_deg\n0;0\n");
    t.path("a third column", "time_s,puck_deg\n0,0,0\n");
    t.path("the wrong dimension", "time_s,puck_mm\n0,0\n");
    t.path("a time in milliseconds", "time_ms,puck_deg\n0,0\n");
    t.path("a time that does not increase", "time_s,puck_deg\n0,0\n1,1\n1,2\n");
    t.path("a gap", "time_s,puck_deg\r\n0,0\r\n1,\r\n2,0\r\n");
    t.path("not a number", "time_s,puck_deg\n0,0\n1,nan\n");
    t.path("a number too large", "time_s,puck_deg\n0,0\n1,1e400\n");
    t.path("a quote that is not closed", "time_s,puck_deg\n0,\"1\n");
    t.path("UTF-16", utf16("\u{feff}time_s,puck_deg\n0,0\n", u16::to_le_bytes));
    t.path("a byte that is no text", b"time_s,puck_deg\n0,0\n1,\xb0\n".to_vec());
    let hand = "kind = \"step\", to = \"45 deg\"";
    t.edit("a path that is not there", hand, "kind = \"path\", file = \"way.csv\"");
    t.edit("a path out of the folder", hand, "kind = \"path\", file = \"../way.csv\"");
    t.edit("a path from the root", hand, "kind = \"path\", file = \"/dev/zero\"");
    t.edit("a folder for a path", hand, "kind = \"path\", file = \".\"");
    t.edit("a path with a NUL", hand, "kind = \"path\", file = \"a\\u0000b\"");
}

fn usage(t: &mut Table) {
    t.typed("a command that is none", &["simulate", "w.toml"]);
    t.typed("no world", &["check"]);
    t.typed("a world that is not there", &["check", "wheel.toml"]);
    t.typed("a folder for a world", &["check", "."]);
    t.typed("an empty name for a world", &["check", ""]);
    t.typed("an option that is none", &["check", "w.toml", "--bogus"]);
    t.typed("a misspelt option", &["sim", "w.toml", "--scenaro", "step"]);
    t.typed("an option without its value", &["sim", "w.toml", "--out"]);
    t.typed("an empty folder", &["sim", "w.toml", "--out", ""]);
    t.typed("a file for a folder", &["sim", "w.toml", "--out", "w.toml"]);
    t.typed("a scenario that is not there", &["sim", "w.toml", "--scenario", "stpe"]);
    t.typed("a format that is none", &["sim", "w.toml", "--format", "xlsx"]);
    t.typed("frequencies that cannot be told apart", &["impedance", "w.toml", "--to", "600 Hz"]);
    t.typed("a frequency in milliseconds", &["impedance", "w.toml", "--from", "2 ms"]);
    t.typed("the upper frequency first", &["impedance", "w.toml", "--from", "20", "--to", "10"]);
    t.typed("an impedance without a row", &["impedance", "w.toml", "--points", "0"]);
    t.typed("frequencies of a Z-width", &["impedance", "w.toml", "--z-width", "--to", "10 Hz"]);
    t.typed("the world itself for its worst hand's file", &["worst", "w.toml", "--out", "./w.toml"]);
    t.typed("a folder for the worst hand's file", &["worst", "w.toml", "--out", "."]);
    t.typed("a worst hand of a world that is not there", &["worst", "wheel.toml"]);
    t.typed("a log that is not there", &["log", "replay", "run.mcap"]);
    t.typed("a world for a log", &["log", "replay", "w.toml"]);
    t.typed("a folder for a log", &["log", "convert", ".", "-o", "run.csv"]);
    t.typed("a conversion into what is no format", &["log", "convert", "run.mcap", "-o", "run.txt"]);
    t.typed("a conversion into nowhere", &["log", "convert", "run.mcap"]);
    let stub = b"\x89MCAP0\r\n\x01\x08\0\0\0\0\0\0\0\0\0\0\0\0".to_vec();
    t.add("a log cut before its first sample", vec![("cut.mcap", stub)], words(&["log", "replay", "cut.mcap"]));
    let name = OsString::from_vec(b"w\xff.toml".to_vec());
    t.add("a name that is no text", vec![], [words(&["check"]), vec![name]].concat());
    t.typed("a name with a line in it", &["check", "w\n.toml"]);
}

fn edges(t: &mut Table) {
    let stiffness = "couplings.0.stiffness=0..2";
    for (name, axes, more) in [
        ("over one key", &[stiffness][..], &[][..]),
        ("over three keys", &[stiffness, "loop.period=1ms..2ms", "loop.delay=0..1ms"], &[]),
        ("over a name", &[stiffness, "loop.method=zoh..foh"], &[]),
        ("between whole numbers", &[stiffness, "loop.advance=0..3"], &[]),
        ("over a range by ratio, from 0", &[stiffness, "loop.delay=0..1ms:log"], &[]),
        ("over a range with equal ends", &[stiffness, "loop.period=1ms..1ms"], &[]),
        ("over a grid", &[stiffness, "loop.period=1ms..2ms:40"], &[]),
        ("over a range that begins with what cannot be", &[stiffness, "loop.period=0..1ms"], &[]),
        ("over a delay of too many periods", &[stiffness, "loop.delay=0..1s"], &[]),
        ("an edge of what has none", &[stiffness, "loop.period=1ms..2ms"], &["--of", "held,heard"]),
        ("into a table of another kind", &[stiffness, "loop.period=1ms..2ms"], &["--out", "edges.parquet"]),
    ] {
        let axes = axes.iter().flat_map(|axis| ["--vary", axis]);
        let args: Vec<&str> = ["boundary", "w.toml"].into_iter().chain(axes).chain(more.iter().copied()).collect();
        t.typed(name, &args);
    }
}
