//! A tree of triangles laid out for speed: eight children per node and four triangles per leaf block, tested at once.

#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod avx2;
mod build;
mod layout;
pub(crate) mod node;
mod portable;
mod traverse;
pub(crate) mod triangle4;

pub use layout::{WideBvh, WideView};

use crate::{Aabb, Bvh, Counter, Hit, InvalidBvh, Ray, Triangle, validate};
use alloc::vec::Vec;
use portable::Portable;
use traverse::walk;

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
        Ok(build::widen(tree, triangles))
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

impl WideView<'_> {
    /// As [`WideBvh::nearest_hit`].
    #[inline]
    pub fn nearest_hit(self, ray: &Ray) -> Option<Hit> {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        if let Some(avx2) = avx2::Avx2::detect() {
            return avx2.nearest_hit(self, ray);
        }
        self.nearest_hit_portable(ray)
    }

    /// As [`WideBvh::any_hit`].
    #[inline]
    pub fn any_hit(self, ray: &Ray) -> bool {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        if let Some(avx2) = avx2::Avx2::detect() {
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
        walk::<Portable, false>(self, ray, counter)
    }

    /// [`any_hit_portable`](Self::any_hit_portable) with its tests counted likewise.
    pub fn any_hit_counted(self, ray: &Ray, counter: &mut impl Counter) -> bool {
        walk::<Portable, true>(self, ray, counter).is_some()
    }
}
