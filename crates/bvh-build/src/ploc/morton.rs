//! The Morton order, which places objects that are close in space mostly close to each other.

use bvh_core::glam::DVec4;
use bvh_core::{PackedAabb, with_vector_instructions};

/// Returns the objects in the order of the Morton codes of their box centres, equal codes by index.
/// Centres are rounded to a grid of 2^21 points along the longest side of the box around all
/// centres, with the same spacing along the other sides.
pub(super) fn order(boxes: &[PackedAabb]) -> Vec<u32> {
    let codes = codes(boxes);
    let mut order: Vec<(u32, u32)> =
        codes.iter().zip(0..).map(|(&code, index)| (upper_half(code), index)).collect();
    // Equal upper halves are rare, so sorting 32-bit keys first and comparing lower halves later is
    // faster than sorting 64-bit keys.
    radsort::sort_by_key(&mut order, |&(half, _)| half);
    for equal in order.chunk_by_mut(|a, b| a.0 == b.0).filter(|equal| equal.len() > 1) {
        equal.sort_by_key(|&(_, index)| codes[index as usize]);
    }
    order.into_iter().map(|(_, index)| index).collect()
}

fn upper_half(code: u64) -> u32 {
    (code >> 31) as u32
}

with_vector_instructions! {
    /// Returns the Morton code of every box's centre.
    codes = codes_plain(boxes: &[PackedAabb]) -> Vec<u64>
}

#[inline(always)]
fn codes_plain(boxes: &[PackedAabb]) -> Vec<u64> {
    let mut low = DVec4::INFINITY;
    let mut high = DVec4::NEG_INFINITY;
    for centre in boxes.iter().map(PackedAabb::doubled_centroid) {
        (low, high) = (low.min(centre), high.max(centre));
    }
    let side = (high - low).max_element();
    let cells = if side > 0.0 { f64::from((1 << 21) - 1) / side } else { 0.0 };
    // Adding 2^52 to a small number rounds it to an integer and leaves the integer in the lowest
    // bits.
    let integers = DVec4::splat((1u64 << 52) as f64);
    boxes
        .iter()
        .map(|b| {
            let cell = (b.doubled_centroid() - low) * cells + integers;
            let [x, y, z, _] = spread(cell.to_array().map(f64::to_bits));
            x << 2 | y << 1 | z
        })
        .collect()
}

/// Moves bit i, below 21, to bit 3·i, in each of four numbers.
#[inline(always)]
fn spread(mut bits: [u64; 4]) -> [u64; 4] {
    bits = bits.map(|bits| bits & 0x1f_ffff);
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        bits = bits.map(|bits| (bits | bits << shift) & mask);
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::Aabb;
    use proptest::prelude::*;

    #[test]
    fn bits_are_spread_by_threes() {
        for bit in 0..21 {
            assert_eq!(spread([0, 1, 1 << bit, 0]), [0, 1, 1 << (3 * bit), 0]);
        }
        assert_eq!(spread([u64::MAX; 4]), [(0..21).map(|bit| 1 << (3 * bit)).sum::<u64>(); 4]);
    }

    #[test]
    fn codes_have_63_bits_with_x_first_and_reach_from_the_lowest_to_the_highest_corner() {
        let point = |point: [f32; 3]| PackedAabb::from(&Aabb::from((point, point)));
        let all = (1 << 63) - 1;
        let x = 0x4924_9249_2492_4924;
        let corners =
            [[-1.0; 3], [3.0; 3], [3.0, -1.0, -1.0], [-1.0, 3.0, -1.0], [-1.0, -1.0, 3.0]];
        assert_eq!(codes(&corners.map(point)), [0, all, x, x >> 1, x >> 2]);
        // Other sides have the same spacing, and a side without length has one cell.
        let flat = [[0.0; 3], [8.0, 4.0, 0.0]].map(point);
        assert_eq!(codes(&flat), [0, x | 1 << 61]);
        assert_eq!(codes(&[[5.0; 3]; 2].map(point)), [0, 0]);
    }

    proptest! {
        #[test]
        fn objects_are_ordered_by_code_and_then_by_index(
            points in prop::collection::vec((0u8..5, 0u32..1 << 22, prop::sample::select(vec![1e-7f32, 1.0])), 0..60),
            copies in prop::sample::select(vec![1usize, 100]),
        ) {
            // Coarse or fine coordinates: many codes have equal upper halves, and some are equal.
            let point = |&(x, y, scale): &(u8, u32, f32)| [f32::from(x), y as f32 * 1e-6 * scale, scale];
            let boxes: Vec<PackedAabb> =
                points.iter().map(|p| PackedAabb::from(&Aabb::from((point(p), point(p))))).collect();
            let boxes = boxes.repeat(copies);
            let codes = codes(&boxes);
            let mut expected: Vec<u32> = (0..boxes.len() as u32).collect();
            expected.sort_by_key(|&index| (codes[index as usize], index));
            prop_assert_eq!(order(&boxes), expected);
        }
    }
}
