//! Files of this library, and of its neighbours.
//!
//! Layout: magic (8 bytes), version (u32), length of the payload (u64), BLAKE3 of the payload (32 bytes),
//! payload (bincode 2, standard configuration); numbers little-endian. A body can follow, and BLAKE3 of it
//! (32 bytes). All use of bincode is in this module. Other crates give payloads of their own.

use bincode::error::DecodeError;
use serde::{Serialize, de::DeserializeOwned};
use std::io::{self, Read, Write};

/// Largest payload that is read or written: the paper's own model, 9,600 pairs of 2·128² numbers, would have
/// 1.26 GB.
pub(crate) const MAX_PAYLOAD: u64 = 2 << 30;

/// A kind of file.
pub struct Format {
    /// First bytes.
    pub magic: [u8; 8],
    /// The version that is written, and the only one that is read.
    pub version: u32,
}

/// What is wrong with a file.
#[derive(Debug)]
pub enum FileFault {
    /// It cannot be read or written.
    Io(io::Error),
    /// It does not begin with the magic.
    Foreign,
    /// It has this version.
    Version(u32),
    /// Its content is not what was written.
    Damaged(String),
    /// Its payload has, or announces, this many bytes.
    Oversized(u64),
}

impl From<io::Error> for FileFault {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl Format {
    /// Reads what [`Format::write`] wrote.
    pub(crate) fn read<T: DeserializeOwned>(&self, mut from: impl Read) -> Result<T, FileFault> {
        let content = self.read_payload(&mut from)?;
        end(from)?;
        Ok(content)
    }

    /// Reads what [`Format::write_with_body`] wrote: `body` turns the payload, and the bytes after it, into
    /// the content, and is answered for by the checksum after them.
    pub(crate) fn read_with_body<H: DeserializeOwned, T>(
        &self,
        mut from: impl Read,
        body: impl FnOnce(H, &mut dyn Read) -> Result<T, FileFault>,
    ) -> Result<T, FileFault> {
        let head = self.read_payload(&mut from)?;
        let mut hashed = Hashed::new(&mut from);
        let content = body(head, &mut hashed)?;
        let (computed, mut checksum) = (hashed.hasher.finalize(), [0; 32]);
        if !read_up_to(&mut from, &mut checksum)? || *computed.as_bytes() != checksum {
            return Err(FileFault::Damaged("its checksum differs".into()));
        }
        end(from)?;
        Ok(content)
    }

    fn read_payload<T: DeserializeOwned>(&self, from: &mut impl Read) -> Result<T, FileFault> {
        unpack(&self.read_bytes(from, MAX_PAYLOAD)?)
    }

    /// Reads the payload, of at most `limit` bytes, and leaves what follows it.
    ///
    /// # Errors
    /// [`FileFault`].
    pub fn read_bytes(&self, from: &mut impl Read, limit: u64) -> Result<Vec<u8>, FileFault> {
        // Read the header. A file too short to have one is foreign.
        let mut magic = [0; 8];
        let whole = read_up_to(from, &mut magic)?;
        if !whole || magic != self.magic {
            return Err(FileFault::Foreign);
        }
        let mut header = [0; 4 + 8 + 32];
        if !read_up_to(from, &mut header)? {
            return Err(FileFault::Damaged("it ends within its header".into()));
        }
        let (version, rest) = header.split_at(4);
        let (length, checksum) = rest.split_at(8);
        let version = u32::from_le_bytes(version.try_into().unwrap_or_default());
        if version != self.version {
            return Err(FileFault::Version(version));
        }
        let length = u64::from_le_bytes(length.try_into().unwrap_or_default());
        if length > limit {
            return Err(FileFault::Oversized(length));
        }

        // Read the payload as far as there is one: memory grows with what arrives, not with what is
        // announced.
        let mut payload = Vec::new();
        from.take(length).read_to_end(&mut payload)?;
        if (payload.len() as u64) < length {
            return Err(FileFault::Damaged(format!("it ends before the {length} bytes it announces")));
        }
        if blake3::hash(&payload).as_bytes() != checksum {
            return Err(FileFault::Damaged("its checksum differs".into()));
        }
        Ok(payload)
    }

    pub(crate) fn write(&self, content: &impl Serialize, mut to: impl Write) -> Result<(), FileFault> {
        let payload = payload(content)?;
        if payload.len() as u64 > MAX_PAYLOAD {
            return Err(FileFault::Oversized(payload.len() as u64));
        }
        Ok(self.write_bytes(&payload, &mut to)?)
    }

    /// Writes a payload. What follows it is up to the caller.
    ///
    /// # Errors
    /// Those of `to`.
    pub fn write_bytes(&self, payload: &[u8], mut to: impl Write) -> io::Result<()> {
        to.write_all(&self.magic)?;
        to.write_all(&self.version.to_le_bytes())?;
        to.write_all(&(payload.len() as u64).to_le_bytes())?;
        to.write_all(blake3::hash(payload).as_bytes())?;
        to.write_all(payload)
    }

    /// Writes a file whose payload is followed by what `body` writes, and by BLAKE3 of that. The body is
    /// not held in memory.
    pub(crate) fn write_with_body(
        &self,
        head: &impl Serialize,
        mut to: impl Write,
        body: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), FileFault> {
        self.write(head, &mut to)?;
        let mut hashed = Hashed::new(&mut to);
        body(&mut hashed)?;
        let checksum = hashed.hasher.finalize();
        to.write_all(checksum.as_bytes())?;
        Ok(())
    }
}

/// Passes bytes on, and computes BLAKE3 of them.
struct Hashed<S> {
    stream: S,
    hasher: blake3::Hasher,
}

impl<S> Hashed<S> {
    fn new(stream: S) -> Self {
        Self { stream, hasher: blake3::Hasher::new() }
    }
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.stream.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

impl<R: Read> Read for Hashed<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.stream.read(buffer)?;
        self.hasher.update(&buffer[..read]);
        Ok(read)
    }
}

/// Makes sure that nothing follows.
fn end(mut from: impl Read) -> Result<(), FileFault> {
    if read_up_to(&mut from, &mut [0])? {
        return Err(FileFault::Damaged("it goes on after its end".into()));
    }
    Ok(())
}

/// The content of bytes that [`payload`] returned.
pub(crate) fn unpack<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, FileFault> {
    // A length inside the payload is believed up to bincode's limit, which is part of a type and counts
    // numbers by their size in memory: up to sixteen times that in the payload. The least limit above that
    // bounds what a short, crafted payload can reserve.
    match bytes.len().saturating_mul(16) {
        0..=0x10_0000 => unpack_within::<T, 0x10_0000>(bytes),
        0x10_0001..=0x100_0000 => unpack_within::<T, 0x100_0000>(bytes),
        0x100_0001..=0x1000_0000 => unpack_within::<T, 0x1000_0000>(bytes),
        _ => unpack_within::<T, { MAX_PAYLOAD as usize }>(bytes),
    }
}

fn unpack_within<T: DeserializeOwned, const LIMIT: usize>(bytes: &[u8]) -> Result<T, FileFault> {
    let config = bincode::config::standard().with_limit::<LIMIT>();
    let (content, used) = bincode::serde::decode_from_slice(bytes, config).map_err(|error| match error {
        // What a type of ours says of its content
        DecodeError::OtherString(what) => FileFault::Damaged(what),
        error => FileFault::Damaged(error.to_string()),
    })?;
    if used != bytes.len() {
        return Err(FileFault::Damaged("it has bytes left over".into()));
    }
    Ok(content)
}

/// The content as bytes, without a header.
pub(crate) fn payload(content: &impl Serialize) -> Result<Vec<u8>, FileFault> {
    bincode::serde::encode_to_vec(content, bincode::config::standard())
        .map_err(|e| FileFault::Damaged(e.to_string()))
}

/// Fills the buffer; false if the input ends before.
fn read_up_to(from: &mut impl Read, buffer: &mut [u8]) -> Result<bool, io::Error> {
    match from.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(e) => Err(e),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A string that claims more bytes than the payload has is refused before memory for it is reserved.
    #[test]
    fn a_crafted_length_reserves_nothing() {
        for length in [100, 0x8000, 0x2_0000] {
            // A length as bincode writes it: 252 for four bytes to follow
            let mut crafted = vec![0u8; length];
            crafted[..5].copy_from_slice(&[252, 0, 0, 0, 0x60]);
            let Err(FileFault::Damaged(what)) = unpack::<String>(&crafted) else { panic!("{length}") };
            assert!(what.contains("LimitExceeded"), "{length}: {what}");
        }
        // One byte each in the payload, eight in memory
        for count in [1000, 0xfff0, 0x10_0000] {
            let whole = payload(&vec![7u64; count]).unwrap_or_default();
            assert!(unpack::<Vec<u64>>(&whole).is_ok_and(|read| read.len() == count), "{count}");
        }
    }
}
