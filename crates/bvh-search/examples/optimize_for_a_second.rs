//! Improves an existing tree for a second, with progress.
//!
//! `cargo run -p bvh-search --example optimize_for_a_second`

use bvh_search::{Event, Observer, prelude::*};
use std::error::Error;

/// A time limit that prints every improvement of a tree of this cost.
struct Progress {
    deadline: Deadline,
    before: f64,
}

impl Observer for Progress {
    fn event(&self, event: &Event) {
        let ms = self.deadline.elapsed().as_millis();
        let part = event.incumbent / self.before;
        println!("{ms:4} ms: {part:.4} of the original after {} moves", event.evaluations);
    }

    fn cancelled(&self) -> bool {
        self.deadline.cancelled()
    }

    fn progress(&self) -> Option<f64> {
        self.deadline.progress()
    }
}

/// Boxes of many sizes along a spiral.
fn spiral() -> Vec<Aabb> {
    (0..3000u16)
        .map(f32::from)
        .map(|i| {
            let angle = i * 0.05;
            let size = 0.2 + (i * 0.37) % 1.5;
            let center = [angle.cos() * i * 0.01, i * 0.004, angle.sin() * i * 0.01];
            Aabb::from([center.map(|c| c - size), center.map(|c| c + size)])
        })
        .collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let boxes = spiral();
    // Any binary tree will do: from another library by `Bvh::from_first_count`, from a file, or as
    // here.
    let tree = median_cut::Config { leaf_fraction: 0.001, ..Default::default() }.build(&boxes)?;
    let before = cost::internal_area(&tree);
    // `improve(&tree, &boxes, Duration::from_secs(1))` does the same without progress.
    let observer = Progress { deadline: Deadline::after(Duration::from_secs(1)), before };
    let problem = Problem::new(&boxes);
    let found =
        optimize(&tree, &problem, &best::Config::default(), 1, Budget::UNLIMITED, &observer)?;
    validate(&found.tree, &boxes)?;
    println!("{:?}: {:.4} of the original", found.stop, found.cost / before);
    assert!(found.cost < before);
    Ok(())
}
