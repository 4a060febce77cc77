//! The parts of a board: a line to the host, an encoder, a motor, a watchdog. A board is one file in `boards/`, with its memory's file next
//! to it.

/// Bytes from and to the host. The main loop has it.
pub trait Line {
    /// A byte that has come in.
    fn receive(&mut self) -> Option<u8>;
    /// Sends a byte, or returns that it has to wait.
    fn send(&mut self, byte: u8) -> bool;
}

/// The devices that a sample needs. They belong to the timer's interrupt.
pub trait Device {
    /// The puck's position in rad (linear: m).
    fn position(&mut self) -> f32;
    /// Whether the motor's driver has reported a fault since the last call: too much current, heat, supply. Called once before each sample.
    /// The supervisor latches it; a board without such a report returns false.
    fn fault(&mut self) -> bool;
    /// Sets the motor's torque in N·m (linear: N) until the next call; off, its driver disconnects. A driver that has switched itself off stays
    /// off for as long as `on` is true: only `on` after off turns it on.
    fn hold(&mut self, torque: f32, on: bool);
    /// Feeds the watchdog. Without feeding for a few periods it removes the motor's power, in any state of the processor.
    fn feed(&mut self);
}

/// A board.
pub trait Board {
    /// Its name.
    const NAME: &'static str;
    /// The processor's clock in Hz, once it has been started.
    const CLOCK: u32;
    /// Its line.
    type Line: Line;
    /// Its encoder, motor and watchdog.
    type Device: Device + Send;
    /// Removes the torque, from the timer's interrupt, while a sample is later than its world allows; the sample's own `hold` comes after
    /// it. It may interrupt `hold`, whose torque is newer then.
    fn cut();
    /// Starts clocks, pins, timers; with no torque.
    fn start() -> (Self::Line, Self::Device);
}
