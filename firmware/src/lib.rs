//! hapt on a microcontroller.
#![no_std]

pub mod board;
#[cfg(feature = "semihosting")]
pub mod console;
pub mod halt;
#[cfg_attr(any(feature = "mps2", feature = "mps2-an505"), path = "boards/mps2.rs")]
#[cfg_attr(feature = "netduinoplus2", path = "boards/netduinoplus2.rs")]
#[cfg_attr(feature = "b-g431b-esc1", path = "boards/b-g431b-esc1.rs")]
#[cfg_attr(feature = "pico2", path = "boards/pico2.rs")]
#[cfg_attr(feature = "stm32f405", path = "boards/stm32f405.rs")]
#[cfg_attr(feature = "my-board", path = "../template/my-board.rs")]
mod here;
mod register;
pub mod sample;
pub mod shared;
#[cfg(feature = "semihosting")]
pub mod stack;
#[cfg(any(feature = "mps2", feature = "mps2-an505", feature = "netduinoplus2"))]
mod swing;
pub mod ticks;
#[cfg(feature = "semihosting")]
pub mod trace;
pub mod uart;
#[cfg(feature = "stm32f405")]
pub mod usb;

pub use here::Here;
