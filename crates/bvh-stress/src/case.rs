//! Cases of the suite, and their checks of one method, traversal or other part: a row of the
//! suite's table.

use crate::methods::{EXACT_OBJECTS, is_builder};
use crate::transform::scale_range;
use crate::{Verdict, examine, tracing};
use anyhow::{Result, anyhow, ensure};
use bvh_core::{Aabb, Primitives, Triangle};
use bvh_scenes::builtin::stiff;
use bvh_search::{Method, Outcome};
use serde::{Deserialize, Serialize};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The maximum number of objects of a scene that is built again for other numbers of threads and at
/// other scales.
const REPEATED: usize = 20_000;

/// One case.
#[derive(Debug)]
pub struct Case {
    /// `S01` to `S45`; also names its scene in [`stiff`].
    pub id: &'static str,
    /// A short description.
    pub name: &'static str,
    /// Numbers of objects by [`Size`], if every method builds the scene of the case, and every
    /// traversal traces it.
    pub sizes: Option<[usize; 3]>,
    /// What else the case promises.
    pub checks: &'static [Check],
}

/// One check of a case.
#[derive(Debug)]
pub enum Check {
    /// A further promise about the outcome of every method on the scene.
    Outcome(fn(&Method, &[Aabb], &Outcome) -> Verdict),
    /// Every method rejects a scene with a box that is damaged in this way, and names its object.
    Refused(fn(&mut Aabb)),
    /// A check of the method with this name, or of all methods if it is empty.
    Method(&'static str, fn(&Method) -> Verdict),
    /// A check of another part of the program, of this name.
    Part(&'static str, fn() -> Verdict),
}

/// The size of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Size {
    /// For every method and every ray.
    Few,
    /// For builders, in the tests.
    Many,
    /// For builders, at the full size of the case.
    All,
}

bvh_config::config! { serde;
    /// The amount of work for the methods and traversals on every scene.
    #[derive(Copy)]
    pub struct Effort {
        /// Size of the scenes that builders get.
        builders: Size = Size::Many;
        /// Nodes per object that a search may make or visit on a scene of few objects.
        work_per_object: u64 = 1000, in 1..;
        /// Larger scenes for searches, in addition to those of few objects. Default none.
        larger_searches: Option<LargerScenes>;
        /// Rays per scene and traversal.
        rays: usize = 5000, in 1..=100_000_000;
    }
}

/// Scenes for searches beyond those of few objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LargerScenes {
    /// Objects per scene; less where [`Size::Many`] is less.
    pub objects: usize,
    /// Nodes per object that a search may make or visit there.
    pub work_per_object: u64,
}

/// How a case ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Class {
    /// All promises are kept.
    #[default]
    #[serde(rename = "as promised")]
    Kept,
    /// The input is rejected with a typed error that names the object, as promised.
    #[serde(rename = "error, as promised")]
    Refused,
    /// A promise is broken.
    #[serde(rename = "promise broken")]
    Broken,
}

/// The outcome of one case for one method, traversal or part.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Cell {
    /// The case.
    pub scene: String,
    /// The method, traversal or part.
    pub method: String,
    /// The outcome.
    pub outcome: Class,
    /// Number of objects; 0 if nothing is built.
    pub objects: usize,
    /// Edges from the root to the deepest leaf.
    pub depth: Option<usize>,
    /// Internal area, world units squared.
    pub cost: Option<f64>,
    /// The cost's relative error against exact arithmetic.
    pub relative_error: Option<f64>,
    /// Further findings, the error, or the broken promise.
    pub note: String,
}

impl Case {
    /// Returns the case's scene with this number of triangles; none if the case has no scene.
    pub fn triangles(&self, objects: usize) -> Vec<Triangle> {
        stiff::by_id(self.id).map_or_else(Vec::new, |triangles| triangles(objects))
    }

    /// Performs all checks of the methods, of the traversals, and of other parts of the program.
    pub fn cells(&self, methods: &[(String, Method)], effort: &Effort) -> Vec<Cell> {
        let mut cells = Vec::new();
        for (label, method) in methods {
            cells.extend(self.cell(label, |cell| self.check_method(method, effort, cell)));
        }
        if let Some(sizes) = self.sizes {
            let triangles = self.triangles(sizes[Size::Few as usize]);
            let rays = tracing::rays(&triangles, effort.rays, 1);
            let objects = Primitives::Triangles(triangles);
            for (name, traversal) in tracing::TRAVERSALS {
                cells.extend(self.cell(name, |cell| {
                    let hits = tracing::check(*traversal, &objects, &rays)?;
                    cell.note = format!("{hits} of {} rays hit", rays.len());
                    Ok(true)
                }));
            }
        }
        for check in self.checks {
            if let Check::Part(name, check) = check {
                cells.extend(self.cell(name, |cell| {
                    cell.note = check()?;
                    Ok(true)
                }));
            }
        }
        cells
    }

    /// Performs all checks of a method. The numbers are those of the largest scene. Returns false
    /// if there is nothing to check.
    fn check_method(&self, method: &Method, effort: &Effort, cell: &mut Cell) -> Result<bool> {
        let mut is_checked = self.sizes.is_some();
        if let Some(sizes) = self.sizes {
            for (objects, work) in extents(sizes, method, effort) {
                self.examine(method, objects, work, cell)?;
            }
        }
        for check in self.checks {
            match check {
                Check::Refused(damage) => {
                    cell.outcome = Class::Refused;
                    cell.note = examine::refuses(method, *damage)?;
                }
                Check::Method(name, check) if ["", method.name()].contains(name) => {
                    cell.note = format!("{} {}", cell.note, check(method)?).trim().to_owned();
                }
                _ => continue,
            }
            is_checked = true;
        }
        Ok(is_checked)
    }

    /// Checks P1, P2 and P4 to P7 for a method on the scene with this number of objects, and what
    /// the case promises beyond them. Writes the findings to `cell`.
    fn examine(&self, method: &Method, objects: usize, work: u64, cell: &mut Cell) -> Result<()> {
        let boxes = stiff::boxes(&self.triangles(objects));
        let outcome = examine::run(method, &boxes, work)?;
        cell.objects = boxes.len();
        cell.depth = Some(outcome.tree.depth());
        cell.cost = Some(outcome.cost);
        cell.relative_error = Some(examine::check_outcome(&boxes, &outcome)?);
        // Repetitions take several times as long, so large scenes are built once.
        if boxes.len() <= REPEATED {
            for threads in [1, 3] {
                let other = examine::on_threads(threads, || examine::run(method, &boxes, work))??;
                let same = (&other.tree, &other.history) == (&outcome.tree, &outcome.history);
                ensure!(same, "P4: another outcome on {threads} threads");
            }
            let range = scale_range(&boxes);
            let low = *range.start().max(&-120);
            let high = *range.end().min(&120);
            // The ends of the range are where exponents overflow; two scales in between cover the
            // rest.
            for k in [low, low / 7, high / 7, high] {
                examine::check_scale(method, &boxes, work, &outcome, k)?;
            }
        }
        cell.note.clear();
        for check in self.checks {
            if let Check::Outcome(check) = check {
                cell.note = check(method, &boxes, &outcome)?;
            }
        }
        Ok(())
    }

    /// Fills a cell by checks, or with the promise that they find broken. A panic breaks one.
    /// `None` if the checks say that there was nothing to check.
    fn cell(&self, method: &str, checks: impl FnOnce(&mut Cell) -> Result<bool>) -> Option<Cell> {
        let scene = format!("{} {}", self.id, self.name);
        let bare = Cell { scene, method: method.to_owned(), ..Default::default() };
        let mut cell = bare.clone();
        // Nothing that the checks borrow is used after a panic.
        let checked =
            catch_unwind(AssertUnwindSafe(|| checks(&mut cell))).unwrap_or_else(|panic| {
                let text = panic.downcast_ref::<String>().map(String::as_str);
                let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
                Err(anyhow!("P1: panicked: {}", text.unwrap_or_default()))
            });
        match checked {
            Ok(is_checked) => is_checked.then_some(cell),
            Err(broken) => {
                Some(Cell { outcome: Class::Broken, note: format!("{broken:#}"), ..bare })
            }
        }
    }
}

/// Returns the numbers of objects for a method, each with its work per object, in ascending order.
/// The exact optimum gets at most [`EXACT_OBJECTS`].
fn extents(sizes: [usize; 3], method: &Method, effort: &Effort) -> Vec<(usize, u64)> {
    let few = (sizes[Size::Few as usize], effort.work_per_object);
    // Builders are fast enough for many objects; searches get them only on request.
    let further = match method {
        // The exact optimum takes exponential time.
        Method::Exact(_) => return vec![(few.0.min(EXACT_OBJECTS), few.1)],
        builder if is_builder(builder) => Some((sizes[effort.builders as usize], few.1)),
        _ => effort
            .larger_searches
            .map(|larger| (larger.objects.min(sizes[Size::Many as usize]), larger.work_per_object)),
    };
    [few].into_iter().chain(further.filter(|further| further.0 > few.0)).collect()
}
