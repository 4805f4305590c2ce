//! All hits of a ray, each crossing of a surface once.
//!
//! # Rule
//!
//! The hits are the crossings of [`Triangle::crossing`](crate::Triangle::crossing), in real
//! arithmetic. A ray through an edge or a corner meets several closed triangles there; the rule
//! counts it as if its origin were moved by (ε, ε², ε³) with an infinitely small ε > 0 (a *symbolic
//! perturbation*). With `o` the origin, `d` the direction and `P`, `Q` the ends of an edge relative
//! to `o`, the side of the edge on which the moved line is follows from the sign of
//!
//! ```text
//!   d · ((P − e) × (Q − e)) = d · (P × Q) + e · (d × (Q − P)),      e = (ε, ε², ε³)
//! ```
//!
//! which is the first nonzero number among `d · (P × Q)` and the components of `d × (Q − P)`. The
//! ray crosses the triangle if the signs of its three edges are equal and not zero.
//!
//! # Proof that the parity is right
//!
//! There is an ε₀ > 0 such that, for every ε below it, all signs of a finite mesh are the signs of
//! the moved line. Such a line meets no corner and no edge: it is on one side of every edge or, if
//! `d × (Q − P) = 0`, parallel to it and to its triangles. Therefore it crosses the *interior* of
//! exactly the triangles that the rule accepts. A line that meets no edge crosses a closed mesh,
//! where an even number of triangles shares every edge, an even number of times. A half line
//! crosses the mesh an odd number of times if and only if it begins inside, and so does the ray: if
//! the origin is not on the surface, every distance has the sign of the moved line's distance. A
//! triangle without area is never crossed and changes no parity, so T-junctions that such triangles
//! close are closed.
//!
//! Neighbours compute the same sign for a common edge, negated if their corners run in the same
//! direction of rotation: swapping `P` and `Q` negates all four numbers.
//!
//! # Sources
//!
//! Edelsbrunner & Mücke 1990, 'Simulation of simplicity'. Differs from the paper: only the ray's
//! origin is perturbed, so three terms suffice. [`exact`](crate::exact) has the filter in f64 and
//! its bounds; no rounding decides an answer.

use super::answer::ANY_HIT;
use super::flight::{RAYS, Traversal};
use super::instructions::{Instructions, Task};
use super::kernel::DeepStacks;
use super::lanes::{Lanes, Mask};
use super::layout::{Child, WideBvh, WideNode};
use super::one_ray::{LeafRay, Leaves, traverse};
use super::pairs::Plane;
use super::prepared::{Prepared, Ready, Test};
use super::ray_lanes::RayLanes;
use super::triangles::TriangleBlock;
use super::{portable, vector};
use crate::exact::Line;
use crate::{Hit, Kernel, Ray, Triangle};
use alloc::vec::Vec;
use core::mem::MaybeUninit;

impl WideBvh {
    /// Returns the hits of the ray in its range, each crossing of a surface once, the nearest
    /// first; among hits at the same distance the lowest id first.
    ///
    /// Through an edge or a corner, the ray hits only the triangles that it would hit if its origin
    /// were moved by (ε, ε², ε³) with an infinitely small ε > 0. The number of hits of a line with
    /// a closed mesh is therefore even, and a half line that begins inside has an odd number. All
    /// kernels give the hits of [`Triangle::crossing`](crate::Triangle::crossing), bit by bit.
    ///
    /// The distances are those of [`nearest_hit`](Self::nearest_hit).
    ///
    /// ```
    /// # use bvh_core::{Aabb, Bvh, Hit, Node, Ray, Triangle, WideBvh};
    /// // A square of two triangles, and a ray through its diagonal.
    /// let [a, b, c, d] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    /// let square = [[a, b, c], [a, c, d]].map(Triangle::from);
    /// let leaf = Node::leaf(Aabb::from([a, c]), 0, 2);
    /// let wide = WideBvh::new(&Bvh { nodes: vec![leaf], prim_ids: vec![0, 1] }, &square)?;
    /// let ray = Ray::half_line([0.5, 0.5, 3.0], [0.0, 0.0, -1.0]).unwrap();
    /// assert_eq!(wide.all_hits(&ray), [Hit { t: 3.0, object: 0 }]);
    /// # Ok::<(), bvh_core::InvalidBvh>(())
    /// ```
    pub fn all_hits(&self, ray: &Ray) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.append_hits(ray, &mut hits);
        let count = sort_hits(&mut hits);
        hits.truncate(count);
        hits
    }

    /// Appends [all hits](Self::all_hits) of every ray to `hits`, ray after ray, and writes the
    /// number of hits of each ray.
    ///
    /// # Panics
    /// Panics if `rays` and `counts` are not equally many.
    pub fn all_hits_of(&self, rays: &[Ray], hits: &mut Vec<Hit>, counts: &mut [u32]) {
        assert_eq!(rays.len(), counts.len(), "a count for every ray");
        let mut found = Vec::new();
        let parts = rays.chunks(MOST);
        for (rays, counts) in parts.zip(counts.chunks_mut(MOST)) {
            self.append_hits_of(rays, hits, counts, &mut found);
        }
    }

    /// Writes the number of [all hits](Self::all_hits) of every ray.
    ///
    /// # Panics
    /// Panics if `rays` and `counts` are not equally many.
    pub fn count_hits(&self, rays: &[Ray], counts: &mut [u32]) {
        /// The number of rays whose hits are kept at a time.
        const AT_ONCE: usize = 16 * MOST;
        assert_eq!(rays.len(), counts.len(), "a count for every ray");
        let mut hits = Vec::new();
        for (rays, counts) in rays.chunks(AT_ONCE).zip(counts.chunks_mut(AT_ONCE)) {
            hits.clear();
            self.all_hits_of(rays, &mut hits, counts);
        }
    }

    /// Appends the hits of every ray, sorted, and writes their numbers. `found` is room for work.
    fn append_hits_of(
        &self,
        rays: &[Ray],
        hits: &mut Vec<Hit>,
        counts: &mut [u32],
        found: &mut Vec<Found>,
    ) {
        /// The number of rays below which rays in flight are not worth their preparation.
        const FEW: usize = 8;
        found.clear();
        if self.kernel == Kernel::Portable || rays.len() < FEW {
            for (ray, count) in rays.iter().zip(counts) {
                let first = hits.len();
                self.append_hits(ray, hits);
                *count = sort_hits(&mut hits[first..]) as u32;
                hits.truncate(first + *count as usize);
            }
            return;
        }
        let first = hits.len();
        // SAFETY: a layout's kernel is available.
        unsafe { vector::dispatch::<_, ()>(self.kernel, ManyRays { wide: self, rays, found }) };
        counts.fill(0);
        for found in found.iter() {
            counts[found.number as usize] += 1;
        }
        // Sorted by counting: the hits of ray after ray, in any order.
        let mut next = [0; MOST];
        let mut end = first;
        for (next, &count) in next.iter_mut().zip(counts.iter()) {
            *next = end;
            end += count as usize;
        }
        hits.resize(end, Hit::MISS);
        for found in found.iter() {
            let next = &mut next[found.number as usize];
            hits[*next] = found.hit;
            *next += 1;
        }
        let mut start = first;
        let mut kept = first;
        for count in counts {
            let end = start + *count as usize;
            let different = sort_hits(&mut hits[start..end]);
            if kept < start {
                hits.copy_within(start..start + different, kept);
            }
            *count = different as u32;
            kept += different;
            start = end;
        }
        hits.truncate(kept);
    }

    /// Appends the hits of a ray, in no order; the hits of a divided triangle once for each of its
    /// leaves.
    fn append_hits(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        if self.kernel != Kernel::Portable {
            // SAFETY: a layout's kernel is available.
            return unsafe { vector::dispatch(self.kernel, OneRay { wide: self, ray, hits }) };
        }
        let line = Line::new(ray);
        portable::traverse::<ANY_HIT>(self, ray, &mut (), |block, _| {
            for (object, triangle) in block.triangles() {
                hits.extend(hit_of(ray, &line, object, &triangle));
            }
            false
        });
    }
}

/// Returns the hit of a ray with a triangle, if it is in the ray's range.
#[inline(always)]
fn hit_of(ray: &Ray, line: &Line, object: u32, triangle: &Triangle) -> Option<Hit> {
    let t = line.crossing(ray, &triangle.0)?;
    (ray.t_min() <= t && t <= ray.t_max()).then_some(Hit { t, object })
}

/// Sorts the hits of one ray and moves each to the front once: a divided triangle is in several
/// leaves, every time at the same distance. Returns the number of different hits.
#[inline]
fn sort_hits(hits: &mut [Hit]) -> usize {
    if hits.len() < 2 {
        return hits.len();
    }
    // No distance is negative or −0, so distances are ordered as their bits are.
    hits.sort_unstable_by_key(|hit| u64::from(hit.t.to_bits()) << 32 | u64::from(hit.object));
    let mut kept = 1;
    for i in 1..hits.len() {
        if hits[i] != hits[kept - 1] {
            hits[kept] = hits[i];
            kept += 1;
        }
    }
    kept
}

/// The largest number of rays that are traced together. What is kept of each fits in the cache.
const MOST: usize = 256;

/// The number of rays in flight.
const FLIGHT: usize = 32;

/// The number of pairs that are tested together, at most.
const PAIRS: usize = 1024;

/// A hit of the ray of this number.
#[derive(Clone, Copy)]
pub(crate) struct Found {
    pub(super) number: u32,
    pub(super) hit: Hit,
}

/// A block of triangles, as the bits of a [`Child`], and above them the number of a ray that
/// entered it.
type Pair = u64;

/// The search for all hits of one ray.
struct OneRay<'a> {
    wide: &'a WideBvh,
    ray: &'a Ray,
    hits: &'a mut Vec<Hit>,
}

impl<K: Instructions> Task<K> for OneRay<'_> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { wide, ray, hits } = self;
        // SAFETY: the processor has the instructions of `K`.
        unsafe {
            let leaf_ray = LeafRay::<K::Block>::new(ray, &wide.bounds);
            traverse::<K, ANY_HIT>(wide, ray, &mut AllHits { ray, leaf_ray, hits });
        }
    }
}

/// Collects all hits of a ray.
struct AllHits<'a, L> {
    ray: &'a Ray,
    leaf_ray: LeafRay<L>,
    hits: &'a mut Vec<Hit>,
}

impl<L: Lanes> Leaves<L> for AllHits<'_, L> {
    #[inline(always)]
    unsafe fn visit(&mut self, block: &TriangleBlock, nearest: &mut Hit) -> bool {
        // SAFETY: the processor has the instructions.
        let (rays, corners) = unsafe { (&self.leaf_ray.pairs, self.leaf_ray.corners(block)) };
        let candidates = rays.candidates(&corners);
        if candidates.possible != 0 {
            let t_max = corners[0][0].filled(nearest.t);
            let plane = Plane::of_lanes(&corners);
            let decided = rays.decide_in_f64(&corners, &plane, &candidates, t_max);
            Decided::new(decided).hits_of(0, block, self.ray, |hit| self.hits.push(hit));
        }
        false
    }
}

/// The answers of a test in f64.
struct Decided {
    hits: u32,
    unsure: u32,
    distances: [f32; 16],
}

impl Decided {
    #[inline(always)]
    fn new<L: Lanes>((hits, unsure, t): (L::Mask, u32, L)) -> Self {
        let mut distances = [0.0; 16];
        // SAFETY: there is room for sixteen lanes.
        unsafe { t.store(distances.as_mut_ptr()) };
        Self { hits: hits.bits(), unsure, distances }
    }

    /// Calls `append` with the hits of a ray in a block, whose tests are in this quarter of the
    /// lanes.
    #[inline(always)]
    fn hits_of(
        &self,
        quarter: usize,
        block: &TriangleBlock,
        ray: &Ray,
        mut append: impl FnMut(Hit),
    ) {
        let first = 4 * quarter;
        let mut hits = self.hits >> first & 0b1111;
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize & 3;
            hits &= hits - 1;
            let hit = Hit { t: self.distances[(first + lane) & 15], object: block.id(lane) };
            // An unused lane repeats a triangle.
            if !hit.is_miss() {
                append(hit);
            }
        }
        let mut unsure = self.unsure >> first & 0b1111;
        while unsure != 0 {
            let lane = unsure.trailing_zeros() as usize & 3;
            unsure &= unsure - 1;
            if let Some((object, triangle)) = block.triangle(lane)
                && let Some(hit) = hit_of(ray, &Line::new(ray), object, &triangle)
            {
                append(hit);
            }
        }
    }
}

/// The search for all hits of at most [`MOST`] rays, with many rays in flight. Appends the hits to
/// `found`, in no order; the hits of a divided triangle once for each of its leaves.
///
/// A search for all hits cuts nothing off, so the order of visits does not matter. A visit of a
/// node puts the inner children that the ray enters on the ray's stack, and the leaves on a list of
/// pairs that all rays share:
///
/// ```text
///   at a node: boxes ─┬─> inner children: the ray's stack ─> the ray's next node
///                     └─> leaves: pairs of a ray and a block ─> candidates ─> decisions ─> hits
/// ```
///
/// Steps of different rays and of different pairs do not depend on each other, and no step has a
/// branch that is hard to predict.
struct ManyRays<'a> {
    wide: &'a WideBvh,
    rays: &'a [Ray],
    found: &'a mut Vec<Found>,
}

impl<K: Instructions> Task<K> for ManyRays<'_> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { wide, rays, found } = self;
        assert!(rays.len() <= MOST);
        let Some(root) = wide.root else { return };
        let mut prepared = [const { MaybeUninit::<Prepared>::uninit() }; MOST + RAYS];
        let mut waiting = [0; MOST];
        let mut count = 0;
        // SAFETY: the processor has the instructions of `K`; there is room for the last lanes.
        unsafe {
            for first in (0..rays.len()).step_by(K::Rays::N) {
                let lanes = RayLanes::<K::Rays>::load_up_to(rays, first, rays.len());
                let ready = Ready::new(lanes, wide);
                ready.write(first as u32, prepared[first].as_mut_ptr());
                let entered = ready.enter(&wide.bounds);
                let last = rays.len().min(first + K::Rays::N);
                for (lane, number) in (first..last).enumerate() {
                    waiting[count] = number as u32;
                    count += (entered >> lane & 1) as usize;
                }
            }
            let mut pairs =
                Pairs { wide, rays, prepared: &prepared, pairs: [0; PAIRS], count: 0, found };
            if root.is_node() {
                visit_nodes::<K>(&mut pairs, &waiting[..count]);
            } else {
                for &number in &waiting[..count] {
                    pairs.append_leaf::<K>(root, number);
                }
            }
            pairs.test::<K>();
        }
    }
}

/// Visits all nodes that the rays of these numbers enter, and puts their leaves on the list.
///
/// # Safety
/// The processor has the instructions of `K`, and the caller is compiled with them; the rays are
/// prepared, and the root is a node.
#[inline(always)]
unsafe fn visit_nodes<K: Instructions>(pairs: &mut Pairs, waiting: &[u32]) {
    let wide = pairs.wide;
    let mut traversals = MaybeUninit::<[Traversal; FLIGHT]>::uninit();
    let traversals = traversals.as_mut_ptr().cast::<Traversal>();
    let mut deep = DeepStacks::new(FLIGHT, wide.stack_need);
    let mut active = [core::ptr::null_mut(); FLIGHT];
    let mut count = FLIGHT.min(waiting.len());
    let (first, mut waiting) = waiting.split_at(count);
    // SAFETY: the references of the layout are sound, and its stacks large enough; nothing is
    // popped after `END`.
    unsafe {
        for (i, &number) in first.iter().enumerate() {
            active[i] = traversals.add(i);
            Traversal::set_stack(active[i], deep.as_mut().map(|deep| deep.stack(i)));
            (*active[i]).start::<K>(pairs.ray(number), wide);
        }
        while count > 0 {
            let visits = count;
            let mut ended = [core::ptr::null_mut(); FLIGHT];
            let mut ends = 0;
            count = 0;
            for i in 0..visits {
                let traversal = &mut *active[i];
                let node = traversal.node(wide);
                let (_, entered) = traversal.ray.boxes::<K>(node, traversal.ray.t_max);
                let leaves = K::Boxes::load(node.children.as_ptr().cast()).signs();
                pairs.append_leaves::<K>(node, entered & leaves, traversal.ray.number);
                traversal.enter_any::<K>(node, entered & !leaves);
                traversal.fetch::<K>(wide);
                let is_at_end = traversal.child == Child::END;
                active[count] = traversal;
                count += usize::from(!is_at_end);
                ended[ends] = traversal;
                ends += usize::from(is_at_end);
            }
            for &traversal in &ended[..ends] {
                let Some((&number, rest)) = waiting.split_first() else { break };
                waiting = rest;
                (*traversal).start::<K>(pairs.ray(number), wide);
                active[count] = traversal;
                count += 1;
            }
            if pairs.count > PAIRS - WideNode::LANES * (FLIGHT + 1) {
                pairs.test::<K>();
            }
        }
    }
}

/// The pairs of a ray and a block of triangles that wait for their test.
struct Pairs<'a> {
    wide: &'a WideBvh,
    rays: &'a [Ray],
    /// Written for all rays.
    prepared: &'a [MaybeUninit<Prepared>],
    pairs: [Pair; PAIRS],
    count: usize,
    found: &'a mut Vec<Found>,
}

impl<'a> Pairs<'a> {
    #[inline(always)]
    unsafe fn ray(&self, number: u32) -> &'a Prepared {
        // SAFETY: the rays are prepared.
        unsafe { self.prepared[number as usize].assume_init_ref() }
    }

    #[inline(always)]
    unsafe fn append_leaf<K: Instructions>(&mut self, leaf: Child, number: u32) {
        self.pairs[self.count] = u64::from(leaf.bits()) | u64::from(number) << 32;
        self.count += 1;
        if self.count == PAIRS {
            // SAFETY: the processor has the instructions of `K`.
            unsafe { self.test::<K>() };
        }
    }

    /// Appends the leaves among the children of a node, without a branch.
    ///
    /// # Safety
    /// There is room for eight more than are appended.
    #[inline(always)]
    unsafe fn append_leaves<K: Instructions>(&mut self, node: &WideNode, leaves: u32, number: u32) {
        // SAFETY: there is room for eight more pairs.
        unsafe {
            let to = self.pairs.as_mut_ptr().add(self.count);
            K::compress(node, leaves, to);
            // All eight, whose number the compiler knows.
            for i in 0..WideNode::LANES {
                *to.add(i) |= u64::from(number) << 32;
            }
        }
        self.count += leaves.count_ones() as usize;
    }

    /// Tests all pairs and empties the list.
    #[inline(always)]
    unsafe fn test<K: Instructions>(&mut self) {
        /// The number of pairs between the one that is tested and the one that is fetched from
        /// memory.
        const AHEAD: usize = 8;
        let quarters = K::Rays::N / 4;
        while self.count > 0 {
            let mut hopeful = [0; PAIRS];
            let mut hopes = 0;
            let mut rest = 0;
            for i in (0..self.count).step_by(quarters) {
                let four = self.tests(&self.pairs[..self.count], i);
                // SAFETY: the processor has the instructions; a prefetch may name any address.
                let possible = unsafe {
                    for k in i..i + quarters {
                        let ahead = self.block(self.pairs[(k + AHEAD).min(self.count - 1)]);
                        K::prefetch_bytes(ahead.cast(), size_of::<TriangleBlock>());
                    }
                    Test::rays::<K::Rays>(four).candidates(&Test::corners(four)).possible
                };
                for (k, test) in four.iter().enumerate().take(quarters.min(self.count - i)) {
                    let pair = self.pairs[i + k];
                    hopeful[hopes] = pair;
                    hopes += usize::from(possible >> (4 * k) & 0b1111 != 0);
                    // The next block of the leaf takes the place of a pair that has been tested.
                    self.pairs[rest] = pair + 1;
                    rest += usize::from(!test.block.is_last());
                }
            }
            self.count = rest;
            for i in (0..hopes).step_by(quarters) {
                let four = self.tests(&hopeful[..hopes], i);
                // SAFETY: the processor has the instructions.
                let decided = unsafe {
                    let rays = Test::rays::<K::Rays>(four);
                    let corners = Test::corners(four);
                    let plane = Plane::of_lanes(&corners);
                    rays.decide_in_f64(
                        &corners,
                        &plane,
                        &rays.candidates(&corners),
                        Test::ends(four),
                    )
                };
                let decided = Decided::new(decided);
                for (k, test) in four.iter().enumerate().take(quarters.min(hopes - i)) {
                    let number = test.ray.number;
                    let ray = &self.rays[number as usize];
                    let append = |hit| self.found.push(Found { number, hit });
                    decided.hits_of(k, test.block, ray, append);
                }
            }
        }
    }

    /// The block of a pair.
    #[inline(always)]
    fn block(&self, pair: Pair) -> *const TriangleBlock {
        self.wide.blocks.as_ptr().wrapping_add(Child::from_bits(pair as u32).index())
    }

    /// Returns the tests of four pairs from one on; the last pair fills up.
    #[inline(always)]
    fn tests(&self, pairs: &[Pair], first: usize) -> [Test<'a>; 4] {
        let test = |k: usize| {
            let pair = pairs[(first + k).min(pairs.len() - 1)];
            // SAFETY: pairs name prepared rays and blocks of the layout; after a block that is not
            // the last of its leaf comes another.
            unsafe { Test { ray: self.ray((pair >> 32) as u32), block: &*self.block(pair) } }
        };
        [test(0), test(1), test(2), test(3)]
    }
}
