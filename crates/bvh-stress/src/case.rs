//! Cases of the suite: stiff scenes, checks of methods, and checks of other parts of the program.

use crate::promise::Verdict;
use bvh_core::{Aabb, Triangle};
use bvh_scenes::builtin::stiff;
use bvh_search::{Method, Outcome};

/// One case.
#[derive(Debug)]
pub struct Case {
    /// `S01` to `S45`; also names its scene in [`stiff`].
    pub id: &'static str,
    /// A short description.
    pub name: &'static str,
    /// How the promises are checked; at least one way.
    pub checks: &'static [Check],
}

/// One way to check.
#[derive(Debug)]
pub enum Check {
    /// Every method builds the scene of the case, every traversal traces it.
    Scene(SceneCase),
    /// Every method rejects these boxes and names the object.
    Refused {
        /// Makes this many boxes.
        boxes: fn(usize) -> Vec<Aabb>,
        /// Index of the object that the error names.
        object: usize,
    },
    /// A check of the method with this name, or of all methods.
    Method(Option<&'static str>, fn(&Method) -> Verdict),
    /// A check of another part of the program.
    Part(Part, fn() -> Verdict),
}

/// A part of the program that is neither a method nor a traversal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Rays and their ranges.
    Rays,
    /// The reader of OBJ files.
    ObjFiles,
    /// The reader of tree files.
    TreeFiles,
    /// Costs that are updated while a tree changes.
    Costs,
}

impl Part {
    /// All parts, in the order of the tables.
    pub const ALL: [Self; 4] = [Self::Rays, Self::ObjFiles, Self::TreeFiles, Self::Costs];

    /// The part's name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            Self::ObjFiles => "OBJ files",
            Self::TreeFiles => "tree files",
            Self::Costs => "costs",
        }
    }
}

/// The scene of a case.
#[derive(Debug)]
pub struct SceneCase {
    /// Numbers of objects by [`Size`].
    pub sizes: [usize; 3],
    /// A further promise about this scene.
    pub also: Option<Also>,
}

/// A promise about one method's outcome on one scene.
pub type Also = fn(&Method, &[Aabb], &Outcome) -> Verdict;

/// The size of a scene.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Size {
    /// For every method and every ray.
    Few,
    /// For builders, in the tests.
    Many,
    /// For builders, at the full size of the case.
    All,
}

impl Case {
    /// The case's scene, if it has one.
    pub fn scene(&self) -> Option<&SceneCase> {
        self.checks.iter().find_map(|check| match check {
            Check::Scene(scene) => Some(scene),
            _ => None,
        })
    }

    /// Returns the case's scene with this number of triangles; none if the case has no scene.
    pub fn triangles(&self, objects: usize) -> Vec<Triangle> {
        stiff::by_id(self.id).map_or_else(Vec::new, |triangles| triangles(objects))
    }
}

/// Returns true if the method is a builder: one evaluation, no search.
pub fn is_builder(method: &Method) -> bool {
    use Method::{Agglomerative, GoldsmithSalmon, MedianCut, MullerFellner};
    matches!(method, MullerFellner(_) | MedianCut(_) | GoldsmithSalmon(_) | Agglomerative(_))
}

/// The number of objects for which the exact optimum is computed.
pub const EXACT_OBJECTS: usize = 12;

/// The amount of work for the methods on every scene.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Size of the scenes that builders get.
    pub builders: Size,
    /// Nodes per object that a search may make or visit on a scene of few objects.
    pub work_per_object: u64,
    /// Larger scenes for searches, if any.
    pub larger: Option<LargerScenes>,
}

/// Scenes for searches beyond those of few objects.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(deny_unknown_fields)]
pub struct LargerScenes {
    /// Objects per scene; less where [`Size::Many`] is less.
    pub objects: usize,
    /// Nodes per object that a search may make or visit there.
    pub work_per_object: u64,
}

impl SceneCase {
    /// Returns the numbers of objects for a method, each with its work per object, in ascending
    /// order. The exact optimum gets at most [`EXACT_OBJECTS`].
    pub fn extents(&self, method: &Method, effort: &Effort) -> Vec<(usize, u64)> {
        let few = (self.sizes[Size::Few as usize], effort.work_per_object);
        // Builders are fast enough for many objects; searches get them only on request.
        let further = match method {
            // The exact optimum takes exponential time.
            Method::Exact(_) => return vec![(few.0.min(EXACT_OBJECTS), few.1)],
            builder if is_builder(builder) => Some((self.sizes[effort.builders as usize], few.1)),
            _ => effort.larger.map(|larger| {
                (larger.objects.min(self.sizes[Size::Many as usize]), larger.work_per_object)
            }),
        };
        [few].into_iter().chain(further.filter(|further| further.0 > few.0)).collect()
    }
}

/// Returns every method of the registry and every variant of the builders, with labels.
pub fn methods() -> Vec<(String, Method)> {
    use bvh_build::{goldsmith_salmon, median_cut, muller_fellner, ploc, top_down::AreaOnly};
    use goldsmith_salmon::Descent;
    use muller_fellner::Heuristic;
    let mut methods: Vec<(String, Method)> =
        Method::all().into_iter().map(|method| (method.name().to_owned(), method)).collect();
    let readings = [
        AreaOnly::Sum,
        AreaOnly::InnerSum,
        AreaOnly::Max,
        AreaOnly::SumOfSquares,
        AreaOnly::Difference,
        AreaOnly::Product,
    ];
    for heuristic in
        readings.map(Heuristic::AreaOnly).into_iter().chain([Heuristic::AreaTimesPower(0.9)])
    {
        let config = muller_fellner::Config { heuristic, ..Default::default() };
        methods.push((format!("muller_fellner, {heuristic:?}"), Method::MullerFellner(config)));
    }
    let longest = median_cut::Config { axis: median_cut::CutAxis::Longest, ..Default::default() };
    methods.push(("median_cut, longest".into(), Method::MedianCut(longest)));
    for (descent, pair_inner) in
        [(Descent::Cost, true), (Descent::Area, false), (Descent::Area, true)]
    {
        let config = goldsmith_salmon::Config { descent, pair_inner };
        methods.push((format!("goldsmith_salmon, {config:?}"), Method::GoldsmithSalmon(config)));
    }
    let narrow = ploc::Config { radius: 1, ..Default::default() };
    methods.push(("agglomerative, radius 1".into(), Method::Agglomerative(narrow)));
    methods
}
