//! The initial inputs of the drivers: the built-in worlds, good quantities, overrides and paths, and inputs contrived to be slow,
//! deep or large. Earlier findings are in `kept/TARGET`.

use std::fs;
use std::path::{Path, PathBuf};

use hapt_log::{Header, LogWriter, Origin};
use hapt_model::{Source, World};
use hapt_sim::Simulation;

use crate::set::EVERYTHING;

fn here() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every file below a folder, in the order of the names.
fn files(folder: &Path) -> Vec<Vec<u8>> {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path())).collect();
    entries.sort();
    entries
        .iter()
        .flat_map(|path| if path.is_dir() { files(path) } else { fs::read(path).into_iter().collect() })
        .collect()
}

fn with_kept(target: &str, seeds: impl IntoIterator<Item = String>) -> Vec<Vec<u8>> {
    seeds.into_iter().map(String::into_bytes).chain(files(&here().join("kept").join(target))).collect()
}

pub fn worlds() -> Vec<Vec<u8>> {
    let linear = EVERYTHING.replace("rotary", "linear");
    let mut seeds = files(&here().join("../worlds"));
    seeds.extend(with_kept("world", [EVERYTHING.to_string(), linear].into_iter().chain(contrived())));
    seeds
}

/// A mebibyte each, or as much as it takes.
fn contrived() -> Vec<String> {
    const LARGEST: usize = hapt_model::LARGEST_SOURCE as usize;
    let filled = |line: &dyn Fn(usize) -> String| {
        let mut text = String::new();
        for i in 0.. {
            let line = line(i);
            if text.len() + line.len() > LARGEST {
                break;
            }
            text.push_str(&line);
        }
        text
    };
    let lines = |line: &str| line.repeat(LARGEST / line.len());
    let twice = |first: &dyn Fn(usize) -> String, second: &dyn Fn(usize) -> String| {
        (0..20_000).map(first).chain((0..20_000).map(second)).collect::<String>()
    };
    let bodies = |count: usize| (0..count).map(|i| format!("bodies.b{i}.inertia = 1\n")).collect::<String>();
    vec![
        // Tables that are opened again: quadratic in a parser that keeps their order by moving them.
        twice(&|i| format!("[a{i}.b]\n"), &|i| format!("[a{i}]\n")),
        twice(&|i| format!("[t.a{i}.b]\n"), &|i| format!("[t.a{}]\n", 19_999 - i)),
        filled(&|i| format!("[\"a\".b{i}.c]\n[a.b{i}]\n")),
        filled(&|i| format!("[a{i}.b]\n")),
        filled(&|i| format!("a{i}=1\n")),
        filled(&|i| format!("[scenarios.s{i}]\n")),
        filled(&|i| format!("[{}a{i}]\n", "a.".repeat(70))),
        filled(&|i| format!("{}a{i}=1\n", "a.".repeat(70))),
        lines("[a]\n"),
        lines("[[a]]\n"),
        lines("[[a]]\n[a.b]\n"),
        lines("a=1\n"),
        lines("a.b=1\n"),
        lines("=\n"),
        lines("a=\"\n"),
        lines("\n"),
        lines("["),
        lines("\r"),
        lines("\0"),
        lines("#"),
        format!("a=[{}]", "1,".repeat(LARGEST / 2 - 4)),
        format!("a=[{}]", "[],".repeat(LARGEST / 3 - 4)),
        format!("a=\"{}\"", "\\q".repeat(LARGEST / 2 - 4)),
        format!("loop.period={}", "1".repeat(LARGEST - 20)),
        format!("loop.method=\"{}\"", "µ".repeat(LARGEST / 2 - 20)),
        format!("[{}a]\n", "a.".repeat(LARGEST / 2 - 4)),
        format!("a=[1{}", "]".repeat(LARGEST / 2)),
        // As deep as a parser with a limit on each of brackets and dots goes: their product.
        format!("{}1{}", format!("{}a={{", "a.".repeat(78)).repeat(78), "}".repeat(78)),
        format!("loop.period = 1\ndevice.inertia = 1\n{}", bodies(33)),
    ]
}

pub fn sets() -> Vec<Vec<u8>> {
    let one = "loop.period=2ms\nbodies.wheel.inertia=0.02 kg m^2\ncouplings.0.stiffness=2 N m/rad\n\
               scenarios.turn.hand.amplitude=-3 deg\ntitle=1984\nloop.window=0x10\ndevice.levels=16.0";
    let other = "motion=linear\ndevice.inertia=1 kg\nscenarios.lead.hand={kind=\"step\",to=1}\ncouplings=[]\nbodies={}";
    let deep = format!("{}a=1", "a.".repeat(2000));
    let many: String = (0..1000).map(|i| format!("a{i}=1\n")).collect();
    let nested = format!("a={}", "[".repeat(2000));
    let product = format!("a={}1{}", format!("{{{}a=", "a.".repeat(78)).repeat(20), "}".repeat(20));
    with_kept("set", [one.into(), other.into(), deep, many, nested, product, "=".into(), "a..b=1".into(), ".=".into()])
}

pub fn quantities() -> Vec<Vec<u8>> {
    let texts = [
        "1 ms",
        "45°",
        "-1.5e-3 N m/rad",
        "17.7778 N mm/deg",
        "6.4 g cm^2",
        "0.4503 N mm/(deg/s^2)",
        "5 /s",
        "60 rpm",
        "3",
        "1e99 ms^33",
        "1e-400 s",
        "1 (m/s)²/(N⁻¹ kg)",
        "1 m^100",
        "1 (((((((((((((((((m",
    ];
    let long = [format!("1{} s", "0".repeat(900)), format!("1 {}", "m/".repeat(400)), format!("1 {}", "é".repeat(400))];
    with_kept(
        "quantity",
        texts
            .iter()
            .enumerate()
            .map(|(i, text)| format!("{}{text}", char::from(i as u8)))
            .chain(long.into_iter().map(|text| format!("\u{2}{text}"))),
    )
}

pub fn paths() -> Vec<Vec<u8>> {
    let good = [
        "\0time_s,puck_deg\n0,0\n0.5,90\n1,-9e1\n",
        "\u{1}time_s, puck_mm \r\n# here\r\n\r\n-1 , 2\r\n0.001,-2e0\r\n",
        "\u{2}\u{feff}time_s,torque_mNm\n0,7\n",
        "\u{3}time_s,force_N\n0,7\n1e308,1e308\n",
    ];
    let many = format!("\0time_s,puck_rad\n{}", (0..50_000).map(|i| format!("{i},0\n")).collect::<String>());
    let columns = format!("\0time_s,puck_rad\n0{}\n", ",".repeat(100_000));
    let long = format!("\0time_s,puck_rad\n{},0\n", "1".repeat(100_000));
    let blank = format!("\0{}", " \n".repeat(100_000));
    with_kept("path", good.into_iter().map(String::from).chain([many, columns, long, blank]))
}

pub fn cores() -> Vec<Vec<u8>> {
    let mut seeds: Vec<Vec<u8>> = (0..8u8).map(wheel).collect();
    seeds.extend((0..=255u8).step_by(5).map(|byte| vec![byte; 600]));
    seeds.extend(
        (0..64u8).map(|first| (0..600u16).map(|i| (i as u8).wrapping_mul(2 * first + 1).wrapping_add(first)).collect()),
    );
    seeds.extend(files(&here().join("kept/core")));
    seeds
}

/// A wheel's log, whole and cut, with its checksums and without: checksums detect a changed byte of a log, so that it gets no further.
pub fn logs() -> Vec<Vec<u8>> {
    let text = "loop.period = 1e-3\ndevice.inertia = 1\nbodies.b.inertia = 1\n[[couplings]]\nkind = \"spring\"\n\
        between = [\"puck\", \"b\"]\nstiffness = 1\n[scenarios.s]\nduration = 0.02\nhand = { kind = \"step\", to = 1 }\n";
    let log = || -> Result<Vec<u8>, Box<dyn std::error::Error>> {
        let world = World::read(&Source::from_text("w", text), &[])?;
        let header = Header { world_text: text.into(), ..Header::default() };
        let mut writer = LogWriter::new(Vec::new(), &world, &header, Origin::Run)?;
        let mut run = Simulation::new(&world, world.scenario("s")?)?;
        while let Some(row) = run.next() {
            writer.write_row(row?)?;
        }
        Ok(writer.finish()?)
    };
    let log = log().unwrap_or_else(|error| panic!("{error}"));
    let mut plain = log.clone();
    let mut at = 8;
    while let Some(head) = log.get(at..at + 9) {
        let length = u64::from_le_bytes(std::array::from_fn(|i| head[i + 1])) as usize;
        let (body, end) = (at + 9, at + 9 + length);
        match head[0] {
            0x06 => plain[body + 24..body + 28].fill(0),
            0x09 => plain[end - 4..end].fill(0),
            0x0f => plain[body..body + 4].fill(0),
            _ => {}
        }
        at = end;
    }
    let cuts = [9, 100, log.len() / 2, log.len() - 1].map(|length| log[..length].to_vec());
    [log, plain].into_iter().chain(cuts).chain(files(&here().join("kept/log"))).collect()
}

pub fn messages() -> Vec<Vec<u8>> {
    let talk = r#"{"type":"hello","v":1,"token":"00ff"}
{"type":"take"}
{"type":"order","order":"arm"}
{"type":"hand","grip":true,"position":-0.5}
{"type":"set","key":"loop.estimator","value":"low-pass"}
{"type":"set","key":"loop.period","value":"2 ms"}
{"type":"focus","key":"couplings.0.stiffness"}
{"type":"scenario","name":null}
{"type":"record","on":false}
{"type":"reset"}
{"type":"give"}
{"type":"alive"}"#;
    let sets = |value: &str| format!(r#"{{"type":"set","key":"couplings.0.stiffness","value":"{value}"}}"#);
    let many = [sets("1 N m/rad"), sets("1e-300 N mm/deg"), sets("{a=1}"), sets("[]"), sets("\\u0000")].join("\n");
    let deep = format!("{}1{}", "[".repeat(2000), "]".repeat(2000));
    let wide = format!(r#"{{"type":"set","key":"{}","value":"{}"}}"#, "a.".repeat(128), "(".repeat(256));
    with_kept("live", [talk.to_string(), many, deep, wide])
}

/// A wheel on a spring with a wall, by the order in which the core's target takes its input.
fn wheel(method: u8) -> Vec<u8> {
    let (one, small) = (1u8, 4u8);
    let mut input = vec![method & 1, 1, one, 0, 0, 2];
    // A spring from the puck to the body, and a wall from the puck to ground.
    input.extend([0, 3, 0, one, 0, 0, 2, 3, 0, 0, 100, small]);
    // Period, method, output, advance, a step at every sample, exact velocity; a count, a limit, no levels; the state as it starts.
    input.extend([small, method, if method > 5 { 0 } else { 2 }, method, 0, 0, 1, small, 1, 3, 0, 0]);
    input.extend((64..104u8).map(|i| i.wrapping_mul(3)));
    input
}
