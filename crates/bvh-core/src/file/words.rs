//! Values of four-byte words as little-endian bytes, and back.

use super::FileError;
use alloc::borrow::Cow;
use alloc::vec::Vec;
use bytemuck::Pod;

/// Returns the bytes of values that consist of four-byte words, little-endian on any machine.
pub(super) fn le_bytes<T: Pod>(values: &[T]) -> Cow<'_, [u8]> {
    let bytes: &[u8] = bytemuck::cast_slice(values);
    if cfg!(target_endian = "little") {
        Cow::Borrowed(bytes)
    } else {
        let (words, _) = bytes.as_chunks::<4>();
        Cow::Owned(words.iter().flat_map(|&[a, b, c, d]| [d, c, b, a]).collect())
    }
}

/// Borrows bytes as values that consist of four-byte words.
pub(super) fn cast<T: Pod>(bytes: &[u8]) -> Result<&[T], FileError> {
    if cfg!(target_endian = "big") {
        return Err(FileError::Machine);
    }
    // An empty slice may have any address, and `bytemuck` would reject it as misaligned.
    if bytes.is_empty() {
        return Ok(&[]);
    }
    bytemuck::try_cast_slice(bytes).map_err(|_| FileError::Alignment(align_of::<T>()))
}

/// Copies bytes to values that consist of four-byte words.
pub(super) fn copied<T: Pod>(bytes: &[u8]) -> Vec<T> {
    let mut values = alloc::vec![T::zeroed(); bytes.len() / size_of::<T>()];
    bytemuck::cast_slice_mut::<T, u8>(&mut values).copy_from_slice(bytes);
    for word in bytemuck::cast_slice_mut::<T, u32>(&mut values) {
        *word = u32::from_le(*word);
    }
    values
}
