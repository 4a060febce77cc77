//! The texts of `hapt explain`, one row a topic, one file a group of them.
//!
//! About ten lines of at most 100 columns each. A line that begins with two blanks and `hapt` is a command that runs; what
//! follows on the line, after three blanks or more, is in its output: tests compare it.

mod analyses;
mod device;
mod messages;
mod methods;
mod verdict;
mod world;

/// One topic.
pub struct Topic {
    /// Its name.
    pub name: &'static str,
    /// Other words for it.
    pub aliases: &'static [&'static str],
    /// Its description in the list.
    pub line: &'static str,
    /// The whole text.
    pub text: &'static str,
}

/// Every topic: the verdict first, then the basic terms, the methods, the loop, the device, and messages.
pub fn topics() -> impl Iterator<Item = &'static Topic> {
    [verdict::TOPICS, world::TOPICS, analyses::TOPICS, methods::TOPICS, device::TOPICS, messages::TOPICS]
        .into_iter()
        .flatten()
}
