//! The cases S01 to S45, stiff and extreme, and what is promised of each: one table for the tests and the experiment.
//!
//! Of every method on every scene:
//! - **P1** no panic, hang or abort: a tree, or a typed error naming the object;
//! - **P2** containment exact, bit by bit;
//! - **P3** no false miss: every traversal answers as brute force does;
//! - **P4** the same bytes for any number of threads;
//! - **P5** scaling by 2^k leaves the topology and multiplies areas by 4^k;
//! - **P6** depth is reported, no stack overflows;
//! - **P7** every cost is finite and that of the tree.

pub mod behaviour;
pub mod child;
pub mod exact_area;
pub mod examine;
pub mod extra;
#[cfg(feature = "peers")]
mod peers;
pub mod precision;
pub mod scenes;
pub mod stability;
mod table;
pub mod tracing;
pub mod transform;

pub use table::CASES;

use bvh_core::{Aabb, Triangle};
use bvh_search::{Method, Outcome};

/// A measurement over the suite, as a spec asks for it.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Every case with every method.
    Stability(stability::Config),
    /// Areas in f32 and f64 against exact ones.
    Precision(precision::Config),
}

/// What was found, for the note, or the promise that was broken.
pub type Verdict = Result<String, String>;

/// One case.
#[derive(Debug)]
pub struct Case {
    /// `S01` to `S45`.
    pub id: &'static str,
    /// What it is.
    pub name: &'static str,
    /// How the promises are checked; at least one way.
    pub checks: &'static [Check],
}

/// One way to check.
#[derive(Debug)]
pub enum Check {
    /// Every method builds it, every traversal traces it.
    Scene(SceneCase),
    /// Every method refuses these boxes and names the object.
    Refused {
        /// The boxes, as many as that.
        boxes: fn(usize) -> Vec<Aabb>,
        /// Index of the one that is named.
        object: usize,
    },
    /// Asked of methods: of the one of this name, or of all.
    Method(Option<&'static str>, fn(&Method) -> Verdict),
    /// Asked of another part of the program, one of [`PARTS`].
    Part(&'static str, fn() -> Verdict),
}

/// Parts of the program that are neither methods nor traversals.
pub const PARTS: [&str; 4] = ["rays", "OBJ files", "tree files", "costs"];

/// A scene to be built and traced.
#[derive(Debug)]
pub struct SceneCase {
    /// The scene of so many objects.
    pub scene: fn(usize) -> Vec<Triangle>,
    /// Numbers of objects by [`Size`].
    pub sizes: [usize; 3],
    /// What else is promised of this scene.
    pub also: Option<Also>,
}

/// A promise about one outcome on one scene.
pub type Also = fn(&Method, &[Aabb], &Outcome) -> Verdict;

/// How large a scene is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Size {
    /// For every method and every ray.
    Few,
    /// For builders, in the tests.
    Many,
    /// For builders, as the case is meant.
    All,
}

impl Case {
    /// The scene, if the case has one.
    pub fn scene(&self) -> Option<&SceneCase> {
        self.checks.iter().find_map(|check| match check {
            Check::Scene(scene) => Some(scene),
            _ => None,
        })
    }
}

/// Whether the method is a builder: one evaluation, no search.
pub fn is_builder(method: &Method) -> bool {
    use Method::{Agglomerative, GoldsmithSalmon, MedianCut, MullerFellner};
    matches!(method, MullerFellner(_) | MedianCut(_) | GoldsmithSalmon(_) | Agglomerative(_))
}

/// Objects of the scenes for the exact optimum.
pub const EXACT_OBJECTS: usize = 12;

impl SceneCase {
    /// How many objects a method gets: searches few, the exact optimum [`EXACT_OBJECTS`] at most.
    pub fn objects(&self, method: &Method, size: Size) -> usize {
        let few = self.sizes[Size::Few as usize];
        match method {
            Method::Exact(_) => few.min(EXACT_OBJECTS),
            builder if is_builder(builder) => self.sizes[size as usize],
            _ => few,
        }
    }
}

/// The outcome of one case for one method, traversal or part.
#[derive(Clone, Debug)]
pub enum Cell {
    /// All promises are kept.
    Kept(examine::Examined),
    /// Refused with a typed error that names the object, as promised.
    Refused(String),
    /// The promise that was broken.
    Broken(String),
}

impl From<Verdict> for Cell {
    fn from(verdict: Verdict) -> Self {
        match verdict {
            Ok(note) => Self::Kept(examine::Examined { note, ..Default::default() }),
            Err(broken) => Self::Broken(broken),
        }
    }
}

impl Case {
    /// All that is asked of a method; `None` if nothing is. Scenes are checked at `size` and before that at
    /// [`Size::Few`].
    pub fn of_method(&self, method: &Method, size: Size, work_per_object: u64) -> Option<Cell> {
        let mut found: Option<Cell> = None;
        for check in self.checks {
            let cell = match check {
                Check::Scene(scene) => {
                    let examine = |size| examine::examine(scene, method, size, work_per_object);
                    let few = scene.objects(method, Size::Few);
                    let first =
                        if scene.objects(method, size) > few { examine(Size::Few).map(drop) } else { Ok(()) };
                    first.and_then(|()| examine(size)).map_or_else(Cell::Broken, Cell::Kept)
                }
                Check::Refused { boxes, object } => {
                    let objects = if let Method::Exact(_) = method { EXACT_OBJECTS } else { 100 };
                    examine::refuses(method, &boxes(objects), *object).map_or_else(Cell::Broken, Cell::Refused)
                }
                Check::Method(name, check) if name.is_none_or(|name| name == method.name()) => {
                    check(method).into()
                }
                _ => continue,
            };
            found = Some(match (found, cell) {
                (Some(Cell::Broken(broken)), _) => Cell::Broken(broken),
                // The numbers of the scene, the notes of both.
                (Some(Cell::Kept(scene)), Cell::Kept(other)) => {
                    let note = [scene.note.as_str(), &other.note].join(" ").trim().to_owned();
                    Cell::Kept(examine::Examined { note, ..scene })
                }
                (_, cell) => cell,
            });
        }
        found
    }

    /// Whether a traversal answers the scene's rays; `None` if there is no scene.
    pub fn of_traversal(&self, traversal: tracing::Traversal, rays: usize) -> Option<Cell> {
        let triangles = self.scene().map(|scene| (scene.scene)(scene.sizes[Size::Few as usize]))?;
        let traced = std::panic::catch_unwind(|| {
            let rays = tracing::rays(&triangles, rays, 1);
            tracing::check(traversal, &triangles, &rays)
        });
        Some(traced.unwrap_or_else(|_| Err("P1: panicked".into())).into())
    }

    /// What is asked of another part; `None` if nothing is.
    pub fn of_part(&self, part: &str) -> Option<Cell> {
        self.checks.iter().find_map(|check| match check {
            Check::Part(name, check) if *name == part => Some(check().into()),
            _ => None,
        })
    }
}

/// Every method of the registry and every builder in its other forms, with labels.
pub fn methods() -> Vec<(String, Method)> {
    use bvh_build::{agglomerative, evaluation::AreaOnly, goldsmith_salmon, median_cut, muller_fellner};
    use goldsmith_salmon::Descent;
    use muller_fellner::Heuristic;
    let mut methods: Vec<(String, Method)> =
        Method::all().into_iter().map(|m| (m.name().to_owned(), m)).collect();
    let readings = [
        AreaOnly::Sum,
        AreaOnly::InnerSum,
        AreaOnly::Max,
        AreaOnly::SumOfSquares,
        AreaOnly::Difference,
        AreaOnly::Product,
    ];
    let heuristics = readings.map(Heuristic::AreaOnly).into_iter().chain([Heuristic::AreaTimesPower(0.9)]);
    for heuristic in heuristics {
        let config = muller_fellner::Config { heuristic, ..Default::default() };
        methods.push((format!("muller_fellner, {heuristic:?}"), Method::MullerFellner(config)));
    }
    let longest = median_cut::Config { axis: median_cut::CutAxis::Longest, ..Default::default() };
    methods.push(("median_cut, longest".into(), Method::MedianCut(longest)));
    for (descent, pair_inner) in [(Descent::Cost, true), (Descent::Area, false), (Descent::Area, true)] {
        let config = goldsmith_salmon::Config { descent, pair_inner };
        methods.push((format!("goldsmith_salmon, {config:?}"), Method::GoldsmithSalmon(config)));
    }
    methods.push((
        "agglomerative, radius 1".into(),
        Method::Agglomerative(agglomerative::Config { radius: 1, ..Default::default() }),
    ));
    methods
}
