//! The network between two wheels: messages sent, delivered, repeated, changed and forged, in any order.
//!
//! An input is a row of steps of three bytes: what is done, at which station, with which of the messages that there are.

use hapt_core::Strength;
use hapt_wire::link::{Number, Outgoing, SIZE, Session};

const KEY: &[u8] = b"nobody has to guess it here";

/// Two stations and everything that was ever sent; the number is of what has happened.
///
/// # Panics
/// When a position is dated after its sample, or one is taken that nobody sent.
pub fn run(bytes: &[u8]) -> u64 {
    let mut sessions = [true, false].map(|first| Session::new(KEY, 5, first, if first { 1 } else { 2 }));
    let mut heard: [Option<Number>; 2] = [None; 2];
    let mut sent: Vec<Vec<u8>> = Vec::new();
    let (mut now, mut starts, mut seen) = (0_u64, 2, 0_u64);
    for step in bytes.chunks_exact(3) {
        let &[what, at, which] = step else { break };
        now += u64::from(at >> 1) * 1_000_000 + 1;
        let (at, which) = (usize::from(at & 1), usize::from(which));
        let Some((session, heard)) = sessions.get_mut(at).zip(heard.get_mut(at)) else { break };
        match what % 4 {
            0 => {
                let say =
                    Outgoing { sampled: now, position: now as f64, strength: Strength(which as u8), heard: *heard };
                sent.extend(session.send(&say).map(|bytes| bytes.to_vec()));
            }
            1 | 2 => {
                let Some(mut bytes) =
                    sent.len().checked_sub(1 + which % sent.len().max(1)).and_then(|at| sent.get(at)).cloned()
                else {
                    continue;
                };
                // Changed at one place, or not.
                let change = if what & 2 != 0 { what >> 2 } else { 0 };
                if let Some(byte) = bytes.get_mut(which % SIZE) {
                    *byte ^= change;
                }
                let taken = session.receive(&bytes, now);
                seen |= match taken {
                    Ok(taken) if taken.since.is_some() => 1,
                    Ok(_) => 2,
                    Err(why) => 4 << why.code(),
                };
                if let Ok(taken) = taken {
                    assert_eq!(change, 0, "a changed message is taken");
                    assert!(taken.since.is_none_or(|since| since as f64 <= taken.position), "{taken:?}");
                    *heard = Some(taken.number);
                }
            }
            _ => {
                starts += 1;
                (*session, *heard) = (Session::new(KEY, 5, at == 0, starts), None);
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
