//! Who has control: one client at a time. The first to come has it, others take it on purpose; who says nothing for
//! [`PATIENCE`] keeps it, but his hand lets go.

use std::time::{Duration, Instant};

/// So long may the client in control be silent before his hand lets go.
pub const PATIENCE: Duration = Duration::from_millis(300);

/// A client's number, never given twice.
pub type Client = u64;

/// Who has control, and when he was last heard.
#[derive(Clone, Copy, Debug, Default)]
pub struct Control {
    holder: Option<(Client, Instant)>,
}

impl Control {
    /// Who has it.
    pub fn holder(&self) -> Option<Client> {
        self.holder.map(|(client, _)| client)
    }

    /// Whether this client has it.
    pub fn is_held_by(&self, client: Client) -> bool {
        self.holder() == Some(client)
    }

    /// A client has come. Whether it has control now and had it not before.
    pub fn joined(&mut self, client: Client, now: Instant) -> bool {
        self.holder.is_none() && self.take(client, now)
    }

    /// A client takes it. Whether that changes anything.
    pub fn take(&mut self, client: Client, now: Instant) -> bool {
        let changes = !self.is_held_by(client);
        self.holder = Some((client, now));
        changes
    }

    /// A client gives it away, or has left. Whether it had it.
    pub fn leave(&mut self, client: Client) -> bool {
        let had = self.is_held_by(client);
        if had {
            self.holder = None;
        }
        had
    }

    /// A client has said something.
    pub fn heard(&mut self, client: Client, now: Instant) {
        if self.is_held_by(client) {
            self.holder = Some((client, now));
        }
    }

    /// Whether somebody has control who was heard within [`PATIENCE`].
    pub fn is_awake(&self, now: Instant) -> bool {
        self.holder.is_some_and(|(_, heard)| now.saturating_duration_since(heard) < PATIENCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_has_control_and_others_take_it_on_purpose() {
        let now = Instant::now();
        let mut control = Control::default();
        assert!(control.joined(1, now) && !control.joined(2, now));
        assert!(control.is_held_by(1) && !control.is_held_by(2));
        assert!(!control.leave(2), "who had none leaves and nothing changes");
        assert!(control.take(2, now) && !control.take(2, now));
        assert!(!control.leave(1) && control.leave(2));
        assert_eq!(control.holder(), None);
        // A page loaded anew.
        assert!(control.joined(3, now));
    }

    #[test]
    fn the_silent_are_asleep_after_their_patience_and_no_other_wakes_them() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut control = Control::default();
        assert!(!control.is_awake(at(0)));
        control.joined(1, at(0));
        assert!(control.is_awake(at(299)) && !control.is_awake(at(300)));
        control.heard(2, at(300));
        assert!(!control.is_awake(at(300)));
        control.heard(1, at(1000));
        assert!(control.is_awake(at(1299)) && !control.is_awake(at(1300)));
        assert!(control.is_held_by(1), "asleep, it keeps control");
    }
}
