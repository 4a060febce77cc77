//! CAN buses for drives and simulations.

use std::io;
use std::time::Instant;

use rustix::event::PollFlags;
use rustix::io::Errno;
use socketcan::{
    CanAnyFrame, CanDataFrame, CanFdFrame, CanFdSocket, CanRemoteFrame, EmbeddedFrame, ExtendedId, Frame as _, Id,
    Socket as _, SocketOptions as _, StandardId,
    id::{CAN_EFF_FLAG, CAN_RTR_FLAG, FdFlags},
};

use crate::frame::Frame;
use crate::serial::wait;

/// Access to a CAN bus. Neither function allocates.
pub trait Bus: Send {
    /// Sends a frame.
    ///
    /// # Errors
    /// The bus was removed, or has not accepted the frame until that instant.
    fn send(&mut self, frame: &Frame, until: Instant) -> io::Result<()>;

    /// Receives the next frame; `None` if none arrives until that instant. With an instant in the past it only returns a frame already
    /// there.
    ///
    /// # Errors
    /// The bus is gone.
    fn receive(&mut self, until: Instant) -> io::Result<Option<Frame>>;
}

/// A CAN interface of the system, such as `can0`.
#[derive(Debug)]
pub struct Socket(CanFdSocket);

impl Socket {
    /// Opens the interface.
    ///
    /// # Errors
    /// There is none of this name, or it is down.
    pub fn open(interface: &str) -> io::Result<Self> {
        let socket = CanFdSocket::open(interface).map_err(|error| explained(interface, error))?;
        socket.set_nonblocking(true)?;
        // Error frames of the controller are not needed.
        socket.set_error_filter_drop_all()?;
        Ok(Socket(socket))
    }

    /// The same for data frames whose 29-bit identifiers agree with `id` in the bits of `mask`. The system drops the others.
    ///
    /// # Errors
    /// As [`Socket::open`].
    pub fn open_for(interface: &str, id: u32, mask: u32) -> io::Result<Self> {
        let socket = Socket::open(interface)?;
        let [id, mask] = [id | CAN_EFF_FLAG, mask | CAN_EFF_FLAG | CAN_RTR_FLAG];
        socket.0.set_filters(&[(id, mask)])?;
        Ok(socket)
    }
}

impl Bus for Socket {
    fn send(&mut self, frame: &Frame, until: Instant) -> io::Result<()> {
        let Some(outgoing) = outgoing(frame) else { return Err(io::ErrorKind::InvalidInput.into()) };
        loop {
            let sent = match &outgoing {
                CanAnyFrame::Normal(frame) => self.0.write_frame(frame),
                CanAnyFrame::Remote(frame) => self.0.write_frame(frame),
                CanAnyFrame::Fd(frame) => self.0.write_frame(frame),
                CanAnyFrame::Error(frame) => self.0.write_frame(frame),
            };
            match sent {
                Err(error) if waits(&error) && wait(&self.0, PollFlags::OUT, until)? => {}
                Err(error) if waits(&error) => return Err(io::ErrorKind::TimedOut.into()),
                sent => return sent,
            }
        }
    }

    fn receive(&mut self, until: Instant) -> io::Result<Option<Frame>> {
        loop {
            match self.0.read_frame() {
                Ok(frame) => {
                    if let Some(frame) = incoming(&frame) {
                        return Ok(Some(frame));
                    }
                }
                Err(error) if waits(&error) && wait(&self.0, PollFlags::IN, until)? => {}
                Err(error) if waits(&error) => return Ok(None),
                Err(error) => return Err(error),
            }
        }
    }
}

/// The error of an interface that does not open, with the cause.
fn explained(interface: &str, error: io::Error) -> io::Error {
    let what = match Errno::from_io_error(&error) {
        Some(Errno::AFNOSUPPORT | Errno::PROTONOSUPPORT) => "this system's kernel has no CAN (modprobe can_raw)".into(),
        Some(Errno::NODEV | Errno::NXIO) => {
            format!("there is no CAN interface {interface}; `ip link` lists what there is")
        }
        Some(Errno::NETDOWN) => format!("it is down; ip link set {interface} up"),
        _ => return error,
    };
    io::Error::new(error.kind(), what)
}

fn waits(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

fn outgoing(frame: &Frame) -> Option<CanAnyFrame> {
    let id = if frame.extended {
        Id::from(ExtendedId::new(frame.id)?)
    } else {
        Id::from(StandardId::new(u16::try_from(frame.id).ok()?)?)
    };
    Some(match frame {
        Frame { fd: true, .. } => CanFdFrame::with_flags(id, frame.data(), FdFlags::BRS)?.into(),
        Frame { remote: true, .. } => CanRemoteFrame::new_remote(id, frame.length().into())?.into(),
        _ => CanDataFrame::new(id, frame.data())?.into(),
    })
}

/// `None` for error frames of the controller.
fn incoming(frame: &CanAnyFrame) -> Option<Frame> {
    let id = frame.raw_id();
    let extended = frame.is_extended();
    Some(match frame {
        CanAnyFrame::Normal(frame) => Frame::classic(id, frame.data()).with_extended(extended),
        CanAnyFrame::Remote(frame) => Frame::remote(id, u8::try_from(frame.dlc()).ok()?).with_extended(extended),
        CanAnyFrame::Fd(frame) => Frame::fd(id, frame.data()).with_extended(extended),
        CanAnyFrame::Error(_) => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_the_same_on_both_sides_of_the_system() {
        let extended = Frame::classic(0x1234, &[1, 2]).with_extended(true);
        for frame in [Frame::classic(0x7ff, &[1, 2, 3]), Frame::remote(0x29, 8), Frame::fd(0x8001, &[5; 48]), extended]
        {
            assert_eq!(incoming(&outgoing(&frame).unwrap()), Some(frame));
        }
        assert!(outgoing(&Frame::classic(0x800, &[])).is_none(), "no identifier of 11 bits");
    }
}
