//! What stops beams and fans, in f32 and in f64, and the points and directions that they are of.

use super::double::DWideBvh;
use super::double_block::corners_of;
use super::lanes::Lanes;
use super::layout::WideBvh;
use super::triangles::TriangleBlock;
use crate::each::Each;
use crate::{Coherence, DRay, PreparedRay, Ray, Select};
use glam::{DVec3, Vec3};

/// The triangles that stop beams, in f32 or f64, laid out.
pub(crate) trait Obstacles {
    /// A point.
    type Point: Copy + Into<DVec3>;
    /// A ray.
    type Ray;

    /// The layout of the boxes.
    fn boxes(&self) -> &WideBvh;

    /// The point in f64.
    fn point(point: Self::Point) -> DVec3;

    /// Returns a bound of the coordinates of all corners relative to a point.
    fn reach(&self, point: DVec3) -> f64;

    /// The ray from a point, over the range of beams.
    fn ray(&self, point: Self::Point, direction: DVec3, range: [f64; 2]) -> Self::Ray;

    /// Returns the ray as boxes are tested with it.
    fn boxed(&self, ray: &Self::Ray) -> Ray;

    /// Returns the corners of a block's triangles along some axes.
    unsafe fn corners<L: Lanes>(
        &self,
        block: &TriangleBlock,
        axes: [usize; 3],
    ) -> [[L::Double; 3]; 3];

    /// Returns whether the triangle in a lane of a block stops a ray.
    fn stops(&self, ray: &Self::Ray, block: &TriangleBlock, lane: usize) -> bool;

    /// Writes whether anything stops each ray.
    fn are_stopped(&self, rays: &[Self::Ray], stopped: &mut [bool]);
}

/// Neighbouring points, and the directions in which they look.
pub(crate) struct Beams<'a, O: Obstacles> {
    pub(crate) obstacles: &'a O,
    /// At most 128, at least one.
    pub(crate) points: &'a [O::Point],
    /// Only directions above the surface count.
    pub(crate) normals: Option<&'a [O::Point]>,
    pub(crate) directions: &'a [DVec3],
    pub(crate) range: [f64; 2],
}

impl<O: Obstacles> Beams<'_, O> {
    /// Returns whether a direction is above the surface at a point.
    #[inline(always)]
    pub(super) fn is_above(&self, point: usize, direction: DVec3) -> bool {
        // A tiny normal counts, too.
        self.normals.is_none_or(|normals| normals[point].into().dot(direction) > 0.0)
    }
}

impl Obstacles for WideBvh {
    type Point = Vec3;
    type Ray = Ray;

    fn boxes(&self) -> &WideBvh {
        self
    }

    fn point(point: Vec3) -> DVec3 {
        point.as_dvec3()
    }

    fn reach(&self, point: DVec3) -> f64 {
        let [min, max] = [self.bounds.min, self.bounds.max].each(Vec3::as_dvec3);
        (max - point).max(point - min).max_element()
    }

    fn ray(&self, point: Vec3, direction: DVec3, [t_min, t_max]: [f64; 2]) -> Ray {
        Ray::assume_valid(point, direction.as_vec3(), t_min as f32, t_max as f32)
    }

    fn boxed(&self, ray: &Ray) -> Ray {
        self.frame().map_or(*ray, |frame| frame.ray(ray))
    }

    #[inline(always)]
    unsafe fn corners<L: Lanes>(
        &self,
        block: &TriangleBlock,
        axes: [usize; 3],
    ) -> [[L::Double; 3]; 3] {
        // SAFETY: the processor has the instructions; these are rows.
        let [a, b, c] = unsafe { block.corners_along::<L>(axes.each(|axis| axis * L::N)) };
        [double(a), double(b), double(c)]
    }

    fn stops(&self, ray: &Ray, block: &TriangleBlock, lane: usize) -> bool {
        let triangle = block.triangle(lane);
        triangle.is_some_and(|(_, triangle)| {
            triangle.intersect(&PreparedRay::new(ray), ray.t_max()).is_some()
        })
    }

    fn are_stopped(&self, rays: &[Ray], stopped: &mut [bool]) {
        self.any_hits(rays, stopped, Coherence::Incoherent);
    }
}

#[inline(always)]
fn double<L: Lanes>([x, y, z]: [L; 3]) -> [L::Double; 3] {
    [x.double(), y.double(), z.double()]
}

impl Obstacles for DWideBvh {
    type Point = DVec3;
    type Ray = DRay;

    fn boxes(&self) -> &WideBvh {
        &self.wide
    }

    fn point(point: DVec3) -> DVec3 {
        DRay::exact(point)
    }

    fn reach(&self, point: DVec3) -> f64 {
        let size = self.wide.bounds.min.abs().max(self.wide.bounds.max.abs()).max_element();
        // A point of the box is less than √3 of its size from the frame's centre.
        (point - self.frame.centre()).abs().max_element() + 1.75 * f64::from(size)
    }

    fn ray(&self, point: DVec3, direction: DVec3, [t_min, t_max]: [f64; 2]) -> DRay {
        DRay { origin: DRay::exact(point), direction, t_min, t_max }
    }

    fn boxed(&self, ray: &DRay) -> Ray {
        DWideBvh::boxed(self, ray)
    }

    #[inline(always)]
    unsafe fn corners<L: Lanes>(
        &self,
        block: &TriangleBlock,
        axes: [usize; 3],
    ) -> [[L::Double; 3]; 3] {
        // SAFETY: the processor has the instructions.
        let corners = unsafe { corners_of::<L>(block, &self.triangles, block.used::<L>()) };
        corners.each(|corner| axes.each(|axis| corner[axis]))
    }

    fn stops(&self, ray: &DRay, block: &TriangleBlock, lane: usize) -> bool {
        self.triangles[block.id(lane) as usize].intersect(ray).is_some()
    }

    fn are_stopped(&self, rays: &[DRay], stopped: &mut [bool]) {
        self.any_hits(rays, Select::default(), stopped, Coherence::Incoherent);
    }
}
