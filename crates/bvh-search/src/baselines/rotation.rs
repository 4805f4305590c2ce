//! Tree rotations: swaps of subtrees one and two levels below a node, until a local optimum.
//!
//! Kensler 2008, 'Tree rotations for improving bounding volume hierarchies': a child is swapped
//! with a grandchild of the other side (four ways), or two grandchildren of different sides are
//! swapped (two ways).
//!
//! Differs from the paper: hill climbing only. Simulated annealing is in
//! [annealing](crate::annealing), on reinsertion moves; every rotation is one or two reinsertions.

use crate::local::TOLERANCE;
use crate::local::incumbent::Incumbent;
use crate::run::{Found, Observer, Problem, Quota, Run, Tally};
use crate::tree::{Metric, Working, search_by_metric};
use bvh_core::with_vector_instructions;

bvh_config::config! {
    /// Without parameters.
    pub struct Config {}
}

search_by_metric!(Config);

impl Config {
    fn search_by(&self, metric: impl Metric, problem: &Problem, _: u64, run: &mut Run) -> Found {
        let (mut best, mut tree) = Incumbent::build(problem, metric, run)?;
        best.improve(&mut tree, run, pass_bottom_up);
        Ok(best.tree)
    }
}

fn pass_bottom_up(tree: &mut Working<impl Metric>, quota: Quota, observer: &dyn Observer) -> Tally {
    let mut order = tree.preorder();
    order.reverse();
    pass(tree, &order, quota, observer)
}

with_vector_instructions! {
    /// Makes the best rotation at every node of `order`, if one pays. Stops early when the quota is
    /// used up or the observer cancels.
    pass = pass_plain(tree: &mut Working<impl Metric>, order: &[u32], quota: Quota, observer: &dyn Observer) -> Tally
}

#[inline(always)]
fn pass_plain(
    tree: &mut Working<impl Metric>,
    order: &[u32],
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    let mut done = Tally::default();
    for &node in order {
        if tree.nodes[node as usize].is_leaf() {
            continue;
        }
        // A poll may read a clock, hence only at every 1024th node.
        if quota.is_reached(&done) || done.moves % 1024 == 1023 && observer.cancelled() {
            break;
        }
        done.moves += 1;
        // The node, its children and grandchildren.
        done.work += 7;
        if let Some(rotation) = best(tree, node) {
            tree.begin();
            rotation.apply(tree);
            done.kept += 1;
        }
    }
    done
}

/// A rotation, as the new children of two nodes, the lower node first.
#[derive(Clone, Copy, Debug)]
struct Rotation([(u32, [u32; 2]); 2]);

impl Rotation {
    fn apply(self, tree: &mut Working<impl Metric>) {
        self.0.into_iter().for_each(|(node, children)| tree.join(node, children));
    }
}

/// Returns the rotation at an inner node that saves most, if any saves area. No rotation changes
/// the box of the node itself, so its ancestors stay tight.
#[inline(always)]
fn best(tree: &Working<impl Metric>, top: u32) -> Option<Rotation> {
    let area = |children| tree.metric().of(&tree.union_of(children));
    let node = |index: u32| &tree.nodes[index as usize];
    let sides = node(top).children;
    let mut most = TOLERANCE * node(top).area;
    let mut best = None;
    for [from, other] in [sides, [sides[1], sides[0]]] {
        if node(from).is_leaf() {
            continue;
        }
        let pair = node(from).children;
        for [leaves, stays] in [pair, [pair[1], pair[0]]] {
            let saved = node(from).area - area([other, stays]);
            if saved > most {
                most = saved;
                best = Some(Rotation([(from, [other, stays]), (top, [from, leaves])]));
            }
        }
    }
    let [left, right] = sides;
    if !node(left).is_leaf() && !node(right).is_leaf() {
        let [a, b] = node(left).children;
        let pair = node(right).children;
        for [c, d] in [pair, [pair[1], pair[0]]] {
            let saved = node(left).area + node(right).area - area([a, c]) - area([b, d]);
            if saved > most {
                most = saved;
                best = Some(Rotation([(left, [a, c]), (right, [b, d])]));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::{built, scatter};
    use bvh_build::median_cut;

    /// The total areas of all trees that are one rotation at this node away, with recomputed boxes.
    fn neighbours(tree: &Working, top: u32) -> Vec<f64> {
        let below = |index: u32| {
            let node = &tree.nodes[index as usize];
            if node.is_leaf() { vec![] } else { node.children.to_vec() }
        };
        let [left, right] = tree.nodes[top as usize].children;
        let mut pairs: Vec<(u32, u32)> =
            below(left).into_iter().map(|below| (below, right)).collect();
        pairs.extend(below(right).into_iter().map(|below| (below, left)));
        pairs.extend(
            below(left).iter().flat_map(|&a| below(right).into_iter().map(move |b| (a, b))),
        );
        let swapped = |(a, b)| {
            let mut other = tree.clone();
            for (old, new) in [(a, b), (b, a)] {
                let parent = tree.nodes[old as usize].parent;
                let children = &mut other.nodes[parent as usize].children;
                children[usize::from(tree.nodes[parent as usize].children[0] != old)] = new;
                other.nodes[new as usize].parent = parent;
            }
            for index in other.preorder().into_iter().rev() {
                if !other.nodes[index as usize].is_leaf() {
                    let aabb = other.union_of(other.nodes[index as usize].children);
                    other.nodes[index as usize].area = aabb.half_area();
                    other.nodes[index as usize].aabb = aabb;
                }
            }
            other.internal_area()
        };
        pairs.into_iter().map(swapped).collect()
    }

    #[test]
    fn the_rotation_chosen_is_the_best_of_all_at_its_node() {
        let tree = built(&median_cut::Config::default(), &scatter(64));
        for top in tree.preorder() {
            if tree.nodes[top as usize].is_leaf() {
                continue;
            }
            let least = neighbours(&tree, top).into_iter().fold(tree.area(), f64::min);
            let mut rotated = tree.clone();
            if let Some(rotation) = best(&tree, top) {
                rotation.apply(&mut rotated);
            }
            assert!((rotated.area() - least).abs() <= 1e-12 * least, "{} {least}", rotated.area());
        }
    }
}
