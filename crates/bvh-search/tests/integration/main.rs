//! The laws of the searches, in one program, which links the library once.

mod bake;
mod cancellation;
mod choose;
mod frames;
mod local_search;
mod measure;
mod shortcuts;

use bvh_core::Aabb;
use bvh_search::Budget;

/// Boxes of very different sizes in a unit cube.
fn scatter(n: u32, salt: u32) -> Vec<Aabb> {
    let hash = |i: u32, k: u32| {
        let h = (i ^ salt.wrapping_mul(0x9e37_79b9))
            .wrapping_mul(2_654_435_761)
            .rotate_left(k)
            .wrapping_mul(0x85eb_ca6b);
        (h >> 8) as f32 / (1 << 24) as f32
    };
    (0..n)
        .map(|i| {
            let low = [hash(i, 3), hash(i, 11), hash(i, 19)];
            let size = hash(i, 27) * hash(i, 5) * 0.5;
            Aabb::from((low, std::array::from_fn(|k| low[k] + size * hash(i, 7 + k as u32))))
        })
        .collect()
}

fn work(max_work: u64) -> Budget {
    Budget { max_work: Some(max_work), ..Budget::UNLIMITED }
}
