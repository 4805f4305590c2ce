//! The descents to a local optimum, by name: what other searches do to a tree they have made.

use crate::working::Working;
use crate::{Observer, Quota, Tally, reinsertion, rotation, treelet};

/// A descent, with its default order, until nothing more pays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum LocalSearch {
    /// Leaves the tree as it is.
    #[default]
    None,
    /// By [rotations](crate::rotation).
    Rotation,
    /// By [treelets](crate::treelet) of 7 leaves.
    Treelet,
    /// By [reinsertion](crate::reinsertion).
    Reinsertion,
}

impl LocalSearch {
    /// Whether the tree is left as it is.
    pub fn is_none(&self) -> bool {
        *self == Self::None
    }

    /// Descends until a local optimum or the quota is reached or the observer says so.
    pub(crate) fn descend(self, tree: &mut Working, quota: Quota, observer: &dyn Observer) -> Tally {
        match self {
            Self::None => Tally::default(),
            Self::Rotation => rotation::to_local_optimum(tree, quota, observer),
            Self::Treelet => treelet::to_local_optimum(tree, quota, observer),
            Self::Reinsertion => reinsertion::to_local_optimum(tree, quota, observer),
        }
    }
}
