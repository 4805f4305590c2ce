//! The genetic algorithm over insertion orders of Goldsmith–Salmon trees.
//!
//! Ng & Trifonov 2003, section 4; operators after Cassen, Michalewicz & Subramanian 1995. An
//! individual is a permutation of the objects. Its fitness is the cost of the tree that inserting
//! the objects in this order builds. A generation consists of one tournament of two per individual,
//! one-point order crossover whose children replace the parents, and mutation by swaps.
//!
//! Differs from the paper: nothing known. Where the paper is silent: 'the most fit is always kept'
//! means that the best individual so far replaces the least fit of a generation whose individuals
//! are all less fit, so the size of the population is constant. The number of swaps is uniform
//! between 0 and twice its mean. An individual that a generation leaves unchanged is not evaluated
//! again, though it counts as evaluated.
//!
//! *Not done*: resuming an insertion where a child's order first differs from its parent's. The
//! first of 2n/500 swapped positions comes so early that only about one insertion in twenty could
//! be saved, less than the cost of keeping the trees.

use super::{Evaluated, Insertion, random_order};
use crate::run::{Problem, Run, Search, SearchError, Stream, stream};
use bvh_build::goldsmith_salmon;
use bvh_config::{Accepts, Nested};
use bvh_core::Bvh;
use rand::RngExt;
use rand::seq::SliceRandom;

bvh_config::config! {
    /// The population and the operators.
    pub struct Config {
        /// Number of individuals.
        population: usize = 50, in 1..=1_000_000;
        /// Number of generations after the initial, random one.
        generations: u64 = 100;
        /// The probability that a pair of parents is replaced by its two children.
        crossover: f64 = 0.7, in 0.0..=1.0;
        /// Mean number of swaps per individual and generation, as a fraction of the number of
        /// objects. The paper has about n/500 swaps.
        mutation: f64 = 0.002, in 0.0..=1.0;
        /// The parameters of the insertion.
        insertion: goldsmith_salmon::Config, in Nested;
    }
}

/// An insertion order and the cost of its tree.
#[derive(Clone, Debug)]
struct Individual {
    order: Vec<u32>,
    cost: f64,
    /// True if `cost` is the cost of `order`.
    evaluated: bool,
}

impl Search for Config {
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        let insertion = Insertion::new(problem, &self.insertion)?;
        let mut rng = stream(seed, 0);
        (..=MOST_ENTRIES / insertion.len().max(1)).check("population", &self.population)?;
        let mut population: Vec<Individual> = Vec::new();
        while population.len() < self.population
            && (population.is_empty() || !run.observer().cancelled())
        {
            let order = random_order(insertion.len(), &mut rng);
            population.push(Individual { order, cost: f64::INFINITY, evaluated: false });
        }
        let (mut best, tree) = evaluate(&insertion, &mut population, run)?;
        let mut built = (best.order.clone(), tree.unwrap_or_default());
        // One buffer for all crossovers, so that a child needs no second allocation.
        let mut marks = vec![false; insertion.len()];
        for _ in 0..self.generations {
            if run.stopped().is_some() {
                break;
            }
            population = select(&population, &mut rng);
            cross(&mut population, self.crossover, &mut marks, &mut rng);
            for individual in &mut population {
                mutate(individual, self.mutation, &mut rng);
            }
            let (fittest, tree) = evaluate(&insertion, &mut population, run)?;
            if let Some(tree) = tree {
                built = (fittest.order.clone(), tree);
            }
            if fittest.cost <= best.cost {
                best = fittest;
            } else {
                keep(&best, &mut population);
            }
        }
        // Another order of the same cost may have replaced the order whose tree was kept.
        if built.0 != best.order
            && let Some(tree) = insertion.tree(&best.order, run.observer())
        {
            return Ok(tree);
        }
        Ok(built.1)
    }
}

/// Maximum number of entries of all permutations together, 1 GB.
const MOST_ENTRIES: usize = 1 << 28;

/// Evaluates the individuals that have changed and records the generation. Returns the fittest, the
/// first of equals, and its tree if it was evaluated now. Individuals that a cancellation leaves
/// without evaluation have an infinite cost.
fn evaluate(
    insertion: &Insertion,
    population: &mut [Individual],
    run: &mut Run,
) -> Result<(Individual, Option<Bvh>), SearchError> {
    let mut changed: Vec<&mut Individual> =
        population.iter_mut().filter(|i| !i.evaluated).collect();
    let orders: Vec<&[u32]> =
        changed.iter().map(|individual| individual.order.as_slice()).collect();
    let Evaluated { costs, cheapest } = insertion.evaluate(&orders, run)?;
    let missing = costs.iter().filter(|cost| cost.is_none()).count();
    let work = (costs.len() - missing) as u64 * insertion.work();
    let cheapest = cheapest.map(|(number, tree)| (orders[number].to_vec(), tree));
    for (individual, cost) in changed.iter_mut().zip(costs) {
        (individual.cost, individual.evaluated) = (cost.unwrap_or(f64::INFINITY), cost.is_some());
    }
    let mut fittest = &population[0];
    for individual in &*population {
        if individual.cost < fittest.cost {
            fittest = individual;
        }
    }
    run.record_generation((population.len() - missing) as u64, fittest.cost, work);
    let tree = cheapest.filter(|(order, _)| *order == fittest.order).map(|(_, tree)| tree);
    Ok((fittest.clone(), tree))
}

/// Returns the winners of one tournament of two per individual. A tournament may draw the same
/// individual twice.
fn select(population: &[Individual], rng: &mut Stream) -> Vec<Individual> {
    let count = population.len() as u32;
    (0..count)
        .map(|_| {
            let a = &population[rng.random_range(0..count) as usize];
            let b = &population[rng.random_range(0..count) as usize];
            if b.cost < a.cost { b } else { a }.clone()
        })
        .collect()
}

/// Replaces the least fit individual, the last of equals, by the best individual so far.
fn keep(best: &Individual, population: &mut [Individual]) {
    if let Some(least_fit) = population.iter_mut().max_by(|a, b| a.cost.total_cmp(&b.cost)) {
        least_fit.clone_from(best);
    }
}

/// Pairs the parents at random and replaces each pair by its two children with the given
/// probability. In an odd population, one parent stays unpaired.
fn cross(parents: &mut [Individual], probability: f64, marks: &mut [bool], rng: &mut Stream) {
    parents.shuffle(rng);
    for pair in parents.chunks_exact_mut(2) {
        if !rng.random_bool(probability) {
            continue;
        }
        let [a, b] = pair else { continue };
        let cut = rng.random_range(0..=a.order.len() as u32) as usize;
        let children =
            [child(&a.order, &b.order, cut, marks), child(&b.order, &a.order, cut, marks)];
        for (parent, order) in [a, b].into_iter().zip(children) {
            // A child may equal its parent, which needs no new evaluation.
            if parent.order != order {
                (parent.order, parent.evaluated) = (order, false);
            }
        }
    }
}

/// Returns the child of a one-point order crossover: the first `cut` objects of `a`, then the
/// remaining objects in the order of `b`. `marks` has one entry per object; all are false before
/// and after.
fn child(a: &[u32], b: &[u32], cut: usize, marks: &mut [bool]) -> Vec<u32> {
    let (kept, _) = a.split_at(cut);
    kept.iter().for_each(|&object| marks[object as usize] = true);
    let mut order = Vec::with_capacity(a.len());
    order.extend_from_slice(kept);
    order.extend(b.iter().filter(|&&object| !marks[object as usize]));
    kept.iter().for_each(|&object| marks[object as usize] = false);
    order
}

/// Swaps random pairs. The number of swaps is uniform between 0 and 2 · `mean` · n, rounded.
fn mutate(individual: &mut Individual, mean: f64, rng: &mut Stream) {
    let n = individual.order.len() as u32;
    if n < 2 {
        return;
    }
    let swaps = rng.random_range(0..=(2.0 * mean * f64::from(n)).round() as u32);
    for _ in 0..swaps {
        individual.order.swap(rng.random_range(0..n) as usize, rng.random_range(0..n) as usize);
    }
    // Two swaps may cancel out; evaluating the order again then is only a little work.
    individual.evaluated &= swaps == 0;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{Budget, Judge, solve};
    use crate::scatter::scatter;
    use bvh_core::cost::Objective;
    use proptest::prelude::*;

    fn individual(cost: f64) -> Individual {
        Individual { order: vec![], cost, evaluated: true }
    }

    fn is_permutation(order: &[u32], n: usize) -> bool {
        let mut sorted = order.to_vec();
        sorted.sort_unstable();
        sorted == (0..n as u32).collect::<Vec<_>>()
    }

    proptest! {
        #[test]
        fn children_are_permutations_with_the_prefix_of_one_parent_and_the_order_of_the_other(
            n in 1..60usize, seed: u64, cut in 0..=60usize,
        ) {
            let mut rng = stream(seed, 0);
            let a = random_order(n, &mut rng);
            let b = random_order(n, &mut rng);
            let cut = cut.min(n);
            let mut marks = vec![false; n];
            let child = child(&a, &b, cut, &mut marks);
            prop_assert!(is_permutation(&child, n));
            prop_assert_eq!(&child[..cut], &a[..cut]);
            let place = |object: &u32| b.iter().position(|other| other == object);
            prop_assert!(child[cut..].iter().map(place).is_sorted());
            prop_assert!(marks.iter().all(|mark| !mark));
        }

        #[test]
        fn mutants_are_permutations(n in 1..60usize, seed: u64, mean in 0.0..=1.0f64) {
            let mut rng = stream(seed, 0);
            let mut individual = Individual { order: random_order(n, &mut rng), cost: 0.0, evaluated: true };
            let before = individual.order.clone();
            mutate(&mut individual, mean, &mut rng);
            prop_assert!(is_permutation(&individual.order, n));
            prop_assert!(individual.order == before || !individual.evaluated, "a change asks for an evaluation");
        }
    }

    #[test]
    fn as_many_tournaments_are_held_as_there_are_individuals() {
        // A single individual wins the only tournament, and then its mutant is evaluated.
        let boxes = scatter(80);
        let problem = Problem { objective: Objective::GoldsmithSalmon, ..Problem::new(&boxes) };
        let config = Config { population: 1, generations: 50, mutation: 0.05, ..Config::default() };
        let history = solve(&config, &problem, 3, Budget::UNLIMITED, &()).unwrap().history;
        assert_eq!(history.len(), 51);
        assert!(history.last().unwrap().incumbent < history[0].cost);
        for count in [1, 2, 7] {
            let population: Vec<Individual> = (0..count).map(f64::from).map(individual).collect();
            assert_eq!(select(&population, &mut stream(1, 0)).len(), count as usize);
        }
    }

    #[test]
    fn the_fitter_wins_and_pairs_and_mutants_are_as_many_as_their_probabilities_say() {
        let rng = &mut stream(1, 0);
        let pair = [individual(1.0), individual(2.0)];
        let population: Vec<Individual> = pair.iter().cycle().take(4000).cloned().collect();
        let winners = select(&population, rng);
        let fitter = winners.iter().filter(|winner| winner.cost == 1.0).count();
        assert!(
            (2850..3150).contains(&fitter),
            "{fitter} of 4000 where three of four are expected"
        );
        let fresh = |rng: &mut Stream| Individual {
            order: random_order(1000, rng),
            cost: 0.0,
            evaluated: true,
        };
        for (probability, expected) in [(0.0, 0..=0), (0.5, 80..=120), (1.0, 198..=200)] {
            let mut parents: Vec<Individual> = (0..200).map(|_| fresh(rng)).collect();
            cross(&mut parents, probability, &mut vec![false; 1000], rng);
            let children = parents.iter().filter(|parent| !parent.evaluated).count();
            assert!(expected.contains(&children), "{probability}: {children}");
        }
        // From 0 to 4 swaps, each equally likely.
        let mut kept = 0;
        let mut moved = 0;
        for _ in 0..2000 {
            let mut mutant = fresh(rng);
            let before = mutant.order.clone();
            mutate(&mut mutant, 0.002, rng);
            kept += usize::from(mutant.evaluated);
            moved += before.iter().zip(&mutant.order).filter(|(a, b)| a != b).count();
        }
        assert!((330..470).contains(&kept), "{kept} of 2000 where a fifth is expected");
        assert!((7500..8500).contains(&moved), "{moved} places where four of each are expected");
    }

    #[test]
    fn the_best_takes_the_place_of_the_least_fit() {
        let mut population = [3.0, 5.0, 4.0].map(individual);
        keep(&individual(2.0), &mut population);
        assert_eq!(population.map(|individual| individual.cost), [3.0, 2.0, 4.0]);
    }

    #[test]
    fn a_judge_takes_the_place_of_the_cost() {
        #[derive(Debug)]
        struct Depth;
        impl Judge for Depth {
            fn judge(&self, tree: &Bvh) -> f64 {
                tree.depth() as f64
            }
        }
        let boxes = scatter(200);
        let config = Config { population: 10, generations: 20, ..Config::default() };
        let depth = |judge: Option<&dyn Judge>| {
            let problem =
                Problem { objective: Objective::GoldsmithSalmon, judge, ..Problem::new(&boxes) };
            let outcome = solve(&config, &problem, 3, Budget::UNLIMITED, &()).unwrap();
            (outcome.tree.depth() as f64, outcome.cost)
        };
        let (judged, cost) = depth(Some(&Depth));
        assert!(judged == cost && judged < depth(None).0);
    }
}
