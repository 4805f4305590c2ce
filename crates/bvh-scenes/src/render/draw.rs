//! Draws a picture of a scene from a view. Rows are drawn in parallel, and the picture has the same
//! bytes for any number of threads.

use super::image::{Film, Options};
use super::light::World;
use crate::Scene;
use crate::rays::Camera;
use crate::trace::Accelerator;
use bvh_core::Aabb;
use rayon::prelude::*;

/// Draws the scene on all threads of the current rayon pool. Calls `row_done` after every row.
pub fn render(
    scene: &Scene,
    accelerator: &Accelerator,
    options: &Options,
    row_done: &(dyn Fn() + Sync),
) -> Film {
    let bounds = Aabb::union_of(&scene.boxes);
    let &Options { width, height, samples, .. } = options;
    let up = scene.up();
    let camera = Camera::new(&options.view, up, width, height);
    let world = World::new(accelerator, scene, &bounds, options);
    // Rows are collected in order, so that the picture does not depend on the order of completion.
    let rows: Vec<Film> = (0..height)
        .into_par_iter()
        .map(|y| {
            let row = world.row(&camera, y, width, samples);
            row_done();
            row
        })
        .collect();
    let mut film = Film { width, ..Film::default() };
    rows.into_iter().for_each(|row| film.append(row));
    film
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::framing::automatic;
    use crate::trace::Structure;

    fn options(scene: &Scene, width: u32, height: u32) -> Options {
        let view = automatic(scene, f64::from(width) / f64::from(height));
        Options { samples: 1, ..Options::new(width, height, view) }
    }

    fn picture(scene: &Scene, options: &Options) -> Film {
        let brute = Accelerator::new(&scene.primitives, Structure::Brute);
        render(scene, &brute, options, &|| ())
    }

    #[test]
    fn rays_follow_as_many_reflections_as_the_options_say() {
        let scene = Scene::load("spheres75").unwrap();
        let options = options(&scene, 32, 18);
        let rays =
            [0, 1, 2].map(|depth| picture(&scene, &Options { depth, ..options.clone() }).rays);
        assert!(rays.is_sorted_by(|a, b| a < b), "{rays:?}");
    }
}
