//! Checks of one method's outcome on the scene of a single case, beyond P1 to P7.

use crate::Verdict;
use crate::examine::{ROUNDING, run};
use crate::transform::{mirrored, same_topology, shuffled};
use anyhow::{Result, ensure};
use bvh_build::muller_fellner;
use bvh_core::{Aabb, Bvh, cost};
use bvh_scenes::builtin::stiff::STADIUM;
use bvh_search::{Method, Outcome};

fn is_top_down(method: &Method) -> bool {
    matches!(method, Method::MullerFellner(_) | Method::MedianCut(_))
}

/// Returns true if the method is the published Müller–Fellner method. The variants of Table 2 build
/// worse trees on purpose.
fn is_greedy(method: &Method) -> bool {
    matches!(method, Method::MullerFellner(config) if config.heuristic == Default::default())
}

fn levels(objects: usize) -> usize {
    objects.max(1).next_power_of_two().trailing_zeros() as usize
}

/// S01, S02, S03: no node, one leaf without cost, one inner node over two leaves.
pub fn fewest_nodes(_: &Method, boxes: &[Aabb], outcome: &Outcome) -> Verdict {
    let Outcome { tree, cost, .. } = outcome;
    let is_least = tree.nodes.len() == (2 * boxes.len()).saturating_sub(1);
    ensure!(is_least && (boxes.len() == 2 || *cost == 0.0), "cost {cost}: {tree:?}");
    Ok(String::new())
}

/// S04, S07: the top-down builders halve the objects and order them by index.
pub fn balanced(method: &Method, boxes: &[Aabb], outcome: &Outcome) -> Verdict {
    let depth = outcome.tree.depth();
    if !is_top_down(method) {
        return Ok(String::new());
    }
    ensure!(depth <= levels(boxes.len()) + 1, "depth {depth} over {} equal boxes", boxes.len());
    if let Method::MullerFellner(_) = method {
        let by_index = outcome.tree.prim_ids.iter().zip(0..).all(|(&id, at)| id == at);
        ensure!(by_index, "equal boxes are not in the order of their indices");
    }
    Ok(format!("⌈log2 n⌉ = {}", levels(boxes.len())))
}

/// S05: the tree is balanced as in S04, and its cost is 0.
pub fn balanced_at_no_cost(method: &Method, boxes: &[Aabb], outcome: &Outcome) -> Verdict {
    ensure!(outcome.cost == 0.0, "P7: points cost {}", outcome.cost);
    balanced(method, boxes, outcome)
}

/// S10: the cost is 0, and the top-down builders' trees have the least possible depth.
pub fn shallow_at_no_cost(method: &Method, boxes: &[Aabb], outcome: &Outcome) -> Verdict {
    ensure!(outcome.cost == 0.0, "P7: segments on a line cost {}", outcome.cost);
    let depth = outcome.tree.depth();
    let least = levels(boxes.len());
    ensure!(!is_top_down(method) || depth == least, "depth {depth}, {least} would do");
    Ok(String::new())
}

/// S08: axes with the same order of objects are recognised, and the tree is the same.
pub fn same_orders_change_nothing(method: &Method, boxes: &[Aabb], outcome: &Outcome) -> Verdict {
    let Method::MullerFellner(config) = method else { return Ok(String::new()) };
    let config =
        muller_fellner::Config { skip_same_order: !config.skip_same_order, ..config.clone() };
    let other = run(&Method::MullerFellner(config), boxes, 0)?;
    ensure!(other.tree == outcome.tree, "another tree without the search for identical orders");
    Ok(String::new())
}

/// S09: every level of a good tree over a grid covers it about once.
pub fn about_one_cover_per_level(method: &Method, boxes: &[Aabb], outcome: &Outcome) -> Verdict {
    let covers = cost::over_root_area(&outcome.tree, outcome.cost);
    let limit = 1.1 * levels(boxes.len()) as f64;
    let binary = is_greedy(method) || matches!(method, Method::Agglomerative(_) | Method::Best(_));
    ensure!(!binary || covers <= limit, "{covers} root areas, {limit} are normal");
    Ok(format!("{covers:.2} root areas"))
}

/// S27: a node near the root holds the teapot and nothing else.
pub fn teapot_is_isolated(method: &Method, boxes: &[Aabb], outcome: &Outcome) -> Verdict {
    if !(is_greedy(method)
        || matches!(method, Method::Best(_) | Method::Reinsertion(_) | Method::Exact(_)))
    {
        return Ok(String::new());
    }
    let tree = &outcome.tree;
    let teapot = boxes.len().saturating_sub(STADIUM);
    let mut level = 0;
    let mut at = (!tree.nodes.is_empty()).then_some(0);
    // The teapot's node is on the path to the child that holds most of it.
    while let Some(node) = at {
        let below = objects_below(tree, node);
        let inside = below.iter().filter(|&&id| id as usize >= STADIUM).count();
        if inside == below.len() {
            ensure!(inside == teapot, "only {inside} of {teapot} together below level {level}");
            ensure!(level <= 8, "isolated at level {level} only");
            return Ok(format!("isolated at level {level}"));
        }
        at = tree.nodes[node].children().max_by_key(|&child| {
            objects_below(tree, child).iter().filter(|&&id| id as usize >= STADIUM).count()
        });
        level += 1;
    }
    ensure!(teapot == 0, "never isolated");
    Ok(String::new())
}

fn objects_below(tree: &Bvh, node: usize) -> Vec<u32> {
    let mut ids = Vec::new();
    let mut open = vec![node];
    while let Some(node) = open.pop() {
        ids.extend_from_slice(&tree.prim_ids[tree.nodes[node].prims()]);
        open.extend(tree.nodes[node].children());
    }
    ids
}

/// S28: reports the costs that compare binary trees with wider ones.
pub fn both_costs(_: &Method, _: &[Aabb], outcome: &Outcome) -> Verdict {
    let tree = &outcome.tree;
    let widest = tree.nodes.iter().map(|node| node.children().len()).max().unwrap_or(0);
    let area = cost::over_root_area(tree, outcome.cost);
    let gs = cost::goldsmith_salmon(tree);
    Ok(format!("{area:.3} root areas, Goldsmith–Salmon {gs:.3}, up to {widest} children"))
}

/// S32: the reflected scene costs the same.
///
/// Insertion and the exact optimum use only areas and indices, which no reflection changes.
/// Müller–Fellner breaks ties between equally good cuts towards the lower end, which a reflection
/// exchanges; in this scene both ends are alike. The check skips median cut, which gives an odd
/// object to the lower half, Morton curves, which begin at a corner, and searches that draw
/// positions.
pub fn reflection_costs_the_same(method: &Method, boxes: &[Aabb], outcome: &Outcome) -> Verdict {
    if !matches!(method, Method::MullerFellner(_) | Method::GoldsmithSalmon(_) | Method::Exact(_)) {
        return Ok(String::new());
    }
    for axis in 0..3 {
        let other = run(method, &mirrored(boxes, axis), 0)?;
        let close = (other.cost - outcome.cost).abs() <= ROUNDING * outcome.cost;
        ensure!(close, "axis {axis} reflected: cost {} and {}", other.cost, outcome.cost);
    }
    Ok("three reflections".into())
}

/// S33: the order of the objects changes nothing if no two centres coincide. Insertion depends on
/// the order; the check reports the range of its costs.
pub fn order_does_not_matter(method: &Method, boxes: &[Aabb], outcome: &Outcome) -> Verdict {
    const ORDERS: u64 = 20;
    if let Method::GoldsmithSalmon(_) = method {
        let costs = (0..ORDERS)
            .map(|seed| Ok(run(method, &shuffled(boxes, seed).0, 0)?.cost / outcome.cost));
        let mut costs = costs.collect::<Result<Vec<f64>>>()?;
        costs.sort_by(f64::total_cmp);
        let [low, high] =
            [costs.first(), costs.last()].map(|cost| cost.copied().unwrap_or(f64::NAN));
        return Ok(format!("{ORDERS} orders: {low:.3} to {high:.3} of this cost"));
    }
    if !is_top_down(method) {
        return Ok(String::new());
    }
    let (permuted, order) = shuffled(boxes, 33);
    let mut other = run(method, &permuted, 0)?;
    other.tree.prim_ids.iter_mut().for_each(|id| *id = order[*id as usize]);
    let same = same_topology(&other.tree, &outcome.tree) && other.cost == outcome.cost;
    ensure!(same, "another order of the objects: cost {} and {}", other.cost, outcome.cost);
    Ok(String::new())
}

/// S45: the root's half area is 3 · 1 + 1 · 1 + 1 · 3.
pub fn root_area_is_seven(_: &Method, _: &[Aabb], outcome: &Outcome) -> Verdict {
    let tree = &outcome.tree;
    let costs = [outcome.cost, cost::goldsmith_salmon(tree), cost::sah(tree, &Default::default())];
    ensure!(costs == [7.0, 2.0, 13.0 / 7.0], "costs {costs:?}");
    Ok(String::new())
}
