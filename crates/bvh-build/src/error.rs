//! What a builder can refuse.

use crate::OutOfRange;
use bvh_core::{InvalidBox, MAX_OBJECTS};

/// Why no tree was built. Nothing else can go wrong: every finite input gives a tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// An object's box is not finite or is inverted.
    #[error(transparent)]
    InvalidBox(#[from] InvalidBox),
    /// Trees index nodes with 31 bits.
    #[error("{objects} objects are more than the {MAX_OBJECTS} a tree can hold")]
    TooManyObjects {
        /// How many were given.
        objects: usize,
    },
    /// There must be one weight per object.
    #[error("{weights} weights were given for {objects} objects")]
    WeightCount {
        /// How many weights were given.
        weights: usize,
        /// How many boxes were given.
        objects: usize,
    },
    /// A weight is an expected cost: finite and not negative.
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
