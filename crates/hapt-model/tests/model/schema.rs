//! The schema agrees with the table of keys.

use hapt_model::{keys, schema};
use serde_json::Value;

#[test]
fn every_key_is_there_with_its_doc() {
    let text = schema();
    let schema: Value = serde_json::from_str(&text).unwrap();
    for key in keys::KEYS.iter().chain(keys::NETWORK) {
        let described = |table: &Value| {
            let doc = table["properties"][key.name()]["description"].as_str();
            doc.is_some_and(|doc| doc.starts_with(key.doc))
        };
        let definitions = schema["definitions"].as_object().unwrap();
        let inside = |table: &Value| {
            let each = |name: &str| described(&table["properties"][name]["additionalProperties"]);
            described(table)
                || ["loop", "device", "safety"].iter().any(|name| described(&table["properties"][*name]))
                || ["bodies", "scenarios", "stations"].iter().any(|name| each(name))
                || described(&table["properties"]["compensation"]["items"])
                || ["motor", "drive", "friction_by_position", "stribeck", "stops", "handle", "gravity", "cogging"]
                    .iter()
                    .any(|name| described(&table["properties"]["device"]["properties"][*name]))
        };
        assert!(definitions.values().any(inside), "{}", key.path);
    }
}
