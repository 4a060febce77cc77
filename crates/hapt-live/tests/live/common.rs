//! A page without a browser.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use hapt_live::{Live, Options};
use hapt_model::Source;
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::handshake::client::Request;
use tokio_tungstenite::tungstenite::{Error, Message, WebSocket, client};

/// A time beyond which a test fails: far longer than on the slowest machine.
const TEST_TIMEOUT: Duration = Duration::from_secs(60);

/// A wheel on a spring to the puck, the puck on one to ground: a released puck returns.
pub const WORLD: &str = r#"title = "wheel"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
limit = "822.25 N mm"
[bodies.wheel]
inertia = "0.02580123 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "17.8 N mm/deg"
[[couplings]]
kind = "spring"
between = ["puck", "ground"]
stiffness = "10 N mm/deg"
[scenarios.step]
duration = "600 s"
hand = { kind = "step", to = "20 deg" }
[scenarios.push]
duration = "1 s"
hand = { kind = "torque", moves = { kind = "step", to = "5 N mm" } }
"#;

/// A chain of `bodies` bodies on springs between the puck and ground.
pub fn many_bodies(bodies: usize) -> String {
    let mut world =
        String::from("[loop]\nperiod = \"1 ms\"\n[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\nlimit = 0.8\n");
    let mut before = "puck".to_string();
    for body in 0..bodies {
        world += &format!("[bodies.b{body}]\ninertia = 0.01\n");
    }
    for body in 0..bodies {
        world += &format!("[[couplings]]\nkind = \"spring\"\nbetween = [\"{before}\", \"b{body}\"]\nstiffness = 0.5\n");
        before = format!("b{body}");
    }
    world
}

/// A server on a free port of the loopback.
pub fn live(world: &str) -> Live {
    live_at(world, "127.0.0.1:0")
}

pub fn live_at(world: &str, address: &str) -> Live {
    let source = Source::from_text("wheel.toml", world);
    let address = address.parse().unwrap();
    Live::start(Options { worlds: vec![source], sets: Vec::new(), address, token: false, folder: ".".into() }).unwrap()
}

/// Sends heartbeats and requests to arm, until the torque has faded in.
pub fn arm(page: &mut Page) {
    loop {
        page.say(json!({ "type": "alive" }));
        let status = page.receive("status");
        assert_ne!(status["phase"], "faulted", "{status}");
        match status["phase"].as_str() {
            Some("running") => return,
            Some("disarmed") => page.say(json!({ "type": "order", "order": "arm" })),
            _ => {}
        }
    }
}

/// The server's answer to these bytes, up to the end of the connection.
pub fn answer(address: SocketAddr, request: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(TEST_TIMEOUT)).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The status of an answer.
pub fn status(answer: &str) -> u16 {
    answer.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or_else(|| panic!("no status in {answer:?}"))
}

/// A page that is connected.
pub struct Page {
    socket: WebSocket<TcpStream>,
}

/// A frame of the telemetry.
pub struct Frame {
    pub generation: u32,
    pub time: f64,
    /// Last, smallest, largest.
    pub columns: Vec<[f32; 3]>,
}

impl Page {
    /// A websocket before its hello.
    pub fn open(live: &Live) -> Page {
        Page::connect(live.address()).unwrap_or_else(|error| panic!("{error}"))
    }

    pub fn connect(address: SocketAddr) -> Result<Page, String> {
        let stream = TcpStream::connect(address).map_err(|error| error.to_string())?;
        stream.set_read_timeout(Some(TEST_TIMEOUT)).unwrap();
        let request = Request::builder()
            .uri(format!("ws://{address}/ws"))
            .header("Host", address.to_string())
            .header("Origin", format!("http://{address}"))
            .header("Connection", "Upgrade")
            .header("Upgrade", "websocket")
            .header("Sec-WebSocket-Version", "13")
            .header("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ==")
            .body(())
            .unwrap();
        client(request, stream).map(|(socket, _)| Page { socket }).map_err(|error| error.to_string())
    }

    /// A websocket after its hello and the answer.
    pub fn new(live: &Live) -> (Page, Value) {
        let mut page = Page::open(live);
        // With a motor the link has a token.
        let token = live.link().split_once('#').map(|(_, token)| token);
        page.say(json!({ "type": "hello", "v": 1, "token": token }));
        let hello = page.receive("hello");
        (page, hello)
    }

    pub fn say(&mut self, message: Value) {
        self.socket.send(Message::text(message.to_string())).unwrap();
    }

    /// Sends a message; returns whether that succeeded.
    pub fn send(&mut self, message: Message) -> bool {
        self.socket.send(message).is_ok()
    }

    /// The next message of this type; earlier ones are dropped.
    pub fn receive(&mut self, kind: &str) -> Value {
        self.receive_until(kind, |_| true)
    }

    /// The next message of one of these types.
    pub fn receive_any(&mut self, kinds: &[&str]) -> Value {
        loop {
            match self.socket.read().unwrap_or_else(|error| panic!("none of {kinds:?}: {error}")) {
                Message::Text(text) => {
                    let value: Value = serde_json::from_str(&text).unwrap();
                    if kinds.iter().any(|kind| value["type"] == *kind) {
                        return value;
                    }
                }
                Message::Close(why) => panic!("none of {kinds:?}, but closed: {why:?}"),
                _ => {}
            }
        }
    }

    /// The next message of this type of which `wanted` is true.
    pub fn receive_until(&mut self, kind: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        self.wait(kind, wanted, false)
    }

    /// The same, with heartbeats.
    pub fn stay_until(&mut self, kind: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        self.wait(kind, wanted, true)
    }

    fn wait(&mut self, kind: &str, wanted: impl Fn(&Value) -> bool, stays: bool) -> Value {
        // A page sends ten heartbeats per second; the server accepts two hundred messages.
        for message in 0.. {
            if stays && message % 4 == 0 {
                self.say(json!({ "type": "alive" }));
            }
            match self.socket.read().unwrap_or_else(|error| panic!("no {kind}: {error}")) {
                Message::Text(text) => {
                    let value: Value = serde_json::from_str(&text).unwrap();
                    if value["type"] == kind && wanted(&value) {
                        return value;
                    }
                }
                Message::Close(why) => panic!("no {kind}, but closed: {why:?}"),
                _ => {}
            }
        }
        unreachable!("a page receives without end")
    }

    /// The next frame of the telemetry.
    pub fn frame(&mut self) -> Frame {
        self.frame_until(|_| true)
    }

    pub fn frame_until(&mut self, wanted: impl Fn(&Frame) -> bool) -> Frame {
        loop {
            if let Message::Binary(bytes) = self.socket.read().unwrap() {
                let frame = Frame::read(&bytes);
                if wanted(&frame) {
                    return frame;
                }
            }
        }
    }

    /// The code with which the server closes; earlier messages are dropped.
    pub fn closed(&mut self) -> u16 {
        loop {
            match self.socket.read() {
                Ok(Message::Close(Some(why))) => return why.code.into(),
                Ok(_) => {}
                // It was closed while messages were being sent: the last ones are lost.
                Err(Error::Io(_) | Error::Protocol(_) | Error::ConnectionClosed) => return 0,
                Err(error) => panic!("{error}"),
            }
        }
    }
}

impl Frame {
    fn read(bytes: &[u8]) -> Frame {
        assert_eq!(bytes[..2], [1, 1], "version and kind");
        let columns = usize::from(u16::from_le_bytes(bytes[2..4].try_into().unwrap()));
        assert_eq!(bytes.len(), 16 + 12 * columns);
        let numbers: Vec<f32> =
            bytes[16..].chunks(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect();
        Frame {
            generation: u32::from_le_bytes(bytes[4..8].try_into().unwrap()),
            time: f64::from_le_bytes(bytes[8..16].try_into().unwrap()),
            columns: numbers.chunks(3).map(|three| [three[0], three[1], three[2]]).collect(),
        }
    }
}
