//! The attachment of a message of `rmw_zenoh`: its number, the time at which it was sent, and the name of its
//! sender.

use std::time::{SystemTime, UNIX_EPOCH};

use esl_bytecode::Bytes;

/// Bytes of the name of a publisher or a client.
const GID: usize = 16;

/// Number, time and sender of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MessageAttachment {
    /// Number of the message among those of its sender.
    pub(super) number: i64,
    /// Nanoseconds since 1970.
    pub(super) time: i64,
    /// Name of the sender.
    pub(super) gid: [u8; GID],
}

impl MessageAttachment {
    /// Returns the attachment of a message that is sent now.
    pub(super) fn now(number: i64, gid: [u8; GID]) -> MessageAttachment {
        let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        MessageAttachment { number, time: i64::try_from(time.as_nanos()).unwrap_or(i64::MAX), gid }
    }

    /// Returns the bytes: two little-endian integers, the length of the name, and the name.
    pub(super) fn encode(&self) -> Bytes {
        let mut bytes = Vec::with_capacity(17 + GID);
        bytes.extend(self.number.to_le_bytes());
        bytes.extend(self.time.to_le_bytes());
        bytes.push(GID as u8);
        bytes.extend(self.gid);
        bytes.into()
    }

    /// Returns the attachment that bytes stand for, if they have the form of one.
    pub(super) fn decode(bytes: &[u8]) -> Option<MessageAttachment> {
        let (number, rest) = bytes.split_first_chunk()?;
        let (time, rest) = rest.split_first_chunk()?;
        let (&length, gid) = rest.split_first()?;
        if usize::from(length) != GID {
            return None;
        }
        Some(MessageAttachment {
            number: i64::from_le_bytes(*number),
            time: i64::from_le_bytes(*time),
            gid: gid.try_into().ok()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attachment_has_33_bytes_in_the_order_of_rmw_zenoh() {
        let attachment = MessageAttachment { number: 2, time: 0x0102_0304, gid: [7; GID] };
        let bytes = attachment.encode();
        assert_eq!(bytes.len(), 33);
        assert_eq!(bytes[..17], [2, 0, 0, 0, 0, 0, 0, 0, 4, 3, 2, 1, 0, 0, 0, 0, 16]);
        assert_eq!(MessageAttachment::decode(&bytes), Some(attachment));
        for length in 0..bytes.len() {
            assert_eq!(MessageAttachment::decode(&bytes[..length]), None);
        }
        let mut other = bytes.to_vec();
        other[16] = 17;
        assert_eq!(MessageAttachment::decode(&other), None);
    }
}
