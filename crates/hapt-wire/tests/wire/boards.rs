//! The firmware's own file of the B-G431B-ESC1, with its registers in this test's memory, under the sampler that runs on it.

#[allow(dead_code, clippy::precedence)]
#[path = "../../../../firmware/src/board.rs"]
mod board;
mod chip;
#[allow(dead_code, clippy::precedence)]
#[path = "../../../../firmware/src/boards/b-g431b-esc1.rs"]
mod esc1;
mod register;
#[allow(dead_code)]
#[path = "../../../../firmware/src/uart.rs"]
mod uart;

use board::{Board, Device};
use chip::{
    CHIP, DAC3_VALUE_1, DAC3_VALUE_2, FLASH_ACCESS, RCC_CONFIGURATION, RCC_CONTROL, RCC_PLL, TIM1_BREAK_SOURCES,
    TIM4_COUNT,
};
use esc1::{Here, Motor};
use hapt_core::{Phase, Reason};
use hapt_testing::prelude::*;
use hapt_wire::device::Measurement;
use hapt_wire::{Command, Parameter, Refusal};

use crate::common::{BOARD, Received, TestHost, WHEEL, storage};

fn current(too_much: bool) {
    CHIP.with_borrow_mut(|chip| chip.current(too_much));
}

fn is_on() -> bool {
    CHIP.with_borrow(chip::Chip::is_on)
}

fn register(at: usize) -> u32 {
    CHIP.with_borrow(|chip| chip.registers[&at])
}

/// A sample in the manner of the firmware's interrupt.
fn sample(host: &mut TestHost, motor: &mut Motor) {
    host.heartbeat();
    host.seen = Measurement { fault: motor.fault(), position: motor.position(), ..Measurement::default() };
    let motor_command = host.sample();
    motor.hold(motor_command.torque, motor_command.on);
    motor.feed();
}

/// The board, running WHEEL.
fn running(host: &mut TestHost) -> (Motor, u32) {
    running_world(host, WHEEL)
}

fn running_world(host: &mut TestHost, text: &str) -> (Motor, u32) {
    let (_, mut motor) = Here::start();
    let world = host.run(text);
    sample(host, &mut motor);
    assert!(is_on());
    (motor, world)
}

#[test]
fn an_overcurrent_is_a_fault_that_only_a_clear_ends() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let (mut motor, world) = running(&mut host);
    host.ask(Command::Set { parameter: Parameter::Divider as u8, value: 1 }).unwrap();

    // The overcurrent lasts less than a sample.
    current(true);
    assert!(!is_on(), "the chip's own break");
    current(false);
    host.received.clear();
    sample(&mut host, &mut motor);
    let telemetry = host.received.iter().find_map(|received| match received {
        Received::Telemetry(telemetry) => Some((telemetry.phase, telemetry.reason, telemetry.output)),
        _ => None,
    });
    assert_eq!(telemetry, Some((Phase::Faulted as u8, Reason::Driver.code(), 0.0)));
    for k in 0..100 {
        sample(&mut host, &mut motor);
        assert!(!is_on(), "{k} samples later");
        // It refuses to arm again.
        assert_eq!(host.ask(Command::Arm { world }), Err(Refusal::Phase), "{k}");
    }
    assert_eq!(host.state(), (Phase::Faulted, Some(world)));
    host.ask(Command::Clear).unwrap();
    for _ in 0..10 {
        sample(&mut host, &mut motor);
        assert!(!is_on(), "a clear arms nothing");
    }
    host.ask(Command::Arm { world }).unwrap();
    sample(&mut host, &mut motor);
    assert!(is_on());
}

#[test]
fn a_lasting_overcurrent_can_neither_be_cleared_nor_armed() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let (mut motor, world) = running(&mut host);
    current(true);
    for _ in 0..50 {
        sample(&mut host, &mut motor);
        host.send(Command::Clear);
        sample(&mut host, &mut motor);
        assert!(!is_on());
    }
    assert_eq!(host.state().0, Phase::Faulted);
    current(false);
    for _ in 0..20 {
        sample(&mut host, &mut motor);
    }
    host.ask(Command::Clear).unwrap();
    // The overcurrent begins at the sample that is to arm the board.
    current(true);
    host.send(Command::Arm { world });
    sample(&mut host, &mut motor);
    assert!(!is_on());
    assert_eq!(host.state().0, Phase::Faulted);
}

#[test]
fn a_fault_while_the_puck_is_braked_ends_the_braking() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let (mut motor, _) = running_world(&mut host, &WHEEL.replace("[safety]", "[safety]\nbrake = 5e-3"));
    // The puck turns by three counts per sample.
    let mut turn = |host: &mut TestHost| {
        CHIP.with_borrow_mut(|chip| *chip.registers.entry(TIM4_COUNT).or_default() += 3);
        sample(host, &mut motor);
    };
    for _ in 0..20 {
        turn(&mut host);
    }
    host.send(Command::Stop);
    for _ in 0..5 {
        turn(&mut host);
    }
    assert!(is_on() && host.motor.torque < 0.0, "{:?}", host.motor);
    current(true);
    current(false);
    for _ in 0..200 {
        turn(&mut host);
        assert!(!is_on());
        assert_eq!(host.motor.torque, 0.0);
    }
}

#[test]
fn a_nan_torque_turns_the_bridges_off() {
    let (_, mut motor) = Here::start();
    motor.hold(0.1, true);
    assert!(is_on());
    for torque in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        motor.hold(torque, true);
        assert!(!is_on(), "{torque}");
    }
}

/// The node's voltage, in V, by Kirchhoff's law and the schematic's resistors: 1.5 kΩ to the 3 mΩ shunt, 22 kΩ to 3.3 V, 2.2 kΩ to ground.
fn node(current: f64) -> f64 {
    let (mut low, mut high) = (0.0, 3.3);
    for _ in 0..60 {
        let v = 0.5 * (low + high);
        let into = (3e-3 * current - v) / 1.5e3 + (3.3 - v) / 22e3 - v / 2.2e3;
        (low, high) = if into > 0.0 { (v, high) } else { (low, v) };
    }
    low
}

#[test]
fn the_comparators_trip_at_ten_amperes() {
    assert!((node(0.0) - 0.1286).abs() < 1e-4 && (node(1.0) - node(0.0) - 1.714e-3).abs() < 1e-6);
    let _ = Here::start();
    for value in [DAC3_VALUE_1, DAC3_VALUE_2] {
        let threshold = f64::from(register(value)) * 3.3 / 4096.0;
        let trips = (0..2000).map(|tenth| f64::from(tenth) / 10.0).find(|current| node(*current) > threshold);
        let trips = trips.unwrap();
        assert!((trips - 10.0).abs() <= 0.5, "{trips} A");
    }
}

proptest! {
    /// Bits of a register that the board does not use keep their values: the debugger's access to the flash, other ports' clocks, other
    /// pins.
    #[test]
    fn shared_registers_are_changed_only_in_the_boards_bits(held in any::<u32>(), pins in any::<u32>()) {
        // Registers, and the bits that the board may write.
        let shared = [
            (FLASH_ACCESS, 0x70f),
            (RCC_CONTROL, 3 << 24 | 3 << 16), // and of these
            (RCC_CONFIGURATION, 0x3fff), // two of them the chip writes
            (RCC_PLL, 3 << 25 | 1 << 24 | 0x7f << 8 | 0xf << 4 | 3),
            (0x4002_104c, 1 << 18 | 7), // AHB2ENR
            (0x4002_1058, 1 << 28 | 1 << 17 | 1 << 2), // APB1ENR1
            (0x4002_1060, 1 << 11 | 1), // APB2ENR
            (0x4000_7080, 1 << 8), // PWR_CR5
            (TIM1_BREAK_SOURCES, 7),
            (0x4800_0000, 3 << 16 | 3 << 18 | 3 << 24), // port A: 8, 9, 12
            (0x4800_0400, 3 << 6 | 3 << 8 | 3 << 12 | 3 << 14), // port B: 3, 4, 6, 7
            (0x4800_0800, 3 << 26), // port C: 13
            (0x4800_040c, 0xf << 12), // pull-ups of 6 and 7
        ];
        let before = |at: usize| held.rotate_left(at as u32 >> 2) ^ pins;
        CHIP.with_borrow_mut(|chip| chip.registers.extend(shared.map(|(at, _)| (at, before(at)))));
        let _ = Here::start();
        for (at, own) in shared {
            let changed = register(at) ^ before(at);
            prop_assert_eq!(changed & !own, 0, "{:#x}: {:#x}", at, changed);
        }
        CHIP.take();
    }
}
