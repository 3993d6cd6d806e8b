//! Canaries: hashes of the course of a run, by which two runs that should be the same are compared.
//!
//! A canary is mixed from what the machine has done so far, not from its state, so that it costs a few
//! instructions a turn. Two runs of one program by different courses have different canaries, but for chance.

use esl_heap::list_state;

/// Hash of a sequence of words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Canary(u64);

esl_heap::stored! { Canary { 0 } }
list_state! { Canary { 0: Run } }

impl Canary {
    /// Mixes in a word.
    #[inline(always)]
    pub fn mix(&mut self, word: u64) {
        // Each line is a bijection of the hash for a given word, and of the word for a given hash.
        self.0 = (self.0 ^ word).wrapping_mul(0xD6E8_FEB8_6659_FD93);
        self.0 ^= self.0 >> 32;
    }

    /// Mixes in bytes and their number.
    pub(crate) fn mix_bytes(&mut self, bytes: &[u8]) {
        self.mix(bytes.len() as u64);
        let (words, rest) = bytes.as_chunks::<8>();
        words.iter().for_each(|word| self.mix(u64::from_le_bytes(*word)));
        if !rest.is_empty() {
            let mut word = [0; 8];
            word[..rest.len()].copy_from_slice(rest);
            self.mix(u64::from_le_bytes(word));
        }
    }

    /// Returns the hash.
    #[inline]
    pub const fn value(self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(mix: impl Fn(&mut Canary)) -> u64 {
        let mut canary = Canary::default();
        mix(&mut canary);
        canary.value()
    }

    #[test]
    fn order_number_and_ends_of_parts_count() {
        let sequences: [&dyn Fn(&mut Canary); 6] = [
            &|canary| canary.mix(1),
            &|canary| [1, 2].into_iter().for_each(|word| canary.mix(word)),
            &|canary| [2, 1].into_iter().for_each(|word| canary.mix(word)),
            &|canary| canary.mix_bytes(b"ab"),
            &|canary| canary.mix_bytes(b"ab\0"),
            &|canary| [&b"a"[..], b"b"].into_iter().for_each(|bytes| canary.mix_bytes(bytes)),
        ];
        let mut found: Vec<u64> = sequences.iter().map(|mix| of(mix)).collect();
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), 6);
    }
}
