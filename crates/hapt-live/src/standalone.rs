//! The page without a server, as files that a browser opens from a folder: the same page, with web/core as WebAssembly in place of the
//! websocket's server.
//!
//! ```text
//! NAME.html   NAME.js   assets/page.js, .css ...   assets/core-SUM.js
//! the page    a world   shared by all worlds       the program, in base64
//! ```
//!
//! The scripts are classic ones, with bytes as text: browsers load no modules and no other data from a folder.

use std::collections::BTreeMap;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use hapt_analysis::{Proposal, SystemCheck};
use hapt_core::SafetyProfile;
use hapt_host::messages::{NetworkFile, ServerMessage, VerdictMessage, WorldFile};
use hapt_host::{SettableKey, WorldConfig, rule};
use hapt_model::{Source, System, World};
use hapt_rt::Plan;
use serde_json::{Value, json};

use crate::assets::{self, CORE};
use crate::certifier::{proposed, range, to_verdict};

/// With more bodies only the period's certified range is computed: all ranges would take longer than the report.
const MANY: usize = 4;

/// A file with its name, which may contain a folder.
pub type File = (String, Vec<u8>);

/// A system's page with its title and place.
#[derive(Clone, Copy, Debug)]
pub struct PageInput<'a> {
    /// The system.
    pub page: &'a Page,
    /// The title.
    pub title: &'a str,
    /// A world's remedies or margins.
    pub proposal: Option<&'a Proposal>,
    /// The place of the page.
    pub place: Place<'a>,
}

/// The place of a page, with the text of its links.
#[derive(Clone, Copy, Debug)]
pub enum Place<'a> {
    /// In the folder of a report.
    Report {
        /// The world on the command line, with its overrides.
        command: &'a str,
        /// The report to which the page links back, relative to its folder.
        report: &'a str,
    },
    /// In the output of a notebook's cell.
    Notebook,
}

impl Place<'_> {
    /// The place in the form of the page's data.
    fn data(self) -> Value {
        match self {
            Place::Report { command, report } => json!({ "command": command, "report": report }),
            Place::Notebook => Value::Null,
        }
    }
}

/// A system for such a page.
#[derive(Clone, Debug)]
pub struct Page(Contents);

/// The content of the page.
#[derive(Clone, Debug)]
enum Contents {
    /// A world, its configuration as the page reads it, and its verdict.
    World(WorldFile, Box<WorldConfig>, Box<VerdictMessage>),
    /// A network for a page with all of its wheels, and its stations' names.
    Network(NetworkFile, Vec<String>),
}

impl Page {
    /// The system that was read from `source` under `sets`, with its certificate, and the files that it names.
    ///
    /// # Errors
    /// In a sentence: the page has not been built, or does not run this world, or that of a station.
    pub fn new(source: &Source, sets: Vec<String>, system: &System, check: &SystemCheck) -> Result<Self, String> {
        let built = !CORE.is_empty() && assets::all().any(|(name, _)| name == "/index.html");
        if !built {
            return Err("this hapt was built without the page".into());
        }
        Ok(Page(match check {
            SystemCheck::World(check) => {
                let file = WorldFile::new(source, sets)?;
                let config = file.clone().config()?;
                runs(&config.world)?;
                let verdict = to_verdict(&config, check);
                Contents::World(file, Box::new(config), Box::new(verdict))
            }
            SystemCheck::Network(check) => {
                let file = NetworkFile::new(source, sets, system, check)?;
                for station in file.network()?.stations {
                    let at = |why| format!("{}: {why}", station.name);
                    rule::check(&station.world, &station.source, &station.sets).map_err(at)?;
                    runs(&station.world).map_err(at)?;
                }
                Contents::Network(file, system.stations.iter().map(|station| station.name.clone()).collect())
            }
        }))
    }
}

fn runs(world: &World) -> Result<(), String> {
    Plan::new(world, SafetyProfile::Simulated).map(drop).map_err(|error| error.to_string())
}

/// The script and the style that make the figures of a report interactive.
#[derive(Clone, Copy, Debug)]
pub struct ReportPlots {
    /// The script.
    pub script: &'static str,
    /// Its SHA-256 in base64.
    pub sum: &'static str,
    /// The style.
    pub style: &'static str,
}

/// The plots of reports; `None` where this hapt was built without the page.
pub fn report_plots() -> Option<ReportPlots> {
    let [script, sum, style] = ["plots.js", "plots.sha256", "plots.css"].map(assets::report);
    Some(ReportPlots { script: script?, sum: sum?, style: style? })
}

/// The files common to all worlds.
pub fn shared() -> Vec<File> {
    let files = assets::all().filter(|(name, _)| *name != "/index.html");
    let mut list: Vec<File> =
        files.map(|(name, bytes)| (name.trim_start_matches('/').to_string(), bytes.to_vec())).collect();
    list.push((core(), core_script().into_bytes()));
    list
}

fn core_script() -> String {
    format!("window.hapt = {{ core: \"{}\" }};\n", STANDARD.encode(CORE))
}

/// A system's page and its data, `stem.html` and `stem.js`.
pub fn files(stem: &str, input: &PageInput<'_>) -> [File; 2] {
    let data = with_core(&data(input));
    [(format!("{stem}.html"), page(stem).into_bytes()), (format!("{stem}.js"), data.into_bytes())]
}

/// A system's page as one file, for the text of an embedded frame.
pub fn single(input: &PageInput<'_>) -> String {
    let text = |ending: &str| {
        let found = assets::all().find(|(name, _)| name.ends_with(ending));
        found.map_or(String::new(), |(_, bytes)| String::from_utf8_lossy(bytes).into_owned())
    };
    let (html, script, style) = (text("/index.html"), text(".js"), text(".css"));
    let head = html.split("<link rel=\"icon\"").next().unwrap_or_default();
    let body = html.split_once("</head>").map_or("", |(_, rest)| rest);
    let body = body.split("</body>").next().unwrap_or_default();
    // The escape prevents the world's text from ending the element; the policy forbids loading.
    let data = with_core(&data(input)).replace('<', "\\u003c");
    let core = core_script();
    format!(
        "{head}<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline' \
         'wasm-unsafe-eval'; style-src 'unsafe-inline'\" />\n<style>{style}</style>\n</head>{body}<script>{core}</script>\n\
         <script>{data}</script>\n<script>{script}</script>\n</body></html>\n"
    )
}

/// A script that gives the page its data, and the program.
fn with_core(data: &Value) -> String {
    format!("Object.assign(window.hapt, {data});\n")
}

/// The name of the program's file, which contains its checksum: worlds of another version in the same folder keep theirs.
fn core() -> String {
    // FNV-1a
    let sum = CORE
        .iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |sum, byte| (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3));
    format!("assets/core-{sum:016x}.js")
}

/// The page, with the scripts before its own one. The policy forbids everything that a world's text might load or run.
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

/// The data of a page in the form of its script: that of web/src/local.ts and web/src/wheels.ts.
fn data(input: &PageInput<'_>) -> Value {
    let PageInput { page: Page(contents), title, proposal, place } = *input;
    let (file, config, verdict) = match contents {
        Contents::World(file, config, verdict) => (file, config, verdict),
        Contents::Network(file, stations) => {
            return json!({ "network": file, "stations": stations, "title": title, "place": place.data() });
        }
    };
    let is_small = config.world.bodies.len() <= MANY;
    let number = |key: &&SettableKey| key.kind == "quantity" && (is_small || key.path == "loop.period");
    let ranges: BTreeMap<&str, Vec<[f64; 2]>> = (config.keys().iter().filter(number))
        .filter_map(|key| Some((key.path.as_str(), range(config, key, &|| false)?)))
        .collect();
    let remedies = Some(proposal.map_or(Vec::new(), proposed));
    json!({
        "world": file,
        "ranges": ranges,
        "place": place.data(),
        "verdict": ServerMessage::Verdict(Box::new(VerdictMessage { remedies, ..(**verdict).clone() })),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::WHEEL;

    #[test]
    fn a_worlds_text_is_escaped() {
        let title = "title = \"</script><script>alert(1)</script>\"";
        let source = Source::from_text("wheel.toml", WHEEL.replace("title = \"wheel\"", title));
        let sets = vec!["loop.period=2 ms".to_string()];
        let system = System::read(&source, &sets).unwrap();
        let check = hapt_analysis::check_system(&system, false).unwrap();
        let page = &Page::new(&source, sets, &system, &check).unwrap();
        let input = PageInput {
            page,
            title: "wheel",
            proposal: None,
            place: Place::Report { command: "it's", report: "../wheel.html" },
        };
        let [(name, html), (data, text)] = files("wheel", &input);
        assert_eq!((name.as_str(), data.as_str()), ("wheel.html", "wheel.js"));
        assert!(!String::from_utf8_lossy(&html).contains("alert(1)"));
        let text = String::from_utf8(text).unwrap();
        let json = text.strip_prefix("Object.assign(window.hapt, ").unwrap().strip_suffix(");\n").unwrap();
        let data: Value = serde_json::from_str(json).unwrap();
        let file: WorldFile = serde_json::from_value(data["world"].clone()).unwrap();
        let read = file.config().unwrap();
        assert_eq!(read.world.title.as_deref(), Some("</script><script>alert(1)</script>"));
        assert_eq!(read.world.sampling.period, 2e-3);
        assert_eq!(
            (&data["place"]["command"], &data["verdict"]["certified"]),
            (&json!("it's"), &json!(check.is_certified()))
        );
        let [from, to] = [0, 1].map(|end| data["ranges"]["loop.period"][0][end].as_f64().unwrap());
        assert!(from < to);
    }

    #[test]
    fn a_page_of_one_file_loads_nothing_and_no_text_ends_its_scripts() {
        let title = "title = \"</script><script>alert(1)</script>\"";
        let source = Source::from_text("wheel.toml", WHEEL.replace("title = \"wheel\"", title));
        let system = System::read(&source, &[]).unwrap();
        let check = hapt_analysis::check_system(&system, false).unwrap();
        let page = &Page::new(&source, Vec::new(), &system, &check).unwrap();
        let page = single(&PageInput { page, title: "wheel", proposal: None, place: Place::Notebook });
        assert_eq!((page.matches("<script>").count(), page.matches("</script>").count()), (3, 3));
        assert_eq!((page.matches("<style>").count(), page.matches("</style>").count()), (1, 1));
        for away in ["<link", " src=", "@import", "alert(1)</script"] {
            assert!(!page.contains(away), "{away}");
        }
        assert!(page.contains("id=\"stage\"") && page.contains("wasm-unsafe-eval"));
    }
}
