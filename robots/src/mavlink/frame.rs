//! Frames of MAVLink 1 and 2: finding them among other bytes, and making them.
//!
//! Guarantees: no sequence of bytes makes this panic; a frame is given only if its checksum is right; the
//! work is bounded by the length of the bytes times that of a frame.
//! Not here: signatures (`signing`). The reader of the crate mavlink-core drops bytes silently; here they are
//! counted, and a datagram ends its frames.

use mavlink_core::consts::{self, MAX_FRAME_SIZE};
use mavlink_core::{MAV_STX, MAV_STX_V2, calculate_crc};

use super::definitions::{Dialect, MavlinkMessage};

/// A whole frame with a right checksum.
#[derive(Clone, Copy, Debug)]
pub(super) struct MavlinkFrame<'a> {
    pub(super) message: &'static MavlinkMessage,
    pub(super) system: u8,
    pub(super) component: u8,
    pub(super) sequence: u8,
    pub(super) payload: &'a [u8],
    /// All bytes of a signed frame.
    pub(super) signed: Option<&'a [u8]>,
}

/// A part of a sequence of bytes.
#[derive(Clone, Copy, Debug)]
pub(super) enum StreamPart<'a> {
    Frame(MavlinkFrame<'a>),
    /// Bytes outside of frames.
    Garbage(usize),
    /// A frame whose checksum is wrong, or whose flags are unknown.
    Malformed,
    /// A frame of a message that is not defined, with its number.
    Unknown(u32),
}

/// Calls `take` with the parts of `bytes`. Returns the number of bytes that are done with: those behind are
/// the beginning of a frame, unless the bytes are `whole`, as a datagram is.
pub(super) fn scan<'a>(bytes: &'a [u8], whole: bool, mut take: impl FnMut(StreamPart<'a>)) -> usize {
    let mut at = 0;
    loop {
        let rest = &bytes[at..];
        let Some(place) = rest.iter().position(|&byte| byte == MAV_STX || byte == MAV_STX_V2) else {
            if !rest.is_empty() {
                take(StreamPart::Garbage(rest.len()));
            }
            return bytes.len();
        };
        if place > 0 {
            take(StreamPart::Garbage(place));
            at += place;
        }
        let rest = &bytes[at..];
        let is_second = rest[0] == MAV_STX_V2;
        let flags = if is_second { rest.get(consts::v2::INCOMPAT_FLAGS_OFFSET).copied() } else { None };
        let is_signed = flags == Some(consts::v2::IFLAG_SIGNED);
        // Such bytes are not worth waiting for more.
        if !is_signed && flags.is_some_and(|flags| flags != 0) {
            take(StreamPart::Malformed);
            at += 1;
            continue;
        }
        let Some(length) = frame_length(rest).filter(|length| *length <= rest.len()) else {
            if !whole {
                return at;
            }
            take(StreamPart::Garbage(1));
            at += 1;
            continue;
        };
        let number = match is_second {
            true => u32::from_le_bytes([rest[7], rest[8], rest[9], 0]),
            false => u32::from(rest[5]),
        };
        let Some(message) = Dialect::get().message(number) else {
            take(StreamPart::Unknown(number));
            // The checksum of an unknown message cannot be checked, so its length counts only if another
            // frame, or nothing, follows.
            let ends = rest.get(length).map_or(whole, |&next| next == MAV_STX || next == MAV_STX_V2);
            at += if ends { length } else { 1 };
            continue;
        };
        let header = if is_second { 1 + consts::v2::MIN_HEADER_SIZE } else { 1 + consts::v1::HEADER_SIZE };
        let end = header + usize::from(rest[consts::PAYLOAD_LEN_OFFSET]);
        if calculate_crc(&rest[1..end], message.extra_crc).to_le_bytes() != rest[end..end + 2] {
            take(StreamPart::Malformed);
            at += 1;
            continue;
        }
        let first = if is_second { 4 } else { 2 };
        take(StreamPart::Frame(MavlinkFrame {
            message,
            sequence: rest[first],
            system: rest[first + 1],
            component: rest[first + 2],
            payload: &rest[header..end],
            signed: is_signed.then(|| &rest[..length]),
        }));
        at += length;
    }
}

/// Returns the length of the frame that begins here, if the bytes tell it.
fn frame_length(bytes: &[u8]) -> Option<usize> {
    let payload = usize::from(*bytes.get(consts::PAYLOAD_LEN_OFFSET)?);
    let flags = *bytes.get(consts::v2::INCOMPAT_FLAGS_OFFSET)?;
    Some(match bytes[0] {
        MAV_STX => 1 + consts::v1::HEADER_SIZE + payload + consts::CHECKSUM_SIZE,
        _ => {
            let is_signed = flags & consts::v2::IFLAG_SIGNED != 0;
            let signature = if is_signed { consts::v2::SIGNATURE_SIZE } else { 0 };
            1 + consts::v2::MIN_HEADER_SIZE + payload + consts::CHECKSUM_SIZE + signature
        }
    })
}

/// The origin of a frame: system, component and number in the sequence.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameOrigin {
    pub(super) system: u8,
    pub(super) component: u8,
    pub(super) sequence: u8,
}

/// Returns a frame of MAVLink 2; with `is_signed`, it says so and lacks the signature.
pub(super) fn frame(
    message: &MavlinkMessage,
    payload: &[u8],
    origin: FrameOrigin,
    is_signed: bool,
) -> Vec<u8> {
    let payload = &payload[..message.length.min(payload.len())];
    // Zeros at the end are left out, but the first byte is not.
    let length = payload.iter().rposition(|&byte| byte != 0).map_or(1, |place| place + 1).min(payload.len());
    let mut bytes = Vec::with_capacity(MAX_FRAME_SIZE);
    let number = message.number.to_le_bytes();
    bytes.extend([MAV_STX_V2, u8::try_from(length).unwrap_or(u8::MAX), u8::from(is_signed), 0]);
    bytes.extend([origin.sequence, origin.system, origin.component, number[0], number[1], number[2]]);
    bytes.extend(&payload[..length]);
    with_checksum(bytes, message)
}

/// Returns a frame of MAVLink 1; `None` if the message has a number that version 1 lacks.
pub(super) fn first_frame(message: &MavlinkMessage, payload: &[u8], origin: FrameOrigin) -> Option<Vec<u8>> {
    let number = u8::try_from(message.number).ok()?;
    let payload = payload.get(..message.base_length)?;
    let length = u8::try_from(message.base_length).ok()?;
    let mut bytes = vec![MAV_STX, length, origin.sequence, origin.system, origin.component, number];
    bytes.extend(payload);
    Some(with_checksum(bytes, message))
}

fn with_checksum(mut bytes: Vec<u8>, message: &MavlinkMessage) -> Vec<u8> {
    let checksum = calculate_crc(&bytes[1..], message.extra_crc);
    bytes.extend(checksum.to_le_bytes());
    bytes
}
