//! Content codings of answers: gzip and deflate, decoded as the body comes.
//!
//! Guarantees: a piece of [`PIECE`] bytes is decoded at a time, which is at most a thousand times as long
//! then, so a body that grows without end is noticed when it has grown beyond the limit of the program's.

use std::io::{Error, ErrorKind, Write};

use flate2::write::MultiGzDecoder;
use flate2::{Decompress, FlushDecompress, Status};

/// Bytes that are decoded at a time.
pub(super) const PIECE: usize = 4096;

/// Codings that this client understands, as `Accept-Encoding` names them.
pub(super) const ACCEPTED: &str = "gzip, deflate";

/// How the body of an answer is coded.
pub(super) enum Coding {
    Identity,
    /// Nothing before the first byte: a body without any is empty.
    Gzip(Option<Box<MultiGzDecoder<Vec<u8>>>>),
    /// RFC 9110 means the format of zlib; some servers send what is inside of it. The first byte tells.
    Deflate(Option<Box<Inflater>>),
}

/// A body in deflate that is being decoded.
pub(super) struct Inflater {
    machine: Decompress,
    is_whole: bool,
}

impl Coding {
    /// Returns the coding of a name in `Content-Encoding`; `None` if it is unknown.
    pub(super) fn named(name: &str) -> Option<Coding> {
        match name.trim().to_ascii_lowercase().as_str() {
            "" | "identity" => Some(Coding::Identity),
            "gzip" | "x-gzip" => Some(Coding::Gzip(None)),
            "deflate" => Some(Coding::Deflate(None)),
            _ => None,
        }
    }

    /// Returns whether a body is as it comes.
    pub(super) fn is_identity(&self) -> bool {
        matches!(self, Coding::Identity)
    }

    /// Decodes the next bytes of a body.
    pub(super) fn decode(&mut self, bytes: &[u8]) -> Result<Vec<u8>, Error> {
        match self {
            Coding::Identity => Ok(bytes.to_vec()),
            Coding::Gzip(decoder) => {
                let decoder = decoder.get_or_insert_with(|| Box::new(MultiGzDecoder::new(Vec::new())));
                decoder.write_all(bytes)?;
                Ok(std::mem::take(decoder.get_mut()))
            }
            Coding::Deflate(inflater) => {
                let Some(&first) = bytes.first() else { return Ok(Vec::new()) };
                // The low half of a header of zlib is 8; no encoder begins a bare stream so.
                let has_header = first & 0x0F == 8;
                let inflater = inflater.get_or_insert_with(|| {
                    Box::new(Inflater { machine: Decompress::new(has_header), is_whole: false })
                });
                inflater.decode(bytes)
            }
        }
    }

    /// Returns the last bytes of a body, of which all has been given.
    pub(super) fn finish(&mut self) -> Result<Vec<u8>, Error> {
        match self {
            Coding::Gzip(Some(decoder)) => {
                decoder.try_finish()?;
                Ok(std::mem::take(decoder.get_mut()))
            }
            Coding::Deflate(Some(inflater)) if !inflater.is_whole => Err(ErrorKind::UnexpectedEof.into()),
            Coding::Identity | Coding::Gzip(None) | Coding::Deflate(_) => Ok(Vec::new()),
        }
    }
}

impl Inflater {
    fn decode(&mut self, bytes: &[u8]) -> Result<Vec<u8>, Error> {
        let mut decoded = Vec::new();
        let mut rest = bytes;
        while !self.is_whole {
            decoded.reserve(PIECE);
            let (before, length) = (self.machine.total_in(), decoded.len());
            let status = self.machine.decompress_vec(rest, &mut decoded, FlushDecompress::None)?;
            let used = usize::try_from(self.machine.total_in() - before).unwrap_or(rest.len());
            rest = &rest[used..];
            self.is_whole = status == Status::StreamEnd;
            // It may take nothing while it gives what it has kept.
            if used == 0 && decoded.len() == length && !self.is_whole {
                return Ok(decoded);
            }
        }
        if rest.is_empty() { Ok(decoded) } else { Err(Error::other("bytes follow the end")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::{DeflateEncoder, GzEncoder, ZlibEncoder};

    /// Decodes a body, in pieces of so many bytes.
    fn decoded(name: &str, body: &[u8], size: usize) -> Result<Vec<u8>, Error> {
        let mut coding = Coding::named(name).expect("it is known");
        let mut all = Vec::new();
        for piece in body.chunks(size) {
            all.extend(coding.decode(piece)?);
        }
        all.extend(coding.finish()?);
        Ok(all)
    }

    #[test]
    fn bodies_are_decoded_in_pieces_and_must_be_whole() {
        let text: Vec<u8> = (0..50_000_u32).flat_map(|number| number.to_le_bytes()).collect();
        let level = Compression::default();
        let mut gzip = GzEncoder::new(Vec::new(), level);
        let mut zlib = ZlibEncoder::new(Vec::new(), level);
        let mut bare = DeflateEncoder::new(Vec::new(), level);
        for encoder in [&mut gzip as &mut dyn Write, &mut zlib, &mut bare] {
            encoder.write_all(&text).expect("there is room");
        }
        let bodies = [
            ("gzip", gzip.finish().expect("there is room")),
            ("deflate", zlib.finish().expect("there is room")),
            ("Deflate ", bare.finish().expect("there is room")),
        ];
        for (name, body) in bodies {
            for size in [1, 7, PIECE, body.len()] {
                assert!(decoded(name, &body, size).is_ok_and(|decoded| decoded == text), "{name} {size}");
            }
            for cut in [body.len() / 2, body.len() - 1] {
                assert!(decoded(name, &body[..cut], PIECE).is_err(), "{name} {cut}");
            }
            assert!(decoded(name, &[&body[..], b"more"].concat(), PIECE).is_err(), "{name}");
            assert!(decoded(name, b"", 1).is_ok_and(|decoded| decoded.is_empty()), "{name}");
        }
        assert!(decoded("deflate", b"xnonsense", 3).is_err());
        assert!(decoded("gzip", b"nonsense nonsense", 3).is_err());
        assert_eq!(decoded("identity", b"as it is", 3).ok().as_deref(), Some(&b"as it is"[..]));
        assert!(Coding::named("br").is_none() && Coding::named("gzip, gzip").is_none());
    }

    #[test]
    fn what_a_piece_may_become_is_bounded() {
        let mut gzip = GzEncoder::new(Vec::new(), Compression::best());
        gzip.write_all(&vec![0; 64 << 20]).expect("there is room");
        let body = gzip.finish().expect("there is room");
        let mut coding = Coding::named("gzip").expect("it is known");
        let most = body.chunks(PIECE).map(|piece| coding.decode(piece).expect("it is right").len()).max();
        assert!(most.is_some_and(|most| most < 5 << 20), "{most:?}");
    }
}
