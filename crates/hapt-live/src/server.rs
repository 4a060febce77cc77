//! The server: connections in, the page and the websockets out, on a thread of its own.
//!
//! A connection costs a place in a short list. When the list is full the oldest gives way to the newest, so that a thousand connections
//! that say nothing never keep the page from anybody. Nothing here reaches the loop but through the desk's door.

use std::collections::VecDeque;
use std::net::TcpListener;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

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
/// Websockets.
const SOCKETS: usize = 64;
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
    sockets: AtomicUsize,
    /// Connections that are no websockets, the oldest first.
    guests: Mutex<VecDeque<(u64, AbortHandle)>>,
}

impl House {
    /// A number that no client has had.
    pub(crate) fn number(&self) -> u64 {
        self.clients.fetch_add(1, Ordering::Relaxed)
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
            sockets: AtomicUsize::new(0),
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
            let is_full = house.sockets.load(Ordering::Relaxed) >= SOCKETS;
            let response = match answer(&request, &house.access, is_full) {
                Answer::Plain(response) => response,
                Answer::Socket(response) => {
                    let place = Place::new(&house);
                    let upgrade = hyper::upgrade::on(&mut request);
                    tokio::spawn(async move {
                        let _place = place;
                        if let Ok(Ok(upgraded)) = tokio::time::timeout(PATIENCE, upgrade).await {
                            socket::talk(TokioIo::new(upgraded), house).await;
                        }
                    });
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
struct Place(Arc<House>);

impl Place {
    fn new(house: &Arc<House>) -> Self {
        house.sockets.fetch_add(1, Ordering::Relaxed);
        Place(Arc::clone(house))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.sockets.fetch_sub(1, Ordering::Relaxed);
    }
}
