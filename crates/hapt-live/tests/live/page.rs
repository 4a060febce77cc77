//! The page's files, and the admission of requests.

use crate::common::{Page, WORLD, answer, live, live_at, status};

fn get(path: &str, host: &str, more: &str) -> String {
    format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{more}\r\n")
}

const UPGRADE: &str =
    "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

fn upgrade(host: &str, more: &str) -> String {
    format!("GET /ws HTTP/1.1\r\nHost: {host}\r\nConnection: Upgrade\r\n{UPGRADE}{more}\r\n")
}

#[test]
fn the_page_is_at_the_root_and_nothing_loads_from_elsewhere() {
    let live = live(WORLD);
    let own = live.address().to_string();
    let page = answer(live.address(), &get("/", &own, ""));
    assert_eq!(status(&page), 200);
    let (head, body) = page.split_once("\r\n\r\n").unwrap();
    assert!(body.starts_with("<!doctype html>"), "{body}");
    let head = head.to_lowercase();
    assert!(head.contains(&format!("connect-src 'self' ws://{own};")), "{head}");
    for line in [
        "content-security-policy: default-src 'none'; script-src 'self'; style-src 'self';",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "content-type: text/html",
    ] {
        assert!(head.contains(line), "{line}: {head}");
    }
    assert!(!head.contains("set-cookie") && !head.contains("unsafe-inline") && !head.contains("unsafe-eval"));

    let only_head = answer(live.address(), &get("/", &own, "").replace("GET", "HEAD"));
    assert_eq!(status(&only_head), 200);
    assert!(only_head.contains(&format!("content-length: {}", body.len())) && only_head.ends_with("\r\n\r\n"));

    assert_eq!(status(&answer(live.address(), &get("/nothing", &own, ""))), 404);
    assert_eq!(status(&answer(live.address(), &get("/../Cargo.toml", &own, ""))), 404);
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "TRACE"] {
        let refused = answer(live.address(), &get("/", &own, "").replace("GET", method));
        assert_eq!(status(&refused), 405, "{method}");
        assert!(refused.to_lowercase().contains("allow: get, head"), "{refused}");
    }
    assert_eq!(status(&answer(live.address(), &get("/ws", &own, &format!("Origin: http://{own}\r\n")))), 426);
}

#[test]
fn only_requests_of_the_servers_own_names_and_pages_are_admitted() {
    let live = live(WORLD);
    let port = live.address().port();
    let named = |name: &str| format!("{name}:{port}");
    for host in ["127.0.0.1", "localhost", "[::1]"].map(named) {
        assert_eq!(status(&answer(live.address(), &get("/", &host, ""))), 200, "{host}");
        let own = format!("Origin: http://{host}\r\n");
        assert_eq!(status(&answer(live.address(), &get("/", &host, &own))), 200, "{host}");
    }
    let wrong = [
        "localhost".to_string(),
        "127.0.0.1:1".into(),
        named("evil.example"),
        named("localhost.evil.example"),
        named("192.168.0.1"),
        named("0.0.0.0"),
        String::new(),
    ];
    for host in &wrong {
        assert_eq!(status(&answer(live.address(), &get("/", host, ""))), 403, "{host:?}");
        let own = format!("Origin: http://{host}\r\n");
        assert_eq!(status(&answer(live.address(), &upgrade(host, &own))), 403, "{host:?}");
    }
    let own = named("127.0.0.1");
    let origins = wrong.iter().map(|host| format!("http://{host}")).chain([
        "null".to_string(),
        format!("https://{own}"),
        format!("http://{own}/"),
        format!("ws://{own}"),
    ]);
    for origin in origins {
        let origin = format!("Origin: {origin}\r\n");
        assert_eq!(status(&answer(live.address(), &get("/", &own, &origin))), 403, "{origin}");
        assert_eq!(status(&answer(live.address(), &upgrade(&own, &origin))), 403, "{origin}");
    }
    // Refused: a request of no browser, a second Host, and a proxy request for another server.
    assert_eq!(status(&answer(live.address(), &upgrade(&own, ""))), 403);
    assert_eq!(status(&answer(live.address(), &get("/", &own, "Host: evil.example\r\n"))), 403);
    assert_eq!(status(&answer(live.address(), &get("http://evil.example/", &own, ""))), 403);
    assert_eq!(status(&answer(live.address(), "GET / HTTP/1.0\r\n\r\n")), 403);
}

#[test]
fn bytes_that_are_no_request_and_heads_too_long_are_refused() {
    let live = live(WORLD);
    let own = live.address().to_string();
    for bytes in ["\0\0\0\0\r\n\r\n", "\u{16}\u{3}\u{1}\r\n\r\n", "GET\r\n\r\n", "GET / HTTP/9.9\r\n\r\n"] {
        let refused = answer(live.address(), bytes);
        assert!(refused.is_empty() || status(&refused) >= 400, "{bytes:?}: {refused}");
    }
    let many = "X-A: b\r\n".repeat(1000);
    assert_eq!(status(&answer(live.address(), &get("/", &own, &many))), 431);
    assert_eq!(status(&answer(live.address(), &get("/", &own, ""))), 200);
}

#[test]
fn a_page_from_another_machine_needs_the_links_token() {
    let live = live_at(WORLD, "0.0.0.0:0");
    let (address, token) = live.link().split_once("/#").map(|(a, t)| (a.to_string(), t.to_string())).unwrap();
    let address = address.trim_start_matches("http://").parse().unwrap();
    assert!(live.asks_for_token());
    let wrong = "0".repeat(token.len());
    for hello in ["", ",\"token\":\"\"", &format!(",\"token\":\"{wrong}\""), &format!(",\"token\":\"{token}0\"")] {
        let mut page = Page::connect(address).unwrap();
        page.send(format!("{{\"type\":\"hello\",\"v\":1{hello}}}").into());
        page.receive("error");
        assert_eq!(page.closed(), 1008, "{hello}");
    }
    let mut page = Page::connect(address).unwrap();
    page.send(format!("{{\"type\":\"hello\",\"v\":1,\"token\":{token:?}}}").into());
    page.receive("hello");
}
