//! The firmware's own file of the Raspberry Pi Pico 2, with an RP2350's registers, clocks, PIO and watchdog in this test's memory, under
//! the sampler that runs on it. A start is some 10^5 clocks of the model: few cases.

#[allow(dead_code, clippy::precedence, clippy::duplicate_mod)]
#[path = "../../../../firmware/src/board.rs"]
mod board;
mod chip;
#[allow(dead_code, clippy::precedence)]
#[path = "../../../../firmware/src/boards/pico2.rs"]
mod pico2_board;
mod pio;
#[allow(clippy::duplicate_mod)]
#[path = "boards/register.rs"]
mod register;
#[allow(dead_code, clippy::duplicate_mod)]
#[path = "../../../../firmware/src/uart.rs"]
mod uart;

use std::f32::consts::TAU;

use board::{Board, Device};
use chip::{CHIP, Chip, RESETS};
use hapt_core::{Phase, Reason};
use hapt_testing::cases;
use hapt_wire::device::Measurement;
use hapt_wire::{Command, Parameter, Refusal};
use pico2_board::{Here, Motor};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use crate::common::{BOARD, Received, TestHost, WHEEL, storage};

/// Of the file: counts a revolution; the torque at a whole duty, 0.05 N·m/A of 12 V on 2 Ω; the largest duty.
const COUNTS: f32 = 4096.0;
const TORQUE: f32 = 0.3;
const MAX_DUTY: f32 = 0.95;
const PWM_CLOCKS: u32 = 7500;
/// The pins of the encoder's lines, and of the bridge's fault.
const A: u32 = 1 << 2;
const B: u32 = 1 << 3;
const FAULT: u32 = 1 << 7;

fn chip<R>(look: impl FnOnce(&mut Chip) -> R) -> R {
    CHIP.with_borrow_mut(look)
}

/// A board with this ring oscillator, and its encoder's lines at the place of a cycle of four.
fn started(ring: f64, anything: u32, place: i64) -> Motor {
    chip(|chip| {
        *chip = Chip::new(ring, anything);
        chip.driven = A | B;
    });
    turn_to(place);
    Here::start().1
}

/// The lines at this count.
fn turn_to(place: i64) {
    chip(|chip| chip.levels = [0, A, A | B, B][place.rem_euclid(4) as usize]);
}

fn is_on() -> bool {
    chip(|chip| chip.is_enabled())
}

fn pass(clocks: u32) {
    chip(|chip| chip.pass(clocks));
}

/// A sample in the manner of the firmware's interrupt.
fn sample(host: &mut TestHost, motor: &mut Motor) {
    host.heartbeat();
    host.seen = Measurement { fault: motor.fault(), position: motor.position(), ..Measurement::default() };
    let motor_command = host.sample();
    motor.hold(motor_command.torque, motor_command.on);
    motor.feed();
}

/// The rates of the ring oscillator that the datasheet allows, and more.
fn rings() -> impl Strategy<Value = f64> {
    4e6..20e6
}

#[test]
fn the_clocks_are_those_that_the_board_states_whatever_the_ring_oscillator_does_and_at_a_second_start_too() {
    TestRunner::new(cases(4))
        .run(&(rings(), any::<u32>()), |(ring, anything)| {
            let _ = started(ring, anything, 0);
            for _ in 0..2 {
                chip(|chip| {
                    prop_assert_eq!(chip.system(), f64::from(Here::CLOCK));
                    prop_assert!((chip.baud() / 921_600.0 - 1.0).abs() < 2e-3, "{} baud", chip.baud());
                    prop_assert!(!chip.is_enabled());
                    Ok(())
                })?;
                // As a debugger starts it again.
                let _ = Here::start();
            }
            Ok(())
        })
        .unwrap();
}

/// Bits of the registers that the board shares keep their values.
#[test]
fn other_blocks_stay_in_their_reset_or_out_of_it() {
    TestRunner::new(cases(4))
        .run(&any::<u32>(), |held| {
            let held = held & 0x1fff_ffff;
            chip(|chip| {
                *chip = Chip::new(11e6, held);
                chip.put(RESETS, held);
            });
            let _ = Here::start();
            let own = 1 << 26 | 1 << 16 | 1 << 14 | 1 << 11 | 1 << 9 | 1 << 6;
            prop_assert_eq!(chip(|chip| chip.register(RESETS)), held & !own);
            Ok(())
        })
        .unwrap();
}

/// Steps of the encoder, forth and back, each for some clocks, over any zero of the count.
#[test]
fn the_state_machine_counts_every_edge_of_both_lines() {
    let steps = proptest::collection::vec((any::<bool>(), 14_u32..200), 1..300);
    TestRunner::new(cases(32))
        .run(&(any::<u32>(), -8_i64..8, steps), |(anything, start, steps)| {
            let mut motor = started(11e6, anything, start);
            prop_assert_eq!(motor.position(), 0.0);
            let mut place = start;
            for (forth, clocks) in steps {
                place += if forth { 1 } else { -1 };
                turn_to(place);
                pass(clocks);
                let wanted = (place - start) as f32 * (TAU / COUNTS);
                // Its loop takes 11 clocks at most, and the flip-flops before it two.
                prop_assert_eq!(motor.position(), wanted);
            }
            motor.hold(0.0, true);
            prop_assert!(!motor.fault(), "no count is lost");
            Ok(())
        })
        .unwrap();
}

#[test]
fn lines_that_change_both_at_once_are_a_fault_while_the_motor_is_on() {
    for start in 0..4 {
        for on in [true, false] {
            let mut motor = started(11e6, 0, start);
            motor.hold(0.0, on);
            assert!(!motor.fault());
            turn_to(start + 2);
            pass(20);
            assert_eq!(motor.fault(), on);
            assert!(!motor.fault(), "told once");
            turn_to(start + 3);
            pass(20);
            assert!(!motor.fault());
        }
    }
}

/// Torques that follow each other at any time within a PWM period: the mean of a whole period is the last one's, and in no clock are both
/// inputs high.
#[test]
fn the_bridges_mean_voltage_is_in_proportion_to_the_torque() {
    let torques = proptest::collection::vec((-0.5_f32..0.5, 0_u32..20_000), 1..10);
    TestRunner::new(cases(32))
        .run(&torques, |torques| {
            let mut motor = started(11e6, 0, 0);
            for (torque, clocks) in torques {
                motor.hold(torque, true);
                pass(clocks);
                let before = chip(|chip| {
                    chip.pass(PWM_CLOCKS);
                    (chip.on, chip.high)
                });
                let (on, high) = chip(|chip| {
                    chip.pass(PWM_CLOCKS);
                    (chip.on - before.0, [chip.high[0] - before.1[0], chip.high[1] - before.1[1]])
                });
                prop_assert_eq!(on, PWM_CLOCKS);
                let duty = (high[0] as f32 - high[1] as f32) / PWM_CLOCKS as f32;
                let wanted = (torque / TORQUE).clamp(-MAX_DUTY, MAX_DUTY);
                prop_assert!((duty - wanted).abs() < 1.5 / PWM_CLOCKS as f32, "{torque}: {duty}, not {wanted}");
            }
            prop_assert_eq!(chip(|chip| chip.both_high), 0);
            Ok(())
        })
        .unwrap();
}

#[test]
fn off_a_cut_and_a_torque_that_is_no_number_turn_the_bridge_off_at_once() {
    let mut motor = started(11e6, 0, 0);
    assert!(!is_on());
    for torque in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        motor.hold(0.1, true);
        assert!(is_on());
        motor.hold(torque, true);
        assert!(!is_on(), "{torque}");
    }
    motor.hold(0.1, true);
    motor.hold(0.1, false);
    assert!(!is_on());
    motor.hold(0.1, true);
    Here::cut();
    assert!(!is_on());
    // The next sample decides again.
    motor.hold(0.1, true);
    assert!(is_on());
}

/// At any rate of the ring oscillator, which only the board's own measurement determines; also while a debugger stops the processor, and
/// when the crystal stops.
#[test]
fn without_a_feeding_the_watchdog_turns_the_bridge_off_after_20_ms() {
    let ms = Here::CLOCK / 1000;
    TestRunner::new(cases(4))
        .run(&(rings(), any::<bool>(), any::<bool>()), |(ring, debugging, crystal_fails)| {
            let mut motor = started(ring, 0, 0);
            // It takes no part here, and most of the time.
            chip(|chip| chip.machine.runs = false);
            for _ in 0..2 {
                motor.hold(0.1, true);
                motor.feed();
                pass(15 * ms);
                prop_assert!(is_on());
            }
            motor.feed();
            chip(|chip| (chip.debugging, chip.crystal_fails) = (debugging, crystal_fails));
            // A PLL without its crystal has a rate of its own, 10 MHz here.
            let ms = if crystal_fails { 10_000 } else { ms };
            pass(19 * ms);
            prop_assert!(is_on());
            pass(2 * ms);
            prop_assert!(!is_on() && chip(|chip| chip.expired));
            Ok(())
        })
        .unwrap();
}

#[test]
fn a_crystal_that_stops_is_a_fault() {
    let mut motor = started(11e6, 0, 0);
    motor.hold(0.1, true);
    assert!(!motor.fault());
    chip(|chip| chip.crystal_fails = true);
    assert!(motor.fault());
}

#[test]
fn the_bridges_fault_is_a_fault_that_only_a_clear_ends() {
    let mut storage = storage();
    let mut host = TestHost::new(BOARD, &mut storage);
    let mut motor = started(11e6, 0, 0);
    let world = host.run(WHEEL);
    sample(&mut host, &mut motor);
    assert!(is_on());
    let fault = |low: bool| {
        chip(|chip| {
            chip.driven = if low { chip.driven | FAULT } else { chip.driven & !FAULT };
            chip.levels &= !FAULT;
        });
    };
    host.ask(Command::Set { parameter: Parameter::Divider as u8, value: 1 }).unwrap();
    host.received.clear();
    fault(true);
    sample(&mut host, &mut motor);
    fault(false);
    assert!(!is_on());
    let telemetry = host.received.iter().find_map(|received| match received {
        Received::Telemetry(telemetry) => Some((telemetry.phase, telemetry.reason)),
        _ => None,
    });
    assert_eq!(telemetry, Some((Phase::Faulted as u8, Reason::Driver.code())));
    for _ in 0..50 {
        sample(&mut host, &mut motor);
        assert!(!is_on());
        assert_eq!(host.ask(Command::Arm { world }), Err(Refusal::Phase));
    }
    host.ask(Command::Clear).unwrap();
    host.ask(Command::Arm { world }).unwrap();
    sample(&mut host, &mut motor);
    assert!(is_on());
}
