//! The reference of the language, as the manual has it: of each public name how it is used, and a text.
//!
//! The manual's chapter is made from a running machine, so it also knows what macros of the library define.

use super::definition::DefinedAs;

/// The chapter.
const CHAPTER: &str = include_str!("../reference.md");

/// The entry of the reference for a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ReferenceEntry {
    /// Name without its package, in lower case.
    pub(super) name: String,
    pub(super) kind: DefinedAs,
    /// Lambda list with its parentheses; `None` if it has none.
    pub(super) lambda_list: Option<String>,
    pub(super) text: String,
}

/// Returns the entries, in order.
pub(super) fn entries() -> Vec<ReferenceEntry> {
    let mut kind = DefinedAs::Other;
    let mut found = Vec::new();
    for line in CHAPTER.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            kind = match heading.split_once(": ").map_or("", |(_, kind)| kind) {
                "special operators" => DefinedAs::Operator,
                "macros" => DefinedAs::Macro,
                "functions" => DefinedAs::Function,
                "variables and constants" => DefinedAs::Variable,
                "conditions and structures" => DefinedAs::Type,
                _ => DefinedAs::Other,
            };
        } else if let Some(row) = line.strip_prefix("| `") {
            found.extend(entry(row, kind));
        }
    }
    found
}

/// Returns the entry of a row, without its beginning.
fn entry(row: &str, kind: DefinedAs) -> Option<ReferenceEntry> {
    let (usage, text) = row.split_once("` | ")?;
    let text = text.strip_suffix(" |").unwrap_or(text).replace("\\|", "|");
    let usage = usage.replace("\\|", "|");
    let call = usage.strip_prefix('(').and_then(|usage| usage.strip_suffix(')'));
    let (name, parameters) = match call {
        Some(call) => call.split_once(' ').unwrap_or((call, "")),
        None => (&*usage, ""),
    };
    let name = esl_syntax::bare_name(name);
    Some(ReferenceEntry { name, kind, lambda_list: call.map(|_| format!("({parameters})")), text })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_have_a_kind_a_usage_and_a_text() {
        let all = entries();
        let find = |name: &str| all.iter().find(|entry| entry.name == name).expect("it is in the reference");
        let mapcar = find("mapcar");
        assert_eq!(
            (mapcar.kind, mapcar.lambda_list.as_deref()),
            (DefinedAs::Function, Some("(function list &rest more-lists)"))
        );
        assert_eq!(find("if").kind, DefinedAs::Operator);
        assert_eq!(find("tagbody").text.matches("TAG | FORM").count(), 1);
        assert_eq!(
            (find("*print-case*").kind, &find("*print-case*").lambda_list),
            (DefinedAs::Variable, &None)
        );
        assert!(all.iter().all(|entry| entry.kind != DefinedAs::Other && !entry.text.is_empty()));
    }
}
