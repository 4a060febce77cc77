//! The lists of connections and of websockets.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::task::AbortHandle;

use crate::access::Access;
use crate::sender::EventSender;

/// The largest number of websockets after their hello, and before it.
const MAX_PAGES: usize = 64;
const MAX_PENDING: usize = 64;
/// A page that has sent nothing for this time is closed where another needs its place.
const MAX_SILENCE: Duration = Duration::from_secs(10);

/// The state shared by all connections.
pub struct ServerState {
    pub(crate) access: Access,
    pub(crate) sender: EventSender,
    /// The next client's number.
    clients: AtomicU64,
    /// Websockets, the oldest first.
    sockets: Mutex<VecDeque<Socket>>,
    /// Connections that are no websockets, the oldest first.
    connections: Mutex<VecDeque<(u64, AbortHandle)>>,
}

/// A websocket.
struct Socket {
    client: u64,
    /// Whether its hello was accepted, with the token where one is required.
    is_page: bool,
    last_message: Instant,
    task: Option<AbortHandle>,
}

impl ServerState {
    pub(crate) fn new(access: Access, sender: EventSender) -> Self {
        let clients = AtomicU64::new(1);
        ServerState { access, sender, clients, sockets: Mutex::default(), connections: Mutex::default() }
    }

    /// Stores the task of a websocket.
    pub(crate) fn served_by(&self, client: u64, task: AbortHandle) {
        if let Some(socket) = self.sockets().iter_mut().find(|socket| socket.client == client) {
            socket.task = Some(task);
        }
    }

    /// Admits a websocket before its hello; the oldest such is closed where there are too many.
    pub(crate) fn admit(self: &Arc<Self>) -> Place {
        let client = self.clients.fetch_add(1, Ordering::Relaxed);
        let mut sockets = self.sockets();
        let pending = sockets.iter().filter(|socket| !socket.is_page).count();
        if pending >= MAX_PENDING
            && let Some(oldest) = sockets.iter().position(|socket| !socket.is_page)
            && let Some(Socket { task: Some(task), .. }) = sockets.remove(oldest)
        {
            task.abort();
        }
        sockets.push_back(Socket { client, is_page: false, last_message: Instant::now(), task: None });
        Place { client, state: Arc::clone(self) }
    }

    /// Whether there is a place for one more page, possibly that of a silent one without control.
    pub(crate) fn has_room(&self, now: Instant) -> bool {
        let sockets = self.sockets();
        let is_silent = |socket: &Socket| self.is_replaceable(socket, now);
        sockets.iter().filter(|socket| socket.is_page).count() < MAX_PAGES || sockets.iter().any(is_silent)
    }

    fn is_replaceable(&self, socket: &Socket, now: Instant) -> bool {
        socket.is_page
            && !self.sender.is_in_control(socket.client)
            && now.saturating_duration_since(socket.last_message) > MAX_SILENCE
    }

    /// Makes a client a page after its hello; `false`: there is no place.
    pub(crate) fn make_page(&self, client: u64) -> bool {
        let now = Instant::now();
        let mut sockets = self.sockets();
        if sockets.iter().filter(|socket| socket.is_page).count() >= MAX_PAGES {
            let silent = sockets.iter().enumerate().filter(|(_, socket)| self.is_replaceable(socket, now));
            let Some((longest, _)) = silent.min_by_key(|(_, socket)| socket.last_message) else { return false };
            if let Some(Socket { task: Some(task), .. }) = sockets.remove(longest) {
                task.abort();
            }
        }
        let own = sockets.iter_mut().find(|socket| socket.client == client);
        own.map(|socket| (socket.is_page, socket.last_message) = (true, now)).is_some()
    }

    /// Records the time of a client's message.
    pub(crate) fn message_from(&self, client: u64) {
        if let Some(socket) = self.sockets().iter_mut().find(|socket| socket.client == client) {
            socket.last_message = Instant::now();
        }
    }

    fn sockets(&self) -> MutexGuard<'_, VecDeque<Socket>> {
        self.sockets.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn connections(&self) -> MutexGuard<'_, VecDeque<(u64, AbortHandle)>> {
        self.connections.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A websocket's place in the list, given back when it ends.
pub(crate) struct Place {
    pub client: u64,
    state: Arc<ServerState>,
}

impl Drop for Place {
    fn drop(&mut self) {
        self.state.sockets().retain(|socket| socket.client != self.client);
    }
}
