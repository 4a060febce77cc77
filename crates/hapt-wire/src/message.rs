//! What a host and a board say to each other. The number of a variant is its code on the wire, and never changes; a new one comes last.
//!
//! ```text
//! host:  sequence u32   not_after u64   code   the order's fields
//! board: code   the answer's fields
//! ```
//!
//! Everything is postcard's: u16, u32, u64 and codes as varints (LEB128), u8 and bool one byte, f32 four bytes little-endian, an option
//! a byte 0 or 1 before what is there, a string or a list its length before it.

use core::fmt;

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The version of everything said here. Only [`Order::Hello`] and [`DeviceMessage::Hello`] keep their form in every version.
pub const PROTOCOL: u16 = 1;
/// The longest frame to a board, its 0 too.
pub const LONGEST: usize = 256;
/// The most bytes of a [`Order::Piece`] that fit into one.
pub const PIECE: usize = 224;
/// Bodies and couplings that a board has room for, and counts that its sensor remembers (a FOAW window and one).
pub const ROOM: [usize; 3] = [4, 8, 17];
/// Bodies that [`Telemetry`] has room for.
pub const BODIES: usize = ROOM[0];

/// A frame from the host.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Command<'a> {
    /// One more than that of the command before. It never begins anew: a board says in its [`Hello`] how far it is.
    pub sequence: u32,
    /// The sample after which it is refused.
    pub not_after: u64,
    /// What is to be done.
    #[serde(borrow)]
    pub order: Order<'a>,
}

/// What a host may ask for. Each is answered by [`DeviceMessage::Done`], [`DeviceMessage::Refused`] or what stands beside it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Order<'a> {
    /// The first word, answered by [`DeviceMessage::Hello`]. It counts with any sequence and at any time, as `Stop` does.
    Hello {
        /// [`PROTOCOL`]
        protocol: u16,
    },
    /// The torque is 0 from the next sample on, and the supervisor faulted. Ahead of all other orders.
    Stop,
    /// The host is there. `Arm` says so too, and nothing else does: without either for the world's `safety.link`, the torque goes away.
    Heartbeat,
    /// Fade in.
    Arm {
        /// The hash of the world that is meant: no other is armed.
        world: u32,
    },
    /// Fade out.
    Disarm,
    /// From faulted, the cause gone: disarmed. After a lost link it is gone when `Alive` has come within the world's `safety.link`.
    Clear,
    /// A world is about to come, in place of one that has come in part.
    Begin {
        /// Its bytes, as [`crate::pack`] makes them.
        length: u16,
        /// Their [`crate::hash`].
        hash: u32,
    },
    /// The next bytes of it.
    Piece {
        /// How many came before.
        at: u16,
        /// At most [`PIECE`].
        bytes: &'a [u8],
    },
    /// All of it is there: check it, compile it, and run it from now on. Done when it runs; refused while there may be a torque.
    Commit,
    /// Answered by [`DeviceMessage::Value`].
    Get {
        /// The code of a [`Parameter`].
        parameter: u8,
    },
    /// Answered by [`DeviceMessage::Value`], with the value as it is then.
    Set {
        /// The code of a [`Parameter`].
        parameter: u8,
        /// In the parameter's unit.
        value: u32,
    },
    /// A sample for a board without an encoder of its own, which takes one sample at each: answered by [`DeviceMessage::Telemetry`]. It does not
    /// say that the host is there.
    Sample {
        /// Its number, greater than that of the last; those between count as missed.
        sample: u64,
        /// The puck's position in rad (linear: m).
        position: f32,
        /// Its velocity in rad/s (m/s), for the exact estimator only.
        velocity: f32,
        /// How long after its instant the sample is taken, in s.
        late: f32,
        /// A prescribed jump of a simulated hand falls on this sample; believed where the world's limits say so.
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
    /// To a hello.
    #[serde(borrow)]
    Hello(Hello<'a>),
    /// It is done.
    Done {
        /// The command's.
        sequence: u32,
    },
    /// It is not, and nothing has changed.
    Refused {
        /// The command's.
        sequence: u32,
        /// Why not.
        why: Refusal,
    },
    /// A parameter.
    Value {
        /// The command's.
        sequence: u32,
        /// Its code.
        parameter: u8,
        /// In its unit.
        value: u32,
    },
    /// A sample.
    Telemetry(Telemetry),
}

/// What a board is, and how far it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello<'a> {
    /// The board's [`PROTOCOL`].
    pub protocol: u16,
    /// The firmware's version.
    pub firmware: &'a str,
    /// What the board is called.
    pub board: &'a str,
    /// The hash of the core's source that it was built from.
    pub core: u32,
    /// The hash of the world that it runs.
    pub world: Option<u32>,
    /// Bodies that a world may have here.
    pub bodies: u8,
    /// Couplings.
    pub couplings: u8,
    /// The longest FOAW window, in samples.
    pub window: u8,
    /// Whether it has no encoder, and waits for [`Order::Sample`].
    pub externally_clocked: bool,
    /// The last command's.
    pub sequence: u32,
    /// The number of the sample that comes next.
    pub sample: u64,
    /// The period, in ns.
    pub period: u32,
    /// The supervisor's, as in [`Telemetry::phase`].
    pub phase: u8,
    /// As in [`Telemetry::reason`].
    pub reason: u8,
}

/// One sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Telemetry {
    /// One more than that of the telemetry before: a gap is what was lost on the way.
    pub sequence: u32,
    /// k
    pub sample: u64,
    /// 0 disarmed, 1 fading in, 2 running, 3 fading out, 4 faulted: the order of [`hapt_core::Phase::ALL`].
    pub phase: u8,
    /// The code of a [`hapt_core::Reason`]; 0: none.
    pub reason: u8,
    /// What would have tripped where the supervisor only warns; 0: nothing.
    pub warning: u8,
    /// The puck's position as the device gave it, in rad (linear: m).
    pub position: f32,
    /// z_k, as the world saw it.
    pub measured: f32,
    /// v_k, by the estimator, in rad/s (m/s).
    pub velocity: f32,
    /// From the couplings, in N·m (N).
    pub torque: f32,
    /// After levels and limit.
    pub command: f32,
    /// What the motor was asked for: after the supervisor.
    pub output: f32,
    /// Samples missed since the start.
    pub missed: u32,
    /// What the sample before took, in a unit of the board's: cycles, or instructions; 0 where nobody counts.
    pub used: u32,
    /// x_k
    pub bodies: States,
}

/// Positions and velocities of up to [`BODIES`] bodies. On the wire, a list of two numbers each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct States {
    count: usize,
    states: [(f32, f32); BODIES],
}

impl States {
    /// The first [`BODIES`] of these.
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

/// Why a command is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// No hello of this version came before it, since the board has started.
    Hello,
    /// Its sequence is not after the last one's, or far beyond it.
    Sequence,
    /// The sample after which it does not count is over, or more than 65 536 samples ahead.
    Late,
    /// Others are still waiting.
    Busy,
    /// The piece is not the next one.
    Piece,
    /// The bytes are not all there, or not those that were announced.
    Hash,
    /// They are of another version.
    Version,
    /// They are no world.
    Bytes,
    /// The world has more bytes, bodies, couplings or a longer window than there is room for.
    Room,
    /// The core refuses it: a number out of range.
    World,
    /// Its period is none that the board's timer keeps.
    Period,
    /// Its motor has no limit: `device.limit`.
    NoLimit,
    /// Its estimator wants a true velocity, which an encoder does not give.
    Exact,
    /// While there may be a torque, no world is changed.
    Armed,
    /// There is no world, or another one than is meant.
    NoWorld,
    /// The supervisor does not go there from where it is: telemetry says why.
    Phase,
    /// The board has an encoder of its own.
    NotExternallyClocked,
    /// The sample is not after the last.
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

    /// What a person may make of it.
    pub const fn sentence(self) -> &'static str {
        match self {
            Refusal::Hello => "handshake missing: it has restarted, or the protocol versions differ",
            Refusal::Sequence => "the command is not the next one: it was doubled, or came too late",
            Refusal::Late => "the command's time was over when it came",
            Refusal::Busy => "it is still busy with commands that came before",
            Refusal::Piece => "a piece of the world was lost on the way",
            Refusal::Hash => "the world did not come as it was sent",
            Refusal::Version => "it reads worlds of another version: its firmware and this hapt do not fit together",
            Refusal::Bytes => "the data received is not a world",
            Refusal::Room => "the world is too large for it",
            Refusal::World => "a number of the world is out of the range of its own numbers",
            Refusal::Period => "its timer does not keep this period: loop.period",
            Refusal::NoLimit => "the world does not give the largest torque of its motor: device.limit",
            Refusal::Exact => "an encoder gives no true velocity: loop.estimator",
            Refusal::Armed => "while there may be a torque, it changes no world",
            Refusal::NoWorld => "it runs another world than the one that is meant",
            Refusal::Phase => "its supervisor does not allow that in its phase, or the cause of its fault still lasts",
            Refusal::NotExternallyClocked => "it has an encoder of its own",
            Refusal::Sample => "the sample is not after the last one",
            Refusal::Parameter => "it has no such parameter, or not that value of it",
        }
    }
}
