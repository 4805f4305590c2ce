//! Draws a picture of a scene from a view. Tiles are drawn in parallel, and the picture has the
//! same bytes for any number of threads.

use super::framing;
use super::image::Film;
use super::light::World;
use crate::Scene;
use crate::rays::{Camera, View};
use crate::trace::Accelerator;
use bvh_core::Aabb;
use rayon::prelude::*;

/// The contents and the resolution of a picture.
#[derive(Clone, Debug)]
pub struct Options {
    /// The number of pixels per row.
    pub width: u32,
    /// The number of rows.
    pub height: u32,
    /// The square root of the number of rays per pixel, which form a grid; 1 or more.
    pub samples: u32,
    /// The largest number of successive mirror reflections.
    pub depth: u32,
    /// The view. The default shows the whole scene.
    pub view: Option<View>,
    /// True to draw a ground below a scene that is seen from outside.
    pub ground: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { width: 960, height: 540, samples: 2, depth: 4, view: None, ground: true }
    }
}

/// The side of a tile in pixels. A thread reports progress after every tile.
const TILE: u32 = 16;

/// Returns the number of tiles that [`render`] reports.
pub fn tiles(options: &Options) -> u64 {
    u64::from(options.width.div_ceil(TILE)) * u64::from(options.height.div_ceil(TILE))
}

/// Draws the scene on all threads of the current rayon pool. Calls `tile_done` after every tile.
pub fn render(
    scene: &Scene,
    accelerator: &Accelerator,
    options: &Options,
    tile_done: &(dyn Fn() + Sync),
) -> Film {
    let bounds = Aabb::union_of(&scene.boxes);
    let width = options.width;
    let height = options.height;
    let up = scene.up();
    let aspect = f64::from(width) / f64::from(height);
    let view = match &options.view {
        Some(view) => view.clone(),
        None => framing::automatic(scene, &bounds, aspect),
    };
    let camera = Camera::new(&view, up, width, height);
    let world = World::new(accelerator, &view, up, &bounds, options.ground, options.depth);
    let columns = width.div_ceil(TILE);
    // Tiles are collected in order, so that the picture does not depend on the order of completion.
    let tiles: Vec<Film> = (0..tiles(options) as u32)
        .into_par_iter()
        .map(|index| {
            let x = index % columns * TILE;
            let y = index / columns * TILE;
            let tile = world.tile(
                &camera,
                x..(x + TILE).min(width),
                y..(y + TILE).min(height),
                options.samples,
            );
            tile_done();
            tile
        })
        .collect();
    Film::of_tiles(width, &tiles, columns as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Structure;

    fn picture(scene: &Scene, options: &Options) -> Film {
        let brute = Accelerator::new(&scene.primitives, Structure::Brute);
        render(scene, &brute, options, &|| ())
    }

    #[test]
    fn any_number_of_threads_and_any_size_give_the_same_pixels() {
        let scene = Scene::load("spheres75").unwrap();
        for (width, height) in [(1, 1), (16, 16), (17, 33), (5, 40)] {
            let options = Options { width, height, samples: 1, ..Options::default() };
            let films = [1, 3].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| picture(&scene, &options))
            });
            assert_eq!(films[0].pixels.len(), (width * height) as usize);
            assert_eq!(films[0], films[1]);
        }
    }

    #[test]
    fn rays_follow_as_many_reflections_as_the_options_say() {
        let scene = Scene::load("spheres75").unwrap();
        let options = Options { width: 32, height: 18, samples: 1, ..Options::default() };
        let rays =
            [0, 1, 2].map(|depth| picture(&scene, &Options { depth, ..options.clone() }).rays);
        assert!(rays.is_sorted_by(|a, b| a < b), "{rays:?}");
    }
}
