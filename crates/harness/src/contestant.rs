//! One entry of a spec's `methods`: a method with its label, limits and seeds.

use crate::measure::ray_cost::TrainedOn;
use crate::peers::Peer;
use bvh_config::{Check, Keys, Nested, OutOfRange, fault};
use bvh_core::cost::Objective;
use bvh_scenes::rays::RandomRays;
use bvh_search::{Budget, Frames, Method, Shortcut};
use serde::{Deserialize, Deserializer, Serialize};
use toml::Table;

/// A method with the label that tables and figures show, and the further keys of its entry.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(into = "Table")]
pub struct Labelled {
    /// Unique within the experiment.
    pub label: String,
    /// The method that runs.
    pub method: Contestant,
    /// The keys of the entry that are not parameters of the method; without the label.
    pub options: EntryOptions,
}

/// A method of ours, or another library or program.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
#[allow(missing_docs, reason = "the line above names the variants in order")]
pub enum Contestant {
    Ours(Method),
    Peer(Peer),
}

impl Contestant {
    /// The method's name in specs.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Ours(method) => method.name(),
            Self::Peer(peer) => peer.name(),
        }
    }

    fn read<'de, D: Deserializer<'de>>(
        name: &str,
        parameters: D,
    ) -> Result<Option<Self>, D::Error> {
        // Our methods come first, so that no library can take the name of one.
        if Method::NAMES.contains(&name) {
            Method::read(name, parameters).map(|method| method.map(Self::Ours))
        } else {
            Peer::read(name, parameters).map(|peer| peer.map(Self::Peer))
        }
    }
}

impl Check for Contestant {
    fn check(&self) -> Result<(), OutOfRange> {
        match self {
            Self::Ours(method) => method.check(),
            // The library checks its settings.
            Self::Peer(_) => Ok(()),
        }
    }
}

bvh_config::config! { serde;
    /// The keys of an entry that are not parameters of its method.
    pub struct EntryOptions {
        /// The method's name in tables and figures: unique within the experiment. Default the
        /// method's name.
        label: Option<String>;
        /// Limits of the method's runs; the lower of this and the experiment's limit applies.
        /// Default none.
        budget: Option<Budget>;
        /// Steps that the method's runs perform although the scene does not need them, to measure
        /// the savings of skipping them. Default none.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        keep: Vec<Shortcut>;
        /// Label whose seeds the method's runs use, for methods that must differ in nothing else.
        /// Default the method's label.
        seed_as: Option<String>;
        /// Random rays whose mean number of box tests judges trees instead of the objective; the
        /// costs in `history.csv` are then such means. Default none.
        judge: Option<RandomRays>, in Nested;
        /// Rays of the experiment's `ray_cost` whose visits replace areas in the method's runs and
        /// in their objective; the costs in `history.csv` are then such visits. Not for
        /// `median_cut`, which compares no box sizes. Default none.
        for_rays: Option<TrainedOn>;
        /// The cost that the method's runs minimise instead of the experiment's. Default none.
        objective: Option<Objective>;
        /// Maximum number of references per object if the method may divide objects among leaves:
        /// for `best`. Default none: it may not.
        references: Option<f64>, in 1.0..=16.0;
        /// Axes of the boxes: `auto` for those that the triangles choose, as `bvh bake` does, `file`
        /// for the scene's. Default the scene's.
        frame: Option<Frames>;
    }
}

impl Labelled {
    /// Methods that build every tree from scratch, so that each can be judged as a whole.
    pub(crate) const JUDGED: [&str; 3] = ["genetic", "random_orders", "grasp"];

    /// A method under its own name, without limits.
    pub fn new(method: Method) -> Self {
        Self {
            label: method.name().into(),
            method: Contestant::Ours(method),
            options: EntryOptions::default(),
        }
    }

    /// Reads an entry, without what depends on the rest of the spec.
    pub(crate) fn read(mut entry: Table) -> Result<Self, OutOfRange> {
        // A method rejects unknown keys, so the keys that are not its parameters are removed first.
        let options =
            EntryOptions::KEYS.iter().filter_map(|key| entry.remove_entry(*key)).collect();
        let mut options: EntryOptions = fault::deserialize(options)?;
        let method = fault::tagged(
            entry,
            "method",
            |name, parameters| Contestant::read(name, parameters),
            accepted_methods,
        )?;
        let label = options.label.take().unwrap_or_else(|| method.name().into());
        Ok(Self { label, method, options })
    }
}

fn accepted_methods() -> String {
    let ours = Method::NAMES.join(", ");
    format!("{ours}, or the libraries and programs {}", Peer::NAMES.join(", "))
}

impl<'de> Deserialize<'de> for Labelled {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::read(Table::deserialize(deserializer)?).map_err(serde::de::Error::custom)
    }
}

impl From<Labelled> for Table {
    fn from(Labelled { label, method, options }: Labelled) -> Self {
        let options = EntryOptions { label: Some(label), ..options };
        let mut table = Self::try_from(&method).unwrap_or_default();
        table.extend(Self::try_from(&options).unwrap_or_default());
        table
    }
}
