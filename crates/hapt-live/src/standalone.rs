//! The page without a server, as files that a browser opens from where they lie: the same page, and web/core as WebAssembly in place of
//! what is behind a websocket.
//!
//! ```text
//! NAME.html   NAME.js   assets/page.js, .css ...   assets/core-SUM.js
//! the page    a world   shared by all worlds       the program, in base64
//! ```
//!
//! Scripts of a folder are classic ones, and bytes are text in them: browsers load nothing else from there.

use std::collections::BTreeMap;

use hapt_analysis::{Check, Proposal};
use hapt_core::{Output, Reason, SafetyProfile};
use hapt_host::messages::{ServerMessage, VerdictMessage, describe};
use hapt_host::{SettableKey, WorldConfig, grip, rule};
use hapt_model::{Source, World};
use hapt_web::{Page, Setup, Slot};
use serde_json::{Value, json};

use crate::assets::{self, CORE};
use crate::certifier::{proposed, range, to_verdict};

/// More bytes than a world of all bodies and couplings takes.
const ROOM: usize = 1 << 16;

/// With more bodies only the period's certified range is looked for: all of them would take longer than the report.
const MANY: usize = 4;

/// A file by its name, which may be in a folder.
pub type File = (String, Vec<u8>);

/// What is known of a world whose page is to be written.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// The world, of [`config()`].
    pub config: &'a WorldConfig,
    /// Its certificate.
    pub check: &'a Check,
    /// Its remedies or margins.
    pub proposal: Option<&'a Proposal>,
    /// What it is called on the command line, with what is set there.
    pub command: &'a str,
    /// The report that the page leads back to, from its folder.
    pub report: &'a str,
}

/// A world for such a page.
///
/// # Errors
/// In words, why it has none: the page has not been built, or does not run this world.
pub fn config(source: Source, sets: Vec<String>) -> Result<WorldConfig, String> {
    if CORE.is_empty() || !assets::all().any(|(name, _)| name == "/index.html") {
        return Err("this hapt was built without the page".into());
    }
    let config = WorldConfig::checked(source, sets, rule::check)?;
    let (world, setup) = bytes(&config)?;
    Page::new(&world, &setup).ok_or("its numbers are out of the core's range")?;
    Ok(config)
}

/// A world, and what runs beside it, as the page reads them.
fn bytes(config: &WorldConfig) -> Result<(Vec<u8>, Vec<u8>), String> {
    let mut room = vec![0; ROOM];
    let world = hapt_wire::write(&config.world.spec(), &mut room).map_err(|error| error.to_string())?.to_vec();
    Ok((world, postcard::to_allocvec(&setup(config)).map_err(|error| error.to_string())?))
}

/// The files that all worlds share.
pub fn shared() -> Vec<File> {
    let files = assets::all().filter(|(name, _)| *name != "/index.html");
    let mut list: Vec<File> =
        files.map(|(name, bytes)| (name.trim_start_matches('/').to_string(), bytes.to_vec())).collect();
    list.push((core(), format!("window.hapt = {{ core: \"{}\" }};\n", base64(CORE)).into_bytes()));
    list
}

/// A world's page and its data, `stem.html` and `stem.js`.
pub fn world(stem: &str, known: &Known<'_>) -> [File; 2] {
    let data = format!("Object.assign(window.hapt, {});\n", data(known));
    [(format!("{stem}.html"), page(stem).into_bytes()), (format!("{stem}.js"), data.into_bytes())]
}

/// The program's file. It has a sum in its name: another hapt's worlds in the same folder keep theirs.
fn core() -> String {
    // FNV-1a
    let sum = CORE
        .iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |sum, byte| (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3));
    format!("assets/core-{sum:016x}.js")
}

/// The page, with what it runs before its own script. Whatever a world's text would load or run, the policy forbids.
fn page(stem: &str) -> String {
    let html = assets::asset("/").map_or(String::new(), |page| String::from_utf8_lossy(page.bytes).into_owned());
    let own = format!(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'self' file: \
         'wasm-unsafe-eval'; style-src 'self' file:; img-src 'self' file:\" />\n    \
         <script src=\"./{}\"></script>\n    <script src=\"./{stem}.js\"></script>\n    ",
        core()
    );
    let before = html.find("<link rel=\"icon\"").unwrap_or_default();
    let (head, rest) = html.split_at(before);
    format!("{head}{own}{rest}")
}

/// A world as the page takes it: web/src/local.ts has its form.
fn data(known: &Known<'_>) -> Value {
    let Known { config, check, proposal, command, report } = *known;
    let world = &config.world;
    // They have been written before.
    let (bytes, setup) = bytes(config).unwrap_or_default();
    let info = describe(config);
    let slots: BTreeMap<&str, Place> =
        info.keys.iter().filter_map(|key| Some((key.path.as_str(), place(world, &key.path)?))).collect();
    let is_small = world.bodies.len() <= MANY;
    let number = |key: &&SettableKey| {
        key.kind == "quantity" && slots.contains_key(key.path.as_str()) && (is_small || key.path == "loop.period")
    };
    let ranges: BTreeMap<&str, Vec<[f64; 2]>> = (info.keys.iter().filter(number))
        .filter_map(|key| Some((key.path.as_str(), range(config, key, &|| false)?)))
        .collect();
    let remedies = Some(proposal.map_or(Vec::new(), proposed));
    let reason = |reason: Reason| {
        let words = json!({ "name": reason.name(), "sentence": reason.sentence(), "clear": reason.remedy() });
        (reason.code().to_string(), words)
    };
    let hand = grip(world);
    json!({
        "bytes": base64(&bytes),
        "setup": base64(&setup),
        "slots": slots,
        "ranges": ranges,
        "reasons": Reason::ALL.into_iter().map(reason).collect::<BTreeMap<_, _>>(),
        "grip": { "inertia": hand.inertia, "damping": hand.damping, "stiffness": hand.stiffness },
        "command": command,
        "report": report,
        "verdict": ServerMessage::Verdict(Box::new(VerdictMessage { remedies, ..to_verdict(config, check) })),
        "world": ServerMessage::World(Box::new(info)),
    })
}

/// What runs beside the world's bytes.
fn setup(config: &WorldConfig) -> Setup {
    let world = &config.world;
    let sampling = &world.sampling;
    // What the file says, or leaves to the method, shows under a method that may have any.
    let output = match sampling.method.takes_new_sample_first() {
        true => config.with("loop.method", "zoh").map_or(Output::End, |other| other.world.sampling.output),
        false => sampling.output,
    };
    Setup {
        device: world.device_spec(),
        limits: world.limits(SafetyProfile::Simulated),
        output,
        scenarios: world.scenarios.iter().map(|scenario| (scenario.hand.clone(), scenario.duration)).collect(),
    }
}

/// A [`Slot`], of which coupling or body, and the slot for the word that may stand in place of the number.
type Place = (u32, usize, Option<u32>);

/// Where a key's number is in the page; `None` where only a server changes it.
fn place(world: &World, path: &str) -> Option<Place> {
    let names: Vec<&str> = path.split('.').collect();
    let (slot, index, word) = match names[..] {
        ["loop", "period"] => (Slot::Period, 0, None),
        ["loop", "method"] => (Slot::Method, 0, None),
        ["loop", "output"] => (Slot::Output, 0, None),
        ["loop", "delay"] => (Slot::Delay, 0, None),
        ["device", "inertia"] => (Slot::PuckInertia, 0, None),
        ["device", "damping"] => (Slot::PuckDamping, 0, None),
        ["device", "friction"] => (Slot::PuckFriction, 0, None),
        ["bodies", name, "inertia"] => (Slot::Inertia, world.names.iter().position(|other| other == name)?, None),
        ["couplings", index, name] => {
            let index: usize = index.parse().ok()?;
            let mut law = world.couplings.get(index)?.law;
            let is_damper = law.damper().is_some();
            let has_number = law.quantities().any(|quantity| quantity.name == name);
            let (slot, word) = match name {
                "damping" if is_damper => (Slot::Damping, Some(Slot::Compensating)),
                "stiffness" if has_number => (Slot::Stiffness, None),
                "damping" if has_number => (Slot::Damping, None),
                "torque" if has_number => (Slot::Torque, None),
                _ => return None,
            };
            (slot, index, word)
        }
        _ => return None,
    };
    Some((slot as u32, index, word.map(|slot| slot as u32)))
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let all = three.iter().fold(0, |all, byte| all << 8 | usize::from(*byte)) << (8 * (3 - three.len()));
        for place in 0..4 {
            let letter = LETTERS[all >> (18 - 6 * place) & 63];
            text.push(if place <= three.len() { char::from(letter) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use hapt_core::Request;
    use hapt_web::COLUMNS;

    use super::*;
    use crate::testing::WHEEL;

    fn page(config: &WorldConfig) -> Box<Page> {
        let (world, setup) = bytes(config).unwrap();
        Page::new(&world, &setup).unwrap()
    }

    /// Where all of it is, now and then, in a hand that swings the puck.
    fn goes(mut page: Box<Page>, hand: hapt_sim::Grip) -> Vec<[[f64; COLUMNS]; 3]> {
        // Disarmed, it forgets that its numbers were changed: there is nothing to fade over.
        page.run(1);
        page.ask(Request::Arm);
        page.hold(Some(hand));
        let sample = |k: u32| {
            page.intend(0.5 * (0.3 * f64::from(k)).sin());
            page.run(7);
            *page.frame()
        };
        (0..40).map(sample).collect()
    }

    #[test]
    fn whatever_a_page_changes_by_itself_is_the_world_with_that_key() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../worlds");
        let (mut tried, mut refused) = (0, 0);
        for entry in ["notes", "devices"].iter().flat_map(|under| std::fs::read_dir(folder.join(under)).unwrap()) {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|ending| ending != "toml") {
                continue;
            }
            let config = WorldConfig::checked(Source::open(&path).unwrap(), Vec::new(), rule::check).unwrap();
            let hand = grip(&config.world);
            for key in config.keys() {
                let Some((slot, index, word)) = place(&config.world, &key.path) else { continue };
                let ends = [key.min, key.max].map(|end| format!("{} {}", end / key.factor, key.unit));
                let numbers = ends.iter().filter(|_| key.kind == "quantity").map(String::as_str);
                for value in numbers.chain(key.choices.iter().copied()) {
                    let next = config.with(&key.path, value);
                    let choice = key.choices.iter().position(|choice| *choice == value);
                    // To the bit as the reader has it.
                    let si = next.as_ref().ok().and_then(|next| next.keys().iter().find(|k| k.path == key.path)?.value);
                    let (slot, number) = match choice {
                        Some(_) if key.kind == "quantity" => (word.unwrap(), 0.0),
                        Some(choice) => (slot, choice as f64),
                        None => (slot, si.unwrap_or(f64::NAN)),
                    };
                    let mut changed = page(&config);
                    let done = changed.set(Slot::ALL[slot as usize], index, number);
                    let place = format!("{}: {} = {value}", path.display(), key.path);
                    assert_eq!(done, next.is_ok(), "{place}: {:?}", next.err());
                    match next {
                        Ok(next) => assert_eq!(goes(changed, hand), goes(page(&next), hand), "{place}"),
                        Err(_) => refused += 1,
                    }
                    tried += 1;
                }
            }
        }
        assert!(tried > 100 && refused < tried / 4, "{tried} tried, {refused} refused");
    }

    #[test]
    fn the_page_takes_the_same_periods_with_and_without_a_server() {
        assert_eq!(hapt_web::PERIODS, hapt_host::keys::PERIODS);
    }

    #[test]
    fn a_method_that_takes_any_output_finds_the_files_own_again() {
        let config = |set: &str| {
            let source = Source::from_text("wheel.toml", WHEEL);
            WorldConfig::checked(source, vec![set.into()], rule::check).unwrap()
        };
        for (set, wanted) in [
            ("loop.method=tustin", Output::End),
            ("loop.method=rk4", Output::End),
            ("loop.output=middle", Output::Middle),
            ("loop.output=start", Output::Start),
        ] {
            let mut page = page(&config(set));
            for (method, output) in [(7.0, Output::Start), (4.0, wanted), (6.0, Output::Start), (0.0, wanted)] {
                assert!(page.set(Slot::Method, 0, method));
                assert_eq!(page.output(), output, "{set}, method {method}");
            }
        }
    }

    #[test]
    fn a_worlds_text_stays_text() {
        let title = "title = \"</script><script>alert(1)</script>\"";
        let source = Source::from_text("wheel.toml", WHEEL.replace("title = \"wheel\"", title));
        let config = WorldConfig::new(source, Vec::new()).unwrap();
        let check = hapt_analysis::check(&config.world).unwrap();
        let known = Known { config: &config, check: &check, proposal: None, command: "it's", report: "../wheel.html" };
        let [(name, html), (data, text)] = world("wheel", &known);
        assert_eq!((name.as_str(), data.as_str()), ("wheel.html", "wheel.js"));
        assert!(!String::from_utf8_lossy(&html).contains("alert(1)"));
        let text = String::from_utf8(text).unwrap();
        let json = text.strip_prefix("Object.assign(window.hapt, ").unwrap().strip_suffix(");\n").unwrap();
        let data: Value = serde_json::from_str(json).unwrap();
        assert_eq!(data["world"]["title"], "</script><script>alert(1)</script>");
        assert_eq!(data["world"]["type"], "world");
        assert_eq!((&data["command"], &data["verdict"]["certified"]), (&json!("it's"), &json!(check.certified)));
        let [from, to] = [0, 1].map(|end| data["ranges"]["loop.period"][0][end].as_f64().unwrap());
        assert!(from < to && data["slots"]["bodies.wheel.inertia"] == json!([Slot::Inertia as u32, 0, null]));
    }

    #[test]
    fn bytes_are_text_as_rfc_4648_has_them() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xfb, 0xff, 0x00]), "+/8A");
    }
}
