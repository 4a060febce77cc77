//! What a page says.

use serde::Deserialize;

use super::VERSION;

/// The longest message that a page may send, in bytes.
pub const LONGEST: usize = 4096;

/// How far a hand may mean to be, in rad (linear: m), either way.
pub const FARTHEST: f64 = 1e4;

/// The longest key, value, or scenario's name, in bytes.
const LONGEST_WORD: usize = 256;

/// What a page says.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum Said {
    /// The first thing: its version, and the token of a link that asks for one.
    Hello {
        /// [`VERSION`].
        v: u32,
        /// From the link's fragment.
        token: Option<String>,
    },
    /// It wants control.
    Take,
    /// It gives control away.
    Give,
    /// To the supervisor; `stop` from anybody.
    Order {
        /// What for.
        order: Wish,
    },
    /// The hand on a simulated puck.
    Hand {
        /// Whether it holds.
        grip: bool,
        /// Where it means to be, rad (linear: m).
        #[serde(default)]
        position: f64,
    },
    /// A key of the world.
    Set {
        /// Its dotted path.
        key: String,
        /// As it would stand in the world file: `20 N mm/deg`.
        value: String,
    },
    /// Several keys together, all of them or none.
    Sets {
        /// Each with its value, as in `Set`.
        sets: Vec<(String, String)>,
    },
    /// Every key as the file has it.
    Reset,
    /// The simulated puck at rest at 0 again, the world at its start, and armed.
    Restart,
    /// Run a scenario's hand; `None`: end it.
    Scenario {
        /// Its name.
        name: Option<String>,
    },
    /// Record, or end the recording.
    Record {
        /// Whether to.
        on: bool,
    },
    /// The key whose certified range is wanted first.
    Focus {
        /// Its dotted path.
        key: String,
    },
    /// The page is there.
    Alive,
}

/// What somebody asks of the supervisor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Wish {
    /// Fade in.
    Arm,
    /// Fade out.
    Disarm,
    /// The torque is 0 now.
    Stop,
    /// From faulted to disarmed.
    Clear,
}

impl Said {
    /// Reads a message, or says in a sentence why it is none.
    pub fn read(text: &str) -> Result<Said, String> {
        let said: Said = serde_json::from_str(text).map_err(|error| {
            let why: String = error.to_string().chars().take(LONGEST_WORD).collect();
            format!("no message of version {VERSION}: {why}")
        })?;
        let words: Vec<&str> = match &said {
            Said::Hello { token: Some(token), .. } => vec![token],
            Said::Set { key, value } => vec![key, value],
            Said::Sets { sets } => sets.iter().flat_map(|(key, value)| [key.as_str(), value]).collect(),
            Said::Scenario { name: Some(name) } => vec![name],
            Said::Focus { key } => vec![key],
            Said::Hand { position, .. } if position.is_nan() || position.abs() > FARTHEST => {
                return Err(format!("a hand's position is within {FARTHEST} either way"));
            }
            _ => Vec::new(),
        };
        match words.iter().any(|word| word.len() > LONGEST_WORD) {
            true => Err(format!("a key, a value, a name has at most {LONGEST_WORD} bytes")),
            false => Ok(said),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_message_of_the_page_reads() {
        for (text, said) in [
            (r#"{"type":"hello","v":1}"#, Said::Hello { v: 1, token: None }),
            (r#"{"type":"hello","v":1,"token":"ab"}"#, Said::Hello { v: 1, token: Some("ab".into()) }),
            (r#"{"type":"take"}"#, Said::Take),
            (r#"{"type":"give"}"#, Said::Give),
            (r#"{"type":"order","order":"arm"}"#, Said::Order { order: Wish::Arm }),
            (r#"{"type":"order","order":"stop"}"#, Said::Order { order: Wish::Stop }),
            (r#"{"type":"hand","grip":true,"position":-0.5}"#, Said::Hand { grip: true, position: -0.5 }),
            (r#"{"type":"hand","grip":false}"#, Said::Hand { grip: false, position: 0.0 }),
            (
                r#"{"type":"set","key":"loop.period","value":"2 ms"}"#,
                Said::Set { key: "loop.period".into(), value: "2 ms".into() },
            ),
            (
                r#"{"type":"sets","sets":[["loop.period","2 ms"],["loop.delay","0 s"]]}"#,
                Said::Sets { sets: vec![("loop.period".into(), "2 ms".into()), ("loop.delay".into(), "0 s".into())] },
            ),
            (r#"{"type":"reset"}"#, Said::Reset),
            (r#"{"type":"restart"}"#, Said::Restart),
            (r#"{"type":"scenario","name":"step"}"#, Said::Scenario { name: Some("step".into()) }),
            (r#"{"type":"scenario","name":null}"#, Said::Scenario { name: None }),
            (r#"{"type":"record","on":true}"#, Said::Record { on: true }),
            (r#"{"type":"focus","key":"loop.delay"}"#, Said::Focus { key: "loop.delay".into() }),
            (r#"{"type":"alive"}"#, Said::Alive),
            (r#"{"type":"alive","more":[1,2]}"#, Said::Alive),
        ] {
            assert_eq!(Said::read(text), Ok(said), "{text}");
        }
    }

    #[test]
    fn what_is_no_message_is_said_so_in_a_short_sentence() {
        let long = format!(r#"{{"type":"set","key":"{}","value":"1"}}"#, "k".repeat(300));
        let unknown = format!(r#"{{"type":"{}"}}"#, "x".repeat(3000));
        for text in [
            "",
            "{}",
            "[]",
            "null",
            "{\"type\":\"fly\"}",
            "{\"type\":\"order\",\"order\":\"explode\"}",
            "{\"type\":\"hand\",\"grip\":1,\"position\":0}",
            "{\"type\":\"hand\",\"grip\":true,\"position\":1e999}",
            "{\"type\":\"hand\",\"grip\":true,\"position\":1e5}",
            "{\"type\":\"hello\",\"v\":-1}",
            "{\"type\":\"sets\",\"sets\":[[\"loop.period\"]]}",
            &long,
            &unknown,
        ] {
            let error = Said::read(text).unwrap_err();
            assert!(!error.is_empty() && error.len() < 600, "{text}: {error}");
        }
    }

    proptest! {
        #[test]
        fn no_bytes_are_too_much(bytes in prop::collection::vec(any::<u8>(), 0..LONGEST)) {
            let _ = Said::read(&String::from_utf8_lossy(&bytes));
        }

        #[test]
        fn a_position_that_reads_is_one_to_go_to(position in any::<f64>(), grip in any::<bool>()) {
            let text = format!(r#"{{"type":"hand","grip":{grip},"position":{position:e}}}"#);
            if let Ok(Said::Hand { position, .. }) = Said::read(&text) {
                prop_assert!(position.abs() <= FARTHEST);
            }
        }
    }
}
