//! Hashes and payloads of all bundled types, compared with those of other implementations of ROS 2: the table
//! `hashes.txt`, made by rosbags, and rosbags itself where Python and its registry are there.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::span::Span;
use esl_robots::message::{Element, FieldExtent, MessageType, Scalar, Types, decode, encode, noise};

/// Random messages, both ways.
const MESSAGES: usize = 10_000;

/// The names of the messages, and of the parts of services and actions, that are bundled.
fn bundled(types: &Types) -> Vec<String> {
    let parts = |name: String| -> Vec<String> {
        let parts: &[&str] = match name.split('/').nth(1) {
            Some("srv") => &["_Request", "_Response"],
            Some("action") => &["_Goal", "_Result", "_Feedback"],
            _ => &[""],
        };
        parts.iter().map(|part| format!("{name}{part}")).collect()
    };
    types.names().into_iter().flat_map(parts).collect()
}

/// Returns whether a type has a field `wstring`, which rosbags does not know.
fn is_wide(types: &Types, name: &str) -> bool {
    text_of(types, name).lines().any(|line| line.starts_with("wstring"))
}

fn message_type(types: &Types, name: &str) -> Arc<MessageType> {
    types.message(name).unwrap_or_else(|fault| panic!("{name}: {fault}"))
}

#[test]
fn hashes_of_messages_equal_those_of_the_table() {
    let types = Types::bundled();
    let table = include_str!("hashes.txt");
    let expected: BTreeMap<&str, &str> = table.lines().filter_map(|line| line.split_once(' ')).collect();
    let mut names = types.names();
    names.retain(|name| name.contains("/msg/") && !is_wide(&types, name));
    assert!(names.len() > 220, "only {} messages are bundled", names.len());
    let wrong: Vec<String> = names
        .iter()
        .filter(|name| expected.get(name.as_str()) != Some(&message_type(&types, name).hash()))
        .map(|name| format!("{name} {}", message_type(&types, name).hash()))
        .collect();
    assert_eq!(wrong, Vec::<String>::new());
    assert_eq!(expected.len(), names.len(), "a type of the table is not bundled any more");
}

#[test]
fn hashes_of_services_and_actions_equal_those_of_the_generator_of_code() {
    let (messages, services, actions) = generated();
    let mut resolver = hiroz_codegen::resolver::Resolver::new(false);
    resolver.resolve_messages(messages).expect("the definitions are right");
    let types = Types::bundled();
    let mut compared = 0;
    for service in resolver.resolve_services(services).expect("they are right") {
        let name = format!("{}/srv/{}", service.parsed.package, service.parsed.name);
        let ours = types.service(&name).expect("it is bundled");
        // The generator takes every name with `CancelGoal` for a part of an action; this is the hash that an
        // installation of ROS 2 has.
        let expected = match &*name {
            "action_msgs/srv/CancelGoal" => {
                "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a".to_owned()
            }
            _ => service.type_hash.to_rihs_string(),
        };
        assert_eq!(ours.hash(), expected, "{name}");
        compared += 1;
    }
    for action in resolver.resolve_actions(actions).expect("they are right") {
        let name = format!("{}/action/{}", action.parsed.package, action.parsed.name);
        let ours = types.action(&name).expect("it is bundled");
        assert_eq!(ours.send_goal.hash(), action.send_goal_hash.to_rihs_string(), "{name}");
        assert_eq!(ours.get_result.hash(), action.get_result_hash.to_rihs_string(), "{name}");
        assert_eq!(ours.feedback_message.hash(), action.feedback_message_hash.to_rihs_string(), "{name}");
        assert_eq!(ours.cancel_goal.name(), "action_msgs/srv/CancelGoal", "{name}");
        assert_eq!(ours.status.hash(), action.status_hash.to_rihs_string(), "{name}");
        compared += 1;
    }
    assert!(compared > 50, "only {compared} have been compared");
}

/// Returns the definitions of Jazzy as the generator of code reads them.
fn generated() -> (
    Vec<hiroz_codegen::types::ParsedMessage>,
    Vec<hiroz_codegen::types::ParsedService>,
    Vec<hiroz_codegen::types::ParsedAction>,
) {
    use hiroz_codegen::parser::{action, msg, srv};
    let (mut messages, mut services, mut actions) = (Vec::new(), Vec::new(), Vec::new());
    let root = hiroz_codegen::bundled_assets_dir_for("jazzy");
    for package in fs::read_dir(root).expect("the crate has definitions").flatten() {
        let name = package.file_name().to_string_lossy().into_owned();
        // The first is a fixture of the crate; the second has an action whose parts are missing.
        if ["test_interface_files", "test_msgs"].contains(&&*name) {
            continue;
        }
        for kind in ["msg", "srv", "action"] {
            for file in fs::read_dir(package.path().join(kind)).into_iter().flatten().flatten() {
                let path = file.path();
                let is_wide =
                    fs::read_to_string(&path).expect("a text").lines().any(|l| l.starts_with("wstring"));
                match kind {
                    // It does not know wide texts.
                    "msg" if !is_wide => {
                        messages.push(msg::parse_msg_file(&path, &name).expect("it is right"))
                    }
                    "srv" => services.push(srv::parse_srv_file(&path, &name).expect("it is right")),
                    "action" => actions.push(action::parse_action_file(&path, &name).expect("it is right")),
                    _ => {}
                }
            }
        }
    }
    (messages, services, actions)
}

/// Random numbers by xorshift, alike in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() >> 33) as usize % limit
    }

    fn message(&mut self, message_type: &MessageType, depth: usize) -> Datum {
        let mut items = Vec::new();
        for field in message_type.fields() {
            let most = if depth < 3 { [0, 1, 2, 5][self.below(4)] } else { 1 };
            let value = match field.extent {
                FieldExtent::One => self.element(&field.element, depth),
                FieldExtent::Fixed(count) => self.array(&field.element, count, depth),
                FieldExtent::Sequence(bound) => {
                    let count = self.below(bound.unwrap_or(most).min(most) + 1);
                    self.array(&field.element, count, depth)
                }
            };
            items.extend([field.keyword.clone(), value]);
        }
        Datum::list(items, Span::default())
    }

    fn array(&mut self, element: &Element, count: usize, depth: usize) -> Datum {
        let items = (0..count).map(|_| self.element(element, depth)).collect();
        Datum::new(DatumKind::Vector(items), Span::default())
    }

    fn element(&mut self, element: &Element, depth: usize) -> Datum {
        match element {
            Element::Message(message) => self.message(message, depth + 1),
            Element::Text { most, .. } => {
                let letters = ["a", "Z", "0", " ", "_", "/", "\u{e9}", "\u{20ac}", "\u{1f916}"];
                let mut text = String::new();
                for _ in 0..self.below(12) {
                    let letter = letters[self.below(letters.len())];
                    if text.len() + letter.len() <= most.unwrap_or(100) {
                        text.push_str(letter);
                    }
                }
                Datum::string(&text, Span::default())
            }
            Element::Scalar(Scalar::Bool) if self.below(2) == 0 => Datum::nil(Span::default()),
            Element::Scalar(Scalar::Bool) => {
                Datum::symbol(esl_bytecode::symbol::Symbol::cl("T"), Span::default())
            }
            Element::Scalar(scalar) => match scalar.range() {
                Some((least, greatest)) => {
                    let any = least + i128::from(self.next()).rem_euclid(greatest - least + 1);
                    Datum::integer([least, greatest, 0, any][self.below(4)], Span::default())
                }
                None => {
                    let any = (self.next() as f64 / u64::MAX as f64 - 0.5) * 1e6;
                    let value = [0.0, -0.0, f64::INFINITY, 1e-40, any][self.below(5)];
                    Datum::new(DatumKind::Float(value), Span::default())
                }
            },
        }
    }
}

/// Writes a message as the script for rosbags does, by its type.
fn write_message(out: &mut String, message_type: &MessageType, message: &Datum) {
    out.push('{');
    let values: Vec<&Datum> = message.elements().skip(1).step_by(2).collect();
    for (index, (field, value)) in message_type.fields().iter().zip(values).enumerate() {
        if index > 0 {
            out.push(' ');
        }
        if field.extent == FieldExtent::One {
            write_element(out, &field.element, value);
            continue;
        }
        let items: Vec<Datum> = match value.kind() {
            DatumKind::Vector(items) => items.to_vec(),
            DatumKind::Packed(PackedVector::Bytes(bytes)) => {
                bytes.iter().map(|&n| integer(n.into())).collect()
            }
            DatumKind::Packed(PackedVector::Integers(integers)) => {
                integers.iter().map(|&n| integer(n)).collect()
            }
            DatumKind::Packed(PackedVector::Floats(floats)) => {
                floats.iter().map(|&value| Datum::new(DatumKind::Float(value), Span::default())).collect()
            }
            _ => panic!("{value} is not an array"),
        };
        out.push('[');
        for (index, item) in items.iter().enumerate() {
            if index > 0 {
                out.push(' ');
            }
            write_element(out, &field.element, item);
        }
        out.push(']');
    }
    out.push('}');
}

fn integer(value: i64) -> Datum {
    Datum::integer(value, Span::default())
}

fn write_element(out: &mut String, element: &Element, value: &Datum) {
    match (element, value.kind()) {
        (Element::Message(message), _) => write_message(out, message, value),
        (Element::Scalar(Scalar::Bool), kind) => {
            out.push(if matches!(kind, DatumKind::Nil) { 'F' } else { 'T' })
        }
        (_, DatumKind::Float(value)) => _ = write!(out, "f{:016x}", value.to_bits()),
        (_, DatumKind::String(text)) => _ = write!(out, "s{}", hexadecimal(text.as_bytes())),
        _ => _ = write!(out, "{value}"),
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        _ = write!(text, "{byte:02x}");
        text
    })
}

fn bytes_of(text: &str) -> Vec<u8> {
    let digit = |at: usize| u8::from_str_radix(&text[at..at + 2], 16).expect("two digits");
    (0..text.len()).step_by(2).map(digit).collect()
}

/// Returns a Python with rosbags; `None`, with a text, if there cannot be one.
#[allow(clippy::print_stderr, reason = "whoever runs the tests sees what is left out")]
fn python() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("rosbags");
    let python = folder.join("bin/python");
    let works =
        |code: &str| Command::new(&python).args(["-c", code]).output().is_ok_and(|out| out.status.success());
    if works("import rosbags") {
        return Some(python);
    }
    let made = Command::new("python3").args(["-m", "venv"]).arg(&folder).output();
    let is_made = made.is_ok_and(|out| out.status.success());
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "rosbags==0.11.9"]);
    if is_made && install.output().is_ok_and(|out| out.status.success()) {
        return Some(python);
    }
    eprintln!("left out: it needs `python3`, its `venv`, and its registry");
    None
}

/// Returns the text of one part of a definition.
fn text_of(types: &Types, name: &str) -> String {
    let suffixes = ["_Request", "_Response", "_Goal", "_Result", "_Feedback"];
    if name.contains("/msg/") {
        return types.text(name).expect("it is bundled");
    }
    let suffix = suffixes.iter().find(|suffix| name.ends_with(**suffix)).expect("a part");
    let whole = types.text(name.trim_end_matches(suffix)).expect("it is bundled");
    let index = match *suffix {
        "_Request" | "_Goal" => 0,
        "_Feedback" => 2,
        _ => 1,
    };
    let lines: Vec<&str> = whole.lines().collect();
    let part = lines.split(|line| line.trim() == "---").nth(index).expect("it has all parts");
    part.join("\n") + "\n"
}

#[test]
fn messages_and_hashes_equal_those_of_rosbags() {
    let Some(python) = python() else { return };
    let types = Types::bundled();
    let mut names = bundled(&types);
    names.retain(|name| !is_wide(&types, name));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("messages-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder");
    let definitions: String =
        names.iter().map(|name| format!("=== {name}\n{}\n", text_of(&types, name))).collect();
    fs::write(folder.join("definitions.txt"), &definitions).expect("a file");
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut theirs = String::new();
    let mut expected = Vec::new();
    for number in 0..MESSAGES {
        let name = &names[number % names.len()];
        let message_type = message_type(&types, name);
        let message = random.message(&message_type, 0);
        let payload =
            encode(&message_type, &message).unwrap_or_else(|fault| panic!("{name} {message}: {fault}"));
        let read = decode(&message_type, &payload).unwrap_or_else(|fault| panic!("{name}: {fault}"));
        let mut text = String::new();
        write_message(&mut text, &message_type, &read);
        let payload = hexadecimal(&payload);
        _ = writeln!(theirs, "{name} {payload}");
        expected.push(format!("{payload} {text}"));
    }
    fs::write(folder.join("theirs.txt"), theirs).expect("a file");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/rosbags_peer.py");
    let out = Command::new(python).arg(script).arg(&folder).output().expect("Python is there");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let read = fs::read_to_string(folder.join("read.txt")).expect("it is written");
    assert_eq!(read.lines().count(), MESSAGES);
    for ((line, expected), number) in read.lines().zip(&expected).zip(0..) {
        assert_eq!(line, expected, "{}", names[number % names.len()]);
    }
    let ours = fs::read_to_string(folder.join("ours.txt")).expect("it is written");
    assert_eq!(ours.lines().count(), MESSAGES);
    for line in ours.lines() {
        let mut parts = line.splitn(3, ' ');
        let (name, payload) = (parts.next().expect("a name"), parts.next().expect("a payload"));
        let message_type = message_type(&types, name);
        let read =
            decode(&message_type, &bytes_of(payload)).unwrap_or_else(|fault| panic!("{name}: {fault}"));
        let mut text = String::new();
        write_message(&mut text, &message_type, &read);
        assert_eq!(Some(text.as_str()), parts.next(), "{name}");
        let again = encode(&message_type, &read).unwrap_or_else(|fault| panic!("{name}: {fault}"));
        assert_eq!(hexadecimal(&again), payload, "{name}");
    }
    let hashes = fs::read_to_string(folder.join("hashes.txt")).expect("it is written");
    fs::remove_dir_all(&folder).expect("it is there");
    let table = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/hashes.txt");
    if std::env::var_os("ESL_BLESS").is_some() {
        fs::write(&table, &hashes).expect("a file");
    }
    assert_eq!(hashes, fs::read_to_string(&table).expect("it is there"), "ESL_BLESS=1 writes the table");
}

/// Returns the number of inputs of a test with noise; `ESL_NOISE` sets another one, for longer runs by hand.
fn noises(usual: usize) -> usize {
    std::env::var("ESL_NOISE").ok().and_then(|count| count.parse().ok()).unwrap_or(usual)
}

/// The checks of the fuzz target, with mutated definitions and payloads.
#[test]
fn mutated_definitions_and_payloads_are_read_or_refused() {
    let types = Types::bundled();
    let names = types.names();
    let mut random = Random(0x5851_f42d_4c95_7f2d);
    for round in 0..noises(20_000) {
        let name = &names[random.below(names.len())];
        let mut bytes = types.text(name).expect("it is bundled").into_bytes();
        bytes.truncate(400);
        bytes.extend([0, 0, 1, 0, 0]);
        bytes.extend((0..random.below(80)).map(|_| [0, 0, 0, 1, 2, 0xff][random.below(6)]));
        for _ in 0..random.below(8) {
            let place = random.below(bytes.len());
            bytes[place] = b"\0\n =#[]<\"'-9a/\xff"[random.below(15)];
        }
        // The payload of a bundled type begins behind the first byte.
        let bytes = if round % 2 == 0 { bytes } else { bytes.split_off(bytes.len() / 2) };
        noise::understand(&types, &bytes);
    }
}

/// Payloads of messages of all types, of which bytes are changed, left out, repeated or cut off.
#[test]
fn mutated_payloads_of_all_types_are_read_or_refused() {
    let types = Types::bundled();
    let mut random = Random(0x2545_f491_4f6c_dd1d);
    let mut payloads = Vec::new();
    for name in bundled(&types) {
        let of_type = message_type(&types, &name);
        for _ in 0..4 {
            let message = random.message(&of_type, 0);
            let payload = encode(&of_type, &message).unwrap_or_else(|fault| panic!("{name}: {fault}"));
            // An input of usual length, so that changes meet lengths and truth values.
            if payload.len() < 2000 {
                payloads.push((of_type.clone(), payload));
            }
        }
    }
    let mut read = 0;
    for _ in 0..noises(20_000) {
        let (of_type, payload) = &payloads[random.below(payloads.len())];
        let mut bytes = payload.to_vec();
        for _ in 0..random.below(6) {
            let place = random.below(bytes.len());
            match random.below(5) {
                0 => bytes[place] = [0, 1, 2, 4, 0x7f, 0x80, 0xff][random.below(7)],
                1 => bytes[place] ^= 1 << random.below(8),
                2 => _ = bytes.drain(place..(place + random.below(9)).min(bytes.len())),
                3 => {
                    let part = bytes[place..(place + random.below(9)).min(bytes.len())].to_vec();
                    bytes.splice(place..place, part);
                }
                _ => bytes.truncate(place),
            }
            if bytes.is_empty() {
                break;
            }
        }
        read += usize::from(noise::pass(of_type, &bytes));
    }
    assert!(read > 0, "none is read");
}
