// The root of the crate; its front page is its README.
#![doc = include_str!("../README.md")]

pub mod accelerator;
pub mod config;
mod error;
pub mod goldsmith_salmon;
pub mod kd_tree;
pub mod ploc;
pub mod top_down;

use bvh_core::cost::Measure;
use bvh_core::{Aabb, Bvh};

pub use accelerator::{Accelerator, Query, Structure};
pub use config::{Check, OutOfRange};
pub use error::BuildError;
pub use top_down::{Presorted, median_cut, muller_fellner, spatial};

/// A builder: a configuration that turns boxes into a tree, after it has been [checked](Check).
pub trait Builder: Check {
    /// Builds a tree over `boxes`; `boxes[i]` bounds object `i`. No boxes give the tree without nodes. Where boxes are compared by
    /// size, their size is the `measure`, or the half area if there is none.
    fn build_by(&self, boxes: &[Aabb], measure: Option<&dyn Measure>) -> Result<Bvh, BuildError>;

    /// [`build_by`](Self::build_by) half area.
    fn build(&self, boxes: &[Aabb]) -> Result<Bvh, BuildError> {
        self.build_by(boxes, None)
    }
}
