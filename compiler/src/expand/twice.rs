//! Definitions that stand twice in one file: the second takes the place of the first, or changes nothing.

use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::ESL_PACKAGE;

use super::expander::Expander;
use super::form::{Form, is_known, name, on_one_line, operator};
use crate::diagnostic::code;

/// Most characters of a rule by which it is compared with others.
const COMPARED: usize = 2000;

/// Returns what a top-level form defines, as a word and a text that is the same for the same definition.
fn defined(form: &Form, datum: &Datum) -> Option<(&'static str, String)> {
    if !form.operator.is_in(ESL_PACKAGE) {
        return None;
    }
    let named = form.args.first()?;
    let symbol = || named.as_symbol().map(name);
    let head = || operator(named).map(name);
    match form.operator.name() {
        "DEFINE-CAUSE" => Some(("cause", symbol()?)),
        "DEFINE-PROPERTY" => Some(("property", symbol()?)),
        "TO-ACHIEVE" => Some(("goal", head()?)),
        // Several rules derive facts of one name; one that is written twice derives nothing more.
        "DEFINE-RULE" => {
            let text = on_one_line(datum, COMPARED);
            (text.chars().count() < COMPARED).then_some(("rule", text))
        }
        _ => None,
    }
}

impl Expander {
    /// Warns of a top-level form that defines what another one of the file defines.
    pub(super) fn check_twice(&mut self, form: &Form, datum: &Datum) {
        if !is_known(datum.span()) {
            return;
        }
        let Some((what, text)) = defined(form, datum) else { return };
        let span = datum.span();
        let key = (span.source, what, text);
        let Some(&first) = self.globals.definitions.get(&key) else {
            self.globals.definitions.insert(key, span);
            return;
        };
        let (_, _, text) = key;
        let message = match what {
            "rule" => "this rule stands twice in the file".to_string(),
            _ => format!(
                "the {what} {text} is defined twice in the file, and this definition replaces the first"
            ),
        };
        let warning = code::DUPLICATE_DEFINITION.at(span, message).also(first, "the first is here");
        self.report(warning.help("leave one of them out"), None);
    }
}
