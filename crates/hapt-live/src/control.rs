//! Control: one client has it at a time. The first client gets it, others take it by a request. A client that sends nothing for [`CONTROL_TIMEOUT`] keeps
//! control, but its hand releases the puck.

use std::time::{Duration, Instant};

/// The time without a message of the client in control after which its hand releases the puck.
pub const CONTROL_TIMEOUT: Duration = Duration::from_millis(300);

/// A client's number, never used twice.
pub type Client = u64;

/// The client in control, and the time of its last message.
#[derive(Clone, Copy, Debug, Default)]
pub struct Control {
    holder: Option<(Client, Instant)>,
}

impl Control {
    /// The client in control.
    pub fn holder(&self) -> Option<Client> {
        self.holder.map(|(client, _)| client)
    }

    /// Whether this client has control.
    pub fn is_held_by(&self, client: Client) -> bool {
        self.holder() == Some(client)
    }

    /// Adds a client; returns whether it gets control.
    pub fn joined(&mut self, client: Client, now: Instant) -> bool {
        self.holder.is_none() && self.take(client, now)
    }

    /// Gives a client control; returns whether that is a change.
    pub fn take(&mut self, client: Client, now: Instant) -> bool {
        let changes = !self.is_held_by(client);
        self.holder = Some((client, now));
        changes
    }

    /// Takes control from a client that gives it up or has disconnected; returns whether it had control.
    pub fn leave(&mut self, client: Client) -> bool {
        let had = self.is_held_by(client);
        if had {
            self.holder = None;
        }
        had
    }

    /// Records the time of a client's message.
    pub fn message_from(&mut self, client: Client, now: Instant) {
        if self.is_held_by(client) {
            self.holder = Some((client, now));
        }
    }

    /// Whether a client has control and its last message came within [`CONTROL_TIMEOUT`].
    pub fn is_responsive(&self, now: Instant) -> bool {
        self.holder.is_some_and(|(_, last)| now.saturating_duration_since(last) < CONTROL_TIMEOUT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_client_gets_control_and_others_take_it_by_a_request() {
        let now = Instant::now();
        let mut control = Control::default();
        assert!(control.joined(1, now) && !control.joined(2, now));
        assert!(control.is_held_by(1) && !control.is_held_by(2));
        assert!(!control.leave(2), "a client without control leaves and nothing changes");
        assert!(control.take(2, now) && !control.take(2, now));
        assert!(!control.leave(1) && control.leave(2));
        assert_eq!(control.holder(), None);
        // A reloaded page.
        assert!(control.joined(3, now));
    }

    #[test]
    fn a_silent_client_is_unresponsive_although_other_clients_send() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut control = Control::default();
        assert!(!control.is_responsive(at(0)));
        control.joined(1, at(0));
        assert!(control.is_responsive(at(299)) && !control.is_responsive(at(300)));
        control.message_from(2, at(300));
        assert!(!control.is_responsive(at(300)));
        control.message_from(1, at(1000));
        assert!(control.is_responsive(at(1299)) && !control.is_responsive(at(1300)));
        assert!(control.is_held_by(1), "unresponsive, it keeps control");
    }
}
