//! Splits that separate a few objects from almost all others.

/// A split stalls if its smaller side has less than one in `LEAST_SIDE` objects and its larger
/// side's box more than half the node's size. Without a limit on stalls, a division takes O(n²) if
/// splits keep separating a few objects from all others, which happens if most objects are as large
/// as the scene. A split whose boxes shrink does not stall, because boxes cannot shrink forever.
const LEAST_SIDE: usize = 16;

/// Least number of objects of a node whose stalls count. Any division of smaller nodes takes little
/// time.
pub(super) const LEAST_STALLED: usize = 256;

/// Returns whether a split into sides with these numbers of objects stalls. `larger_side_size` is
/// the size of the side with more objects.
#[inline(always)]
pub(super) fn is_stall(counts: [usize; 2], larger_side_size: f64, node_size: f64) -> bool {
    let all = counts[0] + counts[1];
    LEAST_SIDE * counts[0].min(counts[1]) < all && larger_side_size > 0.5 * node_size
}
