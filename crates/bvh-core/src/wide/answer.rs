//! What is asked of every ray of a batch, and where the answers go.

use super::gathered::Decided;
use super::instructions::Instructions;
use super::layout::WideBvh;
use super::ray_lanes::Rays;
use super::triangles::TriangleBlock;
use crate::{Hit, Ray};
use bytemuck::Zeroable;

/// The value of the parameter `ANY` of a traversal that ends a ray at the first hit that is found.
pub(crate) const ANY_HIT: bool = true;

/// The value of `ANY` of a traversal that finds a ray's nearest hit.
pub(crate) const NEAREST_HIT: bool = false;

/// A question about rays, with the place of the answers by the number of the ray.
pub(crate) trait Find {
    type Rays: Rays;
    /// Whether the first hit that is found ends a ray.
    const ANY: bool = false;
    /// Whether every hit counts, and none shortens a ray.
    const ALL: bool = false;

    /// Whether the layers in f32 only bound hits, and `decide` decides them.
    const DECIDES: bool = false;
    /// Whether a certain hit in f32 is an answer.
    const TAKES_CERTAIN: bool = true;

    fn rays(&self) -> Self::Rays;

    /// Returns those of the certain hits that count; `along` are those along the normal. Others are
    /// passed over.
    #[inline(always)]
    fn counted(&self, certain: u32, _along: u32) -> u32 {
        certain
    }

    /// Takes what a packet knows of a ray's nearest hit, where hits are decided elsewhere.
    fn learn(&mut self, _number: usize, _known: Known) {}

    /// Returns the same.
    fn known(&self, _number: usize) -> Known {
        Known { low: 0.0, high: 0.0, object: u32::MAX }
    }

    /// Returns the new nearest hit of a ray, if one of the triangles of a block is it.
    ///
    /// # Safety
    /// The processor has the instructions; the block is one of the layout, with a triangle in each
    /// lane that is bounded.
    unsafe fn decide<K: Instructions>(
        &mut self,
        _number: usize,
        _block: &TriangleBlock,
        _bounded: &Bounded,
    ) -> Option<Hit> {
        None
    }

    /// Writes the answer for a ray: the distance at which its traversal ended, and the hit object,
    /// `u32::MAX` for none.
    fn write(&mut self, _number: usize, _t: f32, _object: u32) {}

    /// Takes the hit of a ray and the triangle in a lane of a block, if there is one, where all are
    /// asked for. `pair` is its place among the decided ones.
    fn append(
        &mut self,
        _number: usize,
        _decided: &Decided,
        _pair: usize,
        _block: &TriangleBlock,
        _lane: usize,
    ) {
    }

    fn alone(&mut self, wide: &WideBvh, number: usize);
}

/// What f32 knows about the nearest hit of a ray.
#[derive(Clone, Copy)]
pub(crate) struct Known {
    /// Bounds of its distance.
    pub(crate) low: f32,
    pub(crate) high: f32,
    /// The triangle's id; the greatest number for none.
    pub(crate) object: u32,
}

/// What f32 knows about a ray and the triangles of a block: a bit or a lane for each.
#[repr(C, align(16))]
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct Bounded {
    /// Bounds of the distances of certain hits.
    pub(crate) low: [f32; TriangleBlock::LANES],
    pub(crate) high: [f32; TriangleBlock::LANES],
    /// The triangles that may be hits.
    pub(crate) possible: u32,
    /// Those that certainly are.
    pub(crate) certain: u32,
    /// The certain hits along the triangle's normal.
    pub(crate) along: u32,
}

/// The nearest hit of every ray.
pub(crate) struct Nearest<'a> {
    pub(crate) rays: &'a [Ray],
    pub(crate) hits: &'a mut [Hit],
}

impl<'a> Find for Nearest<'a> {
    type Rays = &'a [Ray];

    #[inline(always)]
    fn rays(&self) -> &'a [Ray] {
        self.rays
    }

    #[inline(always)]
    fn write(&mut self, number: usize, t: f32, object: u32) {
        let t = if object == u32::MAX { f32::INFINITY } else { t };
        self.hits[number] = Hit { t, object };
    }

    fn alone(&mut self, wide: &WideBvh, number: usize) {
        self.hits[number] = wide.nearest_hit(&self.rays[number]).unwrap_or(Hit::MISS);
    }
}

/// Whether each ray hits anything.
pub(crate) struct Any<'a> {
    pub(crate) rays: &'a [Ray],
    pub(crate) hits: &'a mut [bool],
}

impl<'a> Find for Any<'a> {
    type Rays = &'a [Ray];
    const ANY: bool = true;

    #[inline(always)]
    fn rays(&self) -> &'a [Ray] {
        self.rays
    }

    #[inline(always)]
    fn write(&mut self, number: usize, _: f32, object: u32) {
        self.hits[number] = object != u32::MAX;
    }

    fn alone(&mut self, wide: &WideBvh, number: usize) {
        self.hits[number] = wide.any_hit(&self.rays[number]);
    }
}
