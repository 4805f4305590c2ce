//! Tracers of others that take a ready tree: what a node and a triangle cost there, and which trees
//! they accept.

use super::FirstCountNode;
use crate::collapse::{binary, collapse_at_most};
use crate::cost::{self, SahConstants};
use crate::{Aabb, Bvh, Node, file};
use bytemuck::NoUninit;

/// A tracer that traces rays through a ready tree.
///
/// ```
/// # use bvh_core::{Aabb, Bvh, Node, export::Target};
/// # let boxes = [Aabb::from([[0.0; 3], [1.0; 3]])];
/// # let tree = Bvh::new(vec![Node::leaf(boxes[0], 0, 1)], vec![0]);
/// let target = Target::named("three-mesh-bvh")?;
/// let fitted = target.fit(&tree);
/// target.check(&fitted, boxes.len(), false)?;
/// let file = target.bytes(&fitted, &boxes);
/// assert!(file.len() > 32, "a header and nodes");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// The name of the library.
    pub name: &'static str,
    /// What a visit of an inner node, with the tests of its two children, and a test of a triangle
    /// cost there.
    pub constants: SahConstants,
    /// The most objects in a leaf.
    pub most_objects: u32,
    /// The most nodes from the root to a leaf, the root not counted.
    pub most_depth: usize,
    /// The references per object that a search for the tracer should be permitted: 1, where a query
    /// for all hits would find a divided object twice.
    pub references: f64,
    /// The nodes in [files](Target::bytes) for the tracer.
    pub layout: Layout,
}

/// A name that no [`Target`] has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{name:?}; accepted: {}", Target::ALL.map(|target| target.name).join(", "))]
pub struct UnknownTarget {
    /// The name.
    pub name: String,
}

/// The reason why a tree is not exported.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ExportError {
    /// The boxes lie in a [frame](crate::Frame), but those of other tracers along the file's axes.
    #[error(
        "the boxes of the tree lie in a frame, but those of other tracers along the file's axes; \
         accepted: a tree baked in single precision with the frame `file`"
    )]
    Framed,
    /// The tree divides objects, which a query for all hits would find more than once there.
    #[error(
        "the tree has {references} references to {objects} objects, and a query of {tracer} for all \
         hits would find the divided ones more than once; accepted: a tree that divides none, or \
         your word (`divided`) that your queries are for the nearest or any hit"
    )]
    #[allow(missing_docs)] // The message explains the fields.
    Divided { tracer: &'static str, references: usize, objects: usize },
}

/// A layout of binary nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Layout {
    /// [`FirstCountNode`](super::FirstCountNode)s.
    FirstCount,
    /// The same with an unused node at index 1.
    FirstCountAligned,
    /// [`ThreeMeshNode`](super::ThreeMeshNode)s.
    ThreeMesh,
    /// Text: `{"nodes": [[min x, y, z, max x, y, z, first, count], …], "ids": […]}`, with the fields
    /// of [`FirstCountNode`](super::FirstCountNode)s.
    Json,
}

impl Target {
    /// All targets.
    pub const ALL: [Self; 6] = [
        Self::THREE_MESH_BVH,
        Self::TINYBVH,
        Self::OBVHS,
        Self::BVH,
        Self::MADMANN91_BVH,
        Self::PLAIN,
    ];

    /// `three-mesh-bvh` for three.js, and `three-gpu-pathtracer`. The costs are about those that the
    /// library builds with; its shaders have a stack of 60.
    pub const THREE_MESH_BVH: Self = Self {
        name: "three-mesh-bvh",
        constants: constants(1.8, 1.25),
        most_objects: 65_535,
        most_depth: 59,
        references: 1.0,
        layout: Layout::ThreeMesh,
    };

    /// The binary layout `BVH` of `tinybvh`, by the costs that the library builds with.
    pub const TINYBVH: Self = Self {
        name: "tinybvh",
        references: DIVIDED,
        layout: Layout::FirstCountAligned,
        ..Self::PLAIN
    };

    /// The layout `Bvh2` of `obvhs`, by the costs that the library collapses leaves with.
    pub const OBVHS: Self = Self {
        name: "obvhs",
        constants: constants(3.0, 1.0),
        most_objects: 255,
        most_depth: 95,
        references: DIVIDED,
        layout: Layout::FirstCount,
    };

    /// The Rust crate `bvh`, whose leaves have one shape, and whose iterator has a stack of 32.
    pub const BVH: Self = Self {
        name: "bvh",
        most_objects: 1,
        most_depth: 31,
        layout: Layout::FirstCount,
        ..Self::PLAIN
    };

    /// Version 2 of `madmann91/bvh` in C++, which stores the size of a leaf in four bits, and whose
    /// examples have a stack of 64.
    pub const MADMANN91_BVH: Self = Self {
        name: "madmann91-bvh",
        most_objects: 15,
        references: DIVIDED,
        layout: Layout::FirstCount,
        ..Self::PLAIN
    };

    /// Nodes as text, for any program with a stack of 64.
    pub const PLAIN: Self = Self {
        name: "json",
        constants: constants(1.0, 1.0),
        most_objects: 1 << 20,
        most_depth: 63,
        references: 1.0,
        layout: Layout::Json,
    };

    /// Returns the target with this name.
    pub fn named(name: &str) -> Result<Self, UnknownTarget> {
        let target = Self::ALL.into_iter().find(|target| target.name == name);
        target.ok_or_else(|| UnknownTarget { name: name.into() })
    }

    /// Rejects a tree over so many objects that this tracer would trace wrongly: one in a frame, and,
    /// unless all queries are for the nearest or any hit (`divided`), one that divides objects where
    /// [`references`](Self::references) permits none. O(1).
    pub fn check(&self, tree: &Bvh, objects: usize, divided: bool) -> Result<(), ExportError> {
        let (tracer, references) = (self.name, tree.prim_ids.len());
        match references > objects && self.references == 1.0 && !divided {
            _ if tree.frame.is_some() => Err(ExportError::Framed),
            true => Err(ExportError::Divided { tracer, references, objects }),
            false => Ok(()),
        }
    }

    /// Returns the tree for this tracer: binary, with the leaves that cost least there, no leaf too
    /// large and none too deep, and the larger of two siblings first. O(n), and O(n depth) where
    /// subtrees are too deep.
    ///
    /// # Panics
    /// Panics if the tree lies in a [frame](crate::Frame): other tracers have boxes along the file's
    /// axes.
    pub fn fit(&self, tree: &Bvh) -> Bvh {
        assert!(tree.frame.is_none(), "a tree along the file's axes");
        let mut fitted =
            collapse_at_most((&*binary(tree)).into(), &self.constants, self.most_objects);
        fitted.halve_leaves(self.most_objects as usize);
        limit_depth(&mut fitted, self.most_depth);
        larger_first(&mut fitted);
        compact(&fitted)
    }

    /// Returns a [fitted](Self::fit) tree over `boxes` as a file for this tracer:
    ///
    /// | bytes | type | contents |
    /// |---|---|---|
    /// | 0..4 | `u8[4]` | `BVHX` |
    /// | 4..8 | `u32` | version: 1 |
    /// | 8..12 | `u32` | number of nodes |
    /// | 12..16 | `u32` | number of object ids |
    /// | 16..20 | `u32` | [checksum](file::boxes_checksum) of the scene's boxes |
    /// | 20..32 | | zeros |
    /// | 32.. | | the nodes, 32 bytes each, in the target's [layout](Layout), then a `u32` per object id |
    ///
    /// [Text](Layout::Json) has no header.
    ///
    /// # Panics
    /// As [`fit`](Self::fit), or if the tree is not fitted.
    pub fn bytes(&self, tree: &Bvh, boxes: &[Aabb]) -> Vec<u8> {
        assert!(tree.frame.is_none(), "a tree along the file's axes");
        match self.layout {
            Layout::FirstCount => packed(&tree.to_first_count(), tree, boxes),
            Layout::FirstCountAligned => packed(&tree.to_first_count_aligned(), tree, boxes),
            Layout::ThreeMesh => packed(&tree.to_three_mesh(), tree, boxes),
            Layout::Json => text(tree).into_bytes(),
        }
    }

    /// Returns the cost of a ray in a tree, fitted or not: the surface area heuristic by the
    /// tracer's costs. O(nodes).
    pub fn cost(&self, tree: &Bvh) -> f64 {
        cost::sah(tree, &self.constants)
    }
}

/// References per object that suffice: searches that may use twice as many hardly do.
const DIVIDED: f64 = 1.3;

/// Returns the [bytes](Target::bytes) of a tree with these nodes.
fn packed<N: NoUninit>(nodes: &[N], tree: &Bvh, boxes: &[Aabb]) -> Vec<u8> {
    let [nodes_len, ids_len] = [nodes.len(), tree.prim_ids.len()].map(|len| len as u32);
    let header = [1, nodes_len, ids_len, file::boxes_checksum(boxes), 0, 0, 0];
    let mut bytes = b"BVHX".to_vec();
    bytes.extend(header.iter().flat_map(|word| word.to_le_bytes()));
    bytes.extend(bytemuck::cast_slice::<N, u8>(nodes));
    bytes.extend(tree.prim_ids.iter().flat_map(|id| id.to_le_bytes()));
    bytes
}

/// Returns a binary tree as [text](Layout::Json). Numbers have the fewest digits that are read back
/// as the same numbers in double precision, as most readers of JSON do. The digits of single
/// precision would give them boxes smaller than their triangles.
fn text(tree: &Bvh) -> String {
    let node = |FirstCountNode { min, max, first, count }| {
        let [[a, b, c], [d, e, f]] = [min, max].map(|corner| corner.map(f64::from));
        format!("[{a:?},{b:?},{c:?},{d:?},{e:?},{f:?},{first},{count}]")
    };
    let nodes: Vec<String> = tree.to_first_count().into_iter().map(node).collect();
    format!("{{\"nodes\":[\n{}\n],\"ids\":{:?}}}\n", nodes.join(",\n"), tree.prim_ids)
}

const fn constants(traversal: f64, intersection: f64) -> SahConstants {
    SahConstants { traversal, intersection }
}

/// Swaps siblings, so that a query for any hit that takes them in their order enters first the one
/// that more rays meet.
fn larger_first(tree: &mut Bvh) {
    for index in 0..tree.nodes.len() {
        let children = tree.nodes[index].children();
        if let [first, second] = &mut tree.nodes[children]
            && first.aabb.half_area() < second.aabb.half_area()
        {
            core::mem::swap(first, second);
        }
    }
}

/// Replaces subtrees that reach below `most` levels by balanced ones over the same leaves, as far
/// down as possible, where few rays come. Their former nodes stay, unused.
fn limit_depth(tree: &mut Bvh, most: usize) {
    let mut heights = vec![0usize; tree.nodes.len()];
    let mut leaves = vec![1usize; tree.nodes.len()];
    for index in (0..tree.nodes.len()).rev() {
        let children = tree.nodes[index].children();
        if !children.is_empty() {
            heights[index] = 1 + heights[children.clone()].iter().max().unwrap_or(&0);
            leaves[index] = leaves[children].iter().sum();
        }
    }
    if heights.first().is_none_or(|&height| height <= most) {
        return;
    }
    let balanced = |leaves: usize| leaves.next_power_of_two().trailing_zeros() as usize;
    let mut open = vec![(0, 0)];
    while let Some((index, depth)) = open.pop() {
        if depth + heights[index] <= most {
            continue;
        }
        let children = tree.nodes[index].children();
        if children.clone().all(|child| depth + 1 + balanced(leaves[child]) <= most) {
            open.extend(children.map(|child| (child, depth + 1)));
        } else {
            balance(tree, index);
        }
    }
}

/// Makes the subtree a balanced one over its leaves in their order. Its former nodes stay, unused.
fn balance(tree: &mut Bvh, root: usize) {
    let mut leaves: Vec<Node> = Vec::new();
    let mut open = vec![root];
    while let Some(index) = open.pop() {
        let node = tree.nodes[index];
        if node.is_leaf() {
            leaves.push(node);
        }
        open.extend(node.children().rev());
    }
    let mut open = vec![(root, 0..leaves.len())];
    while let Some((index, range)) = open.pop() {
        if range.len() == 1 {
            tree.nodes[index] = leaves[range.start];
            continue;
        }
        let aabb = Aabb::union_of(leaves[range.clone()].iter().map(|leaf| &leaf.aabb));
        let first = tree.nodes.len();
        tree.nodes[index] = Node::inner(aabb, first as u32, 2);
        tree.nodes.extend([leaves[range.start]; 2]);
        let middle = range.start + range.len() / 2;
        open.extend([(first + 1, middle..range.end), (first, range.start..middle)]);
    }
}

/// Returns the nodes that the root reaches, in depth-first order.
fn compact(tree: &Bvh) -> Bvh {
    // No inner node becomes a leaf of at most no objects, whatever the constants.
    collapse_at_most(tree.into(), &SahConstants::default(), 0)
}
