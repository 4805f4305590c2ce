//! The cost of a ray that misses the scene: its construction, its preparation and the root's test.
//!
//! `cargo bench -p harness --bench misses -- SCENE [PROGRAM]`
//!
//! Interleaved rounds on one thread. The numbers are medians over the rounds, in nanoseconds per
//! ray beyond an empty loop. PROGRAM, made by `scripts/ray-peers/build`, runs Embree and tinybvh on
//! the same rays in the same rounds. Their rays are constructed before their clocks start, and the
//! same loop is subtracted.

use bvh_build::{Builder, muller_fellner};
use bvh_core::{Aabb, Coherence, Hit, Ray, WideBvh};
use bvh_scenes::Scene;
use bvh_scenes::trace::Query;
use bvh_search::Stream;
use glam::{DVec3, Vec3};
use harness::measure::contender::{Batch, PART};
use harness::peers::external;
use harness::statistics::median;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

/// The number of timed rounds, in each of which every contender answers all rays.
const ROUNDS: usize = 300;
const WARM_UP: usize = 20;

/// The number of rays per call.
const BATCH: usize = 1024;

/// A name, and a function that returns the seconds of all rays.
type Contender<'a> = (String, Box<dyn FnMut() -> f64 + 'a>);

fn main() {
    // Cargo adds `--bench`.
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|argument| argument != "--bench")
        .collect();
    let scene = Scene::load(arguments.first().map_or("cloister", |name| name)).expect("a scene");
    let triangles = scene.triangles().expect("a scene of triangles");
    let tree = muller_fellner::Config::default()
        .build(&scene.boxes)
        .expect("finite boxes");
    let wide = &WideBvh::new(&tree, triangles).expect("a valid tree");
    let rays = &rays_that_miss(&tree.root_aabb().expect("triangles"))[..];
    assert!(rays.iter().all(|ray| !wide.any_hit(ray)));

    let parts: Vec<(Vec3, Vec3)> = rays
        .iter()
        .map(|ray| (ray.origin(), ray.direction()))
        .collect();
    let others = arguments
        .get(1)
        .map(|program| external::contenders(Path::new(program), &scene).expect("the program"));

    let alone = "loop alone";
    let mut contenders: Vec<Contender> = vec![
        (alone.into(), timed(rays, |ray| _ = black_box(ray))),
        ("nearest_hit".into(), timed(rays, |ray| _ = black_box(wide.nearest_hit(ray)))),
        ("any_hit".into(), timed(rays, |ray| _ = black_box(wide.any_hit(ray)))),
    ];
    for hint in [Coherence::Coherent, Coherence::Incoherent] {
        let mut hits = [Hit::MISS; BATCH];
        let mut any = [false; BATCH];
        let nearest =
            move |rays: &[Ray; BATCH]| wide.nearest_hits(rays, black_box(&mut hits), hint);
        contenders
            .push((format!("nearest_hits, {hint:?}"), timed(rays.as_chunks::<BATCH>().0, nearest)));
        let any = move |rays: &[Ray; BATCH]| wide.any_hits(rays, black_box(&mut any), hint);
        contenders.push((format!("any_hits, {hint:?}"), timed(rays.as_chunks::<BATCH>().0, any)));
    }
    let assumed =
        |&(from, to): &(Vec3, Vec3)| _ = black_box(Ray::assume_valid(from, to, 0.0, f32::MAX));
    let checked = |&(from, to): &(Vec3, Vec3)| _ = black_box(Ray::new(from, to, 0.0, f32::MAX));
    contenders.push(("Ray::assume_valid".into(), timed(&parts, assumed)));
    contenders.push(("Ray::new".into(), timed(&parts, checked)));

    for (library, contender) in others.iter().flatten() {
        for query in [Query::Nearest, Query::Any] {
            let mut hits = vec![None; rays.len()];
            let batch = Batch { query, coherence: Coherence::Incoherent, in_squares: false, rays };
            let trace = move || {
                let seconds = contender
                    .tracer
                    .trace(&batch, &mut hits)
                    .expect("answers");
                assert!(hits.iter().all(Option::is_none));
                seconds.iter().sum()
            };
            contenders
                .push((format!("{library} {}, {query:?}", contender.layout), Box::new(trace)));
        }
    }

    let mut nanoseconds = vec![Vec::new(); contenders.len()];
    for round in 0..WARM_UP + ROUNDS {
        for ((_, answer), nanoseconds) in contenders.iter_mut().zip(&mut nanoseconds) {
            let seconds = answer();
            if round >= WARM_UP {
                nanoseconds.push(1e9 * seconds / rays.len() as f64);
            }
        }
    }
    let medians: Vec<f64> = nanoseconds
        .iter()
        .filter_map(|rounds| median(rounds))
        .collect();
    println!(
        "{}, {} triangles, {} rays, {ROUNDS} rounds; {alone}: {:.2} ns",
        scene.name,
        triangles.len(),
        rays.len(),
        medians[0]
    );
    for ((name, _), median) in contenders.iter().zip(&medians).skip(1) {
        println!("  {name:<32} {:>7.2} ns", median - medians[0]);
    }
}

/// Measures the seconds of `answer` for all items.
fn timed<'a, T>(items: &'a [T], mut answer: impl FnMut(&T) + 'a) -> Box<dyn FnMut() -> f64 + 'a> {
    Box::new(move || {
        let start = Instant::now();
        items
            .iter()
            .for_each(|item| answer(black_box(item)));
        start.elapsed().as_secs_f64()
    })
}

/// Returns rays with unit directions that start outside the box and miss it, exactly.
fn rays_that_miss(root: &Aabb) -> Vec<Ray> {
    let mut rng = Stream::seed_from_u64(1);
    let mut point = || DVec3::from([(); 3].map(|()| rng.random_range(-1.0..1.0)));
    let low = root.min.as_dvec3();
    let high = root.max.as_dvec3();
    let mut rays = Vec::new();
    while rays.len() < PART {
        let origin = (low + high) / 2.0 + point() * 2.0 * root.extent().length();
        let direction = point().normalize();
        let Ok(ray) = Ray::half_line(origin.as_vec3(), direction.as_vec3()) else { continue };
        let [enter, leave] = [low, high]
            .map(|corner| (corner - ray.origin().as_dvec3()) / ray.direction().as_dvec3());
        let first = enter.min(leave).max_element();
        let last = enter.max(leave).min_element();
        if first > last || last < 0.0 {
            rays.push(ray);
        }
    }
    rays
}
