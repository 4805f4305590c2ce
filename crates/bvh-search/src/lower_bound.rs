//! A lower bound of the internal area of every binary tree with one object per leaf. A search whose
//! incumbent meets it has found an optimum.

use bvh_core::{Aabb, PackedAabb, cost::Sum};

/// A lower bound in O(n): the area of the root plus the areas of all objects except the smallest
/// and the largest, in world units squared; 0 for fewer than two objects. The optimum meets it if
/// all boxes are equal, if every box is inside the next, or if no box has an area.
///
/// *Proof.* Every inner node has at least the area of the largest object below it. There are k − 2
/// or more inner nodes above `k` of the objects, not counting the root, if these are all objects,
/// and k − 1 or more otherwise: k paths to the root join in k − 1 nodes, and any other object joins
/// them in one more. Choose the `k` objects of area t or more, and integrate over t. ∎
///
/// ```
/// use bvh_search::{lower_bound, prelude::*};
/// let boxes = vec![Aabb::from([[0.0; 3], [1.0; 3]]); 5];
/// let tree = median_cut::Config::default().build(&boxes)?;
/// assert_eq!(lower_bound::of_largest(&boxes), cost::internal_area(&tree), "no tree is better");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn of_largest(boxes: &[Aabb]) -> f64 {
    if boxes.len() < 2 {
        return 0.0;
    }
    let mut least = f64::INFINITY;
    let mut most = 0.0f64;
    let mut root = PackedAabb::EMPTY;
    let mut sum = Sum::default();
    for aabb in boxes.iter().map(PackedAabb::from) {
        let area = aabb.half_area();
        (least, most) = (least.min(area), most.max(area));
        root.grow(&aabb);
        sum.add(area);
    }
    let root = root.half_area();
    [root, -least, -most].into_iter().for_each(|area| sum.add(area));
    sum.value().max(root)
}
