//! The wide layout of triangles in f64.
//!
//! Boxes and triangles are laid out in f32, in the frame of the tree, and traversed by the kernels
//! for f32. These bound the distances of hits, and know nearly always which hit is nearest:
//!
//! ```text
//!   f32          does the line cross the triangle?   between which distances?
//!    │ perhaps                                        │ the nearest    │ they overlap
//!   f64 ──> expansions, exact                         │               f64 ──> expansions
//!                                                     └─> its distance, once, in twice f64
//! ```
//!
//! # The bounds
//!
//! A corner in f32 is off by uS, with S the largest coordinate in the frame, and a ray's origin by
//! u|o|. With R the largest coordinate relative to the origin and S ≤ kR, a relative corner is off
//! by u (S + |o| + R) ≤ 2 (k + 1) uR, and each component of the direction by u of itself, where
//! [`pairs`](super::pairs) has uR and nothing. The frame's own errors are below 2⁻³⁷ of both.
//!
//! With k = 1, a sheared coordinate is off by less than 14.4 uR and an edge value by less than
//! 4 · 14.4 uRm + 8.5 uRm and a square: less than e (m + e) with e = 72 uR. A difference of depths
//! is off by 10 uR, X by 5EΔ / |a| + (55 + 17) uR, and the other terms together by 36 uR: less than
//! 128 uR. So the bounds of f32 hold with 2kR for R. Ends of a range are rounded to f32: beyond the
//! slack |T − t| exceeds u|t|, so that t and the end itself are on the same sides. A half of the largest extent is never more than
//! R, and so k is at most S over that half.

use super::answer::{ANY_HIT, Bounded, NEAREST_HIT};
use super::double_block::{decide, rounded_distance};
use super::instructions::{Instructions, Task};
use super::lanes::Lanes;
use super::layout::{WideBvh, WideNode};
use super::one_ray::{DeferredRay, Leaves, traverse};
use super::triangles::TriangleBlock;
use super::turn::Turn;
use super::{build, portable, vector};
use crate::double::{NearestHit, Query};
use crate::each::Each;
use crate::slabs::FarRay;
use crate::{
    Aabb, Bvh, DHit, DRay, DTriangle, Frame, Hit, InFrame, InvalidBvh, Kernel, Orientation, Ray,
    Select, Slabs, Triangle, validate_references,
};
use bytemuck::Zeroable;
use glam::{DMat3, DVec3};
use std::borrow::Cow;

/// An immutable copy of a tree and its triangles in f64, for tracing only.
///
/// Gives the answers of testing every triangle by [`DTriangle::intersect`], bit by bit, on every
/// machine and with every [`Kernel`]. Boxes are those of a [`WideBvh`].
///
/// ```
/// # use bvh_core::{Bvh, DRay, DTriangle, DWideBvh, Node, Select};
/// // A triangle at map coordinates, which f32 would move by a quarter.
/// let at = [5.0e6, 5.0e5, 100.0];
/// # let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// let triangles = [DTriangle(corners.map(|c| [0, 1, 2].map(|i| at[i] + c[i]).into()))];
/// let frame = DWideBvh::centred(&triangles);
/// let boxes = DWideBvh::boxes(&triangles, &frame); // for any builder
/// # let tree = Bvh::new(vec![Node::leaf(boxes[0], 0, 1)], vec![0]);
/// let wide = DWideBvh::new(&Bvh { frame: Some(frame), ..tree }, &triangles)?;
/// let ray = DRay::half_line([at[0] + 0.1, at[1] + 0.1, 103.0], [0.0, 0.0, -1.0])?;
/// assert_eq!(wide.nearest_hit(&ray, Select::default()).map(|hit| hit.t), Some(3.0));
/// assert!(!wide.any_hit(&ray, Select { exclude: &[0], ..Select::default() }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct DWideBvh {
    /// The triangles in f32, in the frame.
    pub(super) wide: WideBvh,
    pub(super) frame: Frame,
    turn: Turn,
    /// By id.
    pub(super) triangles: Box<[DTriangle]>,
}

impl DWideBvh {
    /// Lays out `tree`, valid over the [boxes](Self::boxes) of `triangles`, as [`WideBvh::new`]
    /// does. Its frame should have its centre in the middle of the scene. Triangles that
    /// [`DTriangle::check`] rejects have answers that are not exact. O(n) time and memory.
    pub fn new(tree: &Bvh, triangles: &[DTriangle]) -> Result<Self, InvalidBvh> {
        let frame = tree.frame.unwrap_or(Frame::FILE);
        let objects = InFrame { triangles, frame: Some(&frame) };
        validate_references(tree, &objects.boxes(), &objects)?;
        let in_frame = |corner: DVec3| frame.point(corner).as_vec3();
        let rounded: Vec<Triangle> =
            triangles.iter().map(|triangle| Triangle(triangle.0.each(in_frame))).collect();
        let framed = match tree.frame {
            Some(_) => Cow::Borrowed(tree),
            None => Cow::Owned(Bvh { frame: Some(frame), ..tree.clone() }),
        };
        let is_left_out = |id: u32| triangles[id as usize].is_degenerate();
        let mut wide = build::widen(&framed, &rounded, None, is_left_out);
        if let Some(framed) = wide.framed.take() {
            let Aabb { min, max } = framed.bounds;
            let half = 0.5 * (max - min).max_element();
            let size = min.abs().max(max.abs()).max_element();
            wide.error_factor = if half > 0.0 { 2.0 * (size / half).max(1.0) } else { f32::MAX };
            wide.bounds = framed.bounds;
            wide.near = framed.near;
        }
        Ok(Self { wide, frame, turn: Turn::new(&frame), triangles: triangles.into() })
    }

    /// Returns the boxes of triangles in a frame, to build a tree over.
    pub fn boxes(triangles: &[DTriangle], frame: &Frame) -> Vec<Aabb> {
        InFrame { triangles, frame: Some(frame) }.boxes()
    }

    /// Returns a frame along the file's axes with its centre in the middle of the triangles.
    pub fn centred(triangles: &[DTriangle]) -> Frame {
        let corners = || triangles.iter().flat_map(|triangle| triangle.0);
        let min = corners().fold(DVec3::INFINITY, DVec3::min);
        let max = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        let middle = min + (max - min) * 0.5;
        let centre = if middle.is_finite() { middle } else { DVec3::ZERO };
        Frame::new(DMat3::IDENTITY, centre).unwrap_or(Frame::FILE)
    }

    /// Returns the same layout for another kernel; `None` if this processor cannot run that kernel.
    pub fn with_kernel(self, kernel: Kernel) -> Option<Self> {
        Some(Self { wide: self.wide.with_kernel(kernel)?, ..self })
    }

    /// Returns the nearest triangle that `ray` meets in its range, among those that count. Of several
    /// at the same distance, the one with the lowest id is nearest.
    #[inline]
    pub fn nearest_hit(&self, ray: &DRay, select: Select) -> Option<DHit> {
        self.nearest_hit_of(ray, select.orientation, select.exclude)
    }

    /// Returns whether `ray` meets any triangle that counts in its range.
    #[inline]
    pub fn any_hit(&self, ray: &DRay, select: Select) -> bool {
        self.any_hit_of(ray, select.orientation, select.exclude)
    }

    // By numbers in registers: a load of two that were just written would wait until they have
    // reached the cache.

    fn nearest_hit_of(
        &self,
        ray: &DRay,
        orientation: Orientation,
        exclude: &[u32],
    ) -> Option<DHit> {
        let mut nearest = NearestHit::new(ray);
        let query = self.query(ray, Select { orientation, exclude });
        self.search::<NEAREST_HIT>(&query, &mut nearest);
        nearest.hit()
    }

    fn any_hit_of(&self, ray: &DRay, orientation: Orientation, exclude: &[u32]) -> bool {
        let query = self.query(ray, Select { orientation, exclude });
        self.search::<ANY_HIT>(&query, &mut NearestHit::new(ray))
    }

    /// Returns the hits of the ray in its range, each crossing of a surface once, the nearest first;
    /// among hits at the same distance the lowest id first. The rule is that of
    /// [`WideBvh::all_hits`], and the hits those of [`DTriangle::crossing`].
    pub fn all_hits(&self, ray: &DRay) -> Vec<DHit> {
        let mut hits = Vec::new();
        if self.wide.kernel == Kernel::Portable {
            self.visit_portable::<ANY_HIT>(ray, |block, _| {
                block.triangles().for_each(|(object, _)| hits.extend(self.hit_of(ray, object)));
                false
            });
        } else {
            let task = AllHits { layout: self, ray, hits: &mut hits };
            // SAFETY: a layout's kernel is available.
            unsafe { vector::dispatch::<_, ()>(self.wide.kernel, task) };
        }
        // No distance is negative or −0, so distances are ordered as their bits are. A divided
        // triangle is hit in several leaves, every time at the same distance.
        hits.sort_unstable_by_key(|hit| (hit.t.to_bits(), hit.object));
        hits.dedup();
        hits
    }

    pub(super) fn hit_of(&self, ray: &DRay, object: u32) -> Option<DHit> {
        let t = self.triangles[object as usize].crossing(ray)?;
        Some(DHit { t, object })
    }

    /// Visits the blocks that a ray enters by [`Kernel::Portable`].
    fn visit_portable<const ANY: bool>(
        &self,
        ray: &DRay,
        visit: impl FnMut(&TriangleBlock, &mut Hit) -> bool,
    ) -> Hit {
        let boxed = self.boxed(ray);
        let slabs = Slabs::of_frame(&boxed, ray.scaled_ends(), &self.frame, &self.wide.bounds);
        let intervals = |node: &WideNode| portable::intervals(&slabs, node);
        portable::traverse::<ANY>(&self.wide, boxed.t_max(), intervals, &mut (), visit)
    }

    pub(super) fn resolve_alone(&self, ray: &DRay, nearest: &mut NearestHit) {
        if !nearest.is_known() {
            self.query(ray, Select::default()).resolve(nearest);
        }
    }

    fn far_ray(&self, ray: &DRay) -> FarRay {
        FarRay::in_frame(ray.scaled_ends(), &self.frame, &self.wide.bounds)
    }

    fn query<'a>(&'a self, ray: &'a DRay, select: Select<'a>) -> Query<'a> {
        Query { triangles: &self.triangles, ray, select }
    }

    /// Returns the ray in the frame. Its direction has a largest component of about 1, so that f32
    /// has all distances within the scene.
    pub(super) fn boxed(&self, ray: &DRay) -> Ray {
        self.frame.ray_of(ray.scaled_ends(), [ray.single(ray.t_min), ray.single(ray.t_max)])
    }

    /// Returns the same by vector registers.
    ///
    /// # Safety
    /// As [`Turn::ray`].
    #[inline(always)]
    unsafe fn boxed_by<L: Lanes>(&self, ray: &DRay) -> Ray {
        let range = [ray.single(ray.t_min), ray.single(ray.t_max)];
        // SAFETY: the caller's.
        unsafe { self.turn.ray::<L>(ray.origin, ray.direction, ray.scales(), range) }
    }

    /// Finds the nearest hit that counts, or with `ANY` any. Returns whether there is one.
    #[inline]
    pub(super) fn search<const ANY: bool>(&self, query: &Query, nearest: &mut NearestHit) -> bool {
        if self.wide.kernel != Kernel::Portable {
            let task = Search::<ANY> { layout: self, query, nearest };
            // SAFETY: a layout's kernel is available.
            return unsafe { vector::dispatch(self.wide.kernel, task) };
        }
        self.search_portable::<ANY>(query, nearest)
    }

    #[inline(never)]
    fn search_portable<const ANY: bool>(&self, query: &Query, nearest: &mut NearestHit) -> bool {
        let visit = |block: &TriangleBlock, limit: &mut Hit| {
            let mut is_nearer = false;
            for (object, _) in block.triangles() {
                is_nearer |= query.offer(nearest, object);
            }
            if is_nearer {
                *limit = Hit { t: query.ray.single(nearest.high), object: 0 };
            }
            is_nearer
        };
        let hit = self.visit_portable::<ANY>(query.ray, visit);
        self.resolve_alone(query.ray, nearest);
        !hit.is_miss()
    }

    /// Takes those triangles of a block that are nearer. Returns the ray's new end in f32, if there
    /// are any.
    ///
    /// # Safety
    /// The processor has the instructions of `K`; the block is one of the layout.
    #[inline(always)]
    pub(super) unsafe fn offer_block<K: Instructions>(
        &self,
        query: &Query,
        nearest: &mut NearestHit,
        block: &TriangleBlock,
        bounded: &Bounded,
    ) -> Option<f32> {
        let Bounded { low, high, possible, certain, along } = *bounded;
        // SAFETY: the processor has the instructions.
        let used = unsafe { block.used::<K::Block>() };
        let mut end = None;
        let mut lanes = query.select.oriented(certain & used, along);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 3;
            lanes &= lanes - 1;
            let object = block.id(lane);
            if query.select.exclude.contains(&object) {
                continue;
            }
            let new = NearestHit::between(query.ray.doubles(low[lane], high[lane]), object);
            // It is certainly in the ray's range.
            if new.high < nearest.low {
                *nearest = new;
                end = Some(high[lane]);
            } else if new.low <= nearest.high && query.take_close(nearest, new) {
                end = Some(query.ray.single(nearest.high));
            }
        }
        let others = possible & !certain & used;
        if others != 0 {
            let doubles = InDoubles { query: *query, nearest, block, possible: others };
            // SAFETY: as above.
            if unsafe { K::call(doubles) } {
                end = Some(query.ray.single(nearest.high));
            }
        }
        end
    }

    /// Returns a triangle of a block that the ray hits, if there is one.
    ///
    /// # Safety
    /// As [`offer_block`](Self::offer_block).
    #[inline(always)]
    pub(super) unsafe fn any_of<K: Instructions>(
        &self,
        query: &Query,
        block: &TriangleBlock,
        Bounded { possible, certain, along, .. }: &Bounded,
    ) -> Option<u32> {
        // SAFETY: the processor has the instructions.
        let used = unsafe { block.used::<K::Block>() };
        let mut lanes = query.select.oriented(certain & used, *along);
        while lanes != 0 {
            let object = block.id(lanes.trailing_zeros() as usize & 3);
            lanes &= lanes - 1;
            if !query.select.exclude.contains(&object) {
                return Some(object);
            }
        }
        let others = possible & !certain & used;
        let mut nearest = NearestHit::new(query.ray);
        // SAFETY: as above.
        let is_hit = others != 0
            && unsafe {
                let nearest = &mut nearest;
                K::call(InDoubles { query: *query, nearest, block, possible: others })
            };
        is_hit.then_some(nearest.object)
    }
}

/// A search by a vector kernel.
struct Search<'a, const ANY: bool> {
    layout: &'a DWideBvh,
    query: &'a Query<'a>,
    nearest: &'a mut NearestHit,
}

impl<K: Instructions, const ANY: bool> Task<K> for Search<'_, ANY> {
    type Output = bool;

    #[inline(always)]
    unsafe fn run(self) -> bool {
        let Self { layout, query, nearest } = self;
        // SAFETY: the processor has the instructions.
        unsafe {
            let boxed = layout.boxed_by::<K::Block>(query.ray);
            let leaf_ray = DeferredRay::new(&boxed, &layout.wide);
            let mut leaves = Candidates::<_, ANY> { layout, leaf_ray, query, nearest };
            let hit = traverse::<K, ANY>(&layout.wide, &boxed, &mut leaves);
            if !ANY && !nearest.is_known() {
                let triangle = &layout.triangles[nearest.object as usize];
                match rounded_distance::<K::Block>(query.ray, triangle, nearest) {
                    Some(t) => (nearest.low, nearest.high) = (t, t),
                    None => layout.resolve_alone(query.ray, nearest),
                }
            }
            !hit.is_miss()
        }
    }
}

/// The search for all hits of a ray by a vector kernel.
struct AllHits<'a> {
    layout: &'a DWideBvh,
    ray: &'a DRay,
    hits: &'a mut Vec<DHit>,
}

impl<K: Instructions> Task<K> for AllHits<'_> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        // SAFETY: the processor has the instructions.
        unsafe {
            let layout = self.layout;
            let boxed = layout.boxed_by::<K::Block>(self.ray);
            let leaf_ray = DeferredRay::new(&boxed, &layout.wide);
            let mut leaves = AllCandidates { leaf_ray, hits: self };
            traverse::<K, ANY_HIT>(&layout.wide, &boxed, &mut leaves);
        }
    }
}

/// Takes the triangles of a block that the ray crosses.
struct AllCandidates<'a, 'r, L> {
    leaf_ray: DeferredRay<'r, L>,
    hits: AllHits<'a>,
}

impl<K: Instructions> Leaves<K> for AllCandidates<'_, '_, K::Block> {
    #[inline(always)]
    unsafe fn visit(&mut self, block: &TriangleBlock, _: &mut Hit) -> bool {
        let AllHits { layout, ray, hits } = &mut self.hits;
        // SAFETY: the processor has the instructions.
        let possible = unsafe {
            let leaf_ray = self.leaf_ray.get::<K>();
            let corners = leaf_ray.corners(block);
            leaf_ray.pairs.candidates(&corners).crossings.possible & block.used::<K::Block>()
        };
        for lane in (0..TriangleBlock::LANES).filter(|lane| possible >> lane & 1 != 0) {
            hits.extend(layout.hit_of(ray, block.id(lane)));
        }
        false
    }

    fn far_ray(&self, _: &WideBvh, _: &Ray) -> FarRay {
        self.hits.layout.far_ray(self.hits.ray)
    }
}

/// Passes the triangles of a block on that the ray may meet.
struct Candidates<'a, 'r, L, const ANY: bool> {
    layout: &'a DWideBvh,
    leaf_ray: DeferredRay<'r, L>,
    query: &'a Query<'a>,
    nearest: &'a mut NearestHit,
}

impl<K: Instructions, const ANY: bool> Leaves<K> for Candidates<'_, '_, K::Block, ANY> {
    #[inline(always)]
    unsafe fn visit(&mut self, block: &TriangleBlock, nearest: &mut Hit) -> bool {
        // SAFETY: the processor has the instructions.
        unsafe {
            let leaf_ray = self.leaf_ray.get::<K>();
            let corners = leaf_ray.corners(block);
            let pairs = &leaf_ray.pairs;
            let candidates = pairs.candidates(&corners);
            let (possible, certain) = pairs.within(&candidates, K::Block::splat(nearest.t));
            if possible == 0 {
                return false;
            }
            let ([low, high], along) = pairs.distances(&candidates);
            let mut bounded = Bounded { possible, certain, along, ..Bounded::zeroed() };
            if ANY {
                let hit = self.layout.any_of::<K>(self.query, block, &bounded);
                nearest.object = hit.unwrap_or(nearest.object);
                return hit.is_some();
            }
            low.store(bounded.low.as_mut_ptr());
            high.store(bounded.high.as_mut_ptr());
            let end = self.layout.offer_block::<K>(self.query, self.nearest, block, &bounded);
            if let Some(t) = end {
                let object = self.nearest.object;
                *nearest = Hit { t, object };
                let triangle = self.query.triangles.as_ptr().wrapping_add(object as usize);
                K::prefetch_bytes(triangle.cast(), size_of::<DTriangle>());
            }
            end.is_some()
        }
    }

    fn far_ray(&self, _: &WideBvh, _: &Ray) -> FarRay {
        self.layout.far_ray(self.query.ray)
    }
}

/// The decision about triangles of a block of which f32 knows no more than that they are
/// `possible`. Few are, and so it is by itself.
struct InDoubles<'a, 'n> {
    query: Query<'a>,
    nearest: &'n mut NearestHit,
    block: &'a TriangleBlock,
    possible: u32,
}

impl<K: Instructions> Task<K> for InDoubles<'_, '_> {
    /// Whether one of them is nearer.
    type Output = bool;

    #[inline(always)]
    unsafe fn run(self) -> bool {
        let Self { query, nearest, block, possible } = self;
        // SAFETY: the processor has the instructions; the block is one of the layout.
        let decided = unsafe { decide::<K::Block>(query.ray, block, query.triangles, possible) };
        let mut is_nearer = false;
        for lane in (0..TriangleBlock::LANES).filter(|lane| decided.hits >> lane & 1 != 0) {
            let bounds = (decided.low[lane], decided.high[lane]);
            is_nearer |= query.take(nearest, NearestHit::between(bounds, block.id(lane)));
        }
        for lane in (0..TriangleBlock::LANES).filter(|lane| decided.unsure >> lane & 1 != 0) {
            is_nearer |= query.offer(nearest, block.id(lane));
        }
        is_nearer
    }
}
