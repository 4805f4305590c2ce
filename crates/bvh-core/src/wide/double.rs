//! The wide layout of triangles in f64.
//!
//! Boxes and triangles are laid out in f32, in the frame of the tree, and traversed by the kernels
//! for f32. What they pass on is decided with the triangles in f64.
//!
//! # The bounds
//!
//! A corner in f32 is off by uS, with S the largest coordinate in the frame, and a ray's origin by
//! u|o|. With R the largest coordinate relative to the origin and S ≤ kR, a relative corner is off
//! by u (S + |o| + R) ≤ 2 (k + 1) uR, and each component of the direction by u of itself, where
//! [`pairs`](super::pairs) has uR and nothing. The frame's own errors are below 2⁻³⁷ of both.
//!
//! With k = 1, a sheared coordinate is off by less than 14.4 uR and an edge value by less than
//! 4 · 14.4 uRm + 8.5 uRm and a square: less than e (m + e) with e = 128 uR. A difference of depths
//! is off by 10 uR, X by 5EΔ / |a| + (55 + 17) uR, and the other terms together by 36 uR: less than
//! e, too. So the bounds of f32 hold with 2kR for R. A half of the largest extent is never more than
//! R, and so k is at most S over that half.

use super::answer::{ANY_HIT, Find, NEAREST_HIT};
use super::box_ray::{BoxRay, FarBoxRay};
use super::double_block::{Distances, DoubleBlock, rounded_distance};
use super::instructions::{Instructions, Pending, Task};
use super::kernel::{SPARE, STACK, deep_stacks};
use super::lanes::{Aligned, Lanes};
use super::layout::{WideBvh, WideNode};
use super::one_ray::{LeafRay, Leaves, visit};
use super::triangles::TriangleBlock;
use super::{build, portable, vector};
use crate::clip::{BUILDERS, VALIDATION, clip_corners};
use crate::double::{NearestHit, Query};
use crate::slabs::FarRay;
use crate::{
    Aabb, Bvh, Clip, Coherence, DHit, DRay, DTriangle, Frame, Hit, InvalidBvh, Kernel, Ray, Select,
    Slabs, Triangle, validate_references,
};
use core::mem::MaybeUninit;
use glam::{DMat3, DVec3};
use std::borrow::Cow;

/// An immutable copy of a tree and its triangles in f64, for tracing only.
///
/// Gives the answers of testing every triangle by [`DTriangle::intersect`], bit by bit, on every
/// machine and with every [`Kernel`]. Boxes are those of a [`WideBvh`].
#[derive(Clone, Debug)]
pub struct DWideBvh {
    /// The triangles in f32, in the frame.
    wide: WideBvh,
    frame: Frame,
    /// For every block in f32 the same triangles.
    blocks: Vec<DoubleBlock>,
}

/// Triangles in f64 with their parts in a frame.
#[derive(Debug)]
struct DoublesInFrame<'a>(&'a [DTriangle], &'a Frame);

impl DoublesInFrame<'_> {
    fn clip(&self, object: u32, region: &Aabb, slack: f64) -> Aabb {
        let DTriangle(corners) = self.0[object as usize];
        let in_frame = || corners.map(|corner| self.1.point(corner));
        clip_corners(in_frame, self.1.aabb_of(corners), region, slack)
    }
}

impl Clip for DoublesInFrame<'_> {
    fn clip(&self, object: u32, region: &Aabb) -> Aabb {
        self.clip(object, region, BUILDERS)
    }

    fn clip_tightly(&self, object: u32, region: &Aabb) -> Aabb {
        self.clip(object, region, VALIDATION)
    }
}

/// A ray as the layout is traversed with it.
struct Boxed {
    ray: Ray,
    ends: [DVec3; 2],
    /// The factor from distances of the ray to those of its form in f32.
    scale: f64,
}

impl DWideBvh {
    /// Lays out `tree`, valid over the [boxes](Self::boxes) of `triangles`, as [`WideBvh::new`]
    /// does. Its frame should have its centre in the middle of the scene. O(n) time and memory.
    pub fn new(tree: &Bvh, triangles: &[DTriangle]) -> Result<Self, InvalidBvh> {
        let frame = tree.frame.unwrap_or(Frame::FILE);
        let boxes = Self::boxes(triangles, &frame);
        validate_references(tree, &boxes, &DoublesInFrame(triangles, &frame))?;
        drop(boxes);
        let in_frame = |corner: DVec3| frame.point(corner).as_vec3();
        let rounded: Vec<Triangle> =
            triangles.iter().map(|triangle| Triangle(triangle.0.map(in_frame))).collect();
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
        let blocks = wide.blocks.iter().map(|block| DoubleBlock::new(block, triangles)).collect();
        Ok(Self { wide, frame, blocks })
    }

    /// Returns the boxes of triangles in a frame, to build a tree over.
    pub fn boxes(triangles: &[DTriangle], frame: &Frame) -> Vec<Aabb> {
        triangles.iter().map(|triangle| frame.aabb_of(triangle.0)).collect()
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
    pub fn nearest_hit(&self, ray: &DRay, select: Select) -> Option<DHit> {
        let mut nearest = NearestHit::new(ray);
        self.search::<NEAREST_HIT>(Query { ray, select }, &mut nearest);
        nearest.hit()
    }

    /// Returns whether `ray` meets any triangle that counts in its range.
    pub fn any_hit(&self, ray: &DRay, select: Select) -> bool {
        self.search::<ANY_HIT>(Query { ray, select }, &mut NearestHit::new(ray))
    }

    /// Writes the [nearest hit](Self::nearest_hit) of every ray. `select` excludes the same number of
    /// ids for each ray, ray after ray.
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many, or the number of excluded ids is no multiple.
    pub fn nearest_hits(&self, rays: &[DRay], select: Select, hits: &mut [Option<DHit>]) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        let mut nearest = Vec::new();
        self.in_parts(rays, select, hits, |rays, boxed, select, hits| {
            nearest.clear();
            nearest.extend(rays.iter().map(NearestHit::new));
            let part = Part { layout: self, rays, select };
            let find = Nearest { part, nearest: &mut nearest };
            self.wide.trace(boxed, find, Coherence::Incoherent);
            self.resolve(rays, &mut nearest);
            for (hit, nearest) in hits.iter_mut().zip(&nearest) {
                *hit = nearest.hit();
            }
        });
    }

    /// Writes whether every ray meets [any triangle](Self::any_hit), as
    /// [`nearest_hits`](Self::nearest_hits) does.
    ///
    /// # Panics
    /// As [`nearest_hits`](Self::nearest_hits).
    pub fn any_hits(&self, rays: &[DRay], select: Select, hits: &mut [bool]) {
        assert_eq!(rays.len(), hits.len(), "an answer for every ray");
        self.in_parts(rays, select, hits, |rays, boxed, select, hits| {
            let part = Part { layout: self, rays, select };
            if select.counts_all() {
                self.wide.trace(boxed, Any::<true> { part, hits }, Coherence::Incoherent);
            } else {
                self.wide.trace(boxed, Any::<false> { part, hits }, Coherence::Incoherent);
            }
        });
    }

    fn triangle_at(&self, place: u32) -> DTriangle {
        let (block, lane) =
            (place as usize / TriangleBlock::LANES, place as usize % TriangleBlock::LANES);
        self.blocks[block].triangle(lane)
    }

    /// Finds the distances that are not known yet.
    fn resolve(&self, rays: &[DRay], nearest: &mut [NearestHit]) {
        if self.wide.kernel != Kernel::Portable {
            let task = Resolve { layout: self, rays, nearest };
            // SAFETY: a layout's kernel is available.
            return unsafe { vector::dispatch(self.wide.kernel, task) };
        }
        for (ray, nearest) in rays.iter().zip(nearest) {
            self.resolve_alone(ray, nearest);
        }
    }

    fn resolve_alone(&self, ray: &DRay, nearest: &mut NearestHit) {
        if !nearest.is_known() {
            let query = Query { ray, select: Select::default() };
            query.resolve(nearest, &self.triangle_at(nearest.place));
        }
    }

    /// Passes some rays at a time with their forms in f32, with what they exclude and their answers.
    fn in_parts<T>(
        &self,
        rays: &[DRay],
        select: Select,
        answers: &mut [T],
        mut trace: impl FnMut(&[DRay], &[Ray], Select, &mut [T]),
    ) {
        /// What is kept of these rays fits in the cache.
        const AT_ONCE: usize = 512;
        if rays.is_empty() {
            return;
        }
        let excluded = select.exclude.len() / rays.len();
        assert_eq!(select.exclude.len(), excluded * rays.len(), "ids to exclude for every ray");
        let mut boxed = Vec::new();
        for (part, answers) in answers.chunks_mut(AT_ONCE).enumerate() {
            let first = part * AT_ONCE;
            let rays = &rays[first..first + answers.len()];
            boxed.clear();
            boxed.extend(rays.iter().map(|ray| self.boxed(ray).ray));
            let exclude = &select.exclude[excluded * first..excluded * (first + rays.len())];
            trace(rays, &boxed, Select { exclude, ..select }, answers);
        }
    }

    /// Returns the ray in the frame. Its direction has a largest component of about 1, so that f32
    /// has all distances within the scene.
    #[inline(always)]
    fn boxed(&self, ray: &DRay) -> Boxed {
        let scale = scale(ray);
        // The reciprocal of a power of two is exact.
        let ends = [ray.origin, ray.direction * scale.recip()];
        let single = |t: f64| ((t * scale) as f32).min(f32::MAX);
        let ray = self.frame.ray_of(ends, [single(ray.t_min), single(ray.t_max)]);
        Boxed { ray, ends, scale }
    }

    /// Finds the nearest hit that counts, or with `ANY` any. Returns whether there is one.
    fn search<const ANY: bool>(&self, query: Query, nearest: &mut NearestHit) -> bool {
        let boxed = self.boxed(query.ray);
        if self.wide.kernel != Kernel::Portable {
            let task = Search::<ANY> { layout: self, boxed, query, nearest };
            // SAFETY: a layout's kernel is available.
            return unsafe { vector::dispatch(self.wide.kernel, task) };
        }
        let slabs = Slabs::of_frame(&boxed.ray, boxed.ends, &self.frame, &self.wide.bounds);
        let intervals = |node: &WideNode| portable::intervals(&slabs, node);
        let visit = |block: &TriangleBlock, limit: &mut Hit| {
            let mut is_nearer = false;
            let first = self.first_place(block);
            for lane in (0..TriangleBlock::LANES).filter(|&lane| block.triangle(lane).is_some()) {
                let place = first + lane as u32;
                is_nearer |= self.offer(query, nearest, block.id(lane), place);
            }
            if is_nearer {
                *limit = Hit { t: (nearest.high * boxed.scale) as f32, object: 0 };
            }
            is_nearer
        };
        let t_max = boxed.ray.t_max();
        let hit = portable::traverse::<ANY>(&self.wide, t_max, intervals, &mut (), visit);
        self.resolve_alone(query.ray, nearest);
        !hit.is_miss()
    }

    /// The place of a block's first triangle.
    #[inline(always)]
    fn first_place(&self, block: &TriangleBlock) -> u32 {
        let bytes = core::ptr::from_ref(block).addr() - self.wide.blocks.as_ptr().addr();
        (bytes / size_of::<TriangleBlock>() * TriangleBlock::LANES) as u32
    }

    /// Takes a triangle, decided by itself.
    fn offer(&self, query: Query, nearest: &mut NearestHit, object: u32, place: u32) -> bool {
        let Some((low, high)) = query.bounds(&self.triangle_at(place)) else { return false };
        let new = NearestHit { low, high, object, place };
        query.take(nearest, new, |place| self.triangle_at(place))
    }

    /// Takes those of the `possible` triangles of a block that are nearer. Returns whether there are
    /// any.
    ///
    /// # Safety
    /// The processor has the instructions of `K`; the block is one of the layout.
    #[inline(always)]
    unsafe fn offer_block<K: Instructions>(
        &self,
        query: Query,
        nearest: &mut NearestHit,
        block: &TriangleBlock,
        possible: u32,
    ) -> bool {
        let first = self.first_place(block);
        // SAFETY: there is such a block in f64 for every one in f32.
        let decided = unsafe {
            let doubles = self.blocks.get_unchecked(first as usize / TriangleBlock::LANES);
            doubles.decide::<K::Block>(query.ray, possible)
        };
        let mut is_nearer = false;
        let mut lanes = decided.hits;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 3;
            lanes &= lanes - 1;
            let (low, high) = (decided.low[lane], decided.high[lane]);
            let new = NearestHit { low, high, object: block.id(lane), place: first + lane as u32 };
            is_nearer |= query.take(nearest, new, |place| self.triangle_at(place));
        }
        let mut lanes = decided.unsure;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 3;
            lanes &= lanes - 1;
            is_nearer |= self.offer(query, nearest, block.id(lane), first + lane as u32);
        }
        is_nearer
    }
}

/// Returns the power of two in the largest component of a ray's direction.
#[inline(always)]
fn scale(ray: &DRay) -> f64 {
    f64::from_bits(ray.direction.abs().max_element().to_bits() >> 52 << 52)
}

/// Returns what counts for one of several rays.
#[inline(always)]
fn select_of<'a>(select: Select<'a>, rays: usize, number: usize) -> Select<'a> {
    if select.exclude.is_empty() {
        return select;
    }
    let excluded = select.exclude.len() / rays;
    Select { exclude: &select.exclude[excluded * number..][..excluded], ..select }
}

/// A search by a vector kernel.
struct Search<'a, const ANY: bool> {
    layout: &'a DWideBvh,
    boxed: Boxed,
    query: Query<'a>,
    nearest: &'a mut NearestHit,
}

impl<K: Instructions, const ANY: bool> Task<K> for Search<'_, ANY> {
    type Output = bool;

    #[inline(always)]
    unsafe fn run(self) -> bool {
        let Self { layout, boxed, query, nearest } = self;
        let wide = &layout.wide;
        let mut stack = MaybeUninit::<Aligned<[Pending; STACK + SPARE]>>::uninit();
        let mut deep = deep_stacks::<Pending>(1, wide.stack_need);
        let base = deep.as_mut().map_or(stack.as_mut_ptr().cast(), |deep| deep.as_mut_ptr().cast());
        let ray = &boxed.ray;
        // SAFETY: the processor has the instructions; the stack has room for `stack_need` children
        // and one register more.
        unsafe {
            let leaf_ray = LeafRay::<K::Block>::new(ray, wide);
            let mut leaves =
                Candidates::<_, ANY> { layout, leaf_ray, scale: boxed.scale, query, nearest };
            let hit = if ray.begins_in(&wide.near) {
                visit::<K, ANY>(wide, ray.t_max(), &BoxRay::new(ray), &mut leaves, base)
            } else {
                let far = FarRay::in_frame(boxed.ends, &layout.frame, &wide.bounds);
                visit::<K, ANY>(wide, ray.t_max(), &FarBoxRay::new(ray, &far), &mut leaves, base)
            };
            if !ANY && !nearest.is_known() {
                let triangle = layout.triangle_at(nearest.place);
                let slack = nearest.high - nearest.low;
                match rounded_distance::<K::Block>(query.ray, &triangle, slack) {
                    Some(t) => (nearest.low, nearest.high) = (t, t),
                    None => layout.resolve_alone(query.ray, nearest),
                }
            }
            !hit.is_miss()
        }
    }
}

/// Passes the triangles of a block on that the ray may meet.
struct Candidates<'a, 'n, L, const ANY: bool> {
    layout: &'a DWideBvh,
    leaf_ray: LeafRay<L>,
    scale: f64,
    query: Query<'a>,
    nearest: &'n mut NearestHit,
}

impl<K: Instructions, const ANY: bool> Leaves<K> for Candidates<'_, '_, K::Block, ANY> {
    #[inline(always)]
    unsafe fn visit(&mut self, block: &TriangleBlock, nearest: &mut Hit) -> bool {
        // SAFETY: the processor has the instructions.
        unsafe {
            let corners = self.leaf_ray.corners(block);
            let candidates = self.leaf_ray.pairs.candidates(&corners);
            let (possible, sure) =
                self.leaf_ray.pairs.within(&candidates, K::Block::splat(nearest.t));
            if possible == 0 {
                return false;
            }
            let used = block.used::<K::Block>();
            if ANY && sure & used != 0 && self.query.select.counts_all() {
                nearest.object = block.id(sure.trailing_zeros() as usize & 3);
                return true;
            }
            let is_nearer =
                self.layout.offer_block::<K>(self.query, self.nearest, block, possible & used);
            if is_nearer {
                let t = (self.nearest.high * self.scale) as f32;
                *nearest = Hit { t, object: self.nearest.object };
            }
            is_nearer
        }
    }
}

/// The search for distances that are not known yet.
struct Resolve<'a> {
    layout: &'a DWideBvh,
    rays: &'a [DRay],
    nearest: &'a mut [NearestHit],
}

impl<K: Instructions> Task<K> for Resolve<'_> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { layout, rays, nearest } = self;
        let mut distances = Distances::EMPTY;
        let mut numbers = [0; Distances::COUNT];
        let mut count = 0;
        for number in 0..nearest.len() {
            let hit = nearest[number];
            if !hit.is_known() {
                let triangle = layout.triangle_at(hit.place);
                distances.set(count, &rays[number], &triangle, hit.high - hit.low);
                numbers[count] = number;
                count += 1;
            }
            if count < K::Rays::N && (number + 1 < nearest.len() || count == 0) {
                continue;
            }
            // SAFETY: the processor has the instructions.
            let (rounded, is_decided) = unsafe { distances.rounded::<K::Rays>() };
            for (lane, &number) in numbers[..count].iter().enumerate() {
                if is_decided >> lane & 1 != 0 {
                    let hit = &mut nearest[number];
                    (hit.low, hit.high) = (rounded[lane], rounded[lane]);
                } else {
                    layout.resolve_alone(&rays[number], &mut nearest[number]);
                }
            }
            count = 0;
        }
    }
}

/// Some rays of a batch, with what counts for each.
#[derive(Clone, Copy)]
struct Part<'a> {
    layout: &'a DWideBvh,
    rays: &'a [DRay],
    select: Select<'a>,
}

impl<'a> Part<'a> {
    #[inline(always)]
    fn query(&self, number: usize) -> Query<'a> {
        let select = select_of(self.select, self.rays.len(), number);
        Query { ray: &self.rays[number], select }
    }
}

/// The nearest hit of every ray.
struct Nearest<'a> {
    part: Part<'a>,
    nearest: &'a mut [NearestHit],
}

impl Find for Nearest<'_> {
    const DECIDES: bool = true;

    #[inline(always)]
    unsafe fn decide<K: Instructions>(
        &mut self,
        number: usize,
        block: &TriangleBlock,
        possible: u32,
    ) -> Option<Hit> {
        let query = self.part.query(number);
        let nearest = &mut self.nearest[number];
        // SAFETY: the processor has the instructions; the block is one of the layout.
        let is_nearer =
            unsafe { self.part.layout.offer_block::<K>(query, nearest, block, possible) };
        let t = (nearest.high * scale(query.ray)) as f32;
        is_nearer.then_some(Hit { t, object: nearest.object })
    }

    fn alone(&mut self, _: &WideBvh, number: usize, _: &Ray) {
        let query = self.part.query(number);
        self.part.layout.search::<NEAREST_HIT>(query, &mut self.nearest[number]);
    }
}

/// Whether each ray hits anything. All triangles count if `PLAIN`.
struct Any<'a, const PLAIN: bool> {
    part: Part<'a>,
    hits: &'a mut [bool],
}

impl<const PLAIN: bool> Find for Any<'_, PLAIN> {
    const ANY: bool = true;
    const DECIDES: bool = true;
    const TAKES_CERTAIN: bool = PLAIN;

    #[inline(always)]
    unsafe fn decide<K: Instructions>(
        &mut self,
        number: usize,
        block: &TriangleBlock,
        possible: u32,
    ) -> Option<Hit> {
        let query = self.part.query(number);
        let mut nearest = NearestHit::new(query.ray);
        // SAFETY: the processor has the instructions; the block is one of the layout.
        let is_hit =
            unsafe { self.part.layout.offer_block::<K>(query, &mut nearest, block, possible) };
        is_hit.then_some(Hit { t: 0.0, object: nearest.object })
    }

    #[inline(always)]
    fn write(&mut self, number: usize, _: f32, object: u32) {
        self.hits[number] = object != u32::MAX;
    }

    fn alone(&mut self, _: &WideBvh, number: usize, _: &Ray) {
        let query = self.part.query(number);
        let mut nearest = NearestHit::new(query.ray);
        self.hits[number] = self.part.layout.search::<ANY_HIT>(query, &mut nearest);
    }
}
