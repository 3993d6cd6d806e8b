//! Payloads as data of the program, and back.

use esl_bytecode::Bytes;
use esl_bytecode::datum::Datum;
use esl_host::{FromArgument, HostFailure, IntoDatum};
use zenoh::bytes::{Encoding, ZBytes};

/// How payloads become data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PayloadForm {
    /// A text, if the encoding says so; otherwise bytes.
    ByEncoding,
    /// Bytes.
    Bytes,
    /// A text, in which what is not UTF-8 is replaced.
    Text,
}

impl FromArgument for PayloadForm {
    const TYPE: &'static str = "SYMBOL";

    fn from_argument(datum: &Datum) -> Result<PayloadForm, HostFailure> {
        let name = datum.as_symbol().map(|symbol| symbol.name());
        Ok(match name {
            Some("BYTES") => PayloadForm::Bytes,
            Some("TEXT") => PayloadForm::Text,
            _ => PayloadForm::ByEncoding,
        })
    }
}

/// Returns whether payloads of this encoding are texts.
fn is_text(encoding: &str) -> bool {
    let kind = encoding.split(';').next().unwrap_or(encoding);
    kind.starts_with("text/")
        || matches!(
            kind,
            "zenoh/string" | "application/json" | "application/yaml" | "application/xml" | "application/sql"
        )
        || kind.ends_with("json")
}

/// Returns a payload as data.
pub(crate) fn datum_of_payload(payload: &ZBytes, encoding: &Encoding, form: PayloadForm) -> Datum {
    let is_text = match form {
        PayloadForm::ByEncoding => is_text(&encoding.to_string()),
        PayloadForm::Bytes => false,
        PayloadForm::Text => true,
    };
    let bytes = payload.to_bytes();
    if is_text {
        String::from_utf8_lossy(&bytes).as_ref().into_datum()
    } else {
        Bytes::from(bytes.into_owned()).into_datum()
    }
}

/// Returns an attachment as data, bytes; `NIL` if there is none.
pub(crate) fn datum_of_attachment(attachment: Option<&ZBytes>) -> Datum {
    attachment.map(|attachment| Bytes::from(attachment.to_bytes().into_owned())).into_datum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_encoding_tells_texts_from_bytes() {
        let datum = |encoding: &str, form| {
            datum_of_payload(&ZBytes::from("a\u{e9}"), &Encoding::from(encoding), form).to_string()
        };
        for encoding in ["zenoh/string", "text/plain", "text/plain;utf-8", "application/json", "text/json5"] {
            assert_eq!(datum(encoding, PayloadForm::ByEncoding), "\"a\u{e9}\"", "{encoding}");
        }
        for encoding in ["zenoh/bytes", "application/cdr", "image/png", "application/octet-stream"] {
            assert!(!datum(encoding, PayloadForm::ByEncoding).contains('"'), "{encoding}");
        }
        assert!(!datum("text/plain", PayloadForm::Bytes).contains('"'));
        assert_eq!(datum("zenoh/bytes", PayloadForm::Text), "\"a\u{e9}\"");
    }
}
