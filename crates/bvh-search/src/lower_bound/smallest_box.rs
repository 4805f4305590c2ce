//! The smallest box around an object and enough others: an anytime branch and bound over its six
//! faces.

use crate::run::Observer;
use bvh_build::median_cut::{Config, CutAxis};
use bvh_build::{BuildError, Builder};
use bvh_core::{Aabb, Bvh, NodeKind, with_vector_instructions};
use std::cmp::Ordering;
use std::ops::Range;

/// The extent of a box in six directions, as −min and max, each padded to four lanes. A box
/// contains an object if it reaches as far in every direction. The maximum of several reaches is
/// the union of the boxes; the minimum is a lower bound of the reach of every box that contains at
/// least one of the objects.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
struct Reach([f32; 8]);

impl Reach {
    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|face| {
            if other.0[face] > self.0[face] { other.0[face] } else { self.0[face] }
        }))
    }

    #[inline(always)]
    fn common(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|face| {
            if other.0[face] < self.0[face] { other.0[face] } else { self.0[face] }
        }))
    }

    /// Returns the least half area of a box with this reach, rounded like [`Aabb::half_area`] and
    /// therefore also monotone.
    #[inline(always)]
    fn half_area(&self) -> f64 {
        let extent =
            |axis: usize| f64::max(f64::from(self.0[axis + 4]) + f64::from(self.0[axis]), 0.0);
        let [x, y, z] = [extent(0), extent(1), extent(2)];
        x * y + y * z + z * x
    }
}

impl From<&Aabb> for Reach {
    fn from(b: &Aabb) -> Self {
        let ([a, b, c], [d, e, f]) = (b.min.to_array(), b.max.to_array());
        Self([-a, -b, -c, 0.0, d, e, f, 0.0])
    }
}

/// A node of the tree that finds neighbours: a group of objects close to each other.
#[derive(Clone, Debug)]
struct Cluster {
    /// The objects below the node, in tree order.
    objects: Range<usize>,
    /// The parent; the root is its own parent.
    parent: usize,
    /// The first of two children; 0 for leaves.
    children: usize,
    /// The minimum over its objects.
    reach: Reach,
    /// Half area of the box around all its objects.
    half_area: f64,
}

/// The objects in the order of a balanced tree over them, with weights.
pub(super) struct Clusters {
    nodes: Vec<Cluster>,
    leaves: Vec<usize>,
    /// Prefix sums of the weights, the total last.
    weight_before: Vec<u64>,
}

/// A cluster that weighs at most 1/128 of the size in question counts as inside a box as soon as
/// one of its objects is.
const CLUSTERS_PER_SIZE: u64 = 128;

/// Areas of smallest boxes with at least a certain weight, for groups of objects.
pub(super) struct Grouped {
    pub from: u64,
    /// One past the last object, and the area.
    groups: Vec<(usize, f64)>,
}

impl Grouped {
    /// Returns the area for one object.
    pub fn area(&self, object: usize) -> f64 {
        let group = self
            .groups
            .partition_point(|group| group.0 <= object);
        self.groups
            .get(group)
            .map_or(0.0, |group| group.1)
    }
}

impl Clusters {
    /// Builds a tree of objects with weight 1 each. Rejects the boxes that builders reject. O(n log
    /// n).
    pub fn new(boxes: &[Aabb]) -> Result<Self, BuildError> {
        let tree = Config { axis: CutAxis::Longest, ..Config::default() }.build(boxes)?;
        let reaches: Vec<Reach> = tree
            .prim_ids
            .iter()
            .map(|&id| Reach::from(&boxes[id as usize]))
            .collect();
        let nodes = nodes(&tree, &reaches);
        let mut leaves = vec![0; boxes.len()];
        for (index, cluster) in nodes
            .iter()
            .enumerate()
            .filter(|(_, cluster)| cluster.children == 0)
        {
            leaves[cluster.objects.start] = index;
        }
        let mut clusters = Self { nodes, leaves, weight_before: vec![] };
        clusters.set_weights(&vec![1; boxes.len()]);
        Ok(clusters)
    }

    /// Sets the weights of the objects, in tree order.
    pub fn set_weights(&mut self, weights: &[u64]) {
        let mut total = 0;
        let before = weights.iter().map(|weight| {
            total += weight;
            total
        });
        self.weight_before = std::iter::once(0).chain(before).collect();
    }

    /// The weight of all objects.
    pub fn weight(&self) -> u64 {
        self.weight_before.last().copied().unwrap_or(0)
    }

    /// The half area of the box around all objects.
    pub fn area(&self) -> f64 {
        self.nodes
            .first()
            .map_or(0.0, |root| root.half_area)
    }

    /// Returns the cluster of a single object.
    pub fn leaf(&self, object: usize) -> usize {
        self.leaves[object]
    }

    fn weight_of(&self, objects: &Range<usize>) -> u64 {
        self.weight_before[objects.end] - self.weight_before[objects.start]
    }

    /// Returns the largest clusters that weigh at most `most` or are single objects, in tree order.
    pub fn groups(&self, most: u64) -> Vec<usize> {
        let mut groups = vec![];
        let mut stack = vec![0];
        while let Some(index) = stack.pop() {
            let cluster = &self.nodes[index];
            if cluster.children == 0 || self.weight_of(&cluster.objects) <= most {
                groups.push(index);
            } else {
                stack.extend([cluster.children + 1, cluster.children]);
            }
        }
        groups
    }

    /// Returns the areas of groups, indexed by object.
    pub fn grouped(&self, from: u64, groups: &[usize], areas: &[f64]) -> Grouped {
        let ends = groups
            .iter()
            .map(|&group| self.nodes[group].objects.end);
        Grouped { from, groups: ends.zip(areas.iter().copied()).collect() }
    }

    /// Returns a lower bound of the half area of every box that contains an object of the cluster
    /// `seed` and weighs at least `weight`, which must not exceed the total weight. The bound is
    /// the exact minimum for a single object and enough effort, and 0 once the observer cancels.
    pub fn smallest_box(
        &self,
        seed: usize,
        weight: u64,
        effort: u32,
        observer: &dyn Observer,
    ) -> f64 {
        if observer.cancelled() { 0.0 } else { search(self, seed, weight, effort, observer) }
    }
}

/// Returns the nodes of the tree with the summary of their objects. Parents come before children.
fn nodes(tree: &Bvh, reaches: &[Reach]) -> Vec<Cluster> {
    let mut nodes: Vec<Cluster> = Vec::with_capacity(tree.nodes.len());
    for node in &tree.nodes {
        let (children, objects) = match node.kind() {
            NodeKind::Inner { first, .. } => (first as usize, 0..0),
            NodeKind::Leaf { .. } => (0, node.prims()),
        };
        let reach = reaches[objects.start];
        nodes.push(Cluster {
            objects,
            parent: 0,
            children,
            reach,
            half_area: node.aabb.half_area(),
        });
    }
    for index in (0..nodes.len()).rev() {
        let first = nodes[index].children;
        if first != 0 {
            let left = &nodes[first];
            let right = &nodes[first + 1];
            let objects = left.objects.start..right.objects.end;
            let reach = left.reach.common(&right.reach);
            nodes[first].parent = index;
            nodes[first + 1].parent = index;
            nodes[index] = Cluster { objects, reach, ..nodes[index].clone() };
        }
    }
    nodes
}

/// A cluster that a box may contain.
#[derive(Clone, Copy)]
struct Member {
    /// Half area of the box around the cluster and everything that must be inside.
    area: f64,
    cluster: u32,
    weight: u32,
}

impl Member {
    /// Orders members by area. The cluster breaks ties, so that the order is total and the result
    /// deterministic.
    #[inline(always)]
    fn compare(&self, other: &Self) -> Ordering {
        self.area
            .total_cmp(&other.area)
            .then(self.cluster.cmp(&other.cluster))
    }
}

#[inline(always)]
fn total_weight(members: &[Member]) -> u64 {
    members
        .iter()
        .map(|member| u64::from(member.weight))
        .sum()
}

/// All boxes that contain `must` and only `members`, weigh enough, and are smaller than the best
/// known box.
struct Region {
    must: Reach,
    members: Vec<Member>,
    /// The number of members that weigh enough together, in increasing order of the area that they
    /// need.
    enough: usize,
    /// The area that the last of these members needs. No box of the region is smaller.
    bound: f64,
}

impl Region {
    /// Builds the region; `None` if it has no box smaller than `known`. Lowers `known` to the area
    /// of the best box found.
    #[inline(always)]
    fn new(
        clusters: &Clusters,
        must: Reach,
        members: impl Iterator<Item = Member>,
        weight: u64,
        known: &mut f64,
    ) -> Option<Self> {
        let mut members: Vec<Member> = members
            .map(|member| {
                let reach = &clusters.nodes[member.cluster as usize].reach;
                Member { area: must.union(reach).half_area(), ..member }
            })
            .filter(|member| member.area < *known)
            .collect();
        if total_weight(&members) < weight {
            return None;
        }
        // Invariant: the smallest prefix that weighs enough ends within `low..high`. Quickselect
        // finds it in O(n) without a full sort.
        let mut low = 0;
        let mut high = members.len();
        let mut missing = weight;
        while high - low > 1 {
            let half = (high - low) / 2;
            members[low..high].select_nth_unstable_by(half, Member::compare);
            let lower = total_weight(&members[low..low + half]);
            if lower >= missing {
                high = low + half;
            } else {
                missing -= lower;
                low += half;
            }
        }
        let bound = members[low].area;
        let region = Self { must, members, enough: low + 1, bound };
        *known = known.min(region.around(clusters).half_area());
        Some(region)
    }

    /// Returns the reaches of the first `enough` members.
    #[inline(always)]
    fn nearest<'a>(&'a self, clusters: &'a Clusters) -> impl Iterator<Item = &'a Reach> {
        self.members[..self.enough]
            .iter()
            .map(|member| &clusters.nodes[member.cluster as usize].reach)
    }

    /// Returns the box around these members, a good box of the region.
    #[inline(always)]
    fn around(&self, clusters: &Clusters) -> Reach {
        self.nearest(clusters)
            .fold(self.must, |union, reach| union.union(reach))
    }

    /// Chooses the division of the region: the face whose move from `must` to that box costs most
    /// area, at the median of the reaches that it passes.
    fn division(&self, clusters: &Clusters) -> Option<(usize, f32)> {
        let around = self.around(clusters);
        let mut best = None;
        for face in [0, 1, 2, 4, 5, 6] {
            let mut moved = self.must;
            moved.0[face] = around.0[face];
            let gain = (moved.half_area(), around.0[face] - self.must.0[face]);
            if gain.1 > 0.0 && best.is_none_or(|(least, _)| gain > least) {
                best = Some((gain, face));
            }
        }
        let (_, face) = best?;
        let mut passed: Vec<f32> = self
            .nearest(clusters)
            .map(|reach| reach.0[face])
            .filter(|&reach| reach > self.must.0[face])
            .collect();
        let middle = passed.len() / 2;
        passed.select_nth_unstable_by(middle, f32::total_cmp);
        Some((face, passed[middle]))
    }
}

with_vector_instructions! {
    search = search_plain(
        clusters: &Clusters, seed: usize, weight: u64, effort: u32, observer: &dyn Observer,
    ) -> f64
}

#[inline(always)]
fn search_plain(
    clusters: &Clusters,
    seed: usize,
    weight: u64,
    effort: u32,
    observer: &dyn Observer,
) -> f64 {
    let mut around = seed;
    // The box of the smallest ancestor with enough weight is a first upper bound.
    while around != 0 && clusters.weight_of(&clusters.nodes[around].objects) < weight {
        around = clusters.nodes[around].parent;
    }
    let mut known = clusters.nodes[around].half_area;
    let must = clusters.nodes[seed].reach;
    let members = neighbours(clusters, &must, weight / CLUSTERS_PER_SIZE, known);
    // Invariant: the regions together contain all boxes smaller than `known`.
    let mut regions: Vec<Region> =
        Region::new(clusters, must, members.into_iter(), weight, &mut known)
            .into_iter()
            .collect();
    let mut left = regions
        .iter()
        .map(|region| region.members.len() as u64)
        .sum::<u64>()
        * u64::from(effort);
    loop {
        let least =
            (0..regions.len()).min_by(|&a, &b| regions[a].bound.total_cmp(&regions[b].bound));
        let Some(least) = least.filter(|&least| regions[least].bound < known) else { return known };
        if left == 0 || observer.cancelled() {
            return regions[least].bound;
        }
        // The region with the least bound first: the search's bound is that least bound, so only
        // its division can raise it.
        let region = regions.swap_remove(least);
        left = left.saturating_sub(2 * region.members.len() as u64);
        let Some((face, plane)) = region.division(clusters) else { return region.bound };
        let members = || region.members.iter().copied();
        // Every box either ends below the plane on this face, which excludes the members beyond, or
        // reaches the plane. The two regions cover both cases.
        let short = members()
            .filter(|member| clusters.nodes[member.cluster as usize].reach.0[face] < plane);
        let mut far = region.must;
        far.0[face] = plane;
        regions.extend(Region::new(clusters, region.must, short, weight, &mut known));
        regions.extend(Region::new(clusters, far, members(), weight, &mut known));
    }
}

/// Returns the clusters that need less area than `known` together with `must`: single objects, or
/// clusters that weigh at most `most`.
#[inline(always)]
fn neighbours(clusters: &Clusters, must: &Reach, most: u64, known: f64) -> Vec<Member> {
    let mut found = vec![];
    let mut stack = vec![0];
    while let Some(index) = stack.pop() {
        let cluster = &clusters.nodes[index];
        let area = must.union(&cluster.reach).half_area();
        if area >= known {
            continue;
        }
        let weight = clusters.weight_of(&cluster.objects);
        if cluster.children == 0 || weight <= most {
            found.push(Member { area, cluster: index as u32, weight: weight as u32 });
        } else {
            stack.extend([cluster.children + 1, cluster.children]);
        }
    }
    found
}
