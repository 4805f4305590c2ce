//! All hits of a ray, each crossing of a surface once.
//!
//! # Rule
//!
//! The hits are the crossings of [`Triangle::crossing`](crate::Triangle::crossing), in real
//! arithmetic. A ray through an edge or a corner meets several closed triangles there; the rule
//! counts those that its line would cross if it were moved by (ε, ε², ε³) with an infinitely small
//! ε > 0 (a *symbolic perturbation*). With `o` the origin, `d` the direction and `P`, `Q` the ends of an edge relative
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

use super::answer::{ANY_HIT, Find};
use super::gathered::{Decided, hit_of};
use super::instructions::{Instructions, Task};
use super::lanes::Lanes;
use super::layout::{WideBvh, WideNode};
use super::one_ray::{LeafRay, Leaves, traverse};
use super::triangles::TriangleBlock;
use super::{portable, vector};
use crate::{Coherence, Hit, Kernel, Ray};

impl WideBvh {
    /// Returns the hits of the ray in its range, each crossing of a surface once, the nearest
    /// first; among hits at the same distance the lowest id first.
    ///
    /// Through an edge or a corner, the ray hits only the triangles that its line would hit if it
    /// were moved by (ε, ε², ε³) with an infinitely small ε > 0. The number of hits of a line with
    /// a closed mesh is therefore even, and a half line that begins inside it, not on it, has an
    /// odd number, but for distances beyond f32. All kernels give the hits of
    /// [`Triangle::crossing`](crate::Triangle::crossing), bit by bit.
    ///
    /// The distances are those of [`nearest_hit`](Self::nearest_hit).
    ///
    /// ```
    /// # use bvh_core::{Aabb, Bvh, Hit, Node, Ray, Triangle, WideBvh};
    /// // A square of two triangles, and a ray through its diagonal.
    /// let [a, b, c, d] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    /// let square = [[a, b, c], [a, c, d]].map(Triangle::from);
    /// let leaf = Node::leaf(Aabb::from([a, c]), 0, 2);
    /// let wide = WideBvh::new(&Bvh::new(vec![leaf], vec![0, 1]), &square)?;
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
        for (rays, counts) in rays.chunks(AT_ONCE).zip(counts.chunks_mut(AT_ONCE)) {
            found.clear();
            self.trace(All { rays, found: &mut found }, Coherence::Incoherent);
            append_sorted(&found, hits, counts);
        }
    }

    /// Appends the hits of one ray, in no order; the hits of a divided triangle once for each of its
    /// leaves.
    fn append_hits(&self, ray: &Ray, hits: &mut Vec<Hit>) {
        if self.kernel != Kernel::Portable {
            // SAFETY: a layout's kernel is available.
            return unsafe { vector::dispatch(self.kernel, OneRay { wide: self, ray, hits }) };
        }
        let line = ray.line();
        let slabs = self.slabs(ray);
        let intervals = |node: &WideNode| portable::intervals(&slabs, node);
        portable::traverse::<ANY_HIT>(self, ray.t_max(), intervals, &mut (), |block, _| {
            for (object, triangle) in block.triangles() {
                hits.extend(hit_of(ray, &line, object, &triangle));
            }
            false
        });
    }
}

/// Appends the hits of rays in the order of the rays, each hit once, and writes how many there are
/// of each ray.
fn append_sorted(found: &[Found], hits: &mut Vec<Hit>, counts: &mut [u32]) {
    counts.fill(0);
    for found in found {
        counts[found.number as usize] += 1;
    }
    // Sorted by counting: the hits of ray after ray, in any order.
    let first = hits.len();
    let mut next = [first; AT_ONCE];
    for i in 1..counts.len() {
        next[i] = next[i - 1] + counts[i - 1] as usize;
    }
    hits.resize(first + found.len(), Hit::MISS);
    for found in found {
        let next = &mut next[found.number as usize];
        hits[*next] = found.hit;
        *next += 1;
    }
    let mut start = first;
    let mut kept = first;
    for count in counts {
        let end = start + *count as usize;
        let different = sort_hits(&mut hits[start..end]);
        hits.copy_within(start..start + different, kept);
        *count = different as u32;
        kept += different;
        start = end;
    }
    hits.truncate(kept);
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

/// The number of rays whose hits are sorted together. What is kept of them fits in the cache.
const AT_ONCE: usize = 1024;

/// A hit of the ray of this number.
#[derive(Clone, Copy)]
struct Found {
    number: u32,
    hit: Hit,
}

/// All hits of every ray, in no order; the hits of a divided triangle once for each of its leaves.
struct All<'a> {
    rays: &'a [Ray],
    found: &'a mut Vec<Found>,
}

impl<'a> Find for All<'a> {
    type Rays = &'a [Ray];
    const ALL: bool = true;

    #[inline(always)]
    fn rays(&self) -> &'a [Ray] {
        self.rays
    }

    #[inline(always)]
    fn append(
        &mut self,
        number: usize,
        decided: &Decided,
        pair: usize,
        block: &TriangleBlock,
        lane: usize,
    ) {
        let hit = decided.hit_of(pair, block, lane, &self.rays[number]);
        self.found.extend(hit.map(|hit| Found { number: number as u32, hit }));
    }

    fn alone(&mut self, wide: &WideBvh, number: usize) {
        let mut hits = Vec::new();
        wide.append_hits(&self.rays[number], &mut hits);
        let number = number as u32;
        self.found.extend(hits.into_iter().map(|hit| Found { number, hit }));
    }
}

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
            let leaf_ray = LeafRay::<K::Block>::new(ray, wide);
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

impl<K: Instructions> Leaves<K> for AllHits<'_, K::Block> {
    #[inline(always)]
    unsafe fn visit(&mut self, block: &TriangleBlock, nearest: &mut Hit) -> bool {
        // SAFETY: the processor has the instructions.
        let (rays, corners) = unsafe { (&self.leaf_ray.pairs, self.leaf_ray.corners(block)) };
        let crossings = rays.candidates(&corners).crossings;
        if crossings.possible != 0 {
            let t_max = corners[0][0].filled(nearest.t);
            let decided = Decided::new(rays.decide_in_f64(&corners, crossings, t_max));
            for lane in 0..block.len() {
                self.hits.extend(decided.hit_of(lane, block, lane, self.ray));
            }
        }
        false
    }
}
