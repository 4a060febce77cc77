//! The energy of a link that connects and releases, over random delays of messages and hands that pull at the best times.

use std::collections::VecDeque;

use hapt_core::{LASTING, LinkEnd, LinkTerms, RemoteState, Strength};
use hapt_testing::prelude::*;

#[derive(Clone, Copy)]
struct Message {
    sampled: f64,
    position: f64,
    strength: Strength,
}

struct End {
    link: LinkEnd,
    coming: VecDeque<(usize, Message)>,
    newest: Option<Message>,
}

/// The energy that the hands have drawn from the link, and how often it has connected, when they hold the ends `stretch` apart whenever the
/// messages are cut, and bring them together when it is connected again.
fn drawn(stiffness: f64, soft: f64, stretch: f64, travel_time: usize, wall: bool) -> (f64, u64) {
    let period = 1e-3;
    let terms = LinkTerms { age_max: 30e-3, hold: period, period, soft };
    let mut ends =
        [true, false].map(|first| End { link: LinkEnd::new(first, terms), coming: VecDeque::new(), newest: None });
    let (mut drawn, mut previous, mut taken) = (0.0, [0.0; 2], 0);
    let mut torques = [0.0; 2];
    for sample in 0..8000_usize {
        let time = sample as f64 * period;
        // A second each: cut and pulled apart, joined, moved together.
        let at = time % 2.0;
        let apart = match at {
            _ if at < 0.1 => 0.0,
            _ if at < 0.6 => (at - 0.1) / 0.5,
            _ if at < 1.4 => 1.0,
            _ if at < 1.9 => (1.9 - at) / 0.5,
            _ => 0.0,
        };
        let is_cut = at < 0.7;
        let positions = [0.5 * stretch * apart, -0.5 * stretch * apart];
        for side in 0..2 {
            drawn += torques[side] * (positions[side] - previous[side]);
        }
        previous = positions;
        for side in 0..2 {
            let end = &mut ends[side];
            while let Some((_, message)) = end.coming.front().filter(|(arrives, _)| *arrives <= sample).copied() {
                end.coming.pop_front();
                end.newest = Some(message);
            }
            let remote = end.newest.map(|newest| RemoteState {
                age: time - newest.sampled,
                session: 1,
                taken: newest.sampled,
                position: newest.position,
                strength: newest.strength,
            });
            let own = positions[side];
            let law = |other: f64, _: Option<f64>| {
                let q = own - other;
                let q = if wall { if side == 0 { q.max(0.0) } else { q.min(0.0) } } else { q };
                -stiffness * q
            };
            let acted = end.link.strength().acts();
            let torque = end.link.sample(period, true, remote, law);
            torques[side] = torque;
            taken += u64::from(side == 0 && !acted && end.link.strength().acts());
            let message = Message { sampled: time, position: own, strength: end.link.sent_strength() };
            if !is_cut {
                ends[1 - side].coming.push_back((sample + travel_time, message));
            }
        }
    }
    (drawn, taken)
}

proptest! {
    // (T54): a hand draws the soft torque times the stretch each time that the link connects, and the energy by the age (T51); a link that
    // connected at once would give it half of K times the square of the stretch.
    #[test]
    fn taking_hold_gives_no_more_than_the_soft_torque_times_the_stretch(
        stiffness in 0.1..10.0, part in 0.01..0.1, stretch in 0.1..1.0, travel_time in 0_usize..10, wall in any::<bool>(),
    ) {
        let soft = part * stiffness * stretch;
        let (drawn, taken) = drawn(stiffness, soft, stretch, travel_time, wall);
        prop_assert!(taken >= 3, "{taken}");
        // Four ways there and back at stretch/1 s each: ∫ż² of one end is (stretch/2)²/0.25 s.
        let age = (travel_time + 2) as f64 * 1e-3;
        let squares = 8.0 * (0.5 * stretch / 0.5_f64).powi(2) * 0.5;
        let late = stiffness * (2.0 * age + 1e-3) * squares;
        let w = stretch * 60e-3;
        let bound = taken as f64 * soft * (stretch + w * (1.0 + (stiffness * stretch / soft).ln())) + late;
        prop_assert!(drawn <= bound, "{drawn} J of {bound} J");
        prop_assert!(bound < 0.5 * taken as f64 * 0.5 * stiffness * stretch * stretch, "the bound says little: {bound}");
    }
}

/// A link with time to fade does so in steps, whatever messages are lost: the torque has faded before the age is reached.
#[test]
fn a_torque_fades_over_a_quarter_of_the_age_and_not_at_once() {
    let terms = LinkTerms { age_max: 40e-3, hold: 1e-3, period: 1e-3, soft: 0.1 };
    for first in [true, false] {
        let mut end = LinkEnd::new(first, terms);
        let remote = |age, position, strength| Some(RemoteState { age, session: 1, taken: 0.0, position, strength });
        let law = |other: f64, _: Option<f64>| -(1.0 - other);
        end.sample(1e-3, true, remote(2e-3, 1.0, Strength::NONE), law);
        end.sample(1e-3, true, remote(2e-3, 1.0, Strength::WHOLE), law);
        assert_eq!(end.strength(), Strength::WHOLE);
        assert_eq!(end.sample(1e-3, true, remote(2e-3, 0.0, Strength::WHOLE), law), -1.0);
        // No more messages arrive.
        let torques: Vec<f64> = (3..60)
            .map(|age| end.sample(1e-3, true, remote(f64::from(age) * 1e-3, 0.0, Strength::WHOLE), law))
            .collect();
        let largest = torques.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        assert!(
            largest < 0.2
                && torques[20] == -1.0
                && torques[36] > -0.2
                && torques[38..].iter().all(|torque| *torque == 0.0),
            "{torques:?}"
        );
        assert_eq!(end.releases(), 1);
        // The other stops: its last position fades, the one that it sends on is not used.
        let mut end = LinkEnd::new(first, terms);
        end.sample(1e-3, true, remote(2e-3, 1.0, Strength::NONE), law);
        end.sample(1e-3, true, remote(2e-3, 1.0, Strength::WHOLE), law);
        end.sample(1e-3, true, remote(2e-3, 0.0, Strength::WHOLE), law);
        let torques: Vec<f64> =
            (0..12).map(|_| end.sample(1e-3, true, remote(2e-3, -9.0, Strength::NONE), law)).collect();
        assert!(torques[0] >= -1.0 && torques[0] < -0.8 && torques[11] == 0.0 && torques.is_sorted(), "{torques:?}");
        // Its own loop is not ready: at once.
        end = LinkEnd::new(first, terms);
        end.sample(1e-3, true, remote(2e-3, 1.0, Strength::NONE), law);
        end.sample(1e-3, true, remote(2e-3, 1.0, Strength::WHOLE), law);
        assert_eq!(end.sample(1e-3, false, remote(2e-3, 0.0, Strength::WHOLE), law), 0.0);
        assert_eq!(end.sent_strength(), Strength::NONE);
    }
}

proptest! {
    #[test]
    fn a_strength_is_the_largest_step_below_a_part(part in 0.0..1.5_f64, byte in any::<u8>()) {
        let found = Strength::at_most(part);
        prop_assert!(found.part() <= part);
        prop_assert!(found == Strength::WHOLE || Strength(found.0 + 1).part() > part);
        prop_assert_eq!(Strength::at_most(Strength(byte).part()), Strength(byte));
    }
}

proptest! {
    // (T64), whatever messages are lost, and whenever they arrive: the velocity that acts is a mean of the other's motion, within the
    // bound.
    #[test]
    fn the_others_velocity_that_acts_is_bounded_by_its_motion(
        sender in 0.5e-3..4e-3_f64, receiver in 0.5e-3..4e-3_f64, loss in 0.0..0.9_f64, steps in any::<[f64; 16]>(), seed in 1_u64..,
    ) {
        let mut state = seed;
        let mut random = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let terms = LinkTerms { age_max: 50e-3, hold: receiver, period: sender, soft: 1.0 };
        let mut end = LinkEnd::holding(false, terms);
        // Steps of the other at its samples, and when each arrives.
        let (mut position, mut squares, mut sent) = (0.0, 0.0, Vec::new());
        for k in 1..2000_u32 {
            let step = sender * steps[k as usize % 16].clamp(-1e3, 1e3) / 1e3;
            (position, squares) = (position + step, squares + step * step / sender);
            let taken = f64::from(k) * sender;
            if random() >= loss {
                sent.push((taken + 10e-3 * random(), taken, position));
            }
        }
        let (mut newest, mut acted, mut seen) = (None::<(f64, f64)>, 0.0, 0);
        for k in 0..(2000.0 * sender / receiver) as u32 {
            let now = f64::from(k) * receiver;
            for (_, taken, position) in sent.iter().filter(|(arrives, ..)| *arrives <= now && *arrives > now - receiver) {
                if newest.is_none_or(|(before, _)| before < *taken) {
                    newest = Some((*taken, *position));
                }
            }
            let remote = newest.map(|(taken, position)| RemoteState {
                age: now - taken, session: 1, taken, position, strength: Strength::WHOLE,
            });
            let velocity = std::cell::Cell::new(0.0);
            end.sample(receiver, true, remote, |_, known| {
                velocity.set(known.unwrap_or(velocity.get()));
                0.0
            });
            seen += u32::from(velocity.get() != 0.0);
            acted += velocity.get() * velocity.get() * receiver;
        }
        let most = LASTING.max(receiver / sender);
        prop_assert!(seen > 0 || loss > 0.5 || squares == 0.0);
        prop_assert!(acted <= most * squares * (1.0 + 1e-9), "{acted} of {squares} times {most}");
    }
}

/// With messages on time it is the mean between two, and it ends soon after the last.
#[test]
fn the_others_velocity_is_its_mean_between_two_messages_for_four_times_as_long() {
    let terms = LinkTerms { age_max: 50e-3, hold: 1e-3, period: 2e-3, soft: 1.0 };
    let mut end = LinkEnd::holding(false, terms);
    let mut sample = |age: f64, session, taken: f64| {
        let velocity = std::cell::Cell::new(None);
        let remote = RemoteState { age, session, taken, position: 3.0 * taken, strength: Strength::WHOLE };
        end.sample(1e-3, true, Some(remote), |_, known| {
            velocity.set(known.or(velocity.get()));
            0.0
        });
        velocity.get()
    };
    assert_eq!(sample(1e-3, 1, 0.0), None);
    assert!((sample(1e-3, 1, 2e-3).unwrap() - 3.0).abs() < 1e-12);
    // Seven holds later it has acted for 8 ms, and not longer.
    let lasting: Vec<bool> = (2..12).map(|age| sample(f64::from(age) * 1e-3, 1, 2e-3).is_some()).collect();
    assert_eq!(lasting, [true, true, true, true, true, true, true, false, false, false]);
    assert!((sample(1e-3, 1, 20e-3).unwrap() - 3.0).abs() < 1e-12);
    // Message numbers that are too close together never give too large a velocity, and those of another run give none.
    assert!((sample(0.5e-3, 1, 20.1e-3).unwrap() - 0.15).abs() < 1e-9);
    assert_eq!(sample(0.4e-3, 2, 30e-3), None);
}
