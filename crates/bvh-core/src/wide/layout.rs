//! The nodes of a wide layout, the references from node to node and to leaves, and the arrays.

use super::kernel::Kernel;
use super::lanes::Lanes;
use super::triangles::TriangleBlock;
use super::turn::Turn;
use crate::each::Each;
use crate::slabs::{FarRay, near_region};
use crate::{Aabb, Frame, Ray, Slabs};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// A node's eight children, or fewer in the lower lanes: four cache lines.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct WideNode {
    /// Lower x, y, z, then upper x, y, z, of all children; ∞ and −∞ in unused lanes, so that no ray
    /// enters them.
    pub(crate) planes: [[f32; 8]; 6],
    pub(crate) children: [Child; 8],
    pub(crate) padding: [u32; 8],
}

impl WideNode {
    pub(crate) const LANES: usize = 8;
    pub(crate) const EMPTY: Self = {
        let (lower, upper) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
        let planes = [lower, lower, lower, upper, upper, upper];
        Self { planes, children: [Child::node(0); 8], padding: [0; 8] }
    };

    pub(crate) fn set_box(&mut self, lane: usize, aabb: &Aabb) {
        for axis in 0..3 {
            self.planes[axis][lane] = aabb.min[axis];
            self.planes[axis + 3][lane] = aabb.max[axis];
        }
    }

    /// The box of a lane's child; `None` for an unused lane.
    pub(crate) fn lane_box(&self, lane: usize) -> Option<Aabb> {
        let corner =
            |from: usize| [from, from + 1, from + 2].each(|plane| self.planes[plane][lane]);
        (self.planes[0][lane] < f32::INFINITY).then(|| Aabb::from([corner(0), corner(3)]))
    }
}

/// A node's index, or the index of a leaf's first block; the leaf's last block is marked as such.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    /// The end of every ray.
    pub(crate) const END: Self = Self::leaf(u32::MAX);

    pub(crate) const fn node(index: u32) -> Self {
        Self(index)
    }

    pub(crate) const fn leaf(first_block: u32) -> Self {
        Self(first_block | Self::LEAF)
    }

    #[inline(always)]
    pub(crate) fn is_node(self) -> bool {
        self.0 & Self::LEAF == 0
    }

    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }

    #[inline(always)]
    pub(crate) fn bits(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub(crate) fn from_bits(bits: u32) -> Self {
        Self(bits)
    }
}

/// Where the nodes and the blocks of a layout begin.
#[derive(Clone, Copy)]
pub(crate) struct Places {
    nodes: *const u8,
    blocks: *const u8,
}

impl Places {
    /// Returns the beginning of a child in memory. It need not exist.
    #[inline(always)]
    pub(crate) fn of(self, child: Child) -> *const u8 {
        // Both are computed, though only one is asked for, and the index of the end is the greatest:
        // where addresses have 32 bits, the products wrap.
        let node = self.nodes.wrapping_add(child.index().wrapping_mul(size_of::<WideNode>()));
        let block =
            self.blocks.wrapping_add(child.index().wrapping_mul(size_of::<TriangleBlock>()));
        if child.is_node() { node } else { block }
    }
}

/// An immutable copy of a [`Bvh`](crate::Bvh) and its triangles, for tracing only.
///
/// Gives the answers of [`nearest_hit`](crate::nearest_hit) with
/// [`Triangle::intersect`](crate::Triangle::intersect) over the same triangles, bit by bit, on
/// every machine and with every [`Kernel`]; the fastest one that the processor has is chosen when
/// the layout is made.
#[derive(Clone, Debug)]
pub struct WideBvh {
    /// A box around the triangles along the file's axes.
    pub(crate) bounds: Aabb,
    /// `None` for the tree over no triangles.
    pub(crate) root: Option<Child>,
    pub(crate) nodes: Vec<WideNode>,
    pub(crate) blocks: Vec<TriangleBlock>,
    /// The [region](crate::slabs::near_region) from which f32 tells the boxes apart, for rays as
    /// they are; empty in a frame, so that none of them begins there.
    pub(crate) near: Aabb,
    /// The frame that the boxes lie in, if it is not the file's.
    pub(crate) framed: Option<Box<Framed>>,
    /// The factor of error bounds in f32, above 1 if corners and rays are rounded.
    pub(crate) error_factor: f32,
    /// The kernel that traces it. The processor has its instructions.
    pub(crate) kernel: Kernel,
    /// The most children that can be waiting on the way through it.
    pub(crate) stack_need: usize,
}

/// The frame of a layout's boxes, and what the layout has of the file's axes otherwise.
#[derive(Clone, Debug)]
pub(crate) struct Framed {
    pub(crate) frame: Frame,
    turn: Turn,
    /// The root's box, padded.
    pub(crate) bounds: Aabb,
    pub(crate) near: Aabb,
    pub(crate) slack: f64,
}

impl WideBvh {
    /// Sets the frame that the boxes lie in, and a box around all of them; `around` is a box around
    /// the triangles along the file's axes.
    pub(crate) fn set_bounds(&mut self, frame: Option<Frame>, bounds: &Aabb, around: Aabb) {
        self.bounds = around;
        self.near = if frame.is_some() { Aabb::EMPTY } else { near_region(bounds) };
        self.framed = frame.map(|frame| {
            let slack = Frame::slack(bounds);
            let padded = Frame::padded(bounds, slack);
            let (turn, near) = (Turn::new(&frame), near_region(bounds));
            Box::new(Framed { frame, turn, bounds: padded, near, slack })
        });
    }

    /// Returns a box of the tree as nodes have it.
    pub(crate) fn laid(&self, aabb: &Aabb) -> Aabb {
        self.framed.as_ref().map_or(*aabb, |framed| Frame::padded(aabb, framed.slack))
    }

    /// The root's box as rays are tested with it.
    #[inline(always)]
    pub(crate) fn root_box(&self) -> &Aabb {
        self.framed.as_ref().map_or(&self.bounds, |framed| &framed.bounds)
    }

    /// The region in which the boxed forms of rays begin that are tested in f32.
    #[inline(always)]
    pub(crate) fn near_box(&self) -> &Aabb {
        self.framed.as_ref().map_or(&self.near, |framed| &framed.near)
    }

    /// Returns the ray as vector kernels test boxes with it, and whether it begins near the scene.
    ///
    /// # Safety
    /// As [`Turn::ray`].
    #[inline(always)]
    pub(crate) unsafe fn boxed<L: Lanes>(&self, ray: &Ray) -> (Ray, bool) {
        match &self.framed {
            None => (*ray, ray.begins_in(&self.near)),
            Some(framed) => {
                let [origin, direction] = ray.ends().each(Vec3::as_dvec3);
                let range = [ray.t_min(), ray.t_max()];
                // SAFETY: the caller's.
                let ray = unsafe { framed.turn.ray::<L>(origin, direction, [1.0; 2], range) };
                (ray, ray.begins_in(&framed.near))
            }
        }
    }

    /// Returns the ray as boxes are tested with it in f64.
    pub(crate) fn far_ray(&self, ray: &Ray) -> FarRay {
        match &self.framed {
            None => FarRay::new(ray),
            Some(framed) => {
                let ends = ray.ends().each(Vec3::as_dvec3);
                FarRay::in_frame(ends, &framed.frame, &framed.bounds)
            }
        }
    }

    /// The ray as the portable kernel tests boxes with it.
    #[inline(always)]
    pub(crate) fn slabs(&self, ray: &Ray) -> Slabs {
        Slabs::in_frame(ray, self.frame(), self.root_box())
    }

    #[inline(always)]
    pub(crate) fn frame(&self) -> Option<&Frame> {
        self.framed.as_ref().map(|framed| &framed.frame)
    }

    #[inline(always)]
    pub(crate) fn places(&self) -> Places {
        Places { nodes: self.nodes.as_ptr().cast(), blocks: self.blocks.as_ptr().cast() }
    }
}
