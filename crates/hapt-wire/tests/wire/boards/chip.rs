//! The modelled part of a STM32G431 (ST RM0440): clocks that are ready at once, and timer 1's break.

use std::cell::RefCell;
use std::collections::BTreeMap;

thread_local! {
    /// Each test has its own thread, and therefore its own chip.
    pub static CHIP: RefCell<Chip> = RefCell::default();
}

pub const RCC_CONTROL: usize = 0x4002_1000;
pub const RCC_CONFIGURATION: usize = 0x4002_1008;
pub const RCC_PLL: usize = 0x4002_100c;
pub const FLASH_ACCESS: usize = 0x4002_2000;
pub const TIM1_STATE: usize = 0x4001_2c10;
pub const TIM1_BREAK: usize = 0x4001_2c44;
pub const TIM1_BREAK_SOURCES: usize = 0x4001_2c60;
pub const TIM4_COUNT: usize = 0x4000_0824;
pub const DAC3_VALUE_1: usize = 0x5000_1008;
pub const DAC3_VALUE_2: usize = 0x5000_1014;

/// MOE: the outputs' enable.
const OUTPUTS: u32 = 1 << 15;
/// BIF: a break has occurred.
const BROKEN: u32 = 1 << 7;

/// The chip.
#[derive(Debug, Default)]
pub struct Chip {
    pub registers: BTreeMap<usize, u32>,
    /// Whether a comparator detects overcurrent.
    overcurrent: bool,
}

impl Chip {
    pub fn read(&mut self, at: usize) -> u32 {
        let value = self.registers.get(&at).copied().unwrap_or(0);
        match at {
            // Crystal and PLL are ready, and the processor runs from the selected clock.
            RCC_CONTROL => value | (value & (1 << 16 | 1 << 24)) << 1,
            RCC_CONFIGURATION => value & !(3 << 2) | (value & 3) << 2,
            _ => value,
        }
    }

    pub fn write(&mut self, at: usize, value: u32) {
        let value = match at {
            // Writing 0 clears a flag, and only the chip sets it.
            TIM1_STATE => value & self.read(at),
            // A break keeps the outputs disabled.
            TIM1_BREAK if self.overcurrent => value & !OUTPUTS,
            _ => value,
        };
        self.registers.insert(at, value);
        self.look();
    }

    /// Sets or ends an overcurrent at a comparator.
    pub fn current(&mut self, overcurrent: bool) {
        self.overcurrent = overcurrent;
        self.look();
    }

    /// The break of a comparator is a level: it sets its flag again for as long as it lasts.
    fn look(&mut self) {
        if self.overcurrent {
            *self.registers.entry(TIM1_STATE).or_default() |= BROKEN;
            *self.registers.entry(TIM1_BREAK).or_default() &= !OUTPUTS;
        }
    }

    /// Whether the bridges switch.
    pub fn is_on(&self) -> bool {
        self.registers.get(&TIM1_BREAK).is_some_and(|x| x & OUTPUTS != 0)
    }
}
