//! Random numbers, the same in every run: xoshiro256**, seeded by a number.
//!
//! A state is a record with one slot, a vector of eight 32-bit words. The state is always an argument;
//! nothing is hidden here.
//!
//! Source: Blackman and Vigna, "Scrambled linear pseudorandom number generators", 2021; SplitMix64 spreads
//! the seed.

use esl_heap::{Kind, Value};
use num_bigint::{BigInt, BigUint};

use super::{Int, Number, NumberResult, Numbers};

/// Returns a new state.
pub fn make_state(numbers: &mut Numbers<'_>, seed: u64) -> NumberResult {
    let mut words = Vec::with_capacity(8);
    let mut at = seed;
    for _ in 0..4 {
        at = at.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = at;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        words.extend([z as u32, (z >> 32) as u32]);
    }
    state_of(numbers, &words)
}

/// Returns a copy of `state`, which produces the same numbers.
pub fn copy_state(numbers: &mut Numbers<'_>, state: Value) -> NumberResult {
    let words = words_of(numbers, state)?;
    let words = numbers.heap.words(words).unwrap_or_default().to_vec();
    state_of(numbers, &words)
}

fn state_of(numbers: &mut Numbers<'_>, words: &[u32]) -> NumberResult {
    let object = numbers.heap.alloc_words(words.len(), 0)?;
    if let Some(slots) = numbers.heap.words_mut(object) {
        slots.copy_from_slice(words);
    }
    Ok(numbers.heap.alloc_record(Kind::RandomState, 0, 0, &[object])?)
}

fn words_of(numbers: &mut Numbers<'_>, state: Value) -> NumberResult {
    match numbers.heap.record(state, Kind::RandomState) {
        Some(&[words]) => Ok(words),
        _ => numbers.type_error(state, "RANDOM-STATE"),
    }
}

/// Returns a number from 0 to below `limit`, of the type of `limit`.
pub fn random(numbers: &mut Numbers<'_>, limit: Value, state: Value) -> NumberResult {
    let object = words_of(numbers, state)?;
    let mut generator = RandomState::load(numbers, object);
    let result = match Number::of(numbers.heap, limit) {
        Some(Number::Float(x)) if x > 0.0 && x.is_finite() => loop {
            let y = (generator.next() >> 11) as f64 / (1u64 << 53) as f64 * x;
            if y < x {
                break numbers.float_value("RANDOM", y)?;
            }
        },
        Some(Number::Int(n)) if n.signum() > 0 => {
            numbers.charge(n.len());
            let drawn = generator.below(&n);
            numbers.integer_value("RANDOM", &drawn)?
        }
        _ => return numbers.type_error(limit, "REAL"),
    };
    // The state advances only once no failure is possible.
    generator.store(numbers, object);
    Ok(result)
}

struct RandomState([u64; 4]);

impl RandomState {
    fn load(numbers: &Numbers<'_>, object: Value) -> RandomState {
        let words = numbers.heap.words(object).unwrap_or_default();
        let word = |i: usize| words.get(i).copied().map_or(1, u64::from);
        RandomState([0, 1, 2, 3].map(|i| word(2 * i) | word(2 * i + 1) << 32))
    }

    fn store(&self, numbers: &mut Numbers<'_>, object: Value) {
        let words = self.0.iter().flat_map(|&s| [s as u32, (s >> 32) as u32]);
        for (slot, word) in numbers.heap.words_mut(object).unwrap_or_default().iter_mut().zip(words) {
            *slot = word;
        }
    }

    fn next(&mut self) -> u64 {
        let s = &mut self.0;
        let result = s[1].wrapping_mul(5).rotate_left(7).wrapping_mul(9);
        let t = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= t;
        s[3] = s[3].rotate_left(45);
        result
    }

    /// Returns an integer from 0 to below `limit`, uniformly distributed. `limit` is above zero.
    fn below(&mut self, limit: &Int) -> Int {
        if let Some(limit) = limit.as_fixnum() {
            let limit = limit.unsigned_abs();
            let mask = u64::MAX >> (limit | 1).leading_zeros();
            loop {
                // At least half of the draws are below the limit.
                let drawn = self.next() & mask;
                if drawn < limit {
                    return Int::from(drawn as i64);
                }
            }
        }
        let bits = limit.bits() as usize;
        loop {
            let mut words: Vec<u32> = Vec::with_capacity(bits.div_ceil(32) + 1);
            while words.len() * 32 < bits {
                let drawn = self.next();
                words.extend([drawn as u32, (drawn >> 32) as u32]);
            }
            words.truncate(bits.div_ceil(32));
            if !bits.is_multiple_of(32)
                && let Some(last) = words.last_mut()
            {
                *last &= (1 << (bits % 32)) - 1;
            }
            let drawn = Int::from_big(BigInt::from(BigUint::new(words)));
            if drawn.compare(limit).is_lt() {
                return drawn;
            }
        }
    }
}
