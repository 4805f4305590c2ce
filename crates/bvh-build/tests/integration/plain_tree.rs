//! Goldsmith–Salmon by brute force: a plain tree that recomputes all costs and tries every stop.

use bvh_build::goldsmith_salmon::{Config, Descent};
use bvh_core::Aabb;

/// A node of the plain tree. A leaf has an object and no children.
#[derive(Clone)]
pub struct Plain {
    object: Option<u32>,
    children: Vec<Plain>,
}

impl Plain {
    fn leaf(object: u32) -> Self {
        Self { object: Some(object), children: vec![] }
    }

    pub fn aabb(&self, boxes: &[Aabb]) -> Aabb {
        let mut aabb = match self.object {
            Some(object) => boxes[object as usize],
            None => Aabb::EMPTY,
        };
        for child in &self.children {
            aabb = aabb.union(&child.aabb(boxes));
        }
        aabb
    }

    fn area_with(&self, boxes: &[Aabb], id: u32) -> f64 {
        self.aabb(boxes).union(&boxes[id as usize]).half_area()
    }

    /// Returns whether this is an inner node whose box contains object `id`.
    fn contains(&self, boxes: &[Aabb], id: u32) -> bool {
        self.object.is_none() && self.aabb(boxes).contains(&boxes[id as usize])
    }

    /// Returns Σ S · children of the full subtree.
    pub fn cost(&self, boxes: &[Aabb]) -> f64 {
        let below: f64 = self.children.iter().map(|child| child.cost(boxes)).sum();
        self.aabb(boxes).half_area() * self.children.len() as f64 + below
    }

    /// Returns this tree with object `id` inserted at a node, which is given by a path of child
    /// positions.
    fn with(&self, path: &[usize], id: u32, pair: bool) -> Self {
        let mut tree = self.clone();
        let Some((&last, above)) = path.split_last() else {
            if pair {
                return Self { object: None, children: vec![tree, Self::leaf(id)] };
            }
            tree.children.push(Self::leaf(id));
            return tree;
        };
        let mut parent = &mut tree;
        for &position in above {
            parent = &mut parent.children[position];
        }
        let child = &mut parent.children[last];
        let was_leaf = child.object.is_some();
        *child = child.with(&[], id, pair);
        if was_leaf {
            // A leaf became an inner node. Inner nodes are in front of leaves.
            let front = parent.children.iter().position(|child| child.object.is_some());
            if let Some(front) = front
                && front < last
            {
                parent.children.swap(last, front);
            }
        }
        tree
    }

    /// Returns the child at which the descent for object `id` continues.
    fn next_child(&self, config: &Config, boxes: &[Aabb], id: u32) -> usize {
        if let Some(containing) = self.children.iter().position(|child| child.contains(boxes, id)) {
            return containing;
        }
        let mut best = (f64::INFINITY, 0);
        for (position, child) in self.children.iter().enumerate() {
            let growth = child.growth(config, boxes, id);
            if growth < best.0 {
                best = (growth, position);
            }
        }
        best.1
    }

    fn growth(&self, config: &Config, boxes: &[Aabb], id: u32) -> f64 {
        let before = self.aabb(boxes).half_area();
        let after = self.area_with(boxes, id);
        match (config.descent, self.object) {
            (Descent::Area, _) => after - before,
            (Descent::Cost, None) => (after - before) * self.children.len() as f64,
            (Descent::Cost, Some(_)) => 2.0 * after,
        }
    }

    /// Tries every stop of the path and keeps the cheapest tree, the first among equal trees, from
    /// the last inner node that contains the object downwards.
    fn insert(&self, config: &Config, boxes: &[Aabb], id: u32) -> Self {
        let mut node = self;
        let mut path = vec![];
        // Paths, and whether the object is paired with the node or becomes its child.
        let mut stops = vec![];
        let mut last_containing = 0;
        loop {
            if node.contains(boxes, id) {
                last_containing = stops.len();
            }
            if node.object.is_none() {
                stops.push((path.clone(), false));
            }
            if node.object.is_some() || config.pair_inner {
                stops.push((path.clone(), true));
            }
            if node.object.is_some() {
                break;
            }
            let next = node.next_child(config, boxes, id);
            node = &node.children[next];
            path.push(next);
        }
        let mut trees = vec![];
        for (path, pair) in &stops {
            trees.push(self.with(path, id, *pair));
        }
        let best = cheapest(&trees[last_containing..], boxes);
        // No stop above the last containing node is cheaper.
        assert_eq!(best.cost(boxes), cheapest(&trees, boxes).cost(boxes));
        best.clone()
    }

    /// Returns the nodes depth first: the number of children of an inner node, the object of a
    /// leaf.
    pub fn topology(&self) -> Vec<Result<usize, u32>> {
        let mut nodes = vec![match self.object {
            Some(object) => Err(object),
            None => Ok(self.children.len()),
        }];
        for child in &self.children {
            nodes.extend(child.topology());
        }
        nodes
    }
}

fn cheapest<'t>(trees: &'t [Plain], boxes: &[Aabb]) -> &'t Plain {
    let mut best = &trees[0];
    for tree in &trees[1..] {
        if tree.cost(boxes) < best.cost(boxes) {
            best = tree;
        }
    }
    best
}

pub fn brute_force(config: &Config, boxes: &[Aabb], order: &[u32]) -> Plain {
    let mut tree = Plain::leaf(order[0]);
    for &id in &order[1..] {
        tree = tree.insert(config, boxes, id);
    }
    tree
}
