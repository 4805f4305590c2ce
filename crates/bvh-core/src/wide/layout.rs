//! The arrays of a wide layout, and the kernel that traces it.

use super::kernel::Kernel;
use super::node::{Child, WideNode};
use super::triangles::TriangleBlock;
use crate::Aabb;
use crate::slabs::near_region;
use alloc::collections::VecDeque;
use alloc::vec::Vec;

/// An immutable copy of a [`Bvh`](crate::Bvh) and its triangles, for tracing only.
///
/// Gives the answers of [`nearest_hit`](crate::nearest_hit) with
/// [`Triangle::intersect`](crate::Triangle::intersect) over the same triangles, bit by bit, on
/// every machine and with every [`Kernel`]; the fastest one that the processor has is chosen when
/// the layout is made.
///
/// ```
/// use bvh_core::{Aabb, Bvh, Hit, Node, Ray, Triangle, WideBvh};
/// use glam::Vec3;
/// let corners = |z| [Vec3::new(0.0, 0.0, z), Vec3::new(1.0, 0.0, z), Vec3::new(0.0, 1.0, z)];
/// let triangles = [0.0, 1.0].map(|z| Triangle(corners(z)));
/// let [a, b] = triangles.map(|t| t.aabb());
/// let tree = Bvh {
///     nodes: vec![Node::inner(a.union(&b), 1, 2), Node::leaf(a, 0, 1), Node::leaf(b, 1, 1)],
///     prim_ids: vec![0, 1],
/// };
/// let wide = WideBvh::new(&tree, &triangles)?;
/// let ray = Ray::half_line(Vec3::new(0.2, 0.2, 3.0), -Vec3::Z).unwrap();
/// assert_eq!(wide.nearest_hit(&ray), Some(Hit { t: 2.0, object: 1 }));
/// assert!(wide.any_hit(&ray));
/// # Ok::<(), bvh_core::InvalidBvh>(())
/// ```
#[derive(Clone, Debug)]
pub struct WideBvh {
    pub(crate) bounds: Aabb,
    /// `None` for the tree over no triangles.
    pub(crate) root: Option<Child>,
    pub(crate) nodes: Vec<WideNode>,
    pub(crate) blocks: Vec<TriangleBlock>,
    /// The [region](near_region) from which f32 tells the boxes apart.
    pub(crate) near: Aabb,
    /// The kernel that traces it. The processor has its instructions.
    pub(crate) kernel: Kernel,
    /// The most children that can be waiting on the way through it.
    pub(crate) stack_need: usize,
}

/// The maximum number of boxes in an outline. Boxes of instances are computed from all of them.
const OUTLINE: usize = 64;

impl WideBvh {
    /// Returns boxes around all triangles, fewer than [`OUTLINE`] and eight: the subtrees of the
    /// layout from the root down.
    pub(crate) fn outline(&self) -> Vec<Aabb> {
        let Some(root) = self.root else { return Vec::new() };
        let mut leaves = Vec::new();
        let mut open = VecDeque::from([(self.bounds, root)]);
        while let Some((aabb, child)) = open.pop_front() {
            if !child.is_node() || leaves.len() + open.len() >= OUTLINE {
                leaves.push(aabb);
                continue;
            }
            let node = &self.nodes[child.index()];
            for lane in 0..WideNode::LANES {
                if let Some(aabb) = node.lane_box(lane) {
                    open.push_back((aabb, node.children[lane]));
                }
            }
        }
        leaves
    }

    /// Returns the layout of nothing within these bounds, for the portable kernel.
    pub(super) fn without_nodes(bounds: Aabb) -> Self {
        Self {
            bounds,
            root: None,
            nodes: Vec::new(),
            blocks: Vec::new(),
            near: near_region(&bounds),
            kernel: Kernel::Portable,
            stack_need: 0,
        }
    }
}
