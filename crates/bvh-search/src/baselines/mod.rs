//! Published methods that [`best`](crate::best) is compared with and never calls.
//!
//! Two local searches, [`rotation`] and [`treelet`], and a way to continue from a local optimum,
//! [`rebuild`]. [`LocalSearch`] names the local search of GRASP.

pub mod rebuild;
pub mod rotation;
pub mod treelet;

use crate::local::reinsertion;
use crate::run::{Observer, Quota, Tally};
use crate::tree::{Metric, Working};

bvh_config::config! {
    /// A local search by name, which improves the trees that GRASP constructs.
    #[derive(Copy, Default, Eq)]
    pub enum LocalSearch {
        /// Leaves the tree as it is.
        #[default]
        None,
        /// By [reinsertion](crate::reinsertion).
        Reinsertion,
    }
}

impl LocalSearch {
    /// Returns whether the tree is left as it is.
    pub fn is_none(&self) -> bool {
        *self == Self::None
    }

    /// Improves the tree until it is a local optimum, the quota is used up, or the observer
    /// cancels.
    pub(crate) fn improve(
        self,
        tree: &mut Working<impl Metric>,
        quota: Quota,
        observer: &dyn Observer,
    ) -> Tally {
        match self {
            Self::None => Tally::default(),
            Self::Reinsertion => reinsertion::to_local_optimum(tree, quota, observer),
        }
    }
}
