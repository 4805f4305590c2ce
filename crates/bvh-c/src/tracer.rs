//! Tracers: triangles in the wide layout, which answer batches of rays and points.

use crate::failure::{BvsStatus, Failure, given, given_mut, made, slice, slice_mut, status};
use crate::tree::{BvsObjects, BvsTree, kind, moved};
use bvh_search::OwnedTree;
use bvh_search::bvh_core::glam::DVec3;
use bvh_search::bvh_core::{Closest, InvalidRay, Traced};
use bvh_search::prelude::*;
use std::sync::{Arc, OnceLock};

/// Triangles in the wide layout. Any number of threads may trace rays at the same time. A thread
/// that updates or frees a tracer must be the only user.
pub struct BvsTracer {
    /// Instances share it.
    pub(crate) wide: Arc<WideBvh>,
    source: Arc<OwnedTree>,
    /// Made when it is first needed.
    solid: OnceLock<Solid>,
}

impl BvsTracer {
    fn triangles(&self) -> &[Triangle] {
        self.source.triangles().unwrap_or(&[])
    }
}

/// The points `origin` + t * `direction` with `t_min` <= t <= `t_max`. The direction may have any
/// length except 0; `t_min` is 0 or more; `t_max` may be infinite.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BvsRay {
    /// The point with t = 0.
    pub origin: [f32; 3],
    /// The smallest distance.
    pub t_min: f32,
    /// The vector from the origin to the point with t = 1.
    pub direction: [f32; 3],
    /// The largest distance.
    pub t_max: f32,
}

impl BvsRay {
    fn check(&self) -> Result<(), InvalidRay> {
        Ray::new(self.origin, self.direction, self.t_min, self.t_max).map(drop)
    }

    /// Converts a ray that has been checked. To pass on the ray of the check would copy it, right
    /// behind the stores of its parts, which costs a ray 10 ns.
    fn checked(&self) -> Ray {
        Ray::assume_valid(self.origin, self.direction, self.t_min, self.t_max)
    }
}

/// The nearest triangle that a ray hits; of several at the same distance, the triangle with the
/// lowest index. A ray without a hit has infinity and UINT32_MAX.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvsHit {
    /// The distance, in multiples of the direction's length.
    pub t: f32,
    /// The index of the triangle.
    pub object: u32,
}

// Batches write the library's hits as these.
same_layout!(BvsHit, Hit, t, object);

/// A hit with the surface there. Without a hit, `t` is infinity, `object` is UINT32_MAX, and all
/// other numbers are 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvsSurfaceHit {
    /// The distance, in multiples of the direction's length.
    pub t: f32,
    /// The index of the triangle.
    pub object: u32,
    /// The weight of the triangle's second corner.
    pub u: f32,
    /// The weight of the triangle's third corner.
    pub v: f32,
    /// The unit vector perpendicular to the triangle, on the side from which its corners run
    /// counterclockwise.
    pub normal: [f32; 3],
}

/// The point of the triangles that is closest to a given point. Without one, `distance` is
/// infinity, `object` is UINT32_MAX, and the point is NaN.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvsClosest {
    /// The closest point.
    pub point: [f64; 3],
    /// Its distance from the given point.
    pub distance: f64,
    /// The index of the triangle; of several at the same distance, the lowest.
    pub object: u32,
}

impl From<Option<Closest>> for BvsClosest {
    fn from(closest: Option<Closest>) -> Self {
        let none = Closest { object: u32::MAX, point: DVec3::NAN, distance: f64::INFINITY };
        let Closest { object, point, distance } = closest.unwrap_or(none);
        Self { point: point.to_array(), distance, object }
    }
}

/// Creates a tracer of a tree over triangles. The tracer is independent of the tree: the tree may
/// be freed, and later improvements do not change the tracer.
///
/// `tree` is a tree.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_new(tree: *const BvsTree) -> *mut BvsTracer {
    made(|| {
        // SAFETY: the caller keeps the tree alive and unchanged during the call.
        let owned = &unsafe { given("tree", tree) }?.owned;
        let Some(wide) = owned.layout() else {
            let accepted = "accepted: a tree over `vertices`";
            return Err(Failure::invalid(format!("tree is over {}; {accepted}", kind(owned))));
        };
        let wide = Arc::new(wide.map_err(Failure::invalid)?);
        Ok(BvsTracer { wide, source: owned.clone(), solid: OnceLock::new() })
    })
}

/// Moves the triangles of a tracer: as many as it has, elsewhere. Answers are those of a new
/// tracer, which takes about twice as long; rays become slower as neighbours part, and at once where
/// the tree divides triangles: bake with `references` = 1 what moves. Triangles with an area still
/// have one, and others none, or the call fails. Instances of the tracer remain as they are.
///
/// `tracer` is a tracer that no other thread uses; `objects` are triangles whose arrays have the
/// promised lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_update(
    tracer: *mut BvsTracer,
    objects: *const BvsObjects,
) -> BvsStatus {
    status(|| {
        // SAFETY: no other thread uses the tracer during the call.
        let tracer = unsafe { given_mut("tracer", tracer) }?;
        // SAFETY: `objects` is null or points to objects whose arrays have the promised lengths.
        let source = unsafe { moved(&tracer.source, objects) }?;
        let triangles = source.triangles().unwrap_or(&[]);
        Arc::make_mut(&mut tracer.wide).refit(triangles).map_err(Failure::invalid)?;
        tracer.solid = OnceLock::new();
        tracer.source = Arc::new(source);
        Ok(())
    })
}

/// Writes the nearest hit of one ray to `hit`. Dozens of rays at once are faster in
/// `bvs_tracer_nearest_hits`.
///
/// `tracer` is a tracer; `ray` points to a ray, and `hit` to a hit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_nearest(
    tracer: *const BvsTracer,
    ray: *const BvsRay,
    hit: *mut BvsHit,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer and the ray during the call; nobody changes them.
        let (tracer, ray) = unsafe { (given("tracer", tracer)?, given("ray", ray)?) };
        ray.check().map_err(Failure::invalid)?;
        // SAFETY: `hit` points to a hit that nobody else uses during the call.
        let hit = unsafe { given_mut("hit", hit) }?;
        let Hit { t, object } = tracer.wide.nearest_hit(&ray.checked()).unwrap_or(Hit::MISS);
        *hit = BvsHit { t, object };
        Ok(())
    })
}

/// Writes to `hit` whether one ray hits any triangle: 1 or 0. Dozens of rays at once are faster in
/// `bvs_tracer_any_hits`.
///
/// `tracer` is a tracer; `ray` points to a ray, and `hit` to a byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_any(
    tracer: *const BvsTracer,
    ray: *const BvsRay,
    hit: *mut u8,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer and the ray during the call; nobody changes them.
        let (tracer, ray) = unsafe { (given("tracer", tracer)?, given("ray", ray)?) };
        ray.check().map_err(Failure::invalid)?;
        // SAFETY: `hit` points to a byte that nobody else uses during the call.
        *unsafe { given_mut("hit", hit) }? = u8::from(tracer.wide.any_hit(&ray.checked()));
        Ok(())
    })
}

/// Writes the nearest hits of `count` rays to `hits`. Set `coherent` to 1 if consecutive rays begin
/// close to each other and have similar directions, and to 0 otherwise. It changes the speed and no
/// answer.
///
/// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, and do not overlap.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_nearest_hits(
    tracer: *const BvsTracer,
    rays: *const BvsRay,
    count: usize,
    coherent: i32,
    hits: *mut BvsHit,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer and `count` rays during the call; nobody changes them.
        let (tracer, rays) = unsafe { (given("tracer", tracer)?, slice("rays", rays, count)?) };
        // SAFETY: `hits` points to `count` elements that nobody else uses during the call.
        let hits = unsafe { slice_mut("hits", hits.cast::<Hit>(), count) }?;
        in_batches(rays, |start, rays| {
            let hits = &mut hits[start..start + rays.len()];
            tracer.wide.nearest_hits(rays, hits, coherence(coherent));
        })
    })
}

/// Writes to `hits` whether each of `count` rays hits any triangle: 1 or 0. `coherent` has the
/// meaning that it has in `bvs_tracer_nearest_hits`.
///
/// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, and do not overlap.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_any_hits(
    tracer: *const BvsTracer,
    rays: *const BvsRay,
    count: usize,
    coherent: i32,
    hits: *mut u8,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer and `count` rays during the call; nobody changes them.
        let (tracer, rays) = unsafe { (given("tracer", tracer)?, slice("rays", rays, count)?) };
        // SAFETY: `hits` points to `count` elements that nobody else uses during the call.
        let hits = unsafe { slice_mut("hits", hits, count) }?;
        flags_in_batches(rays, hits, |rays, hits| {
            tracer.wide.any_hits(rays, hits, coherence(coherent));
        })
    })
}

/// Writes the nearest hits of `count` rays with the surfaces there to `hits`. `coherent` has the
/// meaning that it has in `bvs_tracer_nearest_hits`.
///
/// `tracer` is a tracer; `rays` and `hits` point to `count` elements each, and do not overlap.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_surface_hits(
    tracer: *const BvsTracer,
    rays: *const BvsRay,
    count: usize,
    coherent: i32,
    hits: *mut BvsSurfaceHit,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer and `count` rays during the call; nobody changes them.
        let (tracer, rays) = unsafe { (given("tracer", tracer)?, slice("rays", rays, count)?) };
        // SAFETY: `hits` points to `count` elements that nobody else uses during the call.
        let hits = unsafe { slice_mut("hits", hits, count) }?;
        let mut found = vec![Hit::MISS; count.min(BATCH)];
        in_batches(rays, |start, rays| {
            let found = &mut found[..rays.len()];
            tracer.wide.nearest_hits(rays, found, coherence(coherent));
            for ((to, ray), &Hit { t, object }) in hits[start..].iter_mut().zip(rays).zip(&*found) {
                let triangle = tracer.triangles().get(object as usize);
                let weights = triangle.and_then(|triangle| triangle.barycentrics(ray));
                let normal = triangle.and_then(Triangle::normal);
                let [_, u, v] = weights.unwrap_or_default().map(|weight| weight as f32);
                *to = BvsSurfaceHit {
                    t,
                    object,
                    u,
                    v,
                    normal: normal.unwrap_or_default().to_array(),
                };
            }
        })
    })
}

/// Writes all crossings of `count` rays to `hits`, ray after ray and the nearest first, the number
/// of each ray's hits to `counts`, and the number of all hits to `total`. Hits at the same distance
/// are in the order of their triangles. Each crossing of the surface counts once, although
/// triangles share edges and corners: a ray that touches one counts there as a ray beside it would,
/// which may hit another of these triangles than `bvs_nearest` returns, or none. Only the first
/// `capacity` hits are written; if `total` is greater, call again with room for them.
///
/// `tracer` is a tracer; `rays` and `counts` point to `count` elements each, `hits` points to
/// `capacity` elements, and `total` points to a size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_all_hits(
    tracer: *const BvsTracer,
    rays: *const BvsRay,
    count: usize,
    hits: *mut BvsHit,
    capacity: usize,
    counts: *mut u32,
    total: *mut usize,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer and `count` rays during the call; nobody changes them.
        let (tracer, rays) = unsafe { (given("tracer", tracer)?, slice("rays", rays, count)?) };
        // SAFETY: `hits` points to `capacity` elements that nobody else uses during the call.
        let hits = unsafe { slice_mut("hits", hits.cast::<Hit>(), capacity) }?;
        // SAFETY: `counts` points to `count` elements that nobody else uses during the call.
        let counts = unsafe { slice_mut("counts", counts, count) }?;
        // SAFETY: `total` points to a size that nobody else uses during the call.
        let total = unsafe { slice_mut("total", total, 1) }?;
        let mut found = Vec::new();
        let mut written = 0;
        in_batches(rays, |start, rays| {
            found.clear();
            let counts = &mut counts[start..start + rays.len()];
            tracer.wide.all_hits_of(rays, &mut found, counts);
            let room = hits.get_mut(written..).unwrap_or_default();
            let count = room.len().min(found.len());
            room[..count].copy_from_slice(&found[..count]);
            written += found.len();
        })?;
        total[0] = written;
        Ok(())
    })
}

/// Writes the closest points of the triangles to `count` points, 3 floats each. Triangles without
/// area do not count.
///
/// `tracer` is a tracer; `points` points to 3 * `count` floats, and `closest` to `count` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_closest_points(
    tracer: *const BvsTracer,
    points: *const f32,
    count: usize,
    closest: *mut BvsClosest,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer alive during the call; nobody changes a tracer.
        let tracer = unsafe { given("tracer", tracer) }?;
        // SAFETY: `points` points to 3 floats for each of `count` points.
        let points = unsafe { slice("points", points.cast::<Vec3>(), count) }?;
        // SAFETY: `closest` points to `count` elements that nobody else uses during the call.
        let closest = unsafe { slice_mut("closest", closest, count) }?;
        let mut found = [None; BATCH];
        for (points, closest) in points.chunks(BATCH).zip(closest.chunks_mut(BATCH)) {
            let found = &mut found[..points.len()];
            tracer.wide.closest_points(points, found);
            for (to, closest) in closest.iter_mut().zip(&*found) {
                *to = (*closest).into();
            }
        }
        Ok(())
    })
}

/// Writes to `inside` whether each of `count` points, 3 floats each, is inside of the mesh: 1 or 0.
/// A mesh with holes has an inside, too: there the generalised winding number decides, at a hundred
/// times the cost, and near an open terrain, where it is nearly one half everywhere, at the cost of
/// most triangles. A point on the surface of a mesh without holes counts as one a little below it in
/// x, far less above it in y, and again less in z: where meshes share faces, it is in one of them.
/// On other surfaces it may count as either. The first call for a tracer examines all edges.
///
/// `tracer` is a tracer; `points` points to 3 * `count` floats, and `inside` to `count` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_contains(
    tracer: *const BvsTracer,
    points: *const f32,
    count: usize,
    inside: *mut u8,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer alive during the call; nobody changes a tracer.
        let tracer = unsafe { given("tracer", tracer) }?;
        let solid =
            tracer.solid.get_or_init(|| Solid::new(tracer.source.tree(), tracer.triangles()));
        // SAFETY: there are 3 floats for each of `count` points, and as many bytes.
        unsafe { contained(solid, &*tracer.wide, points.cast::<Vec3>(), count, inside) }
    })
}

/// Writes whether each of `count` points is inside.
///
/// # Safety
/// Both arrays have `count` elements that nobody else uses during the call.
pub(crate) unsafe fn contained<L: Traced>(
    solid: &Solid,
    wide: &L,
    points: *const L::Point,
    count: usize,
    inside: *mut u8,
) -> Result<(), Failure> {
    // SAFETY: what the caller promises.
    let (points, inside) =
        unsafe { (slice("points", points, count)?, slice_mut("inside", inside, count)?) };
    let mut found = [false; BATCH];
    for (points, inside) in points.chunks(BATCH).zip(inside.chunks_mut(BATCH)) {
        let found = &mut found[..points.len()];
        solid.contains(wide, points, InsideRule::Auto, found);
        for (to, &is_inside) in inside.iter_mut().zip(&*found) {
            *to = u8::from(is_inside);
        }
    }
    Ok(())
}

/// Frees a tracer. Ignores null.
///
/// `tracer` is null, or a tracer that nobody uses any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_free(tracer: *mut BvsTracer) {
    if !tracer.is_null() {
        // SAFETY: `made` has created the pointer from a box, and the caller frees it once.
        drop(unsafe { Box::from_raw(tracer) });
    }
}

/// The number of rays that are converted and traced at once: enough to make the cost of a call
/// negligible, and few enough to stay in the cache.
pub(crate) const BATCH: usize = 512;

pub(crate) fn coherence(coherent: i32) -> Coherence {
    if coherent != 0 { Coherence::Coherent } else { Coherence::Incoherent }
}

/// Passes all rays to `trace`, batch by batch, with the index of each batch's first ray. Passes
/// none if one of the rays is invalid.
pub(crate) fn in_batches(
    rays: &[BvsRay],
    mut trace: impl FnMut(usize, &[Ray]),
) -> Result<(), Failure> {
    // All rays are checked first, because a failed call must not change `hits`.
    for (index, ray) in rays.iter().enumerate() {
        ray.check().map_err(|error| Failure::invalid(format!("rays[{index}]: {error}")))?;
    }
    let mut batch = Vec::with_capacity(rays.len().min(BATCH));
    for (number, rays) in rays.chunks(BATCH).enumerate() {
        batch.clear();
        batch.extend(rays.iter().map(BvsRay::checked));
        trace(number * BATCH, &batch);
    }
    Ok(())
}

/// Passes all rays like [`in_batches`], and turns the answers of `trace` into bytes.
pub(crate) fn flags_in_batches(
    rays: &[BvsRay],
    flags: &mut [u8],
    mut trace: impl FnMut(&[Ray], &mut [bool]),
) -> Result<(), Failure> {
    let mut found = [false; BATCH];
    in_batches(rays, |start, rays| {
        let found = &mut found[..rays.len()];
        trace(rays, found);
        for (to, &is_hit) in flags[start..].iter_mut().zip(&*found) {
            *to = u8::from(is_hit);
        }
    })
}
