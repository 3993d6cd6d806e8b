//! Digests: hashes of sequences of words, long enough to tell states apart.

use esl_bytecode::symbol::Symbol;

/// Two hashes of 64 bits of a sequence of words, mixed apart from each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Digest(pub(super) u64, pub(super) u64);

impl Digest {
    #[inline(always)]
    pub(super) fn add(&mut self, word: u64) {
        // Each line is a bijection of the hash for a given word, and of the word for a given hash.
        self.0 = (self.0 ^ word).wrapping_mul(0xD6E8_FEB8_6659_FD93);
        self.0 ^= self.0 >> 32;
        self.1 = (self.1.rotate_left(27) ^ word.rotate_left(32)).wrapping_mul(0x9FB2_1C65_1E98_DF25);
        self.1 ^= self.1 >> 29;
    }

    pub(super) fn add_all(&mut self, words: impl ExactSizeIterator<Item = u64>) {
        self.add(words.len() as u64);
        words.for_each(|word| self.add(word));
    }

    pub(super) fn add_text(&mut self, text: &str) {
        self.add_all(text.bytes().map(u64::from));
    }

    /// Adds numbers of 32 bits, two at a time: those at different places apart from each other first, which a
    /// processor can do at once.
    pub(super) fn add_numbers(&mut self, numbers: &[u32]) {
        let pair = |low: u32, high: u32| u64::from(high) << 32 | u64::from(low);
        let [mut first, mut second, mut third] = [Digest(3, 5), Digest(7, 11), Digest(13, 17)];
        self.add(numbers.len() as u64);
        let mut rest = numbers;
        while let [a, b, c, d, e, f, after @ ..] = rest {
            first.add(pair(*a, *b));
            second.add(pair(*c, *d));
            third.add(pair(*e, *f));
            rest = after;
        }
        // The number of them says what follows.
        if rest.len() < numbers.len() {
            [first, second, third].into_iter().for_each(|Digest(one, other)| {
                self.add(one);
                self.add(other);
            });
        }
        while let [low, high, after @ ..] = rest {
            self.add(pair(*low, *high));
            rest = after;
        }
        rest.iter().for_each(|&last| self.add(u64::from(last)));
    }

    /// Adds bytes, eight at a time.
    pub(super) fn add_bytes(&mut self, bytes: &[u8]) {
        self.add(bytes.len() as u64);
        let mut rest = bytes;
        while let Some((word, after)) = rest.split_first_chunk() {
            self.add(u64::from_le_bytes(*word));
            rest = after;
        }
        rest.iter().for_each(|&last| self.add(u64::from(last)));
    }

    /// Returns what tells a symbol of a package from others.
    pub(super) fn of_symbol(symbol: &Symbol) -> Digest {
        let mut digest = Digest(2, 1);
        digest.add_text(symbol.package().map_or("", |package| package));
        digest.add_text(symbol.name());
        digest
    }

    pub(super) fn bits(self) -> u128 {
        u128::from(self.0) << 64 | u128::from(self.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_words_are_told_apart_by_each_of_them_and_their_number() {
        let digest = |numbers: &[u32]| {
            let mut digest = Digest::default();
            digest.add_numbers(numbers);
            digest.bits()
        };
        let mut found = std::collections::HashSet::new();
        for len in 0..40 {
            let mut numbers = vec![0; len];
            assert!(found.insert(digest(&numbers)), "{len} of them");
            for at in 0..len {
                numbers[at] = 1;
                assert!(found.insert(digest(&numbers)), "{at} of {len}");
                numbers[at] = 0;
            }
        }
        let bytes = |bytes: &[u8]| {
            let mut digest = Digest::default();
            digest.add_bytes(bytes);
            digest.bits()
        };
        assert_ne!(
            bytes(b"a longer text, of more than one word"),
            bytes(b"a longer text, of more than one worm")
        );
        assert_ne!(bytes(b"text"), bytes(b"text\0"));
    }
}
