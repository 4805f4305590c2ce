//! Median cut: halves the objects of a node at the median of their box centres.
//!
//! Kay & Kajiya 1986, 'Ray tracing complex scenes', alternate the axes. Chang's CSS 552 report
//! stops at 10 % of all objects; it names the 'local axis', which is 'also world axis', and no rule
//! that chooses among the three.
//!
//! Differs from the sources: an odd object goes to the left half; equal centres are ordered by
//! index.

use crate::error::check_scene;
use crate::watch::Pace;
use crate::{BuildError, Builder, Check, Watch};
use bvh_core::cost::Measure;
use bvh_core::{Aabb, Bvh, Node};

bvh_config::config! {
    /// The axis of cuts, and the size of leaves.
    pub struct Config {
        /// The axis along which a node is cut.
        axis: CutAxis = CutAxis::Alternating;
        /// A node with at most this fraction of all objects is a leaf. With 0, every leaf holds
        /// exactly one object.
        leaf_fraction: f64 = 0.0, in 0.0..=1.0;
    }
}

bvh_config::config! {
    /// The axis along which a node is cut.
    #[derive(Copy, Eq)]
    pub enum CutAxis {
        /// x at the root, then y, z, x and so on by level (Kay & Kajiya).
        Alternating,
        /// The longest side of the node's box.
        Longest,
        /// Always x.
        X,
    }
}

struct Frame {
    node: usize,
    start: usize,
    len: usize,
    level: usize,
}

impl Builder for Config {
    /// Builds a tree of depth at most ⌈log₂ n⌉ in O(n log n).
    fn build_watched(
        &self,
        boxes: &[Aabb],
        _sizes_are_not_compared: Option<&dyn Measure>,
        watch: &Watch,
    ) -> Result<Bvh, BuildError> {
        check_scene(boxes)?;
        self.check()?;
        let n = boxes.len();
        let max_leaf = ((n as f64 * self.leaf_fraction) as usize).max(1);
        let mut prim_ids: Vec<u32> = (0..n as u32).collect();
        let mut nodes = Vec::with_capacity(2 * n);
        let placeholder = Node::leaf(Aabb::EMPTY, 0, 0);
        let mut stack = Vec::new();
        if n > 0 {
            nodes.push(placeholder);
            stack.push(Frame { node: 0, start: 0, len: n, level: 0 });
        }
        let mut pace = Pace::new(watch);
        while let Some(Frame { node, start, len, level }) = stack.pop() {
            if pace.ends_after(len) {
                return Err(BuildError::Cancelled);
            }
            let ids = &mut prim_ids[start..start + len];
            let aabb = Aabb::union_of(ids.iter().map(|&id| &boxes[id as usize]));
            if len <= max_leaf {
                // The selection leaves no defined order within a side, and a leaf's order must be
                // reproducible.
                ids.sort_unstable();
                nodes[node] = Node::leaf(aabb, start as u32, len as u32);
                continue;
            }
            let axis = match self.axis {
                CutAxis::Alternating => level % 3,
                CutAxis::Longest => aabb.longest_axis(),
                CutAxis::X => 0,
            };
            let half = len.div_ceil(2);
            let key = |id: u32| boxes[id as usize].doubled_centroid()[axis];
            ids.select_nth_unstable_by(half - 1, |&a, &b| {
                key(a).total_cmp(&key(b)).then(a.cmp(&b))
            });
            let first = nodes.len();
            nodes[node] = Node::inner(aabb, first as u32, 2);
            nodes.extend([placeholder; 2]);
            let level = level + 1;
            stack.push(Frame { node: first + 1, start: start + half, len: len - half, level });
            stack.push(Frame { node: first, start, len: half, level });
        }
        Ok(Bvh::new(nodes, prim_ids))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::NodeKind;

    /// Unit cubes at x = 0, 2, 4, … and y = 0, 100, 0, 100, …
    fn zigzag(n: usize) -> Vec<Aabb> {
        let low = |i: usize| [2.0 * i as f32, 100.0 * (i % 2) as f32, 0.0];
        (0..n).map(|i| Aabb::from((low(i), low(i).map(|c| c + 1.0)))).collect()
    }

    #[test]
    fn the_chosen_axes_are_cut_and_an_odd_object_goes_to_the_left() {
        for (axis, boxes, expected, end_of_left) in [
            // The root is cut along x, its children along y.
            (CutAxis::Alternating, &zigzag(4)[..], &[0, 1, 2, 3][..], 3.0),
            (CutAxis::Longest, &zigzag(4), &[0, 2, 1, 3], 5.0),
            // Along y, object 1 would be first.
            (CutAxis::X, &zigzag(5)[1..], &[0, 1, 2, 3], 5.0),
            (CutAxis::X, &zigzag(5), &[0, 1, 2, 3, 4], 5.0),
        ] {
            let tree = Config { axis, ..Config::default() }.build(boxes).unwrap();
            assert_eq!(tree.prim_ids, expected, "{axis:?}");
            assert_eq!(tree.nodes[1].aabb.max.x, end_of_left, "{axis:?}");
        }
    }

    #[test]
    fn leaves_hold_at_most_the_given_fraction_of_all_objects() {
        for (fraction, expected) in [(0.1, 7), (0.0, 1), (1.0, 75)] {
            let tree = Config { axis: CutAxis::Longest, leaf_fraction: fraction }
                .build(&zigzag(75))
                .unwrap();
            let largest = tree.nodes.iter().filter_map(|node| match node.kind() {
                NodeKind::Leaf { count, .. } => Some(count),
                NodeKind::Inner { .. } => None,
            });
            assert!(largest.max().unwrap() <= expected, "fraction {fraction}");
        }
    }
}
