//! Times of builders, compared with each other, with more threads, and with other libraries.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench build`

mod paired;

use attic::{Preset, build_by_obvhs};
use bvh_build::top_down::Workspace;
use bvh_build::{Builder, Presorted, Watch, goldsmith_salmon, muller_fellner};
use bvh_core::{Aabb, Bvh};
use bvh_scenes::Scene;
use bvh_search::grasp::{self, Candidates};
use bvh_search::{Budget, Problem, Stream, solve};
use glam::Vec3;
use paired::{Contender, compare};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rayon::{ThreadPool, ThreadPoolBuilder};

fn pool(threads: usize) -> ThreadPool {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads")
}

fn main() {
    let one = pool(1);
    for name in ["cloister", "sponza", "escher"] {
        match Scene::load(name) {
            Ok(scene) => one.install(|| one_thread(&scene)),
            Err(error) => println!("\n{error}"),
        }
    }
    let cloister = Scene::load("cloister").expect("a built-in scene").boxes;
    let away = Vec3::new(1e4, 0.0, 0.0);
    let twice: Vec<Aabb> = cloister
        .iter()
        .copied()
        .chain(cloister.iter().map(|b| Aabb { min: b.min + away, max: b.max + away }))
        .collect();
    two_threads(&twice);
}

fn one_thread(scene: &Scene) {
    let boxes = &scene.boxes;
    let config = muller_fellner::Config::default();
    let mut contenders: Vec<Contender> =
        vec![("Müller–Fellner, one object per leaf", Box::new(|| drop(config.build(boxes))))];
    let insertion = goldsmith_salmon::Config::default();
    let objects = goldsmith_salmon::Scene::new(boxes).expect("finite boxes");
    let order = shuffled(boxes.len() as u32);
    let mut workspace = goldsmith_salmon::Workspace::default();
    let mut tree = Bvh::default();
    contenders.push((
        "Goldsmith–Salmon, a random order",
        Box::new(move || {
            insertion
                .insert_all(&objects, &order, &mut workspace, &Watch::default())
                .expect("a permutation");
            workspace.write(&mut tree);
        }),
    ));
    contenders.extend(peers(boxes));
    compare(&format!("{}, {} objects, one thread", scene.name, boxes.len()), 25, contenders);

    // Trials share the sorted objects, so many are measured together to count the sort once.
    const TRIALS: u64 = 20;
    let greedy = || {
        let scene = Presorted::new(boxes).expect("finite boxes");
        let mut workspace = Workspace::default();
        let mut tree = Bvh::default();
        for _ in 0..TRIALS {
            let rule = &mut bvh_build::top_down::TakeBest;
            config
                .construct(&scene, None, rule, &mut workspace, &mut tree, &Watch::default())
                .expect("nobody cancels");
            std::hint::black_box(bvh_core::cost::internal_area(&tree));
        }
    };
    let trials = |candidates, noise| {
        let config = grasp::Config { trials: TRIALS, candidates, noise, ..Default::default() };
        move || drop(solve(&config, &Problem::new(boxes), 1, Budget::UNLIMITED, &()))
    };
    let contenders: Vec<Contender> = vec![
        ("greedy", Box::new(greedy)),
        ("axis best, noise 0.1", Box::new(trials(Candidates::AxisBest, Some(0.1)))),
        ("axis best, any", Box::new(trials(Candidates::AxisBest, None))),
        ("k = 5, noise 0.1", Box::new(trials(Candidates::KBest(5), Some(0.1)))),
        ("k = 5, any", Box::new(trials(Candidates::KBest(5), None))),
        ("within 5 %, any", Box::new(trials(Candidates::Within(0.05), None))),
    ];
    compare(
        &format!("{}, {TRIALS} constructions with their costs, one thread", scene.name),
        9,
        contenders,
    );
}

fn shuffled(n: u32) -> Vec<u32> {
    let mut order: Vec<u32> = (0..n).collect();
    order.shuffle(&mut Stream::seed_from_u64(1));
    order
}

fn peers(boxes: &[Aabb]) -> Vec<Contender<'_>> {
    vec![
        ("obvhs fast", Box::new(|| drop(build_by_obvhs(Preset::Fast, boxes)))),
        ("obvhs medium", Box::new(|| drop(build_by_obvhs(Preset::Medium, boxes)))),
    ]
}

fn two_threads(boxes: &[Aabb]) {
    let one = pool(1);
    let two = pool(2);
    let config = muller_fellner::Config::default();
    let contenders: Vec<Contender> = vec![
        ("one thread", Box::new(|| one.install(|| drop(config.build(boxes))))),
        ("two threads", Box::new(|| two.install(|| drop(config.build(boxes))))),
    ];
    compare(&format!("cloister twice, {} objects, Müller–Fellner", boxes.len()), 25, contenders);
}
