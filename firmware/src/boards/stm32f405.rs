//! A board with an STM32F405 for a force-feedback wheel: an encoder, a brushed motor on a bridge with two inputs, USB. **Not tried on hardware.**
//!
//! | pin | what |
//! | --- | --- |
//! | PA0, PA1 | the encoder's two lines, pulled up |
//! | PA8 | the bridge's duty, 20 kHz |
//! | PB0 | its direction |
//! | PB1 | its enable; a resistor to ground keeps it off while the board starts |
//! | PB10 | its fault, low; pulled up |
//! | PA9, PA10 | the serial line of the other programs, 921 600 baud |
//! | PA11, PA12 | USB, from a crystal |
//!
//! The motor gets an open-loop voltage in proportion to the commanded torque, as on the B-G431B-ESC1: its notes on back-EMF and supply hold
//! here. The bridge has to limit its current by itself. Manuals: ST RM0090 (registers), DS8626 (pins).

use super::board::{Board, Device};
use super::register::Register;
use super::uart::Uart;

/// The board's crystal, in MHz.
const CRYSTAL: u32 = 8;
/// The encoder's counts a revolution, all four edges of its lines.
const COUNTS: f32 = 65536.0;
/// The motor's torque at a whole duty, standing still at your supply, in N·m. The sign turns the motor around.
const TORQUE: f32 = 5.0;

/// The board.
pub struct Here;

impl Board for Here {
    const NAME: &'static str = "stm32f405";
    const CLOCK: u32 = 168_000_000;
    type Line = Uart;
    type Device = Motor;

    /// The bridge is off.
    fn cut() {
        PORT_B_SET.set(1 << (16 + ENABLE));
        PWM_DUTY.set(0);
    }

    fn start() -> (Uart, Motor) {
        // Before anything else: only a resistor has held the bridge off so far.
        PORTS_ON.change(|x| x | 3);
        let _ = PORTS_ON.get();
        Self::cut();
        clock();
        pins();
        // 84 MHz.
        SERIAL_RATE.set(Self::CLOCK / 2 / 921_600);
        SERIAL_CONTROL.set(1 << 13 | 1 << 3 | 1 << 2);
        encoder();
        pwm();
        watchdog();
        (
            Uart {
                state: SERIAL_STATE,
                received: SERIAL_DATA,
                sent: SERIAL_DATA,
                full: (1 << 5, true),
                free: (1 << 7, true),
            },
            Motor { last: ENCODER_COUNT.get(), counts: 0, on: false },
        )
    }
}

/// Its encoder and its bridge.
pub struct Motor {
    last: u32,
    counts: i32,
    on: bool,
}

impl Device for Motor {
    fn position(&mut self) -> f32 {
        let now = ENCODER_COUNT.get();
        self.counts = self.counts.wrapping_add(now.wrapping_sub(self.last) as i32);
        self.last = now;
        self.counts as f32 * (core::f32::consts::TAU / COUNTS)
    }

    fn fault(&mut self) -> bool {
        self.on && PORT_B_IN.get() & 1 << FAULT == 0
    }

    fn hold(&mut self, torque: f32, on: bool) {
        let on = on && torque.is_finite();
        let part = if on { (torque / TORQUE).clamp(-1.0, 1.0) } else { 0.0 };
        // The direction first, at no duty where it changes: the duty of one side is never given to the other.
        let (direction, is_left) = (1 << DIRECTION, part < 0.0);
        if (PORT_B_OUT.get() & direction != 0) != is_left {
            PWM_DUTY.set(0);
            PORT_B_SET.set(if is_left { direction } else { direction << 16 });
        }
        PWM_DUTY.set((part.abs() * PWM_PERIOD as f32) as u32);
        PORT_B_SET.set(if on { 1 << ENABLE } else { 1 << (16 + ENABLE) });
        self.on = on;
    }

    fn feed(&mut self) {
        WATCHDOG_KEY.set(0xaaaa);
    }
}

/// 168 MHz, and 48 MHz for USB: the crystal to 1 MHz, · 336 / 2 and / 7.
fn clock() {
    RCC_CONTROL.change(|x| x | 1 << 16);
    while RCC_CONTROL.get() & 1 << 17 == 0 {}
    RCC_PLL.set(7 << 24 | 1 << 22 | 336 << 6 | CRYSTAL);
    RCC_CONTROL.change(|x| x | 1 << 24);
    while RCC_CONTROL.get() & 1 << 25 == 0 {}
    // Caches, prefetch, 5 waits; the buses at a quarter and a half.
    FLASH_ACCESS.set(1 << 10 | 1 << 9 | 1 << 8 | 5);
    while FLASH_ACCESS.get() & 7 != 5 {}
    RCC_CONFIGURATION.set(4 << 13 | 5 << 10 | 2);
    while RCC_CONFIGURATION.get() >> 2 & 3 != 2 {}
    APB1_ON.change(|x| x | 1); // timer 2
    APB2_ON.change(|x| x | 1 << 4 | 1); // USART 1, timer 1
    let _ = APB2_ON.get();
}

/// Each pin's mode (1 output, 2 alternate), its function, and whether it is pulled up.
fn pins() {
    for (port, pin, mode, function, pull) in [
        (A, 0, 2, 1, 1),
        (A, 1, 2, 1, 1),
        (A, 8, 2, 1, 0),
        (A, 9, 2, 7, 0),
        (A, 10, 2, 7, 1),
        (A, 11, 2, 10, 0),
        (A, 12, 2, 10, 0),
        (B, DIRECTION, 1, 0, 0),
        (B, ENABLE, 1, 0, 0),
        (B, FAULT, 0, 0, 1),
    ] {
        let half = Register::at(port + if pin < 8 { 0x20 } else { 0x24 });
        let at = pin % 8 * 4;
        half.change(|x| x & !(0xf << at) | function << at);
        Register::at(port + 0x0c).change(|x| x & !(3 << (2 * pin)) | pull << (2 * pin));
        // USB requires fast edges.
        let speed = if port == A && pin >= 11 { 3 } else { 1 };
        Register::at(port + 0x08).change(|x| x & !(3 << (2 * pin)) | speed << (2 * pin));
        Register::at(port).change(|x| x & !(3 << (2 * pin)) | mode << (2 * pin));
    }
}

/// Timer 2, of 32 bits, counts all edges of both lines, each seen eight times.
fn encoder() {
    ENCODER_INPUTS.set(3 << 12 | 1 << 8 | 3 << 4 | 1);
    ENCODER_MODE.set(3);
    ENCODER_TOP.set(u32::MAX);
    ENCODER_CONTROL.set(1);
}

/// Timer 1 at 20 kHz, its first channel, at no duty.
fn pwm() {
    PWM_TOP.set(PWM_PERIOD - 1);
    PWM_MODES.set(6 << 4 | 1 << 3);
    PWM_DUTY.set(0);
    PWM_ENABLE.set(1);
    PWM_BREAK.set(1 << 15);
    PWM_EVENT.set(1);
    PWM_CONTROL.set(1 << 7 | 1);
}

/// The independent watchdog, by its own oscillator: reset after 20 ms, and with it the bridge off.
fn watchdog() {
    WATCHDOG_KEY.set(0xcccc);
    WATCHDOG_KEY.set(0x5555);
    WATCHDOG_DIVIDER.set(0);
    WATCHDOG_RELOAD.set(160);
    while WATCHDOG_STATE.get() != 0 {}
    WATCHDOG_KEY.set(0xaaaa);
}

/// Clocks of a PWM period; the timer has the processor's clock.
const PWM_PERIOD: u32 = Here::CLOCK / 20_000;
/// Of port B.
const DIRECTION: u32 = 0;
const ENABLE: u32 = 1;
const FAULT: u32 = 10;

const A: usize = 0x4002_0000;
const B: usize = 0x4002_0400;
const PORT_B_IN: Register = Register::at(B + 0x10);
const PORT_B_OUT: Register = Register::at(B + 0x14);
const PORT_B_SET: Register = Register::at(B + 0x18);

const RCC_CONTROL: Register = Register::at(0x4002_3800);
const RCC_PLL: Register = Register::at(0x4002_3804);
const RCC_CONFIGURATION: Register = Register::at(0x4002_3808);
const PORTS_ON: Register = Register::at(0x4002_3830);
const APB1_ON: Register = Register::at(0x4002_3840);
const APB2_ON: Register = Register::at(0x4002_3844);
const FLASH_ACCESS: Register = Register::at(0x4002_3c00);

const SERIAL_STATE: Register = Register::at(0x4001_1000);
const SERIAL_DATA: Register = Register::at(0x4001_1004);
const SERIAL_RATE: Register = Register::at(0x4001_1008);
const SERIAL_CONTROL: Register = Register::at(0x4001_100c);

const ENCODER_CONTROL: Register = Register::at(0x4000_0000);
const ENCODER_MODE: Register = Register::at(0x4000_0008);
const ENCODER_INPUTS: Register = Register::at(0x4000_0018);
const ENCODER_COUNT: Register = Register::at(0x4000_0024);
const ENCODER_TOP: Register = Register::at(0x4000_002c);

const PWM_CONTROL: Register = Register::at(0x4001_0000);
const PWM_EVENT: Register = Register::at(0x4001_0014);
const PWM_MODES: Register = Register::at(0x4001_0018);
const PWM_ENABLE: Register = Register::at(0x4001_0020);
const PWM_TOP: Register = Register::at(0x4001_002c);
const PWM_DUTY: Register = Register::at(0x4001_0034);
const PWM_BREAK: Register = Register::at(0x4001_0044);

const WATCHDOG_KEY: Register = Register::at(0x4000_3000);
const WATCHDOG_DIVIDER: Register = Register::at(0x4000_3004);
const WATCHDOG_RELOAD: Register = Register::at(0x4000_3008);
const WATCHDOG_STATE: Register = Register::at(0x4000_300c);
