//! Traversal of the wide layout with any implementation of the box test.

use super::layout::WideView;
use super::node::{Child, Pending, WideNode};
use super::triangle4::Triangle4;
use crate::slabs::margin;
use crate::stack::Stack;
use crate::{Aabb, Counter, Hit, Ray, Shear};

/// A ray prepared for wide nodes.
pub(crate) struct WideRay {
    /// Which planes of a node the ray meets first, by axis, and which last.
    pub(crate) near: [usize; 3],
    pub(crate) far: [usize; 3],
    /// The margins of [`Slabs`] for those planes.
    pub(crate) near_origin: [f32; 3],
    pub(crate) far_origin: [f32; 3],
    pub(crate) inverse: [f32; 3],
    pub(crate) t_min: f32,
}

impl WideRay {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, bounds: &Aabb) -> Self {
        let (origin, inverse) = (ray.origin(), ray.inverse_direction());
        // Signs cannot be predicted: no branches. The same numbers as those of [`Slabs`].
        let margin = margin(ray, bounds).copysign(inverse);
        let backwards = inverse.to_array().map(|x| (x.to_bits() >> 31) as usize);
        Self {
            near: [3 * backwards[0], 1 + 3 * backwards[1], 2 + 3 * backwards[2]],
            far: [3 - 3 * backwards[0], 4 - 3 * backwards[1], 5 - 3 * backwards[2]],
            near_origin: (origin + margin).to_array(),
            far_origin: (origin - margin).to_array(),
            inverse: inverse.to_array(),
            t_min: ray.t_min(),
        }
    }
}

/// A way to test the eight boxes of a node at once.
pub(crate) trait Expand {
    /// The nearest of the children that the ray enters before `t_max`, and the number of the others, which are written
    /// to `others`, the nearest last. `None` if it enters none. What comes after these is overwritten too.
    ///
    /// Entries are those of [`Slabs::interval`], whatever the implementation; the order of nearly equal ones is not.
    fn expand(node: &WideNode, ray: &WideRay, t_max: f32, others: &mut [Pending; 8]) -> Option<(Child, usize)>;
}

/// The nearest hit, or the first one found. One function without closures, so that all of it is compiled with the
/// instructions that its caller may use.
#[inline(always)]
pub(crate) fn walk<E: Expand, const ANY: bool>(
    wide: WideView,
    ray: &Ray,
    counter: &mut impl Counter,
) -> Option<Hit> {
    let mut child = wide.root?;
    let (shear, wide_ray) = (Shear::new(ray), WideRay::new(ray, &wide.bounds));
    let mut nearest: Option<Hit> = None;
    let mut t_max = ray.t_max();
    let mut stack = Stack::<Pending, 32>::new(Pending { entry: 0.0, child: Child::node(0) });
    loop {
        if child.is_node() {
            counter.boxes(WideNode::LANES);
            let node = &wide.nodes[child.index()];
            if let Some((nearest, others)) = E::expand(node, &wide_ray, t_max, stack.room()) {
                stack.grow(others);
                child = nearest;
                continue;
            }
        } else {
            for block in &wide.blocks[child.index()..] {
                (0..Triangle4::LANES).for_each(|_| counter.object());
                let mut lanes = block.candidates(&shear, t_max);
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize;
                    lanes &= lanes - 1;
                    if let Some((object, triangle)) = block.triangle(lane)
                        && let Some(t) = triangle.decide(&shear, t_max)
                    {
                        let hit = Hit { t, object };
                        if ANY {
                            return Some(hit);
                        }
                        if nearest.is_none_or(|nearest| hit.precedes(&nearest)) {
                            nearest = Some(hit);
                            t_max = t;
                        }
                    }
                }
                if block.is_last() {
                    break;
                }
            }
        }
        child = loop {
            let Some(pending) = stack.pop() else { return nearest };
            if pending.entry <= t_max {
                break pending.child;
            }
        };
    }
}
