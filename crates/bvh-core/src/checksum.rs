//! A 64-bit checksum at the speed of memory that no change within one of its words escapes.
//!
//! The bytes are cut into four quarters: of `b` bytes they begin at 0, `q`, `2q` and `3q`, with `q` the least multiple
//! of 256 for which `4q` is no less than `b`, and end where the next begins or all bytes do. Within a quarter, bytes
//! are taken as little-endian words of eight, padded with zeros to a multiple of 32 words. Word `i` goes to lane
//! `i mod 32`, from lanes that begin as 1, 2, …, 32. With arithmetic modulo 2^64, a lane takes in a word by
//!
//! ```text
//! x = rotate_left(lane ^ word, 16);  x = x + (x << 5);  lane = x ^ (x >> 23)
//! ```
//!
//! In the end a quarter's `sum`, at first the number of its bytes, takes in its lanes in turn:
//! `sum = rotate_left((sum ^ lane) · M, 29)` with M odd. Likewise the checksum, at first the number of all bytes, takes
//! in the sums of the quarters.
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
const BLOCK: usize = 8 * LANES;
/// Bytes taken in of one quarter before the next: with more, memory rests while what is there is looked at.
const STEP: usize = 4 * BLOCK;

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

/// What the lanes begin as.
const BEGIN: [u64; LANES] = {
    let mut lanes = [0; LANES];
    let mut lane = 0;
    while lane < LANES {
        lanes[lane] = lane as u64 + 1;
        lane += 1;
    }
    lanes
};

/// Takes in bytes of a quarter, the rest after whole blocks padded with zeros: only the last may have one.
#[inline(always)]
fn absorb_bytes(lanes: &mut [u64; LANES], bytes: &[u8]) {
    let (blocks, rest) = bytes.as_chunks::<BLOCK>();
    // In registers, of which each holds several lanes.
    let mut own = *lanes;
    let mut take = |block: &[u8; BLOCK]| {
        for (lane, word) in own.iter_mut().zip(block.as_chunks::<8>().0) {
            *lane = absorb(*lane, u64::from_le_bytes(*word));
        }
    };
    blocks.iter().for_each(&mut take);
    if !rest.is_empty() {
        let mut padded = [0; BLOCK];
        padded[..rest.len()].copy_from_slice(rest);
        take(&padded);
    }
    *lanes = own;
}

#[cfg(feature = "std")]
crate::with_vector_instructions! {
    /// The checksum of some bytes, with the vector instructions that the processor has.
    pub(crate) checksum = checksum_plain(bytes: &[u8]) -> u64
}
#[cfg(not(feature = "std"))]
pub(crate) use checksum_plain as checksum;

#[inline(always)]
pub(crate) fn checksum_plain(bytes: &[u8]) -> u64 {
    checksum_and_visit(bytes, |_, _| ())
}

/// The checksum of some bytes. Shows what has just been taken in to `visit`, with where it begins, while it is still in
/// the cache: all bytes once, in pieces from a multiple of 256 on.
///
/// Of quarters, so that memory is read in four places at a time: what a processor fetches ahead ends with a page.
#[inline(always)]
pub(crate) fn checksum_and_visit(bytes: &[u8], mut visit: impl FnMut(usize, &[u8])) -> u64 {
    let quarter = bytes.len().div_ceil(4 * BLOCK) * BLOCK;
    let part =
        |from: usize, to: usize| (from.min(bytes.len()), &bytes[from.min(bytes.len())..to.min(bytes.len())]);
    let starts = [0, 1, 2, 3].map(|number| number * quarter);
    let mut lanes = [BEGIN; 4];
    for at in (0..quarter).step_by(STEP) {
        let pieces = starts.map(|start| part(start + at, start + quarter.min(at + STEP)));
        for (lanes, (_, piece)) in lanes.iter_mut().zip(pieces) {
            absorb_bytes(lanes, piece);
        }
        for (start, piece) in pieces {
            visit(start, piece);
        }
    }
    let sums = [0, 1, 2, 3].map(|number| {
        let (_, whole) = part(starts[number], starts[number] + quarter);
        lanes[number].into_iter().fold(whole.len() as u64, mix)
    });
    sums.into_iter().fold(bytes.len() as u64, mix)
}

/// The checksum of objects' boxes, by which a tree file knows its scene: of min x, y, z, max x, y, z of each, f32,
/// little-endian. O(n).
pub fn boxes_checksum(boxes: &[Aabb]) -> u64 {
    checksum(&le_bytes(boxes))
}

/// The checksum of triangles, by which the file of a wide layout knows its scene: of x, y, z of each corner, f32,
/// little-endian. O(n).
pub fn triangles_checksum(triangles: &[Triangle]) -> u64 {
    checksum(&le_bytes(triangles))
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
        let untouched: [u64; 32] = core::array::from_fn(|lane| lane as u64 + 1);
        let [first, other] =
            [(lanes, 9), (untouched, 0)].map(|(lanes, bytes)| lanes.into_iter().fold(bytes, mix));
        let sum = [first, other, other, other].into_iter().fold(9, mix);
        assert_eq!(checksum(&[1, 2, 3, 4, 5, 6, 7, 8, 9]), sum);
    }

    #[test]
    fn checksums_are_the_same_everywhere_and_for_ever() {
        let bytes: Vec<u8> = (0..2000u32).map(|i| (i * i / 7) as u8).collect();
        let sums = [0, 1, 256, 2000].map(|length| checksum(&bytes[..length]));
        assert_eq!(
            sums,
            [0x42e7_2dc3_6868_92be, 0xa261_feb5_c057_6f8e, 0x642f_9a91_d8ed_1246, 0x0227_405d_4f2d_01cd]
        );
        assert_eq!(checksum(&bytes), checksum_plain(&bytes));
    }

    #[test]
    fn lengths_and_places_of_zeros_count() {
        assert!(is_free_of_repetitions((0..2100).map(|length| checksum(&vec![0; length])).collect()));
    }

    #[test]
    fn bytes_are_visited_once_and_quarters_have_sums_of_their_own() {
        let bytes: Vec<u8> = (0..=250).cycle().take(12_000).collect();
        for length in (0..1100).chain([2047, 2048, 2049, 4096, 4097, 8191, 8193, 12_000]) {
            let bytes = &bytes[..length];
            let mut seen = vec![0; length];
            let sum = checksum_and_visit(bytes, |start, piece| {
                assert_eq!(piece, &bytes[start..start + piece.len()]);
                assert!(piece.is_empty() || start % 256 == 0);
                seen[start..start + piece.len()].iter_mut().for_each(|times| *times += 1);
            });
            assert_eq!(seen, vec![1; length]);
            let quarter = length.div_ceil(1024) * 256;
            let mut parts = bytes.chunks(quarter.max(1));
            let sums = [(); 4].map(|()| {
                let (part, mut lanes) = (parts.next().unwrap_or_default(), BEGIN);
                absorb_bytes(&mut lanes, part);
                lanes.into_iter().fold(part.len() as u64, mix)
            });
            assert_eq!(sum, sums.into_iter().fold(length as u64, mix), "{length}");
        }
    }

    #[test]
    fn no_flipped_bit_is_like_another_and_none_undoes_another() {
        let mut bytes = vec![0; 4 * 768];
        let whole = checksum(&bytes);
        let mut flipped = |bits: &[usize]| {
            bits.iter().for_each(|bit| bytes[bit / 8] ^= 1 << (bit % 8));
            let sum = checksum(&bytes);
            bits.iter().for_each(|bit| bytes[bit / 8] ^= 1 << (bit % 8));
            sum
        };
        let single: Vec<u64> = (0..4 * 6144).map(|bit| flipped(&[bit])).collect();
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
        // The first 70 are in one quarter.
        boxes.truncate(280);
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
