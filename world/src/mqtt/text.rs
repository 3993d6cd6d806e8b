//! Topics, filters and other texts of the protocol, checked before anything is sent.
//!
//! Guarantees: a text that passes has the form that the protocol asks for, and a length that its packet can
//! express.
//! Source: MQTT 3.1.1, sections 1.5.3 and 4.7.

use esl_host::HostFailure;

use super::mqtt_failure;

/// Most bytes of a text in a packet.
pub(super) const MOST_TEXT: usize = 65_535;

/// Marks filters of subscriptions that several clients share; the name of the group follows.
const SHARED: &str = "$share/";

/// Checks a text, which the failure calls `name`.
///
/// # Errors
/// `:mqtt-error`, if the text holds U+0000 or has more than [`MOST_TEXT`] bytes.
pub(super) fn check_text(name: &str, text: &str) -> Result<(), HostFailure> {
    check_length(name, text.len())?;
    if text.contains('\0') {
        Err(mqtt_failure(format!("the {name} holds the character U+0000")))
    } else {
        Ok(())
    }
}

/// Checks the length in bytes of a part of a packet.
///
/// # Errors
/// `:mqtt-error`, if it is more than [`MOST_TEXT`].
pub(super) fn check_length(name: &str, bytes: usize) -> Result<(), HostFailure> {
    if bytes <= MOST_TEXT {
        return Ok(());
    }
    Err(mqtt_failure(format!("the {name} has {bytes} bytes: at most {MOST_TEXT} fit in a packet")))
}

/// Checks a topic to publish under.
///
/// # Errors
/// `:mqtt-error`, if it is empty, holds a wildcard, or is not a text of the protocol.
pub(super) fn check_topic(topic: &str) -> Result<(), HostFailure> {
    if topic.is_empty() {
        return Err(mqtt_failure("the topic is empty"));
    }
    check_text("topic", topic)?;
    match topic.chars().find(|character| matches!(character, '+' | '#')) {
        None => Ok(()),
        Some(found) => {
            Err(mqtt_failure(format!("`{topic}` is not a topic: `{found}` is allowed in filters only")))
        }
    }
}

/// Checks a filter of topics.
///
/// # Errors
/// `:mqtt-error`, if it is empty, a wildcard is not a whole level, `#` is not the last level, the group of a
/// shared subscription has no name, or it is not a text of the protocol.
pub(super) fn check_filter(filter: &str) -> Result<(), HostFailure> {
    if filter.is_empty() {
        return Err(mqtt_failure("the topic filter is empty"));
    }
    check_text("topic filter", filter)?;
    let invalid =
        |reason: &str| Err(mqtt_failure(format!("`{filter}` is not a valid topic filter: {reason}")));
    let levels = match filter.strip_prefix(SHARED).map(|rest| rest.split_once('/')) {
        None => filter,
        Some(Some((group, rest))) if !group.is_empty() && !group.contains(['+', '#']) && !rest.is_empty() => {
            rest
        }
        Some(_) => return invalid("expected `$share/GROUP/FILTER`"),
    };
    if levels.split('/').any(|level| level.len() > 1 && level.contains(['+', '#'])) {
        return invalid("`+` and `#` stand for whole levels");
    }
    if levels.find('#').is_some_and(|at| at + 1 < levels.len()) {
        return invalid("`#` is the last level");
    }
    Ok(())
}

/// Returns whether a valid filter stands for a topic: `+` for one level, `#` for all that follow, none of the
/// two for a first level that begins with `$`.
pub(super) fn matches(filter: &str, topic: &str) -> bool {
    let shared = filter.strip_prefix(SHARED).and_then(|rest| rest.split_once('/'));
    let levels = shared.map_or(filter, |(_, levels)| levels);
    if topic.starts_with('$') && levels.starts_with(['+', '#']) {
        return false;
    }
    let (mut wanted, mut found) = (levels.split('/'), topic.split('/'));
    loop {
        match (wanted.next(), found.next()) {
            (Some("#"), _) | (None, None) => return true,
            (Some("+"), Some(_)) => {}
            (Some(wanted), Some(found)) if wanted == found => {}
            _ => return false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_stand_for_topics() {
        for (filter, topics) in [
            ("a/b", &["a/b"][..]),
            ("+", &["a", "", "ä", "€"]),
            ("+/+", &["a/b", "/b", "a/", "/"]),
            ("/+", &["/b", "/"]),
            ("#", &["a", "a/b", "/", "ä/b"]),
            ("a/#", &["a", "a/", "a/b", "a/b/c"]),
            ("a/+/c", &["a/b/c", "a//c", "a/€/c"]),
            ("$SYS/#", &["$SYS", "$SYS/a"]),
            ("$SYS/+", &["$SYS/a"]),
            ("$share/g/#", &["a", "a/b", "g"]),
            ("$share/g/a/+", &["a/b"]),
            ("$share/g//a", &["/a"]),
            ("$share/g/$SYS/#", &["$SYS/a"]),
            ("$sharea/+", &["$sharea/b"]),
        ] {
            for topic in topics {
                assert!(matches(filter, topic), "{filter} {topic}");
            }
        }
        for (filter, topics) in [
            ("a/b", &["a", "a/b/", "a/b/c", "A/b"][..]),
            ("+", &["a/b", "/a", "$SYS"]),
            ("+/a", &["$SYS/a", "a", "a/a/a"]),
            ("#", &["$SYS", "$SYS/a", "$a"]),
            ("a/#", &["b", "ab", "ab/c"]),
            ("a/+", &["a", "a/b/c"]),
            ("$share/g/#", &["$SYS/a"]),
            ("$share/g/a", &["g/a", "$share/g/a"]),
        ] {
            for topic in topics {
                assert!(!matches(filter, topic), "{filter} {topic}");
            }
        }
    }

    fn reason(result: Result<(), HostFailure>) -> Option<String> {
        result.err().map(|failure| failure.arguments[0].to_string())
    }

    #[test]
    fn topics_have_no_wildcards_and_fit_in_a_packet() {
        let longest = "ä".repeat(MOST_TEXT / 2);
        for topic in ["a", "/", "a//b", " ", "$SYS/a", "\u{1}", &longest, &format!("{longest}a")] {
            assert_eq!(reason(check_topic(topic)), None, "{topic:.20}");
        }
        let too_long = format!("{longest}ä");
        for (topic, expected) in [
            ("", "is empty"),
            ("a/+", "`+` is allowed in filters only"),
            ("#", "`#` is allowed"),
            ("a#b", "`#` is allowed"),
            ("a\0b", "U+0000"),
            (&too_long, "has 65536 bytes: at most 65535"),
        ] {
            let found = reason(check_topic(topic)).unwrap_or_default();
            assert!(found.contains(expected), "{topic:.20}: {found}");
        }
    }

    #[test]
    fn wildcards_in_filters_are_whole_levels() {
        for filter in [
            "#",
            "+",
            "a",
            "/",
            "/#",
            "+/+",
            "a/+/b/#",
            "$SYS/#",
            "$share/g/#",
            "$share/g/a/+",
            "$sharea",
            "$a/b",
        ] {
            assert_eq!(reason(check_filter(filter)), None, "{filter}");
        }
        let too_long = "a".repeat(MOST_TEXT + 1);
        for (filter, expected) in [
            ("", "is empty"),
            ("a#", "whole levels"),
            ("a/b+", "whole levels"),
            ("++", "whole levels"),
            ("##", "whole levels"),
            ("#/a", "the last level"),
            ("a/#/b", "the last level"),
            ("a\0", "U+0000"),
            ("$share/g", "$share/GROUP/FILTER"),
            ("$share//a", "$share/GROUP/FILTER"),
            ("$share/g/", "$share/GROUP/FILTER"),
            ("$share/+/a", "$share/GROUP/FILTER"),
            (&too_long, "has 65536 bytes"),
        ] {
            let found = reason(check_filter(filter)).unwrap_or_default();
            assert!(found.contains(expected), "{filter:.20}: {found}");
        }
    }
}
