//! All hits of a ray, each crossing of a surface once, and whether points are inside a closed mesh.
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

use super::all_in_flight::{self, Found};
use super::answer::ANY_HIT;
use super::crossed_leaves::{AllHits, SlopedLine};
use super::layout::WideBvh;
use super::portable;
use super::vector;
use crate::exact::Line;
use crate::{Hit, Kernel, Ray};
use alloc::vec::Vec;
use glam::Vec3;

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
        let parts = rays.chunks(all_in_flight::MOST);
        for (rays, counts) in parts.zip(counts.chunks_mut(all_in_flight::MOST)) {
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
        let parts = rays.chunks(all_in_flight::MOST);
        for (rays, counts) in parts.zip(counts.chunks_mut(all_in_flight::MOST)) {
            hits.clear();
            self.append_hits_of(rays, &mut hits, counts, &mut found);
        }
    }

    /// Writes whether every point is inside the mesh: whether the half line from the point along +x
    /// has an odd number of [hits](Self::all_hits). The answer is exact for closed meshes. A point
    /// on the surface counts as inside or outside, and of two solids with a common face and
    /// opposite sides of it one contains the point. A point that is not finite is outside.
    ///
    /// # Panics
    /// Panics if `points` and `inside` are not equally many.
    pub fn contains(&self, points: &[Vec3], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "an answer for every point");
        let is_within = |point: Vec3| {
            // A point outside the box is outside the mesh. NaN fails every comparison.
            (self.bounds.min.cmple(point) & point.cmple(self.bounds.max)).all()
        };
        let rays: Vec<Ray> = points
            .iter()
            .filter(|&&point| is_within(point))
            .map(|&point| Ray::assume_valid(point, Vec3::X, 0.0, f32::MAX))
            .collect();
        let mut counts = alloc::vec![0; rays.len()];
        self.count_hits(&rays, &mut counts);
        let mut counts = counts.into_iter();
        for (&point, inside) in points.iter().zip(inside) {
            *inside = is_within(point) && counts.next().is_some_and(|count| count % 2 == 1);
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
        // SAFETY: `kernel` is available, as those who set it saw; callers
        // pass parts of no more rays.
        unsafe { vector::all_hits_of(self, rays, found) };
        counts.fill(0);
        for found in found.iter() {
            counts[found.number as usize] += 1;
        }
        // Sorted by counting: the hits of ray after ray, in any order.
        let mut next = [0; all_in_flight::MOST];
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
            // SAFETY: `kernel` is available, as those who set it saw.
            unsafe { vector::all_hits(self, ray, &mut leaves) };
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
