//! A tree of triangles laid out for speed: eight children per node and four triangles per leaf block, tested at once.

use crate::block::Block;
use crate::lanes::{Expand, Portable, WideRay};
use crate::stack::Stack;
use crate::{Aabb, Bvh, Counter, Hit, InvalidBvh, Ray, Shear, Triangle, collapse, validate};
use alloc::vec::Vec;
use bytemuck::{Pod, Zeroable};

/// An immutable copy of a [`Bvh`] and its triangles, for tracing only.
///
/// Gives the answers of [`nearest_hit`](crate::nearest_hit) with [`Triangle::intersect`] over the same triangles, bit
/// by bit, on every machine: with AVX2 where the processor has it and the feature `std` is on, else with portable code.
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
    pub(crate) blocks: Vec<Block>,
}

/// A [`WideBvh`] that lies elsewhere, in a mapped file for example.
#[derive(Clone, Copy, Debug)]
pub struct WideView<'a> {
    pub(crate) bounds: Aabb,
    pub(crate) root: Option<Child>,
    pub(crate) nodes: &'a [WideNode],
    pub(crate) blocks: &'a [Block],
}

/// A node's eight children, or fewer in the lower lanes: four cache lines.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct WideNode {
    /// Lower x, y, z, then upper x, y, z, of all children; NaN in unused lanes, so that no ray enters them.
    pub(crate) planes: [[f32; 8]; 6],
    pub(crate) children: [Child; 8],
    pub(crate) padding: [u32; 8],
}

impl WideNode {
    pub(crate) const LANES: usize = 8;
    pub(crate) const EMPTY: Self =
        Self { planes: [[f32::NAN; 8]; 6], children: [Child::node(0); 8], padding: [0; 8] };

    /// Gives a lane a child with this box.
    pub(crate) fn set_box(&mut self, lane: usize, aabb: &Aabb) {
        for axis in 0..3 {
            self.planes[axis][lane] = aabb.min[axis];
            self.planes[axis + 3][lane] = aabb.max[axis];
        }
    }
}

/// A node's index, or the index of a leaf's first block; the leaf's last block is marked as such.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;

    pub(crate) const fn node(index: u32) -> Self {
        Self(index)
    }

    /// The leaf that begins with this block.
    pub(crate) const fn leaf(first_block: u32) -> Self {
        Self(first_block | Self::LEAF)
    }

    /// The index of the node, or of the leaf's first block.
    pub(crate) fn target(self) -> WideTarget {
        let index = (self.0 & !Self::LEAF) as usize;
        if self.0 & Self::LEAF == 0 { WideTarget::Node(index) } else { WideTarget::Block(index) }
    }
}

/// What a [`Child`] refers to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum WideTarget {
    Node(usize),
    Block(usize),
}

/// A child that the ray enters at `entry`, to be visited later.
#[derive(Clone, Copy)]
#[repr(C)]
pub(crate) struct Pending {
    pub(crate) entry: f32,
    pub(crate) child: Child,
}

impl WideBvh {
    /// Lays out `tree`, valid over the boxes of `triangles`, with any number of children per node. O(n) time and
    /// memory.
    ///
    /// Which nodes of the tree survive, and which subtrees become one leaf, is decided exactly by dynamic programming:
    /// the result has the least expected time for a random line among all that can be made by leaving nodes out.
    ///
    /// Source: Ylitie, Karras & Laine 2017, 'Efficient incoherent ray traversal on GPUs through compressed wide BVHs',
    /// section 4.1. Differs from the paper: boxes in full precision; leaves of any size, paid per block of four.
    pub fn new(tree: &Bvh, triangles: &[Triangle]) -> Result<Self, InvalidBvh> {
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
        validate(tree, &boxes)?;
        Ok(collapse::widen(tree, triangles))
    }

    /// The layout where it lies.
    #[inline(always)]
    pub fn view(&self) -> WideView<'_> {
        WideView { bounds: self.bounds, root: self.root, nodes: &self.nodes, blocks: &self.blocks }
    }

    /// The nearest triangle that `ray` meets in its range; of several at the same distance the one of the lowest id.
    #[inline]
    pub fn nearest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.view().nearest_hit(ray)
    }

    /// Whether `ray` meets any triangle in its range.
    #[inline]
    pub fn any_hit(&self, ray: &Ray) -> bool {
        self.view().any_hit(ray)
    }

    /// Bytes of memory that nodes and triangles take.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.blocks[..])
    }
}

impl<'a> WideView<'a> {
    /// A layout whose root is the first node, else the leaf of all blocks.
    pub(crate) fn over(bounds: Aabb, nodes: &'a [WideNode], blocks: &'a [Block]) -> Self {
        let leaf = (!blocks.is_empty()).then_some(Child::leaf(0));
        let root = if nodes.is_empty() { leaf } else { Some(Child::node(0)) };
        Self { bounds, root, nodes, blocks }
    }

    /// As [`WideBvh::nearest_hit`].
    #[inline]
    pub fn nearest_hit(self, ray: &Ray) -> Option<Hit> {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        if let Some(avx2) = crate::lanes::Avx2::detect() {
            return avx2.nearest_hit(self, ray);
        }
        self.nearest_hit_portable(ray)
    }

    /// As [`WideBvh::any_hit`].
    #[inline]
    pub fn any_hit(self, ray: &Ray) -> bool {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        if let Some(avx2) = crate::lanes::Avx2::detect() {
            return avx2.any_hit(self, ray);
        }
        self.any_hit_portable(ray)
    }

    /// [`nearest_hit`](Self::nearest_hit) without instructions that the processor may lack.
    pub fn nearest_hit_portable(self, ray: &Ray) -> Option<Hit> {
        self.nearest_hit_counted(ray, &mut ())
    }

    /// [`any_hit`](Self::any_hit) without instructions that the processor may lack.
    pub fn any_hit_portable(self, ray: &Ray) -> bool {
        self.any_hit_counted(ray, &mut ())
    }

    /// [`nearest_hit_portable`](Self::nearest_hit_portable) with its tests counted: eight boxes for every node and four
    /// objects for every block of triangles, whether these have so many or not. The same counts on every machine.
    pub fn nearest_hit_counted(self, ray: &Ray, counter: &mut impl Counter) -> Option<Hit> {
        self.nearest_with::<Portable>(ray, counter)
    }

    /// [`any_hit_portable`](Self::any_hit_portable) with its tests counted likewise.
    pub fn any_hit_counted(self, ray: &Ray, counter: &mut impl Counter) -> bool {
        self.any_with::<Portable>(ray, counter)
    }

    #[inline(always)]
    pub(crate) fn nearest_with<E: Expand>(self, ray: &Ray, counter: &mut impl Counter) -> Option<Hit> {
        self.walk::<E, false>(ray, counter)
    }

    #[inline(always)]
    pub(crate) fn any_with<E: Expand>(self, ray: &Ray, counter: &mut impl Counter) -> bool {
        self.walk::<E, true>(ray, counter).is_some()
    }

    /// The nearest hit, or the first one found. One function without closures, so that all of it is compiled with the
    /// instructions that its caller may use.
    #[inline(always)]
    fn walk<E: Expand, const ANY: bool>(self, ray: &Ray, counter: &mut impl Counter) -> Option<Hit> {
        let mut child = self.root?;
        let (shear, wide_ray) = (Shear::new(ray), WideRay::new(ray, &self.bounds));
        let mut nearest: Option<Hit> = None;
        let mut t_max = ray.t_max();
        let mut stack = Stack::<Pending, 32>::new(Pending { entry: 0.0, child: Child::node(0) });
        loop {
            if child.0 & Child::LEAF == 0 {
                counter.boxes(WideNode::LANES);
                let node = &self.nodes[child.0 as usize];
                if let Some((nearest, others)) = E::expand(node, &wide_ray, t_max, stack.room()) {
                    stack.grow(others);
                    child = nearest;
                    continue;
                }
            } else {
                for block in &self.blocks[(child.0 & !Child::LEAF) as usize..] {
                    (0..Block::LANES).for_each(|_| counter.object());
                    let mut lanes = block.candidates(&shear, t_max);
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize;
                        lanes &= lanes - 1;
                        if let Some((object, triangle)) = block.triangle(lane)
                            && let Some(t) = triangle.decide(&shear, t_max)
                        {
                            let hit = Hit { t, object };
                            if ANY {
                                return Some(hit);
                            }
                            if nearest.is_none_or(|nearest| hit.precedes(&nearest)) {
                                nearest = Some(hit);
                                t_max = t;
                            }
                        }
                    }
                    if block.is_last() {
                        break;
                    }
                }
            }
            child = loop {
                let Some(pending) = stack.pop() else { return nearest };
                if pending.entry <= t_max {
                    break pending.child;
                }
            };
        }
    }
}

#[cfg(test)]
impl WideBvh {
    /// The box of every node, with 0, and of every leaf, with its number of blocks.
    pub(crate) fn boxes(&self) -> impl Iterator<Item = (Aabb, usize)> {
        let lane_box = |node: &WideNode, lane: usize| Aabb {
            min: [0, 1, 2].map(|axis| node.planes[axis][lane]).into(),
            max: [3, 4, 5].map(|axis| node.planes[axis][lane]).into(),
        };
        let blocks = |child: Child| match child.0 & Child::LEAF {
            0 => 0,
            leaf => {
                1 + self.blocks[(child.0 ^ leaf) as usize..].iter().take_while(|block| !block.is_last()).count()
            }
        };
        let root = self.root.map(|root| (self.bounds, blocks(root)));
        root.into_iter().chain(self.nodes.iter().flat_map(move |node| {
            let used = (0..8).filter(|&lane| !node.planes[0][lane].is_nan());
            used.map(move |lane| (lane_box(node, lane), blocks(node.children[lane])))
        }))
    }
}
