//! Agglomerative clustering: bottom-up, join clusters that are each other's nearest nearby.
//!
//! Meister & Bittner 2018, 'Parallel locally-ordered clustering for bounding volume hierarchy construction'. Clusters
//! lie along a space-filling curve; each finds the nearest among its `radius` neighbours on either side, by the area of
//! the box around both, and those that find each other are joined, round by round.
//!
//! Differs from the paper: Morton cells are cubes, so that flat scenes are not distorted; the first rounds may look at
//! next neighbours only; of equally near neighbours that is taken whose position has the least exclusive or with the
//! cluster's own, so that regular grids divide by powers of two and clusters without a difference pair off; a round
//! after one that joined few also joins neighbours along the curve, so that there are O(log n) rounds whatever the
//! scene.

mod curve;
mod nearest;

use crate::presort::check_scene;
use crate::{BuildError, Builder, Check};
use bvh_core::{Aabb, Bvh, Node, PackedAabb};
use nearest::{CHUNK, Scratch};
use std::mem::MaybeUninit;

crate::config! {
    /// How far to look for a neighbour.
    pub struct Config {
        /// Clusters looked at on either side.
        radius: u32 = 24, in 1..=1000;
        /// Number of first rounds that look only at the next cluster on either side: faster, and often no worse.
        near_rounds: u32 = 0;
    }
}

impl Builder for Config {
    /// O(radius · n), and a radix sort. Neighbours are looked for on all threads of the current rayon pool, with the
    /// same result as on one.
    fn build(&self, boxes: &[Aabb]) -> Result<Bvh, BuildError> {
        self.check()?;
        Along::new(boxes)?.build(self)
    }
}

/// The objects of a scene along the curve: what is the same for every radius.
#[derive(Clone, Debug)]
pub struct Along {
    /// One box per object, by index.
    boxes: Vec<PackedAabb>,
    /// The box around all.
    all: PackedAabb,
    /// The objects along the curve.
    order: Vec<u32>,
}

impl Along {
    /// Checks and sorts: a radix sort in O(n), O(n log n) if most objects are within a thousandth of the scene.
    pub fn new(boxes: &[Aabb]) -> Result<Self, BuildError> {
        check_scene(boxes)?;
        let boxes: Vec<PackedAabb> = boxes.iter().map(PackedAabb::from).collect();
        let all = boxes.iter().fold(PackedAabb::EMPTY, |all, b| all.union(b));
        let order = curve::order(&boxes);
        Ok(Self { boxes, all, order })
    }

    /// The objects along the curve.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Clusters what was sorted.
    pub fn build(self, config: &Config) -> Result<Bvh, BuildError> {
        config.check()?;
        let Self { boxes, all, order } = self;
        if boxes.is_empty() {
            return Ok(Bvh::default());
        }
        let scale = scale(&all);
        let mut clusters = Clusters::new(order.iter().map(|&object| boxes[object as usize]).collect());
        let mut round = 0;
        while clusters.boxes.len() > 1 {
            let radius = if round < config.near_rounds { 1 } else { config.radius as usize };
            clusters.find_nearest(scale, radius);
            clusters.join();
            round += 1;
        }
        Ok(Bvh { nodes: clusters.into_nodes(), prim_ids: order })
    }
}

/// The power of two that brings the longest side of the box around all to between 1 and 2. 1 if it has no extent.
fn scale(all: &PackedAabb) -> f64 {
    let side = all.extent().max_element();
    if side > 0.0 { 2f64.powi(-libm::ilogb(side)) } else { 1.0 }
}

/// Marks what is above a cluster as an object.
const LEAF: u32 = 1 << 31;

/// The subtrees that are not yet joined, along the curve, and the nodes below them.
struct Clusters {
    boxes: Vec<PackedAabb>,
    /// What is below each: its first child, or the object's position along the curve and [`LEAF`].
    below: Vec<u32>,
    /// How far on the nearest neighbour of each is.
    nearest: Vec<i32>,
    /// The first clusters of the pairs joined in a round, and the clusters that are left after it.
    joined: Vec<u32>,
    kept: Vec<u32>,
    /// The tree's nodes, filled from the last to the first, so that parents come before their children. They are not
    /// filled with anything before, which would take a fifteenth of the time.
    nodes: Box<[MaybeUninit<Node>]>,
    /// Nodes not yet filled.
    free: usize,
    /// Whether the last round joined few.
    slow: bool,
    scratch: Scratch,
}

/// A round that joins fewer pairs than one for so many clusters is slow.
const SLOW: usize = 32;

impl Clusters {
    /// One object each.
    fn new(boxes: Vec<PackedAabb>) -> Self {
        let n = boxes.len();
        Self {
            boxes,
            below: (0..n as u32).map(|at| at | LEAF).collect(),
            nearest: vec![0; n],
            joined: vec![0; n],
            kept: vec![0; n],
            nodes: Box::new_uninit_slice(2 * n - 1),
            free: 2 * n - 1,
            slow: false,
            scratch: Scratch::default(),
        }
    }

    fn find_nearest(&mut self, scale: f64, radius: usize) {
        let nearest = &mut self.nearest[..self.boxes.len()];
        #[cfg(feature = "rayon")]
        if nearest.len() * radius >= PARALLEL_PAIRS && rayon::current_num_threads() > 1 {
            use rayon::prelude::*;
            nearest.par_chunks_mut(CHUNK).enumerate().for_each_init(
                Scratch::default,
                |scratch, (number, found)| {
                    nearest::find(&self.boxes, scale, radius, number * CHUNK, found, scratch);
                },
            );
            return;
        }
        for (number, found) in nearest.chunks_mut(CHUNK).enumerate() {
            nearest::find(&self.boxes, scale, radius, number * CHUNK, found, &mut self.scratch);
        }
    }

    /// Whether the cluster is its nearest's nearest.
    #[inline(always)]
    fn is_mutual(&self, at: usize) -> bool {
        self.nearest[at.wrapping_add_signed(self.nearest[at] as isize)] == -self.nearest[at]
    }

    /// Lets clusters next to each other find each other where they found nobody.
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

    /// Joins clusters that are each other's nearest, in the place of the first of the two. The others keep their order.
    fn join(&mut self) {
        if self.slow {
            self.pair_the_rest();
        }
        let count = self.boxes.len();
        let (nearest, joined, kept) =
            (&self.nearest[..count], &mut self.joined[..count], &mut self.kept[..count]);
        // Whether a cluster is joined cannot be predicted: no branch depends on it.
        let (mut pairs, mut left) = (0, 0);
        for at in 0..count {
            let far = nearest[at];
            let other = at.wrapping_add_signed(far as isize);
            let mutual = nearest[other] == -far;
            (joined[pairs], kept[left]) = (at as u32, at as u32);
            pairs += usize::from(mutual & (far > 0));
            left += usize::from(!mutual | (far > 0));
        }
        let (boxes, below) = (&mut self.boxes[..count], &mut self.below[..count]);
        for at in joined[..pairs].iter().map(|&at| at as usize) {
            let other = at.wrapping_add_signed(nearest[at] as isize);
            self.free -= 2;
            let pair = &mut self.nodes[self.free..][..2];
            pair[0].write(node((boxes[at], below[at])));
            pair[1].write(node((boxes[other], below[other])));
            (boxes[at], below[at]) = (boxes[at].union(&boxes[other]), self.free as u32);
        }
        for (to, at) in kept[..left].iter().map(|&at| at as usize).enumerate() {
            (boxes[to], below[to]) = (boxes[at], below[at]);
        }
        self.slow = pairs < count.div_ceil(SLOW);
        self.boxes.truncate(left);
    }

    /// The nodes, when one cluster is left.
    fn into_nodes(mut self) -> Vec<Node> {
        self.nodes[0].write(node((self.boxes[0], self.below[0])));
        assert_eq!(self.free, 1);
        // SAFETY: `free` began at the number of nodes, and each time it was lowered, to 1 in the end, those passed were
        // filled; node 0 has just been.
        unsafe { self.nodes.assume_init() }.into_vec()
    }
}

/// Clusters times radius from which on threads pay.
#[cfg(feature = "rayon")]
const PARALLEL_PAIRS: usize = 1 << 16;

/// The node of a cluster.
#[inline(always)]
fn node((aabb, below): (PackedAabb, u32)) -> Node {
    let aabb = Aabb::from(&aabb);
    let (leaf, inner) = (Node::leaf(aabb, below & !LEAF, 1), Node::inner(aabb, below, 2));
    if below & LEAF != 0 { leaf } else { inner }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::validate;
    use proptest::prelude::*;

    fn cube(at: [f32; 3], size: f32) -> Aabb {
        Aabb::from((at, at.map(|c| c + size)))
    }

    fn scatter(n: u32) -> Vec<Aabb> {
        let hash = |i: u32, salt: u32| (i.wrapping_mul(2_654_435_761).rotate_left(salt) % 65_521) as f32;
        (0..n).map(|i| cube([hash(i, 3), hash(i, 11), hash(i, 19)], hash(i, 27) / 32.0)).collect()
    }

    #[test]
    fn trees_are_valid_and_tight() {
        for n in [0, 1, 2, 3, 4, 5, 100, 3000] {
            let boxes = scatter(n);
            let tree = Config::default().build(&boxes).unwrap();
            validate(&tree, &boxes).unwrap();
            assert!(tree.is_tight(&boxes));
        }
    }

    #[test]
    fn a_radius_over_all_objects_joins_the_closest_pair_first() {
        let boxes = [0.0, 100.0, 10.0, 107.0].map(|x| cube([x, 0.0, 0.0], 1.0));
        let tree = Config { radius: 4, ..Config::default() }.build(&boxes).unwrap();
        let sides: Vec<f32> = tree.nodes[0].children().map(|child| tree.nodes[child].aabb.max.x).collect();
        assert_eq!(sides, [11.0, 108.0]);
    }

    #[test]
    fn clusters_without_a_difference_pair_off_into_a_balanced_tree() {
        for boxes in [vec![cube([0.1; 3], 1.0); 1 << 12], vec![cube([0.1; 3], 0.0); 1 << 12]] {
            assert_eq!(Config::default().build(&boxes).unwrap().depth(), 12);
        }
    }

    #[test]
    fn no_scene_takes_more_rounds_than_a_multiple_of_the_logarithm() {
        // One inside the other: every cluster's nearest is the smallest.
        let boxes: Vec<Aabb> = (1..20_000u16).map(|i| cube([-f32::from(i); 3], 2.0 * f32::from(i))).collect();
        let tree = Config::default().build(&boxes).unwrap();
        validate(&tree, &boxes).unwrap();
        assert!(tree.depth() < 1000, "{}", tree.depth());
    }

    #[test]
    fn neither_threads_nor_a_scale_by_powers_of_two_change_the_tree() {
        let boxes = scatter(5000);
        let tree = Config::default().build(&boxes).unwrap();
        #[cfg(feature = "rayon")]
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| Config::default().build(&boxes).unwrap()), tree);
        }
        for factor in [2f32.powi(-100), 2f32.powi(-60), 2f32.powi(60), 2f32.powi(100)] {
            let scaled: Vec<Aabb> =
                boxes.iter().map(|b| Aabb { min: b.min * factor, max: b.max * factor }).collect();
            assert_eq!(Config::default().build(&scaled).unwrap().prim_ids, tree.prim_ids);
        }
    }

    /// The objects below every inner node, sorted, by the definition: no arrays of planes, no f32, no early exit.
    fn oracle(boxes: &[Aabb], config: &Config) -> Vec<Vec<u32>> {
        let packed: Vec<PackedAabb> = boxes.iter().map(PackedAabb::from).collect();
        let mut clusters: Vec<(Aabb, Vec<u32>)> =
            curve::order(&packed).into_iter().map(|id| (boxes[id as usize], vec![id])).collect();
        let (mut joined, mut slow) = (Vec::new(), false);
        for round in 0.. {
            let n = clusters.len();
            if n == 1 {
                break;
            }
            let radius = if round < config.near_rounds { 1 } else { config.radius as usize };
            let key = |at: usize, other: usize| {
                let area = clusters[at].0.union(&clusters[other].0).half_area();
                (area, at ^ other)
            };
            let nearest = |at: usize| {
                let others = (at.saturating_sub(radius)..n.min(at + radius + 1)).filter(|&other| other != at);
                others.min_by(|&a, &b| key(at, a).partial_cmp(&key(at, b)).unwrap()).unwrap()
            };
            let mut nearest: Vec<usize> = (0..n).map(nearest).collect();
            let mutual = |nearest: &[usize], at: usize| nearest[nearest[at]] == at;
            for at in 0..n - 1 {
                if slow && !mutual(&nearest, at) && !mutual(&nearest, at + 1) {
                    (nearest[at], nearest[at + 1]) = (at + 1, at);
                }
            }
            let mut next = Vec::new();
            for at in 0..n {
                let other = nearest[at];
                if !mutual(&nearest, at) {
                    next.push(clusters[at].clone());
                } else if other > at {
                    let mut ids = [clusters[at].1.clone(), clusters[other].1.clone()].concat();
                    ids.sort_unstable();
                    joined.push(ids.clone());
                    next.push((clusters[at].0.union(&clusters[other].0), ids));
                }
            }
            slow = n - next.len() < n.div_ceil(SLOW);
            clusters = next;
        }
        joined.sort();
        joined
    }

    fn below_inner_nodes(tree: &Bvh) -> Vec<Vec<u32>> {
        let mut below: Vec<Vec<u32>> = vec![Vec::new(); tree.nodes.len()];
        for at in (0..tree.nodes.len()).rev() {
            let node = &tree.nodes[at];
            let mut ids = tree.prim_ids[node.prims()].to_vec();
            node.children().for_each(|child| ids.extend_from_slice(&below[child]));
            ids.sort_unstable();
            below[at] = ids;
        }
        let mut inner: Vec<_> = below.into_iter().filter(|ids| ids.len() > 1).collect();
        inner.sort();
        inner
    }

    proptest! {
        #[test]
        fn trees_are_those_of_the_definition(
            // Small integers: areas are exact in f32, and many are equal.
            corners in prop::collection::vec(([0u8..40, 0u8..40, 0u8..6], [0u8..5, 0u8..5, 0u8..5]), 1..90),
            radius in 1u32..30, near_rounds in 0u32..3, exponent in prop::sample::select(vec![-60, 0, 100]),
        ) {
            let place = |c: u8| f32::from(c) * 2f32.powi(exponent);
            let boxes: Vec<Aabb> = corners
                .iter()
                .map(|(low, size)| Aabb::from((low.map(place), [0, 1, 2].map(|axis| place(low[axis] + size[axis])))))
                .collect();
            let config = Config { radius, near_rounds };
            let tree = config.build(&boxes).unwrap();
            prop_assert!(validate(&tree, &boxes).is_ok());
            prop_assert_eq!(below_inner_nodes(&tree), oracle(&boxes, &config));
        }

        #[test]
        fn any_finite_boxes_give_a_valid_tree(
            corners in prop::collection::vec(prop::array::uniform6(prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL
                | prop::num::f32::ZERO), 1..60),
            radius in 1u32..20,
        ) {
            let boxes: Vec<Aabb> = corners
                .iter()
                .map(|&[a, b, c, d, e, f]| Aabb::from(([a.min(d), b.min(e), c.min(f)], [a.max(d), b.max(e), c.max(f)])))
                .collect();
            let tree = Config { radius, ..Config::default() }.build(&boxes).unwrap();
            prop_assert!(validate(&tree, &boxes).is_ok());
        }
    }

    #[test]
    fn a_plane_far_from_the_origin_for_its_size_does_not_hide_areas() {
        let flat = |x: f32| -> Vec<Aabb> {
            let rows = [0.0f32, 10.0, 11.0, 20.0, 21.0, 30.0, 31.0, 40.0].map(|row| row * 1e-10);
            rows.map(|y| Aabb::from(([x, y, 0.0], [x, y + 1e-10, 1e-10]))).to_vec()
        };
        assert_eq!(below_inner_nodes(&built(&flat(1e32))), below_inner_nodes(&built(&flat(0.0))));
        assert!(below_inner_nodes(&built(&flat(1e32))).contains(&vec![1, 2]));
    }

    fn built(boxes: &[Aabb]) -> Bvh {
        Config::default().build(boxes).unwrap()
    }

    #[test]
    fn a_radius_outside_its_range_is_named() {
        for radius in [0, 1001] {
            let error = Config { radius, ..Config::default() }.build(&[]).unwrap_err().to_string();
            assert_eq!(error, format!("radius is {radius}; accepted: 1 to 1000"));
        }
    }
}
