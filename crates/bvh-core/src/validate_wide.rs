//! The validator of wide layouts: nothing in one that passes leads out of bounds or in circles.

use crate::validate::Marks;
use crate::wide::{WideView, node::WideTarget};
use crate::{Aabb, MAX_OBJECTS};

/// Why a wide layout was refused. Nodes, lanes and blocks are named by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // the fields are the indices that the messages name
pub enum InvalidWide {
    /// Triangles without blocks, or the reverse.
    #[error("the layout has {nodes} nodes and {blocks} blocks over {objects} triangles")]
    Counts { nodes: usize, blocks: usize, objects: usize },
    /// Children follow their parent, leaves begin where one before has ended, and each has one parent.
    #[error("lane {lane} of node {node} names no child, or one that has another parent")]
    Child { node: usize, lane: usize },
    /// A box is finite, and inside that of the lane that names its node; unused lanes are NaN throughout.
    #[error("lane {lane} of node {node} has no box inside its parent's")]
    Box { node: usize, lane: usize },
    /// A node that no lane names.
    #[error("node {node} has no parent")]
    NoParent { node: usize },
    /// A leaf that no lane names, or that does not end.
    #[error("block {block} begins no leaf that is named, or ends none")]
    Leaf { block: usize },
    /// An id outside the scene or in two places.
    #[error("block {block} names object {object}, of {objects}, or names it a second time")]
    Object { block: usize, object: u32, objects: usize },
    /// A triangle that is not inside its leaf's box.
    #[error("a triangle of block {block} is not inside its leaf")]
    Outside { block: usize },
    /// A triangle that is in no block.
    #[error("object {object} is in no leaf")]
    Missing { object: usize },
}

#[cfg(feature = "std")]
crate::with_vector_instructions! {
    /// [`check_wide_plain`], with the vector instructions that the processor has.
    pub(crate) check_wide = check_wide_plain(wide: WideView, objects: usize) -> Result<(), InvalidWide>
}
#[cfg(not(feature = "std"))]
pub(crate) use check_wide_plain as check_wide;

/// Whether each lane of a node is unused, NaN throughout, and whether it has a finite box inside `bounds`.
#[inline(always)]
fn lanes(planes: &[[f32; 8]; 6], bounds: &Aabb) -> [[bool; 8]; 2] {
    // All bits or none, for vector registers.
    let all = |is_so: bool| u32::from(is_so).wrapping_neg();
    let (mut unused, mut inside) = ([u32::MAX; 8], [u32::MAX; 8]);
    for axis in 0..3 {
        let (least, most) = (bounds.min[axis], bounds.max[axis]);
        for lane in 0..8 {
            let (low, high) = (planes[axis][lane], planes[axis + 3][lane]);
            unused[lane] &= all(low.is_nan()) & all(high.is_nan());
            inside[lane] &= all(low >= least) & all(low <= high) & all(high <= most);
            inside[lane] &= all(low > f32::NEG_INFINITY) & all(high < f32::INFINITY);
        }
    }
    [unused, inside].map(|lanes| lanes.map(|lane| lane != 0))
}

/// Checks that `wide` is a layout over `objects` triangles: every node and leaf reached once, every triangle in exactly
/// one leaf, every box inside its parent's. O(nodes + blocks), no recursion; safe on any bits.
#[inline(always)]
pub(crate) fn check_wide_plain(wide: WideView, objects: usize) -> Result<(), InvalidWide> {
    let WideView { nodes, blocks, .. } = wide;
    if objects > MAX_OBJECTS || blocks.is_empty() != (objects == 0) || nodes.len() > 2 * objects {
        return Err(InvalidWide::Counts { nodes: nodes.len(), blocks: blocks.len(), objects });
    }
    let (mut reached, mut leaves) = (Marks::new(nodes.len()), Marks::new(blocks.len()));
    let begins_leaf = |block: usize| block == 0 || blocks[block - 1].is_last();
    // The boxes that nodes and leaves must lie in, as their parents give them.
    let mut node_bounds = alloc::vec![wide.bounds; nodes.len()];
    let mut leaf_bounds = alloc::vec![wide.bounds; blocks.len()];
    if nodes.is_empty() && !blocks.is_empty() {
        leaves.set(0);
    }
    for (index, node) in nodes.iter().enumerate() {
        let [unused, inside] = lanes(&node.planes, &node_bounds[index]);
        for lane in 0..8 {
            if unused[lane] {
                if node.children[lane].target() != WideTarget::Node(0) {
                    return Err(InvalidWide::Child { node: index, lane });
                }
                continue;
            }
            if !inside[lane] {
                return Err(InvalidWide::Box { node: index, lane });
            }
            let plane = |plane: usize| node.planes[plane][lane];
            let aabb = Aabb::from([[plane(0), plane(1), plane(2)], [plane(3), plane(4), plane(5)]]);
            let is_named_once = match node.children[lane].target() {
                WideTarget::Node(child) if child > index && child < nodes.len() => {
                    node_bounds[child] = aabb;
                    reached.set(child)
                }
                WideTarget::Block(first) if first < blocks.len() && begins_leaf(first) => {
                    leaf_bounds[first] = aabb;
                    leaves.set(first)
                }
                _ => false,
            };
            if !is_named_once {
                return Err(InvalidWide::Child { node: index, lane });
            }
        }
    }
    if let Some(node) = (1..nodes.len()).find(|&node| !reached.get(node)) {
        return Err(InvalidWide::NoParent { node });
    }
    let mut seen = Marks::new(objects);
    for (index, block) in blocks.iter().enumerate() {
        if begins_leaf(index) != leaves.get(index) || (index + 1 == blocks.len() && !block.is_last()) {
            return Err(InvalidWide::Leaf { block: index });
        }
        if !begins_leaf(index) {
            leaf_bounds[index] = leaf_bounds[index - 1];
        }
        let is_inside = block.is_inside(&leaf_bounds[index]);
        for (lane, id) in block.ids().into_iter().enumerate() {
            let Some(object) = id else { continue };
            if object as usize >= objects || !seen.set(object as usize) {
                return Err(InvalidWide::Object { block: index, object, objects });
            }
            if !is_inside && !block.triangle(lane).is_some_and(|(_, t)| leaf_bounds[index].contains(&t.aabb()))
            {
                return Err(InvalidWide::Outside { block: index });
            }
        }
    }
    match (0..objects).find(|&object| !seen.get(object)) {
        Some(object) => Err(InvalidWide::Missing { object }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Triangle;
    use crate::wide::triangle4::Triangle4;
    use glam::Vec3;

    const VALUES: [f32; 9] = [f32::NEG_INFINITY, -2.0, -1.0, -0.0, 0.0, 1.0, 2.0, f32::INFINITY, f32::NAN];

    #[test]
    fn lanes_are_judged_as_boxes_are() {
        let bounds =
            [[-1.0, 1.0], [f32::NEG_INFINITY, f32::INFINITY], [0.0, f32::MAX], [1.0, -1.0], [f32::NAN; 2]];
        for [least, most] in bounds {
            let bounds = Aabb::from([[least, -1.0, -1.0], [most, 1.0, 1.0]]);
            for (axis, low, high) in (0..3)
                .flat_map(|axis| VALUES.into_iter().flat_map(move |low| VALUES.map(|high| (axis, low, high))))
            {
                let mut planes = [[0.0; 8]; 6];
                planes[4][1] = f32::NAN;
                planes.iter_mut().for_each(|plane| plane[2] = f32::NAN);
                (planes[axis][3], planes[axis + 3][3]) = (low, high);
                (planes[axis][2], planes[axis + 3][2]) = (high, low);
                let [unused, inside] = lanes(&planes, &bounds);
                for lane in 0..8 {
                    let [a, b, c, d, e, f] = planes.map(|plane| plane[lane]);
                    let aabb = Aabb::from([[a, b, c], [d, e, f]]);
                    assert_eq!(inside[lane], aabb.check().is_ok() && bounds.contains(&aabb), "{aabb:?}");
                    assert_eq!(unused[lane], [a, b, c, d, e, f].iter().all(|plane| plane.is_nan()), "{aabb:?}");
                }
            }
        }
    }

    #[test]
    fn blocks_inside_a_box_are_those_of_which_all_triangles_are() {
        let bounds = Aabb::from([[-1.0; 3], [1.0; 3]]);
        for count in 1..=4 {
            for (lane, corner, axis) in (0..36).map(|place| (place / 9, place / 3 % 3, place % 3)) {
                for value in VALUES {
                    let mut triangles = [Triangle([Vec3::ZERO, Vec3::X, Vec3::Y]); 4];
                    triangles[lane].0[corner][axis] = value;
                    let block = Triangle4::chain(&[0, 1, 2, 3][..count], &triangles).next().unwrap();
                    let is_inside = lane >= count || value.abs() <= 1.0;
                    assert_eq!(block.is_inside(&bounds), is_inside, "{value} in lane {lane} of {count}");
                }
            }
        }
    }
}
