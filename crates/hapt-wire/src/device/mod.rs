//! The device's side of the wire: a board's command handler and its sampler. They receive, check and run worlds, and output torques.
//!
//! Two halves, so that compiling a world, which takes milliseconds, never delays a sample:
//!
//! - The [`CommandHandler`] runs in the main loop. It takes the line's bytes, sends responses, receives worlds and compiles them into a
//!   spare [`WorldStorage`].
//! - The [`Sampler`] runs in the timer's interrupt. It takes one sample a period under the supervisor and gives the motor's torque.
//!
//! They share a [`Mailbox`]: commands in one direction, responses and telemetry in the other, and a world as a reference whose ownership moves.
//! Only a few words are copied, and neither half waits for the other. Each half calls `exchange` with it; the board gives access to one
//! half at a time (by a critical section in the main loop, and by the interrupt's priority there).
//!
//! ```no_run
//! # use hapt_wire::{MAX_FRAME_BYTES, device::*};
//! # fn byte() -> Option<u8> { None }
//! # fn send(_: &[u8]) {}
//! # fn encoder() -> f32 { 0.0 }
//! # fn driver_has_switched_itself_off() -> bool { false }
//! # fn motor(_: Motor) {}
//! # fn timer(_: f32) {}
//! # fn cycles() -> u32 { 0 }
//! # let (mut one, mut other, mut mailbox) = (WorldStorage::EMPTY, WorldStorage::EMPTY, Mailbox::new());
//! let board = Board { name: "my-board", firmware: "0.1.0", externally_clocked: false, periods: [50e-6, 10e-3] };
//! let mut handler = CommandHandler::new(board, &mut one);
//! let mut sampler = Sampler::new(&board, &mut other);
//!
//! // The main loop, repeatedly; `exchange` with the interrupt off.
//! while let Some(byte) = byte() {
//!     handler.push(byte);
//! }
//! handler.exchange(&mut mailbox);
//! while let Some(frame) = handler.answer(&mut [0; MAX_FRAME_BYTES]) {
//!     send(frame);
//! }
//!
//! // The timer's interrupt.
//! let fault = driver_has_switched_itself_off();
//! motor(sampler.sample(&Measurement { position: encoder(), fault, ..Measurement::default() }));
//! sampler.used(cycles());
//! if sampler.exchange(&mut mailbox) {
//!     timer(sampler.period());
//! }
//! ```
//!
//! A board without an encoder (an emulator, a test) is `externally_clocked`: [`CommandHandler::push`] returns the measurement of an
//! [`Command::Sample`], and the sample is taken at once; [`Endpoint`] is both halves in one thread and does just that.
//!
//! [`Command::Sample`]: crate::Command::Sample
//!
//! A board that is a standalone force-feedback wheel has its world in its program, and a game's computer as its host: [`WheelSampler`] is its
//! interrupt's half, `WheelPort` of the module `usb` the main loop's half, and [`WheelMailbox`] connects them.

mod endpoint;
mod game_wheel;
mod handler;
mod mailbox;
mod sampler;
mod storage;

pub use endpoint::Endpoint;
pub use game_wheel::{NoWheel, UNSERVED, WheelMailbox, WheelSampler, WheelStatus};
pub use handler::{Board, CommandHandler};
pub use mailbox::Mailbox;
pub use sampler::{Measurement, Motor, Sampler};
pub use storage::WorldStorage;
