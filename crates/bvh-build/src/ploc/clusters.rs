//! The rounds of the clustering: clusters in Morton order, their nearest neighbours, and the nodes of joined ones.

use super::neighbours::{self, CHUNK, Scratch};
use crate::{OBJECTS_PER_POLL, Watch};
use bvh_core::cost::Measure;
use bvh_core::{Aabb, Node, PackedAabb};
use std::mem::MaybeUninit;

/// In an entry of [`Clusters::below`], marks an object.
const LEAF: u32 = 1 << 31;

/// A round joins few clusters if it joins fewer pairs than one per this many clusters.
pub(super) const FEW: usize = 32;

/// Clusters times radius from which on threads pay.
#[cfg(feature = "rayon")]
const PARALLEL_PAIRS: usize = 1 << 16;

/// The subtrees that are not yet joined, in Morton order, and the nodes below them.
pub(super) struct Clusters {
    /// One box per cluster.
    boxes: Vec<PackedAabb>,
    /// Per cluster, the index of its first child, or the position of its object in Morton order with [`LEAF`].
    below: Vec<u32>,
    /// Per cluster, the distance to its nearest neighbour, negative if that comes before it.
    nearest: Vec<i32>,
    /// The power of two that brings the scene's longest side to between 1 and 2.
    scale: f64,
    /// Scratch space of a round: the first clusters of the pairs that are joined, and the clusters that remain.
    joined: Vec<u32>,
    kept: Vec<u32>,
    /// The tree's nodes, filled from the last to the first, so that parents come before their children. Initialising
    /// them before would take a fifteenth of the build.
    nodes: Box<[MaybeUninit<Node>]>,
    /// Number of nodes not yet filled.
    free: usize,
    /// Whether the last round joined few clusters.
    joined_few: bool,
    scratch: Scratch,
}

impl Clusters {
    /// One cluster per box; `bounds` is around all of them. At least one box.
    pub(super) fn new(boxes: Vec<PackedAabb>, bounds: &PackedAabb) -> Self {
        let n = boxes.len();
        let side = bounds.extent().max_element();
        Self {
            boxes,
            below: (0..n as u32).map(|at| at | LEAF).collect(),
            nearest: vec![0; n],
            scale: if side > 0.0 { 2f64.powi(-libm::ilogb(side)) } else { 1.0 },
            joined: vec![0; n],
            kept: vec![0; n],
            nodes: Box::new_uninit_slice(2 * n - 1),
            free: 2 * n - 1,
            joined_few: false,
            scratch: Scratch::default(),
        }
    }

    /// Number of clusters that are not yet joined.
    pub(super) fn count(&self) -> usize {
        self.boxes.len()
    }

    /// Finds every cluster's nearest neighbour up to `radius` positions away, by half area or by a measure. Once the `watch` has
    /// ended the construction, not every cluster gets one.
    pub(super) fn find_nearest(
        &mut self,
        radius: usize,
        measure: Option<&dyn Measure>,
        watch: &Watch,
    ) {
        let scale = self.scale;
        let nearest = &mut self.nearest[..self.boxes.len()];
        let chunks_per_poll = OBJECTS_PER_POLL / CHUNK;
        let ends_at =
            |number: usize| number % chunks_per_poll == chunks_per_poll - 1 && watch.is_cancelled();
        #[cfg(feature = "rayon")]
        if nearest.len() * radius >= PARALLEL_PAIRS && rayon::current_num_threads() > 1 {
            use rayon::prelude::*;
            nearest
                .par_chunks_mut(CHUNK)
                .enumerate()
                .for_each_init(Scratch::default, |scratch, (number, found)| {
                    if ends_at(number) {
                        return;
                    }
                    neighbours::find(
                        &self.boxes,
                        scale,
                        measure,
                        radius,
                        number * CHUNK,
                        found,
                        scratch,
                    );
                });
            return;
        }
        for (number, found) in nearest.chunks_mut(CHUNK).enumerate() {
            if ends_at(number) {
                return;
            }
            neighbours::find(
                &self.boxes,
                scale,
                measure,
                radius,
                number * CHUNK,
                found,
                &mut self.scratch,
            );
        }
    }

    /// Whether the cluster is the nearest neighbour of its own nearest neighbour.
    #[inline(always)]
    fn is_mutual(&self, at: usize) -> bool {
        self.nearest[at.wrapping_add_signed(self.nearest[at] as isize)] == -self.nearest[at]
    }

    /// Pairs adjacent clusters that have no mutual nearest neighbour.
    fn pair_the_rest(&mut self) {
        let mut at = 0;
        while at + 1 < self.boxes.len() {
            if self.is_mutual(at) || self.is_mutual(at + 1) {
                at += 1;
            } else {
                (self.nearest[at], self.nearest[at + 1]) = (1, -1);
                at += 2;
            }
        }
    }

    /// Joins mutual nearest neighbours at the position of the first of the two. The other clusters keep their order.
    pub(super) fn join(&mut self) {
        if self.joined_few {
            self.pair_the_rest();
        }
        let count = self.boxes.len();
        let nearest = &self.nearest[..count];
        let joined = &mut self.joined[..count];
        let kept = &mut self.kept[..count];
        // Whether a cluster is joined is unpredictable, so no branch depends on it.
        let mut pairs = 0;
        let mut left = 0;
        for at in 0..count {
            let far = nearest[at];
            let other = at.wrapping_add_signed(far as isize);
            let mutual = nearest[other] == -far;
            (joined[pairs], kept[left]) = (at as u32, at as u32);
            pairs += usize::from(mutual & (far > 0));
            left += usize::from(!mutual | (far > 0));
        }
        let boxes = &mut self.boxes[..count];
        let below = &mut self.below[..count];
        for at in joined[..pairs].iter().map(|&at| at as usize) {
            let other = at.wrapping_add_signed(nearest[at] as isize);
            self.free -= 2;
            let pair = &mut self.nodes[self.free..][..2];
            pair[0].write(node((boxes[at], below[at])));
            pair[1].write(node((boxes[other], below[other])));
            (boxes[at], below[at]) = (boxes[at].union(&boxes[other]), self.free as u32);
        }
        for (to, at) in kept[..left]
            .iter()
            .map(|&at| at as usize)
            .enumerate()
        {
            (boxes[to], below[to]) = (boxes[at], below[at]);
        }
        self.joined_few = pairs < count.div_ceil(FEW);
        self.boxes.truncate(left);
    }

    /// The nodes, once a single cluster remains.
    pub(super) fn into_nodes(mut self) -> Vec<Node> {
        self.nodes[0].write(node((self.boxes[0], self.below[0])));
        assert_eq!(self.free, 1);
        // SAFETY: `free` started at the number of nodes and ended at 1. Whenever it was lowered, the nodes that it
        // passed were filled, and node 0 has just been.
        unsafe { self.nodes.assume_init() }.into_vec()
    }
}

/// The node of a cluster.
#[inline(always)]
fn node((aabb, below): (PackedAabb, u32)) -> Node {
    let aabb = Aabb::from(&aabb);
    let leaf = Node::leaf(aabb, below & !LEAF, 1);
    let inner = Node::inner(aabb, below, 2);
    if below & LEAF != 0 { leaf } else { inner }
}
