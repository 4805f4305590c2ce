//! Improves an existing tree for a second, with progress, on a clock that the search does not know.
//!
//! `cargo run -p bvh-search --example optimize_for_a_second`

use bvh_build::{Builder, median_cut};
use bvh_core::{Aabb, Bvh, cost, validate};
use bvh_search::{Budget, Event, Observer, Problem, best, optimize};
use std::error::Error;
use std::time::{Duration, Instant};

/// Prints every improvement and cancels when the time is over. A button or a flag would do as well.
struct Second {
    start: Instant,
    before: f64,
}

impl Observer for Second {
    fn event(&self, event: &Event) {
        println!(
            "{:4} ms: {:.4} of the original after {} moves",
            self.start.elapsed().as_millis(),
            event.incumbent / self.before,
            event.evaluations
        );
    }

    fn cancelled(&self) -> bool {
        self.start.elapsed() > Duration::from_secs(1)
    }
}

/// Boxes along a spiral, of all sizes.
fn boxes() -> Vec<Aabb> {
    (0..3000u16)
        .map(f32::from)
        .map(|i| {
            let (angle, size) = (i * 0.05, 0.2 + (i * 0.37) % 1.5);
            let center = [angle.cos() * i * 0.01, i * 0.004, angle.sin() * i * 0.01];
            Aabb::from([center.map(|c| c - size), center.map(|c| c + size)])
        })
        .collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let boxes = boxes();
    // Any binary tree: from another library by `Bvh::from_first_count`, from a file, or as here.
    let tree: Bvh = median_cut::Config { leaf_fraction: 0.001, ..Default::default() }.build(&boxes)?;
    let second = Second { start: Instant::now(), before: cost::internal_area(&tree) };
    let found =
        optimize(&tree, &Problem::new(&boxes), &best::Config::default(), 1, Budget::default(), &second)?;
    validate(&found.tree, &boxes)?;
    println!("{:?}: {:.4} of the original", found.stop, found.cost / second.before);
    assert!(found.cost < second.before);
    Ok(())
}
