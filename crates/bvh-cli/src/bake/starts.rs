//! The trees that `bvh bake` builds before it searches.

use crate::Error;
use crate::interrupt;
use bvh_build::{BuildError, Builder, Watch, muller_fellner, ploc};
use bvh_core::Bvh;
use bvh_scenes::Scene;
use bvh_search::Splits;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The number of objects up to which even an interrupted bake builds the greedy tree, because that
/// takes a few tenths of a second.
const BUILT_AT_ONCE: usize = 200_000;

/// Builds the greedy tree, the reference for the costs of all other trees. If the build is
/// interrupted, a bake that has already written trees continues with the tree of a faster builder.
pub fn greedy(method: &str, scene: &Scene, interrupted: &AtomicBool) -> Result<Bvh, Error> {
    let is_interrupted = || scene.boxes.len() > BUILT_AT_ONCE && interrupted.load(Relaxed);
    let config = muller_fellner::Config::default();
    let greedy = match config.build_watched(&scene.boxes, None, &Watch::new(&is_interrupted)) {
        Err(BuildError::Cancelled) if !interrupt::holds() => return Err(Error::NoTree),
        Err(BuildError::Cancelled) => {
            // The folder of instances must get all its files even after Ctrl-C.
            ploc::Config { radius: 1, ..Default::default() }.build(&scene.boxes)
        }
        greedy => greedy,
    };
    greedy.map_err(Error::search(&scene.name, method))
}

/// The decision whether a bake divides objects among leaves.
pub enum Division<'a> {
    /// The arguments do not permit it, or the bake ended before the decision.
    No,
    /// No spatial split saves anything, so that the search for whole objects finds the same tree.
    Useless,
    /// The starting tree divides objects.
    OfStart(Splits<'a>),
    /// This tree, divided with spatial splits, shows that splits pay.
    Pays(Splits<'a>, Bvh),
}

impl<'a> Division<'a> {
    /// Decides whether leaves may have up to `most_references` in total. The search continues
    /// `from` a tree, if there is one.
    pub fn decide(
        most_references: usize,
        scene: &'a Scene,
        from: Option<&Bvh>,
        is_over: &(dyn Fn() -> bool + Sync),
    ) -> Result<Self, Error> {
        let Some(splits) = Splits::at_most(most_references, &scene.boxes, &scene.primitives) else {
            return Ok(Self::No);
        };
        // A search from divided objects cannot return to whole ones.
        if from.is_some_and(|tree| tree.prim_ids.len() > scene.boxes.len()) {
            return Ok(Self::OfStart(splits));
        }
        // The division of a large scene takes tenths of a second before it looks at its watch.
        if is_over() {
            return Ok(Self::No);
        }
        let divided = match splits.divide(&scene.boxes, &Watch::new(is_over)) {
            Err(BuildError::Cancelled) => return Ok(Self::No),
            divided => divided.map_err(Error::search(&scene.name, "--references"))?,
        };
        let pays = divided.prim_ids.len() > scene.boxes.len();
        Ok(if pays { Self::Pays(splits, divided) } else { Self::Useless })
    }

    /// Returns the permission to divide objects for the search.
    pub fn splits(&self) -> Option<Splits<'_>> {
        match self {
            Self::No | Self::Useless => None,
            Self::OfStart(splits) => Some(*splits),
            Self::Pays(splits, tree) => Some(Splits { division: Some(tree), ..*splits }),
        }
    }
}
