//! Performs the checks of one case for one method, traversal or part: a cell of the suite's table.

use crate::case::{Case, Check, EXACT_OBJECTS, Effort, Part, Size};
use crate::examine::{self, Examined};
use crate::promise::{Broken, Promise, Verdict};
use crate::tracing;
use bvh_core::Primitives;
use bvh_search::Method;

/// The outcome of one case for one method, traversal or part.
#[derive(Clone, Debug)]
pub enum Cell {
    /// All promises are kept.
    Kept(Examined),
    /// The input is rejected with a typed error that names the object, as promised.
    Refused(String),
    /// A promise is broken.
    Broken(Broken),
}

impl From<Verdict> for Cell {
    fn from(verdict: Verdict) -> Self {
        match verdict {
            Ok(note) => Self::Kept(Examined { note, ..Default::default() }),
            Err(broken) => Self::Broken(broken),
        }
    }
}

impl Cell {
    /// Combines two checks of the same case and subject: the broken promise, if any, otherwise the
    /// numbers of the first check and the notes of both.
    fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Broken(broken), _) => Self::Broken(broken),
            (Self::Kept(first), Self::Kept(other)) => {
                let note = [first.note.as_str(), &other.note].join(" ").trim().to_owned();
                Self::Kept(Examined { note, ..first })
            }
            (_, other) => other,
        }
    }
}

impl Case {
    /// Performs all checks of a method; `None` if there are none. The result reports the largest
    /// size of the scene.
    pub fn of_method(&self, method: &Method, effort: &Effort) -> Option<Cell> {
        let cells = self.checks.iter().filter_map(|check| match check {
            Check::Scene(scene) => {
                let extents = scene.extents(method, effort).into_iter();
                let examined = extents
                    .map(|(objects, work)| examine::examine(self, scene, method, objects, work));
                let all: Result<Vec<Examined>, Broken> = examined.collect();
                Some(
                    all.map_or_else(Cell::Broken, |mut all| {
                        Cell::Kept(all.pop().unwrap_or_default())
                    }),
                )
            }
            Check::Refused { boxes, object } => {
                // The exact method rejects larger scenes for their size first.
                let objects = if let Method::Exact(_) = method { EXACT_OBJECTS } else { 100 };
                let refused = examine::refuses(method, &boxes(objects), *object);
                Some(refused.map_or_else(Cell::Broken, Cell::Refused))
            }
            Check::Method(name, check) => {
                name.is_none_or(|name| name == method.name()).then(|| check(method).into())
            }
            Check::Part(..) => None,
        });
        cells.reduce(Cell::and)
    }

    /// Checks a traversal's answers to the scene's rays; `None` if there is no scene.
    pub fn of_traversal(&self, traversal: tracing::Traversal, rays: usize) -> Option<Cell> {
        let triangles = self.triangles(self.scene()?.sizes[Size::Few as usize]);
        // A panic is a broken promise to report, not the end of the suite.
        let traced = std::panic::catch_unwind(|| {
            let rays = tracing::rays(&triangles, rays, 1);
            tracing::check(traversal, &Primitives::Triangles(triangles), &rays)
        });
        Some(traced.unwrap_or_else(|_| Err(Promise::P1.broken("panicked"))).into())
    }

    /// Performs all checks of another part; `None` if there are none.
    pub fn of_part(&self, part: Part) -> Option<Cell> {
        self.checks.iter().find_map(|check| match check {
            Check::Part(of, check) if *of == part => Some(check().into()),
            _ => None,
        })
    }
}
