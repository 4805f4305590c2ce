//! Stiff and extreme cases S01 to S45 for builders, searches, traversals and readers of files, and
//! checks of the promises that all of them keep for every input:
//!
//! - **P1**: no panic, hang or abort, but a tree, or a typed error that names the object.
//! - **P2**: containment is exact, bit by bit.
//! - **P3**: no false miss: every traversal gives the answers of brute force.
//! - **P4**: the same bytes for any number of threads.
//! - **P5**: scaling by 2^k leaves the topology and multiplies areas by 4^k.
//! - **P6**: depth is reported, and no stack overflows.
//! - **P7**: every cost is finite and equals the tree's cost.
//! - **P8**: every traversal tests at most twice as many boxes and objects as in real arithmetic,
//!   except where boxes are smaller than 2⁻²⁰ of their distance from the ray's origin, as in S24.
//! - **P9**: a bake costs at most 1.03 times the area, and rays at most 1.1 times the tests, of the
//!   same scene as its author built it, however the scene stands and wherever it is.
//!
//! [`CASES`] lists the cases, some of which promise more about their own scene. A [`Case`] is
//! checked by [`Case::cells`]. The checks themselves work on any tree: [`examine::check_outcome`] on
//! the outcome of a search, [`transform`] on scenes, [`tracing`] on rays.

mod case;
mod checks;
mod exact;
pub mod examine;
mod methods;
mod table;
pub mod tracing;
pub mod transform;

pub use case::{Case, Cell, Check, Class, Effort, LargerScenes, Size};
pub use methods::{EXACT_OBJECTS, is_builder, methods};
pub use table::{CASES, KINDS, by_id, scenes};

/// A note, or the broken promise: an error whose text begins with `P1: ` to `P8: ` if the promise
/// is a general one.
pub type Verdict = anyhow::Result<String>;
