//! The generalised winding number of a point: how often triangles wind round it, closed or not.
//!
//! The winding number is the sum of the triangles' solid angles, with signs, in units of the whole
//! sphere. Of a closed mesh it is an integer; of a mesh with holes it is near one.
//!
//! # The bound
//!
//! A triangle with the unit normal n has the solid angle ∫ n · F(x − q) dA at the point q, with
//! F(x) = x / |x|³ = −∇ 1/|x|. A patch of triangles with the middle c and x − q = R + h, R = c − q,
//! has the potential 1/|R + h| = Σ (−1)ᵏ |h|ᵏ Pₖ(cos) / |R|ᵏ⁺¹. The gradient of the term k in h is
//! at most √(k (k + 1)) |h|ᵏ⁻¹ / |R|ᵏ⁺¹, because P² + (1 − x²) P'² / (k (k + 1)) ≤ 1 for all
//! Legendre polynomials (Szegő, 'Orthogonal polynomials', 7.3). A patch is estimated by its terms 1
//! and 2. All triangles are within r of c; with ρ = r / |R| < 1 and M = ∫ |h|² dA the other terms
//! together are at most
//!
//! ```text
//!   Σ_{k ≥ 3} (k + ½) M rᵏ⁻³ / |R|ᵏ⁺¹ = M / |R|⁴ · (3.5 / (1 − ρ) + ρ / (1 − ρ)²)
//! ```
//!
//! The patches with the largest bounds are opened until the sum of all bounds is less than the
//! distance of the estimate from the threshold. The answer is then the answer of the sum over all
//! triangles; points where that sum is within rounding of the threshold may count as either.
//!
//! # Sources
//!
//! Barill, Dickson, Schmidt, Levin & Jacobson 2018, 'Fast winding numbers for soups and clouds';
//! van Oosterom & Strackee 1983, 'The solid angle of a plane triangle'. Differs from the first
//! paper: errors are bounded, and no parameter trades them for time.

use crate::collapse::collapse_at_most;
use crate::cost::SahConstants;
use crate::exact::is_degenerate;
use crate::validate::Marks;
use crate::{Bvh, BvhView};
use core::f64::consts::PI;
use core::ops::Range;
use glam::{DMat3, DVec3};
use std::collections::BinaryHeap;

/// Triangles that are near to each other, and the terms of their solid angles.
#[derive(Clone, Debug)]
struct Patch {
    /// The centroid.
    center: DVec3,
    /// The largest distance of a corner from the centre, or more.
    radius: f64,
    area: f64,
    /// ∫ n dA.
    normal: DVec3,
    /// ∫ n hᵀ dA.
    moment: DMat3,
    /// ∫ |h|² dA.
    spread: f64,
    /// The least and the greatest coordinates.
    bounds: [DVec3; 2],
    first: u32,
    count: u32,
    /// Whether the range above is of triangles, or of patches.
    is_leaf: bool,
}

impl Patch {
    const EMPTY: Self = Self {
        center: DVec3::ZERO,
        radius: 0.0,
        area: 0.0,
        normal: DVec3::ZERO,
        moment: DMat3::ZERO,
        spread: 0.0,
        bounds: [DVec3::INFINITY, DVec3::NEG_INFINITY],
        first: 0,
        count: 0,
        is_leaf: true,
    };

    fn range(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// Returns the patch of one triangle. About its centroid, the triangle has no first moment.
    fn of(&[a, b, c]: &[DVec3; 3]) -> Self {
        let center = (a + b + c) / 3.0;
        let normal = (b - a).cross(c - a) / 2.0;
        let area = normal.length();
        let squares: f64 = [a, b, c].iter().map(|p| p.distance_squared(center)).sum();
        let spread = area * squares / 12.0;
        let bounds = [a.min(b).min(c), a.max(b).max(c)];
        Self { center, area, normal, spread, bounds, ..Self::EMPTY }
    }

    /// Returns the terms of all parts together.
    fn merged(parts: impl Iterator<Item = Patch> + Clone) -> Self {
        let mut whole = Self::EMPTY;
        for part in parts.clone() {
            whole.area += part.area;
            whole.center += part.area * part.center;
            let ([lower, upper], [min, max]) = (whole.bounds, part.bounds);
            whole.bounds = [lower.min(min), upper.max(max)];
        }
        // Nothing without an area winds round a point; with the radius 0 it is never opened.
        if whole.area == 0.0 {
            return whole;
        }
        whole.center /= whole.area;
        for part in parts {
            let h = part.center - whole.center;
            whole.normal += part.normal;
            whole.spread += part.spread + part.area * h.length_squared();
            whole.moment += part.moment
                + DMat3::from_cols(part.normal * h.x, part.normal * h.y, part.normal * h.z);
        }
        let [lower, upper] = whole.bounds;
        whole.radius = (whole.center - lower).max(upper - whole.center).length();
        whole
    }

    /// Returns an estimate of the solid angle, and a bound of its error; `None` for a near point.
    #[inline]
    fn estimate(&self, point: DVec3) -> Option<[f64; 2]> {
        /// The largest ρ of the patches that are estimated.
        const RATIO: f64 = 0.6;
        /// Covers all roundings, in units of the largest possible angle.
        const ROUNDING: f64 = 1e-13;
        let to = self.center - point;
        let square = to.length_squared();
        if self.radius * self.radius >= RATIO * RATIO * square {
            return None;
        }
        let inverse = 1.0 / to.length();
        let toward = to * inverse;
        let trace = self.moment.x_axis.x + self.moment.y_axis.y + self.moment.z_axis.z;
        let second = trace - 3.0 * toward.dot(self.moment * toward);
        let inverse_square = inverse * inverse;
        let value = inverse_square * (self.normal.dot(toward) + second * inverse);
        let ratio = self.radius * inverse;
        let tail = 1.0 / (1.0 - ratio);
        let terms = tail * (3.5 + ratio * tail);
        let error = self.spread * inverse_square * inverse_square * terms;
        Some([value, error + ROUNDING * self.area * inverse_square])
    }
}

/// Returns the solid angle of a triangle, positive where its corners run clockwise.
#[inline]
fn solid_angle(&[p, q, r]: &[DVec3; 3], point: DVec3) -> f64 {
    let [a, b, c] = [p - point, q - point, r - point];
    let [la, lb, lc] = [a.length(), b.length(), c.length()];
    let volume = a.dot((q - p).cross(r - p));
    let cosines = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * libm::atan2(volume, cosines)
}

/// The patches that are estimated, and those to be opened. Room that points share.
#[derive(Default)]
pub(crate) struct Open {
    /// The bits of each error, none of which is negative, with the patch and the bits of its value.
    estimated: BinaryHeap<(u64, u32, u64)>,
    near: Vec<u32>,
}

/// A tree of patches, coarser than the tree it is made of.
#[derive(Clone, Debug)]
pub(crate) struct Winding {
    patches: Vec<Patch>,
    triangles: Vec<[DVec3; 3]>,
}

impl Winding {
    /// Makes the patches of a valid tree over triangles. O(n) time and memory.
    pub(crate) fn new(tree: BvhView, triangles: &[[DVec3; 3]]) -> Self {
        /// The number of triangles up to which a subtree becomes a leaf.
        const LEAF: u32 = 8;
        let free_leaves = SahConstants { traversal: 1.0, intersection: 0.0 };
        let Bvh { nodes, prim_ids, .. } = collapse_at_most(tree, &free_leaves, LEAF);
        let mut patches = vec![Patch::EMPTY; nodes.len()];
        let mut sorted = Vec::with_capacity(triangles.len());
        let mut seen = Marks::new(triangles.len());
        // Children come after their parents.
        for (index, node) in nodes.iter().enumerate().rev() {
            let first = sorted.len();
            for &id in &prim_ids[node.prims()] {
                let triangle = triangles[id as usize];
                // A divided triangle belongs to one of its leaves. One without area winds round
                // nothing, though roundings would let it where a point is on its line.
                if seen.set(id as usize) && !is_degenerate(&triangle) {
                    sorted.push(triangle);
                }
            }
            let (patch, range) = if node.is_leaf() {
                (Patch::merged(sorted[first..].iter().map(Patch::of)), first..sorted.len())
            } else {
                let range = node.children();
                (Patch::merged(patches[range.clone()].iter().cloned()), range)
            };
            let (first, count) = (range.start as u32, range.len() as u32);
            patches[index] = Patch { first, count, is_leaf: node.is_leaf(), ..patch };
        }
        Self { patches, triangles: sorted }
    }

    /// Returns whether triangles wind round a finite point, in either direction: whether the size
    /// of the winding number exceeds one half.
    pub(crate) fn is_inside(&self, point: DVec3, open: &mut Open) -> bool {
        /// Covers the rounding of the sums.
        const SLACK: f64 = 1e-9;
        open.estimated.clear();
        open.near.clear();
        open.near.extend(self.patches.first().map(|_| 0));
        let mut angle = 0.0;
        let mut error = 0.0;
        loop {
            while let Some(index) = open.near.pop() {
                let patch = &self.patches[index as usize];
                if let Some([value, bound]) = patch.estimate(point) {
                    angle += value;
                    error += bound;
                    open.estimated.push((bound.to_bits(), index, value.to_bits()));
                } else {
                    angle += self.opened(patch, point, &mut open.near);
                }
            }
            let size = f64::abs(angle) - 2.0 * PI;
            if size.abs() > error + SLACK {
                return size > 0.0;
            }
            let Some((bound, patch, value)) = open.estimated.pop() else { return size > 0.0 };
            angle -= f64::from_bits(value);
            error -= f64::from_bits(bound);
            angle += self.opened(&self.patches[patch as usize], point, &mut open.near);
        }
    }

    /// Returns the solid angles of a patch's triangles, or opens its parts.
    #[inline]
    fn opened(&self, patch: &Patch, point: DVec3, near: &mut Vec<u32>) -> f64 {
        if patch.is_leaf {
            return self.triangles[patch.range()].iter().map(|t| solid_angle(t, point)).sum();
        }
        near.extend(patch.first..patch.first + patch.count);
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points(count: Range<usize>) -> impl Strategy<Value = Vec<DVec3>> {
        prop::collection::vec(prop::array::uniform3(-1.0f64..1.0).prop_map(DVec3::from), count)
    }

    #[test]
    fn no_patch_without_area_is_opened() {
        let degenerate = [DVec3::X, DVec3::Y].map(|end| Patch::of(&[end, end, DVec3::ONE]));
        let patches = [&[][..], &degenerate[..]].map(|of| Patch::merged(of.iter().cloned()));
        let whole = Patch::merged(patches.iter().cloned());
        for patch in patches.iter().chain([&whole]) {
            for point in [DVec3::X, DVec3::ONE, DVec3::splat(0.6)] {
                assert_eq!(patch.estimate(point), Some([0.0; 2]), "{patch:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn the_error_of_an_estimate_is_within_its_bound(
            corners in points(3..60),
            direction in prop::array::uniform3(-1.0f64..1.0),
            ratio in 0.01f64..0.59,
            are_inverted in any::<bool>(),
        ) {
            let (corners, _) = corners.as_chunks::<3>();
            let mut triangles = corners.to_vec();
            if are_inverted {
                // Two layers whose first terms cancel each other.
                for i in 0..triangles.len() {
                    let [a, b, c] = triangles[i].map(|corner| 0.9 * corner);
                    triangles.push([a, c, b]);
                }
            }
            let patch = Patch::merged(triangles.iter().map(Patch::of));
            let direction = DVec3::from(direction).try_normalize().unwrap_or(DVec3::X);
            let point = patch.center + direction * (patch.radius / ratio);
            let [value, error] = patch.estimate(point).unwrap();
            let exact: f64 = triangles.iter().map(|t| solid_angle(t, point)).sum();
            prop_assert!((value - exact).abs() <= error, "{value}, {exact}, {error}");
            // The bound is of the third order.
            let largest = patch.area * (ratio / patch.radius).powi(2);
            prop_assert!(error <= 40.0 * ratio * ratio * largest + 1e-12 * largest);
        }

        #[test]
        fn patches_of_patches_have_the_terms_of_all_their_triangles(corners in points(6..60)) {
            let (corners, _) = corners.as_chunks::<3>();
            let parts: Vec<Patch> = corners.iter().map(Patch::of).collect();
            let whole = Patch::merged(parts.iter().cloned());
            let (left, right) = parts.split_at(parts.len() / 2);
            let halves = [left, right].map(|half| Patch::merged(half.iter().cloned()));
            let merged = Patch::merged(halves.into_iter());
            prop_assert!((merged.spread - whole.spread).abs() < 1e-9);
            prop_assert!(merged.center.abs_diff_eq(whole.center, 1e-9));
            prop_assert!(merged.moment.abs_diff_eq(whole.moment, 1e-9));
            prop_assert!(merged.normal.abs_diff_eq(whole.normal, 1e-9));
            prop_assert!((merged.radius - whole.radius).abs() < 1e-9);
        }
    }
}
