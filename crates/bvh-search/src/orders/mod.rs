//! Searches over insertion orders. The fitness of an order is the cost of its Goldsmith–Salmon
//! tree.

pub mod genetic;
pub mod random_orders;

use crate::parallel::{KEPT_NODES, map_init};
use crate::run::{Observer, Problem, Run, SearchError, Stream, watched};
use bvh_build::BuildError;
use bvh_build::goldsmith_salmon::{self, InvalidOrder, Scene, Workspace};
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
            scene: Scene::new(problem.boxes, problem.measure)?,
            config: config.clone(),
            problem: *problem,
        })
    }

    fn len(&self) -> usize {
        self.problem.boxes.len()
    }

    /// Nodes created or visited by an evaluation: a leaf per object and about as many inner nodes.
    fn work(&self) -> u64 {
        2 * self.len() as u64
    }

    /// Inserts the objects in this order and returns the Goldsmith–Salmon cost.
    fn insert(
        &self,
        order: &[u32],
        workspace: &mut Workspace,
        observer: &dyn Observer,
    ) -> Result<f64, InvalidOrder> {
        watched(observer, |watch| self.config.insert_all(&self.scene, order, workspace, watch))
    }

    /// Returns the cost of the tree of one order, which must be a permutation of the objects;
    /// `None` if the observer cancels first.
    fn cost(
        &self,
        order: &[u32],
        (workspace, tree): &mut Buffers,
        observer: &dyn Observer,
    ) -> Option<f64> {
        let goldsmith_salmon = match self.insert(order, workspace, observer) {
            Ok(cost) => cost,
            Err(InvalidOrder::Cancelled) => return None,
            // Only a defect of the search leads here. An infinite cost never becomes the incumbent.
            Err(_) => {
                debug_assert!(false, "orders are permutations");
                return Some(f64::INFINITY);
            }
        };
        let Problem { judge, objective, .. } = self.problem;
        if judge.is_none() && objective == Objective::GoldsmithSalmon {
            return Some(goldsmith_salmon);
        }
        workspace.write(tree);
        Some(self.problem.cost(tree))
    }

    /// Builds the tree of one order; `None` if the observer cancels first.
    fn tree(&self, order: &[u32], observer: &dyn Observer) -> Option<Bvh> {
        let (mut workspace, mut tree) = Buffers::default();
        self.insert(order, &mut workspace, observer).ok()?;
        workspace.write(&mut tree);
        Some(tree)
    }

    /// Evaluates orders on all threads of the current rayon pool, until the observer cancels. Fails
    /// if neither this call nor an earlier one has evaluated any order.
    fn evaluate(&self, orders: &[&[u32]], run: &Run) -> Result<Evaluated, SearchError> {
        let observer = run.observer();
        let mut found = Evaluated { costs: Vec::with_capacity(orders.len()), cheapest: None };
        let mut limit = run.incumbent();
        // The number of trees kept at a time limits the memory.
        let most = (KEPT_NODES / self.work().max(1)).max(1) as usize;
        for (number, orders) in orders.chunks(most).enumerate() {
            let evaluated = map_init(orders.len(), Buffers::default, |buffers, index| {
                if number + index > 0 && observer.cancelled() {
                    return None;
                }
                let cost = self.cost(orders[index], buffers, observer)?;
                let (workspace, _) = buffers;
                let tree = (cost <= limit).then(|| {
                    let mut tree = Bvh::default();
                    workspace.write(&mut tree);
                    tree
                });
                Some((cost, tree))
            });
            for (index, evaluated) in evaluated.into_iter().enumerate() {
                let (cost, tree) = evaluated.unzip();
                found.costs.push(cost);
                // The first tree may equal the incumbent's cost; later trees must be strictly
                // cheaper, so that the first of equals is kept.
                let is_cheapest = cost
                    .is_some_and(|cost| found.cheapest.is_none() && cost <= limit || cost < limit);
                if let (Some(cost), Some(tree), true) = (cost, tree.flatten(), is_cheapest) {
                    limit = cost;
                    found.cheapest = Some((number * most + index, tree));
                }
            }
        }
        if limit == f64::INFINITY && found.costs.iter().all(Option::is_none) {
            return Err(BuildError::Cancelled.into());
        }
        Ok(found)
    }
}

/// The outcome of evaluating several orders.
struct Evaluated {
    /// In the sequence of the orders; `None` for orders that a cancellation left without
    /// evaluation.
    costs: Vec<Option<f64>>,
    /// The number of the first of the cheapest orders, and its tree; `None` if it costs more than
    /// the incumbent.
    cheapest: Option<(usize, Bvh)>,
}

/// Draws a permutation of `0..n`, each equally likely.
fn random_order(n: usize, rng: &mut Stream) -> Vec<u32> {
    let mut order: Vec<u32> = (0..n as u32).collect();
    order.shuffle(rng);
    order
}
