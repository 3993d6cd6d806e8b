//! Packets: six hexadecimal digits with the length in bytes of the form that follows.
//!
//! Source: the protocol of SLIME's server, SWANK.

use std::io::{self, Error, ErrorKind, Read, Write};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt};

use super::form::WireForm;

/// Most bytes of a packet.
pub(crate) const LARGEST: usize = 1 << 20;

fn length(head: [u8; 6]) -> io::Result<usize> {
    let text = std::str::from_utf8(&head).ok().filter(|text| text.bytes().all(|b| b.is_ascii_hexdigit()));
    let length = text.and_then(|text| usize::from_str_radix(text, 16).ok());
    length.filter(|&length| length <= LARGEST).ok_or(Error::from(ErrorKind::InvalidData))
}

/// Reads a packet, on the event loop.
///
/// # Errors
/// If the connection ends, or it is not a packet of at most `most` bytes of text.
pub(super) async fn read_async(from: &mut (impl AsyncRead + Unpin), most: usize) -> io::Result<String> {
    let first = from.read_u8().await?;
    read_rest(first, from, most).await
}

/// As [`read_async`]; once the packet has begun, it comes within `time`.
///
/// # Errors
/// As [`read_async`], or that it does not.
pub(super) async fn read_in_time(
    from: &mut (impl AsyncRead + Unpin),
    most: usize,
    time: Duration,
) -> io::Result<String> {
    let first = from.read_u8().await?;
    tokio::time::timeout(time, read_rest(first, from, most)).await?
}

async fn read_rest(first: u8, from: &mut (impl AsyncRead + Unpin), most: usize) -> io::Result<String> {
    let mut head = [first, 0, 0, 0, 0, 0];
    from.read_exact(&mut head[1..]).await?;
    let length = length(head)?;
    if length > most {
        return Err(ErrorKind::InvalidData.into());
    }
    // Room is made for what has come, not for what was announced.
    let mut bytes = Vec::new();
    from.take(length as u64).read_to_end(&mut bytes).await?;
    if bytes.len() < length {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    String::from_utf8(bytes).map_err(|_| ErrorKind::InvalidData.into())
}

/// Reads a packet.
///
/// # Errors
/// If the connection ends, or it is not a packet.
pub fn read(from: &mut impl Read) -> io::Result<WireForm> {
    let mut head = [0; 6];
    from.read_exact(&mut head)?;
    let mut bytes = vec![0; length(head)?];
    from.read_exact(&mut bytes)?;
    let text = String::from_utf8(bytes).map_err(|_| Error::from(ErrorKind::InvalidData))?;
    WireForm::parse(&text).map_err(|_| ErrorKind::InvalidData.into())
}

/// Writes a packet.
///
/// # Errors
/// If the connection has ended, or the form is too large.
pub fn write(to: &mut impl Write, form: &WireForm) -> io::Result<()> {
    let packet = packet(form).ok_or(Error::from(ErrorKind::InvalidData))?;
    to.write_all(&packet)?;
    to.flush()
}

/// Returns the packet of a form; `None` if it would be too large.
pub(super) fn packet(form: &WireForm) -> Option<Vec<u8>> {
    let text = format!("{form}\n");
    (text.len() <= LARGEST).then(|| format!("{:06x}{text}", text.len()).into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_is_read_as_it_was_written() {
        let form =
            WireForm::list([WireForm::symbol(":return"), WireForm::text("ü\n"), WireForm::Integer(-3)]);
        let mut bytes = Vec::new();
        write(&mut bytes, &form).expect("there is room");
        assert_eq!(bytes[..6], *b"000013");
        assert_eq!(read(&mut &bytes[..]).ok(), Some(form));
        for wrong in ["", "00000", "00000g(a)", "-00001a", "ffffff", "000002a", "000001("] {
            assert!(read(&mut wrong.as_bytes()).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_packet_that_has_begun_comes_in_time() {
        use tokio::io::AsyncWriteExt;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build();
        runtime.expect("there can be one").block_on(async {
            let (mut near, mut far) = tokio::io::duplex(64);
            near.write_all(b"000003(a)0000").await.expect("there is room");
            let time = Duration::from_millis(20);
            assert_eq!(read_in_time(&mut far, 100, time).await.ok().as_deref(), Some("(a)"));
            let late = read_in_time(&mut far, 100, time).await;
            assert_eq!(late.map_err(|error| error.kind()), Err(ErrorKind::TimedOut));
        });
    }

    /// An accepted packet is a form that can be written and read again; all others are refused.
    #[test]
    fn noise_is_a_form_or_refused() {
        const PIECES: [&str; 18] = [
            "(",
            "(",
            ")",
            ")",
            " ",
            ":emacs-rex",
            "swank:",
            "nil",
            "t",
            "\"",
            "\\",
            "1",
            "-",
            "'",
            "#",
            "|",
            "ü",
            "99999999999999999999",
        ];
        let mut state = 1_u64;
        let mut below = |count: usize| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 33) as usize % count
        };
        let mut forms = 0;
        for _ in 0..300_000 {
            let text: String = (0..below(14)).map(|_| PIECES[below(PIECES.len())]).collect();
            let length = if below(8) == 0 { below(64) } else { text.len() };
            let mut bytes = format!("{length:06x}{text}").into_bytes();
            if below(4) == 0 {
                let at = below(bytes.len());
                bytes[at] = below(256) as u8;
            }
            if let Ok(form) = read(&mut &bytes[..]) {
                let written = packet(&form).expect("it is small");
                assert_eq!(read(&mut &written[..]).ok(), Some(form), "{:?}", String::from_utf8_lossy(&bytes));
                forms += 1;
            }
        }
        assert!(forms > 10_000, "{forms}");
    }
}
