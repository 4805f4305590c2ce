//! Builders of bounding volume hierarchies: boxes in, one [`Bvh`](bvh_core::Bvh) out.
//!
//! Every builder is one file with a `Config` and sees the objects' boxes only. All are deterministic, use no
//! recursion on data, and refuse boxes that are not finite by naming the object.

pub mod agglomerative;
pub mod config;
pub mod division;
mod error;
pub mod evaluation;
pub mod goldsmith_salmon;
pub mod kd_tree;
pub mod median_cut;
pub mod muller_fellner;
mod presort;
pub mod sweep;

pub use config::{Check, OutOfRange};
pub use error::BuildError;
pub use presort::Presorted;

/// A builder: a configuration that turns boxes into a tree, after it has been [checked](Check).
pub trait Builder: Check {
    /// Builds a tree over `boxes`; `boxes[i]` bounds object `i`. No boxes give the tree without nodes.
    fn build(&self, boxes: &[bvh_core::Aabb]) -> Result<bvh_core::Bvh, BuildError>;
}
