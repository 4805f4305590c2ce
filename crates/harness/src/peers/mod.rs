//! Third-party libraries and programs as methods of experiments: our costs of their trees, and
//! their traversals compared with ours.
//!
//! A library is one file and one line in [`Peer`]. Specs that name one are parsed even without the
//! cargo feature `peers`, which lets the error name the missing feature.

#[cfg(feature = "peers")]
mod bvh;
pub mod command;
pub mod comparison;
pub mod external;
#[cfg(feature = "peers")]
mod obvhs;
mod program;

use crate::measure::contender::Contender;
use bvh_config::{Accepts, Check, OutOfRange};
#[cfg(feature = "peers")]
use bvh_core::Aabb;
use bvh_core::Bvh;
use bvh_scenes::Scene;
use serde::{Deserialize, Deserializer, Serialize};

/// A library with its settings, as a spec names it.
///
/// For costs and build times it builds a tree with one object per leaf, as our methods do. For rays
/// it builds its native structures with the same settings: with its leaves, and with split
/// triangles if it splits them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "method", rename_all = "snake_case")]
pub enum Peer {
    /// The crate `bvh`: binned surface area heuristic. It has no settings.
    Bvh(NoSettings),
    /// The crate `obvhs`: parallel locally ordered clustering, then reinsertion.
    Obvhs(Obvhs),
}

/// The settings of a library that has none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoSettings {}

/// Settings of `obvhs`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Obvhs {
    /// The library's preset. Default medium.
    pub preset: Preset,
    /// The fraction of nodes that are reinserted, `reinsertion_batch_ratio`; above 1, nodes are
    /// reinserted repeatedly. Default the preset's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reinsertion: Option<f32>,
}

/// The presets of `obvhs`, named like its functions without `_build`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "the library's names")]
pub enum Preset {
    Fastest,
    VeryFast,
    Fast,
    #[default]
    Medium,
    Slow,
    VerySlow,
}

/// A library's tree.
#[derive(Clone, Debug)]
pub struct Built {
    /// The tree as our type, with tight boxes.
    pub tree: Bvh,
    /// The time that the library needed to build the tree, without conversions.
    pub seconds: f64,
}

impl Built {
    #[cfg(feature = "peers")]
    fn tight(mut tree: Bvh, seconds: f64, boxes: &[Aabb]) -> Self {
        // Costs are compared by tight boxes; a library may pad its own.
        tree.refit(boxes);
        Self { tree, seconds }
    }
}

impl Check for Peer {
    fn faults(&self) -> Vec<OutOfRange> {
        match self {
            Self::Obvhs(settings) => (0.0..=100.0).faults("reinsertion", &settings.reinsertion),
            _ => vec![],
        }
    }
}

impl Peer {
    /// The names of all libraries.
    pub const NAMES: &[&str] = &["bvh", "obvhs"];

    /// Reads the settings of the library called `name`; `None` if no library has this name.
    pub fn read<'de, D: Deserializer<'de>>(
        name: &str,
        settings: D,
    ) -> Result<Option<Self>, D::Error> {
        match name {
            "bvh" => NoSettings::deserialize(settings).map(|settings| Some(Self::Bvh(settings))),
            "obvhs" => Obvhs::deserialize(settings).map(|settings| Some(Self::Obvhs(settings))),
            _ => Ok(None),
        }
    }

    /// The library's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Bvh(_) => "bvh",
            Self::Obvhs(_) => "obvhs",
        }
    }

    /// The cargo feature that this build of the program lacks for the library, if any.
    pub fn missing_feature(&self) -> Option<&'static str> {
        (!cfg!(feature = "peers")).then_some("peers")
    }

    /// Builds the tree over the scene's objects.
    ///
    /// # Errors
    ///
    /// If the library is not compiled in.
    #[cfg_attr(
        not(feature = "peers"),
        allow(unused_variables, reason = "there is nothing to build")
    )]
    pub fn build(&self, scene: &Scene) -> Result<Built, String> {
        match self {
            #[cfg(feature = "peers")]
            Self::Bvh(_) => Ok(bvh::build(&scene.boxes)),
            #[cfg(feature = "peers")]
            Self::Obvhs(config) => Ok(obvhs::build(config, &scene.boxes)),
            #[cfg(not(feature = "peers"))]
            _ => Err(format!("this program was built without the library {}", self.name())),
        }
    }

    /// Returns the library's ways to trace rays through the scene's triangles.
    #[cfg_attr(
        not(feature = "peers"),
        allow(unused_variables, reason = "there is nothing to trace")
    )]
    pub fn contenders<'a>(&self, scene: &'a Scene) -> Result<Vec<Contender<'a>>, String> {
        match self {
            #[cfg(feature = "peers")]
            Self::Bvh(_) => Ok(vec![bvh::contender(triangles(scene)?)]),
            #[cfg(feature = "peers")]
            Self::Obvhs(config) => Ok(obvhs::contenders(config, triangles(scene)?)),
            #[cfg(not(feature = "peers"))]
            _ => Err(format!("this program was built without the library {}", self.name())),
        }
    }
}

#[cfg(feature = "peers")]
fn triangles(scene: &Scene) -> Result<&[bvh_core::Triangle], String> {
    scene.triangles().map_err(|error| error.to_string())
}

#[cfg(all(test, feature = "peers"))]
mod tests {
    use super::*;
    use crate::measure::contender::{Batch, Tracer};
    use crate::measure::disagreements;
    use bvh_core::{Coherence, validate};
    use bvh_scenes::rays::{Kind, rays};
    use bvh_scenes::trace::{Accelerator, Query};

    fn all() -> Vec<Peer> {
        let mut peers = vec![Peer::Bvh(NoSettings {})];
        let presets = [Preset::Fastest, Preset::Medium, Preset::VerySlow];
        peers.extend(presets.map(|preset| Peer::Obvhs(Obvhs { preset, reinsertion: None })));
        peers
    }

    #[test]
    fn a_fraction_out_of_range_is_rejected_by_its_name() {
        let settings = Obvhs { reinsertion: Some(-0.5), ..Default::default() };
        let error = Peer::Obvhs(settings).check().unwrap_err();
        assert_eq!(error.to_string(), "reinsertion is -0.5; accepted: 0 to 100");
        let settings = Obvhs { reinsertion: Some(2.0), ..Default::default() };
        assert_eq!(Peer::Obvhs(settings).check(), Ok(()));
    }

    #[test]
    fn trees_of_other_libraries_are_valid_and_have_one_object_per_leaf() {
        let scene = Scene::load("escher:500").unwrap();
        for peer in all() {
            let built = peer.build(&scene).unwrap();
            validate(&built.tree, &scene.boxes).unwrap();
            assert_eq!(built.tree.nodes.len(), 2 * 500 - 1, "{peer:?}");
        }
    }

    #[test]
    fn other_libraries_find_nearly_all_hits_and_nothing_else() {
        let scene = Scene::load("escher:2000").unwrap();
        let tree = Peer::Bvh(NoSettings {}).build(&scene).unwrap().tree;
        let rays = rays(Kind::Incoherent, 4000, &scene, &tree, &Default::default(), 1);
        let batch = Batch {
            query: Query::Nearest,
            coherence: Coherence::Incoherent,
            in_squares: false,
            rays: &rays,
        };
        let mut right = vec![None; rays.len()];
        Tracer::Own(Accelerator::of_tree(&scene.primitives, &tree))
            .trace(&batch, &mut right)
            .unwrap();
        for peer in all() {
            for contender in peer.contenders(&scene).unwrap() {
                let mut hits = vec![None; rays.len()];
                contender.tracer.trace(&batch, &mut hits).unwrap();
                let found = disagreements(&right, &hits, &tree, &rays);
                assert!(found.missed + found.false_hits + found.other < 20, "{peer:?}: {found:?}");
            }
        }
    }
}
