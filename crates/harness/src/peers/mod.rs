//! Third-party libraries and programs as methods of experiments: our costs of their trees, and
//! their traversals compared with ours.
//!
//! The harness contains no library. The program in `attic/` does: it brings each as a [`Library`],
//! and a [lower bound](LowerBound), and is the same program otherwise. A program of your own needs no code here: see [`command`].

pub mod command;
mod program;

use crate::Error;
use crate::measure::contender::Contender;
use crate::measure::speed::Traced;
use bvh_build::BuildError;
use bvh_config::fault::Fault;
use bvh_config::{Check, OutOfRange};
use bvh_core::{Aabb, Bvh, Triangle};
use bvh_search::Observer;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;
use std::sync::OnceLock;
use toml::Table;

/// A library that builds trees and traces rays.
///
/// For costs and build times it builds a tree with one object per leaf, as our methods do. For rays
/// it builds its native structures with the same settings: with its leaves, and with split
/// triangles if it splits them.
pub trait Library: Sync {
    /// The library's name in specs.
    fn name(&self) -> &'static str;

    /// Checks settings, which are the keys of the method's entry.
    ///
    /// # Errors
    ///
    /// An unknown key, or a value that is not accepted.
    fn check(&self, settings: &Table) -> Result<(), Fault>;

    /// Builds the tree over the boxes of objects.
    ///
    /// # Errors
    ///
    /// As [`Self::check`].
    fn build(&self, settings: &Table, boxes: &[Aabb]) -> Result<Built, Fault>;

    /// Returns the library's ways to trace rays through triangles.
    ///
    /// # Errors
    ///
    /// As [`Self::check`].
    fn contenders<'a>(
        &self,
        settings: &Table,
        triangles: &'a [Triangle],
    ) -> Result<Vec<Contender<'a>>, Fault>;
}

/// A library's tree.
#[derive(Clone, Debug)]
pub struct Built {
    /// The tree as our type, with tight boxes: a library may pad its own.
    pub tree: Bvh,
    /// The time that the library needed to build the tree, without conversions.
    pub seconds: f64,
}

/// Programs that trace rays beside our trees, and the comparison of all speeds.
pub trait Race: Sync {
    /// Starts a program with a scene. Returns its modes, each with the name of its library.
    ///
    /// # Errors
    ///
    /// If the program cannot be started or its output is malformed.
    fn start(
        &self,
        program: &Path,
        triangles: &[Triangle],
    ) -> Result<Vec<(String, Contender<'static>)>, String>;

    /// Compares speeds. Returns files with their names, and lines for the terminal.
    fn compare(&self, raced: &[Raced]) -> Result<(Vec<NamedBytes>, String), Error>;
}

/// The name of a file of results, and its bytes.
pub type NamedBytes = (&'static str, Vec<u8>);

/// The library of our own contenders.
pub const OURS: &str = "ours";

/// One contender's rays of one kind on one scene.
pub struct Raced<'a> {
    /// The contender's library, or [`OURS`].
    pub library: String,
    /// The seconds in which a tree of ours was built, to which its layout's are added.
    pub search_seconds: f64,
    /// Answers and seconds.
    pub traced: &'a Traced,
}

/// A proven lower bound of the internal area of every binary tree over boxes, which grows with an
/// effort.
pub type LowerBound = fn(&[Aabb], u32, &dyn Observer) -> Result<f64, BuildError>;

/// What a program contains beside the harness.
pub struct Others {
    /// The libraries that specs may name.
    pub libraries: &'static [&'static dyn Library],
    /// Programs that trace rays.
    pub race: &'static dyn Race,
    /// The bound of a spec's key `lower_bound`.
    pub lower_bound: LowerBound,
}

/// What this program contains, which does not change while it runs.
static OTHERS: OnceLock<Others> = OnceLock::new();

/// Sets what this program contains. Only the first call counts.
pub fn bring(others: Others) {
    OTHERS.get_or_init(|| others);
}

/// Returns the race of this program, if it contains other libraries.
pub(crate) fn race() -> Option<&'static dyn Race> {
    OTHERS.get().map(|others| others.race)
}

/// Returns the lower bound of this program.
pub(crate) fn lower_bound() -> Result<LowerBound, Fault> {
    OTHERS.get().map(|others| others.lower_bound).ok_or_else(|| {
        Fault::new("lower_bound", format!("set, which `{PROGRAM}` computes"), "none without it")
    })
}

/// A library with its settings, as a spec names it.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Peer {
    #[serde(rename = "method")]
    name: Name,
    /// Settings of the library, which checks them.
    #[serde(flatten)]
    #[schemars(with = "std::collections::BTreeMap<String, serde_json::Value>")]
    settings: Table,
}

/// The libraries that specs may name.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Name {
    Bvh,
    Obvhs,
}

impl Check for Peer {
    fn faults(&self) -> Vec<OutOfRange> {
        vec![]
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
        let name = match name {
            "bvh" => Name::Bvh,
            "obvhs" => Name::Obvhs,
            _ => return Ok(None),
        };
        Table::deserialize(settings).map(|settings| Some(Self { name, settings }))
    }

    /// The library's name.
    pub fn name(&self) -> &'static str {
        match self.name {
            Name::Bvh => "bvh",
            Name::Obvhs => "obvhs",
        }
    }

    /// Checks that this program contains the library, and that the library accepts the settings.
    pub fn check_settings(&self) -> Result<(), Fault> {
        self.library()?.check(&self.settings)
    }

    /// Builds the tree over the boxes of objects.
    pub fn build(&self, boxes: &[Aabb]) -> Result<Built, String> {
        let built = self.library().and_then(|library| library.build(&self.settings, boxes));
        built.map_err(|fault| fault.to_string())
    }

    /// Returns the library's ways to trace rays through triangles.
    pub fn contenders<'a>(&self, triangles: &'a [Triangle]) -> Result<Vec<Contender<'a>>, String> {
        let made = self.library().and_then(|library| library.contenders(&self.settings, triangles));
        made.map_err(|fault| fault.to_string())
    }

    fn library(&self) -> Result<&'static dyn Library, Fault> {
        let here = OTHERS.get().map_or(&[][..], |others| others.libraries);
        let library = here.iter().find(|library| library.name() == self.name());
        library.copied().ok_or_else(|| {
            let found = format!("{:?}, another library, which `{PROGRAM}` contains", self.name());
            let ours = bvh_search::Method::NAMES.join(", ");
            Fault::new("method", found, format!("without it {ours}"))
        })
    }
}

/// How to run the program that contains the libraries.
const PROGRAM: &str = "cargo run --release --manifest-path attic/Cargo.toml --";
