// The crate's front page is its README.
#![doc = include_str!("../README.md")]

mod error;
pub mod goldsmith_salmon;
pub mod ploc;
pub mod top_down;
mod watch;

use bvh_core::cost::Measure;
use bvh_core::{Aabb, Bvh};

pub use bvh_config::{Check, OutOfRange};
pub use error::{BuildError, check_scene};
pub use top_down::{Presorted, median_cut, muller_fellner, spatial};
pub use watch::{OBJECTS_PER_POLL, Watch};

/// A builder: a configuration that turns boxes into a tree, after it has been [checked](Check).
pub trait Builder: Check {
    /// Builds a tree over `boxes`; `boxes[i]` bounds object `i`. No boxes give the tree without
    /// nodes. The size of a box is the `measure`, or the half area if there is none. Returns
    /// [`BuildError::Cancelled`] soon after the `watch` cancels the construction.
    fn build_watched(
        &self,
        boxes: &[Aabb],
        measure: Option<&dyn Measure>,
        watch: &Watch,
    ) -> Result<Bvh, BuildError>;

    /// Builds a tree by half area, without a watch.
    fn build(&self, boxes: &[Aabb]) -> Result<Bvh, BuildError> {
        self.build_watched(boxes, None, &Watch::default())
    }
}

/// Returns the larger of two numbers that are not NaN. Unlike `f32::max`, it is one instruction.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
