//! The set of the states of a search, by fingerprint: most of the memory of a long one.
//!
//! A state takes the 16 bytes of its fingerprint and 5 to 7.5 of a table of numbers, in which four of five
//! places are used before it grows by half. Fingerprints lie in chunks, so that they never move, and a set
//! has no room for many more than it has.

/// Fingerprints of a chunk.
const CHUNK: usize = 1 << 12;

/// Places at first.
const PLACES: usize = 1 << 10;

/// States by number, in the order in which they came.
#[derive(Debug)]
pub(super) struct StateSet {
    /// Fingerprints, by number.
    chunks: Vec<Vec<u128>>,
    count: usize,
    /// Numbers of states, one more than they are; 0 for none. A fingerprint has its place here, or behind.
    places: Vec<u32>,
}

impl Default for StateSet {
    fn default() -> StateSet {
        StateSet { chunks: Vec::new(), count: 0, places: vec![0; PLACES] }
    }
}

impl StateSet {
    /// Returns the number of states.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Returns the bytes that the set takes.
    pub(super) fn bytes(&self) -> usize {
        self.chunks.len() * CHUNK * size_of::<u128>() + self.places.len() * size_of::<u32>()
    }

    /// Returns whether a state is known.
    pub(super) fn contains(&self, fingerprint: u128) -> bool {
        self.places[self.place(fingerprint)] != 0
    }

    /// Returns the number of a state, and whether it is new.
    pub(super) fn insert(&mut self, fingerprint: u128) -> (u32, bool) {
        let place = self.place(fingerprint);
        if let Some(number) = self.places[place].checked_sub(1) {
            return (number, false);
        }
        let number = self.count as u32;
        match self.chunks.last_mut().filter(|chunk| chunk.len() < CHUNK) {
            Some(chunk) => chunk.push(fingerprint),
            None => {
                let mut chunk = Vec::with_capacity(CHUNK);
                chunk.push(fingerprint);
                self.chunks.push(chunk);
            }
        }
        self.count += 1;
        self.places[place] = number + 1;
        if self.count > self.places.len() / 5 * 4 {
            self.grow();
        }
        (number, true)
    }

    fn fingerprint(&self, number: u32) -> u128 {
        self.chunks[number as usize / CHUNK][number as usize % CHUNK]
    }

    /// Returns the place of a fingerprint, or the free one where it belongs.
    fn place(&self, fingerprint: u128) -> usize {
        let count = self.places.len();
        let mut place = ((fingerprint as u64 as u128 * count as u128) >> 64) as usize;
        while self.places[place].checked_sub(1).is_some_and(|number| self.fingerprint(number) != fingerprint)
        {
            place += 1;
            if place == count {
                place = 0;
            }
        }
        place
    }

    #[cold]
    fn grow(&mut self) {
        self.places = vec![0; self.places.len() + self.places.len() / 2];
        for number in 0..self.count as u32 {
            let place = self.place(self.fingerprint(number));
            self.places[place] = number + 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::digest::Digest;
    use super::*;

    #[test]
    fn a_state_takes_few_bytes_and_keeps_its_number() {
        let mut set = StateSet::default();
        let fingerprint = |number: u64| {
            let mut digest = Digest::default();
            digest.add(number);
            digest.bits()
        };
        let mut most = 0;
        for number in 0..100_000 {
            assert!(!set.contains(fingerprint(number)));
            assert_eq!(set.insert(fingerprint(number)), (number as u32, true));
            if number > 50_000 {
                most = most.max(set.bytes() / set.len());
            }
        }
        for number in 0..100_000 {
            assert_eq!(set.insert(fingerprint(number)), (number as u32, false));
        }
        assert_eq!(set.len(), 100_000);
        assert!(most <= 24, "{most} bytes a state");
    }
}
