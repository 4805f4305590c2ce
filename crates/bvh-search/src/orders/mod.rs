//! Searches over insertion orders. They share the fitness of an order: the cost of its Goldsmith–Salmon tree.

pub mod genetic;
pub mod random_orders;

use crate::parallel::map_init;
use crate::run::{Observer, Problem, SearchError, Stream};
use bvh_build::goldsmith_salmon::{self, Scene, Workspace};
use bvh_core::{Bvh, cost::Objective};
use rand::seq::SliceRandom;

/// A scene ready to be built from any insertion order.
struct Insertion<'p> {
    scene: Scene<'p>,
    config: goldsmith_salmon::Config,
    problem: Problem<'p>,
}

/// The buffers of one thread.
type Buffers = (Workspace, Bvh);

impl<'p> Insertion<'p> {
    fn new(problem: &Problem<'p>, config: &goldsmith_salmon::Config) -> Result<Self, SearchError> {
        Ok(Self {
            scene: Scene::by(problem.boxes, problem.measure)?,
            config: config.clone(),
            problem: *problem,
        })
    }

    /// Number of objects.
    fn len(&self) -> usize {
        self.scene.len()
    }

    /// Nodes created or visited by an evaluation: a leaf per object and about as many inner nodes.
    fn work(&self) -> u64 {
        2 * self.scene.len() as u64
    }

    /// The cost of the tree of one order, which must be a permutation of the objects.
    fn cost(&self, order: &[u32], (workspace, tree): &mut Buffers) -> f64 {
        // An order that is not a permutation would be a defect of the search, and never becomes the incumbent.
        let Ok(goldsmith_salmon) = self.config.insert_all(&self.scene, order, workspace) else {
            debug_assert!(false, "orders are permutations");
            return f64::INFINITY;
        };
        let Problem { judge, objective, .. } = self.problem;
        if judge.is_none() && objective == Objective::GoldsmithSalmon {
            goldsmith_salmon
        } else {
            workspace.write(tree);
            self.problem.cost(tree)
        }
    }

    /// The tree of one order.
    fn tree(&self, order: &[u32]) -> Bvh {
        let (mut workspace, mut tree) = Buffers::default();
        if self.config.insert_all(&self.scene, order, &mut workspace).is_ok() {
            workspace.write(&mut tree);
        }
        tree
    }

    /// The costs of several orders, in their order, on all threads of the current rayon pool. The first is always
    /// evaluated, the others unless the observer cancels before.
    fn costs(&self, orders: &[&[u32]], observer: &dyn Observer) -> Vec<Option<f64>> {
        map_init(orders.len(), Buffers::default, |buffers, at| {
            (at == 0 || !observer.cancelled()).then(|| self.cost(orders[at], buffers))
        })
    }
}

/// A permutation of `0..n`, each equally likely.
fn random_order(n: usize, rng: &mut Stream) -> Vec<u32> {
    let mut order: Vec<u32> = (0..n as u32).collect();
    order.shuffle(rng);
    order
}
