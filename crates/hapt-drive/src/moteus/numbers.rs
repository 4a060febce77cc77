//! Which of this host's frames the drive took last, by the numbers that stand in one of its registers.

/// Numbers go from 1 up to this one, all exact in a float; 0 is what a command without a number leaves.
const LARGEST: u32 = (1 << 24) - 1;

/// The numbers that were given, and the newest of which the drive is known to have taken the frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Numbers {
    last: u32,
    known: u32,
    /// What stood in the register before `known` is checked from the next answer on.
    is_checked: bool,
}

/// What an answer says about the frames before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// It is no answer of the past.
    pub is_new: bool,
    /// The drive has taken a frame in between that is another host's, or one of this host's a second time.
    pub is_foreign: bool,
}

impl Numbers {
    /// The number of the next frame.
    pub fn next(&mut self) -> u32 {
        self.last = self.last % LARGEST + 1;
        self.last
    }

    /// The number of the last frame.
    pub fn last(self) -> u32 {
        self.last
    }

    /// A frame without a number was sent: what stands in the register is not known until the next answer to a later one.
    pub fn forget(&mut self) {
        (self.known, self.is_checked) = (self.last, false);
    }

    /// Of an answer: what stood in the register before its frame, and that frame's own number.
    pub fn take(&mut self, before: f32, own: f32) -> Taken {
        let old = Taken { is_new: false, is_foreign: false };
        let Some(own) = whole(own).filter(|own| self.age(*own) < self.age(self.known)) else { return old };
        // Frames may be lost. None comes in twice, nor before one that was sent earlier.
        let ages = self.age(own)..=self.age(self.known);
        let is_mine = whole(before).is_some_and(|before| ages.contains(&self.age(before)));
        let is_foreign = self.is_checked && !is_mine;
        (self.known, self.is_checked) = (own, true);
        Taken { is_new: true, is_foreign }
    }

    /// How many numbers were given after this one.
    fn age(self, number: u32) -> u32 {
        (self.last + LARGEST - number) % LARGEST
    }
}

fn whole(number: f32) -> Option<u32> {
    ((1.0..=LARGEST as f32).contains(&number) && number.fract() == 0.0).then_some(number as u32)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A drive's register, as frames reach it.
    fn reach(register: &mut f32, number: u32) -> (f32, f32) {
        let before = std::mem::replace(register, number as f32);
        (before, number as f32)
    }

    proptest! {
        /// However many frames and answers are lost, nobody else is suspected; and whoever else commands the drive is seen with the next
        /// answer. So is a frame of this host's that comes a second time.
        #[test]
        fn others_are_seen_and_losses_are_not_taken_for_others(
            from in prop_oneof![Just(0), Just(LARGEST - 20), 0..LARGEST],
            lost in proptest::collection::vec((any::<bool>(), any::<bool>()), 0..40),
            again in any::<bool>(),
        ) {
            let mut numbers = Numbers { last: from, ..Numbers::default() };
            let mut register = 0.0;
            numbers.forget();
            let first = numbers.next();
            let (before, own) = reach(&mut register, first);
            prop_assert_eq!(numbers.take(before, own), Taken { is_new: true, is_foreign: false });
            for (frame, answer) in lost {
                let number = numbers.next();
                if !frame {
                    let (before, own) = reach(&mut register, number);
                    if !answer {
                        prop_assert_eq!(numbers.take(before, own), Taken { is_new: true, is_foreign: false });
                        prop_assert!(!numbers.take(before, own).is_new, "an answer that comes twice");
                    }
                }
            }
            // One is answered, and then somebody else speaks, or an older frame comes again.
            let number = numbers.next();
            let (before, own) = reach(&mut register, number);
            prop_assert!(!numbers.take(before, own).is_foreign);
            register = if again { first as f32 } else { 0.0 };
            let number = numbers.next();
            let (before, own) = reach(&mut register, number);
            prop_assert_eq!(numbers.take(before, own), Taken { is_new: true, is_foreign: true });
        }
    }
}
