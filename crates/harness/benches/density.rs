//! Times of the box sizes that searches use: half areas, and densities of rays, which may take at
//! most five times as long.
//!
//! `cargo bench -p harness --bench density`

mod paired;

use bvh_build::{Builder, muller_fellner};
use bvh_core::PackedAabb;
use bvh_core::cost::{Area, Measure};
use bvh_scenes::Scene;
use harness::measure::ray_cost::{Config, TrainedOn};
use paired::{Contender, compare};
use std::hint::black_box;

/// The number of evaluations of every box in a round.
const REPEATS: usize = 10;

fn main() {
    for name in ["cloister", "escher", "sponza"] {
        match Scene::load(name) {
            Ok(scene) => evaluate(&scene),
            Err(error) => println!("\n{error}"),
        }
    }
}

/// Evaluates the boxes of a greedy tree in the tree's order, and unions of neighbours, like a
/// search for positions.
fn evaluate(scene: &Scene) {
    let tree = muller_fellner::Config::default()
        .build(&scene.boxes)
        .expect("finite boxes");
    let density = Config::default()
        .density(TrainedOn::Default, scene, 1)
        .expect("rays that meet the scene");
    let nodes: Vec<PackedAabb> = tree
        .nodes
        .iter()
        .map(|node| PackedAabb::from(&node.aabb))
        .collect();
    let joined: Vec<PackedAabb> = nodes
        .windows(2)
        .map(|pair| pair[0].union(&pair[1]))
        .collect();
    for (which, boxes) in [("boxes of nodes", &nodes), ("boxes of two nodes", &joined)] {
        let contenders: Vec<Contender> = vec![
            ("half area", Box::new(|| total(&Area, boxes))),
            (
                "half area as any measure",
                Box::new(|| total(black_box(&Area as &dyn Measure), boxes)),
            ),
            ("density of rays", Box::new(|| total(black_box(&density as &dyn Measure), boxes))),
        ];
        compare(
            &format!("{}, {} {which}, {REPEATS} times", scene.name, boxes.len()),
            25,
            contenders,
        );
    }
}

fn total<M: Measure + ?Sized>(measure: &M, boxes: &[PackedAabb]) {
    for _ in 0..REPEATS {
        black_box(
            boxes
                .iter()
                .map(|aabb| measure.of(black_box(aabb)))
                .sum::<f64>(),
        );
    }
}
