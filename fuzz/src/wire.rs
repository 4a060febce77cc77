//! A board's line: arbitrary bytes, and messages with valid checksums and arbitrary content.
//!
//! An input is a row of chunks, each a length byte and as many bytes: with the top bit set they go on the line unchanged, else as a
//! frame. After each the board takes a sample.

use hapt_core::SafetyProfile;
use hapt_model::{Source, World};
use hapt_wire::device::{Board, Endpoint, Measurement, WorldStorage};
use hapt_wire::{Command, DeviceMessage, HostMessage, MAX_FRAME_BYTES, PROTOCOL, Parameter, Reader, frame, hash, pack};

use crate::messages::outcome;

const BOARD: Board = Board { name: "fuzz", firmware: "0", externally_clocked: false, periods: [5e-5, 1e-2] };
const FED: Board = Board { externally_clocked: true, ..BOARD };

const WORLD: &str = r#"
loop = { period = 1e-3, estimator = "difference" }
device = { inertia = 6.4e-4, damping = 1.2e-3, limit = 0.8, encoder = 4000 }
bodies.wheel.inertia = 0.025
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = 1
"#;

fn packed() -> Vec<u8> {
    let world = World::read(&Source::from_text("w.toml", WORLD), &[]).unwrap_or_else(|error| panic!("{error}"));
    let bytes = pack(&world.spec(), &world.limits(SafetyProfile::Certified), &mut [0; 1024]).map(<[u8]>::to_vec);
    bytes.unwrap_or_else(|error| panic!("{error}"))
}

/// A board with a world, disarmed, receives the input; the number identifies its answers.
///
/// # Panics
/// When there is a torque without arming, one beyond every limit, or the board does not answer, or stop, in the end.
pub fn run(bytes: &[u8]) -> u64 {
    let (mut one, mut other) = (WorldStorage::EMPTY, WorldStorage::EMPTY);
    let (kind, mut rest) = bytes.split_first().map_or((0, bytes), |(kind, rest)| (*kind, rest));
    let mut station = Endpoint::new(if kind & 1 == 0 { BOARD } else { FED }, &mut one, &mut other);
    let (mut answers, mut armed) = (0_u64, false);
    let mut ears = Ears { host: Reader::new(), board: Reader::new() };
    for message in session(&packed(), false) {
        ears.put(&mut station, &message, &mut answers);
    }
    let mut seen = Measurement::default();
    while let Some((length, after)) = rest.split_first() {
        let (chunk, next) = after.split_at(usize::from(length & 0x7f).min(after.len()));
        rest = next;
        let line = if length & 0x80 == 0 { stuffed(chunk) } else { chunk.to_vec() };
        armed |= ears.put(&mut station, &line, &mut answers);
        seen.position += 1e-3;
        let motor = station.sample(&seen);
        assert!(motor.torque.is_finite(), "{motor:?}");
        assert!(motor.on || motor.torque == 0.0, "{motor:?}");
        assert!(armed || !motor.on, "nobody has armed it");
        ears.listen(&mut station, &mut answers);
    }
    let before = answers;
    let last = |command| framed(u32::MAX, 0, command);
    ears.put(&mut station, &[0], &mut answers);
    ears.put(&mut station, &last(Command::Hello { protocol: PROTOCOL }), &mut answers);
    assert!(answers != before, "it does not answer any more");
    ears.put(&mut station, &last(Command::Stop), &mut answers);
    assert_eq!(station.sample(&seen), Default::default(), "it does not stop");
    before
}

/// A host's reader, and one that receives the board's input.
struct Ears {
    host: Reader<512>,
    board: Reader<MAX_FRAME_BYTES>,
}

impl Ears {
    /// Puts bytes on the line; whether an arm was among what could be read.
    fn put(&mut self, station: &mut Endpoint<'_>, bytes: &[u8], answers: &mut u64) -> bool {
        let mut armed = false;
        for byte in bytes {
            let message = self.board.push::<HostMessage<'_>>(*byte);
            armed |= message.is_some_and(|message| matches!(message.command, Command::Arm { .. }));
            station.push(*byte);
            self.listen(station, answers);
        }
        armed
    }

    fn listen(&mut self, station: &mut Endpoint<'_>, answers: &mut u64) {
        let mut room = [0; MAX_FRAME_BYTES];
        while let Some(bytes) = station.answer(&mut room) {
            let mut read = false;
            for byte in bytes {
                if let Some(says) = self.host.push::<DeviceMessage<'_>>(*byte) {
                    read = true;
                    let what = match says {
                        DeviceMessage::Refused { why, .. } => (2, why as u8),
                        DeviceMessage::Telemetry(telemetry) => (4, telemetry.phase * 16 + telemetry.reason),
                        DeviceMessage::Hello(hello) => (0, hello.phase),
                        DeviceMessage::Done { .. } => (1, 0),
                        DeviceMessage::Value { parameter, .. } => (3, parameter),
                    };
                    *answers = answers.wrapping_mul(31) ^ outcome(&what);
                }
            }
            assert!(read, "a frame of the board's that cannot be read");
        }
    }
}

fn framed(sequence: u32, not_after: u64, command: Command) -> Vec<u8> {
    let message = HostMessage { sequence, not_after, command };
    frame(&message, &mut [0; MAX_FRAME_BYTES]).map(<[u8]>::to_vec).unwrap_or_else(|error| panic!("{error}"))
}

/// A host's commands: hello, upload, and with `whole` arm, disarm, get and stop.
fn session(bytes: &[u8], whole: bool) -> Vec<Vec<u8>> {
    let mut commands = vec![Command::Hello { protocol: PROTOCOL }];
    commands.push(Command::Begin { length: bytes.len() as u16, hash: hash(bytes) });
    commands.extend(bytes.chunks(100).enumerate().map(|(i, bytes)| Command::Piece { at: 100 * i as u16, bytes }));
    commands.push(Command::Commit);
    if whole {
        let set = Command::Set { parameter: Parameter::Divider as u8, value: 1 };
        let feed = |sample| Command::Sample { sample, position: 0.1, velocity: 0.0, late: 0.0, announced: true };
        let arm = Command::Arm { world: hash(bytes) };
        commands.extend([
            set,
            arm,
            Command::Heartbeat,
            feed(20),
            feed(21),
            Command::Get { parameter: 1 },
            Command::Disarm,
        ]);
        commands.extend([Command::Stop, Command::Clear]);
    }
    (0..).zip(commands).map(|(sequence, command)| framed(sequence, 200, command)).collect()
}

/// A session on either board, as frames and as what is in them.
pub fn seeds() -> Vec<Vec<u8>> {
    let frames = session(&packed(), true);
    // The board of a run has been through the first of them.
    let later = &frames[frames.len() - 9..];
    let chunks = |frames: &[Vec<u8>], raw: bool| {
        let mut input = Vec::new();
        for frame in frames {
            let chunk = if raw { frame.clone() } else { unstuffed(frame) };
            input.push(chunk.len() as u8 | if raw { 0x80 } else { 0 });
            input.extend(chunk);
        }
        input
    };
    let all = [chunks(later, true), chunks(later, false), chunks(&frames, false), vec![0; 400], vec![0xff; 400]];
    all.into_iter().flat_map(|input| [0, 1].map(|kind| [vec![kind], input.clone()].concat())).collect()
}

/// A message as a frame, by the words of docs/wire.md.
fn stuffed(message: &[u8]) -> Vec<u8> {
    let mut sum = 0xffff_u16;
    for byte in message {
        sum ^= u16::from(*byte) << 8;
        for _ in 0..8 {
            sum = if sum & 0x8000 == 0 { sum << 1 } else { (sum << 1) ^ 0x1021 };
        }
    }
    let bytes = [message, &sum.to_le_bytes()].concat();
    // Chunks are below 128 bytes: no run is longer than COBS's 254.
    let mut frame: Vec<u8> =
        bytes.split(|byte| *byte == 0).flat_map(|run| [&[run.len() as u8 + 1], run].concat()).collect();
    frame.push(0);
    frame
}

/// And back, without its checksum.
fn unstuffed(frame: &[u8]) -> Vec<u8> {
    let (mut message, mut rest) = (Vec::new(), &frame[..frame.len() - 1]);
    while let Some((code, after)) = rest.split_first() {
        let (run, next) = after.split_at(usize::from(*code - 1));
        message.extend(run);
        message.push(0);
        rest = next;
    }
    message.truncate(message.len().saturating_sub(3));
    message
}
