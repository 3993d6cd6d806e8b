//! The text of a definition, as `.msg` files have it, as data.
//!
//! Guarantees: any text is parsed or refused with its line; no value is accepted that its type does not have.
//! Not here: the types that fields name (`types`). Source: the grammar of `rosidl_adapter`. `hiroz-codegen`
//! has a parser too, which omits malformed constants, cuts texts at `#` and panics on a single quote.

use std::collections::HashSet;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use num_bigint::BigInt;
use num_traits::Num;

use super::fault::DefinitionProblem;
use super::scalar::{Scalar, boolean, float, vector};

/// The type of a field in a definition, arrays apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ElementName {
    Scalar(Scalar),
    /// `string` or `wstring`, with the greatest length.
    Text {
        is_wide: bool,
        most: Option<usize>,
    },
    /// A message, by its package and its name.
    Message {
        package: Option<String>,
        name: String,
    },
}

/// The number of elements of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldExtent {
    /// It is not an array.
    One,
    /// An array of fixed length.
    Fixed(usize),
    /// A sequence, with its greatest length.
    Sequence(Option<usize>),
}

/// A field of a definition.
#[derive(Clone, Debug)]
pub(super) struct FieldDefinition {
    pub(super) line: usize,
    pub(super) name: String,
    pub(super) element: ElementName,
    pub(super) extent: FieldExtent,
    pub(super) default: Option<Datum>,
}

/// A constant of a message type.
#[derive(Clone, Debug)]
pub struct MessageConstant {
    /// Its name in the definition.
    pub name: String,
    /// Its value.
    pub value: Datum,
}

/// The contents of a definition.
#[derive(Clone, Debug, Default)]
pub(super) struct MessageDefinition {
    pub(super) fields: Vec<FieldDefinition>,
    pub(super) constants: Vec<MessageConstant>,
}

/// A part of a definition, or its fault.
type ParsedPart<T> = Result<T, DefinitionProblem>;

impl MessageDefinition {
    /// Returns the definition that a text denotes, whose first line has the number `first` + 1; a fault comes
    /// with the number of its line.
    pub(super) fn parse(text: &str, first: usize) -> Result<MessageDefinition, (usize, DefinitionProblem)> {
        let mut definition = MessageDefinition::default();
        let mut names = HashSet::new();
        for (index, line) in text.lines().enumerate() {
            let number = first + index + 1;
            definition.add_line(line.trim(), number, &mut names).map_err(|problem| (number, problem))?;
        }
        Ok(definition)
    }

    fn add_line(&mut self, line: &str, number: usize, names: &mut HashSet<String>) -> ParsedPart<()> {
        if line.is_empty() || line.starts_with('#') {
            return Ok(());
        }
        let malformed = || DefinitionProblem::Line(shortened(line));
        let (type_text, rest) = line.split_once(char::is_whitespace).ok_or_else(malformed)?;
        let (element, extent) = parse_type(type_text)?;
        let rest = rest.trim_start();
        let end = rest.find(|c: char| c.is_whitespace() || c == '=' || c == '#').unwrap_or(rest.len());
        let (name, rest) = rest.split_at(end);
        let rest = rest.trim_start();
        if name.is_empty() {
            return Err(malformed());
        }
        if !is_name(name) {
            return Err(DefinitionProblem::FieldName(shortened(name)));
        }
        // Programs write names in one case, constants apart from fields.
        let is_constant = rest.starts_with('=');
        let seen = format!("{}{}", if is_constant { "=" } else { "" }, name.to_ascii_uppercase());
        if !names.insert(seen) {
            return Err(DefinitionProblem::Twice(name.to_owned()));
        }
        if let Some(text) = rest.strip_prefix('=') {
            let value = constant_value(&element, extent, text.trim())?;
            self.constants.push(MessageConstant { name: name.to_owned(), value });
            return Ok(());
        }
        let default = match without_comment(rest) {
            "" => None,
            text => Some(default_value(&element, extent, text)?),
        };
        self.fields.push(FieldDefinition { line: number, name: name.to_owned(), element, extent, default });
        Ok(())
    }
}

/// Returns whether a text is a name of a field, a constant, a package or a type.
pub(super) fn is_name(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_alphabetic())
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Returns a text as it is shown in a message.
fn shortened(text: &str) -> String {
    const SHOWN: usize = 60;
    if text.chars().count() <= SHOWN {
        text.to_owned()
    } else {
        text.chars().take(SHOWN).collect::<String>() + "…"
    }
}

fn parse_type(text: &str) -> ParsedPart<(ElementName, FieldExtent)> {
    let wrong = || DefinitionProblem::Type(shortened(text));
    let number = |digits: &str| match digits.bytes().all(|b| b.is_ascii_digit()) {
        true => digits.parse::<u32>().map(|n| n as usize).map_err(|_| wrong()),
        false => Err(wrong()),
    };
    let (element, extent) = match text.split_once('[') {
        None => (text, FieldExtent::One),
        Some((element, extent)) => {
            let extent = extent.strip_suffix(']').ok_or_else(wrong)?;
            let extent = match extent.strip_prefix("<=") {
                Some(most) => FieldExtent::Sequence(Some(number(most)?)),
                None if extent.is_empty() => FieldExtent::Sequence(None),
                None => FieldExtent::Fixed(number(extent)?),
            };
            (element, extent)
        }
    };
    if matches!(extent, FieldExtent::Fixed(0) | FieldExtent::Sequence(Some(0))) {
        return Err(wrong());
    }
    let (base, most) = match element.split_once("<=") {
        Some((base, most)) => (base, Some(number(most)?)),
        None => (element, None),
    };
    let element = match base {
        "string" | "wstring" => ElementName::Text { is_wide: base == "wstring", most },
        _ if most.is_some() => return Err(wrong()),
        _ => match Scalar::of_name(base) {
            Some(scalar) => ElementName::Scalar(scalar),
            None => message_name(base).ok_or_else(wrong)?,
        },
    };
    Ok((element, extent))
}

/// Returns the message that `Name`, `package/Name` or `package/msg/Name` means.
fn message_name(text: &str) -> Option<ElementName> {
    let parts: Vec<&str> = text.split('/').collect();
    if !parts.iter().all(|part| is_name(part)) {
        return None;
    }
    let (package, name) = match parts[..] {
        ["Header"] => (Some("std_msgs"), "Header"),
        [name] => (None, name),
        [package, name] | [package, "msg", name] => (Some(package), name),
        _ => return None,
    };
    Some(ElementName::Message { package: package.map(str::to_owned), name: name.to_owned() })
}

/// Returns a value without the comment that follows it. A quoted text may contain `#`.
fn without_comment(text: &str) -> &str {
    let mut quote = None;
    let mut is_escaped = false;
    for (place, c) in text.char_indices() {
        match (quote, c) {
            _ if is_escaped => is_escaped = false,
            (Some(_), '\\') => is_escaped = true,
            (Some(open), _) if c == open => quote = None,
            (None, '"' | '\'') if text[..place].ends_with(['[', ',', ' ']) || place == 0 => quote = Some(c),
            (None, '#') => return text[..place].trim_end(),
            _ => {}
        }
    }
    // A quote that is not closed is a part of a text without quotes.
    match quote {
        Some(_) => text.split('#').next().unwrap_or_default().trim_end(),
        None => text.trim_end(),
    }
}

fn constant_value(element: &ElementName, extent: FieldExtent, text: &str) -> ParsedPart<Datum> {
    let text = without_comment(text);
    match (element, extent) {
        (_, FieldExtent::Fixed(_) | FieldExtent::Sequence(_)) => {
            Err(DefinitionProblem::NoValue("an array".into()))
        }
        (ElementName::Message { .. }, _) => Err(DefinitionProblem::NoValue("a message".into())),
        _ => single_value(element, text),
    }
}

fn default_value(element: &ElementName, extent: FieldExtent, text: &str) -> ParsedPart<Datum> {
    if matches!(element, ElementName::Message { .. }) {
        return Err(DefinitionProblem::NoValue("a message".into()));
    }
    let wrong = |expected: String| DefinitionProblem::Value { text: shortened(text), expected };
    if extent == FieldExtent::One {
        return single_value(element, text);
    }
    let inner = text.strip_prefix('[').and_then(|text| text.strip_suffix(']'));
    let inner = inner.ok_or_else(|| wrong("an array, as in `[1, 2]`".into()))?;
    let items = split_items(inner).into_iter().map(|item| single_value(element, item));
    let items = items.collect::<ParsedPart<Vec<Datum>>>()?;
    match extent {
        FieldExtent::Fixed(count) if items.len() != count => {
            Err(wrong(format!("an array of {count} elements")))
        }
        FieldExtent::Sequence(Some(most)) if items.len() > most => {
            Err(wrong(format!("a sequence of at most {most} elements")))
        }
        _ => Ok(match element {
            ElementName::Scalar(scalar) => scalar.array_of(items),
            _ => vector(items),
        }),
    }
}

/// Returns the elements of an array, without the blanks around them. A comma in quotes separates nothing.
fn split_items(text: &str) -> Vec<&str> {
    let mut items = Vec::new();
    let (mut start, mut quote, mut is_escaped) = (0, None, false);
    for (place, c) in text.char_indices() {
        match (quote, c) {
            _ if is_escaped => is_escaped = false,
            (Some(_), '\\') => is_escaped = true,
            (Some(open), _) if c == open => quote = None,
            (None, '"' | '\'') => quote = Some(c),
            (None, ',') => {
                items.push(text[start..place].trim());
                start = place + 1;
            }
            _ => {}
        }
    }
    let last = text[start..].trim();
    if !last.is_empty() || !items.is_empty() {
        items.push(last);
    }
    items
}

fn single_value(element: &ElementName, text: &str) -> ParsedPart<Datum> {
    let wrong =
        |expected: &str| DefinitionProblem::Value { text: shortened(text), expected: expected.to_owned() };
    match element {
        ElementName::Scalar(scalar) => scalar_value(*scalar, text).ok_or_else(|| wrong(scalar.name())),
        ElementName::Text { is_wide, most } => {
            let value = unquoted(text);
            let length = if *is_wide { value.encode_utf16().count() } else { value.len() };
            match most {
                Some(most) if length > *most => Err(wrong(&format!("string<={most}"))),
                _ => Ok(Datum::string(&value, Span::default())),
            }
        }
        ElementName::Message { .. } => Err(DefinitionProblem::NoValue("a message".into())),
    }
}

fn scalar_value(scalar: Scalar, text: &str) -> Option<Datum> {
    match scalar {
        Scalar::Bool => match text {
            "true" | "True" | "TRUE" | "1" => Some(boolean(true)),
            "false" | "False" | "FALSE" | "0" => Some(boolean(false)),
            _ => None,
        },
        Scalar::Float64 => text.parse().ok().map(float),
        Scalar::Float32 => text.parse::<f32>().ok().map(|value| float(value.into())),
        _ => {
            let value = integer(text)?;
            let (least, greatest) = scalar.range()?;
            (BigInt::from(least) <= value && value <= BigInt::from(greatest))
                .then(|| Datum::integer(value, Span::default()))
        }
    }
}

/// Returns an integer in decimal notation, or in another one with its prefix.
fn integer(text: &str) -> Option<BigInt> {
    let (is_negative, digits) = match text.strip_prefix(['-', '+']) {
        Some(digits) => (text.starts_with('-'), digits),
        None => (false, text),
    };
    let (radix, digits) = match digits.get(..2) {
        Some("0x" | "0X") => (16, &digits[2..]),
        Some("0b" | "0B") => (2, &digits[2..]),
        Some("0o" | "0O") => (8, &digits[2..]),
        _ => (10, digits),
    };
    // Longer ones are outside of all types, and take long to read.
    let is_short = digits.len() <= 80 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    let value = is_short.then(|| BigInt::from_str_radix(digits, radix).ok()).flatten()?;
    Some(if is_negative { -value } else { value })
}

/// Returns a text without its quotes, and without the backslashes before quotes in it.
fn unquoted(text: &str) -> String {
    for quote in ['"', '\''] {
        if text.len() >= 2 && text.starts_with(quote) && text.ends_with(quote) {
            return text[1..text.len() - 1].replace(&format!("\\{quote}"), &quote.to_string());
        }
    }
    text.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(text: &str) -> String {
        match MessageDefinition::parse(text, 0) {
            Err((line, problem)) => format!("{line}: {problem}"),
            Ok(definition) => {
                let fields = definition.fields.iter().map(|field| {
                    let default = field.default.as_ref().map_or(String::new(), |value| format!("={value}"));
                    format!("{} {:?}{default}", field.name, field.extent)
                });
                let constants = definition.constants.iter().map(|c| format!("{}:={}", c.name, c.value));
                fields.chain(constants).collect::<Vec<_>>().join(", ")
            }
        }
    }

    #[test]
    fn fields_constants_and_defaults() {
        assert_eq!(shown("\n# only a comment\n"), "");
        assert_eq!(shown("uint8 a\nstring b # text"), "a One, b One");
        assert_eq!(shown("int32[3] a [1, -2, 0x1f]"), "a Fixed(3)=#(1 -2 31)");
        assert_eq!(shown("float32[<=2] a [0.5]\nbool b true"), "a Sequence(Some(2))=#(0.5), b One=T");
        assert_eq!(shown("string<=5[<=2] a"), "a Sequence(Some(2))");
        assert_eq!(shown("uint8 A=1\nuint8 B = 255 # last\nuint8 a"), "a One, A:=1, B:=255");
        assert_eq!(shown("uint64 a 18446744073709551615"), "a One=18446744073709551615");
        assert_eq!(shown("string a \"say \\\"hi\\\" # now\" # comment"), "a One=\"say \\\"hi\\\" # now\"");
        assert_eq!(shown("string[] a ['x, y', \"z\"]"), "a Sequence(None)=#(\"x, y\" \"z\")");
        assert_eq!(shown("string A='b' # c\nstring B=plain text # c"), "A:=\"b\", B:=\"plain text\"");
        assert_eq!(shown("string a \""), "a One=\"\\\"\"");
        assert_eq!(shown("string a it's # c"), "a One=\"it's\"");
        assert_eq!(shown("int32[] a []"), "a Sequence(None)=#()");
    }

    #[test]
    fn faults_are_named_with_their_lines() {
        let line = "expected `type name`, `type name default` or `type NAME=value`";
        assert_eq!(shown("uint8 a\nuint8"), format!("2: {line}, got `uint8`"));
        assert_eq!(shown("uint8 # a"), format!("1: {line}, got `uint8 # a`"));
        assert_eq!(shown("uint8[ a"), "1: `uint8[` is not a type");
        assert_eq!(shown("uint8[0] a"), "1: `uint8[0]` is not a type");
        assert_eq!(shown("uint8[-1] a"), "1: `uint8[-1]` is not a type");
        assert_eq!(shown("uint8[99999999999] a"), "1: `uint8[99999999999]` is not a type");
        assert_eq!(shown("int32<=4 a"), "1: `int32<=4` is not a type");
        assert_eq!(shown("../a/B b"), "1: `../a/B` is not a type");
        assert_eq!(
            shown("uint8 1a"),
            "1: `1a` is not a name; expected a letter, then letters, digits and `_`"
        );
        assert_eq!(shown("uint8 a\nint8 A"), "2: `A` is defined twice");
        assert_eq!(shown("uint8 a 256"), "1: `256` is not a value of uint8");
        assert_eq!(shown("uint8 A=-1"), "1: `-1` is not a value of uint8");
        assert_eq!(shown("bool a yes"), "1: `yes` is not a value of bool");
        assert_eq!(shown("int8[2] a [1]"), "1: `[1]` is not a value of an array of 2 elements");
        assert_eq!(shown("int8[] a 1"), "1: `1` is not a value of an array, as in `[1, 2]`");
        assert_eq!(shown("string<=2 a \"abc\""), "1: `\"abc\"` is not a value of string<=2");
        assert_eq!(shown("int8[] A=1"), "1: an array cannot have a value here");
        assert_eq!(shown("a/B c 1"), "1: a message cannot have a value here");
        let long = shown(&format!("int64 a {}", "9".repeat(100_000)));
        assert_eq!(long, format!("1: `{}…` is not a value of int64", "9".repeat(60)));
    }
}
