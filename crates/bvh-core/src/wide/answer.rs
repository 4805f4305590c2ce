//! What is asked of every ray of a batch, and where the answers go.

use super::instructions::Instructions;
use super::layout::WideBvh;
use super::triangles::TriangleBlock;
use crate::{Hit, Ray};

/// The value of the parameter `ANY` of a traversal that ends a ray at the first hit that is found.
pub(crate) const ANY_HIT: bool = true;

/// The value of `ANY` of a traversal that finds a ray's nearest hit.
pub(crate) const NEAREST_HIT: bool = false;

/// A question about rays, with the place of the answers by the number of the ray.
pub(crate) trait Find {
    /// Whether the first hit that is found ends a ray.
    const ANY: bool = false;
    /// Whether every hit counts, and none shortens a ray.
    const ALL: bool = false;

    /// Whether the layers in f32 only pass on pairs that may be hits, and `decide` decides them.
    const DECIDES: bool = false;
    /// Whether a certain hit in f32 is an answer.
    const TAKES_CERTAIN: bool = true;

    /// Returns the new nearest hit of a ray, if one of the possible triangles of a block is it.
    ///
    /// # Safety
    /// The processor has the instructions; the block is one of the layout.
    unsafe fn decide<K: Instructions>(
        &mut self,
        _number: usize,
        _block: &TriangleBlock,
        _possible: u32,
    ) -> Option<Hit> {
        None
    }

    /// Writes the answer for a ray: the distance at which its traversal ended, and the hit object,
    /// `u32::MAX` for none.
    fn write(&mut self, _number: usize, _t: f32, _object: u32) {}

    /// Takes one of all hits.
    fn append(&mut self, _number: usize, _hit: Hit) {}

    /// Answers one ray by itself.
    fn alone(&mut self, wide: &WideBvh, number: usize, ray: &Ray);
}

/// The nearest hit of every ray.
pub(crate) struct Nearest<'a>(pub(crate) &'a mut [Hit]);

impl Find for Nearest<'_> {
    #[inline(always)]
    fn write(&mut self, number: usize, t: f32, object: u32) {
        let t = if object == u32::MAX { f32::INFINITY } else { t };
        self.0[number] = Hit { t, object };
    }

    fn alone(&mut self, wide: &WideBvh, number: usize, ray: &Ray) {
        self.0[number] = wide.nearest_hit(ray).unwrap_or(Hit::MISS);
    }
}

/// Whether each ray hits anything.
pub(crate) struct Any<'a>(pub(crate) &'a mut [bool]);

impl Find for Any<'_> {
    const ANY: bool = true;

    #[inline(always)]
    fn write(&mut self, number: usize, _: f32, object: u32) {
        self.0[number] = object != u32::MAX;
    }

    fn alone(&mut self, wide: &WideBvh, number: usize, ray: &Ray) {
        self.0[number] = wide.any_hit(ray);
    }
}
