//! The last frame that the drive executed, by sequence numbers in one of its registers.

/// Numbers range from 1 to this one, all exact in a float; 0 is left by a command without a number.
const LARGEST: u32 = (1 << 24) - 1;

/// The last number sent, and the newest one that the drive has confirmed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Numbers {
    last: u32,
    known: u32,
    /// Whether the previous number in the register is known, so that the next answer can be checked.
    is_checked: bool,
}

/// The meaning of an answer for the previous frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// The answer is new.
    pub is_new: bool,
    /// In between the drive executed a frame of another host, or a frame of this host twice.
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

    /// Registers a frame without a number: the register's value is unknown until the next answer to a later frame.
    pub fn forget(&mut self) {
        (self.known, self.is_checked) = (self.last, false);
    }

    /// Evaluates an answer: the register's value before its frame, and that frame's own number.
    pub fn take(&mut self, before: f32, own: f32) -> Taken {
        let old = Taken { is_new: false, is_foreign: false };
        let Some(own) = whole(own).filter(|own| self.age(*own) < self.age(self.known)) else { return old };
        // Frames may be lost, but neither doubled nor reordered.
        let ages = self.age(own)..=self.age(self.known);
        let is_mine = whole(before).is_some_and(|before| ages.contains(&self.age(before)));
        let is_foreign = self.is_checked && !is_mine;
        (self.known, self.is_checked) = (own, true);
        Taken { is_new: true, is_foreign }
    }

    /// The number of later frames.
    fn age(self, number: u32) -> u32 {
        (self.last + LARGEST - number) % LARGEST
    }
}

fn whole(number: f32) -> Option<u32> {
    ((1.0..=LARGEST as f32).contains(&number) && number.fract() == 0.0).then_some(number as u32)
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;

    /// A drive's register after a frame.
    fn reach(register: &mut f32, number: u32) -> (f32, f32) {
        let before = std::mem::replace(register, number as f32);
        (before, number as f32)
    }

    proptest! {
        /// Losses of frames and answers are not mistaken for another host; another host, and a doubled frame of this one, are detected with
        /// the next answer.
        #[test]
        fn other_hosts_are_detected_and_losses_are_not_mistaken_for_them(
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
                        prop_assert!(!numbers.take(before, own).is_new, "a doubled answer");
                    }
                }
            }
            // After an answer another host sends a frame, or an older frame is repeated.
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
