//! Numbers in attributes, as they are written in ESL.

/// Returns a real number as it is written in ESL.
pub(crate) fn real(text: &str) -> Option<String> {
    let value: f64 = text.parse().ok()?;
    // Words such as `inf` and `nan` are texts.
    let is_number = text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    (value.is_finite() && is_number).then(|| format!("{value:?}"))
}

/// Returns a whole number as it is written in ESL.
pub(crate) fn whole(text: &str) -> Option<String> {
    text.parse::<i64>().ok().map(|value| value.to_string())
}

/// Returns a number as it is written in ESL.
pub(crate) fn any(text: &str) -> Option<String> {
    whole(text).or_else(|| real(text))
}

/// Returns seconds for milliseconds.
pub(crate) fn seconds(milliseconds: &str) -> Option<String> {
    let value: i64 = milliseconds.parse().ok().filter(|&value| value >= 0)?;
    if value % 1000 == 0 {
        return Some((value / 1000).to_string());
    }
    Some(format!("{:?}", value as f64 / 1000.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_esl() {
        assert_eq!((any("007").as_deref(), any("-3").as_deref()), (Some("7"), Some("-3")));
        assert_eq!((any("1e3").as_deref(), any(".5").as_deref()), (Some("1000.0"), Some("0.5")));
        assert_eq!((any("1;2"), any("inf"), any("")), (None, None, None));
        assert_eq!((seconds("1500").as_deref(), seconds("2000").as_deref()), (Some("1.5"), Some("2")));
        assert_eq!(seconds("-1"), None);
    }
}
