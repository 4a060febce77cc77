//! The messages between a host and a board. The number of a variant is its code on the wire, and never changes; a new one comes last.
//!
//! ```text
//! host:  sequence u32   not_after u64   code   the command's fields
//! board: code   the answer's fields
//! ```
//!
//! The encoding is postcard's: u16, u32, u64 and codes as varints (LEB128), u8 and bool one byte, f32 four bytes little-endian, an option
//! a byte 0 or 1 and its value, a string or a list its length and its content.

use core::fmt;

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The version of the protocol. Only [`Command::Hello`] and [`DeviceMessage::Hello`] keep their form in every version.
pub const PROTOCOL: u16 = 1;
/// The longest frame to a board, its 0 too.
pub const MAX_FRAME_BYTES: usize = 256;
/// The largest number of bytes of a [`Command::Piece`] that fits into one frame.
pub const PIECE: usize = 224;
/// Capacity of a board: bodies, couplings, and counts of its velocity estimator (a FOAW window and one).
pub const ROOM: [usize; 3] = [4, 8, 17];
/// Bodies that [`Telemetry`] has room for.
pub const BODIES: usize = ROOM[0];

/// A frame from the host.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HostMessage<'a> {
    /// One more than that of the previous command. It never restarts: a board reports the last one in its [`Hello`].
    pub sequence: u32,
    /// The last sample at which it is accepted.
    pub not_after: u64,
    /// The command.
    #[serde(borrow)]
    pub command: Command<'a>,
}

/// A command of a host. The answer is [`DeviceMessage::Done`], [`DeviceMessage::Refused`] or the message that its documentation names.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Command<'a> {
    /// The handshake, answered by [`DeviceMessage::Hello`]. Valid with any sequence and at any time, as `Stop`.
    Hello {
        /// [`PROTOCOL`]
        protocol: u16,
    },
    /// Fault: the torque is 0 from the next sample on. Executed before all other commands.
    Stop,
    /// A heartbeat. `Arm` counts as one too, and no other command does: without a heartbeat for the world's `safety.link` the torque is removed.
    Heartbeat,
    /// Fade in.
    Arm {
        /// The hash of the world to arm: a board that runs another one refuses.
        world: u32,
    },
    /// Fade out.
    Disarm,
    /// From faulted to disarmed, once the cause has ended. A lost link has ended when a `Heartbeat` has arrived within the world's `safety.link`.
    Clear,
    /// Starts the upload of a world; discards an unfinished upload.
    Begin {
        /// Its bytes, as [`crate::pack`] makes them.
        length: u16,
        /// Their [`crate::hash`].
        hash: u32,
    },
    /// The next bytes of the upload.
    Piece {
        /// The number of bytes before these.
        at: u16,
        /// At most [`PIECE`].
        bytes: &'a [u8],
    },
    /// Ends the upload: the board checks, compiles and runs the world. Done when it runs; refused while there may be a torque.
    Commit,
    /// Answered by [`DeviceMessage::Value`].
    Get {
        /// The code of a [`Parameter`].
        parameter: u8,
    },
    /// Answered by [`DeviceMessage::Value`] with the new value.
    Set {
        /// The code of a [`Parameter`].
        parameter: u8,
        /// In the parameter's unit.
        value: u32,
    },
    /// A measurement for an externally clocked board, which takes one sample for each: answered by [`DeviceMessage::Telemetry`]. It is no
    /// heartbeat.
    Sample {
        /// Its number, greater than that of the last; those between count as missed.
        sample: u64,
        /// The puck's position in rad (linear: m).
        position: f32,
        /// Its velocity in rad/s (m/s), for the exact estimator only.
        velocity: f32,
        /// Lateness of the sample, in s.
        late: f32,
        /// A prescribed jump of a simulated hand falls on this sample; accepted where the world's limits allow it.
        announced: bool,
    },
}

hapt_core::named! {
    /// A parameter of a running board. Some are read only.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[repr(u8)]
    pub enum Parameter {
        /// Samples from one telemetry to the next, 1 to 65 535; 0: none. 0 until it is set.
        Divider = 0 => "divider",
        /// Invalid frames since the start; read only.
        Refused = 1 => "refused",
        /// Samples missed since the start; read only.
        Missed = 2 => "missed",
        /// The longest sample so far, in the board's unit of [`Telemetry::used`]; setting it restarts the maximum from that value.
        MostUsed = 3 => "most-used",
        /// Samples under a torque since the start that were later than the certificate covers, or followed a command that was; read only.
        Outside = 4 => "outside",
    }
}

impl Parameter {
    /// The parameter of a code.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|parameter| *parameter as u8 == code)
    }
}

/// A frame from the board.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum DeviceMessage<'a> {
    /// The answer to a hello.
    #[serde(borrow)]
    Hello(Hello<'a>),
    /// The command is executed.
    Done {
        /// The sequence of the command.
        sequence: u32,
    },
    /// The command is refused, and nothing has changed.
    Refused {
        /// The sequence of the command.
        sequence: u32,
        /// The reason.
        why: Refusal,
    },
    /// The value of a parameter.
    Value {
        /// The sequence of the command.
        sequence: u32,
        /// The parameter's code.
        parameter: u8,
        /// In the parameter's unit.
        value: u32,
    },
    /// The telemetry of a sample.
    Telemetry(Telemetry),
}

/// A board's identity, capacity and state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello<'a> {
    /// The board's [`PROTOCOL`].
    pub protocol: u16,
    /// The firmware's version.
    pub firmware: &'a str,
    /// The name of the board.
    pub board: &'a str,
    /// The hash of the core's source that it was built from.
    pub core: u32,
    /// The hash of the world that it runs.
    pub world: Option<u32>,
    /// The largest number of bodies of a world.
    pub bodies: u8,
    /// The largest number of couplings.
    pub couplings: u8,
    /// The longest FOAW window, in samples.
    pub window: u8,
    /// Whether it has no encoder and takes its samples from [`Command::Sample`].
    pub externally_clocked: bool,
    /// The sequence of the last command.
    pub sequence: u32,
    /// The number of the next sample.
    pub sample: u64,
    /// The period, in ns.
    pub period: u32,
    /// The supervisor's phase, as in [`Telemetry::phase`].
    pub phase: u8,
    /// The supervisor's reason, as in [`Telemetry::reason`].
    pub reason: u8,
}

/// The telemetry of one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Telemetry {
    /// One more than that of the previous telemetry: a gap counts lost messages.
    pub sequence: u32,
    /// k
    pub sample: u64,
    /// 0 disarmed, 1 fading in, 2 running, 3 fading out, 4 faulted: the order of [`hapt_core::Phase::ALL`].
    pub phase: u8,
    /// The code of a [`hapt_core::Reason`]; 0: none.
    pub reason: u8,
    /// The code of the first limit that was exceeded and only warns; 0: none.
    pub warning: u8,
    /// The puck's position as the device measured it, in rad (linear: m).
    pub position: f32,
    /// z_k, the position in the world.
    pub measured: f32,
    /// v_k, by the estimator, in rad/s (m/s).
    pub velocity: f32,
    /// The torque of the couplings, in N·m (N).
    pub torque: f32,
    /// The command: that torque after levels and limit.
    pub command: f32,
    /// The output of the supervisor, the torque of the motor.
    pub output: f32,
    /// Samples missed since the start.
    pub missed: u32,
    /// The cost of the previous sample in a unit of the board: cycles, or instructions; 0 where the board does not count.
    pub used: u32,
    /// x_k
    pub bodies: States,
    /// [`Parameter::Outside`] at this sample.
    pub outside: u32,
}

/// Positions and velocities of up to [`BODIES`] bodies. On the wire, a list of two numbers each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct States {
    count: usize,
    states: [(f32, f32); BODIES],
}

impl States {
    /// The states of the first [`BODIES`] bodies.
    pub fn new(given: impl IntoIterator<Item = (f32, f32)>) -> Self {
        let mut states = States::default();
        for (place, state) in states.states.iter_mut().zip(given) {
            *place = state;
            states.count += 1;
        }
        states
    }

    /// Each body's position in rad (linear: m) and velocity in rad/s (m/s).
    pub fn as_slice(&self) -> &[(f32, f32)] {
        self.states.get(..self.count).unwrap_or(&[])
    }
}

impl Serialize for States {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.as_slice().serialize(to)
    }
}

impl<'de> Deserialize<'de> for States {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct List;
        impl<'de> Visitor<'de> for List {
            type Value = States;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "at most {BODIES} bodies")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<States, A::Error> {
                let mut states = States::default();
                while let Some(state) = list.next_element()? {
                    let too_many = || serde::de::Error::invalid_length(BODIES + 1, &List);
                    *states.states.get_mut(states.count).ok_or_else(too_many)? = state;
                    states.count += 1;
                }
                Ok(states)
            }
        }
        from.deserialize_seq(List)
    }
}

/// The reason of a refused command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// No hello of this protocol version since the board's start.
    Hello,
    /// Its sequence is not after the last one, or far beyond it.
    Sequence,
    /// Its last valid sample is over, or more than 65 536 samples ahead.
    Late,
    /// The queue of commands is full.
    Busy,
    /// The piece is not the next one.
    Piece,
    /// The upload is incomplete, or its hash differs.
    Hash,
    /// The uploaded bytes are of another version.
    Version,
    /// The uploaded bytes are not a world.
    Bytes,
    /// The world exceeds the capacity: bytes, bodies, couplings or window.
    Room,
    /// The core refuses the world: a number is out of range.
    World,
    /// The board's timer does not support the period.
    Period,
    /// The motor has no limit: `device.limit`.
    NoLimit,
    /// The estimator needs the true velocity, which an encoder does not provide.
    Exact,
    /// The world cannot change while there may be a torque.
    Armed,
    /// The board runs no world, or another one than named.
    NoWorld,
    /// The supervisor cannot change from its phase to the requested one; telemetry has the reason.
    Phase,
    /// The board has an encoder of its own.
    NotExternallyClocked,
    /// The sample's number is not after the last one.
    Sample,
    /// No such parameter, or it is read only, or the value is out of its range.
    Parameter,
}

impl Refusal {
    /// Whether the cause is a key of the world, which an edit of its file removes.
    pub const fn is_about_the_world(self) -> bool {
        match self {
            Refusal::Room | Refusal::World | Refusal::Period | Refusal::NoLimit | Refusal::Exact => true,
            Refusal::Hello
            | Refusal::Sequence
            | Refusal::Late
            | Refusal::Busy
            | Refusal::Piece
            | Refusal::Hash
            | Refusal::Version
            | Refusal::Bytes
            | Refusal::Armed
            | Refusal::NoWorld
            | Refusal::Phase
            | Refusal::NotExternallyClocked
            | Refusal::Sample
            | Refusal::Parameter => false,
        }
    }

    /// The reason as a sentence, without a full stop.
    pub const fn sentence(self) -> &'static str {
        match self {
            Refusal::Hello => "handshake missing: it has restarted, or the protocol versions differ",
            Refusal::Sequence => "the command is not the next one: it was doubled, or came too late",
            Refusal::Late => "the command arrived too late",
            Refusal::Busy => "its queue of commands is full",
            Refusal::Piece => "a piece of the world was lost in transmission",
            Refusal::Hash => "the world was corrupted in transmission",
            Refusal::Version => "it reads worlds of another version: its firmware and this hapt are incompatible",
            Refusal::Bytes => "the data received is not a world",
            Refusal::Room => "the world is too large for it",
            Refusal::World => "a number of the world exceeds the range of its single-precision numbers",
            Refusal::Period => "its timer does not support this period: loop.period",
            Refusal::NoLimit => "the world does not give the largest torque of its motor: device.limit",
            Refusal::Exact => "an encoder does not measure the true velocity: loop.estimator",
            Refusal::Armed => "the world cannot change while there may be a torque",
            Refusal::NoWorld => "it runs another world than the one named",
            Refusal::Phase => "its supervisor does not allow that in its phase, or the cause of its fault still lasts",
            Refusal::NotExternallyClocked => "it has an encoder of its own",
            Refusal::Sample => "the sample is not after the last one",
            Refusal::Parameter => "it has no such parameter, or the value is out of range",
        }
    }
}
