//! Recombination: the best tree in which every split comes from one of several trees.
//!
//! Good trees over the same objects share many *clades*, sets of objects below one node. A clade
//! may be divided as in any of the trees that have it, independently of the tree above. Dynamic
//! programming over the clades therefore finds the best of all combinations, which is never worse
//! than the best of the trees. Compare the crossover by common partitions (Whitley, Hains & Howe
//! 2009) and the clade-based search for species trees (Bryant 1996).

use crate::tree::{ANCHOR, Metric, NONE, Node, Working};

/// Returns the best tree over the clades of two trees over the same objects. Of two equal divisions
/// it keeps the `first` tree's. O(n), if every object has one leaf.
///
/// The leaves of a clade of the first tree are contiguous in its preorder. A clade of the second
/// tree is therefore shared only if its leaves are contiguous there, too (Day 1985).
pub(super) fn recombine<A: Metric>(first: &Working<A>, second: &Working<A>) -> Working<A> {
    let Some(root) = first.root() else { return first.clone() };
    let trees = [first, second];
    let spans = Spans::of(first);
    // A clade has the index of its node in the first tree, or follows all of them if only the
    // second tree has it.
    let of_first = (0..first.nodes.len() as u32).collect();
    let of_second = spans.clades(second, &positions(first, second, &spans.of_node));
    let clade_of: [Vec<u32>; 2] = [of_first, of_second];
    let clades = first.nodes.len() + second.nodes.len();
    // Per clade: cost of the best division, including the area of the clade's box, and the node
    // that has the division. Parts are smaller than the clade, so their costs are final.
    let mut best = vec![(f64::INFINITY, 0, NONE); clades];
    for (which, index) in by_size(trees) {
        let node = &trees[which].nodes[index as usize];
        let clades = &clade_of[which];
        let cost = if node.is_leaf() {
            A::LEAF * node.area
        } else {
            let [left, right] = node
                .children
                .map(|child| best[clades[child as usize] as usize].0);
            node.area + left + right
        };
        let best = &mut best[clades[index as usize] as usize];
        if cost < best.0 {
            *best = (cost, which, index);
        }
    }
    let mut nodes = vec![first.nodes[ANCHOR as usize]];
    let mut stack = vec![(root, ANCHOR, 0)];
    while let Some((clade, parent, side)) = stack.pop() {
        let (_, which, index) = best[clade as usize];
        let node = trees[which].nodes[index as usize];
        let to = nodes.len() as u32;
        nodes[parent as usize].children[side] = to;
        nodes.push(Node { parent, ..node });
        if !node.is_leaf() {
            let clades = &clade_of[which];
            stack.extend([1, 0].map(|side| (clades[node.children[side] as usize], to, side)));
        }
    }
    Working::from_nodes(nodes, first.metric())
}

/// Positions of leaves in preorder: `start..end`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Span {
    start: u32,
    end: u32,
}

/// The leaves below every node of a tree.
struct Spans {
    of_node: Vec<Span>,
    /// Per position, the largest clade that starts there, and the largest that ends there.
    starting: Vec<u32>,
    ending: Vec<u32>,
}

impl Spans {
    fn of(tree: &Working<impl Metric>) -> Self {
        let order = tree.preorder();
        let mut of_node = vec![Span::default(); tree.nodes.len()];
        let mut starting = vec![NONE; tree.objects()];
        let mut ending = vec![NONE; tree.objects()];
        let mut leaves = tree.objects() as u32;
        // From the back: children before their parent, and larger clades after smaller ones.
        for &index in order.iter().rev() {
            let node = &tree.nodes[index as usize];
            let span = if node.is_leaf() {
                leaves -= 1;
                Span { start: leaves, end: leaves + 1 }
            } else {
                let [left, right] = node.children.map(|child| of_node[child as usize]);
                Span { start: left.start, end: right.end }
            };
            of_node[index as usize] = span;
            starting[span.start as usize] = index;
            ending[span.end as usize - 1] = index;
        }
        Self { of_node, starting, ending }
    }

    /// Returns the clade of every node of another tree, whose leaves have these positions here: the
    /// index of the node here with the same clade, or an index after all of them.
    fn clades(&self, other: &Working<impl Metric>, positions: &[u32]) -> Vec<u32> {
        let mut clades = vec![NONE; other.nodes.len()];
        let mut extents = vec![(Span::default(), 0); other.nodes.len()];
        for &index in other.preorder().iter().rev() {
            let node = &other.nodes[index as usize];
            let extent = if node.is_leaf() {
                match positions[index as usize] {
                    // No clade here is as long.
                    NONE => (Span { start: 0, end: NONE }, 1),
                    start => (Span { start, end: start + 1 }, 1),
                }
            } else {
                let [left, right] = node.children.map(|child| extents[child as usize]);
                let start = left.0.start.min(right.0.start);
                let end = left.0.end.max(right.0.end);
                (Span { start, end }, left.1 + right.1)
            };
            extents[index as usize] = extent;
            let (span, leaves) = extent;
            let is_contiguous = span.end - span.start == leaves;
            // A right child is the largest clade that starts where it does, and a left child the
            // largest that ends where it does.
            let here = is_contiguous.then(|| {
                let candidates =
                    [self.starting[span.start as usize], self.ending[span.end as usize - 1]];
                candidates
                    .into_iter()
                    .find(|&here| self.of_node[here as usize] == span)
            });
            clades[index as usize] = here
                .flatten()
                .unwrap_or(self.of_node.len() as u32 + index);
        }
        clades
    }
}

/// Returns the nodes of both trees, each as tree and index, those with fewer leaves below first and
/// equal ones in the order of the trees.
fn by_size<A: Metric>(trees: [&Working<A>; 2]) -> Vec<(usize, u32)> {
    let orders = trees.map(Working::preorder);
    let mut sizes = trees.map(|tree| vec![0u32; tree.nodes.len()]);
    // A counting sort: the number of nodes of every size, and from it the first place of each.
    let most = trees
        .map(Working::objects)
        .into_iter()
        .max()
        .unwrap_or(0);
    let mut places = vec![0usize; most + 2];
    for which in 0..2 {
        for &index in orders[which].iter().rev() {
            let node = &trees[which].nodes[index as usize];
            let sizes = &mut sizes[which];
            let size = if node.is_leaf() {
                1
            } else {
                let [left, right] = node.children.map(|child| sizes[child as usize]);
                left + right
            };
            sizes[index as usize] = size;
            places[size as usize + 1] += 1;
        }
    }
    for size in 1..places.len() {
        places[size] += places[size - 1];
    }
    let mut sorted = vec![(0, NONE); orders[0].len() + orders[1].len()];
    for which in 0..2 {
        for &index in &orders[which] {
            let place = &mut places[sizes[which][index as usize] as usize];
            sorted[*place] = (which, index);
            *place += 1;
        }
    }
    sorted
}

/// Returns the position in the first tree of every leaf of the second, by node; `NONE` if the first
/// tree has no such leaf. An object that may have several leaves is known by its box, too.
fn positions<A: Metric>(first: &Working<A>, second: &Working<A>, spans: &[Span]) -> Vec<u32> {
    let mut positions = vec![NONE; second.nodes.len()];
    if A::LEAF == 0.0 {
        let mut of_object = vec![NONE; first.objects()];
        for leaf in leaves(first) {
            of_object[first.nodes[leaf as usize].children[1] as usize] = spans[leaf as usize].start;
        }
        for leaf in leaves(second) {
            positions[leaf as usize] = of_object[second.nodes[leaf as usize].children[1] as usize];
        }
        return positions;
    }
    let keyed = |tree: &Working<A>| {
        let mut keyed: Vec<_> = leaves(tree)
            .map(|leaf| {
                let node = &tree.nodes[leaf as usize];
                let planes = node.aabb.planes();
                (
                    node.children[1],
                    planes.map(|corner| [0, 1, 2].map(|axis| corner[axis].to_bits())),
                    leaf,
                )
            })
            .collect();
        keyed.sort_unstable();
        keyed
    };
    let of_first = keyed(first);
    for (object, planes, leaf) in keyed(second) {
        let at = of_first.partition_point(|&(a, b, _)| (a, b) < (object, planes));
        if let Some(&(a, b, other)) = of_first.get(at)
            && (a, b) == (object, planes)
        {
            positions[leaf as usize] = spans[other as usize].start;
        }
    }
    positions
}

/// The leaves in the tree.
fn leaves(tree: &Working<impl Metric>) -> impl Iterator<Item = u32> {
    tree.preorder()
        .into_iter()
        .filter(|&index| tree.nodes[index as usize].is_leaf())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::stream;
    use crate::scatter::built;
    use bvh_build::muller_fellner;
    use bvh_core::{Aabb, validate};
    use rand::RngExt;

    #[test]
    fn the_recombined_tree_has_the_best_part_of_every_parent() {
        let boxes: Vec<Aabb> = (0..200u16)
            .map(|i| {
                let low = [f32::from(i) * 1.7 % 9.0, f32::from(i) * 2.3 % 7.0, f32::from(i / 3)];
                Aabb::from((low, low.map(|c| c + 1.0)))
            })
            .collect();
        let good = built(&muller_fellner::Config::default(), &boxes);
        let [left, right] = good.nodes[good.root().unwrap() as usize].children;
        // Two parents, each degraded on one side of the root.
        let spoilt = |side: u32| {
            let mut tree = good.clone();
            let mut rng = stream(u64::from(side), 0);
            tree.begin();
            for _ in 0..20 {
                let mut node = side;
                while !tree.nodes[node as usize].is_leaf() {
                    node = tree.nodes[node as usize].children[usize::from(rng.random::<bool>())];
                }
                if node != side && tree.nodes[node as usize].parent != side {
                    tree.detach(node);
                    let place = tree.nodes[side as usize].children[0];
                    tree.attach(node, place);
                }
            }
            tree
        };
        let a = spoilt(left);
        let b = spoilt(right);
        let found = recombine(&a, &b);
        validate(&found.to_bvh(), &boxes).unwrap();
        assert!(a.area() > good.area() && b.area() > good.area());
        assert!(found.area() <= good.area() * (1.0 + 1e-12), "{} {}", found.area(), good.area());
        assert_eq!(recombine(&good, &good).to_bvh(), good.to_bvh());
        let empty = built(&muller_fellner::Config::default(), &[]);
        assert_eq!(recombine(&empty, &empty).objects(), 0);
    }
}
