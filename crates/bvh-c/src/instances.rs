//! Instances: tracers in many places, which move without copies of their triangles.

use crate::failure::{BvsStatus, Failure, given, given_mut, made, slice, slice_mut, status};
use crate::tracer::{BvsRay, BvsTracer, flags_in_batches, in_batches};
use crate::tree::deadline;
use bvh_search::prelude::*;
use std::sync::Arc;

/// A scene of tracers in many places. Any number of threads may trace its rays at the same time. A
/// thread that updates or frees it must be the only user.
pub struct BvsInstances {
    scene: Instances,
}

/// A transformed copy of a part.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BvsInstance {
    /// The index of the part.
    pub part: u32,
    /// The transform from the part's coordinates to the scene's, which has an inverse: three rows
    /// of four numbers, the last of which is the translation, as in Vulkan, DirectX and OptiX.
    pub transform: [f32; 12],
}

/// The nearest hit of a ray among instances; of several at the same distance, the lowest instance.
/// A ray without a hit has infinity and UINT32_MAX twice.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvsInstanceHit {
    /// The distance, in multiples of the direction's length.
    pub t: f32,
    /// The index of the instance.
    pub instance: u32,
    /// The index of the triangle in the instance's part.
    pub triangle: u32,
}

// Batches write the library's hits as these.
same_layout!(BvsInstanceHit, InstanceHit, t, instance, triangle);

/// Creates a scene of `count` instances of `part_count` tracers, the parts. Searches for the best
/// tree over the instances for about `seconds`, 0 or more. The parts are shared, not copied; their
/// tracers may be freed.
///
/// `parts` points to `part_count` tracers, and `instances` to `count` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_instances_new(
    parts: *const *const BvsTracer,
    part_count: usize,
    instances: *const BvsInstance,
    count: usize,
    seconds: f64,
) -> *mut BvsInstances {
    made(|| {
        // SAFETY: `parts` points to `part_count` pointers.
        let parts = unsafe { slice("parts", parts, part_count) }?;
        let part = |(index, &part)| {
            // SAFETY: a part is null or points to a tracer, which nobody changes during the call.
            unsafe { given::<BvsTracer>(&format!("parts[{index}]"), part) }
                .map(|tracer| tracer.wide.clone())
        };
        let parts: Vec<Arc<WideBvh>> =
            parts.iter().enumerate().map(part).collect::<Result<_, _>>()?;
        // SAFETY: `instances` points to `count` elements.
        let instances = unsafe { instances_of(instances, count) }?;
        let boxes = Instance::boxes(&instances, &parts).map_err(Failure::invalid)?;
        let observer = deadline(seconds)?;
        let baked = Bake::new(&boxes).search(None, &observer).map_err(Failure::invalid)?;
        let scene = Instances::new(parts, instances, baked.outcome.tree);
        Ok(BvsInstances { scene: scene.map_err(Failure::invalid)? })
    })
}

/// Moves all instances, as many as there are, to other transforms. Their tree keeps its nodes; once
/// the instances are far from where they were, a new scene of the same tracers makes rays faster.
///
/// `scene` is a scene that no other thread uses; `instances` points to `count` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_instances_update(
    scene: *mut BvsInstances,
    instances: *const BvsInstance,
    count: usize,
) -> BvsStatus {
    status(|| {
        // SAFETY: no other thread uses the scene during the call.
        let scene = &mut unsafe { given_mut("scene", scene) }?.scene;
        let there = scene.instances();
        if count != there {
            return Err(Failure::invalid(format!(
                "count is {count}; accepted: {there}, as before"
            )));
        }
        // SAFETY: `instances` points to `count` elements.
        scene.refit(&unsafe { instances_of(instances, count) }?).map_err(Failure::invalid)
    })
}

/// Writes the nearest hits of `count` rays to `hits`.
///
/// `scene` is a scene; `rays` and `hits` point to `count` elements each, and do not overlap.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_instances_nearest_hits(
    scene: *const BvsInstances,
    rays: *const BvsRay,
    count: usize,
    hits: *mut BvsInstanceHit,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the scene and `count` rays during the call; nobody changes them.
        let (scene, rays) = unsafe { (&given("scene", scene)?.scene, slice("rays", rays, count)?) };
        // SAFETY: `hits` points to `count` elements that nobody else uses during the call.
        let hits = unsafe { slice_mut("hits", hits.cast::<InstanceHit>(), count) }?;
        in_batches(rays, |start, rays| {
            scene.nearest_hits(rays, &mut hits[start..start + rays.len()]);
        })
    })
}

/// Writes to `hits` whether each of `count` rays hits any instance: 1 or 0.
///
/// `scene` is a scene; `rays` and `hits` point to `count` elements each, and do not overlap.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_instances_any_hits(
    scene: *const BvsInstances,
    rays: *const BvsRay,
    count: usize,
    hits: *mut u8,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the scene and `count` rays during the call; nobody changes them.
        let (scene, rays) = unsafe { (&given("scene", scene)?.scene, slice("rays", rays, count)?) };
        // SAFETY: `hits` points to `count` elements that nobody else uses during the call.
        let hits = unsafe { slice_mut("hits", hits, count) }?;
        flags_in_batches(rays, hits, |rays, hits| scene.any_hits(rays, hits))
    })
}

/// Frees a scene of instances. Ignores null.
///
/// `scene` is null, or a scene that nobody uses any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_instances_free(scene: *mut BvsInstances) {
    if !scene.is_null() {
        // SAFETY: `made` has created the pointer from a box, and the caller frees it once.
        drop(unsafe { Box::from_raw(scene) });
    }
}

/// Copies instances.
///
/// # Safety
/// `first` points to `count` elements.
unsafe fn instances_of(first: *const BvsInstance, count: usize) -> Result<Vec<Instance>, Failure> {
    // SAFETY: what the caller promises.
    let instances = unsafe { slice("instances", first, count) }?;
    let instance = |&BvsInstance { part, transform: m }: &BvsInstance| {
        let columns = std::array::from_fn(|i| m[i % 3 * 4 + i / 3]);
        Instance { part, transform: Affine3A::from_cols_array(&columns) }
    };
    Ok(instances.iter().map(instance).collect())
}
