//! What a page needs beside the functions of the header: memory for arrays.

use std::alloc::{Layout, alloc, dealloc};

/// As much as any type of the header asks for, and what vector instructions like.
const ALIGN: usize = 16;

/// Memory for so many bytes, or 0 if there is none.
#[unsafe(no_mangle)]
pub extern "C" fn nf_alloc(bytes: usize) -> *mut u8 {
    match Layout::from_size_align(bytes.max(1), ALIGN) {
        // SAFETY: the size is not 0.
        Ok(layout) => unsafe { alloc(layout) },
        Err(_) => std::ptr::null_mut(),
    }
}

/// Takes memory of `nf_alloc` back, of the same size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn nf_dealloc(pointer: *mut u8, bytes: usize) {
    if let (false, Ok(layout)) = (pointer.is_null(), Layout::from_size_align(bytes.max(1), ALIGN)) {
        // SAFETY: `nf_alloc` gave it with this layout, as the caller promises.
        unsafe { dealloc(pointer, layout) }
    }
}
