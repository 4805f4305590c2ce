//! Tracers: triangles in the wide layout, which answer batches of rays.

use crate::failure::{BvhStatus, Failure, given, made, slice, slice_mut, status};
use crate::tree::BvhTree;
use bvh_search::prelude::*;

/// Triangles in the wide layout. Any number of threads may use a tracer at the same time.
pub struct BvhTracer(WideBvh);

/// The points `origin` + t * `direction` with `t_min` <= t <= `t_max`. The direction may have any
/// length except 0; `t_min` is 0 or more; `t_max` may be infinite.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BvhRay {
    /// The point with t = 0.
    pub origin: [f32; 3],
    /// The smallest distance.
    pub t_min: f32,
    /// The vector from the origin to the point with t = 1.
    pub direction: [f32; 3],
    /// The largest distance.
    pub t_max: f32,
}

/// The nearest triangle that a ray hits; of several at the same distance, the triangle with the
/// lowest index. A ray without a hit has infinity and UINT32_MAX.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhHit {
    /// The distance, in multiples of the direction's length.
    pub t: f32,
    /// The index of the triangle.
    pub object: u32,
}

/// Creates a tracer of a tree over triangles. The tracer is independent of the tree: the tree may
/// be freed, and later improvements do not change the tracer.
///
/// `tree` is a tree.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tracer_new(tree: *const BvhTree) -> *mut BvhTracer {
    made(|| {
        // SAFETY: the caller keeps the tree alive and unchanged during the call.
        let owned = &unsafe { given("tree", tree) }?.owned;
        let Some(triangles) = owned.triangles() else {
            return Err(Failure::invalid("tree is over boxes; accepted: a tree over triangles"));
        };
        WideBvh::new(owned.tree(), triangles)
            .map(BvhTracer)
            .map_err(Failure::invalid)
    })
}

/// Writes the nearest hits of `count` rays to `hits`. Set `coherent` to 1 if consecutive rays begin
/// close to each other and have similar directions, and to 0 otherwise. It changes the speed and no
/// answer.
///
/// `tracer` is a tracer; `rays` and `hits` point to `count` elements each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tracer_nearest_hits(
    tracer: *const BvhTracer,
    rays: *const BvhRay,
    count: usize,
    coherent: i32,
    hits: *mut BvhHit,
) -> BvhStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer alive during the call; nobody changes a tracer.
        let tracer = unsafe { given("tracer", tracer) }?;
        // SAFETY: `rays` points to `count` elements that nobody changes during the call.
        let rays = unsafe { slice("rays", rays, count) }?;
        // SAFETY: `hits` points to `count` elements that nobody else uses during the call.
        let hits = unsafe { slice_mut("hits", hits, count) }?;
        let mut found = [Hit::MISS; BATCH];
        in_batches(rays, |start, rays| {
            let found = &mut found[..rays.len()];
            tracer
                .0
                .nearest_hits(rays, found, coherence(coherent));
            for (to, &Hit { t, object }) in hits[start..].iter_mut().zip(&*found) {
                *to = BvhHit { t, object };
            }
        })
    })
}

/// Writes to `hits` whether each of `count` rays hits any triangle: 1 or 0. `coherent` has the
/// meaning that it has in `bvh_tracer_nearest_hits`.
///
/// `tracer` is a tracer; `rays` and `hits` point to `count` elements each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tracer_any_hits(
    tracer: *const BvhTracer,
    rays: *const BvhRay,
    count: usize,
    coherent: i32,
    hits: *mut u8,
) -> BvhStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer alive during the call; nobody changes a tracer.
        let tracer = unsafe { given("tracer", tracer) }?;
        // SAFETY: `rays` points to `count` elements that nobody changes during the call.
        let rays = unsafe { slice("rays", rays, count) }?;
        // SAFETY: `hits` points to `count` elements that nobody else uses during the call.
        let hits = unsafe { slice_mut("hits", hits, count) }?;
        let mut found = [false; BATCH];
        in_batches(rays, |start, rays| {
            let found = &mut found[..rays.len()];
            tracer
                .0
                .any_hits(rays, found, coherence(coherent));
            for (to, &hit) in hits[start..].iter_mut().zip(&*found) {
                *to = u8::from(hit);
            }
        })
    })
}

/// Frees a tracer. Ignores null.
///
/// `tracer` is null, or a tracer that nobody uses any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tracer_free(tracer: *mut BvhTracer) {
    if !tracer.is_null() {
        // SAFETY: `made` has created the pointer from a box, and the caller frees it once.
        drop(unsafe { Box::from_raw(tracer) });
    }
}

/// The number of rays that are converted and traced at once: enough to make the cost of a call
/// negligible, and few enough to stay in the cache.
const BATCH: usize = 512;

fn coherence(coherent: i32) -> Coherence {
    if coherent != 0 { Coherence::Coherent } else { Coherence::Incoherent }
}

/// Passes all rays to `trace`, batch by batch, with the index of each batch's first ray. Passes
/// none if one of the rays is invalid.
fn in_batches(rays: &[BvhRay], mut trace: impl FnMut(usize, &[Ray])) -> Result<(), Failure> {
    // All rays are checked first, because a failed call must not change `hits`.
    for (index, ray) in rays.iter().enumerate() {
        Ray::new(ray.origin, ray.direction, ray.t_min, ray.t_max)
            .map_err(|error| Failure::invalid(format!("rays[{index}]: {error}")))?;
    }
    let mut batch = Vec::with_capacity(BATCH);
    for (number, rays) in rays.chunks(BATCH).enumerate() {
        batch.clear();
        batch.extend(
            rays.iter()
                .map(|ray| Ray::assume_valid(ray.origin, ray.direction, ray.t_min, ray.t_max)),
        );
        trace(number * BATCH, &batch);
    }
    Ok(())
}
