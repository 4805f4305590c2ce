//! The shortcuts that a scene allows, with reasons, decided from its boxes before the search.

use crate::{Shortcut, exact, lower_bound};
use bvh_build::{BuildError, Presorted};
use bvh_core::Aabb;

/// The properties of a scene that decide its [shortcuts](Shortcut).
#[derive(Clone, Debug, PartialEq)]
pub struct Facts {
    /// Number of objects.
    pub objects: usize,
    /// Number of objects whose box equals the box of the previous object.
    pub repeated: usize,
    /// The box around all objects.
    pub bounds: Aabb,
    /// True if `bounds` has no area.
    pub flat: bool,
    /// Per axis, true if the objects are already sorted.
    pub in_order: [bool; 3],
    /// Per axis, the lowest axis that orders all objects identically, usually the same axis.
    pub same_orders: [u8; 3],
    /// A [lower bound](lower_bound::of_largest) of the internal area.
    pub lower_bound: f64,
}

impl Facts {
    /// Examines a scene as builders and searches do, with a radix sort. O(n).
    pub fn of(boxes: &[Aabb]) -> Result<Self, BuildError> {
        let sorted = Presorted::new(boxes)?;
        Ok(Self {
            objects: boxes.len(),
            repeated: boxes.windows(2).filter(|pair| pair[0] == pair[1]).count(),
            bounds: Aabb::union_of(boxes),
            flat: Presorted::without_area(boxes),
            in_order: sorted.in_order(),
            same_orders: sorted.same_orders(),
            lower_bound: lower_bound::of_largest(boxes),
        })
    }

    /// Returns the shortcuts of the whole scene, with reasons. More may follow later: orders may
    /// become equal further down the tree, and a search may meet the bound.
    pub fn shortcuts(&self) -> Vec<(Shortcut, String)> {
        const AXES: [&str; 3] = ["x", "y", "z"];
        let mut found = Vec::new();
        if self.objects < 2 {
            return found;
        }
        for (axis, name) in AXES.into_iter().enumerate() {
            let same = self.same_orders[axis] as usize;
            // A flat scene is not sorted along y and z at all.
            if self.in_order[axis] && !(self.flat && axis > 0) {
                found.push((
                    Shortcut::Sorted,
                    format!("sorting along {name}: the objects come in that order"),
                ));
            }
            if same != axis && !self.flat {
                let same = AXES[same];
                found.push((
                    Shortcut::SameOrder,
                    format!("splits along {name}: the order is that along {same}"),
                ));
            }
        }
        if self.flat {
            found.push((
                Shortcut::Flat,
                "splits along y and z: without area every tree costs nothing".into(),
            ));
        }
        if let Some(work) = exact::most_work_of_tiny(self.objects) {
            let why =
                format!("the search `best` with {work} nodes of work: the optimum takes no more");
            found.push((Shortcut::Tiny, why));
        }
        let why = format!(
            "the rest of a local search at an internal area of {}: no tree has less",
            self.lower_bound
        );
        found.push((Shortcut::BoundMet, why));
        found
    }
}
