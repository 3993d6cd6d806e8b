//! Any bytes as those of a link, for fuzzing and tests.

use super::frame::{StreamPart, scan};
use super::payload::{decode, encode, padded};

/// Takes bytes as a datagram and as a part of a stream. Returns the number of frames in them.
///
/// # Panics
/// If a message that was read is another one when it is written and read again.
pub fn feed(bytes: &[u8]) -> usize {
    let mut frames = 0;
    for whole in [true, false] {
        scan(bytes, whole, |found| {
            let StreamPart::Frame(frame) = found else { return };
            frames += 1;
            let decoded = decode(frame.message, &padded(frame.payload)).to_string();
            // A text that is not Unicode becomes another one.
            if !decoded.contains('\u{fffd}') {
                let message = decode(frame.message, &padded(frame.payload));
                let again = encode(frame.message, &message, (0, 0));
                let again = again.map(|bytes| decode(frame.message, &bytes).to_string());
                assert_eq!(again.ok(), Some(decoded), "{}", frame.message.name);
            }
        });
    }
    frames
}
