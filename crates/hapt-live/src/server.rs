//! The server: connections in, the page and the websockets out, on a thread of its own.
//!
//! A connection costs a place in a short list. When the list is full the oldest gives way to the newest, so that a thousand connections
//! that say nothing never keep the page from anybody. Websockets that have not said hello have such a list of their own, and of those that
//! have, one that is silent gives way. Nothing here reaches the loop but through the desk's door.

use std::collections::VecDeque;
use std::net::TcpListener;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::TcpStream;
use tokio::sync::oneshot;
use tokio::task::AbortHandle;

use crate::access::Access;
use crate::desk::Door;
use crate::http::{Answer, answer};
use crate::socket;

/// Connections that are no websockets.
const CONNECTIONS: usize = 256;
/// Websockets of pages that have said hello, and of those that have not yet.
const PAGES: usize = 64;
const STRANGERS: usize = 64;
/// A page that has said nothing for so long gives way to another, where there is no room.
const SILENT: Duration = Duration::from_secs(10);
/// A request's head comes within this, or never.
const PATIENCE: Duration = Duration::from_secs(10);
/// And is no longer than this in bytes, with so many headers.
const HEAD: usize = 16 * 1024;
const FIELDS: usize = 64;

/// A server at work. Dropped, it ends.
pub struct Server {
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Server {
    fn drop(&mut self) {
        drop(self.end.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What every connection knows.
pub struct House {
    pub(crate) access: Access,
    pub(crate) door: Door,
    /// The next client's number.
    clients: AtomicU64,
    /// Websockets, the oldest first.
    seats: Mutex<VecDeque<Seat>>,
    /// Connections that are no websockets, the oldest first.
    guests: Mutex<VecDeque<(u64, AbortHandle)>>,
}

/// A websocket's place.
struct Seat {
    client: u64,
    /// It has said hello, with the token where one is asked for.
    is_page: bool,
    heard: Instant,
    task: Option<AbortHandle>,
}

impl House {
    /// A place for a websocket that has said nothing; the oldest such gives way.
    fn seat(self: &Arc<Self>) -> Place {
        let client = self.clients.fetch_add(1, Ordering::Relaxed);
        let mut seats = self.seats();
        let strangers = seats.iter().filter(|seat| !seat.is_page).count();
        if strangers >= STRANGERS
            && let Some(oldest) = seats.iter().position(|seat| !seat.is_page)
            && let Some(Seat { task: Some(task), .. }) = seats.remove(oldest)
        {
            task.abort();
        }
        seats.push_back(Seat { client, is_page: false, heard: Instant::now(), task: None });
        Place { client, house: Arc::clone(self) }
    }

    /// Whether there is a place for one more page; a silent one that has no control gives way.
    fn has_room(&self, now: Instant) -> bool {
        let seats = self.seats();
        let is_silent = |seat: &Seat| self.gives_way(seat, now);
        seats.iter().filter(|seat| seat.is_page).count() < PAGES || seats.iter().any(is_silent)
    }

    fn gives_way(&self, seat: &Seat, now: Instant) -> bool {
        seat.is_page && !self.door.is_held_by(seat.client) && now.saturating_duration_since(seat.heard) > SILENT
    }

    /// A client has said hello; `false`: there is no place.
    pub(crate) fn is_page(&self, client: u64) -> bool {
        let now = Instant::now();
        let mut seats = self.seats();
        if seats.iter().filter(|seat| seat.is_page).count() >= PAGES {
            let silent = seats.iter().enumerate().filter(|(_, seat)| self.gives_way(seat, now));
            let Some((longest, _)) = silent.min_by_key(|(_, seat)| seat.heard) else { return false };
            if let Some(Seat { task: Some(task), .. }) = seats.remove(longest) {
                task.abort();
            }
        }
        let own = seats.iter_mut().find(|seat| seat.client == client);
        own.map(|seat| (seat.is_page, seat.heard) = (true, now)).is_some()
    }

    /// A client has said something.
    pub(crate) fn heard(&self, client: u64) {
        if let Some(seat) = self.seats().iter_mut().find(|seat| seat.client == client) {
            seat.heard = Instant::now();
        }
    }

    fn seats(&self) -> MutexGuard<'_, VecDeque<Seat>> {
        self.seats.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn guests(&self) -> MutexGuard<'_, VecDeque<(u64, AbortHandle)>> {
        self.guests.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Starts the server on a listener that does not block.
///
/// # Errors
/// The system gives no thread, or no way to wait.
pub fn start(listener: TcpListener, access: Access, door: Door) -> std::io::Result<Server> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    let listener = {
        let _context = runtime.enter();
        tokio::net::TcpListener::from_std(listener)?
    };
    let (end, ended) = oneshot::channel();
    let thread = std::thread::Builder::new().name("server".into()).spawn(move || {
        let house = Arc::new(House {
            access,
            door,
            clients: AtomicU64::new(1),
            seats: Mutex::default(),
            guests: Mutex::default(),
        });
        runtime.block_on(async {
            tokio::select! {
                () = welcome(&listener, &house) => {}
                _ = ended => {}
            }
        });
        // Whatever else runs ends with the runtime.
    })?;
    Ok(Server { end: Some(end), thread: Some(thread) })
}

/// Lets connections in, for ever.
async fn welcome(listener: &tokio::net::TcpListener, house: &Arc<House>) {
    for number in 0_u64.. {
        match listener.accept().await {
            Ok((stream, _)) => {
                let own = Arc::clone(house);
                let mut guests = house.guests();
                if guests.len() >= CONNECTIONS
                    && let Some((_, oldest)) = guests.pop_front()
                {
                    oldest.abort();
                }
                let task = tokio::spawn(async move {
                    let _leaving = Leaving { number, house: Arc::clone(&own) };
                    receive(stream, own).await;
                });
                guests.push_back((number, task.abort_handle()));
            }
            // Out of file descriptors, or gone before it was let in: the oldest gives way, and a little later there is room.
            Err(_) => {
                if let Some((_, oldest)) = house.guests().pop_front() {
                    oldest.abort();
                }
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        }
    }
}

/// Takes a connection off the list, however it ends.
struct Leaving {
    number: u64,
    house: Arc<House>,
}

impl Drop for Leaving {
    fn drop(&mut self) {
        self.house.guests().retain(|(number, _)| *number != self.number);
    }
}

/// Serves one connection to its end, or until it is a websocket.
async fn receive(stream: TcpStream, house: Arc<House>) {
    let _ = stream.set_nodelay(true);
    let service = service_fn(|mut request| {
        let house = Arc::clone(&house);
        async move {
            let is_full = !house.has_room(Instant::now());
            let response = match answer(&request, &house.access, is_full) {
                Answer::Plain(response) => response,
                Answer::Socket(response) => {
                    let place = house.seat();
                    let client = place.client;
                    let upgrade = hyper::upgrade::on(&mut request);
                    let own = Arc::clone(&house);
                    let task = tokio::spawn(async move {
                        let place = place;
                        if let Ok(Ok(upgraded)) = tokio::time::timeout(PATIENCE, upgrade).await {
                            socket::talk(TokioIo::new(upgraded), own, place.client).await;
                        }
                    });
                    if let Some(seat) = house.seats().iter_mut().find(|seat| seat.client == client) {
                        seat.task = Some(task.abort_handle());
                    }
                    response
                }
            };
            Ok::<_, std::convert::Infallible>(response)
        }
    });
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(PATIENCE).max_buf_size(HEAD).max_headers(FIELDS);
    // A connection that breaks off or speaks no HTTP is nobody's fault here.
    let _ = http.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
}

/// A websocket's place, given back when it ends.
struct Place {
    client: u64,
    house: Arc<House>,
}

impl Drop for Place {
    fn drop(&mut self) {
        self.house.seats().retain(|seat| seat.client != self.client);
    }
}
