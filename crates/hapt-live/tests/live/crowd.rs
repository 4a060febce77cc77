//! Floods of connections and messages.

use std::collections::VecDeque;
use std::io::Write;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::json;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::frame::Frame;
use tokio_tungstenite::tungstenite::protocol::frame::coding::{Data, OpCode};

use crate::common::{Page, WORLD, answer, live, status};

#[test]
fn hundreds_of_connections_with_random_bytes_block_neither_page_nor_frames() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    let before = page.frame().time;
    let mut crowd = Vec::new();
    for i in 0..400_usize {
        let mut stream = TcpStream::connect(live.address()).unwrap();
        // Some send nothing, some begin a request, some send random bytes; a broken pipe is ignored.
        let _ = match i % 4 {
            0 => Ok(()),
            1 => stream.write_all(b"GET / HT"),
            2 => stream.write_all(&[0xff; 5000]),
            _ => stream.write_all(b"GET /ws HTTP/1.1\r\nHost: evil.example\r\n\r\n"),
        };
        crowd.push(stream);
    }
    let own = live.address().to_string();
    let request = format!("GET / HTTP/1.1\r\nHost: {own}\r\nConnection: close\r\n\r\n");
    assert_eq!(status(&answer(live.address(), &request)), 200);
    let after = page.frame_until(|frame| frame.time > before + 0.5);
    assert!(after.time > before);
    page.say(json!({ "type": "order", "order": "stop" }));
    page.receive_until("status", |status| status["phase"] == "faulted");
}

#[test]
fn silent_websockets_do_not_block_other_pages() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    // More than twice as many as there are places: the oldest are closed.
    let silent: Vec<Page> = (0..160).map(|_| Page::open(&live)).collect();
    let (mut other, _) = Page::new(&live);
    for page in [&mut page, &mut other] {
        page.receive_until("status", |status| status["clients"] == 2);
    }
    drop(silent);
}

#[test]
fn pages_beyond_the_sixty_fourth_are_refused_until_one_leaves() {
    let live = live(WORLD);
    let mut pages: Vec<Page> = (0..64).map(|_| Page::new(&live).0).collect();
    let refused = Page::connect(live.address()).err().unwrap();
    assert!(refused.contains("503"), "{refused}");
    // The page's files are still served.
    let own = live.address().to_string();
    let request = format!("GET / HTTP/1.1\r\nHost: {own}\r\nConnection: close\r\n\r\n");
    assert_eq!(status(&answer(live.address(), &request)), 200);
    let mut last = pages.pop().unwrap();
    last.send(Message::Close(None));
    last.closed();
    while Page::connect(live.address()).is_err() {}
}

#[test]
fn the_fragments_of_an_endless_message_count_as_messages() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    let piece = |opcode| Message::Frame(Frame::message(Vec::new(), OpCode::Data(opcode), false));
    page.send(piece(Data::Text));
    let sent = (0..100_000).take_while(|_| page.send(piece(Data::Continue))).count();
    assert!([1008, 0].contains(&page.closed()), "{sent} pieces");
    Page::new(&live);
}

#[test]
fn a_page_that_does_not_read_is_disconnected_and_the_others_are_not() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    let (mut deaf, _) = Page::new(&live);
    page.receive_until("status", |status| status["clients"] == 2);
    // Each answer is a world of several KiB: together more than any buffer holds, at the permitted rate.
    for _ in 0.. {
        for _ in 0..20 {
            page.say(json!({ "type": "reset" }));
        }
        let status = page.receive("status");
        if status["clients"] == 1 {
            break;
        }
    }
    assert_ne!(deaf.closed(), 1000);
    page.frame();
}

#[test]
fn invalid_frames_end_only_their_own_websocket() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    let own = live.address().to_string();
    // xorshift: the same random bytes in every run.
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut byte = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state as u8
    };
    for _ in 0..100 {
        let mut stream = TcpStream::connect(live.address()).unwrap();
        let head = format!(
            "GET /ws HTTP/1.1\r\nHost: {own}\r\nOrigin: http://{own}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        );
        let bytes: Vec<u8> = head.into_bytes().into_iter().chain((0..1000).map(|_| byte())).collect();
        // It may have been disconnected before all was sent.
        let _ = stream.write_all(&bytes);
    }
    let time = page.frame().time;
    page.frame_until(|frame| frame.time > time);
    Page::new(&live);
}

/// Prints the loop's timing under a flood and without one: `cargo test --release -p hapt-live --test live -- --ignored
/// --nocapture`. It asserts nothing, because the machine's other work affects the result.
#[test]
#[ignore = "a measurement"]
fn measured_a_thousand_connections_beside_an_idle_run() {
    println!(
        "| run | samples | missed | latency p50 | p90 | p99 | p99.9 | max, us |\n| --- | --- | --- | --- | --- | --- | --- | --- |"
    );
    for turn in 0..6 {
        let is_crowded = turn % 2 == 1;
        let live = live(WORLD);
        let (mut page, _) = Page::new(&live);
        let end = Arc::new(AtomicBool::new(false));
        let (address, ended) = (live.address(), Arc::clone(&end));
        let crowd = std::thread::spawn(move || {
            let mut streams: VecDeque<TcpStream> = VecDeque::new();
            while is_crowded && !ended.load(Ordering::Relaxed) {
                if let Ok(mut stream) = TcpStream::connect(address) {
                    let _ = stream.write_all(&[0xff; 2000][..2 * streams.len()]);
                    streams.push_back(stream);
                }
                if streams.len() > 999 {
                    streams.pop_front();
                    std::thread::sleep(std::time::Duration::from_millis(1));
                }
            }
        });
        let timing = page.receive_until("status", |status| status["timing"]["samples"].as_u64() > Some(10_000));
        end.store(true, Ordering::Relaxed);
        crowd.join().unwrap();
        let (timing, latency) = (&timing["timing"], &timing["timing"]["latency_us"]);
        let name = if is_crowded { "1000 connections" } else { "idle" };
        print!("| {name} | {} | {} |", timing["samples"], timing["missed"]);
        println!(
            " {} | {} | {} | {} | {} |",
            latency["p50"], latency["p90"], latency["p99"], latency["p999"], latency["max"]
        );
    }
}
