//! What points see of directions that they share: of a sky, or of the sun's path.

use crate::double::BvsTracerF64;
use crate::failure::{BvsStatus, Failure, given, slice, slice_mut, status};
use crate::tracer::BvsTracer;
use bvh_search::bvh_core::glam::DVec3;
use bvh_search::bvh_core::{DRay, Sky, Traced, View, neighbours};
use bvh_search::prelude::*;

/// Directions that many points look along, and what each is worth.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct BvsSky {
    /// 3 doubles for each direction, of any length except 0. A `BvsTracer` rounds them to floats.
    pub directions: *const f64,
    /// The number of directions.
    pub count: usize,
    /// The smallest distance, in multiples of a direction's length: 0 or more. A `BvsTracer` rounds
    /// both distances to floats.
    pub t_min: f64,
    /// The largest distance; 0 is no limit.
    pub t_max: f64,
    /// `columns` doubles for each direction. Null makes every direction weigh 1, in one column.
    pub weights: *const f64,
    /// The number of weights of each direction.
    pub columns: usize,
    /// 1 if a weight counts by the cosine of the angle between its direction and the normal, 0 if
    /// it counts whole.
    pub cosine: i32,
}

/// Writes what each of `count` points, 3 floats each, sees of a sky. A direction is free from a
/// point if a ray along it hits nothing, as `bvs_any` says.
///
/// `bits`, unless it is null, gets the directions themselves: (`sky.count` + 63) / 64 words for each
/// point, in which direction j is free if bit j % 64 of word j / 64 is set. `sums`, unless it is
/// null, gets the sums of the free directions' weights: `sky.columns` doubles for each point, or
/// one without weights.
///
/// `normals` are null, or 3 floats for each point: then directions d count as free only above the
/// surface, where the dot product of normal and d is greater than 0.
///
/// `tracer` is a tracer; `sky` points to a sky whose arrays have the promised lengths; `points` and
/// `normals` point to 3 * `count` floats, unless `normals` is null; `bits` and `sums` point to as
/// many elements as they get.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_visible(
    tracer: *const BvsTracer,
    sky: *const BvsSky,
    points: *const f32,
    normals: *const f32,
    count: usize,
    bits: *mut u64,
    sums: *mut f64,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer alive during the call; nobody changes a tracer.
        let tracer = unsafe { given("tracer", tracer) }?;
        let vectors = (points.cast::<Vec3>(), normals.cast(), count);
        // SAFETY: what the caller promises.
        unsafe { visible(&*tracer.wide, f32::MAX.into(), sky, vectors, (bits, sums)) }
    })
}

/// Writes what each of `count` points, 3 doubles each, sees of a sky, as `bvs_tracer_visible` does.
///
/// `tracer` is a tracer; `sky` points to a sky whose arrays have the promised lengths; `points` and
/// `normals` point to 3 * `count` doubles, unless `normals` is null; `bits` and `sums` point to as
/// many elements as they get.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn bvs_tracer_visible_f64(
    tracer: *const BvsTracerF64,
    sky: *const BvsSky,
    points: *const f64,
    normals: *const f64,
    count: usize,
    bits: *mut u64,
    sums: *mut f64,
) -> BvsStatus {
    status(|| {
        // SAFETY: the caller keeps the tracer alive during the call; nobody changes a tracer.
        let tracer = unsafe { given("tracer", tracer) }?;
        let vectors = (points.cast::<DVec3>(), normals.cast(), count);
        // SAFETY: what the caller promises.
        unsafe { visible(&tracer.wide, DRay::MOST, sky, vectors, (bits, sums)) }
    })
}

/// Writes what points see, if no coordinate of theirs or of the normals is larger than `most`.
///
/// # Safety
/// `sky` is null, or points to a sky whose arrays have the promised lengths; there are `count`
/// points and normals, unless these are null, and as many results as they get.
unsafe fn visible<L: Traced>(
    layout: &L,
    most: f64,
    sky: *const BvsSky,
    (points, normals, count): (*const L::Point, *const L::Point, usize),
    (bits, sums): (*mut u64, *mut f64),
) -> Result<(), Failure> {
    // SAFETY: what the caller promises.
    let BvsSky { directions, count: width, t_min, t_max, weights, columns, cosine } =
        *unsafe { given("sky", sky) }?;
    // SAFETY: what the caller promises.
    let directions = unsafe { slice("directions", directions.cast::<[f64; 3]>(), width) }?;
    let directions = directions.iter().map(|&direction| DVec3::from(direction)).collect();
    let t_max = if t_max == 0.0 { f64::INFINITY } else { t_max };
    let mut sky = Sky::new(directions, [t_min, t_max]).map_err(Failure::invalid)?;
    let columns = if weights.is_null() { 1 } else { columns };
    if !weights.is_null() && width > 0 {
        // SAFETY: what the caller promises.
        let weights = unsafe { slice("weights", weights, width.saturating_mul(columns)) }?;
        sky = sky.with_weights(weights.to_vec()).map_err(Failure::invalid)?;
    }
    let words = sky.words();
    // SAFETY: what the caller promises. A null pointer is of an empty array.
    let (points, normals, bits, sums) = unsafe {
        let length =
            |is_null: bool, each: usize| if is_null { 0 } else { count.saturating_mul(each) };
        (
            slice("points", points, count)?,
            slice("normals", normals, length(normals.is_null(), 1))?,
            slice_mut("bits", bits, length(bits.is_null(), words))?,
            slice_mut("sums", sums, length(sums.is_null(), columns))?,
        )
    };
    if cosine != 0 && normals.len() < count {
        return Err(Failure::invalid(
            "cosine is not 0 and normals is null; accepted: both or none",
        ));
    }
    for (name, vectors) in [("points", points), ("normals", normals)] {
        for (index, &vector) in vectors.iter().enumerate() {
            let found: DVec3 = vector.into();
            // NaN fails every comparison.
            if !found.abs().cmple(DVec3::splat(most)).all() {
                let message =
                    format!("{name}[{index}] is {found}; accepted: up to {most:e} in size");
                return Err(Failure::invalid(message));
            }
        }
    }
    let normals = (normals.len() == count).then_some(normals);
    let cosines = normals.filter(|_| cosine != 0);
    sky.visible(layout, View { points, normals }, &neighbours(points), |point, row| {
        if !bits.is_empty() {
            bits[words * point..][..words].copy_from_slice(row);
        }
        if !sums.is_empty() {
            let normal = cosines.map(|normals| normals[point].into());
            let found = sky.sums(row, normal);
            sums[columns * point..][..columns].copy_from_slice(&found);
        }
    });
    Ok(())
}
