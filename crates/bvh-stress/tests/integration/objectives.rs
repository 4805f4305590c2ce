//! Every scene of the suite holds with other objectives: costs other than the area, the visits of
//! rays, and objects that are divided among leaves.

use bvh_build::{Builder, Watch, muller_fellner, spatial};
use bvh_core::cost::{Objective, total_area};
use bvh_core::{
    Aabb, Primitives, RayDensity, Segment, Triangle, WideBvh, file, validate, validate_references,
};
use bvh_scenes::builtin::stiff;
use bvh_search::{Bake, Method, Problem, Splits, optimize, solve};
use bvh_stress::{
    Case, examine, scenes, tracing,
    transform::{same_topology, scale_range, scaled, scaled_area},
};
use glam::Vec3;

const WORK: u64 = 60;

fn best() -> Method {
    Method::Best(bvh_search::best::Config::default())
}

fn assert_reported(who: &str, reported: f64, cost: f64) {
    assert!(
        (reported - cost).abs() <= examine::ROUNDING * cost,
        "{who}: {reported} reported, {cost}"
    );
}

fn assert_same_answers(case: &Case, wide: &WideBvh, plain: &WideBvh, triangles: &[Triangle]) {
    for ray in tracing::rays(triangles, 300, 2) {
        assert_eq!(wide.nearest_hit(&ray), plain.nearest_hit(&ray), "{}: {ray:?}", case.id);
        assert_eq!(wide.any_hit(&ray), plain.any_hit(&ray), "{}: {ray:?}", case.id);
    }
}

#[test]
fn every_case_holds_with_the_visits_of_rays_instead_of_area() {
    let method = best();
    let mut searched = 0;
    let mut without_density = 0;
    for (case, triangles) in scenes(2000) {
        let boxes = stiff::boxes(&triangles);
        let bounds = Aabb::union_of(&boxes);
        let segments: Vec<Segment> = tracing::rays(&triangles, 1000, 1)
            .iter()
            .map(|ray| Segment {
                from: ray.origin().to_array(),
                to: ray.at(ray.t_max().min(1e30)).to_array(),
            })
            .filter(|segment| segment.from.iter().chain(&segment.to).all(|c| c.is_finite()))
            .collect();
        // Scenes without extent have no density; their number is bounded at the end.
        let Ok(density) = RayDensity::of_rays(&bounds, &segments, 0.1) else {
            without_density += 1;
            continue;
        };
        searched += 1;
        let problem = Problem { measure: Some(&density), ..Problem::new(&boxes) };
        let start = muller_fellner::Config::default().build(&boxes).unwrap();
        let budget = examine::budget(&method, boxes.len(), WORK);
        let outcome = optimize(&start, &problem, &Default::default(), 1, budget, &()).unwrap();
        validate(&outcome.tree, &boxes).unwrap();
        assert!(outcome.cost <= problem.cost(&start), "{}: a worse tree", case.id);
        assert_reported(case.id, outcome.cost, problem.cost(&outcome.tree));
        // A saved tree can be loaded, and every ray has its right answer in the layout for these
        // rays.
        let visits = density.visits(&outcome.tree);
        let bytes = file::save(
            &outcome.tree,
            &boxes,
            &file::Origin { visits: &visits, ..Default::default() },
        );
        let bytes = bytes.unwrap_or_else(|error| panic!("{}: {error}", case.id));
        assert_eq!(file::TreeFile::open(&bytes).unwrap().visits().unwrap().unwrap(), visits);
        let wide = WideBvh::for_rays(&outcome.tree, &triangles, &visits).unwrap();
        let plain = WideBvh::new(&start, &triangles).unwrap();
        assert_same_answers(case, &wide, &plain, &triangles);
    }
    // Skipping most scenes would make the test pass without testing anything.
    assert!(searched > 25 && without_density < 10, "{searched}, {without_density}");
}

#[test]
fn every_case_holds_with_divided_objects_and_with_the_cost_of_the_layout() {
    let method = best();
    let mut divided = 0;
    for (case, triangles) in scenes(2000) {
        let boxes = stiff::boxes(&triangles);
        let objects = Primitives::Triangles(triangles.clone());
        let budget = examine::budget(&method, boxes.len(), WORK);
        for objective in [Objective::Layout, Objective::InternalArea] {
            // 1.0 permits no division, and 1.5 permits some.
            for references in [1.0, 1.5] {
                let most = (references * boxes.len() as f64) as usize;
                let splits = Splits::at_most(most, &boxes, &objects);
                let problem = Problem { objective, splits, ..Problem::new(&boxes) };
                let outcome = solve(&method, &problem, 1, budget, &()).unwrap();
                validate_references(&outcome.tree, &boxes, &objects).unwrap_or_else(|fault| {
                    panic!("{}, {objective:?}, {references}: {fault}", case.id)
                });
                assert!(outcome.tree.prim_ids.len() <= most.max(boxes.len()), "{}", case.id);
                divided += usize::from(outcome.tree.prim_ids.len() > boxes.len());
                assert_reported(case.id, outcome.cost, problem.cost(&outcome.tree));
                let greedy = muller_fellner::Config::default().build(&boxes).unwrap();
                let bake = Bake { shapes: Some(&objects), ..Bake::new(&boxes) };
                let bytes = bake.write(&outcome.tree, 0, |sections, _| sections.concat()).unwrap();
                assert_eq!(file::load(&bytes, &boxes), Ok(outcome.tree.clone()), "{}", case.id);
                let wide = WideBvh::new(&outcome.tree, &triangles).unwrap();
                let plain = WideBvh::new(&greedy, &triangles).unwrap();
                assert_same_answers(case, &wide, &plain, &triangles);
            }
        }
    }
    assert!(divided > 5, "{divided}");
}

#[test]
fn divided_trees_are_the_same_on_any_number_of_threads_and_at_any_scale() {
    let method = best();
    let mut divided = 0;
    for (case, few) in scenes(300) {
        // Only long triangles, from one part of the scene to another, are worth dividing.
        let others = few.iter().cycle().skip(few.len() / 2);
        let triangles: Vec<Triangle> = few
            .iter()
            .zip(others)
            .map(|(near, far)| Triangle([near.0[0], near.0[1], far.0[2]]))
            .collect();
        // The parts of triangles have new coordinates, as small as 2^-100 times the triangle's.
        // They must be normal numbers too.
        let range = scale_range(&stiff::boxes(&triangles));
        let range = range.start() + 100..=*range.end();
        // A scene without normal parts at its own scale has no scales to compare.
        if triangles.is_empty() || !range.contains(&0) {
            continue;
        }
        // By spatial splits, and searched by both costs.
        let trees = |k: i32| {
            let scale = |p: Vec3| (p.as_dvec3() * libm::exp2(k.into())).as_vec3();
            let scaled: Vec<Triangle> =
                triangles.iter().map(|t| Triangle(t.0.map(scale))).collect();
            let boxes = stiff::boxes(&scaled);
            let objects = Primitives::Triangles(scaled);
            let most = boxes.len() * 3 / 2;
            let built = spatial::build(most, &boxes, &objects, &Watch::default()).unwrap();
            let searched = [Objective::Layout, Objective::InternalArea].map(|objective| {
                let splits = Splits::at_most(most, &boxes, &objects);
                let problem = Problem { objective, splits, ..Problem::new(&boxes) };
                let budget = examine::budget(&method, boxes.len(), WORK);
                let outcome = solve(&method, &problem, 1, budget, &()).unwrap();
                (outcome.cost, outcome.tree)
            });
            searched.into_iter().chain([(total_area(&built), built)]).collect::<Vec<_>>()
        };
        let expected = trees(0);
        divided +=
            expected.iter().filter(|(_, tree)| tree.prim_ids.len() > triangles.len()).count();
        for threads in [1, 3] {
            let others = examine::on_threads(threads, || trees(0)).unwrap();
            assert!(others == expected, "{}: another tree on {threads} threads", case.id);
        }
        for k in [*range.start(), range.start() / 7, range.end() / 7, *range.end()] {
            for ((expected_cost, expected), (cost, tree)) in expected.iter().zip(trees(k)) {
                let same = same_topology(&tree, expected);
                assert!(same, "{}: another tree at scale 2^{k}", case.id);
                let [parts, others] = [expected, &tree]
                    .map(|tree| tree.nodes.iter().map(|node| node.aabb).collect::<Vec<Aabb>>());
                assert_eq!(others, scaled(&parts, k), "{}: other parts at scale 2^{k}", case.id);
                assert_eq!(cost, scaled_area(*expected_cost, k), "{}: scale 2^{k}", case.id);
            }
        }
    }
    assert!(divided > 20, "{divided}");
}
