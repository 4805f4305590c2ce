//! Removal of one side of a node's box: of everything in a layer there. The box shrinks only when
//! the whole layer is gone, which the removal of scattered subtrees seldom achieves.

use crate::run::Stream;
use crate::tree::{Metric, Working};
use rand::RngExt;

/// The largest subtrees in a layer at one side of a box.
#[derive(Debug, Default)]
pub(crate) struct Side {
    pub roots: Vec<u32>,
    stack: Vec<u32>,
}

impl Side {
    /// Finds the content of a layer at a random side of the box of `top`, of a random thickness up
    /// to the fraction `thickness` of the box: the largest subtrees inside the layer, and the
    /// leaves that extend through it to the side. Finds nothing if they are more than `most`.
    /// Returns the number of nodes visited.
    #[inline(always)]
    pub fn find(
        &mut self,
        tree: &Working<impl Metric>,
        top: u32,
        thickness: f64,
        most: usize,
        rng: &mut Stream,
    ) -> u64 {
        self.roots.clear();
        self.stack.clear();
        let side = rng.random_range(0..2);
        let axis = rng.random_range(0..3);
        // The interval of a node along the axis, towards the side. The arithmetic in f64 cannot
        // overflow or underflow, so the scale of the scene has no effect.
        let span = |index: u32| {
            let planes = tree.nodes[index as usize].aabb.planes();
            (-f64::from(planes[1 - side][axis]), f64::from(planes[side][axis]))
        };
        let (begin, end) = span(top);
        let limit = end - thickness * rng.random::<f64>() * (end - begin);
        let mut visits = 0;
        self.stack.extend(tree.nodes[top as usize].children);
        while let Some(index) = self.stack.pop() {
            let node = &tree.nodes[index as usize];
            let (near, far) = span(index);
            visits += 1;
            // The subtree ends before the layer.
            if far <= limit {
                continue;
            }
            // A leaf that crosses the limit but does not reach the side need not go for the box to
            // shrink.
            if near >= limit || (node.is_leaf() && far >= end) {
                // Too many subtrees: the move would cost more work than it is likely to gain.
                if self.roots.len() == most {
                    self.roots.clear();
                    break;
                }
                self.roots.push(index);
            } else if !node.is_leaf() {
                self.stack.extend(node.children);
            }
        }
        visits
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::stream;
    use crate::scatter::{built, scatter};
    use crate::tree::ANCHOR;
    use bvh_build::muller_fellner;

    #[test]
    fn a_box_shrinks_when_one_side_of_it_is_removed() {
        let boxes = scatter(300);
        let mut tree = built(&muller_fellner::Config::default(), &boxes);
        let mut rng = stream(8, 0);
        let mut removed = Side::default();
        let mut found = 0;
        for _ in 0..2000 {
            let top = rng.random_range(1..tree.nodes.len() as u32);
            let Some(above) =
                Some(tree.nodes[top as usize].parent).filter(|&above| above != ANCHOR)
            else {
                continue;
            };
            if tree.nodes[top as usize].is_leaf() {
                continue;
            }
            let side = usize::from(tree.nodes[above as usize].children[1] == top);
            let before = (tree.nodes[top as usize].aabb, tree.area().to_bits());
            assert!(removed.find(&tree, top, 0.6, 24, &mut rng) >= 2);
            assert!(removed.roots.len() <= 24);
            tree.begin();
            for &node in &removed.roots {
                if tree.nodes[above as usize].children[side] != node {
                    tree.detach(node);
                }
            }
            let after = tree.nodes[tree.nodes[above as usize].children[side] as usize].aabb;
            if !removed.roots.is_empty() {
                let planes = |aabb: &bvh_core::PackedAabb| aabb.planes().concat();
                assert!(
                    planes(&after)
                        .iter()
                        .zip(planes(&before.0))
                        .any(|(&after, before)| after < before)
                );
                found += 1;
            }
            tree.undo();
            assert_eq!(before, (tree.nodes[top as usize].aabb, tree.area().to_bits()));
        }
        assert!(found > 500, "{found}");
    }
}
