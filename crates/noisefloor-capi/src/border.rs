//! From pointers of C to references and slices of Rust. All that can be checked is: a pointer is there, is
//! aligned, and leads to as many elements as are wanted. The rest is the caller's promise, which the header
//! asks for.

use crate::status::{Failure, NfStatus};
use noisefloor::TileGrid;
use std::ffi::{CStr, c_char};

pub(crate) fn check<T>(pointer: *const T, what: &str) -> Result<(), Failure> {
    if pointer.is_null() {
        return Err(Failure::new(NfStatus::NullPointer, format!("{what} is NULL")));
    }
    if !pointer.is_aligned() {
        return Err(Failure::new(NfStatus::NullPointer, format!("{what} is not aligned")));
    }
    Ok(())
}

/// An array of exactly `wanted` elements, of which the caller says that it has `got`.
///
/// # Safety
/// `pointer` leads to `got` elements that nothing changes during `'a`, if it is neither null nor misaligned.
pub(crate) unsafe fn array<'a, T>(
    pointer: *const T,
    got: usize,
    wanted: usize,
    what: &str,
) -> Result<&'a [T], Failure> {
    check(pointer, what)?;
    expect(got, wanted, what)?;
    // SAFETY: not null, aligned, and `got` elements long by the caller's promise; `wanted` is a size of ours,
    // below `isize::MAX` bytes.
    Ok(unsafe { std::slice::from_raw_parts(pointer, wanted) })
}

/// As [`array`], to be written.
///
/// # Safety
/// `pointer` leads to `got` elements that have values and that nothing else uses during `'a`, if it is
/// neither null nor misaligned.
pub(crate) unsafe fn array_mut<'a, T>(
    pointer: *mut T,
    got: usize,
    wanted: usize,
    what: &str,
) -> Result<&'a mut [T], Failure> {
    check(pointer, what)?;
    expect(got, wanted, what)?;
    // SAFETY: as in `array`, and nothing else uses it by the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, wanted) })
}

/// An array of at least `wanted` elements, to be written: the first `wanted` of `capacity`.
///
/// # Safety
/// As [`array_mut`], for `capacity` elements.
pub(crate) unsafe fn room<'a, T>(
    pointer: *mut T,
    capacity: usize,
    wanted: usize,
    what: &str,
) -> Result<&'a mut [T], Failure> {
    check(pointer, what)?;
    if capacity < wanted {
        let message = format!("{what} has {capacity} elements, and at least {wanted} are needed");
        return Err(Failure::new(NfStatus::Size, message));
    }
    // SAFETY: there are `capacity` elements by the caller's promise, which are enough.
    unsafe { array_mut(pointer, wanted, wanted, what) }
}

/// Channels of a pixel, of which the first three are colours.
pub(crate) fn channels(count: usize) -> Result<(), Failure> {
    let wrong = || Failure::new(NfStatus::Argument, format!("{count} channels: 3 to 64 are allowed"));
    if (3..=64).contains(&count) { Ok(()) } else { Err(wrong()) }
}

fn expect(got: usize, wanted: usize, what: &str) -> Result<(), Failure> {
    if got == wanted {
        return Ok(());
    }
    Err(Failure::new(NfStatus::Size, format!("{what} has {got} elements instead of {wanted}")))
}

/// One object.
///
/// # Safety
/// `pointer` leads to an object that nothing changes during `'a`, if it is neither null nor misaligned.
pub(crate) unsafe fn object<'a, T>(pointer: *const T, what: &str) -> Result<&'a T, Failure> {
    check(pointer, what)?;
    // SAFETY: not null, aligned, and alive by the caller's promise.
    Ok(unsafe { &*pointer })
}

/// Writes one result.
///
/// # Safety
/// `pointer` leads to memory for one `T`, if it is neither null nor misaligned.
pub(crate) unsafe fn write<T>(pointer: *mut T, value: T, what: &str) -> Result<(), Failure> {
    check(pointer, what)?;
    // SAFETY: not null, aligned, and memory for a `T` by the caller's promise. It may be uninitialised:
    // nothing is dropped.
    unsafe { pointer.write(value) };
    Ok(())
}

/// Text.
///
/// # Safety
/// `pointer` leads to bytes that end with a zero and that nothing changes during `'a`, if it is not null.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, Failure> {
    check(pointer, what)?;
    // SAFETY: not null, and ended by a zero by the caller's promise.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| Failure::new(NfStatus::Argument, format!("{what} is not UTF-8")))
}

/// Writes text, cut to `bytes` - 1 bytes between two characters and ended by a zero.
///
/// # Safety
/// As [`array_mut`], for `bytes` elements.
pub(crate) unsafe fn write_text(
    pointer: *mut c_char,
    bytes: usize,
    text: &str,
    what: &str,
) -> Result<(), Failure> {
    // SAFETY: promised by the caller.
    let room = unsafe { self::room(pointer, bytes, bytes.max(1), what) }?;
    let most = text.len().min(room.len() - 1);
    let cut = (0..=most).rev().find(|&n| text.is_char_boundary(n)).unwrap_or(0);
    for (place, byte) in room.iter_mut().zip(text.as_bytes()[..cut].iter().chain([&0])) {
        *place = *byte as c_char;
    }
    Ok(())
}

/// Checks that there is memory for so many bytes a pixel of the picture, which a call is going to take: where
/// an allocation fails in the middle of one, the process ends.
pub(crate) fn memory(grid: TileGrid, bytes_a_pixel: usize) -> Result<(), Failure> {
    let (width, height) = grid.size();
    let bytes = width * height * bytes_a_pixel;
    Vec::<u8>::new().try_reserve_exact(bytes).map_err(|_| {
        let what =
            format!("work on {width}x{height} pixels takes {bytes} bytes of memory, more than there is");
        Failure::new(NfStatus::Memory, what)
    })
}
