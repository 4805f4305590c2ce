//! What a search can refuse.

use bvh_build::BuildError;
use bvh_config::OutOfRange;
use bvh_core::{Bvh, InvalidBvh};

/// What a search returns.
pub(crate) type Found = Result<Bvh, SearchError>;

/// Why a search did not start. Once started, a search always returns a tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// The scene cannot be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The tree to be optimised is not a valid tree over these boxes.
    #[error(transparent)]
    Invalid(#[from] InvalidBvh),
    /// Local search works on binary trees.
    #[error("inner node {node} has {children} children; local search takes binary trees only")]
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
