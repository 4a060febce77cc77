//! The modelled part of an RP2350 (datasheet): resets, clocks, pins, PWM slice 2, state machine 0 of PIO 0, watchdog. Each access of the
//! processor takes some clocks, in which the rest of the chip continues.

use std::cell::RefCell;
use std::collections::BTreeMap;

use super::pio::StateMachine;

thread_local! {
    /// Each test has its own thread, and so its own chip.
    pub static CHIP: RefCell<Chip> = RefCell::new(Chip::new(11e6, 0));
}

const ACCESS_CLOCKS: u32 = 8;
const CRYSTAL: f64 = 12e6;

const REFERENCE: usize = 0x4001_0030;
const REFERENCE_SELECTED: usize = 0x4001_0038;
const SYSTEM: usize = 0x4001_003c;
const SYSTEM_DIVIDER: usize = 0x4001_0040;
const SYSTEM_SELECTED: usize = 0x4001_0044;
const PERIPHERAL: usize = 0x4001_0048;
const WATCHDOG_RESETS: usize = 0x4001_8008;
pub const RESETS: usize = 0x4002_0000;
const RESETS_DONE: usize = 0x4002_0008;
const PINS: usize = 0x4002_8000;
const PADS: usize = 0x4003_8000;
const CRYSTAL_CONTROL: usize = 0x4004_8000;
const CRYSTAL_STATE: usize = 0x4004_8004;
const CRYSTAL_DELAY: usize = 0x4004_800c;
const PLL: usize = 0x4005_0000;
const UART: usize = 0x4007_0000;
const PWM: usize = 0x400a_8000;
const WATCHDOG: usize = 0x400d_8000;
const TICK: usize = 0x4010_8030;
const PIO: usize = 0x5020_0000;
const PORT: usize = 0xd000_0000;

/// Blocks that are held in reset at the start, with their bits.
const BLOCKS: [(usize, u32); 6] = [(PINS, 6), (PADS, 9), (PIO, 11), (PLL, 14), (PWM, 16), (UART, 26)];

pub struct Chip {
    registers: BTreeMap<usize, u32>,
    /// The ring oscillator's rate in Hz.
    ring: f64,
    anything: u32,
    /// In s.
    time: f64,
    crystal_since: Option<f64>,
    pub crystal_fails: bool,
    /// The pins driven from outside, and their levels.
    pub driven: u32,
    pub levels: u32,
    seen: [u32; 2],
    pub machine: StateMachine,
    pwm: (u32, u32),
    port: (u32, u32),
    watchdog: f64,
    pub debugging: bool,
    /// The watchdog has reset the chip.
    pub expired: bool,
    /// Clocks in which the bridge was on, and its inputs were high, and were both so.
    pub on: u32,
    pub high: [u32; 2],
    pub both_high: u32,
}

impl Chip {
    /// With a ring oscillator of this frequency in Hz, and `anything` in registers that a reset does not define.
    pub fn new(ring: f64, anything: u32) -> Self {
        Chip {
            registers: BTreeMap::new(),
            ring,
            anything,
            time: 0.0,
            crystal_since: None,
            crystal_fails: false,
            driven: 0,
            levels: 0,
            seen: [0; 2],
            machine: StateMachine::new(anything),
            pwm: (0, 0),
            port: (0, 0),
            watchdog: 0.0,
            debugging: false,
            expired: false,
            on: 0,
            high: [0; 2],
            both_high: 0,
        }
    }

    /// A register as it is, without an access.
    pub fn register(&self, at: usize) -> u32 {
        self.registers.get(&at).copied().unwrap_or(match at {
            RESETS => 0x1fff_ffff,
            SYSTEM => 0x41,
            _ if at == PLL => 1,
            _ if at == PLL + 4 => 0x2d,
            _ if at == PLL + 0xc => 0x77000,
            _ if (PADS + 4..PADS + 0xc4).contains(&at) => 0x116,
            _ if (PINS..PINS + 0x180).contains(&at) => 0x1f,
            _ if at == PWM + 0x2c => 0x10,
            _ if at == PWM + 0x38 => 0xffff,
            _ if at == WATCHDOG => 7 << 24,
            _ => 0,
        })
    }

    pub fn put(&mut self, at: usize, value: u32) {
        self.registers.insert(at, value);
    }

    fn is_in_reset(&self, block: usize) -> bool {
        BLOCKS.iter().any(|&(at, bit)| at == block && self.register(RESETS) & 1 << bit != 0)
    }

    fn crystal(&self) -> Option<f64> {
        let delay = f64::from(self.register(CRYSTAL_DELAY)) * 256.0 / CRYSTAL;
        let runs = self.crystal_since.is_some_and(|since| self.time >= since + delay.max(1e-3));
        (runs && !self.crystal_fails).then_some(CRYSTAL)
    }

    /// Locked: its oscillator's rate in Hz.
    fn oscillator(&self) -> Option<f64> {
        let rate = self.crystal()? / f64::from(self.register(PLL) & 0x3f) * f64::from(self.register(PLL + 8));
        (self.register(PLL + 4) & 0x21 == 0 && (750e6..=1600e6).contains(&rate)).then_some(rate)
    }

    fn reference(&self) -> f64 {
        assert_eq!(self.register(REFERENCE) & 3, 0, "the reference clock is not the ring oscillator");
        self.ring
    }

    /// The processor's clock in Hz.
    pub fn system(&self) -> f64 {
        let control = self.register(SYSTEM);
        let divider = self.registers.get(&SYSTEM_DIVIDER).map_or(1.0, |x| f64::from(*x) / 65536.0);
        let source = match (control & 1, control >> 5 & 7) {
            (0, _) => self.reference(),
            (_, 2) => self.ring,
            (_, 0) => {
                assert_eq!(self.register(PLL + 4) & 8, 0, "the PLL's dividers are off");
                let dividers = self.register(PLL + 0xc);
                let rate = self.oscillator().unwrap_or(if self.crystal_fails { 100e6 } else { 0.0 });
                rate / f64::from(dividers >> 16 & 7) / f64::from(dividers >> 12 & 7)
            }
            other => panic!("a clock that is not modelled: {other:?}"),
        };
        assert!(source > 1e6, "the processor has no clock");
        source / divider
    }

    /// The UART's rate in baud.
    pub fn baud(&self) -> f64 {
        assert_eq!(self.register(PERIPHERAL), 1 << 11, "its clock");
        assert_eq!(self.register(UART + 0x2c), 0x70, "8 bits, no parity, its queues");
        assert_eq!(self.register(UART + 0x30), 0x301, "on, both ways");
        let divider = f64::from(self.register(UART + 0x24)) + f64::from(self.register(UART + 0x28)) / 64.0;
        self.system() / 16.0 / divider
    }

    /// So many clocks of the processor.
    pub fn pass(&mut self, clocks: u32) {
        // Nothing but an access changes these.
        let second = 1.0 / self.system();
        let ticks = self.watchdogs_ticks() * second;
        let (pins, pio_runs) = (self.inputs(), !self.is_in_reset(PIO));
        let (pwm_runs, top, duties) =
            (self.register(PWM + 0x28) & 1 != 0, self.register(PWM + 0x38), self.register(PWM + 0x34));
        assert!(!pwm_runs || self.register(PWM + 0x2c) == 0x10, "its divider");
        let (enabled, connected) = (self.is_enabled(), [self.connects(4, 4), self.connects(5, 4)]);
        for passed in 1..=clocks {
            self.time += second;
            // Two flip-flops stand before the PIO.
            let seen = self.seen[1];
            self.seen = [pins, self.seen[0]];
            if pio_runs {
                self.machine.clock(seen);
            }
            if pwm_runs {
                self.pwm.0 += 1;
                if self.pwm.0 > top {
                    // Duties count from the next period on.
                    self.pwm = (0, duties);
                }
            }
            if enabled {
                let high = [0, 1].map(|i| connected[i] && self.pwm.0 < self.pwm.1 >> (16 * i) & 0xffff);
                self.on += 1;
                self.high[0] += u32::from(high[0]);
                self.high[1] += u32::from(high[1]);
                self.both_high += u32::from(high == [true; 2]);
            }
            self.watchdog -= ticks;
            if ticks > 0.0 && self.watchdog <= 0.0 {
                // All but the oscillators; then it restarts in the bootrom.
                assert_eq!(self.register(WATCHDOG_RESETS), 0x01ff_fff3);
                *self = Chip { expired: true, time: self.time, ..Chip::new(self.ring, self.anything) };
                return self.pass(clocks - passed);
            }
        }
    }

    /// The watchdog's ticks a second.
    fn watchdogs_ticks(&self) -> f64 {
        let control = self.register(WATCHDOG);
        let pauses = self.debugging && control & 7 << 24 != 0;
        let runs = control & 1 << 30 != 0 && !pauses && self.register(TICK) & 1 != 0;
        if runs { self.reference() / f64::from(self.register(TICK + 4)) } else { 0.0 }
    }

    /// A pad's connection: it is not isolated, and has this function.
    fn connects(&self, pin: usize, function: u32) -> bool {
        self.register(PINS + 8 * pin + 4) == function && self.register(PADS + 4 + 4 * pin) & 1 << 8 == 0
    }

    fn inputs(&self) -> u32 {
        let level = |pin: usize| {
            let pad = self.register(PADS + 4 + 4 * pin);
            let outside = if self.driven & 1 << pin != 0 { self.levels & 1 << pin != 0 } else { pad & 1 << 3 != 0 };
            u32::from(outside && pad & (1 << 8 | 1 << 6) == 1 << 6) << pin
        };
        [2, 3, 7].into_iter().map(level).sum()
    }

    /// Whether the bridge's enable is high.
    pub fn is_enabled(&self) -> bool {
        let (out, outputs) = self.port;
        out & outputs & 1 << 6 != 0 && self.connects(6, 5)
    }

    pub fn read(&mut self, at: usize) -> u32 {
        self.pass(ACCESS_CLOCKS);
        let value = self.register(at);
        match at {
            RESETS_DONE => !self.register(RESETS) & 0x1fff_ffff,
            REFERENCE_SELECTED => 1 << (self.register(REFERENCE) & 3),
            SYSTEM_SELECTED => 1 << (self.register(SYSTEM) & 1),
            CRYSTAL_STATE => u32::from(self.crystal().is_some()) << 31,
            PLL => value & 0x3f | u32::from(self.oscillator().is_some()) << 31,
            WATCHDOG => value | self.watchdog as u32,
            _ if at == PORT + 4 => self.inputs(),
            _ if at == PWM + 0x30 => self.pwm.0,
            _ if at == PIO + 0x30 => self.machine.flags.into(),
            _ if at == PIO + 0x128 => self.machine.words[0],
            _ => value,
        }
    }

    pub fn write(&mut self, at: usize, value: u32) {
        self.pass(ACCESS_CLOCKS);
        let block = if at >= PIO { at & !0xf_ffff } else { at & !0x7fff };
        assert!(!self.is_in_reset(block), "{at:#x} is held in reset");
        match at {
            SYSTEM if self.register(SYSTEM) & 1 == 1 => {
                assert_eq!((value ^ self.register(SYSTEM)) & 0xe0, 0, "the clock's source glitches");
            }
            RESETS => {
                for (start, bit) in BLOCKS.into_iter().filter(|(_, bit)| value & 1 << bit != 0) {
                    let end = start + if start == PIO { 0x1000 } else { 0x8000 };
                    self.registers.retain(|at, _| !(start..end).contains(at));
                    let used = self.register(SYSTEM) & 0xe1 == 1;
                    assert!(start != PLL || !used, "the PLL is reset while the processor has its clock (bit {bit})");
                    match start {
                        PIO => self.machine = StateMachine::new(self.anything),
                        PWM => self.pwm = (0, 0),
                        _ => {}
                    }
                }
            }
            CRYSTAL_CONTROL => {
                assert_eq!(value, 0xfab << 12 | 0xaa0);
                self.crystal_since = self.crystal_since.or(Some(self.time));
            }
            _ if at == PORT + 0x18 => self.port.0 |= value,
            _ if at == PORT + 0x20 => self.port.0 &= !value,
            _ if at == PORT + 0x38 => self.port.1 |= value,
            _ if at == WATCHDOG + 4 => self.watchdog = f64::from(value & 0xff_ffff),
            _ if at == PIO => self.machine.runs = value == 1,
            _ if at == PIO + 0x30 => self.machine.flags &= !(value as u8),
            _ if (PIO + 0x48..PIO + 0xc8).contains(&at) => {
                self.machine.program[(at - PIO - 0x48) / 4] = value as u16;
            }
            _ if at == PIO + 0xcc => {
                assert_eq!(value & !(0x1f << 12 | 0x1f << 7), 0);
                self.machine.wrap = ((value >> 7 & 0x1f) as u8, (value >> 12 & 0x1f) as u8);
            }
            _ if at == PIO + 0xd0 => self.machine.shifts_as_expected = value == 1 << 19 | 1 << 15,
            _ if at == PIO + 0xd8 => {
                let pins = self.seen[1];
                self.machine.execute(value as u16, pins);
            }
            _ if at == PIO + 0xdc => self.machine.first_pin = value >> 15 & 0x1f,
            _ => {}
        }
        self.registers.insert(at, value);
    }
}
