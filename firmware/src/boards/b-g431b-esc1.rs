//! ST's B-G431B-ESC1 (STM32G431CB), for one brushed motor between its phases U and V. **Not tried on hardware.** It runs no brushless
//! motor (BLDC, PMSM), and phase W is not used.
//!
//! The motor gets an open-loop voltage in proportion to the commanded torque: nothing measures or controls its current. `TORQUE` holds at
//! standstill, at one supply voltage and one temperature of the winding. A turning motor's own voltage reduces it, which acts as a damper
//! of kt²/R; a falling supply reduces it too.
//!
//! Before a motor is on it: check the pins and the shunts against your board's schematic (MB1419), and set the constants of your wheel. With
//! an oscilloscope see that no gate of U and V switches while it is disarmed (all four transistors are off, and the motor's terminals
//! float); armed at no torque, both switch at 20 kHz with a duty of one half, in opposite phase, with dead time between their halves.
//!
//! Locked antiphase, as in the notes' lab: at a duty of 1/2 there is no torque, U gets the duty and V the rest. Encoder on PB6 and PB7, the
//! host on USART 2, which the board's own debugger makes a serial port of. Manuals: ST RM0440 (registers), UM2516 (board), MB1419
//! (schematic).

use super::board::{Board, Device, Line};
use super::register::Register;
use super::uart::Uart;

/// The encoder's counts a revolution, all four edges of its lines.
const COUNTS: f32 = 4096.0;
/// The motor's torque at a whole duty, standing still at your supply, in N·m. The sign turns the motor around.
const TORQUE: f32 = 3.1625;
/// The duty stays so near to 1/2: the lab's 24 to 76 %.
const MAX_DUTY_OFFSET: f32 = 0.26;
/// Beyond this current, in A, the comparators turn the bridges off.
const MAX_CURRENT_A: f32 = 10.0;
/// The lower transistors' shunts, in Ω.
const SHUNT: f32 = 3e-3;
/// The comparators' threshold, in steps of the 12-bit DAC from 0 to 3.3 V.
///
/// Three resistors meet at a comparator's input: 1.5 kΩ from the shunt, 22 kΩ from 3.3 V, 2.2 kΩ from ground. No current flows into the
/// input, so that its voltage V is
///
/// ```text
/// (V_shunt - V)/1.5 kΩ + (3.3 V - V)/22 kΩ = V/2.2 kΩ,    V = (0.9 V + 4 V_shunt)/7
/// ```
///
/// 128.6 mV without a current, and 1.714 mV more for each A at 3 mΩ. (The board's amplifiers, 16 times this, give its well known gain of
/// 64/7.) DAC and bias share their 3.3 V, which cancels. A step of the DAC is 0.47 A, and a millivolt of the comparator's own offset
/// 0.58 A: with some millivolts of that and resistors of 1 %, 10 A may be 4 to 16 A without a calibration.
const LIMIT: u32 = ((0.9 + 4.0 * SHUNT * MAX_CURRENT_A) / 7.0 * (4096.0 / 3.3) + 0.5) as u32;

/// The board.
pub struct Here;

impl Board for Here {
    const NAME: &'static str = "b-g431b-esc1";
    const CLOCK: u32 = 170_000_000;
    type Line = Usart;
    type Device = Motor;

    /// A duty of one half is no torque.
    fn cut() {
        PWM_U.set(HALF_PERIOD / 2);
        PWM_V.set(HALF_PERIOD / 2);
    }

    fn start() -> (Usart, Motor) {
        clock();
        pins();
        USART_RATE.set(Self::CLOCK / 921_600);
        USART_CONTROL.set(1 << 29 | 1 << 3 | 1 << 2); // queues of 8, both ways
        USART_CONTROL.change(|x| x | 1);
        encoder();
        current_limit();
        pwm();
        watchdog();
        let (state, received, sent) = (USART_STATE, USART_RECEIVED, USART_SEND);
        (
            Usart(Uart { state, received, sent, full: (1 << 5, true), free: (1 << 7, true) }),
            Motor { last: 0, counts: 0, on: false },
        )
    }
}

/// Its line, which stops at an overrun until the flag is cleared.
pub struct Usart(Uart);

impl Line for Usart {
    fn receive(&mut self) -> Option<u8> {
        const OVERRUN: u32 = 1 << 3;
        if self.0.state.get() & OVERRUN != 0 {
            USART_CLEAR.set(OVERRUN);
        }
        self.0.receive()
    }

    fn send(&mut self, byte: u8) -> bool {
        self.0.send(byte)
    }
}

/// Its encoder and its bridges.
pub struct Motor {
    last: u16,
    counts: i32,
    /// Whether the bridges have been turned on. A comparator may have turned them off since.
    on: bool,
}

impl Device for Motor {
    fn position(&mut self) -> f32 {
        // The timer has 16 bits: less than half of them pass in a sample.
        let now = ENCODER_COUNT.get() as u16;
        self.counts = self.counts.wrapping_add(i32::from(now.wrapping_sub(self.last) as i16));
        self.last = now;
        self.counts as f32 * (core::f32::consts::TAU / COUNTS)
    }

    /// A break turns the outputs off and leaves its flag; both stay so until they are written.
    fn fault(&mut self) -> bool {
        let broken = PWM_STATE.get() & BREAK != 0 || (self.on && PWM_BREAK.get() & OUTPUTS == 0);
        if broken {
            // Of these bits 0 is cleared, and 1 leaves the flag as it is.
            PWM_STATE.set(!BREAK);
        }
        broken
    }

    fn hold(&mut self, torque: f32, on: bool) {
        let on = on && torque.is_finite();
        let part = if on { (torque / TORQUE).clamp(-MAX_DUTY_OFFSET, MAX_DUTY_OFFSET) } else { 0.0 };
        let duty = ((0.5 + part) * HALF_PERIOD as f32) as u32;
        PWM_U.set(duty);
        PWM_V.set(duty);
        // While they are on nothing here enables the outputs: what a comparator has turned off stays off.
        if !on {
            PWM_BREAK.change(|x| x & !OUTPUTS);
        } else if !self.on {
            PWM_BREAK.change(|x| x | OUTPUTS);
        }
        self.on = on;
    }

    fn feed(&mut self) {
        WATCHDOG_KEY.set(0xaaaa);
    }
}

/// 170 MHz from the crystal's 8: / 2 · 85 / 2.
fn clock() {
    const BOOST: u32 = 1 << 8;
    APB1_ON.change(|x| x | 1 << 28); // power control
    POWER_5.change(|x| x & !BOOST);
    // Caches, prefetch, 4 waits; the debugger's access, which is on at reset, stays.
    FLASH_ACCESS.change(|x| x & !0xf | 1 << 10 | 1 << 9 | 1 << 8 | 4);
    while FLASH_ACCESS.get() & 0xf != 4 {}
    RCC_CONTROL.change(|x| x | 1 << 16);
    while RCC_CONTROL.get() & 1 << 17 == 0 {}
    RCC_PLL.change(|x| x & !(3 << 25 | 0x7f << 8 | 0xf << 4 | 3) | 1 << 24 | 85 << 8 | 1 << 4 | 3);
    RCC_CONTROL.change(|x| x | 1 << 24);
    while RCC_CONTROL.get() & 1 << 25 == 0 {}
    // Half the speed first, for a microsecond, as the manual requires.
    const PRESCALERS: u32 = 7 << 11 | 7 << 8 | 0xf << 4;
    RCC_CONFIGURATION.change(|x| x & !(PRESCALERS | 3) | 8 << 4 | 3);
    while RCC_CONFIGURATION.get() >> 2 & 3 != 3 {}
    for _ in 0..100 {
        let _ = RCC_CONFIGURATION.get();
    }
    RCC_CONFIGURATION.change(|x| x & !(PRESCALERS | 3) | 3);
    AHB2_ON.change(|x| x | 1 << 18 | 7); // DAC 3; ports A, B, C
    APB1_ON.change(|x| x | 1 << 17 | 1 << 2); // USART 2, timer 4
    APB2_ON.change(|x| x | 1 << 11 | 1); // timer 1; comparators
    let _ = APB2_ON.get();
}

/// PA8, PA9 and their lower halves PC13, PA12 to timer 1; PB6, PB7 to timer 4; PB3, PB4 to USART 2.
fn pins() {
    for (port, pin, function) in
        [(A, 8, 6), (A, 9, 6), (C, 13, 4), (A, 12, 6), (B, 6, 2), (B, 7, 2), (B, 3, 7), (B, 4, 7)]
    {
        let half = Register::at(port + if pin < 8 { 0x20 } else { 0x24 });
        let at = pin % 8 * 4;
        half.change(|x| x & !(0xf << at) | function << at);
        Register::at(port).change(|x| x & !(3 << (2 * pin)) | 2 << (2 * pin));
    }
    // The encoder's lines pulled up.
    Register::at(B + 0x0c).change(|x| x & !(0xf << 12) | 0x5 << 12);
}

/// Timer 4 counts all edges of both lines, each seen eight times.
fn encoder() {
    ENCODER_INPUTS.set(3 << 12 | 1 << 8 | 3 << 4 | 1);
    ENCODER_MODE.set(3);
    ENCODER_TOP.set(0xffff);
    ENCODER_CONTROL.set(1);
}

/// Comparators 1 and 2 compare the shunts of U and V, at PA1 and PA7, against DAC 3. A lower transistor's shunt shows the motor's current
/// while that transistor is on, as one of them is half of the time either way: not a short circuit from a phase to ground.
fn current_limit() {
    DAC_MODE.set(2 << 14 | 3 << 16 | 3);
    DAC_VALUE_1.set(LIMIT);
    DAC_VALUE_2.set(LIMIT);
    DAC_CONTROL.set(1 << 16 | 1);
    COMPARATOR_1.set(4 << 4 | 1);
    COMPARATOR_2.set(4 << 4 | 1);
    // Both settle within some microseconds.
    for _ in 0..1000 {
        let _ = COMPARATOR_2.get();
    }
}

/// Timer 1 up and down at 20 kHz, V the opposite of U, 0.8 µs of dead time, its outputs off and held low; off whenever a comparator says
/// so, until [`Motor::hold`] turns it off and on again.
fn pwm() {
    PWM_TOP.set(HALF_PERIOD);
    PWM_MODES.set(7 << 12 | 1 << 11 | 6 << 4 | 1 << 3);
    PWM_U.set(HALF_PERIOD / 2);
    PWM_V.set(HALF_PERIOD / 2);
    PWM_ENABLE.set(1 << 6 | 1 << 4 | 1 << 2 | 1);
    // The comparators, and no pin.
    PWM_BREAK_SOURCES.change(|x| x & !1 | 1 << 2 | 1 << 1);
    // A break counts when it lasts for 1.5 µs: the spikes of switching are shorter.
    PWM_BREAK.set(0xf << 16 | 1 << 13 | 1 << 12 | 1 << 11 | 1 << 10 | 0x84);
    PWM_EVENT.set(1);
    PWM_CONTROL.set(1 << 7 | 1 << 5 | 1);
    // The comparators' outputs before they settled.
    PWM_STATE.set(!BREAK);
}

/// The independent watchdog, by its own oscillator: reset after 20 ms, and with it the bridges off.
fn watchdog() {
    WATCHDOG_KEY.set(0xcccc);
    WATCHDOG_KEY.set(0x5555);
    WATCHDOG_DIVIDER.set(0);
    WATCHDOG_RELOAD.set(160);
    while WATCHDOG_STATE.get() != 0 {}
    WATCHDOG_KEY.set(0xaaaa);
}

/// Clocks of half a PWM period.
const HALF_PERIOD: u32 = Here::CLOCK / 40_000;
/// The main output enable.
const OUTPUTS: u32 = 1 << 15;
/// The flags of both break inputs and of the system's.
const BREAK: u32 = 1 << 13 | 1 << 8 | 1 << 7;

const A: usize = 0x4800_0000;
const B: usize = 0x4800_0400;
const C: usize = 0x4800_0800;

const RCC_CONTROL: Register = Register::at(0x4002_1000);
const RCC_CONFIGURATION: Register = Register::at(0x4002_1008);
const RCC_PLL: Register = Register::at(0x4002_100c);
const AHB2_ON: Register = Register::at(0x4002_104c);
const APB1_ON: Register = Register::at(0x4002_1058);
const APB2_ON: Register = Register::at(0x4002_1060);
const POWER_5: Register = Register::at(0x4000_7080);
const FLASH_ACCESS: Register = Register::at(0x4002_2000);

const USART_CONTROL: Register = Register::at(0x4000_4400);
const USART_RATE: Register = Register::at(0x4000_440c);
const USART_STATE: Register = Register::at(0x4000_441c);
const USART_CLEAR: Register = Register::at(0x4000_4420);
const USART_RECEIVED: Register = Register::at(0x4000_4424);
const USART_SEND: Register = Register::at(0x4000_4428);

const ENCODER_CONTROL: Register = Register::at(0x4000_0800);
const ENCODER_MODE: Register = Register::at(0x4000_0808);
const ENCODER_INPUTS: Register = Register::at(0x4000_0818);
const ENCODER_COUNT: Register = Register::at(0x4000_0824);
const ENCODER_TOP: Register = Register::at(0x4000_082c);

const PWM_CONTROL: Register = Register::at(0x4001_2c00);
const PWM_STATE: Register = Register::at(0x4001_2c10);
const PWM_EVENT: Register = Register::at(0x4001_2c14);
const PWM_MODES: Register = Register::at(0x4001_2c18);
const PWM_ENABLE: Register = Register::at(0x4001_2c20);
const PWM_TOP: Register = Register::at(0x4001_2c2c);
const PWM_U: Register = Register::at(0x4001_2c34);
const PWM_V: Register = Register::at(0x4001_2c38);
const PWM_BREAK: Register = Register::at(0x4001_2c44);
const PWM_BREAK_SOURCES: Register = Register::at(0x4001_2c60);

const DAC_CONTROL: Register = Register::at(0x5000_1000);
const DAC_VALUE_1: Register = Register::at(0x5000_1008);
const DAC_VALUE_2: Register = Register::at(0x5000_1014);
const DAC_MODE: Register = Register::at(0x5000_103c);
const COMPARATOR_1: Register = Register::at(0x4001_0200);
const COMPARATOR_2: Register = Register::at(0x4001_0204);

const WATCHDOG_KEY: Register = Register::at(0x4000_3000);
const WATCHDOG_DIVIDER: Register = Register::at(0x4000_3004);
const WATCHDOG_RELOAD: Register = Register::at(0x4000_3008);
const WATCHDOG_STATE: Register = Register::at(0x4000_300c);
