//! The errors of builders, and the check of a scene that all builders make.

use crate::OutOfRange;
use bvh_core::{Aabb, InvalidBox, MAX_OBJECTS, check_boxes};

/// The reason why no tree was built. Any other input of finite boxes and numbers gives a tree
/// unless the caller cancels.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// An object's box is not finite or is inverted.
    #[error(transparent)]
    InvalidBox(#[from] InvalidBox),
    /// There are more objects than node indices of 31 bits allow.
    #[error("{objects} objects are more than the {MAX_OBJECTS} a tree can hold")]
    TooManyObjects {
        /// The number of objects.
        objects: usize,
    },
    /// A parameter of the builder is out of its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// The caller's [`Watch`](crate::Watch) ended the construction.
    #[error("the construction was cancelled")]
    Cancelled,
}

/// Rejects scenes with too many objects, and scenes with a box that is not finite or is inverted.
pub fn check_scene(boxes: &[Aabb]) -> Result<(), BuildError> {
    if boxes.len() > MAX_OBJECTS {
        return Err(BuildError::TooManyObjects { objects: boxes.len() });
    }
    Ok(check_boxes(boxes)?)
}
