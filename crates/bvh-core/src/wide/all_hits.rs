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
use super::crossed_leaves::{AllHits, Decision, LineLanes, SlopedLine};
use super::flight::RAYS;
use super::instructions::{Instructions, Pending, Task};
use super::kernel::{DeepStacks, SPARE, STACK};
use super::lanes::Lanes;
use super::layout::{Child, WideBvh, WideNode};
use super::one_ray::traverse;
use super::prepared::{Prepared, Ready};
use super::ray_lanes::RayLanes;
use super::triangles::TriangleBlock;
use super::{portable, vector};
use crate::exact::Line;
use crate::{Hit, Kernel, Ray};
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
        assert_eq!(rays.len(), counts.len(), "a count for every ray");
        let mut hits = Vec::new();
        let mut found = Vec::new();
        let parts = rays.chunks(MOST);
        for (rays, counts) in parts.zip(counts.chunks_mut(MOST)) {
            hits.clear();
            self.append_hits_of(rays, &mut hits, counts, &mut found);
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
        let line = Line::new(ray);
        let sloped = SlopedLine::new(ray, &self.bounds);
        let mut leaves = AllHits { ray, line, sloped, hits };
        if self.kernel != Kernel::Portable {
            let task = OneRay { wide: self, ray, leaves: &mut leaves };
            // SAFETY: a layout's kernel is available.
            unsafe { vector::dispatch::<_, ()>(self.kernel, task) };
        } else {
            portable::traverse::<ANY_HIT>(self, ray, &mut (), |block, _| {
                leaves.test(block, (1 << block.len()) - 1);
                false
            });
        }
    }
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
struct OneRay<'a, 'b> {
    wide: &'a WideBvh,
    ray: &'a Ray,
    leaves: &'a mut AllHits<'b>,
}

impl<K: Instructions> Task<K> for OneRay<'_, '_> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { wide, ray, leaves } = self;
        // SAFETY: the processor has the instructions of `K`.
        unsafe { traverse::<K, ANY_HIT>(wide, ray, leaves) };
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
        let mut lines = [const { MaybeUninit::<SlopedLine>::uninit() }; MOST];
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
                    if entered >> lane & 1 == 1 {
                        lines[number].write(SlopedLine::new(&rays[number], &wide.bounds));
                        waiting[count] = number as u32;
                        count += 1;
                    }
                }
            }
            let mut pairs = Pairs { wide, rays, lines: &lines, pairs: [0; PAIRS], count: 0, found };
            let waiting = &waiting[..count];
            if root.is_node() {
                visit_nodes::<K>(&mut pairs, waiting, prepared.as_ptr().cast(), root);
            } else {
                for &number in waiting {
                    pairs.append_leaf::<K>(root, number);
                }
            }
            pairs.test::<K>();
        }
    }
}

/// The way of one ray through the layout. Without its nearest hit it needs no copy of the ray.
#[repr(C, align(64))]
struct Traversal {
    ray: *const Prepared,
    top: *mut Pending,
    /// The node to visit next.
    child: Child,
    /// [`Child::END`], what waits, and room for stores of whole registers: `frame`, or on the heap.
    stack: *mut Pending,
    frame: [MaybeUninit<Pending>; STACK + SPARE],
}

impl Traversal {
    /// Starts a ray at the root.
    ///
    /// # Safety
    /// The stack has more than one place.
    #[inline(always)]
    unsafe fn start(&mut self, ray: *const Prepared, root: Child) {
        self.ray = ray;
        self.child = root;
        // SAFETY: the stack has more than one place.
        unsafe {
            self.stack.write(u64::from(Child::END.bits()));
            self.top = self.stack.add(1);
        }
    }
}

/// Visits all nodes that the rays of these numbers enter, and puts their leaves on the list.
///
/// # Safety
/// The processor has the instructions of `K`, and the caller is compiled with them; the rays are
/// prepared, and the root is a node.
#[inline(always)]
unsafe fn visit_nodes<K: Instructions>(
    pairs: &mut Pairs,
    waiting: &[u32],
    prepared: *const Prepared,
    root: Child,
) {
    let wide = pairs.wide;
    let mut traversals = MaybeUninit::<[Traversal; FLIGHT]>::uninit();
    let traversals = traversals.as_mut_ptr().cast::<Traversal>();
    let mut deep = DeepStacks::new(FLIGHT, wide.stack_need);
    let mut active = [core::ptr::null_mut(); FLIGHT];
    let mut count = FLIGHT.min(waiting.len());
    let (first, mut waiting) = waiting.split_at(count);
    let nodes = wide.nodes.as_ptr();
    // SAFETY: the references of the layout are sound, and its stacks large enough; nothing is
    // popped after `END`; a prefetch may name any address.
    unsafe {
        for (i, &number) in first.iter().enumerate() {
            active[i] = traversals.add(i);
            let frame = (&raw mut (*active[i]).frame).cast();
            (*active[i]).stack = deep.as_mut().map_or(frame, |deep| deep.stack(i));
            (*active[i]).start(prepared.add(number as usize), root);
        }
        while count > 0 {
            let visits = count;
            let mut ended = [core::ptr::null_mut(); FLIGHT];
            let mut ends = 0;
            count = 0;
            for i in 0..visits {
                let traversal = &mut *active[i];
                let node = &*nodes.add(traversal.child.index());
                let ray = &*traversal.ray;
                let (_, entered) = ray.boxes::<K>(node, ray.t_max);
                let leaves = K::Boxes::load(node.children.as_ptr().cast()).signs();
                K::compress(node, entered & !leaves, traversal.top);
                let inner = (entered & !leaves).count_ones() as usize;
                pairs.append_leaves::<K>(node, entered & leaves, ray.number);
                traversal.top = traversal.top.add(inner).sub(1);
                traversal.child = Child::from_bits(*traversal.top as u32);
                let is_at_end = traversal.child == Child::END;
                let line = nodes.wrapping_add(traversal.child.index()).cast::<u8>();
                for offset in 0..size_of::<WideNode>() / 64 {
                    K::prefetch(line.wrapping_add(64 * offset));
                }
                active[count] = traversal;
                count += usize::from(!is_at_end);
                ended[ends] = traversal;
                ends += usize::from(is_at_end);
            }
            for &traversal in &ended[..ends] {
                let Some((&number, rest)) = waiting.split_first() else { break };
                waiting = rest;
                (*traversal).start(prepared.add(number as usize), root);
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
    /// Written for all rays in flight.
    lines: &'a [MaybeUninit<SlopedLine>; MOST],
    pairs: [Pair; PAIRS],
    count: usize,
    found: &'a mut Vec<Found>,
}

impl Pairs<'_> {
    /// Appends a leaf.
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
    /// As for [`trace`]; there is room for eight more than are appended.
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
    ///
    /// # Safety
    /// As for [`trace`].
    #[inline(always)]
    unsafe fn test<K: Instructions>(&mut self) {
        /// The number of pairs between the one that is tested and the one that is fetched from
        /// memory.
        const AHEAD: usize = 8;
        let blocks = self.wide.blocks.as_ptr();
        let block_of = |pair: Pair| blocks.wrapping_add(Child::from_bits(pair as u32).index());
        // SAFETY: pairs name rays in flight and blocks of the layout; after a block that is not the
        // last of its leaf comes another; a prefetch may name any address.
        unsafe {
            while self.count > 0 {
                let mut hopeful = [0; PAIRS];
                let mut hopes = 0;
                let mut rest = 0;
                for i in 0..self.count {
                    let ahead = block_of(self.pairs[(i + AHEAD).min(self.count - 1)]);
                    for offset in 0..size_of::<TriangleBlock>().div_ceil(64) {
                        K::prefetch(ahead.cast::<u8>().wrapping_add(64 * offset));
                    }
                    let pair = self.pairs[i];
                    let block = &*block_of(pair);
                    let line = self.lines[(pair >> 32) as usize].assume_init_ref();
                    let line = LineLanes::<K::Block>::new(line);
                    hopeful[hopes] = pair;
                    hopes += usize::from(line.candidates(block) != 0);
                    // The next block of the leaf takes the place of a pair that has been tested.
                    self.pairs[rest] = pair + 1;
                    rest += usize::from(!block.is_last());
                }
                self.count = rest;
                for &pair in &hopeful[..hopes] {
                    self.decide::<K>((pair >> 32) as u32, &*block_of(pair));
                }
            }
        }
    }

    /// Appends the hits of a ray in a block.
    #[inline(always)]
    unsafe fn decide<K: Instructions>(&mut self, number: u32, block: &TriangleBlock) {
        let ray = &self.rays[number as usize];
        // SAFETY: the ray is one of those in flight.
        let Decision { mut hits, mut unsure, distances } = unsafe {
            let line = self.lines[number as usize].assume_init_ref();
            LineLanes::<K::Block>::new(line).decide(block)
        };
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize & 3;
            hits &= hits - 1;
            self.append(number, ray, Hit { t: distances[lane], object: block.id(lane) });
        }
        while unsure != 0 {
            let lane = unsure.trailing_zeros() as usize & 3;
            unsure &= unsure - 1;
            if let Some((object, triangle)) = block.triangle(lane)
                && let Some(t) = Line::new(ray).crossing(ray, &triangle.0)
            {
                self.append(number, ray, Hit { t, object });
            }
        }
    }

    /// Appends a hit if it is in the range of its ray, and not of an unused lane.
    #[inline(always)]
    fn append(&mut self, number: u32, ray: &Ray, hit: Hit) {
        if ray.t_min() <= hit.t && hit.t <= ray.t_max() && !hit.is_miss() {
            self.found.push(Found { number, hit });
        }
    }
}
