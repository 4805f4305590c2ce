//! The laws of the builders, in one program, which links the library once.

mod goldsmith_salmon;
mod muller_fellner;
mod plain_tree;
mod watch;

use bvh_core::Aabb;

fn sized_box((low, size): ([f32; 3], [f32; 3])) -> Aabb {
    Aabb::from((low, std::array::from_fn(|axis| low[axis] + size[axis])))
}

/// A scattered whole number from 0 up to `end`, exclusively.
fn hash(i: u32, salt: u32, end: u32) -> f32 {
    let bits = i.wrapping_mul(2_654_435_761).rotate_left(salt);
    (bits % end) as f32
}
