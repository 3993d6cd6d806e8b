//! Suggestions for misspelt names.

/// Returns whether two names differ in one character, or in two neighbours.
pub fn is_like(left: &str, right: &str) -> bool {
    let (left, right): (Vec<char>, Vec<char>) = (left.chars().collect(), right.chars().collect());
    let (short, long) = if left.len() <= right.len() { (&left, &right) } else { (&right, &left) };
    if long.len() - short.len() > 1 || short.len() < 2 {
        return false;
    }
    let same = short.iter().zip(long.iter()).take_while(|(a, b)| a == b).count();
    let (short, long) = (&short[same..], &long[same..]);
    let has_same_end = |a: &[char], b: &[char]| a == b;
    if short.len() < long.len() {
        return has_same_end(short, &long[1..]);
    }
    let is_swapped = short.len() > 1 && short[0] == long[1] && short[1] == long[0];
    short.is_empty() || has_same_end(&short[1..], &long[1..]) || is_swapped && short[2..] == long[2..]
}

#[cfg(test)]
mod tests {
    use super::is_like;

    #[test]
    fn names_that_differ_in_a_character_or_two_neighbours_are_like() {
        for (left, right) in [("done", "doen"), ("done", "don"), ("done", "donee"), ("done", "dune")] {
            assert!(is_like(left, right) && is_like(right, left), "{left} {right}");
        }
        for (left, right) in [("done", "dxnx"), ("a", "b"), ("done", "do"), ("done", "enod")] {
            assert!(!is_like(left, right) && !is_like(right, left), "{left} {right}");
        }
    }
}
