//! Goldsmith–Salmon: inserts the objects one by one, each where it raises the expected cost of the
//! tree least.
//!
//! Goldsmith & Salmon 1987, 'Automatic creation of object hierarchies for ray tracing', as
//! described by Ng & Trifonov 2003, sections 1 and 4, and by Ericson 2005, 'Real-time collision
//! detection', section 6.2.3.1. The first object is the root. Every further object descends a
//! single path to a leaf, without backtracking. It may stop at any node N of the path, and stops
//! where the cost Σ S(node) · children grows least, with S the half area:
//!
//! - an inner N gets the object as a further child, which adds S(N ∪ object), and children · growth
//!   of S for N and every node above it;
//! - a leaf N is paired with the object under a new inner node, which adds 2 · S(N ∪ object), and
//!   children · growth of S for every node above it.
//!
//! The expected cost is this sum divided by S(root). All choices share the divisor, so the root's
//! growth counts, too.
//!
//! The sources leave some choices open. Here an inner child that contains the object is next on the
//! path before any other child; among the others, [`Descent`] decides. Among equal children the
//! first is chosen: inner nodes before leaves, and inner nodes in the order in which they became
//! inner nodes. (Goldsmith & Salmon choose the nearest centre, or any.) Among equal stops the first
//! is chosen, from the last node that contains the object downwards, and a further child before a
//! pair, so a scene without area becomes one wide node instead of a chain.
//!
//! *Complexity.* O(path · children) per object, hence O(n log n) expected for a random order. In
//! the worst case, objects sorted along a line become a chain of about n/4 levels, and every object
//! enlarges all of them: O(n²). Identical, nested or flat objects make very wide nodes. Leaves
//! there that cannot be chosen are skipped: O(1) per object.

mod block;
mod insertion;

use crate::error::check_scene;
use crate::watch::Pace;
use crate::{BuildError, Builder, Watch};
use block::{Block, LANES, LEAF, Size, family, place};
use bvh_core::cost::{Area, Measure};
use bvh_core::{Aabb, Bvh, Node, PackedAabb};
use insertion::{Walk, insert_each};

bvh_config::config! {
    /// The rules of the insertion. As a [`Builder`], inserts in the order of the indices.
    pub struct Config {
        /// The choice of the next node of the path.
        descent: Descent = Descent::Cost;
        /// True if an object may also be paired with an inner node, at 2 · S(N ∪ object) plus the
        /// growth of the nodes above. Goldsmith & Salmon pair with leaves only. Over random orders
        /// of six scenes the mean cost is 0.5 to 4.1 % lower with inner nodes.
        pair_inner: bool = false;
    }
}

bvh_config::config! {
    /// The choice of the next node on the path among children that do not contain the object.
    #[derive(Copy, Default, Eq)]
    pub enum Descent {
        /// The child whose cost grows least: by children · growth of S for an inner node, and by 2
        /// · S(pair) for a leaf, which cost nothing before. Ng & Trifonov's 'minimal increase in
        /// cost'.
        #[default]
        Cost,
        /// The child whose area grows least, inner node or leaf: Ericson's reading of Goldsmith &
        /// Salmon. Its mean cost is within 3 % of the other rule. A build takes O(n²) if many
        /// leaves are nested.
        Area,
    }
}

/// The objects of a scene, checked once for any number of builds by half area or by a measure.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    objects: Vec<Object>,
    measure: Option<&'a dyn Measure>,
}

/// A box in the form of [`bvh_core::PackedAabb`], without padding, and its size.
#[derive(Clone, Copy, Debug)]
struct Object {
    /// −min.xyz, max.xyz.
    bounds: [f32; 6],
    area: f64,
}

impl<'a> Scene<'a> {
    /// Checks and packs the boxes. Their size is the `measure`, or the half area if there is none.
    /// O(n).
    pub fn new(boxes: &[Aabb], measure: Option<&'a dyn Measure>) -> Result<Self, BuildError> {
        check_scene(boxes)?;
        let objects = boxes.iter().map(|b| {
            let min = -b.min;
            let max = b.max;
            let area =
                measure.map_or_else(|| b.half_area(), |measure| measure.of(&PackedAabb::from(b)));
            Object { bounds: [min.x, min.y, min.z, max.x, max.y, max.z], area }
        });
        Ok(Self { objects: objects.collect(), measure })
    }
}

/// The reason why the objects were not inserted. An order must name every object of the scene
/// exactly once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidOrder {
    /// The order has too few or too many entries.
    #[error("the order names {named} objects but the scene has {objects}")]
    Length {
        /// Number of entries.
        named: usize,
        /// Number of objects in the scene.
        objects: usize,
    },
    /// An entry is not an object of the scene.
    #[error("position {position} of the order names object {object}, of {objects}")]
    NoObject {
        /// Index of the entry.
        position: usize,
        /// The entry.
        object: u32,
        /// Number of objects in the scene.
        objects: usize,
    },
    /// An object is named for the second time.
    #[error("position {position} of the order names object {object} again")]
    Repeated {
        /// Index of the second entry.
        position: usize,
        /// The object.
        object: u32,
    },
    /// The caller's [`Watch`] ended the insertion.
    #[error("the insertion was cancelled")]
    Cancelled,
}

/// The growing tree and the buffers of a build. Further builds reuse them without allocating. Takes
/// at most 192 bytes per object, typically 100.
#[derive(Debug, Default)]
pub struct Workspace {
    /// Block 0 holds only the root.
    blocks: Vec<Block>,
    walk: Walk,
    /// The nodes of the path that the object enlarges.
    grown: Vec<insertion::Grown>,
    named: Vec<bool>,
    stack: Vec<(u32, u32)>,
}

impl Config {
    /// Inserts the scene's objects in the given order. Returns the tree's cost by
    /// [`goldsmith_salmon`](bvh_core::cost::goldsmith_salmon) and the scene's measure, which is
    /// updated incrementally. Equal orders give equal bits. [`Workspace::write`] then writes the
    /// tree. A rejected order leaves the workspace's tree unchanged. After the `watch` has cancelled,
    /// the workspace holds no complete tree.
    pub fn insert_all(
        &self,
        scene: &Scene,
        order: &[u32],
        workspace: &mut Workspace,
        watch: &Watch,
    ) -> Result<f64, InvalidOrder> {
        check_order(order, scene.objects.len(), &mut workspace.named)?;
        let pace = Pace::new(watch);
        // The measure is a type, so that the descent is compiled without branches on it.
        let cost = match scene.measure {
            Some(measure) => self.insert_by(measure, scene, order, workspace, pace),
            None => self.insert_by(Area, scene, order, workspace, pace),
        };
        cost.ok_or(InvalidOrder::Cancelled)
    }

    fn insert_by(
        &self,
        size: impl Size,
        scene: &Scene,
        order: &[u32],
        workspace: &mut Workspace,
        pace: Pace,
    ) -> Option<f64> {
        match (self.descent, self.pair_inner) {
            (Descent::Cost, false) => {
                insert_each::<false, false>(scene, size, order, workspace, pace)
            }
            (Descent::Cost, true) => {
                insert_each::<false, true>(scene, size, order, workspace, pace)
            }
            (Descent::Area, false) => {
                insert_each::<true, false>(scene, size, order, workspace, pace)
            }
            (Descent::Area, true) => insert_each::<true, true>(scene, size, order, workspace, pace),
        }
    }
}

impl Builder for Config {
    fn build_watched(
        &self,
        boxes: &[Aabb],
        measure: Option<&dyn Measure>,
        watch: &Watch,
    ) -> Result<Bvh, BuildError> {
        let scene = Scene::new(boxes, measure)?;
        let order: Vec<u32> = (0..boxes.len() as u32).collect();
        let mut workspace = Workspace::default();
        let mut tree = Bvh::default();
        // The order is valid, so nothing else can end the insertion.
        let inserted = self.insert_all(&scene, &order, &mut workspace, watch);
        inserted.map_err(|_| BuildError::Cancelled)?;
        workspace.write(&mut tree);
        Ok(tree)
    }
}

impl Workspace {
    /// Writes the last tree into `tree` and reuses its memory. Children are adjacent and in their
    /// order. The descendants of the first child follow, then the descendants of the next. O(n).
    pub fn write(&mut self, tree: &mut Bvh) {
        let Self { blocks, stack, .. } = self;
        let Bvh { nodes, prim_ids, .. } = tree;
        nodes.clear();
        prim_ids.clear();
        if blocks.is_empty() {
            return;
        }
        nodes.push(Node::leaf(Aabb::EMPTY, 0, 1));
        stack.clear();
        stack.push((0, 0));
        while let Some((index, node)) = stack.pop() {
            let (block, lane) = place(node);
            // Like `Aabb::from(&PackedAabb)`, this makes all zeros +0, so the order of insertion
            // does not change their signs.
            let [x, y, z, far_x, far_y, far_z] = blocks[block].bounds.map(|bounds| bounds[lane]);
            let aabb =
                Aabb::from(([0.0 - x, 0.0 - y, 0.0 - z], [far_x + 0.0, far_y + 0.0, far_z + 0.0]));
            if blocks[block].is_leaf(lane) {
                nodes[index as usize] = Node::leaf(aabb, prim_ids.len() as u32, 1);
                prim_ids.push(blocks[block].link[lane] & !LEAF);
                continue;
            }
            let (first, count) = family(blocks, node);
            let below = nodes.len() as u32;
            nodes[index as usize] = Node::inner(aabb, below, count as u32);
            nodes.resize(nodes.len() + count, Node::leaf(Aabb::EMPTY, 0, 1));
            stack.extend(
                (0..count as u32)
                    .rev()
                    .map(|child| (below + child, (first * LANES) as u32 + child)),
            );
        }
    }
}

fn check_order(order: &[u32], objects: usize, named: &mut Vec<bool>) -> Result<(), InvalidOrder> {
    if order.len() != objects {
        return Err(InvalidOrder::Length { named: order.len(), objects });
    }
    named.clear();
    named.resize(objects, false);
    for (position, &object) in order.iter().enumerate() {
        match named.get_mut(object as usize) {
            None => return Err(InvalidOrder::NoObject { position, object, objects }),
            Some(true) => return Err(InvalidOrder::Repeated { position, object }),
            Some(named) => *named = true,
        }
    }
    Ok(())
}
