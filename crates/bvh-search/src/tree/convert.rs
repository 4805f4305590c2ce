//! Conversion between flat trees, shapes of trees and the working form.

use super::{ANCHOR, Metric, NONE, Node, Working, part};
use crate::run::SearchError;
use bvh_core::cost::Sum;
use bvh_core::{Aabb, Bvh, Node as BvhNode, NodeKind, PackedAabb};

/// A tree of whole objects without its boxes: in preorder, the object of every leaf, and `NONE` for
/// every inner node. An eighth of the memory of the flat form.
pub(crate) struct Shape(Vec<u32>);

impl<M: Metric> Working<M> {
    /// Builds the working form of a valid tree with one object per leaf and tight boxes. Rejects
    /// inner nodes with more than two children. O(n).
    pub fn from_bvh(tree: &Bvh, metric: M) -> Result<Self, SearchError> {
        let mut working = Self::new(Vec::with_capacity(tree.nodes.len() + 1), metric);
        working.refill(tree)?;
        Ok(working)
    }

    /// Becomes the working form of another tree, in the memory that it has. O(n).
    pub fn refill(&mut self, tree: &Bvh) -> Result<(), SearchError> {
        let metric = self.metric;
        let mut sum = Sum::default();
        let nodes = &mut self.nodes;
        nodes.clear();
        nodes.push(Node::ANCHOR);
        // Leaves write to two dummy slots, so the store needs no branch, which the processor could
        // not predict.
        let mut parents = vec![ANCHOR; tree.nodes.len() + 2];
        for (index, (node, place)) in tree.nodes.iter().zip(1..).enumerate() {
            let (first, count, leaf) = match node.kind() {
                NodeKind::Inner { first, count } => (first, count, false),
                NodeKind::Leaf { first, .. } => (first, 2, true),
            };
            if count != 2 {
                return Err(SearchError::NotBinary { node: index, children: count });
            }
            let below = if leaf { tree.nodes.len() } else { first as usize };
            (parents[below], parents[below + 1]) = (place, place);
            let object = tree.prim_ids[if leaf { first as usize } else { 0 }];
            let children = if leaf { [NONE, object] } else { [first + 1, first + 2] };
            let aabb = PackedAabb::from(&node.aabb);
            let area = metric.of(&aabb);
            let parent = parents[index];
            let node = Node { aabb, area, parent, children, ..Node::ANCHOR };
            sum.add(part(&node, metric));
            nodes.push(node);
        }
        if nodes.len() > 1 {
            nodes[0].children[0] = 1;
        }
        self.restart(sum);
        Ok(())
    }

    /// Returns the flat tree, with adjacent children, left before right, and objects in leaf order.
    pub fn to_bvh(&self) -> Bvh {
        self.to_bvh_in(Bvh::default())
    }

    /// Returns the flat tree like [`to_bvh`](Self::to_bvh), in the memory of another tree. The first
    /// use of fresh memory takes several times as long as the conversion.
    pub fn to_bvh_in(&self, mut tree: Bvh) -> Bvh {
        tree.nodes.clear();
        tree.prim_ids.clear();
        let Some(root) = self.root() else { return tree };
        let count = self.nodes.len() - 1;
        let placeholder = BvhNode::leaf(Aabb::EMPTY, 0, 0);
        tree.nodes.resize(count, placeholder);
        tree.prim_ids.reserve(self.objects());
        let mut free = 1;
        let mut stack = Vec::with_capacity(64);
        let mut next = Some((root, 0));
        while let Some((place, to)) = next {
            let node = &self.nodes[place as usize];
            let aabb = Aabb::from(&node.aabb);
            let [left, right] = node.children;
            // Preorder in the flat tree, with a stack of right children only: left ones follow at
            // once.
            if left == NONE {
                tree.nodes[to as usize] = BvhNode::leaf(aabb, tree.prim_ids.len() as u32, 1);
                tree.prim_ids.push(right);
                next = stack.pop();
            } else {
                tree.nodes[to as usize] = BvhNode::inner(aabb, free, 2);
                stack.push((right, free + 1));
                next = Some((left, free));
                free += 2;
            }
        }
        tree
    }

    /// Returns the shape. Leaves hold whole objects. O(n).
    pub fn shape(&self) -> Shape {
        let mut objects = Vec::with_capacity(self.nodes.len());
        self.visit_in_preorder(|index, _, _, _| {
            let node = &self.nodes[index as usize];
            objects.push(if node.is_leaf() { node.children[1] } else { NONE });
        });
        Shape(objects)
    }

    /// Becomes the tree of this shape over the same boxes, in the memory that it has. O(n).
    pub fn reshape(&mut self, shape: &Shape, boxes: &[Aabb]) {
        let nodes = &mut self.nodes;
        nodes.clear();
        nodes.push(Node::ANCHOR);
        let mut places = vec![(ANCHOR, 0)];
        for (&object, index) in shape.0.iter().zip(1..) {
            let (parent, side) = places.pop().unwrap_or((ANCHOR, 0));
            nodes[parent as usize].children[side] = index;
            nodes.push(Node { parent, children: [NONE, object], ..Node::ANCHOR });
            if object == NONE {
                places.extend([(index, 1), (index, 0)]);
            }
        }
        for index in (1..self.nodes.len()).rev() {
            let node = &self.nodes[index];
            let aabb = match node.children {
                [NONE, object] => PackedAabb::from(&boxes[object as usize]),
                children => self.union_of(children),
            };
            let area = self.metric.of(&aabb);
            (self.nodes[index].aabb, self.nodes[index].area) = (aabb, area);
        }
        self.forget_changes();
    }
}
