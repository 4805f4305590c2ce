//! The shape of a tree alone, for trees that wait while another is searched.

use super::{ANCHOR, Metric, NONE, Node, Working};
use bvh_core::{Aabb, PackedAabb};

/// A tree of whole objects without its boxes: in preorder, the object of every leaf, and `NONE` for
/// every inner node. An eighth of the memory of the flat form.
pub(crate) struct Shape(Vec<u32>);

impl<M: Metric> Working<M> {
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
