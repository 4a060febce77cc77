//! One websocket: a page's messages to the session, the session's to the page.

use std::io::ErrorKind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use hapt_host::messages::{ClientMessage, Command, MAX_MESSAGE_BYTES, ServerMessage, VERSION};
use hyper::upgrade::Upgraded;
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncReadExt, copy, sink as nowhere};
use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{Error, Message};

use crate::allowance::{Allowance, Quota};
use crate::clients::ServerState;
use crate::counted::Counted;
use crate::sender::{Event, EventSender, Waiting};
use crate::session::to_message;

/// The largest number of messages queued for a page: two seconds of telemetry.
const MAX_QUEUED: usize = 128;
/// The time limit for the hello.
const HELLO_TIMEOUT: Duration = Duration::from_secs(5);
/// The time limit between two messages: a page sends ten heartbeats a second, in the background of a browser one a minute.
const SILENCE: Duration = Duration::from_secs(90);
/// The time limit for a page to take a message.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// The time for which messages beyond the limit are searched for a stop.
const STOP_SEARCH: Duration = Duration::from_secs(2);
/// The largest number of consecutive invalid messages.
const MAX_INVALID: u32 = 20;
/// Bytes of a message that is too long that are read, and forgotten.
const MAX_UNREAD: u64 = 1 << 20;

/// The reason that a websocket is closed: a code of RFC 6455 and a sentence.
type Close = (CloseCode, &'static str);

/// The reason for too many messages, or frames that are no complete message.
const TOO_MANY: Close = (CloseCode::Policy, "more than 200 messages a second");

/// Serves a page until either side closes the websocket.
pub async fn serve(io: TokioIo<Upgraded>, state: Arc<ServerState>, client: u64) {
    let config = WebSocketConfig::default()
        .max_message_size(Some(MAX_MESSAGE_BYTES))
        .max_frame_size(Some(MAX_MESSAGE_BYTES))
        .read_buffer_size(MAX_MESSAGE_BYTES)
        .write_buffer_size(0)
        .max_write_buffer_size(1 << 20);
    let allowance = Arc::new(Mutex::new(Allowance::new(Instant::now())));
    let io = Counted::new(io, Arc::clone(&allowance));
    let socket = WebSocketStream::from_raw_socket(io, Role::Server, Some(config)).await;
    let disconnect = Disconnect(state.sender.clone(), client);
    let (mut sink, mut stream) = socket.split();
    let (outbox, mut waiting) = mpsc::channel(MAX_QUEUED);
    let joined = AtomicBool::new(false);
    let receiving = receive(&mut stream, &state, client, outbox, &allowance, &joined);
    let sending = async {
        while let Some(message) = waiting.recv().await {
            if !matches!(timeout(WRITE_TIMEOUT, sink.send(message)).await, Ok(Ok(()))) {
                return (CloseCode::Away, "");
            }
        }
        (CloseCode::Policy, "the page does not read its messages")
    };
    let (code, reason) = tokio::select! {
        close = receiving => close,
        close = sending => close,
    };
    drop(disconnect);
    // The server closes it: a stop that the page has sent before still counts.
    if !matches!(code, CloseCode::Normal | CloseCode::Protocol) && joined.load(Ordering::Relaxed) {
        let _ = timeout(STOP_SEARCH, find_stop(&mut stream, &state, client)).await;
    }
    // The queued messages, and the reason, as long as the page reads them.
    let last = async {
        while let Ok(message) = waiting.try_recv() {
            sink.send(message).await?;
        }
        sink.send(Message::Close(Some(CloseFrame { code, reason: reason.into() }))).await
    };
    let _ = timeout(Duration::from_secs(1), last).await;
    // Closed with bytes unread, the connection would be reset, and the page would not receive the reason.
    if let (CloseCode::Size, Ok(mut socket)) = (code, sink.reunite(stream)) {
        let mut rest = socket.get_mut().take(MAX_UNREAD);
        let _ = timeout(Duration::from_secs(1), copy(&mut rest, &mut nowhere())).await;
    }
}

/// Receives a page's messages; the reason for closing.
async fn receive(
    stream: &mut (impl StreamExt<Item = Result<Message, Error>> + Unpin),
    state: &ServerState,
    client: u64,
    outbox: mpsc::Sender<Message>,
    allowance: &Mutex<Allowance>,
    joined: &AtomicBool,
) -> Close {
    let waiting = Waiting::default();
    let (mut strikes, mut is_over) = (0, false);
    // Owned here until the session owns it: the queue closes when the session drops it.
    let (weak, mut own) = (outbox.downgrade(), Some(outbox));
    let answer = |sentence: String| {
        weak.upgrade()
            .is_some_and(|outbox| outbox.try_send(to_message(&ServerMessage::Error { message: sentence })).is_ok())
    };
    let opened = tokio::time::Instant::now();
    loop {
        let until = if own.is_none() { tokio::time::Instant::now() + SILENCE } else { opened + HELLO_TIMEOUT };
        let (text, is_ping) = match tokio::time::timeout_at(until, stream.next()).await {
            Err(_) => return (CloseCode::Policy, "no message for too long"),
            Ok(None | Some(Ok(Message::Close(_)))) => return (CloseCode::Normal, ""),
            Ok(Some(Err(Error::Capacity(_)))) => return (CloseCode::Size, "a message has at most 4 KiB"),
            Ok(Some(Err(Error::Io(error)))) if error.kind() == ErrorKind::QuotaExceeded => return TOO_MANY,
            Ok(Some(Err(_))) => return (CloseCode::Protocol, ""),
            Ok(Some(Ok(Message::Text(text)))) => (Some(text), false),
            // The library answers them.
            Ok(Some(Ok(Message::Ping(_) | Message::Pong(_)))) => (None, true),
            Ok(Some(Ok(_))) => (None, false),
        };
        let parsed = match &text {
            Some(text) => ClientMessage::read(text.as_str()),
            None => Err("expected a text message".into()),
        };
        // A stop counts beyond every limit.
        let is_stop = matches!(parsed, Ok(ClientMessage::Command { command: Command::Stop }));
        if is_stop && own.is_none() {
            state.sender.send(client, ClientMessage::Command { command: Command::Stop }, &waiting);
        }
        let left = allowance.lock().unwrap_or_else(PoisonError::into_inner).spend(Instant::now());
        match left {
            Quota::Within => is_over = false,
            Quota::Exceeded => {
                if !std::mem::replace(&mut is_over, true) && !answer(TOO_MANY.1.into()) {
                    return TOO_MANY;
                }
                continue;
            }
            Quota::Exhausted => return TOO_MANY,
        }
        if is_ping {
            continue;
        }
        let outcome = match parsed {
            Ok(ClientMessage::Hello { v, .. }) if v != VERSION => {
                Err(format!("the server has version {VERSION} of the protocol, the page {v}: reload the page"))
            }
            Ok(parsed) => match (own.take(), parsed) {
                (None, parsed) => {
                    state.message_from(client);
                    match is_stop || state.sender.send(client, parsed, &waiting) {
                        true => Ok(true),
                        // Not closed: a stop may follow.
                        false => Ok(answer("the server is overloaded: this message was dropped".into())),
                    }
                }
                (Some(outbox), ClientMessage::Hello { token, .. }) => {
                    if !state.access.knows(token.as_deref()) {
                        answer("the token is wrong or missing: open the link that hapt live printed".into());
                        return (CloseCode::Policy, "token");
                    }
                    if !state.make_page(client) {
                        return (CloseCode::Again, "too many pages are open");
                    }
                    joined.store(true, Ordering::Relaxed);
                    Ok(state.sender.notify(Event::Joined(client, outbox)))
                }
                (early, _) => {
                    own = early;
                    Err("the first message must be hello".into())
                }
            },
            Err(message) => Err(message),
        };
        match outcome {
            Ok(true) => strikes = 0,
            Ok(false) => return (CloseCode::Again, "the page does not read its messages, or the server is overloaded"),
            Err(message) => {
                strikes += 1;
                if strikes >= MAX_INVALID || !answer(message) {
                    return (CloseCode::Policy, "too many invalid messages in a row");
                }
            }
        }
    }
}

/// Searches the messages of a page beyond the limits for a stop.
async fn find_stop(
    stream: &mut (impl StreamExt<Item = Result<Message, Error>> + Unpin),
    state: &ServerState,
    client: u64,
) {
    while let Some(Ok(message)) = stream.next().await {
        let parsed = message.to_text().map_or(Err(String::new()), ClientMessage::read);
        if let Ok(parsed @ ClientMessage::Command { command: Command::Stop }) = parsed {
            state.sender.send(client, parsed, &Waiting::default());
            return;
        }
    }
}

/// Reports that a page has disconnected, however its task ends.
struct Disconnect(EventSender, u64);

impl Drop for Disconnect {
    fn drop(&mut self) {
        self.0.notify(Event::Left(self.1));
    }
}
