//! One websocket: a page's messages to the session, the session's to the page.

use std::io::ErrorKind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use hapt_host::messages::{ClientMessage, Command, LONGEST, ServerMessage, VERSION};
use hyper::upgrade::Upgraded;
use hyper_util::rt::TokioIo;
use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{Error, Message};

use crate::counted::Counted;
use crate::sender::{Event, EventSender, Waiting};
use crate::server::ServerState;
use crate::session::to_message;

/// The most messages that wait for a page to read them: two seconds of telemetry.
const WAITING: usize = 128;
/// The time limit for the hello.
const HELLO: Duration = Duration::from_secs(5);
/// The time limit between two messages: a page sends ten heartbeats a second, in the background of a browser one a minute.
const SILENCE: Duration = Duration::from_secs(90);
/// The time limit for a page to take a message.
const STALLED: Duration = Duration::from_secs(5);
/// The most messages a second.
const RATE: f64 = 200.0;
/// How long the messages beyond the limit are searched for a stop.
const LAST: Duration = Duration::from_secs(2);
/// The most invalid messages in a row.
const STRIKES: u32 = 20;

/// Why a websocket is closed: a code of RFC 6455 and a sentence.
type Close = (CloseCode, &'static str);

/// For messages and for frames that are no whole message.
const TOO_MANY: Close = (CloseCode::Policy, "more than 200 messages a second");

/// Serves a page until either side closes the websocket.
pub async fn serve(io: TokioIo<Upgraded>, state: Arc<ServerState>, client: u64) {
    let config = WebSocketConfig::default()
        .max_message_size(Some(LONGEST))
        .max_frame_size(Some(LONGEST))
        .read_buffer_size(LONGEST)
        .write_buffer_size(0)
        .max_write_buffer_size(1 << 20);
    let allowance = Arc::new(Mutex::new(Allowance::new(Instant::now())));
    let io = Counted::new(io, Arc::clone(&allowance));
    let socket = WebSocketStream::from_raw_socket(io, Role::Server, Some(config)).await;
    let leaving = Leaving(state.sender.clone(), client);
    let (mut sink, mut stream) = socket.split();
    let (outbox, mut waiting) = mpsc::channel(WAITING);
    let joined = AtomicBool::new(false);
    let hearing = receive(&mut stream, &state, client, outbox, &allowance, &joined);
    let telling = async {
        while let Some(message) = waiting.recv().await {
            if !matches!(timeout(STALLED, sink.send(message)).await, Ok(Ok(()))) {
                return (CloseCode::Away, "");
            }
        }
        (CloseCode::Policy, "the page does not read")
    };
    let (code, reason) = tokio::select! {
        close = hearing => close,
        close = telling => close,
    };
    drop(leaving);
    // The server closes it: a stop that the page has sent before still counts.
    if !matches!(code, CloseCode::Normal | CloseCode::Protocol) && joined.load(Ordering::Relaxed) {
        let _ = timeout(LAST, stop_among(&mut stream, &state, client)).await;
    }
    // The messages that wait, and the reason, while the page takes them.
    let last = async {
        while let Ok(message) = waiting.try_recv() {
            sink.send(message).await?;
        }
        sink.send(Message::Close(Some(CloseFrame { code, reason: reason.into() }))).await
    };
    let _ = timeout(Duration::from_secs(1), last).await;
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
    let answer = |words: String| {
        weak.upgrade()
            .is_some_and(|outbox| outbox.try_send(to_message(&ServerMessage::Error { message: words })).is_ok())
    };
    let opened = tokio::time::Instant::now();
    loop {
        let until = if own.is_none() { tokio::time::Instant::now() + SILENCE } else { opened + HELLO };
        let text = match tokio::time::timeout_at(until, stream.next()).await {
            Err(_) => return (CloseCode::Policy, "the page says nothing"),
            Ok(None | Some(Ok(Message::Close(_)))) => return (CloseCode::Normal, ""),
            Ok(Some(Err(Error::Capacity(_)))) => return (CloseCode::Size, "a message has at most 4 KiB"),
            Ok(Some(Err(Error::Io(error)))) if error.kind() == ErrorKind::QuotaExceeded => return TOO_MANY,
            Ok(Some(Err(_))) => return (CloseCode::Protocol, ""),
            Ok(Some(Ok(Message::Text(text)))) => Some(text),
            Ok(Some(Ok(_))) => None,
        };
        let said = match &text {
            Some(text) => ClientMessage::read(text.as_str()),
            None => Err("messages are text".into()),
        };
        // A stop counts beyond every limit.
        let is_stop = matches!(said, Ok(ClientMessage::Order { order: Command::Stop }));
        if is_stop && own.is_none() {
            state.sender.send(client, ClientMessage::Order { order: Command::Stop }, &waiting);
        }
        let left = allowance.lock().unwrap_or_else(PoisonError::into_inner).spend(Instant::now());
        match left {
            Left::Some => is_over = false,
            Left::None => {
                if !std::mem::replace(&mut is_over, true) && !answer(TOO_MANY.1.into()) {
                    return TOO_MANY;
                }
                continue;
            }
            Left::Gone => return TOO_MANY,
        }
        let trouble = match said {
            Ok(ClientMessage::Hello { v, .. }) if v != VERSION => {
                Err(format!("this server speaks version {VERSION}, the page {v}: load it anew"))
            }
            Ok(said) => match (own.take(), said) {
                (None, said) => {
                    state.heard(client);
                    match is_stop || state.sender.send(client, said, &waiting) {
                        true => Ok(true),
                        // Not closed: a stop may follow.
                        false => Ok(answer("the server is overrun: this was dropped".into())),
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
                    Err("hello comes first".into())
                }
            },
            Err(words) => Err(words),
        };
        match trouble {
            Ok(true) => strikes = 0,
            Ok(false) => return (CloseCode::Again, "the page does not read, or the server is overrun"),
            Err(words) => {
                strikes += 1;
                if strikes >= STRIKES || !answer(words) {
                    return (CloseCode::Policy, "no messages of ours");
                }
            }
        }
    }
}

/// Searches for a stop in what a page has sent beyond the limits.
async fn stop_among(
    stream: &mut (impl StreamExt<Item = Result<Message, Error>> + Unpin),
    state: &ServerState,
    client: u64,
) {
    while let Some(Ok(message)) = stream.next().await {
        let said = message.to_text().map_or(Err(String::new()), ClientMessage::read);
        if let Ok(said @ ClientMessage::Order { order: Command::Stop }) = said {
            state.sender.send(client, said, &Waiting::default());
            return;
        }
    }
}

/// Reports that a page has disconnected, however its task ends.
struct Leaving(EventSender, u64);

impl Drop for Leaving {
    fn drop(&mut self) {
        self.0.notify(Event::Left(self.1));
    }
}

/// The state of an [`Allowance`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Left {
    /// The message is within the limit.
    Some,
    /// It is beyond the limit, and dropped.
    None,
    /// A second's worth of messages has been dropped.
    Gone,
}

/// Limits messages to a number a second, and a burst of as many.
pub struct Allowance {
    left: f64,
    at: Instant,
}

impl Allowance {
    fn new(now: Instant) -> Self {
        Allowance { left: RATE, at: now }
    }

    /// Counts one message.
    pub fn spend(&mut self, now: Instant) -> Left {
        self.left = (self.left + RATE * now.saturating_duration_since(self.at).as_secs_f64()).min(RATE);
        self.at = now;
        self.left = (self.left - 1.0).max(-RATE - 1.0);
        match self.left {
            left if left >= 0.0 => Left::Some,
            left if left >= -RATE => Left::None,
            _ => Left::Gone,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_hundred_a_second_are_allowed_and_no_more() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut steady = Allowance::new(start);
        assert!((1..=10_000).all(|n| steady.spend(at(5 * n)) == Left::Some));
        let mut burst = Allowance::new(start);
        let burst: Vec<Left> = (0..1000).map(|_| burst.spend(start)).collect();
        assert_eq!(
            [Left::Some, Left::None, Left::Gone].map(|left| burst.iter().filter(|l| **l == left).count()),
            [200, 200, 600]
        );
        let mut fast = Allowance::new(start);
        // At 1000 a second 0.8 of each are more than is earned, and 200 are saved up.
        let lasted = (1..).take_while(|n| fast.spend(at(*n)) == Left::Some).count();
        assert!((249..=251).contains(&lasted), "{lasted}");
    }
}
