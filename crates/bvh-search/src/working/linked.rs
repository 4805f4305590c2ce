//! The working form as a tree in which places are looked for.

use super::{ANCHOR, Working};
use crate::place::Linked;
use bvh_core::PackedAabb;

impl Linked for Working {
    const ABOVE: u32 = ANCHOR;

    #[inline(always)]
    fn parent(&self, at: u32) -> u32 {
        self.nodes[at as usize].parent
    }

    #[inline(always)]
    fn children(&self, at: u32) -> Option<[u32; 2]> {
        let node = &self.nodes[at as usize];
        (!node.is_leaf()).then_some(node.children)
    }

    #[inline(always)]
    fn other(&self, at: u32, child: u32) -> u32 {
        self.nodes[at as usize].other(child)
    }

    #[inline(always)]
    fn aabb(&self, at: u32) -> PackedAabb {
        self.nodes[at as usize].aabb
    }

    #[inline(always)]
    fn area(&self, at: u32) -> f64 {
        self.nodes[at as usize].area
    }

    #[inline(always)]
    fn reinsert(&mut self, node: u32, place: u32) -> u64 {
        self.begin();
        let (_, _, visits) = self.detach(node);
        visits + self.attach(node, place).1
    }
}
