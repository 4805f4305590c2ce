//! Rays side by side, a ray per lane.

use super::instructions::Instructions;
use super::lanes::{DoubleLanes, Lanes, Mask};
use super::layout::WideBvh;
use super::pairs::Pairs;
use crate::each::Each;
use crate::exact::AXES;
use crate::{Aabb, Frame, Ray};

/// One ray per lane, as triangles are tested with it. Vectors of three are by axis.
#[derive(Clone, Copy)]
pub(crate) struct RayLanes<L> {
    pub(crate) origin: [L; 3],
    pub(crate) direction: [L; 3],
    pub(crate) t_min: L,
    pub(crate) t_max: L,
}

/// The same rays as boxes are tested with them: in the frame of the boxes.
#[derive(Clone, Copy)]
pub(crate) struct BoxLanes<L> {
    pub(crate) origin: [L; 3],
    pub(crate) inverse: [L; 3],
}

/// Rays in both forms.
pub(crate) type Loaded<L> = (RayLanes<L>, BoxLanes<L>);

/// The rays of a batch, in f32 or in f64.
pub(crate) trait Rays: Copy {
    fn count(self) -> usize;

    /// Returns the rays from number `first` on; `frame` is that of the boxes.
    ///
    /// # Safety
    /// The processor has the instructions, and there are a ray per lane.
    #[inline(always)]
    unsafe fn load<L: Lanes>(self, first: usize, frame: Option<&Frame>) -> Loaded<L> {
        // SAFETY: the caller's, and no lane lacks a ray.
        unsafe { self.load_up_to(first, first + L::N, frame) }
    }

    /// Does the same; the last ray before `end` fills the lanes that have none.
    ///
    /// # Safety
    /// The processor has the instructions, and the rays from `first` to before `end` are some.
    unsafe fn load_up_to<L: Lanes>(
        self,
        first: usize,
        end: usize,
        frame: Option<&Frame>,
    ) -> Loaded<L>;

    /// Fetches the rays from number `first` on, as many as a vector's. They need not exist. While a
    /// packet is traced, the processor does not see that the rays of the next one follow.
    ///
    /// # Safety
    /// The processor has the instructions.
    unsafe fn prefetch<K: Instructions>(self, first: usize);
}

impl Rays for &[Ray] {
    #[inline(always)]
    fn count(self) -> usize {
        self.len()
    }

    #[inline(always)]
    unsafe fn load_up_to<L: Lanes>(
        self,
        first: usize,
        end: usize,
        frame: Option<&Frame>,
    ) -> Loaded<L> {
        // SAFETY: the rays exist, or the padding does; a ray is three vectors of four lanes.
        unsafe {
            let padded: [Ray; 16];
            let rays = if first + L::N <= end {
                self.as_ptr().add(first)
            } else {
                padded = core::array::from_fn(|i| self[(first + i).min(end - 1)]);
                padded.as_ptr()
            };
            let [ox, oy, oz, t_min] = transpose::<L>(rays, 0);
            let [dx, dy, dz, t_max] = transpose::<L>(rays, 1);
            let [ix, iy, iz, _] = transpose(rays, 2);
            let (origin, direction) = ([ox, oy, oz], [dx, dy, dz]);
            let boxed = match frame {
                None => BoxLanes { origin, inverse: [ix, iy, iz] },
                Some(frame) => {
                    let doubled = [ox.double(), oy.double(), oz.double()];
                    let along = [dx.double(), dy.double(), dz.double()];
                    in_frame::<L>(doubled, along, frame).1
                }
            };
            (RayLanes { origin, direction, t_min, t_max }, boxed)
        }
    }

    #[inline(always)]
    unsafe fn prefetch<K: Instructions>(self, first: usize) {
        let next = self.as_ptr().wrapping_add(first).cast::<u8>();
        // SAFETY: a prefetch may name any address.
        unsafe { K::prefetch_bytes(next, K::Rays::N * size_of::<Ray>()) };
    }
}

/// Returns the directions of rays in a frame, and what [`Frame::ray_of`] returns for every ray, but
/// for operations that are fused, and a division that three numbers share.
#[inline(always)]
pub(super) fn in_frame<L: Lanes>(
    [x, y, z]: [L::Double; 3],
    [dx, dy, dz]: [L::Double; 3],
    frame: &Frame,
) -> ([L; 3], BoxLanes<L>) {
    let centre = frame.centre;
    let x = x - x.filled(centre.x);
    let y = y - y.filled(centre.y);
    let z = z - z.filled(centre.z);
    let mut directions = [x; 3];
    let mut origin = [L::single(x); 3];
    for (axis, along) in frame.axes.iter().enumerate() {
        let ax = x.filled(along.x);
        let ay = x.filled(along.y);
        let az = x.filled(along.z);
        origin[axis] = L::single(z.mul_add(az, y.mul_add(ay, x * ax)));
        directions[axis] = dz.mul_add(az, dy.mul_add(ay, dx * ax));
    }
    let [dx, dy, dz] = directions;
    let above = x.filled(Frame::ABOVE);
    let product = dx * dy * dz;
    // One division instead of three, unless the ray is nearly parallel to an axis.
    let is_far_from_0 = L::narrow(x.filled(1e-250).le(product.abs())).bits();
    let inverses = if is_far_from_0 == u32::MAX >> (32 - L::N) {
        let inverse = above / product;
        [dy * dz * inverse, dz * dx * inverse, dx * dy * inverse]
    } else {
        [above / dx, above / dy, above / dz]
    };
    let mut boxed = BoxLanes { origin, inverse: origin };
    for (boxed, inverse) in boxed.inverse.iter_mut().zip(inverses) {
        let inverse = L::single(inverse);
        let most = inverse.filled(f32::MAX);
        *boxed = inverse.min(most).max(most.filled(f32::MIN));
    }
    ([L::single(dx), L::single(dy), L::single(dz)], boxed)
}

impl<L: Lanes> RayLanes<L> {
    /// The axes of the shear of rays that [cohere](BoxLanes::cohere).
    #[inline(always)]
    pub(crate) fn axes(&self) -> [usize; 3] {
        let (second, third) = self.largest();
        AXES[if third.bits() != 0 { 2 } else { usize::from(second.bits() != 0) }]
    }

    /// The rays whose direction is largest along y, and along z: the lowest axis on ties.
    #[inline(always)]
    pub(crate) fn largest(&self) -> (L::Mask, L::Mask) {
        let [x, y, z] = self.direction;
        let x = x.abs();
        let y = y.abs();
        let z = z.abs();
        let most = x.max(y);
        (x.lt(y) & z.le(most), most.lt(z))
    }

    /// Returns the largest coordinate of a point of `bounds` relative to each origin, rounded.
    #[inline(always)]
    pub(crate) fn reach(&self, bounds: &Aabb) -> L {
        let along = |axis: usize| {
            let origin = self.origin[axis];
            let (min, max) = (origin.filled(bounds.min[axis]), origin.filled(bounds.max[axis]));
            (max - origin).max(origin - min)
        };
        along(0).max(along(1)).max(along(2))
    }

    /// Returns the rays as triangles of a layout are tested with them.
    #[inline(always)]
    pub(crate) fn sheared(&self, [x, y, z]: [usize; 3], wide: &WideBvh) -> Pairs<L> {
        let Self { origin, direction, t_min, .. } = self;
        let reach = self.reach(&wide.bounds);
        Pairs::new(
            [origin[x], origin[y], origin[z]],
            [direction[x], direction[y], direction[z]],
            [direction[x] / direction[z], direction[y] / direction[z]],
            reach * reach.filled(wide.error_factor),
            *t_min,
        )
    }
}

impl<L: Lanes> BoxLanes<L> {
    /// Returns a bit per axis along which the first ray runs backwards.
    #[inline(always)]
    pub(crate) fn octant(&self) -> u32 {
        let [x, y, z] = self.inverse;
        x.signs() & 1 | (y.signs() & 1) << 1 | (z.signs() & 1) << 2
    }

    /// Returns a bit per ray that begins outside of a region.
    #[inline(always)]
    pub(crate) fn beyond(&self, region: &Aabb) -> u32 {
        let all = u32::MAX >> (32 - L::N);
        let mut inside = all;
        for axis in 0..3 {
            let origin = self.origin[axis];
            let (min, max) = (origin.filled(region.min[axis]), origin.filled(region.max[axis]));
            inside &= (min.le(origin) & origin.le(max)).bits();
        }
        all & !inside
    }

    /// Returns whether all of these `rays` begin in a region of the boxes, and run to the same sides
    /// of them, and mostly along the same axis of the triangles.
    #[inline(always)]
    pub(crate) fn cohere(&self, rays: &RayLanes<L>, region: &Aabb) -> bool {
        let all = u32::MAX >> (32 - L::N);
        let same = |mask: u32| mask == 0 || mask == all;
        let [x, y, z] = self.inverse;
        let (second, third) = rays.largest();
        same(x.signs())
            & same(y.signs())
            & same(z.signs())
            & same(second.bits())
            & same(third.bits())
            & (self.beyond(region) == 0)
    }
}

/// Returns one of the three vectors of rays, by component.
///
/// # Safety
/// The processor has the instructions, and there is a ray per lane.
#[inline(always)]
unsafe fn transpose<L: Lanes>(rays: *const Ray, vector: usize) -> [L; 4] {
    const STEP: usize = size_of::<Ray>() / 4;
    // SAFETY: vectors are aligned to four lanes; quarters beyond the lanes are not loaded.
    unsafe {
        let row = |i: usize| {
            let ray = rays.cast::<f32>().wrapping_add(4 * vector + i * STEP);
            L::load_quarters([0, 4, 8, 12].each(|other| ray.wrapping_add(other * STEP)))
        };
        L::transpose_quarters([row(0), row(1), row(2), row(3)])
    }
}

/// The extremes of many rays, lane by lane.
pub(crate) struct RayBounds<L> {
    lowest: [L; 3],
    highest: [L; 3],
    least: [L; 3],
    most: [L; 3],
    begin: L,
    end: L,
}

impl<L: Lanes> RayBounds<L> {
    #[inline(always)]
    pub(crate) unsafe fn none() -> Self {
        // SAFETY: the processor has the instructions.
        let (low, high) = unsafe { (L::splat(f32::NEG_INFINITY), L::splat(f32::INFINITY)) };
        Self {
            lowest: [high; 3],
            highest: [low; 3],
            least: [high; 3],
            most: [low; 3],
            begin: high,
            end: low,
        }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, rays: &RayLanes<L>, boxed: &BoxLanes<L>) {
        for (axis, (&origin, &inverse)) in boxed.origin.iter().zip(&boxed.inverse).enumerate() {
            self.lowest[axis] = self.lowest[axis].min(origin);
            self.highest[axis] = self.highest[axis].max(origin);
            self.least[axis] = self.least[axis].min(inverse);
            self.most[axis] = self.most[axis].max(inverse);
        }
        self.begin = self.begin.min(rays.t_min);
        self.end = self.end.max(rays.t_max);
    }

    #[inline(always)]
    pub(crate) fn origins(&self, axis: usize) -> [f32; 2] {
        [least(self.lowest[axis]), self.highest[axis].greatest()]
    }

    #[inline(always)]
    pub(crate) fn inverses(&self, axis: usize) -> [f32; 2] {
        [least(self.least[axis]), self.most[axis].greatest()]
    }

    #[inline(always)]
    pub(crate) fn begin(&self) -> f32 {
        least(self.begin)
    }

    #[inline(always)]
    pub(crate) fn end(&self) -> f32 {
        self.end.greatest()
    }
}

/// Returns the least number. None may be NaN.
#[inline(always)]
pub(super) fn least<L: Lanes>(lanes: L) -> f32 {
    -(lanes ^ lanes.filled(-0.0)).greatest()
}
