//! Signatures of MAVLink 2: of the frames that are sent, and of those that come.
//!
//! Guarantees: a frame that was received is not taken again; memory is bounded by the number of streams that
//! are signed with the key.
//! Source: the protocol's page on message signing. `SigningData` of mavlink-core panics where the clock is
//! before 2015, as on a computer without a battery, so that only its signature is used.

use std::collections::HashMap;
use std::time::{Duration, SystemTime};

use mavlink_core::MAVLinkV2MessageRaw;
use mavlink_core::consts::v2::{SIGNATURE_SIZE, SIGNATURE_VALUE_SIZE};

use super::frame::MavlinkFrame;

/// Seconds from 1970 to 2015, where timestamps begin.
const EPOCH: u64 = 1_420_070_400;
/// Units of a timestamp in a second.
const UNITS: u64 = 100_000;
/// How far a new stream may be behind.
const MOST_BEHIND: u64 = 60 * UNITS;

/// Number of RADIO_STATUS, which radios send unsigned.
const RADIO_STATUS: u32 = 109;

/// A key, and the times of what was signed with it.
pub(super) struct Signing {
    key: [u8; 32],
    link: u8,
    accepts_unsigned: bool,
    last: u64,
    streams: HashMap<(u8, u8, u8), u64>,
}

/// Returns the time of the system as a timestamp.
fn timestamp(now: SystemTime) -> u64 {
    let since = now.duration_since(SystemTime::UNIX_EPOCH + Duration::from_secs(EPOCH));
    since.map_or(0, |since| since.as_secs() * UNITS + u64::from(since.subsec_micros()) / 10)
}

fn signature(key: &[u8; 32], frame: &[u8]) -> [u8; SIGNATURE_VALUE_SIZE] {
    let mut raw = MAVLinkV2MessageRaw::new();
    let length = frame.len().min(raw.as_slice().len());
    raw.as_mut_slice()[..length].copy_from_slice(&frame[..length]);
    let mut signature = [0; SIGNATURE_VALUE_SIZE];
    raw.calculate_signature(key, &mut signature);
    signature
}

impl Signing {
    /// Returns the signing with a key, as the link of this number.
    pub(super) fn new(key: [u8; 32], link: u8, accepts_unsigned: bool) -> Signing {
        Signing { key, link, accepts_unsigned, last: 0, streams: HashMap::new() }
    }

    /// Adds the signature to a frame that says that it is signed.
    pub(super) fn sign(&mut self, frame: &mut Vec<u8>) {
        self.last = timestamp(SystemTime::now()).max(self.last + 1);
        frame.push(self.link);
        frame.extend(&self.last.to_le_bytes()[..6]);
        let signature = signature(&self.key, &[frame.as_slice(), &[0; SIGNATURE_VALUE_SIZE]].concat());
        frame.extend(signature);
    }

    /// Returns whether a frame is accepted.
    pub(super) fn accepts(&mut self, frame: &MavlinkFrame<'_>) -> bool {
        let Some(bytes) = frame.signed else {
            return self.accepts_unsigned || frame.message.number == RADIO_STATUS;
        };
        let Some((_, tail)) = bytes.split_at_checked(bytes.len().wrapping_sub(SIGNATURE_SIZE)) else {
            return false;
        };
        let time = tail[1..7].iter().rev().fold(0, |time, &byte| time << 8 | u64::from(byte));
        let stream = (tail[0], frame.system, frame.component);
        let now = timestamp(SystemTime::now()).max(self.last);
        let is_new = match self.streams.get(&stream) {
            Some(&before) => time > before,
            None => time + MOST_BEHIND >= now,
        };
        if !is_new || signature(&self.key, bytes) != tail[7..] {
            return false;
        }
        self.streams.insert(stream, time);
        self.last = self.last.max(time);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::definitions::Dialect;
    use super::super::frame::{FrameOrigin, StreamPart, frame, scan};
    use super::*;

    fn signed(signing: &mut Signing) -> Vec<u8> {
        let message = Dialect::get().message(0).expect("there are heartbeats");
        let origin = FrameOrigin { system: 1, component: 1, sequence: 7 };
        let mut bytes = frame(message, &[1; 9], origin, true);
        signing.sign(&mut bytes);
        bytes
    }

    fn accepted(signing: &mut Signing, bytes: &[u8]) -> Vec<bool> {
        let mut answers = Vec::new();
        scan(bytes, true, |found| {
            if let StreamPart::Frame(frame) = found {
                answers.push(signing.accepts(&frame));
            }
        });
        answers
    }

    #[test]
    fn a_signed_frame_is_accepted_once_and_by_the_same_key() {
        let (mut sender, mut receiver) = (Signing::new([7; 32], 3, false), Signing::new([7; 32], 0, false));
        let (first, second) = (signed(&mut sender), signed(&mut sender));
        assert_eq!(accepted(&mut receiver, &first), [true]);
        assert_eq!(accepted(&mut receiver, &first), [false], "it is repeated");
        assert_eq!(accepted(&mut receiver, &second), [true]);
        assert_eq!(accepted(&mut receiver, &first), [false], "it is older");
        assert_eq!(accepted(&mut Signing::new([8; 32], 0, true), &second), [false], "the key is another one");
    }

    #[test]
    fn an_unsigned_frame_is_accepted_where_it_is_allowed() {
        let heartbeat = Dialect::get().message(0).expect("there are heartbeats");
        let radio = Dialect::get().message(RADIO_STATUS).expect("it is defined");
        let origin = FrameOrigin { system: 1, component: 1, sequence: 7 };
        let bytes = |message, length: usize| frame(message, &vec![1; length], origin, false);
        assert_eq!(accepted(&mut Signing::new([7; 32], 3, false), &bytes(heartbeat, 9)), [false]);
        assert_eq!(accepted(&mut Signing::new([7; 32], 3, true), &bytes(heartbeat, 9)), [true]);
        assert_eq!(accepted(&mut Signing::new([7; 32], 3, false), &bytes(radio, 9)), [true]);
    }

    #[test]
    fn a_clock_before_2015_is_no_fault() {
        assert_eq!(timestamp(SystemTime::UNIX_EPOCH), 0);
        assert_eq!(timestamp(SystemTime::UNIX_EPOCH + Duration::from_secs(EPOCH + 2)), 2 * UNITS);
    }
}
