//! Every construction polls its watch, and none takes more than a multiple of n log n.

use bvh_build::top_down::{TakeBest, Workspace};
use bvh_build::{
    BuildError, Builder, OBJECTS_PER_POLL, Presorted, Watch, goldsmith_salmon, median_cut,
    muller_fellner, ploc, spatial,
};
use bvh_core::{Aabb, Bvh, Triangle, cost, validate};
use muller_fellner::Heuristic;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Triangles with random corners in the unit cube: most are as large as the scene.
fn soup(n: u32) -> Vec<Triangle> {
    let mut state = 88_172_645_463_325_252u64;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let mut corner = || std::array::from_fn(|_| random());
    (0..n).map(|_| Triangle::from([corner(), corner(), corner()])).collect()
}

fn boxes(triangles: &[Triangle]) -> Vec<Aabb> {
    triangles.iter().map(Triangle::aabb).collect()
}

fn power(power: f64) -> muller_fellner::Config {
    muller_fellner::Config { heuristic: Heuristic::AreaTimesPower(power), ..Default::default() }
}

fn builders() -> Vec<(&'static str, Box<dyn Builder + Sync>)> {
    vec![
        ("muller_fellner", Box::new(muller_fellner::Config::default())),
        ("power", Box::new(power(0.9))),
        ("median_cut", Box::new(median_cut::Config::default())),
        ("goldsmith_salmon", Box::new(goldsmith_salmon::Config::default())),
        ("agglomerative", Box::new(ploc::Config::default())),
    ]
}

/// Runs a construction with a watch that cancels at poll number `end`. Returns the number of polls.
fn asked<T>(
    end: usize,
    construct: impl FnOnce(&Watch) -> Result<T, BuildError>,
) -> (Result<T, BuildError>, usize) {
    let asked = AtomicUsize::new(0);
    let ends = || asked.fetch_add(1, Relaxed) + 1 >= end;
    let built = construct(&Watch::new(&ends));
    (built, asked.load(Relaxed))
}

#[test]
fn every_builder_ends_when_its_watch_says_so_whenever_that_is() {
    let triangles = soup(150_000);
    let boxes = boxes(&triangles);
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for (name, builder) in builders() {
            let build = |watch: &Watch| builder.build_watched(&boxes, None, watch);
            let (tree, questions) = pool.install(|| asked(usize::MAX, build));
            validate(&tree.unwrap(), &boxes).unwrap();
            assert!(questions >= 4, "{name}: {questions}");
            for end in [1, 2, questions / 2] {
                let (built, questions) = pool.install(|| asked(end, build));
                assert_eq!(built, Err(BuildError::Cancelled), "{name}");
                assert!(
                    questions < end + 2 * threads,
                    "{name}: went on for {questions} questions after {end}"
                );
            }
        }
    }
    let divide =
        |watch: &Watch| spatial::build(boxes.len() * 6 / 5, &boxes, &triangles.as_slice(), watch);
    assert_eq!(asked(2, divide), (Err(BuildError::Cancelled), 2));
    let scene = Presorted::new(&boxes).unwrap();
    let mut workspace = Workspace::default();
    let mut tree = Bvh::default();
    let construct = |watch: &Watch| {
        power(0.9).construct(&scene, None, Some(&mut TakeBest), &mut workspace, &mut tree, watch)
    };
    assert_eq!(asked(2, construct), (Err(BuildError::Cancelled), 2));
    assert_eq!(tree, Bvh::default());
}

#[test]
fn small_scenes_are_built_whatever_the_watch_says() {
    let boxes = boxes(&soup(1000));
    for (name, builder) in builders() {
        let (tree, _) = asked(1, |watch| builder.build_watched(&boxes, None, watch));
        assert_eq!(tree.unwrap(), builder.build(&boxes).unwrap(), "{name}");
    }
}

#[test]
fn objects_as_large_as_the_scene_are_divided_in_little_time_into_a_tree_about_as_good_as_the_greedy_one()
 {
    for n in [5000, 20_000, 80_000] {
        let boxes = boxes(&soup(n));
        let greedy = cost::internal_area(&muller_fellner::Config::default().build(&boxes).unwrap());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        for power in [0.0, 0.5, 0.9] {
            let build = |watch: &Watch| self::power(power).build_watched(&boxes, None, watch);
            let (tree, questions) = pool.install(|| asked(usize::MAX, build));
            let tree = tree.unwrap();
            // Objects visited per object: the levels of the tree.
            let levels = (questions * OBJECTS_PER_POLL) as f64 / f64::from(n);
            // Nodes of a few hundred objects may still separate one object after the other.
            let most = 6.0 * f64::from(n).log2() + 128.0;
            assert!(levels < most, "{n}, {power}: {levels} levels of {most}");
            let area = cost::internal_area(&tree);
            // Without any weight on the number of objects, trees are bad everywhere.
            assert!(power < 0.9 || area < 1.05 * greedy, "{n}, {power}: {area} above {greedy}");
        }
    }
}

#[test]
fn spatial_splits_of_objects_as_large_as_the_scene_visit_each_reference_a_few_hundred_times() {
    for n in [5000, 20_000] {
        let triangles = soup(n);
        let boxes = boxes(&triangles);
        let most = boxes.len() * 6 / 5;
        let divide = |watch: &Watch| spatial::build(most, &boxes, &triangles.as_slice(), watch);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let (tree, questions) = pool.install(|| asked(usize::MAX, divide));
        assert!(tree.unwrap().prim_ids.len() <= most);
        let visits = (questions * OBJECTS_PER_POLL) as f64 / most as f64;
        // A division that separates one reference after the other would visit each n / 2 times.
        let limit = 30.0 * f64::from(n).log2();
        assert!(visits < limit, "{n}: {visits} visits per reference, of {limit}");
    }
}
