//! The eight boxes of a node tested by portable code.

use super::node::{Child, Pending, WideNode};
use super::traverse::{Expand, WideRay};
use crate::Slabs;

/// Code for any machine.
pub(crate) struct Portable;

impl Expand for Portable {
    #[inline(always)]
    fn expand(node: &WideNode, ray: &WideRay, t_max: f32, others: &mut [Pending; 8]) -> Option<(Child, usize)> {
        let (mut entry, mut exit) = ([ray.t_min; 8], [f32::INFINITY; 8]);
        for axis in 0..3 {
            let (near, far) = (&node.planes[ray.near[axis]], &node.planes[ray.far[axis]]);
            for lane in 0..8 {
                let t = (near[lane] - ray.near_origin[axis]) * ray.inverse[axis];
                entry[lane] = if t > entry[lane] { t } else { entry[lane] };
                // In unused lanes NaN, and it stays so.
                let t = (far[lane] - ray.far_origin[axis]) * ray.inverse[axis];
                exit[lane] = if exit[lane] < t { exit[lane] } else { t };
            }
        }
        let mut count = 0;
        for lane in 0..8 {
            if entry[lane] <= exit[lane] * Slabs::FAR && entry[lane] <= t_max {
                // Insertion; the lower lane stays nearer on ties.
                let mut at = count;
                while at > 0 && others[at - 1].entry <= entry[lane] {
                    others[at] = others[at - 1];
                    at -= 1;
                }
                others[at] = Pending { entry: entry[lane], child: node.children[lane] };
                count += 1;
            }
        }
        let last = count.checked_sub(1)?;
        Some((others[last].child, last))
    }
}
