//! Frames: how messages of the protocol stand in the bytes of standard input and output.
//!
//! A frame that cannot be understood is answered by an error, and the next one is read: the client may go on.
//! Frames are read here, and not by `lsp-server`, which ends at the first one that is not a message.

use std::fmt;
use std::io::{self, BufRead, Read, Write};
use std::sync::mpsc;

use lsp_server::{ErrorCode, Message};
use serde_json::{Value, json};

/// Bytes of a message that are read at most.
const MAX_MESSAGE: u64 = 256 << 20;
/// Bytes of a line of a header that are read at most.
const MAX_HEADER_LINE: u64 = 4096;

/// Reason why a frame is not a message.
#[derive(Debug)]
pub(super) enum FrameError {
    /// The header does not say how long the message is.
    NoLength,
    /// The message is longer than the server reads.
    TooLong(u64),
    /// The message is not JSON in UTF-8, or nests too deeply.
    NotJson(serde_json::Error),
    /// The message is an array: the protocol has no batches.
    Batch,
    /// The message is neither a request nor a notification nor an answer. It may have an id.
    NotAMessage(Value),
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FrameError::NoLength => f.write_str("expected a header with `Content-Length: NUMBER`"),
            FrameError::TooLong(length) => {
                write!(f, "a message of {length} bytes is too long: at most {MAX_MESSAGE} are read")
            }
            FrameError::NotJson(error) => write!(f, "the message is not JSON: {error}"),
            FrameError::Batch => {
                f.write_str("batches are not part of the protocol; send one message a frame")
            }
            FrameError::NotAMessage(_) => f.write_str(
                "expected a request or a notification: an object with a `method`, and an `id` that is a \
                 string or an integer of 32 bits",
            ),
        }
    }
}

impl FrameError {
    /// Returns the answer to the client.
    pub(super) fn answer(&self) -> Value {
        let code = match self {
            FrameError::NoLength | FrameError::NotJson(_) => ErrorCode::ParseError,
            FrameError::TooLong(_) | FrameError::Batch | FrameError::NotAMessage(_) => {
                ErrorCode::InvalidRequest
            }
        };
        let id = match self {
            FrameError::NotAMessage(message) => message.get("id").cloned(),
            _ => None,
        };
        let id = id.filter(|id| id.is_string() || id.is_number()).unwrap_or_default();
        json!({ "jsonrpc": "2.0", "id": id, "error": { "code": code as i32, "message": self.to_string() } })
    }
}

/// Reads the next frame; `None` at the end of the input.
///
/// # Errors
/// The input cannot be read.
pub(super) fn read_frame(input: &mut impl BufRead) -> io::Result<Option<Result<Message, FrameError>>> {
    let Some(length) = read_header(input)? else { return Ok(None) };
    let Some(length) = length else { return Ok(Some(Err(FrameError::NoLength))) };
    if length > MAX_MESSAGE {
        io::copy(&mut input.take(length), &mut io::sink())?;
        return Ok(Some(Err(FrameError::TooLong(length))));
    }
    // Memory is taken as bytes come, whatever the header says.
    let mut bytes = Vec::new();
    if (input.take(length).read_to_end(&mut bytes)? as u64) < length {
        return Ok(None);
    }
    Ok(Some(message(&bytes)))
}

fn message(bytes: &[u8]) -> Result<Message, FrameError> {
    let value: Value = serde_json::from_slice(bytes).map_err(FrameError::NotJson)?;
    if value.is_array() {
        return Err(FrameError::Batch);
    }
    let has = |key| value.get(key).is_some();
    // A message with an id that the protocol does not know would pass for a notification.
    let is_whole = value["method"].is_string() || has("id") && (has("result") || has("error"));
    let has_id = has("id") && value["method"].is_string();
    match serde_json::from_value(value.clone()) {
        Ok(Message::Notification(_)) if has_id => Err(FrameError::NotAMessage(value)),
        Ok(message) if is_whole => Ok(message),
        _ => Err(FrameError::NotAMessage(value)),
    }
}

/// Reads a header up to its empty line. Returns the length that it gives, or `Some(None)` if it gives none;
/// `None` at the end of the input.
fn read_header(input: &mut impl BufRead) -> io::Result<Option<Option<u64>>> {
    let mut length = None;
    let mut is_faulty = false;
    loop {
        let mut line = Vec::new();
        input.take(MAX_HEADER_LINE).read_until(b'\n', &mut line)?;
        if line.is_empty() {
            return Ok(None);
        }
        if line.last() != Some(&b'\n') {
            // The rest of a line that is too long. No header is.
            is_faulty = true;
            while !line.is_empty() && line.last() != Some(&b'\n') {
                line.clear();
                input.take(MAX_HEADER_LINE).read_until(b'\n', &mut line)?;
            }
            continue;
        }
        let text = String::from_utf8_lossy(&line);
        match text.trim().split_once(':') {
            Some((name, value)) if name.trim().eq_ignore_ascii_case("content-length") => {
                // Lines before it that were not headers are forgotten.
                length = value.trim().parse().ok();
                is_faulty = length.is_none();
            }
            Some(_) => {}
            None if !text.trim().is_empty() => is_faulty = true,
            None if length.is_some() || is_faulty => return Ok(Some(length)),
            // An empty line between frames.
            None => {}
        }
    }
}

/// Starts a thread that writes messages to standard output, so that reading does not wait for it.
pub(super) fn start_writer() -> (mpsc::Sender<Value>, std::thread::JoinHandle<io::Result<()>>) {
    let (sender, coming) = mpsc::channel::<Value>();
    let write = move || {
        let mut out = io::stdout().lock();
        for message in coming {
            let text = message.to_string();
            write!(out, "Content-Length: {}\r\n\r\n{text}", text.len())?;
            out.flush()?;
        }
        Ok(())
    };
    (sender, std::thread::spawn(write))
}

/// Returns a message as it is sent.
pub(super) fn sent(message: Message) -> Value {
    let mut value = serde_json::to_value(message).unwrap_or_default();
    value["jsonrpc"] = "2.0".into();
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The answers and methods of all frames of an input.
    fn told(input: &[u8]) -> Vec<String> {
        let mut input = input;
        let mut told = Vec::new();
        while let Some(frame) = read_frame(&mut input).expect("a slice can be read") {
            told.push(match frame {
                Ok(Message::Request(request)) => request.method,
                Ok(Message::Notification(notification)) => notification.method,
                Ok(Message::Response(_)) => "an answer".into(),
                Err(error) => {
                    let answer = error.answer();
                    format!("{} {}", answer["error"]["code"], answer["id"])
                }
            });
        }
        told
    }

    fn frame(body: &[u8]) -> Vec<u8> {
        [format!("Content-Length: {}\r\n\r\n", body.len()).as_bytes(), body].concat()
    }

    #[test]
    fn what_is_not_a_message_is_answered_and_the_next_one_is_read() {
        let deep = format!("{{\"method\":\"a\",\"params\":{}{}}}", "[".repeat(128), "]".repeat(128));
        for (body, expected) in [
            (&b"{\"method\":"[..], "-32700 null"),
            (b"hello", "-32700 null"),
            (b"", "-32700 null"),
            (b"{\"method\":\"\xff\"}", "-32700 null"),
            (deep.as_bytes(), "-32700 null"),
            (b"[]", "-32600 null"),
            (b"[{\"id\":1,\"method\":\"a\"}]", "-32600 null"),
            (b"5", "-32600 null"),
            (b"{\"id\":7}", "-32600 7"),
            (b"{\"id\":7,\"method\":3}", "-32600 7"),
            (b"{\"id\":4294967296,\"method\":\"a\"}", "-32600 4294967296"),
            (b"{\"id\":1.5,\"method\":\"a\"}", "-32600 1.5"),
            (b"{\"id\":null,\"method\":\"a\"}", "-32600 null"),
            (b"{\"id\":\"x\",\"method\":\"a\"}", "a"),
            (b"{\"id\":1,\"result\":null}", "an answer"),
        ] {
            let input = [frame(body), frame(b"{\"method\":\"next\"}")].concat();
            assert_eq!(told(&input), [expected, "next"], "{}", String::from_utf8_lossy(body));
        }
    }

    #[test]
    fn headers_that_say_no_length_are_left_behind() {
        let next = frame(b"{\"method\":\"next\"}");
        for header in [
            &b"Content-Type: x\r\nnonsense\r\n\r\n"[..],
            b"Content-Length: many\r\n\r\n",
            b"Content-Length: -1\r\n\r\n",
            &[vec![b'x'; 10_000], b"\r\n\r\n".to_vec()].concat(),
        ] {
            assert_eq!(told(&[header, &next].concat()), ["-32700 null", "next"]);
        }
        assert_eq!(
            told(&[b"\r\n\ncontent-length:17\n\n{\"method\":\"next\"}", &*next].concat()),
            ["next"; 2]
        );
        assert_eq!(told(&[b"garbage\n", &*next].concat()), ["next"], "the length counts");
        assert!(told(b"Content-Length: 99\r\n\r\n{}").is_empty(), "the input ends first");
        let long = [format!("Content-Length: {}\r\n\r\n", MAX_MESSAGE + 1).as_bytes(), b"{}"].concat();
        assert_eq!(told(&long), ["-32600 null"]);
    }
}
