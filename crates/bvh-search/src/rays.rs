//! Trees for the rays of one program: record segments, search, trace the next ones.

use crate::Stream;
use bvh_core::glam::Vec3;
use bvh_core::{
    Aabb, Bvh, DensityError, Primitive, Primitives, Ray, RayDensity, Segment, TestCounts,
    nearest_hit_by,
};
use rand::{RngExt, SeedableRng};

/// The share of area in the measure of a box. Without it, a box that no ray enters would be free.
const AREA_WEIGHT: f64 = 0.1;

/// One in this many rays of a density comes from anywhere in the scene, as a guard of rays that
/// were not recorded. Half of the rays instead cost recorded rays two per cent more tests.
const GUARD: usize = 4;

/// The part of the way to a hit after which the next ray begins: before the surface.
const JUST_BEFORE: f32 = 0.9999;

const NONE: TestCounts = TestCounts { boxes: 0, objects: 0 };

/// Returns the density of recorded segments between the surfaces of a scene, with a tenth of area.
/// The segments begin where rays began and end at their hits or outside the scene. If the `shapes`
/// are known, in f32, a quarter of the density's rays comes from anywhere in the scene, so that rays from
/// elsewhere lose little; they are traced through `tree`, any valid tree over the shapes. Of more
/// segments than fit into [`RayDensity::MOST_SEGMENTS`], every n-th counts. Returns `None` soon
/// after `is_over` returns true.
pub fn ray_density(
    tree: &Bvh,
    shapes: Option<&Primitives>,
    segments: &[Segment],
    is_over: &dyn Fn() -> bool,
) -> Result<Option<RayDensity>, DensityError> {
    let root = tree.root_aabb().unwrap_or(Aabb::EMPTY);
    // Where rays from anywhere come from.
    let bounds = match (&tree.frame, shapes) {
        (Some(_), Some(shapes)) => Aabb::union_of(&shapes.boxes()),
        _ => root,
    };
    // The recorded segments leave room for the guard.
    let most = RayDensity::MOST_SEGMENTS / GUARD * (GUARD - 1);
    let step = segments.len().div_ceil(most).max(1);
    let mut sampled: Vec<Segment> = segments.iter().step_by(step).copied().collect();
    let count = sampled.len() / (GUARD - 1);
    sampled.extend(match shapes {
        Some(Primitives::Triangles(triangles)) => {
            traced(tree, triangles, &bounds, count, NONE, is_over)
        }
        Some(Primitives::Spheres(spheres)) => traced(tree, spheres, &bounds, count, NONE, is_over),
        Some(Primitives::Doubles(_)) | None => vec![],
    });
    if is_over() {
        return Ok(None);
    }
    for segment in &mut sampled {
        *segment = segment.in_frame(tree.frame.as_ref());
    }
    RayDensity::of_rays(&root, &sampled, AREA_WEIGHT).map(Some)
}

/// Returns the segments of `count` rays, up to their nearest hits: from random points of the
/// scene's box in random directions, and from each hit one more. They are the same on every
/// machine. Ends early, with fewer rays, when `is_over` returns true or they take
/// [too many tests](RayDensity::MOST_TESTS) with those that earlier rays took.
fn traced<P: Primitive>(
    tree: &Bvh,
    objects: &[P],
    bounds: &Aabb,
    count: usize,
    mut tests: TestCounts,
    is_over: &dyn Fn() -> bool,
) -> Vec<Segment> {
    let extent = bounds.max - bounds.min;
    let mut rng = Stream::seed_from_u64(1);
    let mut segments = Vec::with_capacity(count);
    let mut bounce = None;
    for _ in 0..count {
        if is_over() || !RayDensity::affords(&tests, 1.0) {
            break;
        }
        let inside = bounds.min + extent * Vec3::from_array(rng.random());
        let direction = random_direction(&mut rng);
        let Ok(ray) = Ray::half_line(bounce.unwrap_or(inside), direction) else { break };
        let prepared = P::prepare(&ray);
        let test = |id: u32, t_max| objects[id as usize].intersect(&prepared, t_max);
        let hit = nearest_hit_by(tree, &ray, test, &mut tests);
        bounce = match (bounce, hit) {
            (None, Some(hit)) => Some(ray.at(hit.t * JUST_BEFORE)),
            _ => None,
        };
        // A ray without a hit ends outside the scene.
        let end = hit.map_or(2.0 * extent.length(), |hit| hit.t);
        segments.extend(Segment::of_ray(&ray, end));
    }
    segments
}

/// Returns a direction that is uniform on the sphere, by arithmetic that is the same on every
/// machine.
fn random_direction(rng: &mut Stream) -> Vec3 {
    loop {
        let point = 2.0 * Vec3::from_array(rng.random()) - 1.0;
        let squared = point.length_squared();
        if squared <= 1.0 && squared > 1e-6 {
            return point / squared.sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_build::{Builder, median_cut, muller_fellner};
    use bvh_core::{Node, Triangle};
    use std::cell::Cell;

    /// Returns walls across the x axis at 0, 1, 2, 3, and a tree over them.
    fn walls() -> (Vec<Triangle>, Primitives, Bvh) {
        let triangles: Vec<Triangle> = (0..4u8)
            .map(f32::from)
            .map(|x| Triangle::from([[x, 0.0, 0.0], [x, 9.0, 0.0], [x, 0.0, 9.0]]))
            .collect();
        let tree = median_cut::Config::default().build(&bvh_core::boxes(&triangles)).unwrap();
        (triangles.clone(), Primitives::Triangles(triangles), tree)
    }

    /// Ends at the first wall.
    const RECORDED: Segment = Segment { from: [-1.0, 1.0, 1.0], to: [0.0, 1.0, 1.0] };

    #[test]
    fn a_quarter_of_a_density_is_rays_from_anywhere_up_to_their_hits() {
        let (triangles, shapes, tree) = walls();
        let boxes = bvh_core::boxes(&triangles);
        let last = boxes[3];
        let density =
            |shapes| ray_density(&tree, shapes, &[RECORDED; 300], &|| false).unwrap().unwrap();
        let alone = density(None);
        assert_eq!((alone.segments(), alone.entries(&last)), (300, 0.0));
        let guarded = density(Some(&shapes));
        assert_eq!(guarded.segments(), 400);
        assert!(guarded.entries(&last) > 1.0, "{}", guarded.entries(&last));
        let segments = traced(&tree, &triangles, &Aabb::union_of(&boxes), 1000, NONE, &|| false);
        let ends = segments.iter().map(|segment| Vec3::from(segment.to));
        let is_on_a_wall = |end: &Vec3| {
            (end.x - end.x.round()).abs() < 1e-4
                && end.y + end.z <= 9.0
                && end.min_element() > -1e-4
        };
        assert!(ends.filter(is_on_a_wall).count() > 300);
    }

    #[test]
    fn directions_are_uniform_and_every_second_ray_goes_on_before_the_hit_of_the_first() {
        let rng = &mut Stream::seed_from_u64(3);
        let directions: Vec<Vec3> = (0..20_000).map(|_| random_direction(rng)).collect();
        assert!(directions.iter().all(|direction| (direction.length() - 1.0).abs() < 1e-6));
        let mean = directions.iter().sum::<Vec3>() / 2e4;
        let squares =
            directions.iter().map(|direction| *direction * *direction).sum::<Vec3>() / 2e4;
        assert!(mean.length() < 0.02, "{mean}");
        assert!((squares - 1.0 / 3.0).abs().max_element() < 0.01, "{squares}");
        let (triangles, _, tree) = walls();
        let bounds = Aabb::union_of(&bvh_core::boxes(&triangles));
        let segments = traced(&tree, &triangles, &bounds, 500, NONE, &|| false);
        let mut bounces = 0;
        for pair in segments.windows(2) {
            let [from, end, next] = [pair[0].from, pair[0].to, pair[1].from].map(Vec3::from);
            let is_bounce = next.distance(end) < 0.01;
            bounces += usize::from(is_bounce);
            assert!(!is_bounce || next.distance(from) < end.distance(from));
            let inside = bounds.min - 1e-3;
            assert!(next.cmpge(inside).all() && next.cmple(bounds.max + 1e-3).all());
        }
        assert!((100..250).contains(&bounces), "{bounces}");
    }

    #[test]
    fn fewer_rays_guard_a_density_where_all_of_them_meet_all_objects() {
        let triangle = Triangle::from([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]);
        let leaf = Node::leaf(triangle.aabb(), 0, 30_000);
        let tree = Bvh { nodes: vec![leaf], prim_ids: (0..30_000).collect(), ..Bvh::default() };
        let taken = TestCounts { objects: RayDensity::MOST_TESTS - 1_000_000, ..NONE };
        let segments =
            traced(&tree, &[triangle; 30_000], &triangle.aabb(), 20_000, taken, &|| false);
        assert_eq!(segments.len(), 1_000_000 / 30_000 + 1);
    }

    #[test]
    fn more_recorded_segments_than_a_density_counts_leave_room_for_the_guard() {
        let (_, shapes, tree) = walls();
        let most = RayDensity::MOST_SEGMENTS;
        let recorded = vec![RECORDED; most];
        let density = ray_density(&tree, Some(&shapes), &recorded, &|| false).unwrap().unwrap();
        // Every second one is recorded.
        assert_eq!(density.segments() as usize, most / 2 + most / 6);
    }

    #[test]
    fn a_density_is_the_same_through_any_tree_and_ends_when_the_caller_says_so() {
        let (triangles, shapes, halved) = walls();
        // The order of their objects makes these trees different.
        let boxes = bvh_core::boxes(&triangles);
        let greedy = muller_fellner::Config::default().build(&boxes).unwrap();
        let polls = Cell::new(0);
        let over_after = |tree: &Bvh, most: usize| {
            polls.set(0);
            let is_over = || polls.replace(polls.get() + 1) >= most;
            ray_density(tree, Some(&shapes), &[RECORDED; 300], &is_over).unwrap()
        };
        let [expected, found] =
            [&greedy, &halved].map(|tree| over_after(tree, usize::MAX).unwrap());
        assert_eq!(found.visits(&halved), expected.visits(&halved));
        assert!(over_after(&halved, 10).is_none());
        assert_eq!(polls.get(), 12);
    }
}
