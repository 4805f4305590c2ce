//! A 64-bit checksum at the speed of memory that no change within one of its words escapes.
//!
//! Bytes are taken as little-endian words of eight, padded with zeros to a multiple of 32 words. Word `i` goes to lane
//! `i mod 32`, from lanes that begin as 1, 2, …, 32. With arithmetic modulo 2^64, a lane takes in a word by
//!
//! ```text
//! x = rotate_left(lane ^ word, 16);  x = x + (x << 5);  lane = x ^ (x >> 23)
//! ```
//!
//! In the end `sum`, at first the number of bytes, takes in the lanes in turn:
//! `sum = rotate_left((sum ^ lane) · M, 29)` with M odd.
//!
//! Why these steps: every one is a bijection of what it takes in and of what it goes on from, hence a change of one
//! word, and so of any byte, changes the result with certainty. Changes in several lanes meet only in the
//! multiplications and escape with probability 2^-64 or so. Two changes in one lane, 256 bytes apart or a multiple of
//! that, escape only if the second undoes what has become of the first. Lanes do without multiplications, which vector
//! instructions of 64 bits do not have. Instead the rotation takes the bits in which coordinates and indices usually
//! differ, the upper halves of floats and the lower halves of integers, to where the next word's usually agree, and the
//! shifts spread them both ways: of one changed bit 6 have come on average after one word, 15 after two and half of all
//! after four. Not a sum: the order of words counts. Not meant against forgery.

use crate::{Aabb, Triangle};
use alloc::borrow::Cow;
use bytemuck::Pod;

/// Words taken in side by side: enough that none waits for the one before it.
const LANES: usize = 32;
/// Bytes taken in at a time.
pub(crate) const BLOCK: usize = 8 * LANES;

#[inline(always)]
fn absorb(lane: u64, word: u64) -> u64 {
    let rotated = (lane ^ word).rotate_left(16);
    let spread = rotated.wrapping_add(rotated << 5);
    spread ^ (spread >> 23)
}

/// With 2^64 divided by the golden ratio, odd.
#[inline(always)]
fn mix(state: u64, word: u64) -> u64 {
    (state ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
}

#[cfg(feature = "std")]
crate::with_vector_instructions! {
    /// Takes in blocks, with the vector instructions that the processor has.
    absorb_blocks = absorb_blocks_plain(lanes: &mut [u64; LANES], blocks: &[[u8; BLOCK]])
}
#[cfg(not(feature = "std"))]
use absorb_blocks_plain as absorb_blocks;

#[inline(always)]
fn absorb_blocks_plain(lanes: &mut [u64; LANES], blocks: &[[u8; BLOCK]]) {
    // In registers, of which each holds several lanes.
    let mut own = *lanes;
    for block in blocks {
        for (lane, word) in own.iter_mut().zip(block.as_chunks::<8>().0) {
            *lane = absorb(*lane, u64::from_le_bytes(*word));
        }
    }
    *lanes = own;
}

/// The checksum of the parts, one after the other. All but the last must be multiples of [`BLOCK`] bytes long.
pub(crate) fn checksum(parts: &[&[u8]]) -> u64 {
    let mut lanes = core::array::from_fn(|lane| lane as u64 + 1);
    let mut length = 0;
    for part in parts {
        let (whole, rest) = part.as_chunks();
        absorb_blocks(&mut lanes, whole);
        if !rest.is_empty() {
            let mut padded = [0; BLOCK];
            padded[..rest.len()].copy_from_slice(rest);
            absorb_blocks(&mut lanes, &[padded]);
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

    fn is_free_of_repetitions(mut sums: Vec<u64>) -> bool {
        let all = sums.len();
        sums.sort_unstable();
        sums.dedup();
        sums.len() == all
    }

    /// Boxes as alike as boxes of a scene can be: unit cubes at whole numbers.
    fn cubes() -> Vec<Aabb> {
        (0..600u16)
            .map(|i| [i % 8, i / 8 % 8, i / 64].map(f32::from))
            .map(|at| Aabb::from([at, at.map(|c| c + 1.0)]))
            .collect()
    }

    #[test]
    fn a_checksum_can_be_computed_by_hand() {
        // 3, rotated by 16, times 33, and its upper bits.
        assert_eq!(absorb(1, 2), 0x63_0000);
        assert_eq!(absorb(1 << 63, 0), 33 << 15);
        assert_eq!(absorb(0, 1 << 47), (33 << 63) ^ (1 << 40));
        assert_eq!(mix(0, 1), 0x9e37_79b9_7f4a_7c15u64.rotate_left(29));
        let mut lanes: [u64; 32] = core::array::from_fn(|lane| lane as u64 + 1);
        lanes[0] = absorb(1, 0x0807_0605_0403_0201);
        lanes[1] = absorb(2, 9);
        (2..32).for_each(|lane| lanes[lane] = absorb(lane as u64 + 1, 0));
        assert_eq!(checksum(&[&[1, 2, 3, 4, 5, 6, 7, 8, 9]]), lanes.iter().fold(9, |h, &lane| mix(h, lane)));
    }

    #[test]
    fn checksums_are_the_same_everywhere_and_for_ever() {
        let bytes: Vec<u8> = (0..2000u32).map(|i| (i * i / 7) as u8).collect();
        let sums = [0, 1, 256, 2000].map(|length| checksum(&[&bytes[..length]]));
        assert_eq!(
            sums,
            [0xcc69_775f_2293_f753, 0xc7b6_c60f_e13f_bdd7, 0x5b2b_c5f5_b2a5_37a1, 0xc25d_020e_5a74_86c9]
        );
        let (mut fast, mut plain) = ([7; LANES], [7; LANES]);
        absorb_blocks(&mut fast, bytes.as_chunks().0);
        absorb_blocks_plain(&mut plain, bytes.as_chunks().0);
        assert_eq!(fast, plain);
    }

    #[test]
    fn lengths_and_places_of_zeros_count() {
        assert!(is_free_of_repetitions((0..1000).map(|length| checksum(&[&vec![0; length]])).collect()));
    }

    #[test]
    fn parts_of_whole_blocks_are_as_good_as_one() {
        let bytes: Vec<u8> = (0..=255).cycle().take(700).collect();
        assert_eq!(checksum(&[&bytes[..512], &bytes[512..]]), checksum(&[&bytes]));
    }

    #[test]
    fn no_flipped_bit_is_like_another_and_none_undoes_another() {
        let mut bytes = vec![0; 768];
        let whole = checksum(&[&bytes]);
        let mut flipped = |bits: &[usize]| {
            bits.iter().for_each(|bit| bytes[bit / 8] ^= 1 << (bit % 8));
            let sum = checksum(&[&bytes]);
            bits.iter().for_each(|bit| bytes[bit / 8] ^= 1 << (bit % 8));
            sum
        };
        let single: Vec<u64> = (0..6144).map(|bit| flipped(&[bit])).collect();
        assert!(is_free_of_repetitions([&single[..], &[whole]].concat()));
        // The words of one lane that follow the first.
        for (bit, other) in
            (0..64).flat_map(|bit| (2048..2112).chain(4096..4160).map(move |other| (bit, other)))
        {
            assert!(flipped(&[bit, other]) != whole, "{bit} {other}");
        }
    }

    #[test]
    fn objects_that_change_places_change_the_checksum() {
        let mut boxes = cubes();
        let mut sums = vec![boxes_checksum(&boxes)];
        for first in [0, 7, 300] {
            for second in first + 1..boxes.len() {
                boxes.swap(first, second);
                sums.push(boxes_checksum(&boxes));
                boxes.swap(first, second);
            }
        }
        // Whole stretches, too, and what turns back to front.
        for length in 1..300 {
            boxes.rotate_left(length);
            sums.push(boxes_checksum(&boxes));
            boxes.rotate_right(length);
            boxes[..=length].reverse();
            sums.push(boxes_checksum(&boxes));
            boxes[..=length].reverse();
        }
        // Reversing two or three is swapping two.
        sums.sort_unstable();
        sums.dedup();
        assert_eq!(sums.len(), 1 + (599 + 592 + 299) + 2 * 299 - 2);
    }

    #[test]
    fn pairs_of_moves_by_whole_numbers_do_not_cancel() {
        let mut boxes = cubes();
        boxes.truncate(70);
        let whole = boxes_checksum(&boxes);
        // Box 10 ends in the word that follows box 0's first in its lane. The words of box 32 are in the lanes of those
        // of box 0, three words later, and those of box 64 six.
        let corners = |other: usize| (0..6).map(move |at| (other, at % 3, at > 2));
        for (other, axis, upper) in [10, 32, 64].into_iter().flat_map(corners) {
            for (own, by, other_by) in (0..3 * 63 * 63).map(|i| (i / 3969, i / 63 % 63 + 1, i % 63 + 1)) {
                let (a, b) = (boxes[0], boxes[other]);
                boxes[0].min[own] -= by as f32;
                let moved = &mut boxes[other];
                let corner = if upper { &mut moved.max } else { &mut moved.min };
                corner[axis] += other_by as f32;
                assert!(boxes_checksum(&boxes) != whole, "{own} by {by}, {axis} of {other} by {other_by}");
                (boxes[0], boxes[other]) = (a, b);
            }
        }
    }
}
