//! The FNV-1a hash, which derives seeds, scene checksums and picture checksums in results.

/// Returns the 64-bit FNV-1a hash (Fowler, Noll & Vo) of `bytes`, which is the same on every
/// machine and in every version.
pub fn fnv1a(bytes: impl IntoIterator<Item = u8>) -> u64 {
    // The offset basis and the prime are part of the algorithm's definition.
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
