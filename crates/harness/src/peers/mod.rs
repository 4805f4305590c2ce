//! Third-party libraries and programs as methods of experiments: our costs of their trees.
//!
//! The harness contains no library. The program in `attic/` does: it brings each as a [`Library`],
//! and the [times of rays](Tracing), and is the same program otherwise. A program of your own needs
//! no code here: see [`command`].

pub mod command;

use crate::Error;
use bvh_config::OutOfRange;
use bvh_core::{Aabb, Bvh, Clip};
use bvh_scenes::Scene;
use serde::{Deserialize, Deserializer, Serialize};
use std::sync::OnceLock;
use toml::Table;

/// A library that builds trees, with one object per leaf, as our methods do.
pub trait Library: Sync {
    /// The library's name in specs.
    fn name(&self) -> &'static str;

    /// Checks settings, which are the keys of the method's entry.
    ///
    /// # Errors
    ///
    /// An unknown key, or a value that is not accepted.
    fn check(&self, settings: &Table) -> Result<(), OutOfRange>;

    /// Builds the tree over the boxes of objects.
    ///
    /// # Errors
    ///
    /// As [`Self::check`], and those of a program.
    fn build(&self, settings: &Table, task: &Task) -> Result<Built, BuildFault>;
}

/// What a library builds a tree over.
pub struct Task<'a> {
    /// The boxes of the objects.
    pub boxes: &'a [Aabb],
    /// The objects, which may be divided.
    pub objects: &'a dyn Clip,
    /// The seed of the run.
    pub seed: u64,
    /// Returns true once nobody waits for the tree.
    pub cancelled: &'a dyn Fn() -> bool,
}

/// The failure of a library or program.
pub type BuildFault = Box<dyn std::error::Error + Send + Sync>;

/// A library's tree.
#[derive(Clone, Debug)]
pub struct Built {
    /// The tree as our type, with tight boxes: a library may pad its own.
    pub tree: Bvh,
    /// The time that the library needed to build the tree, without conversions.
    pub seconds: f64,
}

/// Rays that are traced through trees, timed: the table `tracing` of a spec.
pub struct Tracing {
    /// Returns the table with every default spelled out, or an unknown key or a value that is not
    /// accepted.
    pub resolve: fn(Table) -> Result<Table, OutOfRange>,
    /// Traces rays through trees, scene by scene, until the last argument returns true.
    pub trace: fn(&Table, &[FirstRun], &dyn Fn() -> bool) -> Traced,
}

/// Files with their names, and lines for the terminal; `None` if it was cancelled.
pub type Traced = Result<Option<(Vec<NamedBytes>, String)>, Error>;

/// The first run of a method on a scene.
pub struct FirstRun<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The method's label.
    pub label: &'a str,
    /// The library, if the method is none of ours.
    pub peer: Option<&'a Peer>,
    /// The tree of the run.
    pub tree: &'a Bvh,
    /// How often the run's training rays enter each node, if it has any.
    pub visits: Option<Vec<f32>>,
    /// The median seconds of the method's runs on the scene.
    pub search_seconds: f64,
    /// The seed of the rays, the same for all methods of a scene.
    pub seed: u64,
}

/// The name of a file of results, and its bytes.
pub type NamedBytes = (&'static str, Vec<u8>);

/// What a program contains beside the harness.
pub struct Others {
    /// The libraries that specs may name.
    pub libraries: &'static [&'static dyn Library],
    /// The measurement of a spec's key `tracing`.
    pub tracing: Tracing,
}

/// What this program contains, which does not change while it runs.
static OTHERS: OnceLock<Others> = OnceLock::new();

/// Sets what this program contains. Only the first call counts.
pub fn bring(others: Others) {
    OTHERS.get_or_init(|| others);
}

/// Returns what this program contains for a key of a spec.
pub(crate) fn others(key: &str) -> Result<&'static Others, OutOfRange> {
    OTHERS.get().ok_or_else(|| {
        OutOfRange::new(key, format!("set, which needs `{PROGRAM}`"), "none without that program")
    })
}

/// Returns true if this program contains more than the harness.
pub(crate) fn has_others() -> bool {
    OTHERS.get().is_some()
}

/// A library with its settings, as a spec names it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Peer {
    #[serde(rename = "method")]
    name: &'static str,
    /// Settings of the library, which checks them.
    #[serde(flatten)]
    settings: Table,
}

impl Peer {
    /// The names of all libraries; the last is a [program](command).
    pub const NAMES: &[&str] = &["bvh", "obvhs", "external"];

    /// Reads the settings of the library called `name`; `None` if no library has this name.
    pub fn read<'de, D: Deserializer<'de>>(
        name: &str,
        settings: D,
    ) -> Result<Option<Self>, D::Error> {
        let Some(name) = Self::NAMES.iter().find(|known| **known == name) else { return Ok(None) };
        Table::deserialize(settings).map(|settings| Some(Self { name, settings }))
    }

    /// The library's name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Checks that this program contains the library, and that the library accepts the settings.
    pub fn check_settings(&self) -> Result<(), OutOfRange> {
        self.library()?.check(&self.settings)
    }

    /// Builds the tree over the boxes of objects.
    pub fn build(&self, task: &Task) -> Result<Built, BuildFault> {
        self.library()?.build(&self.settings, task)
    }

    /// The settings of the library.
    pub fn settings(&self) -> &Table {
        &self.settings
    }

    fn library(&self) -> Result<&'static dyn Library, OutOfRange> {
        let others = OTHERS.get().map_or(&[][..], |others| others.libraries);
        let programs: &dyn Library = &command::Programs;
        let mut here = [programs].into_iter().chain(others.iter().copied());
        here.find(|library| library.name() == self.name).ok_or_else(|| {
            let found = format!("{:?}, another library, which `{PROGRAM}` contains", self.name);
            let ours = bvh_search::Method::NAMES.join(", ");
            OutOfRange::new("method", found, format!("without it {ours}, external"))
        })
    }
}

/// How to run the program that contains the libraries.
const PROGRAM: &str = "cargo run --release --manifest-path attic/Cargo.toml --";
