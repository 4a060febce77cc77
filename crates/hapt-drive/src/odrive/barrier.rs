//! Separation of answers from earlier ones, for a protocol without sequence numbers.

use super::codec::Command;

/// Requests of other kinds than the position. They have a lower priority on the bus, so that none overtakes a position.
pub(super) const KINDS: [Command; 5] =
    [Command::Current, Command::Warmth, Command::Bus, Command::Torques, Command::Powers];
/// After this many samples without an answer a request counts as lost, and its kind may be used again. A drive without an answer for
/// half as many samples is gone.
const LOST: u32 = 10;

/// A request of another kind directly before the one for the position: a drive answers in order, so that every position before the
/// barrier's answer is stale, and every one after it is new. A kind with an open request is not used again, so that its answers are
/// unambiguous.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Barrier {
    /// For each of [`KINDS`]: whether it is answered, and never sent cyclically.
    serves: [bool; KINDS.len()],
    /// For each: the sample of its open request.
    requested: [Option<u32>; KINDS.len()],
    /// The last kind used.
    last: usize,
    sample: u32,
}

impl Barrier {
    /// A barrier of the usable kinds.
    pub fn new(serves: [bool; KINDS.len()]) -> Self {
        Barrier { serves, ..Barrier::default() }
    }

    /// The next sample.
    pub fn pass(&mut self) {
        self.sample = self.sample.wrapping_add(1);
    }

    /// The kind for this sample; `None`: every kind has an open request.
    pub fn ask(&mut self) -> Option<Command> {
        let kind = (1..=KINDS.len()).map(|next| (self.last + next) % KINDS.len()).find(|kind| self.may(*kind))?;
        (self.last, self.requested[kind]) = (kind, Some(self.sample));
        Some(KINDS[kind])
    }

    /// Uses this kind in this sample; `false`: it is not usable, or has an open request.
    pub fn ask_for(&mut self, kind: Command) -> bool {
        let Some(kind) = KINDS.iter().position(|one| *one == kind).filter(|kind| self.may(*kind)) else { return false };
        self.requested[kind] = Some(self.sample);
        true
    }

    /// Whether this kind is answered, and never sent cyclically.
    pub fn serves(&self, kind: Command) -> bool {
        KINDS.iter().position(|one| *one == kind).is_some_and(|kind| self.serves[kind])
    }

    fn may(&self, kind: usize) -> bool {
        let waits = self.requested[kind].is_some_and(|requested| self.sample.wrapping_sub(requested) < LOST);
        self.serves[kind] && !waits
    }

    /// Registers an answer; `true`: it answers this sample's request.
    pub fn is_passed_by(&mut self, answer: Command) -> bool {
        let Some(kind) = KINDS.iter().position(|kind| *kind == answer) else { return false };
        let requested = self.requested[kind].take();
        // A kind that arrives unrequested is sent cyclically.
        self.serves[kind] &= requested.is_some();
        requested == Some(self.sample)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use hapt_testing::prelude::*;

    use super::*;

    const ALL: [bool; KINDS.len()] = [true; KINDS.len()];

    proptest! {
        /// With any delay and any losses, only the answer of this sample passes.
        #[test]
        fn only_the_answer_to_this_samples_request_passes(late in 0_usize..8, lost in proptest::collection::vec(0_u8..4, 200)) {
            let mut barrier = Barrier::new(ALL);
            let mut under_way: VecDeque<Option<(usize, Command)>> = VecDeque::from(vec![None; late]);
            for (sample, lost) in lost.iter().enumerate() {
                barrier.pass();
                let requested = barrier.ask();
                under_way.push_back(requested.filter(|_| *lost > 0).map(|kind| (sample, kind)));
                if let Some(Some((of, kind))) = under_way.pop_front() {
                    prop_assert_eq!(barrier.is_passed_by(kind), of == sample);
                }
            }
        }
    }

    #[test]
    fn a_kind_that_is_sent_cyclically_is_no_barrier() {
        let mut barrier = Barrier::new(ALL);
        barrier.pass();
        assert!(!barrier.is_passed_by(Command::Bus));
        for _ in 0..20 {
            barrier.pass();
            let requested = barrier.ask().unwrap();
            assert_ne!(requested, Command::Bus);
            assert!(barrier.is_passed_by(requested));
        }
    }

    #[test]
    fn an_unanswered_request_is_repeated_after_its_timeout() {
        let mut barrier = Barrier::new(ALL);
        let requested = (0..LOST + 1).filter(|_| {
            barrier.pass();
            barrier.ask().is_some()
        });
        assert_eq!(requested.count(), KINDS.len() + 1);
        assert_eq!(Barrier::new([false; KINDS.len()]).ask(), None);
    }
}
