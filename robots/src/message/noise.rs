//! Any bytes as definitions and payloads, for fuzz targets and tests.

use super::{MessageType, Types, decode, encode};

/// Names of bundled types with fields of every kind.
const BUNDLED: [&str; 8] = [
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/PointCloud2",
    "diagnostic_msgs/msg/DiagnosticArray",
    "visualization_msgs/msg/InteractiveMarkerUpdate",
    "test_msgs/msg/Arrays",
    "test_msgs/msg/BoundedSequences",
    "test_msgs/msg/UnboundedSequences",
    "test_msgs/msg/WStrings",
];

/// Takes bytes as a definition and, behind a zero byte, a payload of its type; then as a payload of one of
/// the bundled `types`.
///
/// # Panics
/// A message that has been read is not written, or is another one when it is read again.
pub fn understand(types: &Types, bytes: &[u8]) {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let (text, payload) = bytes.split_at(end);
    // A definition makes types be resolved anew, so the bundled ones are kept apart.
    let defined = Types::bundled();
    if defined.define("noise/msg/Noise", &String::from_utf8_lossy(text)).is_ok() {
        pass_named(&defined, "noise/msg/Noise", payload.get(1..).unwrap_or_default());
    }
    if let Some((&first, payload)) = bytes.split_first() {
        pass_named(types, BUNDLED[usize::from(first) % BUNDLED.len()], payload);
    }
}

fn pass_named(types: &Types, name: &str, payload: &[u8]) {
    if let Ok(message_type) = types.message(name) {
        pass(&message_type, payload);
    }
}

/// Takes bytes as a payload of a type. Returns whether they are one.
///
/// # Panics
/// A message that has been read is not written, or is another one when it is read again.
pub fn pass(message_type: &MessageType, payload: &[u8]) -> bool {
    let Ok(message) = decode(message_type, payload) else { return false };
    let name = message_type.name();
    let written = encode(message_type, &message);
    let written = written.unwrap_or_else(|fault| panic!("{name}: {message} is not written: {fault}"));
    let again = decode(message_type, &written);
    let again = again.unwrap_or_else(|fault| panic!("{name}: {message} is not read again: {fault}"));
    assert_eq!(message.to_string(), again.to_string(), "{name}");
    true
}
