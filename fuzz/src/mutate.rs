//! Inputs from inputs: a few edits, the same every time for the same number.

/// Numbers that look random and never change (xorshift, Marsaglia 2003), and edits made by them.
pub struct Mutator {
    state: u64,
    words: Vec<Vec<u8>>,
}

impl Mutator {
    /// Edits with these words.
    pub fn new(words: Vec<Vec<u8>>) -> Mutator {
        Mutator { state: 0x9e37_79b9_7f4a_7c15, words }
    }

    fn next(&mut self) -> u64 {
        self.state ^= self.state << 13;
        self.state ^= self.state >> 7;
        self.state ^= self.state << 17;
        self.state
    }

    /// Below `n`; 0 when `n` is.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() >> 16) as usize % n.max(1)
    }

    /// One to eight edits of `input`, at most `longest` bytes; parts of `other` may get into it.
    pub fn mutated(&mut self, input: &[u8], other: &[u8], longest: usize) -> Vec<u8> {
        let mut bytes = input.to_vec();
        for _ in 0..=self.below(8) {
            self.edit(&mut bytes, other);
        }
        bytes.truncate(longest);
        bytes
    }

    fn edit(&mut self, bytes: &mut Vec<u8>, other: &[u8]) {
        let at = self.below(bytes.len() + 1);
        let end = (at + 1 + self.below(16)).min(bytes.len()).max(at);
        match self.below(9) {
            0 if at < bytes.len() => bytes[at] ^= 1 << self.below(8),
            1 if at < bytes.len() => bytes[at] = self.next() as u8,
            2 => drop(bytes.drain(at..end)),
            3 | 4 => {
                let word = self.below(self.words.len());
                let word = self.words.get(word).cloned().unwrap_or_default();
                // In place of the bytes there, or before them.
                let end = if self.below(2) == 0 { at } else { end };
                bytes.splice(at..end, word);
            }
            5 => {
                let from = self.below(other.len() + 1);
                let part = &other[from..(from + 1 + self.below(200)).min(other.len()).max(from)];
                bytes.splice(at..at, part.iter().copied());
            }
            6 => {
                let times = 1 << self.below(12);
                let part: Vec<u8> = bytes[at..end].repeat(times);
                bytes.splice(at..at, part);
            }
            7 => {
                let line = |bytes: &[u8], at: usize| bytes[..at].iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
                let (from, to) = (line(bytes, at), self.below(bytes.len() + 1));
                let until = bytes[at..].iter().position(|&b| b == b'\n').map_or(bytes.len(), |i| at + i + 1);
                let moved = bytes[from..until].to_vec();
                let to = line(bytes, to);
                bytes.splice(to..to, moved);
            }
            _ => {
                let digits: Vec<usize> = (0..bytes.len()).filter(|&i| bytes[i].is_ascii_digit()).collect();
                if let Some(&at) = digits.get(self.below(digits.len())) {
                    let numbers: [&[u8]; 6] = [b"0", b"-1", b"1e308", b"1e-320", b"4294967296", b"0.1"];
                    let number = self.below(numbers.len());
                    bytes.splice(at..=at, numbers[number].iter().copied());
                }
            }
        }
    }
}
