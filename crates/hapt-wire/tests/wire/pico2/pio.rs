//! A state machine of the RP2350's PIO (datasheet, 11.4): the instructions that a count needs, one a clock, without side-set or delay.

/// State machine 0 with the memory of its program.
#[derive(Clone, Debug)]
pub struct StateMachine {
    pub program: [u16; 32],
    pub wrap: (u8, u8),
    pub first_pin: u32,
    /// To the left in, to the right out; the queue's words are registers that it writes.
    pub shifts_as_expected: bool,
    pub runs: bool,
    pub flags: u8,
    /// The words that it has written for the processor.
    pub words: [u32; 4],
    at: u8,
    // Their values after a reset are undefined.
    x: u32,
    y: u32,
    input: u32,
    output: u32,
}

impl StateMachine {
    /// With anything in its scratch registers.
    pub fn new(anything: u32) -> Self {
        StateMachine {
            program: [0; 32],
            wrap: (0, 31),
            first_pin: 0,
            shifts_as_expected: false,
            runs: false,
            flags: 0,
            words: [anything; 4],
            at: 0,
            x: anything,
            y: anything.rotate_left(7),
            input: anything.rotate_left(13),
            output: anything.rotate_left(21),
        }
    }

    /// A clock.
    pub fn clock(&mut self, pins: u32) {
        if self.runs {
            let at = self.at;
            self.at = if at == self.wrap.1 { self.wrap.0 } else { (at + 1) % 32 };
            self.execute(self.program[usize::from(at)], pins);
        }
    }

    /// One instruction, which may be a jump.
    pub fn execute(&mut self, instruction: u16, pins: u32) {
        assert!(self.shifts_as_expected, "another configuration of the shifts is not modelled");
        let (kind, rest) = (instruction >> 13, instruction & 0xff);
        assert_eq!(instruction >> 8 & 0x1f, 0, "delays and side-sets are not modelled: {instruction:#06x}");
        let pins = pins.rotate_right(self.first_pin);
        let (upper, lower) = (rest >> 5, rest & 0x1f);
        match (kind, upper) {
            (0, 0) => self.at = lower as u8,
            (0, 4) => {
                let (jumps, y) = (self.y != 0, self.y.wrapping_sub(1));
                self.y = y;
                if jumps {
                    self.at = lower as u8;
                }
            }
            (2, 0) => self.input = self.input << lower | pins & !(u32::MAX << lower),
            (3, 6) => {
                self.input = self.output & !(u32::MAX << lower);
                self.output >>= lower;
            }
            (4, 0) => {
                assert_eq!(lower & !3, 0x18, "a word by its number: {instruction:#06x}");
                self.words[usize::from(lower & 3)] = self.input;
            }
            (5, destination) => {
                let source = match lower & 7 {
                    0 => pins,
                    1 => self.x,
                    2 => self.y,
                    3 => 0,
                    6 => self.input,
                    7 => self.output,
                    _ => panic!("{instruction:#06x}"),
                };
                let value = match lower >> 3 {
                    0 => source,
                    1 => !source,
                    _ => panic!("{instruction:#06x}"),
                };
                match destination {
                    1 => self.x = value,
                    2 => self.y = value,
                    5 => self.at = (value % 32) as u8,
                    6 => self.input = value,
                    7 => self.output = value,
                    _ => panic!("{instruction:#06x}"),
                }
            }
            (6, 0) => self.flags |= 1 << (lower & 7),
            (7, 2) => self.y = lower.into(),
            _ => panic!("not modelled: {instruction:#06x}"),
        }
    }
}
