//! Texts of questions, for messages.

use esl_bytecode::datum::Datum;

use crate::{HostCall, Output};

/// Returns the text of a call of the host.
pub(super) fn asked_call(call: HostCall<'_>) -> String {
    format!("for a call of the host: {}", call_text(call.name, call.arguments))
}

/// Returns the beginning of the text of a call.
pub(super) fn call_text(name: &str, arguments: &[Datum]) -> String {
    let arguments: String = arguments.iter().map(|argument| format!(" {argument}")).collect();
    format!("({name}{})", quoted(arguments.as_bytes()).trim_matches('"'))
}

/// Returns the beginning of a text in quotes.
pub(super) fn quoted(bytes: &[u8]) -> String {
    const SHOWN: usize = 40;
    let text = String::from_utf8_lossy(bytes);
    let more = if text.chars().nth(SHOWN).is_some() { "…" } else { "" };
    format!("{:?}", format!("{}{more}", text.chars().take(SHOWN).collect::<String>()))
}

pub(super) fn stream(output: Output) -> &'static str {
    match output {
        Output::Standard => "standard output",
        Output::Error => "standard error",
    }
}
