//! Other libraries as methods of experiments: their trees by our cost, their traversals beside ours.
//!
//! A library is one file and one line in [`Peer`]. Specs that name one are understood without the cargo feature
//! `peers`, so that the message can say what is missing.

#[cfg(feature = "peers")]
mod bvh;
#[cfg(feature = "peers")]
mod obvhs;
#[cfg(feature = "peer-tinybvh")]
mod tinybvh;

use crate::measure::speed::Contender;
use crate::scenes::Scene;
use bvh_build::OutOfRange;
use bvh_build::config::Accepts;
use bvh_core::Bvh;
#[cfg(feature = "peers")]
use bvh_core::{Aabb, Node, Ray};
use serde::{Deserialize, Deserializer, Serialize};

/// A library with its settings, as a spec names it.
///
/// Its tree, for the costs and the build time, has one object per leaf, as ours do. Its rays go through what the
/// library makes for rays by the same settings: with its own leaves, and with split triangles where it splits them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "method", rename_all = "snake_case")]
pub enum Peer {
    /// The crate `bvh`: binned surface area heuristic. It has no settings.
    Bvh(NoSettings),
    /// The crate `obvhs`: parallel locally ordered clustering, then reinsertion.
    Obvhs(Obvhs),
    /// The crate `tinybvh-rs`, for the C++ library tinybvh: binned surface area heuristic. It has no settings.
    Tinybvh(NoSettings),
}

/// The settings of a library that has none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoSettings {}

/// Settings of `obvhs`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Obvhs {
    /// The library's preset. Default medium.
    pub preset: Preset,
    /// In place of the preset's `reinsertion_batch_ratio`: the fraction of nodes that are reinserted; above 1 several
    /// times. Default the preset's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reinsertion: Option<f32>,
}

/// The presets of `obvhs`, by the names of its functions without `_build`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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
    /// As our type, boxes made tight.
    pub tree: Bvh,
    /// What the library took to build it, conversions left out.
    pub seconds: f64,
}

impl Built {
    #[cfg(feature = "peers")]
    fn tight(mut tree: Bvh, seconds: f64, boxes: &[Aabb]) -> Self {
        tree.refit(boxes);
        Self { tree, seconds }
    }
}

/// What a library makes of boxes, for the suite: nothing of it mended.
#[cfg(feature = "peers")]
pub(crate) struct Raw {
    /// As our type, with the library's boxes.
    pub(crate) tree: Bvh,
    /// The nearest distance at which a ray meets an object, by the library's own traversal and the caller's test.
    pub(crate) nearest: Nearest,
}

#[cfg(feature = "peers")]
pub(crate) type Nearest = Box<dyn Fn(&Ray, &dyn Fn(u32) -> Option<f32>) -> Option<f32>>;

impl Peer {
    /// The names of all libraries.
    pub const NAMES: &[&str] = &["bvh", "obvhs", "tinybvh"];

    /// Reads the settings of the library called `name`; `None` if there is none of this name.
    pub fn read<'de, D: Deserializer<'de>>(name: &str, settings: D) -> Result<Option<Self>, D::Error> {
        match name {
            "bvh" => NoSettings::deserialize(settings).map(|settings| Some(Self::Bvh(settings))),
            "obvhs" => Obvhs::deserialize(settings).map(|settings| Some(Self::Obvhs(settings))),
            "tinybvh" => NoSettings::deserialize(settings).map(|settings| Some(Self::Tinybvh(settings))),
            _ => Ok(None),
        }
    }

    /// The library's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Bvh(_) => "bvh",
            Self::Obvhs(_) => "obvhs",
            Self::Tinybvh(_) => "tinybvh",
        }
    }

    /// The cargo feature that the program lacks to use this library, if it does.
    pub fn missing_feature(&self) -> Option<&'static str> {
        match self {
            Self::Bvh(_) | Self::Obvhs(_) => (!cfg!(feature = "peers")).then_some("peers"),
            Self::Tinybvh(_) => (!cfg!(feature = "peer-tinybvh")).then_some("peer-tinybvh"),
        }
    }

    /// Checks the ranges of the settings.
    pub fn check(&self) -> Result<(), OutOfRange> {
        match self {
            Self::Obvhs(settings) => (0.0..=100.0).check("reinsertion", &settings.reinsertion),
            _ => Ok(()),
        }
    }

    /// Builds the tree over the scene's objects. An error says what the library cannot do.
    #[cfg_attr(not(feature = "peers"), allow(unused_variables, reason = "there is nothing to build"))]
    pub fn build(&self, scene: &Scene) -> Result<Built, String> {
        match self {
            #[cfg(feature = "peers")]
            Self::Bvh(_) => Ok(bvh::build(&scene.boxes)),
            #[cfg(feature = "peers")]
            Self::Obvhs(config) => Ok(obvhs::build(config, &scene.boxes)),
            #[cfg(feature = "peer-tinybvh")]
            Self::Tinybvh(_) => tinybvh::build(triangles(scene)?, &scene.boxes),
            #[allow(unreachable_patterns, reason = "not without the features")]
            _ => Err(format!("this program was built without the library {}", self.name())),
        }
    }

    /// The tree over boxes by the settings as they are; `None` for a library whose traversal takes no other's test.
    #[cfg(feature = "peers")]
    pub(crate) fn raw(&self, boxes: &[Aabb]) -> Option<Raw> {
        match self {
            Self::Bvh(_) => Some(bvh::raw(boxes)),
            Self::Obvhs(config) => Some(obvhs::raw(config, boxes)),
            Self::Tinybvh(_) => None,
        }
    }

    /// The library's ways to trace rays through the scene's triangles.
    #[cfg_attr(not(feature = "peers"), allow(unused_variables, reason = "there is nothing to trace"))]
    pub fn contenders<'a>(&self, scene: &'a Scene) -> Result<Vec<Contender<'a>>, String> {
        match self {
            #[cfg(feature = "peers")]
            Self::Bvh(_) => Ok(vec![bvh::contender(triangles(scene)?)]),
            #[cfg(feature = "peers")]
            Self::Obvhs(config) => Ok(obvhs::contenders(config, triangles(scene)?)),
            #[cfg(feature = "peer-tinybvh")]
            Self::Tinybvh(_) => tinybvh::contenders(triangles(scene)?),
            #[allow(unreachable_patterns, reason = "not without the features")]
            _ => Err(format!("this program was built without the library {}", self.name())),
        }
    }
}

#[cfg(feature = "peers")]
fn triangles(scene: &Scene) -> Result<&[bvh_core::Triangle], String> {
    scene.triangles().map_err(|error| error.to_string())
}

/// What is below a node of a library's tree.
#[cfg(feature = "peers")]
enum Theirs {
    Inner([usize; 2]),
    Leaf(Vec<u32>),
}

/// The tree below node 0 as our type, with the boxes that `node` gives.
#[cfg(feature = "peers")]
fn convert(boxes: &[Aabb], node: impl Fn(usize) -> (Aabb, Theirs)) -> Bvh {
    let mut tree = Bvh::default();
    if boxes.is_empty() {
        return tree;
    }
    tree.nodes.push(Node::leaf(Aabb::EMPTY, 0, 0));
    let mut open = vec![(0, 0)];
    while let Some((theirs, ours)) = open.pop() {
        let (aabb, content) = node(theirs);
        tree.nodes[ours] = match content {
            Theirs::Leaf(objects) => {
                let first = tree.prim_ids.len() as u32;
                tree.prim_ids.extend_from_slice(&objects);
                Node::leaf(aabb, first, objects.len() as u32)
            }
            Theirs::Inner(children) => {
                let first = tree.nodes.len();
                tree.nodes.extend([Node::leaf(Aabb::EMPTY, 0, 0); 2]);
                open.extend(children.into_iter().zip(first..first + 2).rev());
                Node::inner(aabb, first as u32, 2)
            }
        };
    }
    tree
}

#[cfg(all(test, feature = "peers"))]
mod tests {
    use super::*;
    use crate::measure::rays::{Kind, rays};
    use crate::measure::speed::Tracer;
    use crate::measure::{Accelerator, Query, disagreements};
    use bvh_core::validate;

    fn all() -> Vec<Peer> {
        let mut peers = vec![Peer::Bvh(NoSettings {})];
        let presets = [Preset::Fastest, Preset::Medium, Preset::VerySlow];
        peers.extend(presets.map(|preset| Peer::Obvhs(Obvhs { preset, reinsertion: None })));
        if cfg!(feature = "peer-tinybvh") {
            peers.push(Peer::Tinybvh(NoSettings {}));
        }
        peers
    }

    #[test]
    fn a_fraction_of_nodes_that_is_none_is_named() {
        let obvhs = |ratio| Peer::Obvhs(Obvhs { reinsertion: Some(ratio), ..Default::default() });
        let refused = obvhs(-0.5).check().unwrap_err().to_string();
        assert_eq!(refused, "reinsertion is -0.5; accepted: 0 to 100");
        assert_eq!(obvhs(2.0).check(), Ok(()));
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
        let mut right = vec![None; rays.len()];
        Tracer::Own(Accelerator::of_tree(&scene.primitives, &tree)).trace(Query::Nearest, &rays, &mut right);
        for peer in all() {
            for contender in peer.contenders(&scene).unwrap() {
                let mut hits = vec![None; rays.len()];
                contender.tracer.trace(Query::Nearest, &rays, &mut hits);
                let found = disagreements(&right, &hits, &tree, &rays);
                assert!(found.missed + found.false_hits + found.other < 20, "{peer:?}: {found:?}");
            }
        }
    }
}
