//! Rays and triangles in f64.
//!
//! The definitions are those of [`exact`](crate::exact) with f64 for f32. Exactness needs room for
//! products of three coordinates: every coordinate, and every component of a direction, is 0 or
//! between 2⁻¹⁵⁰ and 2¹²⁰ in size; smaller ones count as 0. All values of the exact layer are then
//! multiples of 2⁻⁶⁶⁰ below 2⁵⁰⁰.

use crate::each::Each;
use crate::exact::{Line, Verdict, is_degenerate};
use crate::ray::power_below;
use crate::triangle::{normal_of, offset_from};
use crate::{Aabb, Corners, Frame, Hit, Ray, Triangle};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// A triangle in f64, in world units. Rays can hit both sides.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DTriangle(pub [DVec3; 3]);

impl From<[[f64; 3]; 3]> for DTriangle {
    /// Makes a triangle from three corners. Coordinates below 2⁻¹⁵⁰ count as 0, as those of a
    /// [ray](DRay::new): they are what rounding leaves of 0. Equal corners remain equal.
    fn from(corners: [[f64; 3]; 3]) -> Self {
        Self(corners.each(|corner| DRay::exact(corner.into())))
    }
}

/// The points `origin + t · direction` with `t_min <= t <= t_max`, in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
// Vector kernels load the numbers in this order, none of them across a line of the cache.
#[repr(C, align(32))]
pub struct DRay {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
    pub(crate) t_min: f64,
    pub(crate) t_max: f64,
}

/// The reason why numbers in f64 are rejected.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OutOfExactRange {
    /// A coordinate of a ray's origin.
    #[error("the ray's origin {0}: accepted are coordinates up to 2^120")]
    Origin(DVec3),
    /// A component of a ray's direction, or all of them.
    #[error(
        "the ray's direction {0}: accepted are components up to 2^100, the largest of at least 2^-100"
    )]
    Direction(DVec3),
    /// The range is NaN or extends behind the origin.
    #[error("the ray's range {0}..={1} must not be NaN and must start at 0 or later")]
    Range(f64, f64),
    /// A coordinate of a triangle.
    #[error(
        "triangle {triangle} has the corner {corner}: accepted are coordinates that are 0 or from 2^-150 to 2^120"
    )]
    #[allow(missing_docs)] // The message explains the fields.
    Triangle { triangle: usize, corner: DVec3 },
}

/// Returns whether all coordinates are in the range in which answers are exact.
fn is_exact(point: DVec3) -> bool {
    point.to_array().iter().all(|&x| x == 0.0 || (DRay::LEAST..=DRay::MOST).contains(&x.abs()))
}

impl DRay {
    /// The least size of a coordinate but 0: 2⁻¹⁵⁰.
    pub const LEAST: f64 = 1.0 / (1u128 << 75) as f64 / (1u128 << 75) as f64;
    /// The greatest size of a coordinate: 2¹²⁰.
    pub const MOST: f64 = (1u128 << 120) as f64;
    /// The greatest size of a direction's largest component.
    const LONG: f64 = (1u128 << 100) as f64;

    /// Returns a point or a direction as it counts.
    pub(crate) fn exact(point: DVec3) -> DVec3 {
        point.map(|x| if x.abs() < Self::LEAST { 0.0 } else { x })
    }

    /// Makes the ray from `origin` in `direction` over `t_min..=t_max`. Distances `t` are in
    /// multiples of the direction's length, which need not be 1. Arrays `[f64; 3]` are accepted.
    ///
    /// Coordinates and components below 2⁻¹⁵⁰ count as 0: they are what cancellation leaves where a
    /// path comes to a plane through zero, and the path must not end there.
    #[inline]
    pub fn new(
        origin: impl Into<DVec3>,
        direction: impl Into<DVec3>,
        t_min: f64,
        t_max: f64,
    ) -> Result<Self, OutOfExactRange> {
        let mut origin = origin.into();
        let mut direction = direction.into();
        let (sizes, others) = (direction.abs(), origin.abs());
        let longest = sizes.max_element();
        let DVec3 { x, y, z } = sizes + others;
        let least = sizes.min(others).min_element();
        // NaN fails every comparison. Zeros are looked at one by one.
        let is_valid = (x + y + z <= Self::MOST)
            & (least >= Self::LEAST)
            & (1.0 / Self::LONG..=Self::LONG).contains(&longest)
            & (t_min >= 0.0)
            & !t_max.is_nan();
        if !is_valid {
            [origin, direction] = Self::checked(origin, direction, t_min, t_max)?;
        }
        // Adding 0 turns −0 into +0.
        Ok(Self { origin, direction, t_min: t_min + 0.0, t_max: t_max.min(f64::MAX) + 0.0 })
    }

    #[inline(never)]
    fn checked(
        origin: DVec3,
        direction: DVec3,
        t_min: f64,
        t_max: f64,
    ) -> Result<[DVec3; 2], OutOfExactRange> {
        let [origin, direction] = [origin, direction].each(Self::exact);
        if !is_exact(origin) {
            return Err(OutOfExactRange::Origin(origin));
        }
        let longest = direction.abs().max_element();
        if !(is_exact(direction) && (1.0 / Self::LONG..=Self::LONG).contains(&longest)) {
            return Err(OutOfExactRange::Direction(direction));
        }
        // NaN is in no range.
        if !(0.0..).contains(&t_min) || t_max.is_nan() {
            return Err(OutOfExactRange::Range(t_min, t_max));
        }
        Ok([origin, direction])
    }

    /// Makes a half line: `t` from 0 to the largest finite distance.
    #[inline]
    pub fn half_line(
        origin: impl Into<DVec3>,
        direction: impl Into<DVec3>,
    ) -> Result<Self, OutOfExactRange> {
        Self::new(origin, direction, 0.0, f64::MAX)
    }

    /// The point where `t` is 0.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The unit of `t`: not zero, of any length.
    pub fn direction(&self) -> DVec3 {
        self.direction
    }

    /// The smallest distance of a hit, 0 or more.
    pub fn t_min(&self) -> f64 {
        self.t_min
    }

    /// The largest distance of a hit.
    pub fn t_max(&self) -> f64 {
        self.t_max
    }

    /// Returns the power of two in the direction's largest component, and its reciprocal: the factors
    /// from distances to those of a ray whose direction has about the length 1, and back.
    #[inline(always)]
    pub(crate) fn scales(&self) -> [f64; 2] {
        let size = power_below(self.direction.abs().max_element());
        [size, f64::from_bits(2 * 1.0f64.to_bits() - size.to_bits())]
    }

    /// Returns a distance in f32, for the direction scaled so that its largest component is about 1.
    #[inline(always)]
    pub(crate) fn single(&self, t: f64) -> f32 {
        let [size, _] = self.scales();
        ((t * size) as f32).min(f32::MAX)
    }

    /// Returns bounds of a distance from those of it in f32.
    #[inline(always)]
    pub(crate) fn doubles(&self, low: f32, high: f32) -> (f64, f64) {
        let [_, unit] = self.scales();
        (f64::from(low) * unit, f64::from(high) * unit)
    }

    /// Returns the origin, and the direction, scaled so that its largest component is about 1.
    pub(crate) fn scaled_ends(&self) -> [DVec3; 2] {
        let [_, unit] = self.scales();
        [self.origin, self.direction * unit]
    }

    fn line(&self) -> Line {
        Line::new(self.origin, self.direction)
    }

    /// Returns the distance of the plane of a triangle that the ray's line crosses, rounded once.
    fn rounded(&self, corners: &[DVec3; 3]) -> f64 {
        Line::rounded([self.origin, self.direction], corners)
    }
}

/// The side from which a ray comes to the triangles that it hits.
///
/// A ray through an edge or a corner of a solid meets several closed triangles there, and may only
/// touch the solid. Of a given side, only *crossings* count, by the rule of
/// [`Triangle::crossing`](crate::Triangle::crossing): from a point outside, a closed surface is left as
/// often as it is entered, from a point inside once more. A ray from a point on the surface counts as
/// if it began just before it, on the moved line. So one along a face may count as outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Orientation {
    /// Either side.
    #[default]
    Any,
    /// Along the normal of a triangle, whose corners run counterclockwise seen from outside: the ray
    /// leaves a solid.
    Exiting,
    /// Against the normal: the ray enters a solid.
    Entering,
}

/// Which hits of a ray count.
#[derive(Clone, Copy, Debug, Default)]
pub struct Select<'a> {
    /// The side from which the ray comes.
    pub orientation: Orientation,
    /// The ids of triangles that do not count, such as the one that the ray starts on: a few, in any
    /// order.
    pub exclude: &'a [u32],
}

impl<'a> Select<'a> {
    /// Returns whether all hits count.
    pub fn counts_all(&self) -> bool {
        self.orientation == Orientation::Any && self.exclude.is_empty()
    }

    /// Returns the filter of a ray in f32 over `triangles`, by id, for
    /// [`WideBvh::nearest_hit_where`](crate::WideBvh::nearest_hit_where) and
    /// [`any_hit_where`](crate::WideBvh::any_hit_where): whether a hit counts, exactly.
    pub fn filter(self, ray: &'a Ray, triangles: &'a [Triangle]) -> impl FnMut(Hit) -> bool + 'a {
        move |Hit { object, .. }| {
            let Triangle(corners) = &triangles[object as usize];
            self.admits(object, || ray.line().crossed_side(corners))
        }
    }

    /// Returns whether a hit counts on a triangle to which the ray comes from a [side](Line::side).
    fn admits(&self, object: u32, side: impl FnOnce() -> i32) -> bool {
        !self.exclude.contains(&object)
            && match self.orientation {
                Orientation::Any => true,
                Orientation::Exiting => side() > 0,
                Orientation::Entering => side() < 0,
            }
    }

    /// Returns those of some hits that are of the orientation, by the bits of those along the normal.
    #[inline(always)]
    pub(crate) fn oriented(&self, hits: u32, along: u32) -> u32 {
        match self.orientation {
            Orientation::Any => hits,
            Orientation::Exiting => hits & along,
            Orientation::Entering => hits & !along,
        }
    }
}

/// A hit of a ray with a triangle in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DHit {
    /// The distance, in multiples of the direction's length.
    pub t: f64,
    /// The triangle's id.
    pub object: u32,
}

impl Corners for DTriangle {
    #[inline]
    fn corners(&self) -> [DVec3; 3] {
        self.0
    }

    #[inline]
    fn aabb_in(&self, frame: Option<&Frame>) -> Aabb {
        frame.unwrap_or(&Frame::FILE).aabb_of(self.0)
    }
}

impl DTriangle {
    /// Rejects triangles beyond the range in which answers are exact. [`From`] an array makes none
    /// that is too small for it.
    pub fn check(triangles: &[Self]) -> Result<(), OutOfExactRange> {
        for (triangle, DTriangle(corners)) in triangles.iter().enumerate() {
            if let Some(&corner) = corners.iter().find(|corner| !is_exact(**corner)) {
                return Err(OutOfExactRange::Triangle { triangle, corner });
            }
        }
        Ok(())
    }

    /// Returns the distance at which the ray hits the triangle if that distance is in the ray's
    /// range: the real distance, rounded once to the nearest f64. The same as
    /// [`Triangle::intersect`](crate::Triangle::intersect).
    pub fn intersect(&self, ray: &DRay) -> Option<f64> {
        self.distance(ray, false)
    }

    /// Returns the distance at which the ray crosses the triangle, by the rule of
    /// [`Triangle::crossing`](crate::Triangle::crossing).
    pub fn crossing(&self, ray: &DRay) -> Option<f64> {
        self.distance(ray, true)
    }

    /// Returns the point of the triangle nearest to `point`, as
    /// [`Triangle::closest_point`](crate::Triangle::closest_point) does.
    pub fn closest_point(&self, point: impl Into<DVec3>) -> DVec3 {
        let point = point.into();
        point + offset_from(point, self.0)
    }

    /// Returns the weights of the corners, as
    /// [`Triangle::barycentrics`](crate::Triangle::barycentrics) does.
    pub fn barycentrics(&self, ray: &DRay) -> Option<[f64; 3]> {
        ray.line().barycentrics(&self.0)
    }

    /// Returns the unit normal, as [`Triangle::normal`](crate::Triangle::normal) does.
    pub fn normal(&self) -> Option<DVec3> {
        normal_of(self.0)
    }

    fn distance(&self, ray: &DRay, is_moved: bool) -> Option<f64> {
        let line = ray.line();
        let t = match line.filter(&self.0) {
            // It crosses, and twice f64 nearly always rounds its distance.
            Verdict::Between(..) => ray.rounded(&self.0),
            _ => line.crossing(&self.0, is_moved)?,
        };
        (ray.t_min <= t && t <= ray.t_max).then_some(t)
    }

    /// Returns whether the corners coincide or are collinear, in real arithmetic.
    pub fn is_degenerate(&self) -> bool {
        is_degenerate(&self.0)
    }
}

/// The nearest hit of a ray so far, at a distance between two bounds, which are equal if it is
/// known.
#[derive(Clone, Copy)]
pub(crate) struct NearestHit {
    pub(crate) low: f64,
    /// The distance beyond which nothing counts, or more.
    pub(crate) high: f64,
    /// The triangle's id; the greatest number without a hit.
    pub(crate) object: u32,
}

impl NearestHit {
    pub(crate) fn new(ray: &DRay) -> Self {
        let [low, high] = [ray.t_max; 2];
        Self { low, high, object: u32::MAX }
    }

    /// Returns a hit between bounds of its distance.
    #[inline(always)]
    pub(crate) fn between((low, high): (f64, f64), object: u32) -> Self {
        Self { low, high, object }
    }

    pub(crate) fn is_known(&self) -> bool {
        self.low == self.high
    }

    /// Returns the hit, whose distance is known.
    pub(crate) fn hit(&self) -> Option<DHit> {
        (self.object != u32::MAX).then_some(DHit { t: self.low + 0.0, object: self.object })
    }
}

/// A ray, and which of its hits with triangles count.
#[derive(Clone, Copy)]
pub(crate) struct Query<'a> {
    pub(crate) triangles: &'a [DTriangle],
    pub(crate) ray: &'a DRay,
    pub(crate) select: Select<'a>,
}

impl Query<'_> {
    /// Returns whether a hit is certainly out of the range or behind the nearest one.
    #[inline(always)]
    pub(crate) fn leaves_out(&self, nearest: &NearestHit, new: &NearestHit) -> bool {
        new.high < self.ray.t_min || nearest.high < new.low
    }

    /// Takes a triangle, decided by itself. Returns whether it is the new nearest hit.
    pub(crate) fn offer(&self, nearest: &mut NearestHit, object: u32) -> bool {
        let Some(bounds) = self.bounds(object) else { return false };
        self.take(nearest, NearestHit::between(bounds, object))
    }

    /// Takes a hit, if it counts and is nearer. Returns whether it is.
    pub(crate) fn take(&self, nearest: &mut NearestHit, new: NearestHit) -> bool {
        if self.leaves_out(nearest, &new) {
            return false;
        }
        if !self.select.counts_all() && !self.counts(new.object) {
            return false;
        }
        if new.low < self.ray.t_min || nearest.low <= new.high {
            return self.take_close(nearest, new);
        }
        *nearest = new;
        true
    }

    /// Takes a hit that counts, and is not left out, if it is in the range and nearer, or as near
    /// and of a lower id. Returns whether it is. Where the bounds do not decide, there are narrower
    /// ones.
    #[cold]
    #[inline(never)]
    pub(crate) fn take_close(&self, nearest: &mut NearestHit, mut new: NearestHit) -> bool {
        // A divided triangle is in several leaves.
        if new.object == nearest.object {
            return false;
        }
        for narrow in [Self::narrow, Self::resolve] {
            for hit in [&mut new, &mut *nearest] {
                if !hit.is_known() {
                    narrow(self, hit);
                }
            }
            if self.leaves_out(nearest, &new) {
                return false;
            }
            if self.ray.t_min <= new.low && new.high < nearest.low {
                *nearest = new;
                return true;
            }
        }
        let is_nearer = new.object < nearest.object;
        if is_nearer {
            *nearest = new;
        }
        is_nearer
    }

    #[inline(never)]
    pub(crate) fn counts(&self, object: u32) -> bool {
        let DTriangle(corners) = &self.triangles[object as usize];
        self.select.admits(object, || self.ray.line().crossed_side(corners))
    }

    /// Finds bounds of the distance in f64.
    fn narrow(&self, hit: &mut NearestHit) {
        if let Some(bounds) = self.bounds(hit.object) {
            (hit.low, hit.high) = bounds;
        }
    }

    /// Finds the rounded distance.
    pub(crate) fn resolve(&self, hit: &mut NearestHit) {
        let DTriangle(corners) = &self.triangles[hit.object as usize];
        hit.low = self.ray.rounded(corners);
        hit.high = hit.low;
    }

    /// Returns bounds of the distance at which the ray hits a triangle, without its range. Where they
    /// take exact arithmetic, triangles that do not count have none.
    #[cold]
    #[inline(never)]
    pub(crate) fn bounds(&self, object: u32) -> Option<(f64, f64)> {
        let DTriangle(corners) = &self.triangles[object as usize];
        let line = self.ray.line();
        match line.filter(corners) {
            Verdict::Miss => None,
            Verdict::Between(low, high) => Some((low, high)),
            Verdict::Unsure if self.select.admits(object, || line.side(corners)) => {
                let t = line.crossing(corners, false)?;
                Some((t, t))
            }
            Verdict::Unsure => None,
        }
    }
}
