//! A page's link for a phone: as a QR code on the terminal.

use std::fmt::Write as _;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;

/// The link for another machine: where the page listens on every address, with this machine's address in its network. `None` where no other
/// machine reaches it.
pub fn link(link: &str, address: SocketAddr) -> Option<String> {
    if address.ip().is_loopback() {
        return None;
    }
    if !address.ip().is_unspecified() {
        return Some(link.into());
    }
    let (_, fragment) = link.split_once('#').unwrap_or((link, ""));
    let address = SocketAddr::new(own(address.ip())?, address.port());
    let mark = if fragment.is_empty() { "" } else { "#" };
    Some(format!("http://{address}/{mark}{fragment}"))
}

/// The address from which this machine would send to others. Nothing is sent.
fn own(any: IpAddr) -> Option<IpAddr> {
    // Addresses that are reserved for documentation, and belong to no machine.
    let other: IpAddr = match any {
        IpAddr::V4(_) => Ipv4Addr::new(192, 0, 2, 1).into(),
        IpAddr::V6(_) => Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1).into(),
    };
    let socket = UdpSocket::bind(SocketAddr::new(any, 0)).ok()?;
    socket.connect(SocketAddr::new(other, 9)).ok()?;
    let ip = socket.local_addr().ok()?.ip();
    (!ip.is_loopback() && !ip.is_unspecified()).then_some(ip)
}

/// The code as lines of half blocks, light on dark terminals too; empty where the text is too long for one.
pub fn code(text: &str) -> String {
    let Ok(code) = QrCode::new(text) else { return String::new() };
    let drawn = code.render::<Dense1x2>().dark_color(Dense1x2::Light).light_color(Dense1x2::Dark).build();
    let mut out = String::new();
    for line in drawn.lines() {
        let _ = writeln!(out, "  {line}");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{code, link};

    #[test]
    fn a_link_for_others_names_an_address_that_others_reach() {
        let at = |address: &str| link("http://127.0.0.1:7000/#abc", address.parse().unwrap());
        assert_eq!(at("127.0.0.1:7000"), None);
        assert_eq!(at("[::1]:7000"), None);
        let own = "http://192.168.0.7:7000/#abc";
        assert_eq!(link(own, "192.168.0.7:7000".parse().unwrap()), Some(own.into()));
        // Without a network there is none.
        if let Some(found) = at("0.0.0.0:7000") {
            assert!(found.starts_with("http://") && found.ends_with(":7000/#abc"), "{found}");
            assert!(!found.contains("127.0.0.1") && !found.contains("0.0.0.0"), "{found}");
        }
    }

    #[test]
    fn a_code_is_a_square_of_half_blocks() {
        let drawn = code("http://192.168.0.7:7000/#0123456789abcdef0123456789abcdef");
        let widths: Vec<usize> = drawn.lines().map(|line| line.trim_start().chars().count()).collect();
        assert!(widths.len() > 10 && drawn.chars().all(|c| " █▀▄\n".contains(c)), "{drawn}");
        assert_eq!(code(&"a".repeat(10_000)), "");
    }
}
