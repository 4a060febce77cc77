//! The page's types of these messages: `web/src/messages.ts` is made from them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use hapt_core::{Phase, Side};
use hapt_model::keys::{KEYS, Takes};
use hapt_model::{CouplingKind, Motion};
use ts_rs::{Config, TS, TypeVisitor};

use super::{ClientMessage, LawNumbers, ServerMessage};

impl TS for LawNumbers {
    type WithoutGenerics = Self;
    type OptionInnerType = Self;

    fn name(_: &Config) -> String {
        "Partial<Record<LawNumber, number>>".into()
    }

    fn inline(config: &Config) -> String {
        Self::name(config)
    }

    fn inline_flattened(config: &Config) -> String {
        Self::name(config)
    }
}

/// The declarations of a message and of all types in it.
struct Declarations {
    config: Config,
    /// By name: a derived type lists what it is made of in another order with every build.
    of: BTreeMap<String, String>,
}

impl Declarations {
    fn add<T: TS + 'static + ?Sized>(&mut self) {
        let name = T::name(&self.config);
        if !self.of.contains_key(&name) {
            let docs = T::docs().unwrap_or_default();
            let declared = format!("\n{docs}export {}\n", T::decl(&self.config));
            // A line for a line.
            let declared = declared
                .replace("/**\n * ", "/** ")
                .replace("\n */\n", " */\n")
                .replace(", \n", ",\n")
                .replace(" { \n", " {\n");
            self.of.insert(name, declared);
        }
        T::visit_dependencies(self);
    }
}

impl TypeVisitor for Declarations {
    fn visit<T: TS + 'static + ?Sized>(&mut self) {
        // Numbers, texts and lists have no file of their own, and no declaration.
        if T::output_path().is_some() && !self.of.contains_key(&T::name(&self.config)) {
            self.add::<T>();
        }
    }
}

fn union(name: &str, of: &[&str]) -> String {
    let names: Vec<String> = of.iter().map(|name| format!("\"{name}\"")).collect();
    format!("export type {name} = {};\n", names.join(" | "))
}

#[test]
fn the_page_has_the_types_of_the_messages() {
    let mut text = String::from(
        "// The messages of the websocket, version 1 (docs/live.md). Numbers are SI.\n\
         // Made from crates/hapt-host/src/messages: HAPT_BLESS=1 cargo test -p hapt-host --lib typescript\n\n",
    );
    let numbers: BTreeSet<&str> = (KEYS.iter())
        .filter(|key| matches!(key.takes, Takes::Quantity(..) | Takes::QuantityOr(..)))
        .filter_map(|key| key.path.strip_prefix("couplings.*."))
        .collect();
    text += &union("Phase", Phase::NAMES);
    text += &union("Motion", Motion::NAMES);
    text += &union("Side", &[Side::Above.name(), Side::Below.name()]);
    text += &union("Kind", CouplingKind::NAMES);
    text += &union("LawNumber", &Vec::from_iter(numbers));
    let config = Config::new().with_large_int("number");
    let mut all = Declarations { config, of: BTreeMap::new() };
    all.add::<ClientMessage>();
    all.add::<ServerMessage>();
    text.extend(all.of.into_values());
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web/src/messages.ts");
    if std::env::var_os("HAPT_BLESS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let there = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(there == text, "web/src/messages.ts is of other messages; HAPT_BLESS=1 writes it anew");
}
