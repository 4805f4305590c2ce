//! Every cluster's nearest neighbour in Morton order: vectorised over clusters, one distance after
//! the other.

use crate::larger;
use bvh_core::cost::Measure;
use bvh_core::{PackedAabb, with_vector_instructions};

/// Clusters whose neighbours are found in one call.
pub(super) const CHUNK: usize = 512;

/// Buffers of one call of [`find`]: the boxes of a chunk and its surroundings as one array per
/// plane, and results.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    planes: [Vec<f32>; 6],
    /// Per pair of clusters, the side lengths of the joint box. Its area later replaces the first
    /// side.
    sides: [Vec<f32>; 3],
    /// Per cluster, the bits of the smallest area so far.
    least: Vec<i32>,
    /// A copy of the results so far. Reading and writing the same array would prevent
    /// vectorisation.
    before: Vec<i32>,
}

/// The maximum magnitude of scaled coordinates; larger ones are clamped. Extents are below 2 and an
/// f32 has 24 bits, so coordinates are larger only along an axis where all boxes are in one plane
/// far from the origin.
const FARTHEST: f64 = (1u64 << 40) as f64;

with_vector_instructions! {
    /// Finds the nearest neighbours of the `found.len()` clusters from `start` on, at most
    /// [`CHUNK`], among the clusters up to `radius` positions before and after. Writes the
    /// distances, negative for neighbours before. The nearest neighbour has the smallest joint box;
    /// among equal ones, the least exclusive or of both positions.
    ///
    /// Areas are f32. Coordinates are first multiplied by `scale`, a power of two, so no area
    /// overflows, and only clusters about 2^60 times smaller than the scene have area 0.
    pub(super) find = find_plain(
        boxes: &[PackedAabb], scale: f64, measure: Option<&dyn Measure>, radius: usize, start: usize, found: &mut [i32], scratch: &mut Scratch)
}

#[inline(always)]
fn find_plain(
    boxes: &[PackedAabb],
    scale: f64,
    measure: Option<&dyn Measure>,
    radius: usize,
    start: usize,
    found: &mut [i32],
    scratch: &mut Scratch,
) {
    let len = found.len();
    let Scratch { planes, sides, least, before } = scratch;
    // Position p of the chunk is stored at radius + p. Boxes at infinity, whose areas never win,
    // fill the places beyond the ends.
    let first = start.saturating_sub(radius);
    let last = (start + len + radius).min(boxes.len());
    let offset = first + radius - start;
    for plane in planes.iter_mut() {
        plane.resize(len + 2 * radius, f32::INFINITY);
        plane[..offset].fill(f32::INFINITY);
        plane[offset + last - first..].fill(f32::INFINITY);
    }
    let [a, b, c, d, e, f] =
        planes.each_mut().map(|plane| &mut plane[offset..offset + last - first]);
    let scaled = |x: f32| (f64::from(x) * scale).clamp(-FARTHEST, FARTHEST) as f32;
    for (index, aabb) in boxes[first..last].iter().enumerate() {
        let [low, high] = aabb.planes();
        [a[index], b[index], c[index]] = [scaled(low[0]), scaled(low[1]), scaled(low[2])];
        [d[index], e[index], f[index]] = [scaled(high[0]), scaled(high[1]), scaled(high[2])];
    }
    sides.iter_mut().for_each(|side| side.resize(len + radius, 0.0));
    least.clear();
    // Larger than the bits of any finite area and of infinity.
    least.resize(len, i32::MAX);
    before.resize(len, 0);
    for distance in 1..=radius {
        // All pairs at this distance with at least one cluster in the chunk.
        let pairs = len + distance;
        // The loop writes `found` and reads `before`: separate arrays let it be vectorised.
        before.copy_from_slice(found);
        if let Some(measure) = measure {
            let sizes = &mut sides[0][..pairs];
            joint_sizes(measure, scale, boxes, start, distance, sizes);
            take_nearer(sizes, start, distance, least, before, found);
            continue;
        }
        for (axis, side) in sides.iter_mut().enumerate() {
            let [low, high] = [axis, axis + 3]
                .map(|plane| &planes[plane][radius - distance..][..pairs + distance]);
            joint_sides(low, high, distance, &mut side[..pairs]);
        }
        let [x, y, z] = sides.each_mut().map(|side| &mut side[..pairs]);
        for ((x, y), z) in x.iter_mut().zip(y.iter()).zip(z.iter()) {
            *x = *x * *y + *y * *z + *z * *x;
        }
        take_nearer(x, start, distance, least, before, found);
    }
}

/// Writes the measures of the joint boxes of the clusters at p − distance and p, from p = `start`
/// on, scaled like areas and rounded to f32; infinity only where a cluster does not exist.
fn joint_sizes(
    measure: &dyn Measure,
    scale: f64,
    boxes: &[PackedAabb],
    start: usize,
    distance: usize,
    sizes: &mut [f32],
) {
    for (size, second) in sizes.iter_mut().zip(start..) {
        let pair = second
            .checked_sub(distance)
            .and_then(|first| Some((&boxes[first], boxes.get(second)?)));
        *size = pair.map_or(f32::INFINITY, |(a, b)| {
            ((measure.of(&a.union(b)) * scale * scale) as f32).min(f32::MAX)
        });
    }
}

/// Writes the side lengths of the joint boxes of the clusters at p and p + distance, for every p in
/// `sides`.
#[inline(always)]
fn joint_sides(low: &[f32], high: &[f32], distance: usize, sides: &mut [f32]) {
    let pairs = sides.len();
    let (low, low_on) = (&low[..pairs], &low[distance..][..pairs]);
    let (high, high_on) = (&high[..pairs], &high[distance..][..pairs]);
    for index in 0..pairs {
        sides[index] = larger(low[index], low_on[index]) + larger(high[index], high_on[index]);
    }
}

/// Replaces the results of clusters whose neighbours at `distance` are nearer than all neighbours
/// so far. Areas are not negative, so they compare like their bits, and no branch is needed.
#[inline(always)]
fn take_nearer(
    areas: &[f32],
    start: usize,
    distance: usize,
    least: &mut [i32],
    known: &[i32],
    found: &mut [i32],
) {
    let len = found.len();
    let before = &areas[..len];
    let after = &areas[distance..][..len];
    let least = &mut least[..len];
    let known = &known[..len];
    let far = distance as i32;
    for index in 0..len {
        let before = before[index].to_bits() as i32;
        // Not negative, so the order of the bits is the order of the areas.
        let after = after[index].to_bits() as i32;
        let position = (start + index) as i32;
        let bits = |on: i32| position ^ (position + on);
        let backwards = is_less([before, bits(-far)], [after, bits(far)]);
        let area = after.min(before);
        let on = (far ^ backwards) - backwards;
        // Distances come in increasing order, but the tie-break is by exclusive or, so equal areas
        // compare.
        let nearer = is_less([area, bits(on)], [least[index], bits(known[index])]);
        least[index] = area.min(least[index]);
        found[index] = known[index] ^ (known[index] ^ on) & nearer;
    }
}

/// Returns −1, all bits set, if `a` precedes `b` lexicographically; otherwise 0.
#[inline(always)]
fn is_less(a: [i32; 2], b: [i32; 2]) -> i32 {
    -(i32::from(a[0] < b[0]) | i32::from(a[0] == b[0]) & i32::from(a[1] < b[1]))
}
