//! Reports to an importer: statuses, categories, messages.

/// The severity of a message, and the result of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    /// Done.
    Ok,
    /// Done, with a remark.
    Warning,
    /// Not done; the instance is unchanged, or has failed permanently.
    Error,
    /// A defect of hapt: the instance can only be freed.
    Fatal,
}

impl Status {
    /// The category of its messages.
    pub fn category(self) -> &'static str {
        match self {
            Status::Ok => "logEvents",
            Status::Warning => "logStatusWarning",
            Status::Error => "logStatusError",
            Status::Fatal => "logStatusFatal",
        }
    }
}

/// The categories with their contents, as in the model description.
pub const CATEGORIES: [(&str, &str); 5] = [
    ("logEvents", "Initialisation, changes of parameters, reset, end."),
    ("logStatusWarning", "What may be meant otherwise."),
    ("logStatusError", "Why a call was refused."),
    ("logStatusFatal", "A defect of hapt."),
    ("logAll", "All of these."),
];

/// The importer's logger.
pub type Sink = Box<dyn Fn(Status, &str)>;

/// The filter of messages to the importer's logger. Errors always pass.
pub struct Log {
    sink: Sink,
    is_on: bool,
    /// Empty: all.
    categories: Vec<&'static str>,
}

impl Log {
    /// Every category, where `is_on`.
    pub fn new(sink: Sink, is_on: bool) -> Log {
        Log { sink, is_on, categories: Vec::new() }
    }

    /// Turns debug messages on or off, in these categories; an empty list means all.
    ///
    /// # Errors
    /// In a sentence: a category that does not exist. Then nothing is changed.
    pub fn set(&mut self, is_on: bool, names: &[String]) -> Result<(), String> {
        let known = |name: &String| {
            let row = CATEGORIES.iter().find(|(known, _)| known == name);
            row.map(|(known, _)| *known).ok_or_else(|| {
                format!("there is no log category {name:?}; there are {}", CATEGORIES.map(|(name, _)| name).join(", "))
            })
        };
        let chosen = names.iter().map(known).collect::<Result<Vec<_>, _>>()?;
        self.categories = if chosen.contains(&"logAll") { Vec::new() } else { chosen };
        self.is_on = is_on;
        Ok(())
    }

    /// Passes a message on, if it is an error or its category is on.
    pub fn say(&self, status: Status, message: &str) {
        let is_chosen = self.categories.is_empty() || self.categories.contains(&status.category());
        if status >= Status::Error || (self.is_on && is_chosen) {
            (self.sink)(status, message);
        }
    }
}

impl std::fmt::Debug for Log {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Log").field("is_on", &self.is_on).field("categories", &self.categories).finish_non_exhaustive()
    }
}
