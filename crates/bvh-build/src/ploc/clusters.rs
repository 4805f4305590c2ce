//! The rounds of the clustering: clusters in Morton order, their nearest neighbours, and the nodes
//! of joined clusters.

use super::neighbours::{self, CHUNK, Scratch};
use bvh_core::cost::Measure;
use bvh_core::{Aabb, Node, PackedAabb};
use std::mem::MaybeUninit;

/// Marks an object in an entry of [`Clusters::below`].
const LEAF: u32 = 1 << 31;

/// A round joins few clusters if it joins less than one pair per `FEW` clusters.
pub(super) const FEW: usize = 32;

/// Least product of clusters and radius for which threads pay.
#[cfg(feature = "rayon")]
const PARALLEL_PAIRS: usize = 1 << 16;

/// The subtrees that are not yet joined, in Morton order, and the nodes below them.
pub(super) struct Clusters {
    boxes: Vec<PackedAabb>,
    /// Per cluster, the index of its first child, or the position of its object in Morton order
    /// with [`LEAF`].
    below: Vec<u32>,
    /// Per cluster, the distance to its nearest neighbour; negative if the neighbour comes before
    /// the cluster.
    nearest: Vec<i32>,
    /// The power of two that scales the scene's longest side to between 1 and 2.
    scale: f64,
    /// Scratch space of a round: the first clusters of the joined pairs, and the clusters that
    /// remain.
    joined: Vec<u32>,
    kept: Vec<u32>,
    /// The tree's nodes, filled from the last to the first, so that parents come before their
    /// children. Initialising them first would take a fifteenth of the build.
    nodes: Box<[MaybeUninit<Node>]>,
    free: usize,
    joined_few: bool,
    scratch: Scratch,
}

impl Clusters {
    /// Makes one cluster per box. There is at least one box, and `bounds` is around all of them.
    pub(super) fn new(boxes: Vec<PackedAabb>, bounds: &PackedAabb) -> Self {
        let n = boxes.len();
        let side = bounds.extent().max_element();
        Self {
            boxes,
            below: (0..n as u32).map(|index| index | LEAF).collect(),
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

    pub(super) fn count(&self) -> usize {
        self.boxes.len()
    }

    /// Finds every cluster's nearest neighbour up to `radius` positions away, by half area or by a
    /// measure.
    pub(super) fn find_nearest(&mut self, radius: usize, measure: Option<&dyn Measure>) {
        let Self { boxes, scale, scratch, .. } = self;
        let nearest = &mut self.nearest[..boxes.len()];
        let find = |scratch: &mut Scratch, (number, found): (usize, &mut [i32])| {
            neighbours::find(boxes, *scale, measure, radius, number * CHUNK, found, scratch);
        };
        #[cfg(feature = "rayon")]
        if nearest.len() * radius >= PARALLEL_PAIRS && rayon::current_num_threads() > 1 {
            use rayon::prelude::*;
            let chunks = nearest.par_chunks_mut(CHUNK).enumerate();
            return chunks.for_each_init(Scratch::default, find);
        }
        nearest.chunks_mut(CHUNK).enumerate().for_each(|chunk| find(scratch, chunk));
    }

    #[inline(always)]
    fn is_mutual(&self, index: usize) -> bool {
        self.nearest[index.wrapping_add_signed(self.nearest[index] as isize)]
            == -self.nearest[index]
    }

    /// Pairs adjacent clusters that have no mutual nearest neighbour.
    fn pair_the_rest(&mut self) {
        let mut index = 0;
        while index + 1 < self.boxes.len() {
            if self.is_mutual(index) || self.is_mutual(index + 1) {
                index += 1;
            } else {
                (self.nearest[index], self.nearest[index + 1]) = (1, -1);
                index += 2;
            }
        }
    }

    /// Joins mutual nearest neighbours at the position of the first of the two. The other clusters
    /// keep their order.
    pub(super) fn join(&mut self) {
        if self.joined_few {
            self.pair_the_rest();
        }
        let count = self.boxes.len();
        let nearest = &self.nearest[..count];
        let joined = &mut self.joined[..count];
        let kept = &mut self.kept[..count];
        // The processor cannot predict which clusters are joined, so no branch depends on it.
        let mut pairs = 0;
        let mut left = 0;
        for index in 0..count {
            let far = nearest[index];
            let other = index.wrapping_add_signed(far as isize);
            let mutual = nearest[other] == -far;
            // Always written, and kept only if the counter advances.
            (joined[pairs], kept[left]) = (index as u32, index as u32);
            pairs += usize::from(mutual & (far > 0));
            left += usize::from(!mutual | (far > 0));
        }
        let boxes = &mut self.boxes[..count];
        let below = &mut self.below[..count];
        for index in joined[..pairs].iter().map(|&index| index as usize) {
            let other = index.wrapping_add_signed(nearest[index] as isize);
            // Later joins are nearer to the root, so filling from the end puts parents before
            // children.
            self.free -= 2;
            let pair = &mut self.nodes[self.free..][..2];
            pair[0].write(node((boxes[index], below[index])));
            pair[1].write(node((boxes[other], below[other])));
            (boxes[index], below[index]) = (boxes[index].union(&boxes[other]), self.free as u32);
        }
        for (to, index) in kept[..left].iter().map(|&index| index as usize).enumerate() {
            (boxes[to], below[to]) = (boxes[index], below[index]);
        }
        self.joined_few = pairs < count.div_ceil(FEW);
        self.boxes.truncate(left);
    }

    /// Returns the nodes, once a single cluster remains.
    pub(super) fn into_nodes(mut self) -> Vec<Node> {
        self.nodes[0].write(node((self.boxes[0], self.below[0])));
        assert_eq!(self.free, 1);
        // SAFETY: all nodes are initialised. `free` started at the number of nodes and ended at 1;
        // `join` writes both nodes whenever it lowers `free` by two, and node 0 is written above.
        unsafe { self.nodes.assume_init() }.into_vec()
    }
}

#[inline(always)]
fn node((aabb, below): (PackedAabb, u32)) -> Node {
    let aabb = Aabb::from(&aabb);
    // Both are built and one is selected, because the kind of a cluster is unpredictable.
    let leaf = Node::leaf(aabb, below & !LEAF, 1);
    let inner = Node::inner(aabb, below, 2);
    if below & LEAF != 0 { leaf } else { inner }
}
