//! Bounding volume hierarchies: the one tree type, its boxes, its costs and its validity.
//!
//! Everything in the workspace builds, searches, traces and saves the one [`Bvh`] of this crate, and every
//! reported number comes from its [`cost`] module. The crate does no input or output, reads no clock, draws no
//! random numbers and needs only `alloc`.
//!
//! ```
//! use bvh_core::{Aabb, Bvh, Node, cost};
//! // Two unit cubes, two apart, under one root.
//! let boxes = [Aabb::from(([0.0; 3], [1.0; 3])), Aabb::from(([2.0, 0.0, 0.0], [3.0, 1.0, 1.0]))];
//! let tree = Bvh {
//!     nodes: vec![
//!         Node::inner(boxes[0].union(&boxes[1]), 1, 2),
//!         Node::leaf(boxes[0], 0, 1),
//!         Node::leaf(boxes[1], 1, 1),
//!     ],
//!     prim_ids: vec![0, 1],
//! };
//! bvh_core::validate(&tree, &boxes)?;
//! assert_eq!(cost::internal_area(&tree), 7.0);
//! # Ok::<(), bvh_core::InvalidBvh>(())
//! ```
#![cfg_attr(not(feature = "std"), no_std)]

extern crate alloc;

mod aabb;
mod bvh;
mod collapse;
pub mod cost;
mod dispatch;
pub mod file;
mod first_count;
mod overlap;
mod packed;
mod primitives;
pub mod query;
mod ray;
pub mod ray_density;
mod slabs;
mod sphere;
mod stack;
mod traverse;
mod triangle;
mod validate;
mod wide;

pub use aabb::{Aabb, InvalidBox, InvalidBoxReason, check_boxes};
pub use bvh::{Bvh, BvhView, MAX_OBJECTS, Node, NodeKind};
pub use collapse::collapse_leaves;
pub use first_count::FirstCountNode;
pub use packed::PackedAabb;
pub use primitives::Primitives;
pub use ray::{Hit, InvalidRay, Ray};
pub use ray_density::{DensityError, RayDensity, Segment};
pub use slabs::{Slabs, clip_to_box};
pub use sphere::Sphere;
pub use traverse::{Counter, TestCounts, any_hit, any_hit_of_all, nearest_hit, nearest_hit_of_all};
pub use triangle::{Shear, Triangle};
pub use validate::{InvalidBvh, validate};
pub use wide::{Coherence, Kernel, WideBvh};

pub use glam;
