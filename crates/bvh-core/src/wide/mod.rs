//! A tree of triangles laid out for speed: eight children per node and four triangles per leaf
//! block, tested at once.

// Some machines have no vector kernel, and then its parts are unused.
#![cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]

mod all_hits;
mod answer;
mod batch;
mod beam;
mod box_ray;
mod build;
mod bundle;
mod closest;
mod decide;
mod double;
mod double_batch;
mod double_block;
mod fan;
mod flight;
mod gathered;
mod instances;
mod instructions;
mod kernel;
mod lanes;
mod layout;
mod neighbours;
mod obstacles;
mod one_ray;
mod packet;
mod packet_vector;
mod pairs;
mod pinhole;
mod portable;
mod prepared;
mod ray_lanes;
mod refit;
mod tightness;
mod triangles;
mod turn;
// The kernels of the target, or none.
#[cfg_attr(target_arch = "x86_64", path = "x86/mod.rs")]
#[cfg_attr(
    any(
        all(target_arch = "aarch64", target_feature = "neon"),
        all(target_arch = "wasm32", target_feature = "simd128")
    ),
    path = "simd128/mod.rs"
)]
mod vector;
mod views;

pub use batch::Coherence;
pub(crate) use bundle::RAYS as POINTS_OF_BEAM;
pub use closest::Closest;
pub(crate) use decide::{BLOCK_COST, NODE_COST};
pub use double::DWideBvh;
pub use instances::{Instance, InstanceHit, Instances, InvalidInstances};
pub use kernel::Kernel;
pub use layout::WideBvh;
pub(crate) use layout::WideNode;
pub use neighbours::neighbours;
pub(crate) use obstacles::Beams;
pub use refit::RefitError;
#[doc(hidden)]
pub use tightness::NodeTest;
pub(crate) use triangles::TriangleBlock;
pub(crate) use views::transpose;

use crate::{Bvh, Counter, Hit, InFrame, InvalidBvh, Ray, Triangle, validate_references};
use answer::{ANY_HIT, NEAREST_HIT};
use one_ray::{All, Filter, OneRay};
use portable::walk;

impl Kernel {
    /// Returns whether this processor can run the kernel.
    pub fn is_available(self) -> bool {
        self == Self::Portable || vector::has(self)
    }

    /// The fastest kernel that this processor can run.
    pub fn best() -> Self {
        Self::ALL.into_iter().find(|kernel| kernel.is_available()).unwrap_or(Self::Portable)
    }
}

impl WideBvh {
    /// Boxes that are tested, and counted, at every node.
    pub const BOXES_OF_NODE: u64 = WideNode::LANES as u64;
    /// Objects that are tested, and counted, at every block of triangles of a leaf.
    pub const OBJECTS_OF_BLOCK: u64 = TriangleBlock::LANES as u64;

    /// Lays out `tree`, valid over the boxes of `triangles`, with any number of children per node.
    /// O(n) time and memory.
    ///
    /// Which nodes of the tree survive, and which subtrees become one leaf, is decided exactly by
    /// dynamic programming: the result has the least expected time for a random line among all that
    /// can be made by leaving nodes out.
    ///
    /// Source: Ylitie, Karras & Laine 2017, 'Efficient incoherent ray traversal on GPUs through
    /// compressed wide BVHs', section 4.1. Differs from the paper: boxes in full precision; leaves
    /// of any size, paid per block of four.
    ///
    /// ```
    /// # use bvh_core::{Bvh, Hit, Node, Ray, Triangle, WideBvh};
    /// let triangles = [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]].map(Triangle::from);
    /// # let tree = Bvh::new(vec![Node::leaf(triangles[0].aabb(), 0, 1)], vec![0]);
    /// // The tree is of any builder of `bvh-build`, or of a search of `bvh-search`.
    /// let wide = WideBvh::new(&tree, &triangles)?;
    /// let ray = Ray::half_line([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]).unwrap();
    /// assert_eq!(wide.nearest_hit(&ray), Some(Hit { t: 3.0, object: 0 }));
    /// assert!(wide.any_hit(&ray));
    /// # Ok::<(), bvh_core::InvalidBvh>(())
    /// ```
    pub fn new(tree: &Bvh, triangles: &[Triangle]) -> Result<Self, InvalidBvh> {
        Self::made(tree, triangles, None)
    }

    /// Lays out `tree` as [`new`](Self::new) does, but for rays that enter each node as often as
    /// `visits` reports, rather than for random lines. Visits have any unit; [`RayDensity::visits`]
    /// returns them, and tree files keep them. Inner nodes with many children are divided as if
    /// their parts had nothing in common.
    ///
    /// [`RayDensity::visits`]: crate::RayDensity::visits
    ///
    /// # Panics
    /// If there are not as many `visits` as nodes.
    pub fn for_rays(
        tree: &Bvh,
        triangles: &[Triangle],
        visits: &[f32],
    ) -> Result<Self, InvalidBvh> {
        assert_eq!(tree.nodes.len(), visits.len(), "a number of visits for every node");
        Self::made(tree, triangles, Some(visits))
    }

    fn made(
        tree: &Bvh,
        triangles: &[Triangle],
        visits: Option<&[f32]>,
    ) -> Result<Self, InvalidBvh> {
        let objects = InFrame { triangles, frame: tree.frame.as_ref() };
        let boxes = objects.boxes();
        validate_references(tree, &boxes, &objects)?;
        // Boxes take a quarter of the layout's memory, and nobody reads them again.
        drop(boxes);
        let is_left_out = |id: u32| triangles[id as usize].is_degenerate();
        Ok(build::widen(tree, triangles, visits, is_left_out))
    }

    /// Returns the nearest triangle that `ray` meets in its range. Of several at the same distance,
    /// the one with the lowest id is nearest.
    pub fn nearest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.one_ray::<NEAREST_HIT>(ray, All)
    }

    /// Returns whether `ray` meets any triangle in its range.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        self.one_ray::<ANY_HIT>(ray, All).is_some()
    }

    /// Returns the nearest hit, or with `ANY` the first one found, among those that `filter`
    /// accepts. The distance of any hit is that of no hit in particular.
    #[inline]
    fn one_ray<const ANY: bool>(&self, ray: &Ray, mut filter: impl Filter) -> Option<Hit> {
        if self.kernel == Kernel::Portable {
            return walk::<ANY>(self, ray, &mut (), |hit| filter.accepts(hit));
        }
        let task = OneRay::<_, ANY> { wide: self, ray, filter };
        // SAFETY: a layout's kernel is available.
        let hit: Hit = unsafe { vector::dispatch(self.kernel, task) };
        (!hit.is_miss()).then_some(hit)
    }

    /// Returns the same layout for another kernel; `None` if this processor cannot run that kernel.
    pub fn with_kernel(mut self, kernel: Kernel) -> Option<Self> {
        if !kernel.is_available() {
            return None;
        }
        self.kernel = kernel;
        Some(self)
    }

    /// Returns the [nearest hit](Self::nearest_hit) by [`Kernel::Portable`], and counts the tests:
    /// eight boxes for each node and four objects for each block of triangles, including unused
    /// places. Counts are the same on every machine.
    #[inline(never)]
    pub fn nearest_hit_counted(&self, ray: &Ray, counter: &mut impl Counter) -> Option<Hit> {
        walk::<NEAREST_HIT>(self, ray, counter, |_| true)
    }

    /// Returns whether `ray` meets [any triangle](Self::any_hit) by [`Kernel::Portable`], and
    /// counts the tests as [`nearest_hit_counted`](Self::nearest_hit_counted) does.
    #[inline(never)]
    pub fn any_hit_counted(&self, ray: &Ray, counter: &mut impl Counter) -> bool {
        walk::<ANY_HIT>(self, ray, counter, |_| true).is_some()
    }

    /// Returns the nearest hit that `accept` accepts, for example where a texture is opaque.
    /// `accept` sees hits in no order, and only as many as the answer needs: all of them if it
    /// accepts none.
    ///
    /// ```
    /// # use bvh_core::{Aabb, Bvh, Hit, Node, Ray, Triangle, WideBvh};
    /// # let triangles = [0.0, 1.0].map(|z| Triangle::from([[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]]));
    /// # let tree = Bvh::new(vec![Node::leaf(Aabb::from([[0.0; 3], [1.0; 3]]), 0, 2)], vec![0, 1]);
    /// # let wide = WideBvh::new(&tree, &triangles)?;
    /// let ray = Ray::half_line([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]).unwrap();
    /// let masked = wide.nearest_hit_where(&ray, |hit| hit.object != 1);
    /// assert_eq!(masked, Some(Hit { t: 3.0, object: 0 }));
    /// let mut all = vec![];
    /// wide.nearest_hit_where(&ray, |hit| {
    ///     all.push(hit);
    ///     false
    /// });
    /// assert_eq!(all.len(), 2);
    /// # Ok::<(), bvh_core::InvalidBvh>(())
    /// ```
    pub fn nearest_hit_where(&self, ray: &Ray, mut accept: impl FnMut(Hit) -> bool) -> Option<Hit> {
        self.nearest_accepted(ray, &mut accept)
    }

    /// Returns whether `ray` has a hit that `accept` accepts, for example for shadows of cut-out
    /// leaves.
    pub fn any_hit_where(&self, ray: &Ray, mut accept: impl FnMut(Hit) -> bool) -> bool {
        self.any_accepted(ray, &mut accept)
    }

    // Not generic over the filter: a generic kernel would be compiled, perhaps without
    // optimisation, by every crate that calls it.
    fn nearest_accepted(&self, ray: &Ray, accept: &mut dyn FnMut(Hit) -> bool) -> Option<Hit> {
        self.one_ray::<NEAREST_HIT>(ray, accept)
    }

    fn any_accepted(&self, ray: &Ray, accept: &mut dyn FnMut(Hit) -> bool) -> bool {
        self.one_ray::<ANY_HIT>(ray, accept).is_some()
    }

    /// The number of bytes of nodes and triangles.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.blocks[..])
    }
}
