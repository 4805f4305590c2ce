//! A 64-bit checksum at the speed of memory that no change within eight bytes escapes.
//!
//! Bytes are taken as little-endian words of eight, padded with zeros to a multiple of four words. Word `i` goes to lane
//! `i mod 4`: `lane = rotate_left((lane ^ word) · M, 29)`, from lanes that begin as 1, 2, 3, 4, with M odd and arithmetic
//! modulo 2^64. In the end the number of bytes takes in the four lanes in the same way. Every step is a bijection of
//! what it takes in and of what it goes on from, hence a change of one word, and so of any byte, changes the result with
//! certainty; other changes escape with probability 2^-64 or so. Not meant against forgery.

use crate::{Aabb, Triangle};
use alloc::borrow::Cow;
use bytemuck::Pod;

/// 2^64 divided by the golden ratio, odd.
const MULTIPLIER: u64 = 0x9e37_79b9_7f4a_7c15;

#[inline(always)]
fn mix(state: u64, word: u64) -> u64 {
    (state ^ word).wrapping_mul(MULTIPLIER).rotate_left(29)
}

/// The checksum of the parts, one after the other. All but the last must be multiples of 32 bytes long.
pub(crate) fn checksum(parts: &[&[u8]]) -> u64 {
    let (mut lanes, mut length) = ([1, 2, 3, 4], 0);
    let mut take = |words: &[u8; 32]| {
        for (lane, word) in lanes.iter_mut().zip(words.as_chunks::<8>().0) {
            *lane = mix(*lane, u64::from_le_bytes(*word));
        }
    };
    for part in parts {
        let (whole, rest) = part.as_chunks::<32>();
        whole.iter().for_each(&mut take);
        if !rest.is_empty() {
            let mut padded = [0; 32];
            padded[..rest.len()].copy_from_slice(rest);
            take(&padded);
        }
        length += part.len() as u64;
    }
    lanes.into_iter().fold(length, mix)
}

/// The checksum of objects' boxes, by which a tree file knows its scene: of min x, y, z, max x, y, z of each, f32,
/// little-endian. O(n).
pub fn boxes_checksum(boxes: &[Aabb]) -> u64 {
    checksum(&[&le_bytes(boxes)])
}

/// The checksum of triangles, by which the file of a wide layout knows its scene: of x, y, z of each corner, f32,
/// little-endian. O(n).
pub fn triangles_checksum(triangles: &[Triangle]) -> u64 {
    checksum(&[&le_bytes(triangles)])
}

/// The bytes of values made of four-byte words, little-endian on any machine.
pub(crate) fn le_bytes<T: Pod>(values: &[T]) -> Cow<'_, [u8]> {
    let bytes: &[u8] = bytemuck::cast_slice(values);
    if cfg!(target_endian = "little") {
        Cow::Borrowed(bytes)
    } else {
        Cow::Owned(bytes.as_chunks::<4>().0.iter().flat_map(|&[a, b, c, d]| [d, c, b, a]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::{vec, vec::Vec};

    #[test]
    fn a_checksum_can_be_computed_by_hand() {
        let mut lanes = [1, 2, 3, 4u64];
        lanes[0] = mix(1, 0x0807_0605_0403_0201);
        lanes[1] = mix(2, 9);
        lanes[2] = mix(3, 0);
        lanes[3] = mix(4, 0);
        assert_eq!(checksum(&[&[1, 2, 3, 4, 5, 6, 7, 8, 9]]), lanes.iter().fold(9, |h, &lane| mix(h, lane)));
        assert_eq!(mix(0, 1), MULTIPLIER.rotate_left(29));
    }

    #[test]
    fn lengths_and_places_of_zeros_count() {
        let sums: Vec<u64> = (0..100).map(|length| checksum(&[&vec![0; length]])).collect();
        let mut distinct = sums.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), sums.len());
    }

    #[test]
    fn parts_of_whole_blocks_are_as_good_as_one() {
        let bytes: Vec<u8> = (0..100).collect();
        assert_eq!(checksum(&[&bytes[..64], &bytes[64..]]), checksum(&[&bytes]));
    }
}
