//! The registry of methods: the only place that knows all of them by name.

use crate::run::{Problem, Run, Search, SearchError};
use bvh_config::{Check, OutOfRange};
use bvh_core::Bvh;
use serde::{Deserialize, Deserializer, Serialize};

/// One line per method: its name in specs and tables, and the configuration that runs it.
macro_rules! methods {
    ($($(#[$doc:meta])* $name:literal => $variant:ident($config:ty),)*) => {
        /// A builder or a search with its parameters, as a spec names it: a table whose `method` is
        /// the name and whose other keys are the configuration's fields. Unknown names and keys are
        /// rejected.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "method")]
        pub enum Method {
            $($(#[$doc])* #[serde(rename = $name)] $variant($config),)*
        }

        impl Method {
            /// The names of all methods.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Reads the parameters of the method called `name`; `None` if no method has this name.
            /// Unlike the deserialisation of a whole method, this function passes `parameters` on
            /// unbuffered, so errors keep their position.
            pub fn read<'de, D: Deserializer<'de>>(name: &str, parameters: D) -> Result<Option<Self>, D::Error> {
                match name {
                    $($name => <$config>::deserialize(parameters).map(|config| Some(Self::$variant(config))),)*
                    _ => Ok(None),
                }
            }

            /// Returns every method with its default parameters.
            pub fn all() -> Vec<Self> {
                vec![$(Self::$variant(Default::default())),*]
            }

            /// The method's name.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$variant(_) => $name),* }
            }
        }

        impl Check for Method {
            fn check(&self) -> Result<(), OutOfRange> {
                match self { $(Self::$variant(config) => config.check()),* }
            }
        }

        impl Search for Method {
            fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
                match self { $(Self::$variant(config) => config.search(problem, seed, run)),* }
            }
        }
    };
}

methods! {
    /// Greedy top-down division.
    "muller_fellner" => MullerFellner(bvh_build::muller_fellner::Config),
    /// Division at the median.
    "median_cut" => MedianCut(bvh_build::median_cut::Config),
    /// Incremental insertion, in index order.
    "goldsmith_salmon" => GoldsmithSalmon(bvh_build::goldsmith_salmon::Config),
    /// Bottom-up clustering.
    "agglomerative" => Agglomerative(bvh_build::ploc::Config),
    /// Randomised Müller–Fellner.
    "grasp" => Grasp(crate::grasp::Config),
    /// Goldsmith–Salmon insertion in random orders.
    "random_orders" => RandomOrders(crate::random_orders::Config),
    /// A genetic algorithm over insertion orders.
    "genetic" => Genetic(crate::genetic::Config),
    /// Reinsertion to a local optimum.
    "reinsertion" => Reinsertion(crate::reinsertion::Config),
    /// Tree rotations to a local optimum.
    "rotation" => Rotation(crate::rotation::Config),
    /// Treelet restructuring to a local optimum.
    "treelet" => Treelet(crate::treelet::Config),
    /// Annealing on single reinsertions.
    "annealing" => Annealing(crate::annealing::Config),
    /// Rebuilding of subtrees that look badly split.
    "rebuild" => Rebuild(crate::rebuild::Config),
    /// Annealed ruin and recreate.
    "ruin_recreate" => RuinRecreate(crate::ruin_recreate::Config),
    /// The exact optimum of small scenes.
    "exact" => Exact(crate::exact::Config),
    /// All methods that pay, in the order that pays.
    "best" => Best(crate::best::Config),
}
