//! The objects in a balanced tree, whose nodes stand for all objects below them.

use bvh_build::median_cut::{Config, CutAxis};
use bvh_build::{BuildError, Builder};
use bvh_core::{Aabb, Bvh, NodeKind};
use std::ops::Range;

/// The extent of a box in six directions, as −min and max, each padded to four lanes. A box
/// contains an object if it reaches as far in every direction. The maximum of several reaches is
/// the union of the boxes; the minimum is a lower bound of the reach of every box that contains at
/// least one of the objects.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(super) struct Reach(pub [f32; 8]);

impl Reach {
    #[inline(always)]
    pub fn union(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|face| {
            if other.0[face] > self.0[face] { other.0[face] } else { self.0[face] }
        }))
    }

    #[inline(always)]
    pub fn common(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|face| {
            if other.0[face] < self.0[face] { other.0[face] } else { self.0[face] }
        }))
    }

    /// Returns the least half area of a box with this reach, rounded like [`Aabb::half_area`] and
    /// therefore also monotone.
    #[inline(always)]
    pub fn half_area(&self) -> f64 {
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
pub(super) struct Cluster {
    /// The objects below the node, in tree order.
    pub objects: Range<usize>,
    /// The parent; the root is its own parent.
    pub parent: usize,
    /// The first of two children; 0 for leaves.
    pub children: usize,
    /// The minimum over its objects.
    pub reach: Reach,
    /// Half area of the box around all its objects.
    pub half_area: f64,
}

/// The objects in the order of a balanced tree over them, with weights.
pub(super) struct Clusters {
    pub nodes: Vec<Cluster>,
    leaves: Vec<usize>,
    /// Prefix sums of the weights, the total last.
    weight_before: Vec<u64>,
}

/// Areas of smallest boxes with at least a certain weight, for groups of objects.
pub(super) struct Grouped {
    pub from: u64,
    /// One past the last object, and the area.
    groups: Vec<(usize, f64)>,
}

impl Grouped {
    /// Returns the area for one object.
    pub fn area(&self, object: usize) -> f64 {
        let group = self.groups.partition_point(|group| group.0 <= object);
        self.groups.get(group).map_or(0.0, |group| group.1)
    }
}

impl Clusters {
    /// Builds a tree of objects with weight 1 each. Rejects the boxes that builders reject. O(n log
    /// n).
    pub fn new(boxes: &[Aabb]) -> Result<Self, BuildError> {
        let tree = Config { axis: CutAxis::Longest, ..Config::default() }.build(boxes)?;
        let reaches: Vec<Reach> =
            tree.prim_ids.iter().map(|&id| Reach::from(&boxes[id as usize])).collect();
        let nodes = nodes(&tree, &reaches);
        let mut leaves = vec![0; boxes.len()];
        for (index, cluster) in
            nodes.iter().enumerate().filter(|(_, cluster)| cluster.children == 0)
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
        self.nodes.first().map_or(0.0, |root| root.half_area)
    }

    /// Returns the cluster of a single object.
    pub fn leaf(&self, object: usize) -> usize {
        self.leaves[object]
    }

    pub fn weight_of(&self, objects: &Range<usize>) -> u64 {
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
        let ends = groups.iter().map(|&group| self.nodes[group].objects.end);
        Grouped { from, groups: ends.zip(areas.iter().copied()).collect() }
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
