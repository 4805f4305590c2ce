//! Slabs: what lies at one side of a node's box. The box shrinks only when all of that is gone, which subtrees taken out
//! here and there seldom bring about.

use crate::stream::Stream;
use crate::working::Working;
use rand::RngExt;

/// The largest subtrees in a slab.
#[derive(Debug, Default)]
pub(crate) struct Slab {
    pub roots: Vec<u32>,
    stack: Vec<u32>,
}

impl Slab {
    /// A slab at a random side of the box of `top`, of a random thickness up to this part of the box: the largest
    /// subtrees below that lie in it, and the leaves that reach the side through it. None if they were more than `most`.
    /// Returns the nodes visited.
    #[inline(always)]
    pub fn find(&mut self, tree: &Working, top: u32, thickness: f64, most: usize, rng: &mut Stream) -> u64 {
        self.roots.clear();
        self.stack.clear();
        let (side, axis) = (rng.random_range(0..2), rng.random_range(0..3));
        // Where a node begins and ends, seen from within along the axis. In f64, so that scenes of all scales are alike.
        let span = |at: u32| {
            let planes = tree.nodes[at as usize].aabb.planes();
            (-f64::from(planes[1 - side][axis]), f64::from(planes[side][axis]))
        };
        let (begin, end) = span(top);
        let limit = end - thickness * rng.random::<f64>() * (end - begin);
        let mut visits = 0;
        self.stack.extend(tree.nodes[top as usize].children);
        while let Some(at) = self.stack.pop() {
            let (node, (near, far)) = (&tree.nodes[at as usize], span(at));
            visits += 1;
            if far <= limit {
                continue;
            }
            if near >= limit || (node.is_leaf() && far >= end) {
                if self.roots.len() == most {
                    self.roots.clear();
                    break;
                }
                self.roots.push(at);
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
    use crate::scatter::{built, scatter};
    use crate::stream::stream;
    use crate::working::ANCHOR;
    use bvh_build::muller_fellner;

    #[test]
    fn a_box_shrinks_when_a_slab_of_it_is_taken_out() {
        let boxes = scatter(300);
        let mut tree = built(&muller_fellner::Config::default(), &boxes);
        let (mut rng, mut slab, mut found) = (stream(8, 0), Slab::default(), 0);
        for _ in 0..2000 {
            let top = rng.random_range(1..tree.nodes.len() as u32);
            let Some(above) = Some(tree.nodes[top as usize].parent).filter(|&above| above != ANCHOR) else {
                continue;
            };
            if tree.nodes[top as usize].is_leaf() {
                continue;
            }
            let side = usize::from(tree.nodes[above as usize].children[1] == top);
            let before = (tree.nodes[top as usize].aabb, tree.area().to_bits());
            assert!(slab.find(&tree, top, 0.6, 24, &mut rng) >= 2);
            assert!(slab.roots.len() <= 24);
            tree.begin();
            for &node in &slab.roots {
                if tree.nodes[above as usize].children[side] != node {
                    tree.detach(node);
                }
            }
            let after = tree.nodes[tree.nodes[above as usize].children[side] as usize].aabb;
            if !slab.roots.is_empty() {
                let planes = |aabb: &bvh_core::PackedAabb| aabb.planes().concat();
                assert!(planes(&after).iter().zip(planes(&before.0)).any(|(&after, before)| after < before));
                found += 1;
            }
            tree.undo();
            assert_eq!(before, (tree.nodes[top as usize].aabb, tree.area().to_bits()));
        }
        assert!(found > 500, "{found}");
    }
}
