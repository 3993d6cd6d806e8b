//! Greatest common divisors.
//!
//! Up to 128 bits, Euclid's algorithm and then the binary one. Above, Lehmer's: the leading bits of both
//! numbers determine many quotients at once, which are then applied to the whole numbers in one pass.
//!
//! Source: Knuth, volume 2, 4.5.2, algorithm L, with Collins' condition in the form that CPython uses.

use num_bigint::BigUint;

use super::Int;

/// Returns the greatest common divisor, which is not negative.
pub fn gcd(a: &Int, b: &Int) -> Int {
    reduced(a, b, usize::MAX).0
}

/// Returns two smaller numbers with the same greatest common divisor as `a` and `b`, after at most `steps`
/// steps. When the second is zero, the first is the divisor. Neither is negative.
pub fn reduced(a: &Int, b: &Int, steps: usize) -> (Int, Int) {
    if let (Int::Small(a), Int::Small(b)) = (a, b) {
        return (Int::from_unsigned(small_gcd(a.unsigned_abs(), b.unsigned_abs())), Int::ZERO);
    }
    let (mut a, mut b) = (magnitude(a), magnitude(b));
    for _ in 0..steps {
        if is_less(&a, &b) {
            std::mem::swap(&mut a, &mut b);
        }
        if a.len() <= 2 {
            return (Int::from_unsigned(small_gcd(unsigned(&a), unsigned(&b))), Int::ZERO);
        }
        if b.is_empty() {
            break;
        }
        // The leading bits of numbers of different length determine little.
        let matrix = if b.len() == a.len() { cofactors(&a, &b) } else { None };
        (a, b) = match matrix {
            Some(matrix) => {
                (combination(&a, matrix.p, &b, matrix.q), combination(&a, matrix.r, &b, matrix.s))
            }
            None => {
                let remainder = to_big(&a) % to_big(&b);
                (b, remainder.iter_u64_digits().collect())
            }
        };
    }
    (Int::from_limbs(&a), Int::from_limbs(&b))
}

/// Returns how many steps of reduction of numbers of `limbs` limbs stay within the limit of work of one call.
pub fn steps_within_limit(limbs: usize) -> usize {
    (super::limit::WORK_LIMIT / (8 * limbs)).max(1)
}

fn magnitude(n: &Int) -> Vec<u64> {
    let mut limbs = n.limbs().1.into_vec();
    trim(&mut limbs);
    limbs
}

fn trim(limbs: &mut Vec<u64>) {
    let significant = limbs.iter().rposition(|&limb| limb != 0).map_or(0, |last| last + 1);
    limbs.truncate(significant);
}

fn to_big(limbs: &[u64]) -> BigUint {
    BigUint::new(limbs.iter().flat_map(|&limb| [limb as u32, (limb >> 32) as u32]).collect())
}

fn unsigned(limbs: &[u64]) -> u128 {
    limbs.iter().rev().fold(0, |n, &limb| n << 64 | u128::from(limb))
}

fn is_less(a: &[u64], b: &[u64]) -> bool {
    a.len() < b.len() || a.len() == b.len() && a.iter().rev().lt(b.iter().rev())
}

fn small_gcd(mut a: u128, mut b: u128) -> u128 {
    while b != 0 && (a >> 64 != 0 || b >> 64 != 0) {
        (a, b) = (b, a % b);
    }
    if a == 0 || b == 0 {
        return a | b;
    }
    let (mut a, mut b) = (a as u64, b as u64);
    let shift = (a | b).trailing_zeros();
    a >>= a.trailing_zeros();
    while b != 0 {
        b >>= b.trailing_zeros();
        if a > b {
            std::mem::swap(&mut a, &mut b);
        }
        b -= a;
    }
    u128::from(a << shift)
}

/// The effect of several steps of Euclid's algorithm on a pair: `(p·a + q·b, r·a + s·b)`.
struct Matrix {
    p: i64,
    q: i64,
    r: i64,
    s: i64,
}

/// Returns the steps that the leading bits of `a` and `b`, of the same length, determine for certain; `None`
/// if there is no such step.
fn cofactors(a: &[u64], b: &[u64]) -> Option<Matrix> {
    let last = a.len() - 1;
    let shift = a[last].leading_zeros();
    // With 62 bits, the steps below stay within a signed word.
    let leading = |n: &[u64]| ((u128::from(n[last]) << 64 | u128::from(n[last - 1])) << shift >> 66) as i64;
    let (mut x, mut y) = (leading(a), leading(b));
    let (mut p, mut q, mut r, mut s) = (1i64, 0i64, 0i64, 1i64);
    loop {
        // The true quotient lies between these two; while they agree, it is known.
        if y + r <= 0 || y + s <= 0 {
            break;
        }
        let quotient = (x + p) / (y + r);
        if quotient != (x + q) / (y + s) {
            break;
        }
        (p, r) = (r, p - quotient * r);
        (q, s) = (s, q - quotient * s);
        (x, y) = (y, x - quotient * y);
        // Cofactors have at most half the bits of a word, so that the products below do not overflow.
        if r.abs().max(s.abs()) >> 31 != 0 {
            break;
        }
    }
    (q != 0).then_some(Matrix { p, q, r, s })
}

/// Returns `p·a + q·b`, which is not negative.
fn combination(a: &[u64], p: i64, b: &[u64], q: i64) -> Vec<u64> {
    let mut carry = 0i128;
    let mut sum: Vec<u64> = a
        .iter()
        .zip(b)
        .map(|(&x, &y)| {
            carry += i128::from(x) * i128::from(p) + i128::from(y) * i128::from(q);
            let limb = carry as u64;
            carry >>= 64;
            limb
        })
        .collect();
    debug_assert_eq!(carry, 0, "the steps were certain");
    trim(&mut sum);
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_bigint::BigInt;
    use num_integer::Integer;
    use proptest::prelude::*;

    fn big(words: &[u32]) -> BigUint {
        BigUint::new(words.to_vec())
    }

    proptest! {
        #[test]
        fn agrees_with_the_binary_algorithm(
            a in prop::collection::vec(any::<u32>(), 0..40),
            b in prop::collection::vec(any::<u32>(), 0..40),
            common in prop::collection::vec(any::<u32>(), 0..20),
        ) {
            let (a, b) = (big(&a) * big(&common), big(&b) * big(&common));
            let expected = BigInt::from(a.gcd(&b));
            let found = gcd(&Int::from_big(BigInt::from(a)), &Int::from_big(BigInt::from(b)));
            prop_assert_eq!(found.to_big(), expected);
        }
    }

    #[test]
    fn neighbours_of_a_fibonacci_chain_are_prime_to_each_other() {
        let (mut a, mut b) = (Int::ONE, Int::ONE);
        for _ in 0..5000 {
            let sum = a.plus(&b);
            (a, b) = (b, sum);
        }
        assert_eq!(gcd(&a, &b), Int::ONE);
        assert_eq!(gcd(&a.times(&b), &b.times(&b)), b);
    }
}
