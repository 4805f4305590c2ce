//! The shortcuts that a scene allows, decided from its boxes before the search.

use crate::{Shortcut, exact};
use bvh_build::{BuildError, Presorted};
use bvh_core::Aabb;

/// Returns the [shortcuts](Shortcut) of a whole scene, each with what is skipped and why. More may
/// follow later: orders may become equal further down the tree, and a search may meet the bound.
/// O(n), with the radix sort of builders and searches.
///
/// ```
/// use bvh_search::{shortcuts, prelude::*};
/// let on_a_line: Vec<Aabb> = (0..99u8).map(|x| Aabb::from([[x.into(), 0.0, 0.0]; 2])).collect();
/// for (shortcut, why) in shortcuts::of(&on_a_line)? {
///     println!("{shortcut:?}: {why}");
/// }
/// assert!(!shortcuts::of(&on_a_line)?.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn of(boxes: &[Aabb]) -> Result<Vec<(Shortcut, String)>, BuildError> {
    const AXES: [&str; 3] = ["x", "y", "z"];
    let sorted = Presorted::new(boxes)?;
    let mut shortcuts = Vec::new();
    if boxes.len() < 2 {
        return Ok(shortcuts);
    }
    let is_flat = Presorted::without_area(boxes);
    let in_order = sorted.in_order();
    let same_orders = sorted.same_orders();
    for (axis, name) in AXES.into_iter().enumerate() {
        let same = same_orders[axis] as usize;
        // A flat scene is not sorted along y and z at all.
        if in_order[axis] && !(is_flat && axis > 0) {
            let why = format!("sorting along {name}: the objects come in that order");
            shortcuts.push((Shortcut::Sorted, why));
        }
        if same != axis && !is_flat {
            let why = format!("splits along {name}: the order is that along {}", AXES[same]);
            shortcuts.push((Shortcut::SameOrder, why));
        }
    }
    if is_flat {
        let why = "splits along y and z: without area every tree costs nothing";
        shortcuts.push((Shortcut::Flat, why.into()));
    }
    if let Some(work) = exact::most_work_of_tiny(boxes.len()) {
        let why = format!("the search `best` with {work} nodes of work: the optimum takes no more");
        shortcuts.push((Shortcut::Tiny, why));
    }
    Ok(shortcuts)
}
