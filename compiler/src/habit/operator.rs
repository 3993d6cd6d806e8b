//! Operators between their operands, and calls with the name before the parentheses.

/// Operators that other languages write between their operands, each with ESL's name for it.
const BETWEEN: &[(&str, &str)] = &[
    ("+", "+"),
    ("-", "-"),
    ("*", "*"),
    ("/", "/"),
    ("%", "mod"),
    ("**", "expt"),
    ("//", "floor"),
    ("=", "="),
    ("==", "="),
    ("===", "equal"),
    ("!=", "/="),
    ("/=", "/="),
    ("<>", "/="),
    ("<", "<"),
    (">", ">"),
    ("<=", "<="),
    (">=", ">="),
    ("&&", "and"),
    ("", "or"),
    ("AND", "and"),
    ("OR", "or"),
    ("IS", "eql"),
    ("IN", "member"),
    ("+=", "incf"),
    ("-=", "decf"),
    (":=", "setf"),
    ("<<", "ash"),
];

/// Returns ESL's name for an operator that is read as a symbol of this name, if other languages write it
/// between its operands.
pub fn between(name: &str) -> Option<&'static str> {
    BETWEEN.iter().find(|(operator, _)| *operator == name).map(|(_, own)| *own)
}

/// Returns how ESL writes a call of `name` with `arguments`, the text between parentheses in another
/// language: `(print "hello")` for `print` and `'hello'`. Arguments that are more than names, numbers and
/// texts are left out.
pub fn call(name: &str, arguments: &str) -> String {
    let arguments = arguments.trim();
    if arguments.is_empty() {
        return format!("({name})");
    }
    let parts: Option<Vec<String>> = arguments.split(',').map(|part| plain(part.trim())).collect();
    match parts.filter(|parts| parts.len() <= 4) {
        Some(parts) => format!("({name} {})", parts.join(" ")),
        None => format!("({name} …)"),
    }
}

/// Returns a name, number or text of another language as ESL writes it; `None` for anything else.
pub fn plain(part: &str) -> Option<String> {
    let part = part.trim_end_matches(';').trim();
    for mark in ['"', '\''] {
        if let Some(text) = part.strip_prefix(mark).and_then(|rest| rest.strip_suffix(mark)) {
            return (!text.contains(['"', '\\', '\'', '`'])).then(|| format!("\"{text}\""));
        }
    }
    let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '-');
    (!part.is_empty() && part.len() <= 30 && part.chars().all(is_plain)).then(|| match part {
        "None" | "null" | "false" | "False" | "undefined" | "nullptr" => "nil".to_string(),
        "true" | "True" => "t".to_string(),
        _ => part.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_are_written_as_in_esl() {
        let table = [
            ("main", "", "(main)"),
            ("print", "\"hello\"", "(print \"hello\")"),
            ("print", "'hello', 3", "(print \"hello\" 3)"),
            ("max", "a, b", "(max a b)"),
            ("print", "f(x) + 1", "(print …)"),
            ("show", "None, true", "(show nil t)"),
        ];
        for (name, arguments, expected) in table {
            assert_eq!(call(name, arguments), expected, "{name}({arguments})");
        }
    }
}
