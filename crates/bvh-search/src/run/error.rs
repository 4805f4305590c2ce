//! The errors of a search.

use bvh_build::BuildError;
use bvh_config::OutOfRange;
use bvh_core::{Bvh, InvalidBvh};

/// The result of a search.
pub(crate) type Found = Result<Bvh, SearchError>;

/// The reason why a search did not start. A started search always returns a tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// The builder rejects the scene.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The tree to optimise is not a valid tree over these boxes.
    #[error(transparent)]
    Invalid(#[from] InvalidBvh),
    /// Local search requires binary trees.
    #[error("inner node {node} has {children} children; local search accepts binary trees only")]
    NotBinary {
        /// Index of the node.
        node: usize,
        /// Its number of children.
        children: u32,
    },
    /// A parameter of the search is out of its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
}
