//! Batches of rays through instances, in relation to the same batches through the same scene
//! written out as triangles.
//!
//! `cargo bench -p bvh-build --bench instances [-- COPIES...]`
//!
//! The scenes are copies of one bumpy ball, turned and scaled at random: *sparse*, where most rays
//! pass between copies, and *packed*, where neighbours touch and their boxes overlap. Both sides
//! have trees by Müller–Fellner. Both contenders trace in turns on one thread; the ratio is the
//! median over the rounds.

mod balls;

use balls::{ball, camera, compare, copied, layout, print_head, random, transforms};
use bvh_build::{Builder, muller_fellner};
use bvh_core::{Aabb, Coherence, Hit, Instance, InstanceHit, Instances, Ray, WideBvh};

/// The numbers of copies without arguments.
const COPIES: [usize; 3] = [64, 512, 4096];

/// A scene of instances, and the same scene written out.
struct Pair {
    instances: Instances,
    flat: WideBvh,
    bounds: Aabb,
}

impl Pair {
    /// Makes copies with this distance between neighbours, in radii of the ball.
    fn new(copies: usize, distance: f32) -> Self {
        let triangles = ball(3);
        let transforms = transforms(copies, distance);
        let flat = layout(&copied(&triangles, &transforms));
        let parts = vec![layout(&triangles)];
        let mut instances = Vec::new();
        for transform in transforms {
            instances.push(Instance { part: 0, transform });
        }
        let boxes = Instance::boxes(&instances, &parts).expect("instances of the part");
        let top = muller_fellner::Config::default().build(&boxes).expect("finite boxes");
        let instances = Instances::new(parts, instances, top).expect("a tree over the boxes");
        Self { instances, flat, bounds: Aabb::union_of(&boxes) }
    }

    /// Prints how fast the rays are, by both questions.
    fn compare(&self, name: &str, rays: &[Ray], coherence: Coherence) {
        let mut instance_hits = vec![InstanceHit::MISS; rays.len()];
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut found = vec![false; rays.len()];
        compare(
            &format!("{name} nearest"),
            rays.len(),
            || self.flat.nearest_hits(rays, &mut hits, coherence),
            || {
                self.instances.nearest_hits(rays, &mut instance_hits, coherence);
            },
        );
        let mut flat_found = vec![false; rays.len()];
        compare(
            &format!("{name} any"),
            rays.len(),
            || self.flat.any_hits(rays, &mut flat_found, coherence),
            || self.instances.any_hits(rays, &mut found, coherence),
        );
        let differences = hits
            .iter()
            .zip(&instance_hits)
            .filter(|(hit, instance_hit)| hit.is_miss() != instance_hit.is_miss())
            .count();
        assert!(differences * 10_000 <= rays.len(), "{differences} of {} rays differ", rays.len());
    }
}

fn main() {
    let arguments = std::env::args().skip(1);
    let mut copies: Vec<usize> = arguments
        .filter(|argument| argument != "--bench")
        .map(|argument| argument.parse().expect("a number of copies"))
        .collect();
    if copies.is_empty() {
        copies.extend(COPIES);
    }
    print_head("flat, M/s", "instances, M/s");
    for copies in copies {
        for (name, distance) in [("sparse", 4.0), ("packed", 2.2)] {
            let pair = Pair::new(copies, distance);
            let coherent = format!("{copies} {name}, coherent");
            pair.compare(&coherent, &camera(&pair.bounds), Coherence::Coherent);
            let incoherent = format!("{copies} {name}, incoherent");
            pair.compare(&incoherent, &random(&pair.bounds), Coherence::Incoherent);
        }
    }
}
