//! Everything for programs that build, bake, trace and save trees: `use bvh_search::prelude::*`.

pub use crate::{Bake, Budget, Outcome, Problem, StopReason, best, optimize, solve};
#[cfg(feature = "std")]
pub use crate::{Deadline, bake, bake_for_rays, improve};
pub use bvh_build::{Builder, median_cut, muller_fellner, ploc};
pub use bvh_core::cost::Objective;
pub use bvh_core::glam::{Affine3A, Vec3};
pub use bvh_core::{
    Aabb, Bvh, Coherence, Hit, InsideRule, Instance, InstanceHit, Instances, Primitive, Ray,
    RayDensity, RefitError, Segment, Solid, Sphere, Triangle, WideBvh, any_hit, boxes, cost, file,
    nearest_hit, validate,
};
pub use std::time::Duration;
