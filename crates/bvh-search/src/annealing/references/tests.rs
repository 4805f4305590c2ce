use super::*;
use crate::run::stream;
use crate::scatter::scatter;
use crate::tree::HalfArea;
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::{layout_area, total_area};
use bvh_core::{Triangle, validate_references};

/// Long diagonal triangles, which boxes describe badly.
fn diagonals(n: u32) -> Vec<Triangle> {
    scatter(n)
        .iter()
        .map(|aabb| {
            let far = aabb.min + (aabb.max - aabb.min) * 40.0;
            Triangle([aabb.min, far, aabb.max])
        })
        .collect()
}

#[test]
fn passes_divide_and_reunite_within_the_limit_and_every_reference_saves_its_price() {
    let triangles = diagonals(150);
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
    let objects = &triangles.as_slice();
    let quota = Quota { work: 40_000, moves: u64::MAX };
    for by_layout in [false, true] {
        let cost =
            |tree: &bvh_core::Bvh| if by_layout { layout_area(tree) } else { total_area(tree) };
        let start = muller_fellner::Config::default().build(&boxes).unwrap();
        let mut before = cost(&start);
        let metric = HalfArea::default().with_leaves();
        let mut tree = Working::from_bvh(&start, metric).unwrap();
        let mut most_seen = 0;
        // With fewer allowed references than the tree has, nothing is divided, and leaves that
        // pay little are still reunited.
        for most in [180, 200, 160, 150] {
            let mut divider = Divider::new(Splits { objects, most, divided: None }, by_layout);
            let mut references = tree.objects();
            for round in 0..4 {
                let tally = divider.pass(&mut tree, quota, &mut stream(7, round), &());
                assert!(tally.work > 0);
                let flat = tree.to_bvh();
                validate_references(&flat, &boxes, objects).unwrap();
                assert!(
                    flat.prim_ids.len() <= most.max(references),
                    "{} {most}",
                    flat.prim_ids.len()
                );
                assert!((tree.area() - total_area(&flat)).abs() <= 1e-9 * tree.area());
                let after = cost(&flat);
                // Every added reference has saved its price, and no removed reference cost
                // more.
                let gone = references as f64 - flat.prim_ids.len() as f64;
                let price = PRICE_OF_A_REFERENCE * before;
                let least_leave = if gone > 0.0 { gone / 150.0 } else { gone / 200.0 };
                assert!(
                    after <= before * (1.0 + 1e-9) + price * least_leave,
                    "{after} {before} {gone}"
                );
                references = flat.prim_ids.len();
                (before, most_seen) = (after, most_seen.max(flat.prim_ids.len()));
            }
        }
        assert!(most_seen > 160, "{most_seen}");
    }
}
