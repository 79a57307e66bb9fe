//! Frames: two little-endian u32 (length of header, length of payload), a header in JSON, a raw payload.

use std::io::{self, Read, Write};
use thiserror::Error;

/// Longest header in bytes, either way.
pub(crate) const MAX_HEADER: usize = 1 << 20;

#[derive(Debug)]
pub(crate) struct Frame {
    /// Bytes that should be a JSON object.
    pub(crate) header: Vec<u8>,
    pub(crate) payload: Vec<u8>,
}

/// Why no frame could be read.
#[derive(Debug, Error)]
pub(crate) enum FrameError {
    /// The stream ended, before a frame or within one.
    #[error("the stream ended")]
    End,
    /// The system failed.
    #[error(transparent)]
    Io(io::Error),
    /// A length is over its limit; nothing was allocated.
    #[error("it announced a {part} of {bytes} bytes where at most {most} are allowed")]
    Long { part: &'static str, bytes: usize, most: usize },
}

/// Writes a frame. Only requests to filters have a payload.
pub(crate) fn write(to: &mut impl Write, header: &[u8], payload: &[u8]) -> io::Result<()> {
    for part in [header, payload] {
        let length = u32::try_from(part.len()).map_err(|_| io::ErrorKind::InvalidInput)?;
        to.write_all(&length.to_le_bytes())?;
    }
    to.write_all(header)?;
    to.write_all(payload)?;
    to.flush()
}

/// Reads a frame with at most `most_payload` bytes of payload. Memory grows with what arrives, not with what
/// is announced.
pub(crate) fn read(from: &mut impl Read, most_payload: usize) -> Result<Frame, FrameError> {
    let prefix = exactly(from, 8)?;
    let length = |at: usize| {
        let bytes = prefix.get(at..at + 4).and_then(|b| b.try_into().ok()).unwrap_or_default();
        usize::try_from(u32::from_le_bytes(bytes)).unwrap_or(usize::MAX)
    };
    for (part, bytes, most) in [("header", length(0), MAX_HEADER), ("payload", length(4), most_payload)] {
        if bytes > most {
            return Err(FrameError::Long { part, bytes, most });
        }
    }
    Ok(Frame { header: exactly(from, length(0))?, payload: exactly(from, length(4))? })
}

fn exactly(from: &mut impl Read, bytes: usize) -> Result<Vec<u8>, FrameError> {
    let mut buffer = Vec::new();
    from.take(bytes as u64).read_to_end(&mut buffer).map_err(FrameError::Io)?;
    if buffer.len() == bytes { Ok(buffer) } else { Err(FrameError::End) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(header: u32, payload: u32, rest: &[u8]) -> Vec<u8> {
        [&header.to_le_bytes()[..], &payload.to_le_bytes(), rest].concat()
    }

    #[test]
    fn a_frame_is_two_lengths_a_header_and_a_payload() {
        let mut bytes = Vec::new();
        write(&mut bytes, b"{}", b"").unwrap();
        assert_eq!(bytes, [2, 0, 0, 0, 0, 0, 0, 0, b'{', b'}']);
        let mut with_payload = Vec::new();
        write(&mut with_payload, b"{}", b"ab").unwrap();
        assert_eq!(with_payload, [2, 0, 0, 0, 2, 0, 0, 0, b'{', b'}', b'a', b'b']);
        let two = [frame(2, 3, b"{}abc"), bytes].concat();
        let mut from = two.as_slice();
        let first = read(&mut from, 3).unwrap();
        assert_eq!((first.header.as_slice(), first.payload.as_slice()), (&b"{}"[..], &b"abc"[..]));
        assert_eq!(read(&mut from, 0).unwrap().header, b"{}");
        assert!(matches!(read(&mut from, 0), Err(FrameError::End)));
    }

    #[test]
    fn lengths_are_refused_before_anything_is_read() {
        for (bytes, part) in [
            (frame(u32::MAX, 0, &[]), "header"),
            (frame(MAX_HEADER as u32 + 1, 0, &[]), "header"),
            (frame(2, u32::MAX, &[]), "payload"),
            (frame(2, 13, &[]), "payload"),
        ] {
            let Err(FrameError::Long { part: named, .. }) = read(&mut bytes.as_slice(), 12) else { panic!() };
            assert_eq!(named, part);
        }
    }

    /// A stream cut anywhere is at its end, and takes no more memory than it has bytes.
    #[test]
    fn cut_frames_are_ends() {
        let whole = frame(2, 4, b"{}abcd");
        for cut in 0..whole.len() {
            assert!(matches!(read(&mut &whole[..cut], 4), Err(FrameError::End)), "cut at {cut}");
        }
        let lie = frame(2, 1 << 31, b"{}abcd");
        assert!(matches!(read(&mut lie.as_slice(), usize::MAX), Err(FrameError::End)));
    }
}
