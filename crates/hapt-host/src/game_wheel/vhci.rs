//! The virtual host controller of Linux's kernel (vhci-hcd): it takes one end of a stream, and a device appears on this computer.

use std::fs;
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::path::Path;

use super::WheelError;

const CONTROLLER: &str = "/sys/devices/platform/vhci_hcd.0";
/// The code of full speed, 12 Mbit/s.
const FULL_SPEED: u32 = 2;
/// The state of a free port.
const FREE: &str = "004";

/// The first free port for devices of full speed, in the text of the controller's `status`.
fn free_port(status: &str) -> Option<u32> {
    status.lines().find_map(|line| {
        let mut words = line.split_whitespace();
        let (hub, port, state) = (words.next()?, words.next()?, words.next()?);
        (hub == "hs" && state == FREE).then(|| port.parse().ok()).flatten()
    })
}

/// Attaches a device; the other end of its stream. Closing that detaches it.
pub fn attach() -> Result<UnixStream, WheelError> {
    let folder = Path::new(CONTROLLER);
    if !folder.exists() {
        return Err(WheelError::NoController);
    }
    let failed = |error: io::Error| {
        let is_forbidden = error.kind() == io::ErrorKind::PermissionDenied;
        if is_forbidden { WheelError::Permission } else { WheelError::Attach(error) }
    };
    let status = fs::read_to_string(folder.join("status")).map_err(failed)?;
    let port = free_port(&status).ok_or(WheelError::NoPort)?;
    let (own, kernels) = UnixStream::pair().map_err(WheelError::Attach)?;
    // The device identifier is bus number and device number; any unique value will do.
    let line = format!("{port} {} {} {FULL_SPEED}", kernels.as_raw_fd(), 1 << 16 | (port + 2));
    fs::write(folder.join("attach"), line).map_err(failed)?;
    Ok(own)
}

#[cfg(test)]
mod tests {
    use super::free_port;

    #[test]
    fn the_first_free_port_of_full_speed_is_taken() {
        let status = "hub port sta spd dev      sockfd local_busid\nhs  0000 006 002 00010002 000003 1-1\n\
                      hs  0001 004 000 00000000 000000 0-0\nss  0008 004 000 00000000 000000 0-0\n";
        assert_eq!(free_port(status), Some(1));
        assert_eq!(free_port(&status.replace("hs  0001 004", "hs  0001 006")), None);
        assert_eq!(free_port("nonsense"), None);
    }
}
