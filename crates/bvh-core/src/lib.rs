// The README is the front page of the crate's documentation.
#![doc = include_str!("../README.md")]

mod aabb;
mod bvh;
mod clip;
mod collapse;
pub mod cost;
mod dispatch;
mod double;
mod each;
mod exact;
pub mod export;
pub mod file;
mod frame;
mod layout_cost;
mod mesh;
mod packed;
mod primitives;
mod ray;
pub mod ray_density;
mod sky;
mod slabs;
mod solid;
mod sphere;
mod traverse;
mod triangle;
mod validate;
mod wide;
mod winding;

pub use aabb::{Aabb, InvalidBox, InvalidBoxReason, check_boxes};
pub use bvh::{Bvh, BvhView, MAX_OBJECTS, Node, NodeKind};
pub use clip::Clip;
pub use collapse::collapse_leaves;
pub use double::{DHit, DRay, DTriangle, Orientation, OutOfExactRange, Select};
pub use export::FirstCountNode;
pub use frame::{Frame, InvalidFrame};
pub use mesh::MeshError;
pub use packed::PackedAabb;
pub use primitives::{Primitive, Primitives, boxes};
pub use ray::{Hit, InvalidRay, Ray};
pub use ray_density::{DensityError, RayDensity, Segment};
pub use sky::{InvalidSky, Sky, View};
pub use slabs::{Slabs, clip_to_box};
pub use solid::{InsideRule, Solid, Traced};
pub use sphere::Sphere;
pub use traverse::{
    Counter, TestCounts, any_hit, any_hit_by, any_hit_of_all, nearest_hit, nearest_hit_by,
    nearest_hit_of_all,
};
pub use triangle::{Corners, InFrame, PreparedRay, Triangle};
pub use validate::{InvalidBvh, validate, validate_references};
#[doc(hidden)]
pub use wide::NodeTest;
pub use wide::{
    Closest, Coherence, DWideBvh, Instance, InstanceHit, Instances, InvalidInstances, Kernel,
    RefitError, WideBvh, neighbours,
};

pub use glam;
