//! Datagrams as the medium of links.

use std::io;
use std::net::{SocketAddr, UdpSocket};

use hapt_wire::link::Datagrams;

use super::ends::{Arrived, Medium};

/// A non-blocking socket.
pub struct Udp(pub UdpSocket);

impl Medium for Udp {
    type Codec = Datagrams;
    type To = SocketAddr;

    fn receive(&mut self, into: &mut [u8]) -> Arrived {
        match self.0.recv_from(into) {
            Ok((length, _)) => Arrived::Message(length),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Arrived::Nothing,
            // An earlier message had no receiver, or this one was truncated to the buffer.
            Err(_) => Arrived::Other,
        }
    }

    fn send(&mut self, to: SocketAddr, bytes: &[u8]) {
        let _ = self.0.send_to(bytes, to);
    }
}
