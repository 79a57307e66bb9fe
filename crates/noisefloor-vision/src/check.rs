//! What pictures have to be.

use crate::error::VisionError;
use crate::pyramid::Size;
use multiversion::multiversion;

/// Most pixels of a picture.
const MOST: usize = 1 << 28;

pub(crate) fn checked(width: usize, height: usize) -> Result<Size, VisionError> {
    let fits = width.checked_mul(height).is_some_and(|area| area <= MOST);
    if width < 2 || height < 2 || !fits {
        return Err(VisionError::Size { width, height });
    }
    Ok(Size { width, height })
}

pub(crate) fn check_pixels(pixels: &[[f32; 3]], size: Size) -> Result<(), VisionError> {
    check(pixels.as_flattened(), size, 3)
}

pub(crate) fn check_values(values: &[f32], size: Size) -> Result<(), VisionError> {
    check(values, size, 1)
}

fn check(values: &[f32], size: Size, a_pixel: usize) -> Result<(), VisionError> {
    let Size { width, height } = size;
    if values.len() != size.area() * a_pixel {
        return Err(VisionError::Length { width, height, found: values.len() / a_pixel });
    }
    if !all_finite(values) {
        let value = values.iter().position(|value| !value.is_finite()).unwrap_or_default();
        return Err(VisionError::NotFinite { index: value / a_pixel });
    }
    Ok(())
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn all_finite(values: &[f32]) -> bool {
    // Without a branch, so that it compiles to vector instructions
    values.iter().fold(0, |bad, value| bad | u32::from(!value.is_finite())) == 0
}
