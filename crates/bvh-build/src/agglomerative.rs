//! Agglomerative clustering: bottom-up, join clusters that are each other's nearest nearby.
//!
//! Meister & Bittner 2018, 'Parallel locally-ordered clustering for bounding volume hierarchy construction'. Clusters lie
//! along a space-filling curve; each finds the nearest among its `radius` neighbours on either side, by the area of the
//! box around both, and those that find each other are joined, round by round.
//!
//! Differs from the paper: Morton cells are cubes, so that flat scenes are not distorted; equally near neighbours are told
//! apart by the bits in which their positions differ, so that clusters without a difference pair off; a round that would
//! join few also joins neighbours along the curve, so that there are O(log n) rounds whatever the scene.

use crate::presort::check_scene;
use crate::{BuildError, Builder};
use bvh_core::{Aabb, Bvh, Node, PackedAabb, with_vector_instructions};

/// How far to look for a neighbour.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// Clusters looked at on either side, 1 to 1000. Default 24.
    pub radius: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self { radius: 24 }
    }
}

impl Builder for Config {
    /// O(radius · n), and a sort. Rounds run on all threads of the current rayon pool, with the same result as on one.
    fn build(&self, boxes: &[Aabb]) -> Result<Bvh, BuildError> {
        check_scene(boxes)?;
        if !(1..=1000).contains(&self.radius) {
            let (parameter, accepted) = ("radius", "1 to 1000");
            return Err(BuildError::Parameter { parameter, found: self.radius.into(), accepted });
        }
        let mut clusters: Vec<Cluster> =
            curve(boxes).into_iter().map(|object| Cluster::new(&boxes[object as usize], object)).collect();
        let mut joined: Vec<[Cluster; 2]> = Vec::with_capacity(boxes.len());
        while clusters.len() > 1 {
            let nearest = all_nearest(&clusters, self.radius as usize);
            clusters = join(&clusters, &nearest, boxes.len(), &mut joined);
        }
        Ok(clusters.first().map_or_else(Bvh::default, |root| to_bvh(*root, &joined, boxes.len())))
    }
}

/// A subtree: object `index`, or from `n` on the joint `index - n`.
#[derive(Clone, Copy, Debug)]
struct Cluster {
    aabb: PackedAabb,
    index: u32,
}

impl Cluster {
    fn new(aabb: &Aabb, index: u32) -> Self {
        Self { aabb: PackedAabb::from(aabb), index }
    }
}

/// The objects along the Morton curve through their box centres, equal codes by index. The grid has 2^21 cubes along the
/// longest side of the centres' box.
fn curve(boxes: &[Aabb]) -> Vec<u32> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for b in boxes {
        for axis in 0..3 {
            low[axis] = low[axis].min(b.doubled_centroid()[axis]);
            high[axis] = high[axis].max(b.doubled_centroid()[axis]);
        }
    }
    let side = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    let cells = if side > 0.0 { f64::from((1 << 21) - 1) / side } else { 0.0 };
    let mut keyed: Vec<(u64, u32)> = boxes
        .iter()
        .zip(0..)
        .map(|(b, index)| {
            let code = |axis: usize| spread(((b.doubled_centroid()[axis] - low[axis]) * cells) as u64);
            (code(0) << 2 | code(1) << 1 | code(2), index)
        })
        .collect();
    radsort::sort_by_key(&mut keyed, |&(code, _)| code);
    keyed.into_iter().map(|(_, index)| index).collect()
}

/// Moves bit i of 21 to bit 3·i.
fn spread(bits: u64) -> u64 {
    let mut bits = bits & 0x1f_ffff;
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        bits = (bits | bits << shift) & mask;
    }
    bits
}

/// Clusters whose neighbours are found by one task.
const CHUNK: usize = 1024;

/// The position of every cluster's nearest neighbour within `radius` positions, of at least two clusters.
fn all_nearest(clusters: &[Cluster], radius: usize) -> Vec<u32> {
    let mut nearest = vec![0; clusters.len()];
    let part = |(number, found): (usize, &mut [u32])| nearest_of(clusters, radius, number * CHUNK, found);
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        nearest.par_chunks_mut(CHUNK).enumerate().for_each(part);
    }
    #[cfg(not(feature = "rayon"))]
    nearest.chunks_mut(CHUNK).enumerate().for_each(part);
    nearest
}

with_vector_instructions! {
    /// The nearest neighbours of the clusters from `start` on, as many as `found` has room for.
    nearest_of = nearest_of_plain(clusters: &[Cluster], radius: usize, start: usize, found: &mut [u32])
}

#[inline(always)]
fn nearest_of_plain(clusters: &[Cluster], radius: usize, start: usize, found: &mut [u32]) {
    for (at, found) in (start..).zip(found) {
        let aabb = clusters[at].aabb;
        let mut best = (f64::INFINITY, usize::MAX, at);
        let first = at.saturating_sub(radius);
        for (other, cluster) in (first..).zip(&clusters[first..(at + radius + 1).min(clusters.len())]) {
            if other != at {
                // The same for both of a pair, and different for all pairs of one cluster.
                let area = aabb.union(&cluster.aabb).half_area();
                if (area, at ^ other) < (best.0, best.1) {
                    best = (area, at ^ other, other);
                }
            }
        }
        *found = best.2 as u32;
    }
}

/// A round that joins fewer pairs than one for so many clusters is helped.
const SLOW: usize = 32;

/// Joins clusters that are each other's nearest, in the place of the first of the two. The others keep their order.
fn join(clusters: &[Cluster], nearest: &[u32], n: usize, joined: &mut Vec<[Cluster; 2]>) -> Vec<Cluster> {
    let mutual = |at: usize| nearest[nearest[at] as usize] as usize == at;
    let pairs = (0..clusters.len()).filter(|&at| mutual(at)).count() / 2;
    let slow = pairs < clusters.len().div_ceil(SLOW);
    let mut next = Vec::with_capacity(clusters.len());
    let mut at = 0;
    while at < clusters.len() {
        let partner = if mutual(at) {
            nearest[at] as usize
        } else if slow && at + 1 < clusters.len() && !mutual(at + 1) {
            at + 1
        } else {
            at
        };
        if partner == at {
            next.push(clusters[at]);
        } else if partner > at {
            let pair = [clusters[at], clusters[partner]];
            next.push(Cluster { aabb: pair[0].aabb.union(&pair[1].aabb), index: (n + joined.len()) as u32 });
            joined.push(pair);
        }
        // A neighbour along the curve has been dealt with, too.
        at += if partner == at + 1 { 2 } else { 1 };
    }
    next
}

/// The tree below `root`, children adjacent, objects in leaf order.
fn to_bvh(root: Cluster, joined: &[[Cluster; 2]], n: usize) -> Bvh {
    let placeholder = Node::leaf(Aabb::EMPTY, 0, 0);
    let mut tree = Bvh { nodes: Vec::with_capacity(2 * n - 1), prim_ids: Vec::with_capacity(n) };
    tree.nodes.push(placeholder);
    let mut stack = vec![(root, 0)];
    while let Some((Cluster { aabb, index }, to)) = stack.pop() {
        let aabb = Aabb::from(&aabb);
        tree.nodes[to] = match (index as usize).checked_sub(n) {
            None => {
                tree.prim_ids.push(index);
                Node::leaf(aabb, tree.prim_ids.len() as u32 - 1, 1)
            }
            Some(joint) => {
                let first = tree.nodes.len();
                tree.nodes.extend([placeholder; 2]);
                let [left, right] = joined[joint];
                stack.extend([(right, first + 1), (left, first)]);
                Node::inner(aabb, first as u32, 2)
            }
        };
    }
    tree
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::validate;

    fn cube(at: [f32; 3], size: f32) -> Aabb {
        Aabb::from((at, at.map(|c| c + size)))
    }

    fn scatter(n: u32) -> Vec<Aabb> {
        let hash = |i: u32, salt: u32| (i.wrapping_mul(2_654_435_761).rotate_left(salt) % 65_521) as f32;
        (0..n).map(|i| cube([hash(i, 3), hash(i, 11), hash(i, 19)], hash(i, 27) / 32.0)).collect()
    }

    fn depth(tree: &Bvh) -> usize {
        let mut depths = vec![0; tree.nodes.len()];
        for (at, node) in tree.nodes.iter().enumerate() {
            for child in node.children() {
                depths[child] = depths[at] + 1;
            }
        }
        depths.into_iter().max().unwrap_or(0)
    }

    #[test]
    fn trees_are_valid_and_tight() {
        for n in [0, 1, 2, 3, 4, 5, 100, 3000] {
            let boxes = scatter(n);
            let tree = Config::default().build(&boxes).unwrap();
            validate(&tree, &boxes).unwrap();
            let mut tight = tree.clone();
            tight.refit(&boxes);
            assert_eq!(tree, tight);
        }
    }

    #[test]
    fn a_radius_over_all_objects_joins_the_closest_pair_first() {
        let boxes = [0.0, 100.0, 10.0, 107.0].map(|x| cube([x, 0.0, 0.0], 1.0));
        let tree = Config { radius: 4 }.build(&boxes).unwrap();
        let sides: Vec<f32> = tree.nodes[0].children().map(|child| tree.nodes[child].aabb.max.x).collect();
        assert_eq!(sides, [11.0, 108.0]);
    }

    #[test]
    fn clusters_without_a_difference_pair_off_into_a_balanced_tree() {
        for boxes in [vec![cube([0.1; 3], 1.0); 1 << 12], vec![cube([0.1; 3], 0.0); 1 << 12]] {
            assert_eq!(depth(&Config::default().build(&boxes).unwrap()), 12);
        }
    }

    #[test]
    fn no_scene_takes_more_rounds_than_a_multiple_of_the_logarithm() {
        // One inside the other: every cluster's nearest is the smallest.
        let boxes: Vec<Aabb> = (1..20_000u16).map(|i| cube([-f32::from(i); 3], 2.0 * f32::from(i))).collect();
        let tree = Config::default().build(&boxes).unwrap();
        validate(&tree, &boxes).unwrap();
        assert!(depth(&tree) < 1000, "{}", depth(&tree));
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
        for factor in [2f32.powi(-60), 2f32.powi(60)] {
            let scaled: Vec<Aabb> =
                boxes.iter().map(|b| Aabb { min: b.min * factor, max: b.max * factor }).collect();
            assert_eq!(Config::default().build(&scaled).unwrap().prim_ids, tree.prim_ids);
        }
    }

    #[test]
    fn bits_are_spread_by_threes() {
        for bit in 0..21 {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread(u64::MAX), (0..21).map(|bit| 1 << (3 * bit)).sum());
    }

    #[test]
    fn a_radius_outside_its_range_is_named() {
        for radius in [0, 1001] {
            let error = Config { radius }.build(&[]).unwrap_err().to_string();
            assert_eq!(error, format!("radius is {radius}; accepted: 1 to 1000"));
        }
    }
}
