//! The network between two wheels: messages sent, delivered, repeated, changed and forged, in any order.
//!
//! An input is a row of steps of three bytes: the action, the station, and the message.

use std::collections::VecDeque;

use hapt_core::Strength;
use hapt_wire::link::{Codec, Datagrams, Frames, Number, Outgoing, Session};

const KEY: &[u8] = b"nobody has to guess it here";
/// A bus lets a message be overtaken by as many of its session.
const OVERTAKEN: usize = 128;

/// Two stations and all messages ever sent as datagrams; returns a number of the outcome.
///
/// # Panics
/// When a position is dated after its sample, or one is accepted that was never sent.
pub fn run(bytes: &[u8]) -> u64 {
    stations(bytes, |first| Datagrams::new(KEY, 5, first), None)
}

/// Two stations and the newest frames of their sessions on a bus, which loses, repeats and delays them.
///
/// # Panics
/// When a position is dated after its sample.
pub fn run_can(bytes: &[u8]) -> u64 {
    let codec = |first| Frames::new(Frames::RANGE, 5, 5, first).expect("its identifiers are there");
    stations(bytes, codec, Some(OVERTAKEN))
}

/// With a bound on overtaken messages, they are the newest, and of sessions that continue, and a changed one must only be read: a check is
/// no authentication, and one in 2 million of others passes it.
fn stations<C: Codec + Clone>(bytes: &[u8], codec: impl Fn(bool) -> C, overtaken: Option<usize>) -> u64 {
    let mut sessions = [true, false].map(|first| Session::new(codec(first), if first { 1 } else { 2 }));
    let mut received: [Option<Number>; 2] = [None; 2];
    // The sessions of both stations as it was sent, and the message.
    let mut sent: VecDeque<([u64; 2], C::Bytes)> = VecDeque::new();
    let (mut now, mut starts, mut seen) = (0_u64, 2, 0_u64);
    for step in bytes.chunks_exact(3) {
        let &[what, at, which] = step else { break };
        now += u64::from(at >> 1) * 1_000_000 + 1;
        let (at, which) = (usize::from(at & 1), usize::from(which));
        let owns = sessions.each_ref().map(|session| session.own().session);
        let Some((session, received)) = sessions.get_mut(at).zip(received.get_mut(at)) else { break };
        match what % 4 {
            0 => {
                let position = now as f64 * 1e-9;
                let say = Outgoing { sampled: now, position, strength: Strength(which as u8), received: *received };
                sent.extend(session.send(&say).map(|bytes| (owns, bytes)));
                if overtaken.is_some_and(|most| sent.len() > most) {
                    sent.pop_front();
                }
            }
            1 | 2 => {
                let newest = sent.len().checked_sub(1 + which % sent.len().max(1));
                let Some((of, bytes)) = newest.and_then(|at| sent.get(at)) else { continue };
                if overtaken.is_some() && *of != owns {
                    continue;
                }
                // Changed at one place, or not.
                let change = if what & 2 != 0 { what >> 2 } else { 0 };
                let mut bytes = bytes.as_ref().to_vec();
                let length = bytes.len();
                if let Some(byte) = bytes.get_mut(which % length) {
                    *byte ^= change;
                }
                if overtaken.is_some() && change != 0 {
                    let _ = session.clone().receive(&bytes, now);
                    continue;
                }
                let taken = session.receive(&bytes, now);
                seen |= match taken {
                    Ok(Some(taken)) if taken.since.is_some() => 1,
                    Ok(_) => 2,
                    Err(why) => 4 << why.code(),
                };
                if let Ok(Some(taken)) = taken {
                    assert_eq!(change, 0, "a changed message is taken");
                    // The position of a frame is rounded.
                    let sampled = taken.position + 0.51 / f64::from(1 << 22);
                    assert!(taken.since.is_none_or(|since| since as f64 * 1e-9 <= sampled), "{taken:?}");
                    *received = Some(taken.number);
                }
            }
            _ => {
                starts += 1 << 8;
                (*session, *received) = (Session::new(codec(at == 0), starts), None);
            }
        }
    }
    seen
}

/// Two stations that meet, one that starts anew, and messages that are repeated.
pub fn seeds() -> Vec<Vec<u8>> {
    let turn = [[0, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 0]].concat();
    let again = [[3, 1, 0], [1, 0, 3], [6, 1, 40]].concat();
    vec![turn.repeat(4), [turn.repeat(2), again, turn.repeat(5)].concat()]
}
