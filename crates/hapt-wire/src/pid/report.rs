//! Reading and writing of the host's reports. Numbers are little-endian.

use super::descriptor::{EFFECTS, FULL, id};

/// An effect's type, in the order of the descriptor's array, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // Their names are the standard's.
pub enum Kind {
    Constant = 1,
    Ramp,
    Square,
    Sine,
    Triangle,
    SawtoothUp,
    SawtoothDown,
    Spring,
    Damper,
    Inertia,
    Friction,
}

impl Kind {
    /// All types, in that order.
    pub const ALL: [Kind; 11] = [
        Kind::Constant,
        Kind::Ramp,
        Kind::Square,
        Kind::Sine,
        Kind::Triangle,
        Kind::SawtoothUp,
        Kind::SawtoothDown,
        Kind::Spring,
        Kind::Damper,
        Kind::Inertia,
        Kind::Friction,
    ];
}

/// The properties common to effects of all types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Common {
    /// Its type.
    pub kind: Kind,
    /// ms; 65535 (and 0) without end.
    pub duration: u16,
    /// ms between the starts by a button that stays pressed; 0 and 65535: it starts once.
    pub repeat: u16,
    /// ms from the start to the first torque.
    pub delay: u16,
    /// Of 10000.
    pub gain: i16,
    /// The button that starts it, from 1; 0 and 255: none.
    pub button: u8,
    /// The origin of the force in 1/100 degree, where the effect has one. From the right (90°, or none given), a positive force turns the wheel to the
    /// left.
    pub direction: Option<u16>,
}

/// Levels of 10000, times in ms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // Their names are the standard's.
pub struct Envelope {
    pub attack_level: i16,
    pub fade_level: i16,
    pub attack_time: u16,
    pub fade_time: u16,
}

/// A condition, of 10000 each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // Their names are the standard's.
pub struct Condition {
    pub offset: i16,
    pub positive: i16,
    pub negative: i16,
    pub positive_saturation: i16,
    pub negative_saturation: i16,
    pub dead_band: i16,
}

/// Levels of 10000; the phase in 1/100 degree; the period in ms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // Their names are the standard's.
pub struct Periodic {
    pub magnitude: i16,
    pub offset: i16,
    pub phase: u16,
    pub period: u16,
}

/// An operation of the host on an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // Their names are the standard's.
pub enum Operation {
    Start = 1,
    StartSolo,
    Stop,
}

/// An operation of the host on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // Their names are the standard's.
pub enum Control {
    Enable = 1,
    Disable,
    StopAll,
    Reset,
    Pause,
    Continue,
}

/// A report to the device. Blocks are the places in the pool, from 0 (on the wire from 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // Their names are the standard's.
pub enum Report {
    Effect {
        block: usize,
        common: Common,
    },
    Envelope {
        block: usize,
        envelope: Envelope,
    },
    /// Of the first axis, or of another one (`axis` 1), which a wheel does not have.
    Condition {
        block: usize,
        axis: u8,
        condition: Condition,
    },
    Periodic {
        block: usize,
        periodic: Periodic,
    },
    Constant {
        block: usize,
        magnitude: i16,
    },
    Ramp {
        block: usize,
        start: i16,
        end: i16,
    },
    /// `loops` 0 counts as 1, 255 is without end.
    Operation {
        block: usize,
        operation: Operation,
        loops: u8,
    },
    Free {
        block: usize,
    },
    Control(Control),
    Gain(i16),
    Create(Kind),
}

/// The bytes that are left.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn word(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes([self.byte()?, self.byte()?]))
    }

    fn block(&mut self) -> Option<usize> {
        usize::from(self.byte()?).checked_sub(1).filter(|block| *block < EFFECTS)
    }

    /// Within ±10000.
    fn level(&mut self) -> Option<i16> {
        let level = i16::from_le_bytes([self.byte()?, self.byte()?]);
        (-FULL..=FULL).contains(&level).then_some(level)
    }

    /// Within 0 to 10000.
    fn share(&mut self) -> Option<i16> {
        self.level().filter(|share| *share >= 0)
    }

    fn angle(&mut self) -> Option<u16> {
        self.word().filter(|angle| *angle < 36_000)
    }

    fn one_of<T: Copy>(&mut self, all: &[T]) -> Option<T> {
        all.get(usize::from(self.byte()?).checked_sub(1)?).copied()
    }
}

impl Report {
    /// A report with its id first. `None` where the length, or any number, is outside of the descriptor's limits.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Option<Report> {
        let mut rest = Fields(bytes);
        let report = match rest.byte()? {
            id::EFFECT => {
                let block = rest.block()?;
                let kind = rest.one_of(&Kind::ALL)?;
                let (duration, repeat, delay) = (rest.word()?, rest.word()?, rest.word()?);
                let (gain, button, flags, angle) = (rest.share()?, rest.byte()?, rest.byte()?, rest.angle()?);
                let direction = (flags & 2 != 0).then_some(angle);
                Report::Effect { block, common: Common { kind, duration, repeat, delay, gain, button, direction } }
            }
            id::ENVELOPE => {
                let block = rest.block()?;
                let (attack_level, fade_level) = (rest.share()?, rest.share()?);
                let (attack_time, fade_time) = (rest.word()?, rest.word()?);
                Report::Envelope { block, envelope: Envelope { attack_level, fade_level, attack_time, fade_time } }
            }
            id::CONDITION => {
                let (block, axis) = (rest.block()?, rest.byte().filter(|axis| *axis < 2)?);
                let condition = Condition {
                    offset: rest.level()?,
                    positive: rest.level()?,
                    negative: rest.level()?,
                    positive_saturation: rest.share()?,
                    negative_saturation: rest.share()?,
                    dead_band: rest.share()?,
                };
                Report::Condition { block, axis, condition }
            }
            id::PERIODIC => {
                let block = rest.block()?;
                let (magnitude, offset) = (rest.level()?, rest.level()?);
                let (phase, period) = (rest.angle()?, rest.word()?);
                Report::Periodic { block, periodic: Periodic { magnitude, offset, phase, period } }
            }
            id::CONSTANT => Report::Constant { block: rest.block()?, magnitude: rest.level()? },
            id::RAMP => Report::Ramp { block: rest.block()?, start: rest.level()?, end: rest.level()? },
            id::OPERATION => Report::Operation {
                block: rest.block()?,
                operation: rest.one_of(&[Operation::Start, Operation::StartSolo, Operation::Stop])?,
                loops: rest.byte()?,
            },
            id::FREE => Report::Free { block: rest.block()? },
            id::CONTROL => {
                use Control::{Continue, Disable, Enable, Pause, Reset, StopAll};
                Report::Control(rest.one_of(&[Enable, Disable, StopAll, Reset, Pause, Continue])?)
            }
            id::GAIN => Report::Gain(rest.share()?),
            id::CREATE => Report::Create(rest.one_of(&Kind::ALL)?),
            _ => return None,
        };
        rest.0.is_empty().then_some(report)
    }

    /// The bytes of the report, with its id first; how many of them there are.
    #[must_use]
    pub fn write(&self) -> ([u8; LONGEST_REPORT], usize) {
        let mut out = Bytes { bytes: [0; LONGEST_REPORT], length: 0 };
        match *self {
            Report::Effect { block, common } => {
                out.start(id::EFFECT, block).byte(common.kind as u8).word(common.duration).word(common.repeat);
                out.word(common.delay).level(common.gain).byte(common.button);
                out.byte(if common.direction.is_some() { 2 } else { 1 }).word(common.direction.unwrap_or(0));
            }
            Report::Envelope { block, envelope } => {
                out.start(id::ENVELOPE, block).level(envelope.attack_level).level(envelope.fade_level);
                out.word(envelope.attack_time).word(envelope.fade_time);
            }
            Report::Condition { block, axis, condition } => {
                out.start(id::CONDITION, block).byte(axis).level(condition.offset);
                out.level(condition.positive).level(condition.negative).level(condition.positive_saturation);
                out.level(condition.negative_saturation).level(condition.dead_band);
            }
            Report::Periodic { block, periodic } => {
                out.start(id::PERIODIC, block).level(periodic.magnitude).level(periodic.offset);
                out.word(periodic.phase).word(periodic.period);
            }
            Report::Constant { block, magnitude } => {
                out.start(id::CONSTANT, block).level(magnitude);
            }
            Report::Ramp { block, start, end } => {
                out.start(id::RAMP, block).level(start).level(end);
            }
            Report::Operation { block, operation, loops } => {
                out.start(id::OPERATION, block).byte(operation as u8).byte(loops);
            }
            Report::Free { block } => {
                out.start(id::FREE, block);
            }
            Report::Control(control) => {
                out.byte(id::CONTROL).byte(control as u8);
            }
            Report::Gain(gain) => {
                out.byte(id::GAIN).level(gain);
            }
            Report::Create(kind) => {
                out.byte(id::CREATE).byte(kind as u8);
            }
        }
        (out.bytes, out.length)
    }
}

/// The input report of the wheel to the host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Input {
    /// Full scale 32767 to the right end of the steering range, -32767 to the left.
    pub steering: i16,
    /// Throttle, brake and clutch, 0 to 32767.
    pub pedals: [u16; 3],
    /// The first in the lowest bit.
    pub buttons: u16,
}

impl Input {
    /// A wheel at this position, of a steering range of twice `half`, rad; pedals and buttons at rest.
    #[must_use]
    pub fn at(position: f64, half: f64) -> Self {
        // Rounded by adding a half: `f64::round` is not available without std.
        let steps = f64::from(i16::MAX) * (position / half).clamp(-1.0, 1.0);
        Input { steering: (steps + if steps < 0.0 { -0.5 } else { 0.5 }) as i16, ..Input::default() }
    }

    /// Bytes of the report, with its id.
    pub const LENGTH: usize = 11;

    /// The bytes of the report, with its id first.
    #[must_use]
    pub fn write(&self) -> [u8; Input::LENGTH] {
        let mut out = Bytes { bytes: [0; LONGEST_REPORT], length: 0 };
        out.byte(id::WHEEL).level(self.steering.max(-i16::MAX));
        for pedal in self.pedals {
            out.word(pedal.min(32_767));
        }
        out.word(self.buttons);
        let mut report = [0; Input::LENGTH];
        report.copy_from_slice(out.bytes.split_at(Input::LENGTH).0);
        report
    }
}

/// The longest report to the device, with its id.
pub const LONGEST_REPORT: usize = 15;

struct Bytes {
    bytes: [u8; LONGEST_REPORT],
    length: usize,
}

impl Bytes {
    fn byte(&mut self, byte: u8) -> &mut Self {
        if let Some(place) = self.bytes.get_mut(self.length) {
            *place = byte;
            self.length += 1;
        }
        self
    }

    fn word(&mut self, word: u16) -> &mut Self {
        let [low, high] = word.to_le_bytes();
        self.byte(low).byte(high)
    }

    fn level(&mut self, level: i16) -> &mut Self {
        let [low, high] = level.to_le_bytes();
        self.byte(low).byte(high)
    }

    fn start(&mut self, id: u8, block: usize) -> &mut Self {
        self.byte(id).byte(block.saturating_add(1).min(255) as u8)
    }
}
