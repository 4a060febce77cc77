//! Raspberry Pi Pico 2 (RP2350, one of its Cortex-M33) for an encoder and a brushed motor on a bridge with two inputs. **Not tried on hardware.**
//!
//! | pin | what |
//! | --- | --- |
//! | GP0, GP1 | the serial line, 921 600 baud: sent, received |
//! | GP2, GP3 | the encoder's lines A and B, pulled up |
//! | GP4, GP5 | the bridge's inputs, 20 kHz: one has the duty, the other is low |
//! | GP6 | its enable; a resistor to ground keeps it off while the board starts |
//! | GP7 | its fault, low; pulled up |
//!
//! The motor gets an open-loop voltage in proportion to the commanded torque: nothing measures or controls its current, and the bridge has
//! to limit it by itself. A turning motor's own voltage reduces the torque, which acts as a damper of kt²/R; a falling supply reduces it
//! too. The lines are for 3.3 V.
//!
//! Manual: the RP2350's datasheet (registers, bootrom).

use super::board::{Board, Device};
use super::register::Register;
use super::uart::Uart;

/// The encoder's counts a revolution, all four edges of its lines.
const COUNTS: f32 = 4096.0;
/// The bridge's supply, in V.
const SUPPLY: f32 = 12.0;
/// The motor's torque constant, in N·m/A. The sign turns the motor around.
const TORQUE_CONSTANT: f32 = 0.05;
/// The winding's and the bridge's resistance, in Ω.
const RESISTANCE: f32 = 2.0;
/// The largest duty: many a bridge has to switch to keep its upper transistors on.
const MAX_DUTY: f32 = 0.95;

/// The motor's torque at a whole duty, standing still, in N·m.
const TORQUE: f32 = TORQUE_CONSTANT * SUPPLY / RESISTANCE;

/// The board's crystal, in Hz.
const CRYSTAL: u32 = 12_000_000;

/// The definition that the bootrom searches in the flash's first 4 KiB: a program for its ARM processors, in their secure state, that
/// begins with a table of vectors (datasheet, 5.9: start; image type; last, with the size of all items; no other block; end).
#[used]
#[cfg_attr(target_os = "none", unsafe(link_section = ".image_definition"))]
pub static IMAGE_DEFINITION: [u32; 5] = [0xffff_ded3, 0x1021_0142, 0x0000_01ff, 0, 0xab12_3579];

/// The board.
pub struct Here;

impl Board for Here {
    const NAME: &'static str = "pico2";
    const CLOCK: u32 = 150_000_000;
    type Line = Uart;
    type Device = Motor;

    /// The bridge is off.
    fn cut() {
        PORT_CLEAR.set(1 << ENABLE);
        PWM_DUTIES.set(0);
    }

    fn start() -> (Uart, Motor) {
        VECTORS.set(FLASH);
        clock();
        serial();
        pwm();
        pins();
        encoder();
        let reload = watchdog();
        (
            Uart {
                state: SERIAL_STATE,
                received: SERIAL_DATA,
                sent: SERIAL_DATA,
                full: (1 << 4, false),
                free: (1 << 5, false),
            },
            Motor { on: false, reload },
        )
    }
}

/// Its encoder, its bridge and its watchdog.
pub struct Motor {
    on: bool,
    /// 20 ms of the watchdog's clock.
    reload: u32,
}

impl Device for Motor {
    fn position(&mut self) -> f32 {
        ENCODER_COUNT.get() as i32 as f32 * (core::f32::consts::TAU / COUNTS)
    }

    /// The bridge's own fault; both of the encoder's lines changed at once, so that a count is lost; the clock has left its crystal.
    fn fault(&mut self) -> bool {
        let skipped = ENCODER_FLAGS.get() & SKIPPED != 0;
        if skipped {
            // Writing 1 clears it.
            ENCODER_FLAGS.set(SKIPPED);
        }
        self.on && (skipped || PORT_IN.get() & 1 << FAULT == 0 || PLL_STATE.get() & LOCKED == 0)
    }

    fn hold(&mut self, torque: f32, on: bool) {
        let on = on && torque.is_finite();
        let part = if on { (torque / TORQUE).clamp(-MAX_DUTY, MAX_DUTY) } else { 0.0 };
        let duty = (part.abs() * PWM_PERIOD as f32) as u32;
        // The timer takes both duties over at once, at the end of its period: never are both inputs high.
        PWM_DUTIES.set(if part < 0.0 { duty << 16 } else { duty });
        (if on { PORT_SET } else { PORT_CLEAR }).set(1 << ENABLE);
        self.on = on;
    }

    fn feed(&mut self) {
        WATCHDOG_LOAD.set(self.reload);
    }
}

/// 150 MHz: the crystal · 125 / 5 / 2. The reference clock, and with it the watchdog, stays with the ring oscillator: a crystal that fails
/// does not stop the watchdog.
fn clock() {
    // Away from the PLL, which may run already where a debugger starts the program.
    REFERENCE.change(|x| x & !3);
    while REFERENCE_SELECTED.get() & 1 == 0 {}
    SYSTEM.change(|x| x & !1);
    while SYSTEM_SELECTED.get() & 1 == 0 {}
    // UART 0, PWM, PLL, PIO 0, pads, pins: reset, which also turns off the bridge's inputs and enable.
    const OWN: u32 = 1 << 26 | 1 << 16 | 1 << 14 | 1 << 11 | 1 << 9 | 1 << 6;
    RESETS.change(|x| x | OWN);
    RESETS.change(|x| x & !OWN);
    while RESETS_DONE.get() & OWN != OWN {}
    // 5 ms for the crystal, in 256 of its periods; its range of 1 to 15 MHz.
    CRYSTAL_DELAY.set(CRYSTAL / 200 / 256);
    CRYSTAL_CONTROL.set(0xfab << 12 | 0xaa0);
    while CRYSTAL_STATE.get() & 1 << 31 == 0 {}
    PLL_STATE.change(|x| x & !0x3f | 1);
    PLL_MULTIPLIER.set(125);
    PLL_OFF.change(|x| x & !(1 << 5 | 1));
    while PLL_STATE.get() & LOCKED == 0 {}
    PLL_DIVIDERS.set(5 << 16 | 2 << 12);
    PLL_OFF.change(|x| x & !(1 << 3));
    SYSTEM_DIVIDER.set(1 << 16);
    SYSTEM.change(|x| x & !(7 << 5));
    SYSTEM.change(|x| x | 1);
    while SYSTEM_SELECTED.get() & 2 == 0 {}
    // The UART's, from the same.
    PERIPHERAL.set(1 << 11);
}

/// UART 0: 8 bits, queues of 32 both ways.
fn serial() {
    // In 64ths: clock / 16 / baud.
    const DIVIDER: u32 = (Here::CLOCK * 4 + 921_600 / 2) / 921_600;
    SERIAL_DIVIDER.set(DIVIDER >> 6);
    SERIAL_FRACTION.set(DIVIDER & 0x3f);
    SERIAL_FORMAT.set(3 << 5 | 1 << 4);
    SERIAL_CONTROL.set(1 << 9 | 1 << 8 | 1);
}

/// Slice 2 at 20 kHz, its two channels at no duty.
fn pwm() {
    PWM_DIVIDER.set(1 << 4);
    PWM_TOP.set(PWM_PERIOD - 1);
    PWM_DUTIES.set(0);
    PWM_CONTROL.set(1);
}

/// Each pin's function, and whether it is an input, pulled up. The bridge is off before its pins are let through.
fn pins() {
    const UART: u32 = 2;
    const PWM: u32 = 4;
    const PORT: u32 = 5;
    const PIO: u32 = 6;
    PORT_CLEAR.set(1 << ENABLE);
    PORT_OUTPUTS_SET.set(1 << ENABLE);
    for (pin, function, is_input) in [
        (0, UART, false),
        (1, UART, true),
        (ENCODER, PIO, true),
        (ENCODER + 1, PIO, true),
        (4, PWM, false),
        (5, PWM, false),
        (ENABLE, PORT, false),
        (FAULT, PORT, true),
    ] {
        Register::at(PINS + 8 * pin as usize + 4).set(function);
        // 4 mA, or input and pull-up; a Schmitt trigger; no isolation.
        let pad = if is_input { 1 << 6 | 1 << 3 } else { 1 << 4 };
        Register::at(PADS + 4 * pin as usize + 4).set(pad | 1 << 1);
    }
}

/// The program of the encoder's state machine. Every 5 to 11 clocks it reads both lines, jumps by their former and their present state
/// into the table of 16 at its beginning, and counts in Y. The count is in `rxfifo[0]`, for the processor to read at any time.
///
/// A jump is `condition << 5 | address`; states are B · 2 + A, and A rises before B where the count rises.
#[rustfmt::skip]
const PROGRAM: [u32; 29] = [
    // From 0 to
    SAMPLE, UP, DOWN, LOST,
    // From 1 to
    DOWN, SAMPLE, LOST, UP,
    // From 2 to
    UP, LOST, SAMPLE, DOWN,
    // From 3 to
    LOST, DOWN, UP, SAMPLE,
    0xc000,             // 16 lost:   irq set 0
    0x60c2,             // 17 sample: out isr, 2       the former state (wrap target)
    0x4002,             // 18         in pins, 2       behind it the present one
    0xa0e6,             // 19         mov osr, isr
    0xa0a6,             // 20         mov pc, isr
    0xa04a,             // 21 up:     mov y, ~y        y + 1 = ~(~y - 1)
    4 << 5 | 23,        // 22         jmp y--, 23
    0xa04a,             // 23         mov y, ~y
    COUNTED,            // 24         jmp counted
    4 << 5 | COUNTED,   // 25 down:   jmp y--, counted
    0xa0c2,             // 26 counted: mov isr, y
    0x8018,             // 27         mov rxfifo[0], isr
    SAMPLE,             // 28         jmp sample
];
const LOST: u32 = 16;
const SAMPLE: u32 = 17;
const UP: u32 = 21;
const DOWN: u32 = 25;
const COUNTED: u32 = 26;

/// State machine 0 of PIO 0 at the processor's clock, its count at 0.
fn encoder() {
    for (at, word) in PROGRAM.into_iter().enumerate() {
        Register::at(ENCODER_PROGRAM + 4 * at).set(word);
    }
    ENCODER_WRAP.set(28 << 12 | SAMPLE << 7);
    // Shifts in to the left, out to the right; its queue of received words is registers.
    ENCODER_SHIFTS.set(1 << 19 | 1 << 15);
    ENCODER_PINS.set(ENCODER << 15);
    // set y, 0; mov isr, y; mov rxfifo[0], isr; mov osr, pins; jmp sample
    for instruction in [0xe040, 0xa0c2, 0x8018, 0xa0e0, SAMPLE] {
        ENCODER_EXECUTE.set(instruction);
    }
    ENCODER_CONTROL.set(1);
}

/// The watchdog, by the ring oscillator, whose rate is measured by the PWM's periods: reset after 20 ms, also while a debugger holds the
/// processor, and with it the bridge off. Returns the value to reload.
fn watchdog() -> u32 {
    TICK_LENGTH.set(8);
    TICK_CONTROL.set(1);
    // It resets everything but the two oscillators.
    WATCHDOG_RESETS.set(0x01ff_ffff & !(3 << 2));
    WATCHDOG_LOAD.set(WATCHDOG_TIME);
    WATCHDOG_CONTROL.set(1 << 30);
    let start = WATCHDOG_CONTROL.get();
    let (mut last, mut periods) = (PWM_COUNT.get(), 0);
    while periods < 40 {
        let now = PWM_COUNT.get();
        periods += u32::from(now < last);
        last = now;
    }
    let ticks = start.wrapping_sub(WATCHDOG_CONTROL.get()) & WATCHDOG_TIME;
    // The PWM's 40 periods are 2 ms.
    let reload = (ticks * 10).min(WATCHDOG_TIME);
    WATCHDOG_LOAD.set(reload);
    reload
}

/// Clocks of a PWM period.
const PWM_PERIOD: u32 = Here::CLOCK / 20_000;
/// The encoder's first pin; the bridge's enable and fault.
const ENCODER: u32 = 2;
const ENABLE: u32 = 6;
const FAULT: u32 = 7;
/// Of the encoder's flags: both lines have changed at once.
const SKIPPED: u32 = 1;
/// Of the PLL's state.
const LOCKED: u32 = 1 << 31;
/// Of the watchdog's control: its count.
const WATCHDOG_TIME: u32 = 0x00ff_ffff;

const FLASH: u32 = 0x1000_0000;
const VECTORS: Register = Register::at(0xe000_ed08);

const REFERENCE: Register = Register::at(0x4001_0030);
const REFERENCE_SELECTED: Register = Register::at(0x4001_0038);
const SYSTEM: Register = Register::at(0x4001_003c);
const SYSTEM_DIVIDER: Register = Register::at(0x4001_0040);
const SYSTEM_SELECTED: Register = Register::at(0x4001_0044);
const PERIPHERAL: Register = Register::at(0x4001_0048);
const WATCHDOG_RESETS: Register = Register::at(0x4001_8008);
const RESETS: Register = Register::at(0x4002_0000);
const RESETS_DONE: Register = Register::at(0x4002_0008);
const CRYSTAL_CONTROL: Register = Register::at(0x4004_8000);
const CRYSTAL_STATE: Register = Register::at(0x4004_8004);
const CRYSTAL_DELAY: Register = Register::at(0x4004_800c);
const PLL_STATE: Register = Register::at(0x4005_0000);
const PLL_OFF: Register = Register::at(0x4005_0004);
const PLL_MULTIPLIER: Register = Register::at(0x4005_0008);
const PLL_DIVIDERS: Register = Register::at(0x4005_000c);

const PINS: usize = 0x4002_8000;
const PADS: usize = 0x4003_8000;
const PORT_IN: Register = Register::at(0xd000_0004);
const PORT_SET: Register = Register::at(0xd000_0018);
const PORT_CLEAR: Register = Register::at(0xd000_0020);
const PORT_OUTPUTS_SET: Register = Register::at(0xd000_0038);

const SERIAL_DATA: Register = Register::at(0x4007_0000);
const SERIAL_STATE: Register = Register::at(0x4007_0018);
const SERIAL_DIVIDER: Register = Register::at(0x4007_0024);
const SERIAL_FRACTION: Register = Register::at(0x4007_0028);
const SERIAL_FORMAT: Register = Register::at(0x4007_002c);
const SERIAL_CONTROL: Register = Register::at(0x4007_0030);

const PWM_CONTROL: Register = Register::at(0x400a_8028);
const PWM_DIVIDER: Register = Register::at(0x400a_802c);
const PWM_COUNT: Register = Register::at(0x400a_8030);
const PWM_DUTIES: Register = Register::at(0x400a_8034);
const PWM_TOP: Register = Register::at(0x400a_8038);

const WATCHDOG_CONTROL: Register = Register::at(0x400d_8000);
const WATCHDOG_LOAD: Register = Register::at(0x400d_8004);
const TICK_CONTROL: Register = Register::at(0x4010_8030);
const TICK_LENGTH: Register = Register::at(0x4010_8034);

const ENCODER_CONTROL: Register = Register::at(0x5020_0000);
const ENCODER_FLAGS: Register = Register::at(0x5020_0030);
const ENCODER_PROGRAM: usize = 0x5020_0048;
const ENCODER_WRAP: Register = Register::at(0x5020_00cc);
const ENCODER_SHIFTS: Register = Register::at(0x5020_00d0);
const ENCODER_EXECUTE: Register = Register::at(0x5020_00d8);
const ENCODER_PINS: Register = Register::at(0x5020_00dc);
const ENCODER_COUNT: Register = Register::at(0x5020_0128);
