//! Every cost that the workspace reports, as a documented formula in f64.
//!
//! Areas are *half* surface areas in world units squared. Coordinates are promoted to f64 before
//! they are subtracted. Sums are compensated: the order of the nodes changes at most the last bit
//! or two of a cost. A cost that is divided by the root's area is 0 by definition if that area is
//! 0.

use crate::{Aabb, Bvh, Node, NodeKind, PackedAabb};

pub use crate::layout_cost::{
    CallBoth, LayoutCost, LayoutTree, call_in_turn, layout_area, layout_cost, layout_row,
};

/// The cost that a search minimises and that results report in the column `cost`.
///
/// ```
/// # use bvh_core::{Aabb, Bvh, Node, cost::Objective};
/// # let boxes = [Aabb::from([[0.0; 3], [1.0; 3]]), Aabb::from([[2.0; 3], [3.0; 3]])];
/// # let root = Node::inner(boxes[0].union(&boxes[1]), 1, 2);
/// # let tree = Bvh::new(vec![root, Node::leaf(boxes[0], 0, 1), Node::leaf(boxes[1], 1, 1)], vec![0, 1]);
/// // A root of 3 × 3 × 3 over two leaves: half of its surface.
/// assert_eq!(Objective::InternalArea.cost(&tree), 27.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum Objective {
    /// [`internal_area`], the paper's objective.
    #[default]
    InternalArea,
    /// [`goldsmith_salmon`].
    GoldsmithSalmon,
    /// [`sah`] with the given constants.
    Sah(SahConstants),
    /// [`layout_area`], the cost of the [`WideBvh`](crate::WideBvh) that the tree becomes for
    /// tracing.
    Layout,
}

impl Objective {
    /// Returns the cost of a valid tree under this objective. O(nodes).
    pub fn cost(&self, tree: &Bvh) -> f64 {
        self.cost_by(tree, &Area)
    }

    /// Returns the cost of `tree` under this objective with a measure of boxes instead of their
    /// half areas. O(nodes).
    pub fn cost_by(&self, tree: &Bvh, measure: &dyn Measure) -> f64 {
        let root = tree.nodes.first().map_or(0.0, |root| size_by(measure, root));
        match self {
            Self::InternalArea => internal_measure(tree, measure),
            Self::GoldsmithSalmon => {
                let term = |node: &Node| match node.children().len() {
                    // A leaf, whose measure need not be computed.
                    0 => 0.0,
                    children => size_by(measure, node) * children as f64,
                };
                over(root, sum_over(tree, term))
            }
            Self::Sah(constants) => {
                let term = |node: &Node| size_by(measure, node) * constants.cost_of(node);
                over(root, sum_over(tree, term))
            }
            Self::Layout => layout_cost(tree, Some(measure), &call_in_turn),
        }
    }
}

/// A measure of boxes that builders and searches can use instead of the half area: the expected
/// number of rays that enter a box, for example.
pub trait Measure: core::fmt::Debug + Sync {
    /// Returns the measure of a box that is not empty. The measure is finite, not negative, and
    /// *monotone*: no box has a smaller measure than a box inside it. Branch and bound is exact
    /// only for monotone measures.
    fn of(&self, aabb: &PackedAabb) -> f64;
}

/// The half area as a measure. Code that is generic over the measure is compiled for this type
/// without a virtual call.
#[derive(Clone, Copy, Debug, Default)]
pub struct Area;

impl Measure for Area {
    #[inline(always)]
    fn of(&self, aabb: &PackedAabb) -> f64 {
        aabb.half_area()
    }
}

/// Returns the total measure of the boxes of all inner nodes, root included, in the measure's unit.
/// O(nodes).
pub fn internal_measure(tree: &Bvh, measure: &dyn Measure) -> f64 {
    sum_over(tree, |node| if node.is_leaf() { 0.0 } else { size_by(measure, node) })
}

/// Returns the total measure of the boxes of all nodes, leaves included. O(nodes).
pub fn total_measure(tree: &Bvh, measure: &dyn Measure) -> f64 {
    sum_over(tree, |node| size_by(measure, node))
}

fn size_by(measure: &dyn Measure, node: &Node) -> f64 {
    measure.of(&PackedAabb::from(&node.aabb))
}

/// Returns the total half area of the boxes of all nodes, leaves included, in world units squared.
/// O(nodes).
///
/// The surface area heuristic with equal constants reduces to this sum if every leaf has one
/// reference. Searches of trees with [split references](crate::Clip) minimise it.
pub fn total_area(tree: &Bvh) -> f64 {
    total_measure(tree, &Area)
}

/// The constants of the surface area heuristic, in any common unit of time. Every tree of finite
/// boxes has a finite cost with any constants that [`new`](Self::new) accepts.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct SahConstants {
    /// Cost of visiting an inner node. Default 1.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "checked"))]
    pub(crate) traversal: f64,
    /// Cost of testing one object. Default 1.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "checked"))]
    pub(crate) intersection: f64,
}

/// A rejected constant.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{found} is not a constant from 0 to {:e}", SahConstants::MAX)]
pub struct InvalidConstant {
    /// The value found.
    pub found: f64,
}

impl SahConstants {
    /// The largest constant. It is far too small to overflow the sum over the largest tree of the
    /// largest boxes.
    pub const MAX: f64 = 1e200;

    /// Makes constants from the cost of visiting an inner node and the cost of testing one object,
    /// each from 0 to [`MAX`](Self::MAX).
    pub fn new(traversal: f64, intersection: f64) -> Result<Self, InvalidConstant> {
        for found in [traversal, intersection] {
            // NaN is in no range.
            if !(0.0..=Self::MAX).contains(&found) {
                return Err(InvalidConstant { found });
            }
        }
        Ok(Self { traversal, intersection })
    }

    /// Returns the cost of visiting an inner node.
    pub fn traversal(&self) -> f64 {
        self.traversal
    }

    /// Returns the cost of testing one object.
    pub fn intersection(&self) -> f64 {
        self.intersection
    }

    #[inline]
    pub(crate) fn cost_of(&self, node: &Node) -> f64 {
        match node.kind() {
            NodeKind::Inner { .. } => self.traversal,
            NodeKind::Leaf { count, .. } => self.intersection * f64::from(count),
        }
    }
}

#[cfg(feature = "serde")]
fn checked<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let constant = serde::Deserialize::deserialize(deserializer)?;
    // Both constants have the same range.
    SahConstants::new(constant, constant).map(|_| constant).map_err(serde::de::Error::custom)
}

impl Default for SahConstants {
    fn default() -> Self {
        Self { traversal: 1.0, intersection: 1.0 }
    }
}

/// Returns the paper's objective: the total half area of the boxes of all inner nodes, root
/// included, in world units squared. Values of different scenes cannot be compared. O(nodes).
///
/// Source: Ng & Trifonov 2003, section 3.3. Differs from the paper: half areas instead of full
/// areas, as in the paper's implementation (section 3.2).
pub fn internal_area(tree: &Bvh) -> f64 {
    sum_over(tree, inner_half_area)
}

#[inline]
fn inner_half_area(node: &Node) -> f64 {
    // The processor cannot predict whether a node is a leaf. Both values are computed and one is
    // selected, without a branch. Adding 0 changes no sum.
    core::hint::select_unpredictable(node.is_leaf(), 0.0, node.aabb.half_area())
}

/// Returns the Goldsmith–Salmon cost: Σ over inner nodes of S(node) / S(root) · number of children.
/// O(nodes).
///
/// The cost has no dimension. It is the expected number of boxes below the root that a random line
/// through the root's box is tested against.
///
/// Source: Goldsmith & Salmon 1987; Ng & Trifonov 2003, section 1.
pub fn goldsmith_salmon(tree: &Bvh) -> f64 {
    Objective::GoldsmithSalmon.cost(tree)
}

/// Returns the surface area heuristic:
/// traversal · Σ inner S/S(root) + intersection · Σ leaves S/S(root) · objects. O(nodes).
///
/// The cost is a dimensionless multiple of the constants' unit. It is the expected time per random
/// line through the root's box.
///
/// Source: MacDonald & Booth 1990.
pub fn sah(tree: &Bvh, constants: &SahConstants) -> f64 {
    Objective::Sah(*constants).cost(tree)
}

#[inline]
fn sum_over(tree: &Bvh, term: impl Fn(&Node) -> f64) -> f64 {
    tree.nodes.iter().map(term).collect::<Sum>().value()
}

/// Returns `area` divided by the half area of the root's box; 0 if the root's area is 0 or the tree
/// is empty.
pub fn over_root_area(tree: &Bvh, area: f64) -> f64 {
    let root = tree.root_aabb().unwrap_or(Aabb::EMPTY);
    over(root.half_area(), area)
}

fn over(root: f64, total: f64) -> f64 {
    if root > 0.0 { total / root } else { 0.0 }
}

/// A compensated sum (Neumaier 1974). It is as accurate as a sum in twice the precision.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    total: f64,
    lost: f64,
}

impl Sum {
    /// Adds one term.
    #[inline]
    pub fn add(&mut self, term: f64) {
        let total = self.total + term;
        // The larger operand is subtracted first: only then is the rounding error exact.
        self.lost += if self.total.abs() >= term.abs() {
            (self.total - total) + term
        } else {
            (term - total) + self.total
        };
        self.total = total;
    }

    /// Returns the sum so far.
    #[inline]
    pub fn value(&self) -> f64 {
        self.total + self.lost
    }
}

impl FromIterator<f64> for Sum {
    #[inline]
    fn from_iter<I: IntoIterator<Item = f64>>(terms: I) -> Self {
        let mut sum = Self::default();
        terms.into_iter().for_each(|term| sum.add(term));
        sum
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Unit cubes at x = 0 and x = 2 under one root of half area 7.
    pub(crate) fn two_cubes() -> Bvh {
        let boxes =
            [Aabb::from(([0.0; 3], [1.0; 3])), Aabb::from(([2.0, 0.0, 0.0], [3.0, 1.0, 1.0]))];
        let root = Node::inner(boxes[0].union(&boxes[1]), 1, 2);
        let nodes = vec![root, Node::leaf(boxes[0], 0, 1), Node::leaf(boxes[1], 1, 1)];
        Bvh::new(nodes, vec![0, 1])
    }

    #[test]
    fn the_costs_of_two_cubes_are_those_computed_by_hand() {
        let tree = two_cubes();
        assert_eq!(sah(&tree, &SahConstants::default()), 1.0 + 6.0 / 7.0);
        assert_eq!(sah(&tree, &SahConstants { traversal: 2.0, intersection: 0.0 }), 2.0);
        for (objective, cost) in [
            (Objective::InternalArea, 7.0),
            (Objective::GoldsmithSalmon, 2.0),
            (Objective::Sah(SahConstants::default()), 1.0 + 6.0 / 7.0),
            // Both cubes in one block.
            (Objective::Layout, 7.0),
        ] {
            assert_eq!(objective.cost(&tree), cost, "{objective:?}");
            assert_eq!(objective.cost_by(&tree, &Area), cost, "{objective:?}");
        }
    }

    #[test]
    fn constants_that_could_make_a_cost_infinite_or_nan_are_rejected() {
        for wrong in [f64::NAN, f64::INFINITY, -1.0, 2e200] {
            for rejected in [SahConstants::new(wrong, 1.0), SahConstants::new(1.0, wrong)] {
                let error = rejected.unwrap_err().to_string();
                assert_eq!(error, format!("{wrong} is not a constant from 0 to 1e200"));
            }
        }
        let largest_box =
            Aabb { min: glam::Vec3::splat(f32::MIN), max: glam::Vec3::splat(f32::MAX) };
        let largest_leaf = Node::leaf(largest_box, 0, u32::MAX >> 1);
        let tree = Bvh::new(vec![largest_leaf; 100], vec![]);
        let constants = SahConstants::new(SahConstants::MAX, SahConstants::MAX).unwrap();
        assert!(sah(&tree, &constants).is_finite());
    }

    #[test]
    fn trees_without_inner_nodes_or_area_cost_nothing() {
        let point = Aabb::from(([1.0; 3], [1.0; 3]));
        let flat = Bvh::new(
            vec![Node::inner(point, 1, 2), Node::leaf(point, 0, 1), Node::leaf(point, 1, 1)],
            vec![0, 1],
        );
        let single = Bvh::new(vec![Node::leaf(point, 0, 1)], vec![0]);
        let sah = Objective::Sah(SahConstants::default());
        for tree in [Bvh::default(), single, flat] {
            for objective in
                [Objective::InternalArea, Objective::GoldsmithSalmon, sah, Objective::Layout]
            {
                assert_eq!(objective.cost(&tree), 0.0, "{objective:?} of {tree:?}");
            }
        }
    }

    #[test]
    fn a_sum_does_not_depend_on_the_order_of_its_terms() {
        // The terms span 30 orders of magnitude, so plain sums would differ.
        let terms: Vec<f64> =
            (0..1000).map(|i| f64::from(i * i % 997) * 10f64.powi(i % 30)).collect();
        let forwards: Sum = terms.iter().copied().collect();
        let backwards: Sum = terms.iter().rev().copied().collect();
        assert_eq!(forwards.value(), backwards.value());
    }
}
