//! What a scene does not need: decided from its boxes, before the work. The one list of all that is left out, and why.

use crate::{exact, lower_bound};
use bvh_build::{BuildError, Presorted};
use bvh_core::Aabb;

/// Something that some scenes do not need. None changes the cost of a tree that is built; of a search that is cut short
/// or replaced, the cost is never higher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Omission {
    /// Scanning and dividing an axis that orders the objects as a lower one does: it has the same candidates, and loses
    /// ties. See [`skip_same_order`](bvh_build::muller_fellner::Config::skip_same_order).
    SameOrder,
    /// Sorting what is in order, as it always is along an axis on which all centres coincide. See
    /// [`skip_sorted`](bvh_build::muller_fellner::Config::skip_sorted).
    Sorted,
    /// All axes but x in a scene without area. See [`skip_flat`](bvh_build::muller_fellner::Config::skip_flat).
    Flat,
    /// What is left of a search once its incumbent meets [a lower bound](lower_bound::of_largest).
    BoundMet,
    /// The search `best` where the [exact optimum](exact) takes less work.
    Tiny,
}

/// What of a scene decides about omissions.
#[derive(Clone, Debug, PartialEq)]
pub struct Facts {
    /// Number of objects.
    pub objects: usize,
    /// How many of them have the box of the one before.
    pub repeated: usize,
    /// The box around all.
    pub bounds: Aabb,
    /// Whether that box has no area.
    pub flat: bool,
    /// Per axis, whether the objects came in order.
    pub in_order: [bool; 3],
    /// Per axis, the lowest axis that orders all objects identically, usually itself.
    pub same_orders: [u8; 3],
    /// A [bound](lower_bound::of_largest) of the internal area.
    pub floor: f64,
}

impl Facts {
    /// Asks of a scene what builders and searches ask. O(n), sorting being by radix.
    pub fn of(boxes: &[Aabb]) -> Result<Self, BuildError> {
        let sorted = Presorted::new(boxes)?;
        Ok(Self {
            objects: boxes.len(),
            repeated: boxes.windows(2).filter(|pair| pair[0] == pair[1]).count(),
            bounds: boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b)),
            flat: Presorted::without_area(boxes),
            in_order: sorted.in_order(),
            same_orders: sorted.same_orders(),
            floor: lower_bound::of_largest(boxes),
        })
    }

    /// What is left out of the whole scene, and why. Parts of a scene may leave out more: orders that become the same
    /// further down, and searches that meet the bound later.
    pub fn omissions(&self) -> Vec<(Omission, String)> {
        const AXES: [&str; 3] = ["x", "y", "z"];
        let mut found = Vec::new();
        if self.objects < 2 {
            return found;
        }
        for (axis, name) in AXES.into_iter().enumerate() {
            let same = self.same_orders[axis] as usize;
            if self.in_order[axis] && !(self.flat && axis > 0) {
                found.push((Omission::Sorted, format!("sorting along {name}: the objects come in that order")));
            }
            if same != axis && !self.flat {
                let same = AXES[same];
                found.push((
                    Omission::SameOrder,
                    format!("splits along {name}: the order is that along {same}"),
                ));
            }
        }
        if self.flat {
            found.push((Omission::Flat, "splits along y and z: without area every tree costs nothing".into()));
        }
        if let Some(work) = exact::most_work_of_tiny(self.objects) {
            let why = format!("the search `best`, given {work} nodes of work: the optimum takes no more");
            found.push((Omission::Tiny, why));
        }
        let why =
            format!("what is left of a local search at an internal area of {}: no tree has less", self.floor);
        found.push((Omission::BoundMet, why));
        found
    }
}
