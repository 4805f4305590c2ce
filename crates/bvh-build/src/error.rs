//! The refusals of builders, and the check of a scene that all of them make.

use crate::OutOfRange;
use bvh_core::{Aabb, InvalidBox, MAX_OBJECTS, check_boxes};

/// Why no tree was built. Any other input, of finite boxes and numbers, gives a tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// An object's box is not finite or is inverted.
    #[error(transparent)]
    InvalidBox(#[from] InvalidBox),
    /// More objects than nodes' indices of 31 bits allow.
    #[error("{objects} objects are more than the {MAX_OBJECTS} a tree can hold")]
    TooManyObjects {
        /// How many were given.
        objects: usize,
    },
    /// The number of weights is not the number of objects.
    #[error("{weights} weights were given for {objects} objects")]
    WeightCount {
        /// How many weights were given.
        weights: usize,
        /// How many boxes were given.
        objects: usize,
    },
    /// A weight, which is an expected cost, is not finite or is negative.
    #[error("the weight of object {index} is {weight}; it must be finite and not negative")]
    InvalidWeight {
        /// Index of the object.
        index: usize,
        /// Its weight.
        weight: f64,
    },
    /// A parameter of the builder is out of its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
}

/// Refuses scenes that no builder accepts: with too many objects, or with a box that is not finite or is inverted.
pub(crate) fn check_scene(boxes: &[Aabb]) -> Result<(), BuildError> {
    if boxes.len() > MAX_OBJECTS {
        return Err(BuildError::TooManyObjects { objects: boxes.len() });
    }
    Ok(check_boxes(boxes)?)
}
