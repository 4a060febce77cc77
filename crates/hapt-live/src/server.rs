//! The server: accepts connections and serves the page and the websockets, on its own thread.
//!
//! Connections are in short lists. In a full list the oldest connection is closed for the newest, so that a thousand silent connections
//! never block the page. Websockets before their hello have a separate list; of those after it, a silent one is closed. Only
//! [`EventSender`] connects the server to the loop.
//!
//! This needs hyper without axum: axum serves its own connections and returns complete messages, and permits neither lists that close the oldest
//! connection nor counting the frames below a message (`counted.rs`).

use std::net::TcpListener;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::TcpStream;
use tokio::sync::oneshot;

use crate::access::Access;
use crate::clients::ServerState;
use crate::http::{Reply, reply};
use crate::sender::EventSender;
use crate::socket;

/// The largest number of connections that are no websockets.
const MAX_CONNECTIONS: usize = 256;
/// The time limit for a request's head.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(10);
/// The largest size of a request's head in bytes, and the largest number of its headers.
const MAX_HEAD_BYTES: usize = 16 * 1024;
const MAX_HEADERS: usize = 64;

/// A running server. Dropped, it ends.
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

/// Starts the server on a listener that does not block.
///
/// # Errors
/// The system gives no thread, or no way to wait.
pub fn start(listener: TcpListener, access: Access, sender: EventSender) -> std::io::Result<Server> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    let listener = {
        let _context = runtime.enter();
        tokio::net::TcpListener::from_std(listener)?
    };
    let (end, ended) = oneshot::channel();
    let thread = std::thread::Builder::new().name("server".into()).spawn(move || {
        let state = Arc::new(ServerState::new(access, sender));
        runtime.block_on(async {
            tokio::select! {
                () = accept(&listener, &state) => {}
                _ = ended => {}
            }
        });
        // All other tasks end with the runtime.
    })?;
    Ok(Server { end: Some(end), thread: Some(thread) })
}

/// Accepts connections, without end.
async fn accept(listener: &tokio::net::TcpListener, state: &Arc<ServerState>) {
    for number in 0_u64.. {
        match listener.accept().await {
            Ok((stream, _)) => {
                let own = Arc::clone(state);
                let mut connections = state.connections();
                if connections.len() >= MAX_CONNECTIONS
                    && let Some((_, oldest)) = connections.pop_front()
                {
                    oldest.abort();
                }
                let task = tokio::spawn(async move {
                    let _listed = Listed { number, state: Arc::clone(&own) };
                    serve(stream, own).await;
                });
                connections.push_back((number, task.abort_handle()));
            }
            // Out of file descriptors, or the connection was closed already: the oldest is closed, and accepting continues after a short wait.
            Err(_) => {
                if let Some((_, oldest)) = state.connections().pop_front() {
                    oldest.abort();
                }
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        }
    }
}

/// Removes a connection from the list, however it ends.
struct Listed {
    number: u64,
    state: Arc<ServerState>,
}

impl Drop for Listed {
    fn drop(&mut self) {
        self.state.connections().retain(|(number, _)| *number != self.number);
    }
}

/// Serves one connection until it ends or becomes a websocket.
async fn serve(stream: TcpStream, state: Arc<ServerState>) {
    let _ = stream.set_nodelay(true);
    let service = service_fn(|mut request| {
        let state = Arc::clone(&state);
        async move {
            let is_full = !state.has_room(Instant::now());
            let response = match reply(&request, &state.access, is_full) {
                Reply::Plain(response) => response,
                Reply::Socket(response) => {
                    let place = state.admit();
                    let client = place.client;
                    let upgrade = hyper::upgrade::on(&mut request);
                    let own = Arc::clone(&state);
                    let task = tokio::spawn(async move {
                        let place = place;
                        if let Ok(Ok(upgraded)) = tokio::time::timeout(REQUEST_TIMEOUT, upgrade).await {
                            socket::serve(TokioIo::new(upgraded), own, place.client).await;
                        }
                    });
                    state.served_by(client, task.abort_handle());
                    response
                }
            };
            Ok::<_, std::convert::Infallible>(response)
        }
    });
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new())
        .header_read_timeout(REQUEST_TIMEOUT)
        .max_buf_size(MAX_HEAD_BYTES)
        .max_headers(MAX_HEADERS);
    // A connection that breaks off or is no HTTP is no error of the server.
    let _ = http.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
}
