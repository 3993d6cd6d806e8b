//! Any bytes as a file, for fuzz targets and tests.

use std::io::Cursor;

use super::decode::MessageForm;
use super::file::McapFile;
use super::order::{McapSelection, OrderedMessages};

/// Takes bytes as a file, and behind the magic bytes of one: reads all that can be read. Returns the number
/// of messages.
///
/// # Panics
/// Messages of one selection are not in the order of their times.
pub fn understand(bytes: &[u8]) -> usize {
    let with_magic = [mcap::MAGIC, bytes].concat();
    read(bytes) + read(&with_magic)
}

fn read(bytes: &[u8]) -> usize {
    let Ok(file) = McapFile::of(Cursor::new(bytes)) else { return 0 };
    let mut files = [file];
    let mut messages = OrderedMessages::new(&files, McapSelection::default());
    let mut count = 0;
    while let Ok(Some(message)) = messages.next(&mut files) {
        _ = MessageForm::of(&message.channel).decode(&message.channel.topic, &message.data);
        count += 1;
        if count > 1000 {
            break;
        }
    }
    for record in files[0].index.attachments.clone() {
        _ = files[0].attachment(record.place);
    }
    for record in files[0].index.metadata.clone() {
        _ = files[0].metadata(record.place);
    }
    for damage in &files[0].index.damage {
        assert!(!damage.to_string().is_empty());
    }
    count
}
