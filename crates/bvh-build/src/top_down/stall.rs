//! Splits that separate a few objects from almost all others.

/// A split stalls if its smaller side has fewer than one in this many objects, and its larger side's box more than half the node's size.
/// Without a limit on stalls a division takes O(n²) where splits keep separating a few objects from all others, as they may where most
/// objects are as large as the scene. Boxes that shrink are no stalls: they come to an end.
const LEAST_SIDE: usize = 16;

/// Stalls of smaller nodes are not counted: dividing these takes little time, however that is done.
pub(super) const LEAST_STALLED: usize = 256;

/// Whether a split into sides of so many objects stalls, where the side of more objects and the node have these sizes.
#[inline(always)]
pub(super) fn is_stall(counts: [usize; 2], larger_side_size: f64, node_size: f64) -> bool {
    let all = counts[0] + counts[1];
    LEAST_SIDE * counts[0].min(counts[1]) < all && larger_side_size > 0.5 * node_size
}
