//! The messages of a page.

use serde::Deserialize;

use super::VERSION;

/// The longest message that a page may send, in bytes.
pub const MAX_MESSAGE_BYTES: usize = 4096;

/// The largest position of a hand either way, in rad (linear: m).
pub const FARTHEST: f64 = 1e4;

/// The longest key, value, or scenario's name, in bytes.
const MAX_WORD_BYTES: usize = 256;

/// What the parser's errors call a type, and what it is to the sender.
const NAMES: [(&str, &str); 11] = [
    ("usize", "a whole number from 0"),
    ("u32", "a whole number from 0"),
    ("u16", "a whole number from 0 to 65535"),
    ("variant identifier", "a name"),
    ("a tuple of size 2", "a key and a value"),
    ("an array of length 3", "three numbers"),
    ("f64", "a number"),
    ("a boolean", "true or false"),
    ("a sequence", "a list"),
    ("struct ", "an object "),
    ("internally tagged enum ClientMessage", "an object with a type"),
];

/// A message of a page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "ToServer"))]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum ClientMessage {
    /// The first message: the version, and the token where one is needed.
    Hello {
        /// [`VERSION`].
        v: u32,
        /// From the link's fragment.
        #[cfg_attr(test, ts(optional))]
        token: Option<String>,
    },
    /// Takes control.
    Take,
    /// Gives control away.
    Give,
    /// A command to the supervisor; any client may send `stop`.
    #[serde(rename = "order")]
    Command {
        /// The command.
        #[serde(rename = "order")]
        command: Command,
    },
    /// The hand on a simulated puck.
    Hand {
        /// Whether the hand holds the puck.
        grip: bool,
        /// Its position in rad (linear: m); required with the grip.
        #[serde(default = "no_position")]
        position: f64,
    },
    /// Sets a key of the world.
    Set {
        /// Its dotted path.
        key: String,
        /// As it would stand in the world file: `20 N mm/deg`.
        value: String,
    },
    /// Sets several keys, all of them or none.
    Sets {
        /// Keys with values, as in `Set`.
        sets: Vec<(String, String)>,
        /// Whether every other key goes back to the file's value.
        #[serde(default)]
        #[cfg_attr(test, ts(optional, as = "Option<bool>"))]
        only: bool,
    },
    /// Requests the world that runs as a file.
    File,
    /// Sets every key back to the file's value.
    Reset,
    /// Enters one of the session's worlds. A page without a server has one.
    #[cfg(not(target_family = "wasm"))]
    Enter {
        /// Its place, from 0.
        world: usize,
    },
    /// Restarts a simulated device: puck at rest at 0, world at its start, armed.
    Restart,
    /// Plays a scenario; `None`: ends it.
    Scenario {
        /// Its name. Only `null` ends a scenario, and no misspelt field.
        #[serde(with = "Option")]
        #[cfg_attr(test, ts(as = "Option<String>"))]
        name: Option<String>,
    },
    /// Starts or ends a recording.
    Record {
        /// Whether to record.
        on: bool,
    },
    /// Names the key whose certified range is computed first.
    Focus {
        /// Its dotted path.
        key: String,
    },
    /// Changes the simulated network that the loop is a station of.
    Network(NetworkChange),
    /// Sets the pedals and buttons of a simulated game wheel. A page without a server has none.
    #[cfg(not(target_family = "wasm"))]
    Controls(Controls),
    /// A heartbeat.
    Alive,
}

/// JSON has no such number: the field is missing.
fn no_position() -> f64 {
    f64::NAN
}

/// The pedals and buttons of a wheel for games.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Controls {
    /// Throttle, brake and clutch, 0 to 1.
    pub pedals: [f64; 3],
    /// The first in the lowest bit.
    pub buttons: u16,
}

/// A change of a simulated network, for all of its links. Omitted numbers stay.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields))]
pub struct NetworkChange {
    /// The delay of a message, 0 to 1 s.
    pub delay_s: Option<f64>,
    /// The part of the messages that is lost, 0 to 1.
    pub loss: Option<f64>,
    /// A factor on the file's stiffness, 0.001 to 10.
    pub stiffness: Option<f64>,
    /// A factor on the file's `age_max`, 0.001 to 100.
    pub age: Option<f64>,
}

impl NetworkChange {
    fn is_in_range(&self) -> bool {
        let NetworkChange { delay_s, loss, stiffness, age } = self;
        let within = |number: &Option<f64>, least: f64, most: f64| number.is_none_or(|x| x >= least && x <= most);
        within(delay_s, 0.0, 1.0) && within(loss, 0.0, 1.0) && within(stiffness, 1e-3, 10.0) && within(age, 1e-3, 100.0)
    }
}

/// A command to the supervisor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Order"))]
#[serde(rename_all = "lowercase")]
pub enum Command {
    /// Fade in.
    Arm,
    /// Fade out.
    Disarm,
    /// The torque is 0 now.
    Stop,
    /// From faulted to disarmed.
    Clear,
}

impl ClientMessage {
    /// Reads a message; the error is a sentence.
    pub fn read(text: &str) -> Result<ClientMessage, String> {
        let mut message: ClientMessage = serde_json::from_str(text).map_err(|error| {
            let plain = |text: String, (type_of_rust, name): &(&str, &str)| {
                text.replace(&format!("expected {type_of_rust}"), &format!("expected {name}"))
            };
            let why: String = NAMES.iter().fold(error.to_string(), plain).chars().take(MAX_WORD_BYTES).collect();
            format!("no message of version {VERSION}: {why}")
        })?;
        if let ClientMessage::Hand { grip, position } = &mut message
            && position.is_nan()
        {
            if *grip {
                return Err(format!("no message of version {VERSION}: missing field `position` of a hand that grips"));
            }
            *position = 0.0;
        }
        let words: Vec<&str> = match &message {
            ClientMessage::Hello { token: Some(token), .. } => vec![token],
            ClientMessage::Set { key, value } => vec![key, value],
            ClientMessage::Sets { sets, .. } => sets.iter().flat_map(|(key, value)| [key.as_str(), value]).collect(),
            ClientMessage::Scenario { name: Some(name) } => vec![name],
            ClientMessage::Focus { key } => vec![key],
            ClientMessage::Hand { position, .. } if position.abs() > FARTHEST => {
                return Err(format!("a hand's position is within {FARTHEST} either way"));
            }
            #[cfg(not(target_family = "wasm"))]
            ClientMessage::Controls(Controls { pedals, .. })
                if pedals.iter().any(|pedal| !(0.0..=1.0).contains(pedal)) =>
            {
                return Err("a pedal is pressed by 0 to 1".into());
            }
            ClientMessage::Network(change) if !change.is_in_range() => {
                return Err("a network's delay_s and loss are within 0 and 1, stiffness within 0.001 and 10, age within 0.001 and 100".into());
            }
            #[cfg(not(target_family = "wasm"))]
            ClientMessage::Controls(_) | ClientMessage::Enter { .. } => Vec::new(),
            ClientMessage::Hello { .. }
            | ClientMessage::Take
            | ClientMessage::Give
            | ClientMessage::Command { .. }
            | ClientMessage::Hand { .. }
            | ClientMessage::Reset
            | ClientMessage::File
            | ClientMessage::Restart
            | ClientMessage::Scenario { .. }
            | ClientMessage::Record { .. }
            | ClientMessage::Network(_)
            | ClientMessage::Alive => Vec::new(),
        };
        match words.iter().any(|word| word.len() > MAX_WORD_BYTES) {
            true => Err(format!("a key, a value, a name has at most {MAX_WORD_BYTES} bytes")),
            false => Ok(message),
        }
    }
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;

    #[test]
    fn every_message_of_the_page_reads() {
        for (text, message) in [
            (r#"{"type":"hello","v":1}"#, ClientMessage::Hello { v: 1, token: None }),
            (r#"{"type":"hello","v":1,"token":"ab"}"#, ClientMessage::Hello { v: 1, token: Some("ab".into()) }),
            (r#"{"type":"take"}"#, ClientMessage::Take),
            (r#"{"type":"give"}"#, ClientMessage::Give),
            (r#"{"type":"order","order":"arm"}"#, ClientMessage::Command { command: Command::Arm }),
            (r#"{"type":"order","order":"stop"}"#, ClientMessage::Command { command: Command::Stop }),
            (r#"{"type":"hand","grip":true,"position":-0.5}"#, ClientMessage::Hand { grip: true, position: -0.5 }),
            (r#"{"type":"hand","grip":false}"#, ClientMessage::Hand { grip: false, position: 0.0 }),
            (
                r#"{"type":"set","key":"loop.period","value":"2 ms"}"#,
                ClientMessage::Set { key: "loop.period".into(), value: "2 ms".into() },
            ),
            (
                r#"{"type":"sets","sets":[["loop.period","2 ms"],["loop.delay","0 s"]]}"#,
                ClientMessage::Sets {
                    sets: vec![("loop.period".into(), "2 ms".into()), ("loop.delay".into(), "0 s".into())],
                    only: false,
                },
            ),
            (r#"{"type":"sets","sets":[],"only":true}"#, ClientMessage::Sets { sets: vec![], only: true }),
            (r#"{"type":"file"}"#, ClientMessage::File),
            (r#"{"type":"reset"}"#, ClientMessage::Reset),
            (r#"{"type":"enter","world":2}"#, ClientMessage::Enter { world: 2 }),
            (r#"{"type":"restart"}"#, ClientMessage::Restart),
            (r#"{"type":"scenario","name":"step"}"#, ClientMessage::Scenario { name: Some("step".into()) }),
            (r#"{"type":"scenario","name":null}"#, ClientMessage::Scenario { name: None }),
            (r#"{"type":"record","on":true}"#, ClientMessage::Record { on: true }),
            (r#"{"type":"focus","key":"loop.delay"}"#, ClientMessage::Focus { key: "loop.delay".into() }),
            (r#"{"type":"alive"}"#, ClientMessage::Alive),
            (r#"{"type":"alive","more":[1,2]}"#, ClientMessage::Alive),
        ] {
            assert_eq!(ClientMessage::read(text), Ok(message), "{text}");
        }
    }

    #[test]
    fn other_text_is_refused_in_a_short_sentence() {
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
            "{\"type\":\"enter\",\"world\":-1}",
            "{\"type\":\"sets\",\"sets\":[[\"loop.period\"]]}",
            &long,
            &unknown,
            r#"{"type":"enter","world":-1}"#,
            r#"{"type":"enter","world":"one"}"#,
            r#"{"type":"hello","v":1.5}"#,
            r#"{"type":"hand","grip":1}"#,
            r#"{"type":"hand","grip":true,"position":"far"}"#,
            r#"{"type":"controls","pedals":1,"buttons":0}"#,
            r#"{"type":"controls","pedals":[0,0],"buttons":0}"#,
            r#"{"type":"controls","pedals":[0,0,0],"buttons":70000}"#,
            r#"{"type":"sets","sets":[["loop.period"]]}"#,
            r#"{"type":"network","loss":"all"}"#,
            r#"{"type":7}"#,
            "7",
        ] {
            let error = ClientMessage::read(text).unwrap_err();
            for word in ["usize", "u16", "u32", "f64", "enum", "struct", "tuple", "identifier", "ClientMessage"] {
                assert!(!error.contains(word), "{text}: {error}");
            }
            assert!(!error.is_empty() && error.len() < 600, "{text}: {error}");
        }
    }

    /// A misspelt field is a missing one: what the message needs is never assumed. Further fields are of later versions, and ignored.
    #[test]
    fn a_message_without_a_field_that_it_needs_is_refused_with_its_name() {
        for (text, missing) in [
            (r#"{"type":"hello","version":1}"#, "`v`"),
            (r#"{"type":"order","oder":"stop"}"#, "`order`"),
            (r#"{"type":"hand","gripp":true,"position":0.1}"#, "`grip`"),
            (r#"{"type":"hand","grip":true,"postion":0.1}"#, "`position`"),
            (r#"{"type":"hand","grip":true}"#, "`position`"),
            (r#"{"type":"set","kye":"loop.period","value":"2 ms"}"#, "`key`"),
            (r#"{"type":"set","key":"loop.period","vaule":"2 ms"}"#, "`value`"),
            (r#"{"type":"sets","set":[]}"#, "`sets`"),
            (r#"{"type":"enter","wrold":1}"#, "`world`"),
            (r#"{"type":"scenario","nmae":"step"}"#, "`name`"),
            (r#"{"type":"scenario"}"#, "`name`"),
            (r#"{"type":"record"}"#, "`on`"),
            (r#"{"type":"focus","k":"loop.period"}"#, "`key`"),
            (r#"{"type":"controls","pedal":[0,0,0],"buttons":0}"#, "`pedals`"),
            (r#"{"typ":"take"}"#, "`type`"),
        ] {
            let error = ClientMessage::read(text).unwrap_err();
            assert!(error.contains("missing field") && error.contains(missing), "{text}: {error}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..MAX_MESSAGE_BYTES)) {
            let _ = ClientMessage::read(&String::from_utf8_lossy(&bytes));
        }

        #[test]
        fn a_position_that_reads_is_in_range(position in any::<f64>(), grip in any::<bool>()) {
            let text = format!(r#"{{"type":"hand","grip":{grip},"position":{position:e}}}"#);
            if let Ok(ClientMessage::Hand { position, .. }) = ClientMessage::read(&text) {
                prop_assert!(position.abs() <= FARTHEST);
            }
        }
    }

    #[test]
    fn a_change_of_a_network_is_within_its_bounds() {
        let read = |text: &str| ClientMessage::read(&format!(r#"{{"type":"network",{text}}}"#));
        let change = NetworkChange { delay_s: Some(0.075), ..NetworkChange::default() };
        assert_eq!(read(r#""delay_s":0.075"#), Ok(ClientMessage::Network(change)));
        for wrong in [r#""delay_s":1.5"#, r#""loss":-0.1"#, r#""stiffness":0"#, r#""age":1e3"#, r#""loss":"all""#] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
