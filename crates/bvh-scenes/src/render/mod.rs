//! Pictures of scenes: a small Whitted ray tracer whose picture does not depend on its acceleration
//! structure.
//!
//! Whitted 1980, 'An improved illumination model for shaded display': point lights, a shadow ray to
//! each light, mirror reflection to a limited depth. Differs from the paper: each pixel has a fixed
//! grid of rays instead of an adaptive one, no light is refracted, the ambient light is a
//! hemisphere, and a scene that is seen from outside has a ground.
//!
//! Data flows one way: [`View`](crate::rays::View) → camera → rays → [`Accelerator`] → `Surface` →
//! light → [`Film`]. All computations except ray tests use f64, and `libm` where the platform's
//! functions may differ. The same scene therefore gives the same bytes on every machine.

pub mod framing;
pub mod heat;
mod image;
mod light;
mod surface;

use crate::Scene;
use crate::trace::Accelerator;
pub use image::{Film, Options};
use light::World;
use rayon::prelude::*;

/// Draws the scene on all threads of the current rayon pool, with the same bytes for any number of
/// threads. Calls `row_done` after every row.
pub fn render(
    scene: &Scene,
    accelerator: &Accelerator,
    options: &Options,
    row_done: &(dyn Fn() + Sync),
) -> Film {
    let world = World::new(accelerator, scene, options);
    // Rows are collected in order, so that the picture does not depend on the order of completion.
    let rows: Vec<Film> =
        (0..options.height).into_par_iter().map(|y| world.row(y)).inspect(|_| row_done()).collect();
    let mut film = Film { width: options.width, ..Film::default() };
    rows.into_iter().for_each(|row| film.append(row));
    film
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Structure;

    #[test]
    fn rays_follow_as_many_reflections_as_the_options_say() {
        let scene = Scene::load("spheres75").unwrap();
        let brute = Accelerator::new(&scene.primitives, Structure::Brute);
        let options = Options::new(32, 18, framing::automatic(&scene, 16.0 / 9.0));
        let rays = [0, 1, 2].map(|depth| {
            let options = Options { samples: 1, depth, ..options.clone() };
            render(&scene, &brute, &options, &|| ()).rays
        });
        assert!(rays.is_sorted_by(|a, b| a < b), "{rays:?}");
    }
}
