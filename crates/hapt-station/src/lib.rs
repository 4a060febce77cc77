//! The device's side of hapt's wire: worlds come in, are checked and run, torques go out.
//!
//! Two halves, so that compiling a world, which takes milliseconds, never delays a sample:
//!
//! - The [`Desk`] sits in the main loop. It takes the line's bytes, answers, gathers and compiles worlds into a spare [`Slot`].
//! - The [`Sampler`] sits in the timer's interrupt. It takes one sample a period under the supervisor, and says what the motor is to hold.
//!
//! They meet at the [`Mail`], where orders go one way, verdicts and telemetry the other, and a world as a reference that changes hands:
//! nothing is copied but a few words, and nobody waits. Each half calls `exchange` with it; the board lends it to one at a time (a critical
//! section in the main loop, the interrupt's own priority there).
//!
//! ```no_run
//! # use hapt_station::*;
//! # fn byte() -> Option<u8> { None }
//! # fn send(_: &[u8]) {}
//! # fn encoder() -> f32 { 0.0 }
//! # fn driver_has_switched_itself_off() -> bool { false }
//! # fn motor(_: Motor) {}
//! # fn timer(_: f32) {}
//! # fn cycles() -> u32 { 0 }
//! # let (mut one, mut other, mut mail) = (Slot::EMPTY, Slot::EMPTY, Mail::new());
//! let board = Board { name: "my-board", firmware: "0.1.0", fed: false, periods: [50e-6, 10e-3] };
//! let mut desk = Desk::new(board, &mut one);
//! let mut sampler = Sampler::new(&board, &mut other);
//!
//! // The main loop, again and again; `exchange` with the interrupt off.
//! while let Some(byte) = byte() {
//!     desk.push(byte);
//! }
//! desk.exchange(&mut mail);
//! while let Some(frame) = desk.answer(&mut [0; LONGEST]) {
//!     send(frame);
//! }
//!
//! // The timer's interrupt.
//! let fault = driver_has_switched_itself_off();
//! motor(sampler.sample(&Seen { position: encoder(), fault, ..Seen::default() }));
//! sampler.used(cycles());
//! if sampler.exchange(&mut mail) {
//!     timer(sampler.period());
//! }
//! ```
//!
//! A board without an encoder (an emulator, a test) is `fed`: [`Desk::push`] then gives what an [`Order::Feed`] has shown, and the sample
//! is taken at once; [`Station`] is both halves in one thread and does just that.
//!
//! [`Order::Feed`]: hapt_wire::Order::Feed
#![no_std]
#![forbid(unsafe_code)]

mod desk;
mod mail;
mod sampler;
mod slot;
mod station;

pub use desk::{Board, Desk};
pub use hapt_wire::{LONGEST, ROOM};
pub use mail::Mail;
pub use sampler::{Motor, Sampler, Seen};
pub use slot::Slot;
pub use station::Station;
