//! Admission: requests for this server by its own name, from its own page, and with the token where one is needed.
//!
//! A page of another site in the same browser can send requests to any address of this machine. Its Origin is foreign, and with DNS
//! rebinding its Host too. Both are refused.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

/// The names of the server, and its token.
#[derive(Clone, Debug)]
pub struct Access {
    address: SocketAddr,
    token: Option<String>,
}

/// The reason that a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Denied {
    /// The request is for another server.
    #[error("the Host is not this server's own")]
    Host,
    /// The request comes from another site's page.
    #[error("the Origin is not this server's own")]
    Origin,
    /// The websocket comes from no browser.
    #[error("a websocket without Origin comes from no browser")]
    NoOrigin,
}

impl Access {
    /// For a server bound to `address`: where other machines can reach it, or with `needs_token`, pages need a token.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new(address: SocketAddr, needs_token: bool) -> std::io::Result<Self> {
        let token = if address.ip().is_loopback() && !needs_token { None } else { Some(random()?) };
        Ok(Access { address, token })
    }

    /// The page's address, with the token in the fragment, which browsers do not send.
    pub fn link(&self) -> String {
        let fragment = self.token.as_ref().map_or(String::new(), |token| format!("#{token}"));
        // "Any address" is the loopback in a browser here.
        let ip = match self.address.ip() {
            IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
            ip @ (IpAddr::V4(_) | IpAddr::V6(_)) => ip,
        };
        format!("http://{}/{fragment}", SocketAddr::new(ip, self.address.port()))
    }

    /// Whether the token is needed.
    pub fn asks_for_token(&self) -> bool {
        self.token.is_some()
    }

    /// Checks the Host and Origin of a request; a websocket needs both.
    pub fn admits(&self, host: Option<&str>, origin: Option<&str>, websocket: bool) -> Result<(), Denied> {
        host.filter(|host| self.is_own(host)).ok_or(Denied::Host)?;
        match origin {
            None if websocket => Err(Denied::NoOrigin),
            None => Ok(()),
            Some(origin) => {
                origin.strip_prefix("http://").filter(|named| self.is_own(named)).map(|_| ()).ok_or(Denied::Origin)
            }
        }
    }

    /// Compares the token in constant time.
    pub fn knows(&self, given: Option<&str>) -> bool {
        let Some(token) = &self.token else { return true };
        let given = given.unwrap_or_default().as_bytes();
        let differing = token.bytes().zip(given).fold(0, |bits, (a, b)| bits | (a ^ b));
        std::hint::black_box(differing) == 0 && given.len() == token.len()
    }

    /// Whether `host` is `NAME:PORT` of this server. Only numbers and localhost count, not names that DNS could point here.
    fn is_own(&self, host: &str) -> bool {
        let own = self.address;
        let (name, port) = match host.rsplit_once(':') {
            Some((name, port)) if !port.is_empty() && port.bytes().all(|c| c.is_ascii_digit()) => (name, port),
            // Browsers omit the default port.
            _ => (host, "80"),
        };
        if port.parse() != Ok(own.port()) {
            return false;
        }
        if name.eq_ignore_ascii_case("localhost") {
            return own.ip().is_loopback() || own.ip().is_unspecified();
        }
        let number = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        let Ok(number) = number.parse::<IpAddr>() else { return false };
        if number.is_ipv6() != name.starts_with('[') {
            return false;
        }
        let usual = [IpAddr::from([127, 0, 0, 1]), IpAddr::from([0, 0, 0, 0, 0, 0, 0, 1])];
        match own.ip() {
            ip if ip == number => !ip.is_unspecified(),
            ip if ip.is_loopback() => usual.contains(&number),
            // Every address of the machine is the server's.
            ip => ip.is_unspecified() && !number.is_unspecified(),
        }
    }
}

/// 128 random bits in hexadecimal digits.
fn random() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(address: &str) -> Access {
        Access::new(address.parse().unwrap(), false).unwrap()
    }

    #[test]
    fn on_loopback_the_server_has_three_names() {
        let access = access("127.0.0.1:4278");
        for host in ["127.0.0.1:4278", "localhost:4278", "LOCALHOST:4278", "[::1]:4278"] {
            assert_eq!(access.admits(Some(host), None, false), Ok(()), "{host}");
            assert_eq!(access.admits(Some(host), Some(&format!("http://{host}")), true), Ok(()), "{host}");
            assert_eq!(access.admits(Some(host), Some("http://localhost:4278"), true), Ok(()), "{host}");
            assert_eq!(access.admits(Some(host), None, true), Err(Denied::NoOrigin), "{host}");
        }
        for host in [
            "",
            "127.0.0.1",
            "localhost",
            "127.0.0.1:80",
            "127.0.0.1:42780",
            "127.0.0.2:4278",
            "0.0.0.0:4278",
            "[::]:4278",
            "::1:4278",
            "[127.0.0.1]:4278",
            "[::1]",
            "evil.example:4278",
            "localhost.evil.example:4278",
            "127.0.0.1:4278.evil.example",
            "evil.example",
            "127.0.0.1:4278:4278",
            "127.0.0.1:+4278",
            "127.1:4278",
            "localhost:",
            " localhost:4278",
            "user@localhost:4278",
            "localhost:4278/",
        ] {
            assert_eq!(access.admits(Some(host), None, false), Err(Denied::Host), "{host}");
        }
        assert_eq!(access.admits(None, None, false), Err(Denied::Host));
    }

    #[test]
    fn another_sites_page_is_refused_under_any_name() {
        let access = access("127.0.0.1:4278");
        for origin in [
            "null",
            "",
            "http://evil.example",
            "https://localhost:4278",
            "http://localhost",
            "http://localhost:80",
            "localhost:4278",
            "http://localhost:4278.evil.example",
            "http://localhost:4278/",
            "file://",
            "http://[::1]:80",
            "http://127.0.0.2:4278",
        ] {
            for websocket in [false, true] {
                let answer = access.admits(Some("localhost:4278"), Some(origin), websocket);
                assert_eq!(answer, Err(Denied::Origin), "{origin}");
            }
        }
    }

    #[test]
    fn a_server_for_other_machines_has_numbers_for_names_and_needs_its_token() {
        let one = access("192.0.2.7:4278");
        assert_eq!(one.admits(Some("192.0.2.7:4278"), None, false), Ok(()));
        assert_eq!(one.admits(Some("localhost:4278"), None, false), Err(Denied::Host));
        let every = access("0.0.0.0:4278");
        for host in ["192.0.2.7:4278", "[2001:db8::1]:4278", "localhost:4278", "127.0.0.1:4278"] {
            assert_eq!(every.admits(Some(host), None, false), Ok(()), "{host}");
        }
        assert_eq!(every.admits(Some("lab-pc:4278"), None, false), Err(Denied::Host));
        assert_eq!(every.admits(Some("0.0.0.0:4278"), None, false), Err(Denied::Host));
        for access in [one, every] {
            let link = access.link();
            let token = link.split_once("/#").unwrap().1;
            assert_eq!(token.len(), 32);
            assert!(access.asks_for_token() && access.knows(Some(token)));
            for wrong in [None, Some(""), Some(&token[1..]), Some(&format!("{token}0")), Some(&"0".repeat(32))] {
                assert!(!access.knows(wrong), "{wrong:?}");
            }
        }
    }

    #[test]
    fn with_a_motor_the_token_is_needed_on_loopback_too() {
        let access = Access::new("127.0.0.1:4278".parse().unwrap(), true).unwrap();
        let link = access.link();
        let token = link.strip_prefix("http://127.0.0.1:4278/#").unwrap();
        assert!(token.len() == 32 && access.asks_for_token() && access.knows(Some(token)) && !access.knows(None));
    }

    #[test]
    fn on_loopback_without_a_motor_no_token_is_needed_and_port_80_is_not_named() {
        let access = access("[::1]:80");
        assert_eq!(access.link(), "http://[::1]:80/");
        assert!(!access.asks_for_token() && access.knows(None));
        for host in ["[::1]", "[::1]:80", "localhost", "127.0.0.1"] {
            assert_eq!(access.admits(Some(host), None, false), Ok(()), "{host}");
        }
    }

    #[test]
    fn two_tokens_differ() {
        assert_ne!(access("0.0.0.0:1").link(), access("0.0.0.0:1").link());
    }
}
