//! Tracers in f64, which select what counts by its side and by its id.

use crate::failure::{
    BvsStatus, Failure, given, given_mut, made, slice, slice_mut, status, strided, strided_mut,
};
use crate::tracer::{BATCH, BvsClosest, coherence, contained};
use crate::tree::BvsTree;
use bvh_search::OwnedTree;
use bvh_search::bvh_core::glam::DVec3;
use bvh_search::bvh_core::{DHit, DRay, DWideBvh, Orientation, OutOfExactRange, Select, Solid};
use std::sync::{Arc, OnceLock};

/// Triangles in f64 in the wide layout. Any number of threads may trace rays at the same time. A
/// thread that frees a tracer must be the only user.
pub struct BvsTracerF64 {
    pub(crate) wide: DWideBvh,
    source: Arc<OwnedTree>,
    /// Made when it is first needed.
    solid: OnceLock<Solid>,
}

/// The points `origin` + t * `direction` with `t_min` <= t <= `t_max`. The direction may have any
/// length except 0; `t_min` is 0 or more; `t_max` may be infinite. Coordinates are at most 2^120 in
/// size, below 2^-150 they count as 0, and the largest component of a direction is from 2^-100 to
/// 2^100.
///
/// A ray hits a triangle if they meet in real arithmetic at the origin or in front of it, and the
/// real distance, rounded once, is from `t_min` to `t_max`. Edges and corners belong to a triangle:
/// where triangles share them, a ray hits all.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BvsRayF64 {
    /// The point with t = 0.
    pub origin: [f64; 3],
    /// The smallest distance.
    pub t_min: f64,
    /// The vector from the origin to the point with t = 1.
    pub direction: [f64; 3],
    /// The largest distance.
    pub t_max: f64,
}

impl BvsRayF64 {
    fn ray(&self) -> Result<DRay, OutOfExactRange> {
        DRay::new(self.origin, self.direction, self.t_min, self.t_max)
    }
}

/// The nearest triangle that a ray hits, as in `BvsHit`. The distance is the real one, rounded
/// once.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvsHitF64 {
    /// The distance, in multiples of the direction's length.
    pub t: f64,
    /// The index of the triangle.
    pub object: u32,
}

impl From<Option<DHit>> for BvsHitF64 {
    fn from(hit: Option<DHit>) -> Self {
        let DHit { t, object } = hit.unwrap_or(DHit { t: f64::INFINITY, object: u32::MAX });
        Self { t, object }
    }
}

/// The side from which a ray comes to a triangle.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BvsOrientation {
    /// Either side. A ray in the plane of a triangle never hits it, whatever the orientation.
    Any = 0,
    /// Along the normal, on whose side the corners run counterclockwise: the ray leaves a solid.
    /// Each crossing of the surface counts once, as in `bvs_tracer_all_hits`: a ray that touches an
    /// edge or a corner enters as often as it leaves.
    Exiting = 1,
    /// Against the normal: the ray enters a solid. Crossings count in the same way.
    Entering = 2,
}

/// Which triangles count.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BvsSelect {
    /// One of `BvsOrientation`.
    pub orientation: u32,
    /// The number of ids in `excluded` for each ray.
    pub excluded_count: u32,
    /// The indices of triangles that do not count, `excluded_count` for each ray. Those that no
    /// triangle has, such as UINT32_MAX, are ignored.
    ///
    /// A particle that flies on in its direction keeps its origin: `t_min` becomes the distance of
    /// the last hit, and all triangles met at this distance are excluded, not only the last, because
    /// an edge has several. A ray from the hit point, which is rounded, may miss the next triangle.
    pub excluded: *const u32,
}

/// Returns what counts for `count` rays.
///
/// # Safety
/// `select` is null, or points to what counts, with ids for `count` rays that nobody changes while
/// the result is in use.
unsafe fn selected<'a>(select: *const BvsSelect, count: usize) -> Result<Select<'a>, Failure> {
    if select.is_null() {
        return Ok(Select::default());
    }
    // SAFETY: what the caller promises.
    let BvsSelect { orientation, excluded_count, excluded } = *unsafe { given("select", select) }?;
    let sides = [
        (BvsOrientation::Any, Orientation::Any),
        (BvsOrientation::Exiting, Orientation::Exiting),
        (BvsOrientation::Entering, Orientation::Entering),
    ];
    let Some((_, orientation)) = sides.into_iter().find(|side| side.0 as u32 == orientation) else {
        return Err(Failure::invalid(format!("orientation is {orientation}; accepted: 0 to 2")));
    };
    let ids = count.saturating_mul(excluded_count as usize);
    // SAFETY: what the caller promises.
    Ok(Select { orientation, exclude: unsafe { slice("excluded", excluded, ids) }? })
}

/// Creates a tracer of a tree over triangles in f64. The tracer is independent of the tree.
///
/// `tree` is a tree.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_f64_new(tree: *const BvsTree) -> *mut BvsTracerF64 {
    made(|| {
        // SAFETY: the caller keeps the tree alive and unchanged during the call.
        let source = unsafe { given("tree", tree) }?.owned.clone();
        let Some(triangles) = source.doubles() else {
            return Err(Failure::invalid("tree is not over `vertices_f64`; accepted: such a tree"));
        };
        let wide = DWideBvh::new(source.tree(), triangles).map_err(Failure::invalid)?;
        Ok(BvsTracerF64 { wide, source, solid: OnceLock::new() })
    })
}

/// Writes the nearest hit of one ray to `hit`. Dozens of rays at once are faster in
/// `bvs_tracer_nearest_hits_f64`.
///
/// `tracer` is a tracer; `ray` points to a ray, and `hit` to a hit; `select` is null, or what
/// counts.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_nearest_f64(
    tracer: *const BvsTracerF64,
    ray: *const BvsRayF64,
    select: *const BvsSelect,
    hit: *mut BvsHitF64,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps all three alive during the call, and nobody changes them; `select`
        // is null or what counts for a ray.
        let (tracer, ray, select) =
            unsafe { (given("tracer", tracer)?, given("ray", ray)?, selected(select, 1)?) };
        let ray = ray.ray().map_err(Failure::invalid)?;
        // SAFETY: `hit` points to a hit that nobody else uses during the call.
        *unsafe { given_mut("hit", hit) }? = tracer.wide.nearest_hit(&ray, select).into();
        Ok(())
    })
}

/// Writes to `hit` whether one ray hits any triangle that counts: 1 or 0. Dozens of rays at once
/// are faster in `bvs_tracer_any_hits_f64`.
///
/// `tracer` is a tracer; `ray` points to a ray, and `hit` to a byte; `select` is null, or what
/// counts.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_any_f64(
    tracer: *const BvsTracerF64,
    ray: *const BvsRayF64,
    select: *const BvsSelect,
    hit: *mut u8,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps all three alive during the call, and nobody changes them; `select`
        // is null or what counts for a ray.
        let (tracer, ray, select) =
            unsafe { (given("tracer", tracer)?, given("ray", ray)?, selected(select, 1)?) };
        let ray = ray.ray().map_err(Failure::invalid)?;
        // SAFETY: `hit` points to a byte that nobody else uses during the call.
        *unsafe { given_mut("hit", hit) }? = u8::from(tracer.wide.any_hit(&ray, select));
        Ok(())
    })
}

/// Writes the nearest hits of `count` rays to `hits`. A ray begins `ray_stride` bytes after the one
/// before, and a hit `hit_stride` bytes: multiples of 8; 0 is right behind it. `coherent` has the
/// meaning that it has in `bvs_tracer_nearest_hits`.
///
/// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, which do not overlap;
/// `select` is null, or what counts.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_nearest_hits_f64(
    tracer: *const BvsTracerF64,
    rays: *const BvsRayF64,
    ray_stride: usize,
    count: usize,
    coherent: i32,
    select: *const BvsSelect,
    hits: *mut BvsHitF64,
    hit_stride: usize,
) -> BvsStatus {
    status(|| {
        // SAFETY: what the caller promises.
        let tracer = unsafe { given("tracer", tracer) }?;
        let trace = |wide: &DWideBvh, rays: &[DRay], select: Select<'_>, hits: &mut [_]| {
            wide.nearest_hits(rays, select, hits, coherence(coherent));
        };
        // SAFETY: there are `count` rays and hits at these distances.
        unsafe { in_batches(tracer, (rays, ray_stride), count, select, (hits, hit_stride), trace) }
    })
}

/// Writes to `hits` whether each of `count` rays hits any triangle that counts: 1 or 0. Strides are
/// those of `bvs_tracer_nearest_hits_f64`; that of `hits` is any number of bytes.
///
/// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, which do not overlap;
/// `select` is null, or what counts.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_any_hits_f64(
    tracer: *const BvsTracerF64,
    rays: *const BvsRayF64,
    ray_stride: usize,
    count: usize,
    coherent: i32,
    select: *const BvsSelect,
    hits: *mut u8,
    hit_stride: usize,
) -> BvsStatus {
    status(|| {
        // SAFETY: what the caller promises.
        let tracer = unsafe { given("tracer", tracer) }?;
        let trace = |wide: &DWideBvh, rays: &[DRay], select: Select<'_>, hits: &mut [_]| {
            wide.any_hits(rays, select, hits, coherence(coherent));
        };
        // SAFETY: there are `count` rays and bytes at these distances.
        unsafe { in_batches(tracer, (rays, ray_stride), count, select, (hits, hit_stride), trace) }
    })
}

/// Writes the closest points of the triangles to `count` points, 3 doubles each, as
/// `bvs_tracer_closest_points` does.
///
/// `tracer` is a tracer; `points` points to 3 * `count` doubles, and `closest` to `count` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_closest_points_f64(
    tracer: *const BvsTracerF64,
    points: *const f64,
    count: usize,
    closest: *mut BvsClosest,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer alive during the call; nobody changes a tracer.
        let tracer = unsafe { given("tracer", tracer) }?;
        // SAFETY: `points` points to 3 doubles for each of `count` points.
        let points = unsafe { slice("points", points.cast::<[f64; 3]>(), count) }?;
        // SAFETY: `closest` points to `count` elements that nobody else uses during the call.
        let closest = unsafe { slice_mut("closest", closest, count) }?;
        for (to, &point) in closest.iter_mut().zip(points) {
            *to = tracer.wide.closest_point(point).into();
        }
        Ok(())
    })
}

/// Writes to `inside` whether each of `count` points, 3 doubles each, is inside of the mesh: 1 or 0,
/// as `bvs_tracer_contains` does.
///
/// `tracer` is a tracer; `points` points to 3 * `count` doubles, and `inside` to `count` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_contains_f64(
    tracer: *const BvsTracerF64,
    points: *const f64,
    count: usize,
    inside: *mut u8,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer alive during the call; nobody changes a tracer.
        let BvsTracerF64 { wide, source, solid } = unsafe { given("tracer", tracer) }?;
        let triangles = source.doubles().unwrap_or(&[]);
        let solid = solid.get_or_init(|| Solid::new(source.tree(), triangles));
        // SAFETY: there are 3 doubles for each of `count` points, and as many bytes.
        unsafe { contained(solid, wide, points.cast::<DVec3>(), count, inside) }
    })
}

/// Frees a tracer. Ignores null.
///
/// `tracer` is null, or a tracer that nobody uses any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_f64_free(tracer: *mut BvsTracerF64) {
    if !tracer.is_null() {
        // SAFETY: `made` has created the pointer from a box, and the caller frees it once.
        drop(unsafe { Box::from_raw(tracer) });
    }
}

/// Passes all rays to `trace`, batch by batch, and writes the answers. Passes none if one of the
/// rays is invalid.
///
/// # Safety
/// There are `count` rays and answers at these distances, and `select` is null, or what counts for
/// as many rays.
unsafe fn in_batches<A: Copy + Default, B: From<A>>(
    tracer: &BvsTracerF64,
    (rays, ray_stride): (*const BvsRayF64, usize),
    count: usize,
    select: *const BvsSelect,
    (answers, stride): (*mut B, usize),
    trace: impl Fn(&DWideBvh, &[DRay], Select, &mut [A]),
) -> Result<(), Failure> {
    // SAFETY: what the caller promises.
    let (rays, select, write) = unsafe {
        let rays = strided("rays", rays, count, ray_stride)?;
        (rays, selected(select, count)?, strided_mut("hits", answers, count, stride)?)
    };
    let ray = |index: usize| {
        let ray = rays(index).ok_or_else(|| Failure::invalid("rays are too few"))?;
        ray.ray().map_err(|error| Failure::invalid(format!("rays[{index}]: {error}")))
    };
    // All rays are checked first, because a failed call must not change `hits`.
    (0..count).try_for_each(|index| ray(index).map(drop))?;
    let mut found = [A::default(); BATCH];
    for first in (0..count).step_by(BATCH) {
        let numbers = first..count.min(first + BATCH);
        let batch = numbers.clone().map(&ray).collect::<Result<Vec<DRay>, _>>()?;
        let excluded = select.exclude.len() / count;
        let exclude = &select.exclude[excluded * numbers.start..excluded * numbers.end];
        let found = &mut found[..batch.len()];
        trace(&tracer.wide, &batch, Select { exclude, ..select }, found);
        for (number, &answer) in numbers.zip(&*found) {
            write(number, answer.into());
        }
    }
    Ok(())
}
