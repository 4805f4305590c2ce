//! Tracers: triangles in the wide layout, asked for nearest and for any hits by batches of rays.

use crate::failure::{BvhStatus, Failure, given, made, slice, slice_mut, status};
use crate::tree::BvhTree;
use bvh_search::prelude::*;

/// Triangles in the wide layout. Any number of threads may trace one at the same time.
pub struct BvhTracer(WideBvh);

/// The points `origin` + t * `direction` with `t_min` <= t <= `t_max`. The direction need not have length 1; `t_min` is 0 or more;
/// `t_max` may be infinite.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BvhRay {
    /// Where t is 0.
    pub origin: [f32; 3],
    /// Smallest distance.
    pub t_min: f32,
    /// The step by which t counts.
    pub direction: [f32; 3],
    /// Largest distance.
    pub t_max: f32,
}

/// The nearest triangle that a ray meets, of several at the same distance the one of the lowest index; infinity and
/// UINT32_MAX if there is none.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhHit {
    /// The distance, in multiples of the direction's length.
    pub t: f32,
    /// Index of the triangle.
    pub object: u32,
}

/// Lays out a tree that was made from triangles. The tracer needs the tree no longer, and does not follow its changes.
///
/// `tree` is a tree.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tracer_new(tree: *const BvhTree) -> *mut BvhTracer {
    made(|| {
        // SAFETY: promised by the caller.
        let owned = &unsafe { given("tree", tree) }?.owned;
        let refused = || Failure::invalid("tree is over boxes; accepted: a tree over triangles");
        let triangles = owned.triangles().ok_or_else(refused)?;
        WideBvh::new(owned.tree(), triangles)
            .map(BvhTracer)
            .map_err(Failure::invalid)
    })
}

/// The nearest hits of `count` rays, into as many `hits`. `coherent` is not 0 where consecutive rays begin close to each other and run the
/// same way, which makes them faster and changes no answer.
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
        // SAFETY: promised by the caller.
        let (tracer, rays) = unsafe { (given("tracer", tracer)?, slice("rays", rays, count)?) };
        // SAFETY: likewise.
        let hits = unsafe { slice_mut("hits", hits, count) }?;
        let mut found = [Hit::MISS; BATCH];
        in_batches(rays, |at, rays| {
            let found = &mut found[..rays.len()];
            tracer
                .0
                .nearest_hits(rays, found, coherence(coherent));
            for (to, &Hit { t, object }) in hits[at..].iter_mut().zip(&*found) {
                *to = BvhHit { t, object };
            }
        })
    })
}

/// Whether each of `count` rays meets any triangle: 1 or 0, into as many `hits`. `coherent` is as in `bvh_tracer_nearest_hits`.
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
        // SAFETY: promised by the caller.
        let (tracer, rays) = unsafe { (given("tracer", tracer)?, slice("rays", rays, count)?) };
        // SAFETY: likewise.
        let hits = unsafe { slice_mut("hits", hits, count) }?;
        let mut found = [false; BATCH];
        in_batches(rays, |at, rays| {
            let found = &mut found[..rays.len()];
            tracer
                .0
                .any_hits(rays, found, coherence(coherent));
            for (to, &hit) in hits[at..].iter_mut().zip(&*found) {
                *to = u8::from(hit);
            }
        })
    })
}

/// Frees a tracer. Null is left alone.
///
/// `tracer` is null, or a tracer that nobody uses any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvh_tracer_free(tracer: *mut BvhTracer) {
    if !tracer.is_null() {
        // SAFETY: it comes from `made`, and the caller gives it up.
        drop(unsafe { Box::from_raw(tracer) });
    }
}

/// Rays that are checked and traced at once: enough that the call costs nothing, few enough that they stay in the cache.
const BATCH: usize = 512;

fn coherence(coherent: i32) -> Coherence {
    if coherent != 0 { Coherence::Coherent } else { Coherence::Incoherent }
}

/// Shows all rays to `trace`, with the position of the first of each batch, unless one is refused: then none.
fn in_batches(rays: &[BvhRay], mut trace: impl FnMut(usize, &[Ray])) -> Result<(), Failure> {
    let checked = |ray: &BvhRay| Ray::new(ray.origin, ray.direction, ray.t_min, ray.t_max);
    for (index, ray) in rays.iter().enumerate() {
        checked(ray).map_err(|error| Failure::invalid(format!("rays[{index}]: {error}")))?;
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
