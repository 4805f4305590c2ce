//! What searches over insertion orders share: an order's fitness, the cost of its Goldsmith–Salmon tree.

use crate::stream::Stream;
use crate::{Problem, SearchError};
use bvh_build::goldsmith_salmon::{self, Scene, Workspace};
use bvh_core::{Bvh, cost::Objective};
use rand::seq::SliceRandom;

/// A scene ready to be built from any insertion order.
pub(crate) struct Insertion {
    scene: Scene,
    config: goldsmith_salmon::Config,
    objective: Objective,
}

/// The buffers of one thread.
pub(crate) type Buffers = (Workspace, Bvh);

impl Insertion {
    pub(crate) fn new(problem: &Problem, config: &goldsmith_salmon::Config) -> Result<Self, SearchError> {
        Ok(Self { scene: Scene::new(problem.boxes)?, config: config.clone(), objective: problem.objective })
    }

    /// Number of objects.
    pub(crate) fn len(&self) -> usize {
        self.scene.len()
    }

    /// Nodes made or visited by an evaluation: a leaf per object and about as many inner nodes.
    pub(crate) fn work(&self) -> u64 {
        2 * self.scene.len() as u64
    }

    /// The cost of the tree of one order, which must be a permutation of the objects.
    pub(crate) fn cost(&self, order: &[u32], (workspace, tree): &mut Buffers) -> f64 {
        // An order that is no permutation would be a defect of the search: never the incumbent.
        let Ok(goldsmith_salmon) = self.config.insert_all(&self.scene, order, workspace) else {
            debug_assert!(false, "orders are permutations");
            return f64::INFINITY;
        };
        if self.objective == Objective::GoldsmithSalmon {
            goldsmith_salmon
        } else {
            workspace.write(tree);
            self.objective.cost(tree)
        }
    }

    /// The tree of one order.
    pub(crate) fn tree(&self, order: &[u32]) -> Bvh {
        let (mut workspace, mut tree) = Buffers::default();
        if self.config.insert_all(&self.scene, order, &mut workspace).is_ok() {
            workspace.write(&mut tree);
        }
        tree
    }

    /// The costs of several orders, in their order, on all threads of the current rayon pool.
    pub(crate) fn costs(&self, orders: &[&[u32]]) -> Vec<f64> {
        #[cfg(feature = "rayon")]
        {
            use rayon::prelude::*;
            orders.par_iter().map_init(Buffers::default, |buffers, order| self.cost(order, buffers)).collect()
        }
        #[cfg(not(feature = "rayon"))]
        {
            let mut buffers = Buffers::default();
            orders.iter().map(|order| self.cost(order, &mut buffers)).collect()
        }
    }
}

/// A permutation of `0..n`, all alike.
pub(crate) fn random_order(n: usize, rng: &mut Stream) -> Vec<u32> {
    let mut order: Vec<u32> = (0..n as u32).collect();
    order.shuffle(rng);
    order
}
