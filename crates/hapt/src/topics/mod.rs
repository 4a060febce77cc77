//! The texts of `hapt explain`, one row a topic, one file a group of them.
//!
//! About ten lines of at most 100 columns each. A line that begins with two blanks and `hapt` is a command that runs; what
//! stands beside it, after three blanks or more, is in its output. So no number here can grow old.

mod analyses;
mod device;
mod messages;
mod methods;
mod verdict;
mod world;

/// One topic.
pub struct Topic {
    /// What it is asked for by.
    pub name: &'static str,
    /// Other words for it.
    pub aliases: &'static [&'static str],
    /// What it is about, for the list.
    pub line: &'static str,
    /// The whole text.
    pub text: &'static str,
}

/// Every topic: the verdict first, then the basic words, the methods, the loop, the device, and what messages say.
pub fn topics() -> impl Iterator<Item = &'static Topic> {
    [verdict::TOPICS, world::TOPICS, analyses::TOPICS, methods::TOPICS, device::TOPICS, messages::TOPICS]
        .into_iter()
        .flatten()
}
