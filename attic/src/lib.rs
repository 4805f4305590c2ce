//! Other libraries as methods of experiments, and a lower bound. The instruments of this package
//! are its benchmarks.

mod bvh;
mod comparison;
pub mod lower_bound;
mod obvhs;
mod programs;
mod rows;

pub use crate::obvhs::Preset;

use crate::obvhs::Obvhs;
use bvh_core::{Aabb, Bvh, Triangle};
use harness::Error;
use harness::measure::contender::Contender;
use harness::peers::{Built, Library, NamedBytes, Others, Race, Raced};
use harness::rows::{Row, to_bytes};
use std::path::Path;

/// The libraries that specs may name.
pub const LIBRARIES: &[&dyn Library] = &[&bvh::Crate, &obvhs::Crate];

/// What the program contains beside the harness.
pub const OTHERS: Others = Others {
    libraries: LIBRARIES,
    race: &RayPrograms,
    lower_bound: lower_bound::internal_area,
};

/// Embree and tinybvh, which need a C++ compiler: `scripts/ray-peers/build` makes their programs.
pub struct RayPrograms;

impl Race for RayPrograms {
    fn start(
        &self,
        program: &Path,
        triangles: &[Triangle],
    ) -> Result<Vec<(String, Contender<'static>)>, String> {
        programs::contenders(program, triangles)
    }

    fn compare(&self, raced: &[Raced]) -> Result<(Vec<NamedBytes>, String), Error> {
        let speeds = comparison::speeds(raced);
        let ratios = comparison::ratios(&speeds);
        let files = vec![file(&comparison::rows(&speeds))?, file(&ratios)?];
        Ok((files, comparison::text(&ratios)))
    }
}

fn file<R: Row>(rows: &[R]) -> Result<NamedBytes, Error> {
    Ok((R::FILE, to_bytes(rows, Path::new(R::FILE))?))
}

/// Makes the result of a build. Costs are compared by tight boxes; a library may pad its own.
fn tight(mut tree: Bvh, seconds: f64, boxes: &[Aabb]) -> Built {
    tree.refit(boxes);
    Built { tree, seconds }
}

/// Builds with a preset of `obvhs`.
pub fn build_by_obvhs(preset: Preset, boxes: &[Aabb]) -> Built {
    obvhs::build(&Obvhs { preset, reinsertion: None }, boxes)
}

/// Builds with the crate `bvh`.
pub fn build_by_bvh(boxes: &[Aabb]) -> Built {
    bvh::build(boxes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::{Coherence, validate};
    use bvh_scenes::Scene;
    use bvh_scenes::rays::{Kind, rays};
    use bvh_scenes::trace::{Accelerator, Query};
    use harness::measure::contender::{Batch, Tracer};
    use harness::measure::disagreements;
    use toml::Table;

    fn all() -> Vec<(&'static dyn Library, Table)> {
        let settings = ["", "preset = 'fastest'", "preset = 'medium'", "preset = 'very_slow'"];
        let mut all = Vec::new();
        for (index, settings) in settings.iter().enumerate() {
            all.push((LIBRARIES[index.min(1)], settings.parse().unwrap()));
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
            let built = library.build(&settings, &scene.boxes).unwrap();
            validate(&built.tree, &scene.boxes).unwrap();
            assert_eq!(built.tree.nodes.len(), 2 * 500 - 1, "{} {settings}", library.name());
        }
    }

    #[test]
    fn other_libraries_find_nearly_all_hits_and_nothing_else() {
        let scene = Scene::load("escher:2000").unwrap();
        let tree = build_by_bvh(&scene.boxes).tree;
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
        for (library, settings) in all() {
            for contender in library.contenders(&settings, scene.triangles().unwrap()).unwrap() {
                let mut hits = vec![None; rays.len()];
                contender.tracer.trace(&batch, &mut hits).unwrap();
                let found = disagreements(&right, &hits, &tree, &rays);
                let wrong = found.missed + found.false_hits + found.other;
                assert!(wrong < 20, "{} {settings}: {found:?}", library.name());
            }
        }
    }
}
