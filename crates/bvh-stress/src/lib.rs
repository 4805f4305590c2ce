//! Stiff and extreme cases S01 to S45 for builders, searches, traversals and readers of files, and
//! checks of the promises that all of them keep.
//!
//! [`Promise`] lists the general promises, and [`CASES`] the cases, some of which promise more
//! about their own scene. A [`Case`] is checked by [`Case::of_method`], [`Case::of_traversal`] and
//! [`Case::of_part`]. The checks themselves work on any tree: [`examine::check_outcome`] on the
//! outcome of a search, [`transform`] on scenes, [`kernels`] and [`tracing`] on rays.
//!
//! ```
//! use bvh_search::{Budget, Method, Problem, solve};
//! use bvh_stress::{by_id, examine::check_outcome};
//!
//! let case = by_id("S04").unwrap();
//! let boxes = bvh_scenes::builtin::stiff::boxes(&case.triangles(100));
//! for method in Method::all().iter().filter(|method| bvh_stress::is_builder(method)) {
//!     let outcome = solve(method, &Problem::new(&boxes), 1, Budget::UNLIMITED, &()).unwrap();
//!     check_outcome(&boxes, &outcome).unwrap();
//! }
//! ```

mod case;
mod cell;
mod checks;
pub mod exact_area;
pub mod exact_distance;
pub mod examine;
pub mod kernels;
mod promise;
mod table;
pub mod tracing;
pub mod transform;

pub use case::{
    Also, Case, Check, EXACT_OBJECTS, Effort, LargerScenes, Part, SceneCase, Size, is_builder,
    methods,
};
pub use cell::Cell;
pub use promise::{Broken, Promise, Verdict};
pub use table::{CASES, by_id, scenes};
