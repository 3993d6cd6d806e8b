//! The definitions of messages, enumerations and commands: those of the dialect ardupilotmega, which includes
//! common.
//!
//! Guarantees: the offsets and checksum seeds are computed from the definitions as the protocol says: fields
//! in the order of the size of their elements, extensions behind them.
//! Not here: reading and writing of payloads (`payload`).
//! Source: the XML files of the protocol, of which `interfaces/mavlink/extract.py` extracts what is needed.
//! A table at run time has what the types of the crate mavlink lack: values of enumerations that are newer
//! than the definitions stay numbers, and the parameters of commands have names.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use mavlink_core::calculate_crc;

const TEXT: &str = include_str!("../../interfaces/mavlink/definitions.txt");

/// A type of the elements of fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FieldType {
    Char,
    Int8,
    Uint8,
    Int16,
    Uint16,
    Int32,
    Uint32,
    Int64,
    Uint64,
    Float,
    Double,
}

/// Name, size in bytes, least and greatest value of every type.
const FIELD_TYPES: [(FieldType, &str, usize, i128, i128); 11] = [
    (FieldType::Char, "char", 1, 0, 255),
    (FieldType::Int8, "int8_t", 1, -128, 127),
    (FieldType::Uint8, "uint8_t", 1, 0, 255),
    (FieldType::Int16, "int16_t", 2, i16::MIN as i128, i16::MAX as i128),
    (FieldType::Uint16, "uint16_t", 2, 0, u16::MAX as i128),
    (FieldType::Int32, "int32_t", 4, i32::MIN as i128, i32::MAX as i128),
    (FieldType::Uint32, "uint32_t", 4, 0, u32::MAX as i128),
    (FieldType::Int64, "int64_t", 8, i64::MIN as i128, i64::MAX as i128),
    (FieldType::Uint64, "uint64_t", 8, 0, u64::MAX as i128),
    (FieldType::Float, "float", 4, 0, 0),
    (FieldType::Double, "double", 8, 0, 0),
];

impl FieldType {
    fn of_name(name: &str) -> Option<FieldType> {
        FIELD_TYPES.iter().find(|row| row.1 == name).map(|row| row.0)
    }

    /// Returns the name in the definitions.
    pub(super) fn name(self) -> &'static str {
        FIELD_TYPES[self as usize].1
    }

    /// Returns the bytes of an element.
    pub(super) fn size(self) -> usize {
        FIELD_TYPES[self as usize].2
    }

    /// Returns the least and the greatest value of an integer type.
    pub(super) fn range(self) -> (i128, i128) {
        let (_, _, _, least, greatest) = FIELD_TYPES[self as usize];
        (least, greatest)
    }

    /// Returns whether the elements are floats.
    pub(super) fn is_float(self) -> bool {
        matches!(self, FieldType::Float | FieldType::Double)
    }
}

/// A set of named numbers.
#[derive(Debug)]
pub(super) struct Enumeration {
    pub(super) name: String,
    /// Whether a value is a set of bits.
    pub(super) is_bits: bool,
    /// Values with their keywords, as they are defined.
    pub(super) entries: Vec<(u64, Datum)>,
    keywords: HashMap<u64, Datum>,
    /// Values by the names of keywords: the short ones and the whole ones.
    values: HashMap<String, u64>,
}

impl Enumeration {
    /// Returns the enumeration of these entries. A keyword is the name without the part that all have.
    fn new(name: String, is_bits: bool, entries: &[(u64, &str)]) -> Enumeration {
        let own = format!("{name}_");
        let common = match entries {
            _ if entries.iter().all(|entry| entry.1.starts_with(&own)) => own.len(),
            [first, _, ..] => {
                let shared = |length: &usize| {
                    entries.iter().all(|entry| entry.1.get(..*length) == first.1.get(..*length))
                };
                let ends = first.1.match_indices('_').map(|(place, _)| place + 1).rev();
                ends.into_iter().find(shared).unwrap_or(0)
            }
            _ => 0,
        };
        let mut new = Enumeration {
            name,
            is_bits,
            entries: Vec::new(),
            keywords: HashMap::new(),
            values: HashMap::new(),
        };
        for &(value, entry) in entries {
            let mut start = common;
            // A number is not the name of a keyword.
            while start > 0 && entry[start..].bytes().all(|byte| byte.is_ascii_digit()) {
                start = entry[..start - 1].rfind('_').map_or(0, |place| place + 1);
            }
            let short = hyphenated(&entry[start..]);
            let keyword = keyword(&short);
            new.values.entry(hyphenated(entry)).or_insert(value);
            new.values.entry(short).or_insert(value);
            new.keywords.entry(value).or_insert_with(|| keyword.clone());
            new.entries.push((value, keyword));
        }
        new
    }

    /// Returns the keyword of a value.
    pub(super) fn keyword(&self, value: u64) -> Option<&Datum> {
        self.keywords.get(&value)
    }

    /// Returns the value of the name of a keyword.
    pub(super) fn value(&self, name: &str) -> Option<u64> {
        self.values.get(name).copied()
    }

    /// Returns the names of keywords.
    pub(super) fn names(&self) -> impl Iterator<Item = String> {
        self.values.keys().map(|name| format!(":{}", name.to_ascii_lowercase()))
    }
}

/// A field of a message.
#[derive(Debug)]
pub(super) struct PayloadField {
    pub(super) keyword: Datum,
    /// Name as it is defined.
    pub(super) name: String,
    pub(super) element: FieldType,
    /// Number of elements of an array.
    pub(super) count: Option<usize>,
    pub(super) offset: usize,
    pub(super) enumeration: Option<Arc<Enumeration>>,
    is_extension: bool,
    /// Whether the sender's version of the protocol is the value.
    pub(super) is_version: bool,
}

/// A message.
#[derive(Debug)]
pub(super) struct MavlinkMessage {
    pub(super) number: u32,
    pub(super) name: String,
    pub(super) keyword: Datum,
    pub(super) extra_crc: u8,
    /// Bytes without extensions, which are all that version 1 has.
    pub(super) base_length: usize,
    pub(super) length: usize,
    pub(super) fields: Vec<PayloadField>,
    /// The keywords of the fields.
    pub(super) keywords: Arc<[Datum]>,
    /// Places of the system and the component that a message is for.
    pub(super) target: (Option<usize>, Option<usize>),
}

/// A parameter of a command.
#[derive(Debug)]
pub(super) struct CommandParameter {
    /// Name of the keyword; empty for one without a name.
    pub(super) name: String,
    pub(super) enumeration: Option<Arc<Enumeration>>,
    pub(super) default: f64,
}

/// A command, which is sent to a vehicle or is an item of a mission.
#[derive(Debug)]
pub(super) struct Command {
    pub(super) parameters: [CommandParameter; 7],
}

/// All definitions.
#[derive(Debug)]
pub(super) struct Dialect {
    messages: HashMap<u32, MavlinkMessage>,
    numbers: HashMap<String, u32>,
    enumerations: HashMap<String, Arc<Enumeration>>,
    commands: HashMap<u64, Command>,
}

/// Returns a keyword of this name, in upper case.
pub(super) fn keyword(name: &str) -> Datum {
    Datum::symbol(Symbol::keyword(name), Span::default())
}

/// Returns a name as that of a keyword.
fn hyphenated(name: &str) -> String {
    name.replace('_', "-").to_ascii_uppercase()
}

/// Lines that belong to one definition, behind its first.
fn definition_lines(text: &str) -> Vec<(&str, Vec<&str>)> {
    let mut found: Vec<(&str, Vec<&str>)> = Vec::new();
    for line in text.lines() {
        match (line.strip_prefix(' '), found.last_mut()) {
            (Some(part), Some((_, parts))) => parts.push(part),
            _ => found.push((line, Vec::new())),
        }
    }
    found
}

impl Dialect {
    /// Returns the definitions, which are read by the first call.
    pub(super) fn get() -> &'static Dialect {
        static DIALECT: OnceLock<Dialect> = OnceLock::new();
        DIALECT.get_or_init(|| Dialect::of_text(TEXT))
    }

    fn of_text(text: &str) -> Dialect {
        let mut dialect = Dialect {
            messages: HashMap::new(),
            numbers: HashMap::new(),
            enumerations: HashMap::new(),
            commands: HashMap::new(),
        };
        for (head, parts) in definition_lines(text) {
            let mut words = head.split(' ');
            match (words.next(), words.next(), words.next()) {
                (Some(kind @ ("enum" | "bits")), Some(name), None) => {
                    let entries = parts.iter().filter_map(|part| part.split_once(' '));
                    let entries: Vec<(u64, &str)> =
                        entries.filter_map(|(value, name)| Some((value.parse().ok()?, name))).collect();
                    let enumeration = Enumeration::new(name.to_owned(), kind == "bits", &entries);
                    dialect.enumerations.insert(name.to_owned(), Arc::new(enumeration));
                }
                (Some("message"), Some(number), Some(name)) => {
                    if let Ok(number) = number.parse() {
                        let message = dialect.message_of(number, name, &parts);
                        dialect.numbers.insert(hyphenated(name), number);
                        dialect.messages.insert(number, message);
                    }
                }
                (Some("command"), Some(number), Some(_)) => {
                    if let Ok(number) = number.parse() {
                        let command = dialect.command_of(&parts);
                        dialect.commands.insert(number, command);
                    }
                }
                _ => {}
            }
        }
        dialect
    }

    fn message_of(&self, number: u32, name: &str, parts: &[&str]) -> MavlinkMessage {
        let mut fields = Vec::new();
        let mut is_extension = false;
        for part in parts {
            if *part == "extensions" {
                is_extension = true;
                continue;
            }
            let mut words = part.split(' ');
            let (Some(of_type), Some(field)) = (words.next(), words.next()) else { continue };
            let (element, count) = match of_type.trim_end_matches(']').split_once('[') {
                Some((element, count)) => (element, count.parse().ok()),
                None => (of_type, None),
            };
            let is_version = element == "uint8_t_mavlink_version";
            let element = FieldType::of_name(if is_version { "uint8_t" } else { element });
            let Some(element) = element else { continue };
            let enumeration = words.next().and_then(|name| self.enumerations.get(name));
            fields.push(PayloadField {
                keyword: keyword(&hyphenated(field)),
                name: field.to_owned(),
                element,
                count,
                offset: 0,
                enumeration: enumeration.filter(|_| !element.is_float() && count.is_none()).cloned(),
                is_extension,
                is_version,
            });
        }
        let mut order: Vec<usize> = (0..fields.len()).collect();
        order.sort_by_key(|&place| match &fields[place] {
            field if field.is_extension => 9,
            field => 8 - field.element.size(),
        });
        let (mut length, mut base_length) = (0, 0);
        let mut seed = format!("{name} ").into_bytes();
        for &place in &order {
            let field = &mut fields[place];
            field.offset = length;
            length += field.element.size() * field.count.unwrap_or(1);
            if !field.is_extension {
                base_length = length;
                seed.extend(format!("{} {} ", field.element.name(), field.name).bytes());
                seed.extend(field.count.and_then(|count| u8::try_from(count).ok()));
            }
        }
        let extra_crc = seed.split_last().map_or(0, |(&last, rest)| {
            let crc = calculate_crc(rest, last).to_le_bytes();
            crc[0] ^ crc[1]
        });
        let place = |name: &str| fields.iter().find(|field| field.name == name).map(|field| field.offset);
        MavlinkMessage {
            number,
            name: name.to_owned(),
            keyword: keyword(&hyphenated(name)),
            extra_crc,
            base_length,
            length,
            target: (place("target_system"), place("target_component")),
            keywords: fields.iter().map(|field| field.keyword.clone()).collect(),
            fields,
        }
    }

    fn command_of(&self, parts: &[&str]) -> Command {
        let unnamed = || CommandParameter { name: String::new(), enumeration: None, default: 0.0 };
        let mut parameters: [CommandParameter; 7] = std::array::from_fn(|_| unnamed());
        for part in parts {
            let mut words = part.split(' ');
            let place = words.next().and_then(|index| index.parse::<usize>().ok()).unwrap_or(0);
            let Some(parameter) = parameters.get_mut(place.wrapping_sub(1)) else { continue };
            parameter.name = words.next().filter(|name| *name != "-").map_or_else(String::new, hyphenated);
            for word in words {
                match word.strip_prefix('=') {
                    Some(default) => parameter.default = default.parse().unwrap_or(0.0),
                    None => parameter.enumeration = self.enumerations.get(word).cloned(),
                }
            }
        }
        Command { parameters }
    }

    /// Returns the message of a number.
    pub(super) fn message(&self, number: u32) -> Option<&MavlinkMessage> {
        self.messages.get(&number)
    }

    /// Returns the message of the name of a keyword.
    pub(super) fn message_named(&self, name: &str) -> Option<&MavlinkMessage> {
        self.numbers.get(name).and_then(|number| self.messages.get(number))
    }

    /// Returns the names of messages, as keywords are written.
    pub(super) fn message_names(&self) -> impl Iterator<Item = String> {
        self.numbers.keys().map(|name| format!(":{}", name.to_ascii_lowercase()))
    }

    /// Returns the enumeration of a name.
    pub(super) fn enumeration(&self, name: &str) -> Option<&Arc<Enumeration>> {
        self.enumerations.get(name)
    }

    /// Returns the command of a number.
    pub(super) fn command(&self, number: u64) -> Option<&Command> {
        self.commands.get(&number)
    }
}
