//! The trees that `bvh bake` builds before it searches.

use crate::Error;
use bvh_build::{BuildError, Builder, Watch, muller_fellner, ploc};
use bvh_core::Bvh;
use bvh_scenes::Scene;
use bvh_search::Splits;
use bvh_terminal::interrupt;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Objects over which the greedy tree is built so soon, in a few tenths of a second, that even an interrupted bake finishes it.
const BUILT_AT_ONCE: usize = 200_000;

/// Builds the greedy tree, by which the others are measured. If that is interrupted, only a bake that already keeps trees goes on, with
/// the tree of a faster builder.
pub fn greedy(method: &str, scene: &Scene, interrupted: &AtomicBool) -> Result<Bvh, Error> {
    let is_interrupted = || scene.boxes.len() > BUILT_AT_ONCE && interrupted.load(Relaxed);
    let config = muller_fellner::Config::default();
    let greedy = match config.build_watched(&scene.boxes, None, &Watch::new(&is_interrupted)) {
        Err(BuildError::Cancelled) if !interrupt::holds() => return Err(Error::NoTree),
        Err(BuildError::Cancelled) => {
            ploc::Config { radius: 1, ..Default::default() }.build(&scene.boxes)
        }
        greedy => greedy,
    };
    greedy.map_err(Error::search(&scene.name, method))
}

/// Whether a bake divides objects among leaves.
pub enum Division<'a> {
    /// Nobody asked for it, or the bake was over before it was known to pay.
    No,
    /// No spatial split saves anything: the search for whole objects finds the same tree.
    Useless,
    /// The tree that it goes on from does.
    OfStart(Splits<'a>),
    /// This division with spatial splits shows that it pays.
    Pays(Splits<'a>, Bvh),
}

impl<'a> Division<'a> {
    /// Decides whether leaves may have as many as `most_references`, where the search goes on `from` a tree or from none.
    pub fn decide(
        most_references: usize,
        scene: &'a Scene,
        from: Option<&Bvh>,
        is_over: &(dyn Fn() -> bool + Sync),
    ) -> Result<Self, Error> {
        let Some(splits) = Splits::at_most(most_references, &scene.boxes, &scene.primitives) else {
            return Ok(Self::No);
        };
        // A tree with divided objects stays one.
        if from.is_some_and(|tree| tree.prim_ids.len() > scene.boxes.len()) {
            return Ok(Self::OfStart(splits));
        }
        let divided = match splits.divide(&scene.boxes, &Watch::new(is_over)) {
            Err(BuildError::Cancelled) => return Ok(Self::No),
            divided => divided.map_err(Error::search(&scene.name, "--references"))?,
        };
        let pays = divided.prim_ids.len() > scene.boxes.len();
        Ok(if pays { Self::Pays(splits, divided) } else { Self::Useless })
    }

    /// The leave to divide objects, for the search.
    pub fn splits(&self) -> Option<Splits<'_>> {
        match self {
            Self::No | Self::Useless => None,
            Self::OfStart(splits) => Some(*splits),
            Self::Pays(splits, tree) => Some(Splits { division: Some(tree), ..*splits }),
        }
    }
}
