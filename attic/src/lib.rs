//! Other libraries as methods of experiments, and the times of rays. The instruments of this package are its
//! benchmarks.

pub mod bvh;
mod comparison;
pub mod obvhs;
mod programs;
mod rows;
pub mod tracing;

use crate::tracing::contender::Contender;
use bvh_config::OutOfRange;
use bvh_core::{Aabb, Bvh, Triangle};
use harness::peers::{Built, Library, Others, Tracing};
use toml::Table;

/// A library that also traces rays, by its native structures with the same settings: with its
/// leaves, and with split triangles if it splits them.
pub trait Racer: Library {
    /// Returns the library's ways to trace rays through triangles.
    ///
    /// # Errors
    ///
    /// As [`Library::check`].
    fn contenders<'a>(
        &self,
        settings: &Table,
        triangles: &'a [Triangle],
    ) -> Result<Vec<Contender<'a>>, OutOfRange>;
}

/// The libraries that specs may name.
pub const LIBRARIES: &[&dyn Library] = &[&bvh::Crate, &obvhs::Crate];
const RACERS: &[&dyn Racer] = &[&bvh::Crate, &obvhs::Crate];

/// What the program contains beside the harness.
pub const OTHERS: Others = Others {
    libraries: LIBRARIES,
    tracing: Tracing { resolve: tracing::resolve, trace: tracing::trace },
};

/// Makes the result of a build. Costs are compared by tight boxes; a library may pad its own.
fn tight(mut tree: Bvh, seconds: f64, boxes: &[Aabb]) -> Built {
    tree.refit(boxes);
    Built { tree, seconds }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracing::answers::disagreements;
    use crate::tracing::contender::{Batch, Tracer};
    use crate::tracing::rays::rays;
    use ::obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
    use bvh_core::export::Target;
    use bvh_core::{Coherence, validate};
    use bvh_scenes::Scene;
    use bvh_scenes::rays::Kind;
    use bvh_scenes::trace::{Accelerator, Query};
    use bvh_search::{Bake, Budget};
    use harness::peers::Task;

    fn all() -> Vec<(&'static dyn Racer, Table)> {
        let settings = ["", "preset = 'fastest'", "preset = 'medium'", "preset = 'very_slow'"];
        let mut all = Vec::new();
        for (index, settings) in settings.iter().enumerate() {
            all.push((RACERS[index.min(1)], settings.parse().unwrap()));
        }
        all
    }

    #[test]
    fn wrong_settings_are_rejected_by_their_name() {
        let rejected = [
            (1, "reinsertion = -0.5", "reinsertion is -0.5; accepted: 0 to 100"),
            (1, "preset = 'slower'", "preset: unknown variant `slower`"),
            (1, "speed = 3", "speed: unknown field `speed`"),
            (0, "preset = 'slow'", "preset: unknown field `preset`"),
        ];
        for (library, settings, message) in rejected {
            let fault = LIBRARIES[library].check(&settings.parse().unwrap()).unwrap_err();
            assert!(fault.to_string().starts_with(message), "{fault}");
        }
        let settings = "preset = 'slow'\nreinsertion = 2.0".parse().unwrap();
        assert_eq!(LIBRARIES[1].check(&settings), Ok(()));
    }

    #[test]
    fn trees_of_other_libraries_are_valid_and_have_one_object_per_leaf() {
        let scene = Scene::load("escher:500").unwrap();
        for (library, settings) in all() {
            let task = Task {
                boxes: &scene.boxes,
                objects: &scene.primitives,
                seed: 1,
                cancelled: &|| false,
            };
            let built = library.build(&settings, &task).unwrap();
            validate(&built.tree, &scene.boxes).unwrap();
            assert_eq!(built.tree.nodes.len(), 2 * 500 - 1, "{} {settings}", library.name());
        }
    }

    #[test]
    fn other_libraries_find_nearly_all_hits_and_nothing_else_in_their_trees_and_in_ours() {
        let scene = Scene::load("escher:2000").unwrap();
        let triangles = scene.triangles().unwrap();
        let [whole, tree] = [1.0, Target::OBVHS.references].map(|references| {
            let budget = Budget { max_work: Some(5_000_000), ..Budget::UNLIMITED };
            let bake = Bake { references, budget, ..Bake::new(&scene.boxes) };
            let bake = Bake { shapes: Some(&scene.primitives), ..bake };
            bake.search(None, &()).unwrap().outcome.tree
        });
        assert!(tree.prim_ids.len() > 2200);
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
        let mut tracers = Vec::new();
        for (library, settings) in all() {
            for contender in library.contenders(&settings, triangles).unwrap() {
                tracers.push((library.name(), contender.tracer));
            }
        }
        let mut shapes = bvh::shapes(triangles);
        let ours = bvh::to_theirs(&Target::BVH.fit(&whole), &mut shapes);
        assert!(ours.is_consistent(&shapes));
        let theirs = obvhs::triangles(triangles);
        let binary = obvhs::to_theirs(&Target::OBVHS.fit(&tree));
        // Its conversion merges leaves itself.
        let wide = bvh2_to_cwbvh(&obvhs::to_theirs(&tree), 3, true, false);
        tracers.extend([
            ("ours in bvh", Tracer::Other(bvh::trace(ours, shapes))),
            ("ours in obvhs", Tracer::Other(obvhs::trace_binary(binary, &theirs))),
            ("ours in its wide tree", Tracer::Other(obvhs::trace_wide(wide, &theirs))),
        ]);
        for (name, tracer) in tracers {
            let mut hits = vec![None; rays.len()];
            tracer.trace(&batch, &mut hits).unwrap();
            let found = disagreements(&right, &hits, &tree, &rays);
            let wrong = found.missed + found.false_hits + found.other;
            assert!(wrong < 20, "{name}: {found:?}");
        }
    }
}
