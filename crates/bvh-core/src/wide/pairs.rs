//! The exact test of a triangle, for pairs of a ray and a triangle side by side: one ray and several triangles, several rays and
//! one triangle, or anything between.

use super::lanes::{DoubleLanes, Lanes, Mask};
use crate::Slabs;

/// The rays of the pairs: the shear of each, as in [`Shear`](crate::Shear), and what [`Slabs`] needs. Vectors of three, of
/// corners too, are in the shear's order of axes.
#[derive(Clone, Copy)]
pub(crate) struct Pairs<L> {
    pub(crate) origin: [L; 3],
    pub(crate) inverse: [L; 3],
    pub(crate) slope: [L; 2],
    pub(crate) depth: L,
    pub(crate) t_min: L,
}

impl<L: Lanes> Pairs<L> {
    /// A corner of each triangle relative to the ray, sheared: 0, 0 and any z when it is on the ray. The operations of
    /// [`Shear`](crate::Shear).
    #[inline(always)]
    fn relative(&self, corner: &[L; 3]) -> [L; 3] {
        let z = corner[2] - self.origin[2];
        let x = corner[0] - self.origin[0];
        let y = corner[1] - self.origin[1];
        [x - self.slope[0] * z, y - self.slope[1] * z, z]
    }

    /// Returns a bit per pair whose triangle the ray's line may meet. The sides of the edges are computed
    /// in f32, whose signs are right or zero.
    #[inline(always)]
    pub(crate) fn candidates(&self, corners: &[[L; 3]; 3]) -> u32 {
        let [ax, ay, _] = self.relative(&corners[0]);
        let [bx, by, _] = self.relative(&corners[1]);
        let [cx, cy, _] = self.relative(&corners[2]);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let least = u.min(v).min(w);
        let most = u.max(v).max(w);
        // SAFETY: values exist.
        let zero = unsafe { L::splat(0.0) };
        !(least.lt(zero) & zero.lt(most)).bits()
    }

    /// The pairs whose triangle [`Triangle::intersect`](crate::Triangle::intersect) accepts up to `t_max`, and their
    /// distances, bit by bit. No triangle is degenerate.
    #[inline(always)]
    pub(crate) fn decide(&self, corners: &[[L; 3]; 3], t_max: L) -> (L::Mask, L) {
        let (inside, t) = self.meet(corners);
        // The interval of each triangle's own box: the operations of `Slabs`.
        // SAFETY: values exist.
        let splat = |x: f32| unsafe { L::splat(x) };
        let mut reach = splat(0.0);
        let mut extent = [[reach; 2]; 3];
        for axis in 0..3 {
            let a = corners[0][axis];
            let b = corners[1][axis];
            let c = corners[2][axis];
            let min = a.min(b).min(c);
            let max = a.max(b).max(c);
            let origin = self.origin[axis];
            reach = reach.max((min - origin).abs().max((max - origin).abs()));
            extent[axis] = [min, max];
        }
        let reach = reach * splat(Slabs::MARGIN);
        let mut entry = self.t_min;
        let mut exit = splat(f32::INFINITY);
        for (axis, [min, max]) in extent.into_iter().enumerate() {
            let origin = self.origin[axis];
            let margin = reach + origin.abs() * splat(f32::EPSILON) + splat(f32::MIN_POSITIVE);
            let low = (min - (origin + margin)) * self.inverse[axis];
            let high = (max - (origin - margin)) * self.inverse[axis];
            entry = entry.max(low.min(high));
            exit = exit.min(low.max(high));
        }
        let exit = exit * splat(Slabs::FAR);
        // A zero is +0.
        let moved = t.min(exit).max(entry) + splat(0.0);
        (inside & entry.le(exit) & moved.le(t_max), moved)
    }

    /// Returns the pairs whose ray meets the triangle in front of its origin, and the distances.
    #[inline(always)]
    fn meet(&self, corners: &[[L; 3]; 3]) -> (L::Mask, L) {
        let [ax, ay, az] = self.relative(&corners[0]);
        let [bx, by, bz] = self.relative(&corners[1]);
        let [cx, cy, cz] = self.relative(&corners[2]);
        let ax = ax.double();
        let ay = ay.double();
        let az = az.double();
        let bx = bx.double();
        let by = by.double();
        let bz = bz.double();
        let cx = cx.double();
        let cy = cy.double();
        let cz = cz.double();
        // Products of two f32 are exact in f64: fused or not, the difference is the same.
        let u = cx.mul_sub(by, cy * bx);
        let v = ax.mul_sub(cy, ay * cx);
        let w = bx.mul_sub(ay, by * ax);
        // SAFETY: values exist.
        let zero = unsafe { L::Double::splat(0.0) };
        let outside = u.min(v).min(w).lt(zero) & zero.lt(u.max(v).max(w));
        let determinant = u + v + w;
        let t = (u * az + v * bz + w * cz) / (determinant * self.depth.double());
        let after = self.t_min.double().le(t);
        let excluded = L::narrow(outside | determinant.eq(zero));
        (L::narrow(after).and_not(excluded), L::single(t))
    }
}
