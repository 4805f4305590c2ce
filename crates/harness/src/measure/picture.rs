//! Pictures as measurements: their tests and seconds with a run's tree, with brute force and with a
//! KD-tree.

use crate::Error;
use crate::rows::{RenderRow, RenderTimeRow, RunRow};
use bvh_config::config;
use bvh_core::Bvh;
use bvh_scenes::render::{Film, Options, framing, render};
use bvh_scenes::trace::{Accelerator, KdTree, Structure};
use bvh_scenes::{Scene, fnv1a};
use std::borrow::Cow;
use std::time::Instant;

config! {
    serde;
    /// The picture that every run's tree draws; it frames the whole scene.
    pub struct Config {
        /// Width in pixels.
        width: u32 = 320, in 1..=10_000;
        /// Height in pixels.
        height: u32 = 180, in 1..=10_000;
        /// `samples`² rays go through each pixel.
        samples: u32 = 1, in 1..=16;
        /// Draw with every run's tree a second time, without pruning, as Chang's CSS 552 report
        /// does.
        unpruned: bool = false;
    }
}

/// Returns the name in tables of the pictures that a method's trees draw without pruning.
pub fn unpruned(method: &str) -> String {
    format!("{method}, unpruned")
}

/// A picture is drawn again until this many seconds have passed.
const REPEAT_WITHIN: f64 = 2.0;
/// The maximum number of times that a picture is drawn for its seconds.
pub const MOST_REPEATS: usize = 25;

impl Config {
    /// Draws the scene on one thread with the tree of `run`, which was built in `build_seconds`, up
    /// to `most` times. If `first`, draws it by brute force and with a KD-tree before.
    pub fn measure(
        &self,
        scene: &Scene,
        tree: &Bvh,
        run: &RunRow,
        build_seconds: f64,
        first: bool,
        most: usize,
    ) -> Result<(Vec<RenderRow>, Vec<RenderTimeRow>), Error> {
        let mut structures = Vec::new();
        if first {
            structures.push(("brute force".to_owned(), Structure::Brute, 0, 0.0));
            let start = Instant::now();
            let cells = KdTree::build(&scene.boxes);
            let cells = cells.map_err(Error::search(&scene.name, "KD-tree"))?;
            let seconds = start.elapsed().as_secs_f64();
            structures.push(("KD-tree".to_owned(), Structure::KdTree(cells), 0, seconds));
        }
        // The tree is borrowed: a copy would cost memory and no time of the drawing.
        let own = Structure::Tree(Cow::Borrowed(tree));
        structures.push((run.method.clone(), own, run.repetition, build_seconds));
        if self.unpruned {
            let own = Structure::Unpruned(Cow::Borrowed(tree));
            structures.push((unpruned(&run.method), own, run.repetition, build_seconds));
        }
        // Seconds per picture compare structures only if all have one thread.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|error| Error::Usage(format!("cannot start a thread: {error}")))?;
        let mut rows = Vec::new();
        let mut times = Vec::new();
        for (method, structure, repetition, build_seconds) in structures {
            let accelerator = Accelerator::new(&scene.primitives, structure);
            let (film, seconds) = pool.install(|| self.draw(scene, &accelerator, most));
            let rays = film.rays as f64;
            rows.push(RenderRow {
                scene: scene.name.clone(),
                method: method.clone(),
                repetition,
                objects: scene.boxes.len(),
                rays: film.rays,
                boxes_per_ray: film.counts.boxes as f64 / rays,
                objects_per_ray: film.counts.objects as f64 / rays,
                picture: format!("{:016x}", fnv1a(film.pixels.as_flattened().iter().copied())),
            });
            times.push(RenderTimeRow {
                scene: scene.name.clone(),
                method,
                repetition,
                repeats: seconds.len(),
                build_seconds,
                // Other programs can only slow a drawing down, so the shortest time is the best.
                render_seconds: seconds.into_iter().fold(f64::INFINITY, f64::min),
            });
        }
        Ok((rows, times))
    }

    /// Returns the picture and the seconds of each repetition.
    fn draw(&self, scene: &Scene, accelerator: &Accelerator, most: usize) -> (Film, Vec<f64>) {
        let Self { width, height, samples, .. } = *self;
        let view = framing::automatic(scene, f64::from(width) / f64::from(height));
        let options = Options { samples, ..Options::new(width, height, view) };
        let mut seconds = Vec::new();
        loop {
            let start = Instant::now();
            let film = render(scene, accelerator, &options, &|| ());
            seconds.push(start.elapsed().as_secs_f64());
            if seconds.iter().sum::<f64>() >= REPEAT_WITHIN || seconds.len() == most {
                return (film, seconds);
            }
        }
    }
}
