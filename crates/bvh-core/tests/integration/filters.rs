//! Filters of hits by every kernel.

use crate::support::layouts::layouts;
use crate::support::{Random, rays, soup};
use bvh_core::{Hit, PreparedRay, Ray, Triangle};

/// Returns all hits of a ray, in the order of their objects.
fn all_hits(triangles: &[Triangle], ray: &Ray) -> Vec<Hit> {
    let prepared = PreparedRay::new(ray);
    let hit = |(object, triangle): (u32, &Triangle)| {
        let t = triangle.intersect(&prepared, ray.t_max())?;
        Some(Hit { t, object })
    };
    (0..).zip(triangles).filter_map(hit).collect()
}

/// Returns the nearest of some hits, and of several at the same distance the one of the lowest id.
fn nearest<'a>(hits: impl Iterator<Item = &'a Hit>) -> Option<Hit> {
    hits.min_by(|a, b| a.t.total_cmp(&b.t).then(a.object.cmp(&b.object))).copied()
}

#[test]
fn a_filter_passes_over_hits_and_sees_all_of_them_if_it_accepts_none() {
    let mut random = Random(9);
    let triangles = soup(150, &mut random);
    let layouts = layouts(&triangles, &mut random);
    let mut found = 0;
    let mut several = 0;
    for ray in rays(&triangles, 2000, &mut random) {
        let all = all_hits(&triangles, &ray);
        let kept = all.iter().filter(|hit| hit.object % 3 > 0);
        let nearest = nearest(kept);
        for (_, layout) in &layouts {
            assert_eq!(layout.nearest_hit_where(&ray, |hit| hit.object % 3 > 0), nearest);
            assert_eq!(layout.any_hit_where(&ray, |hit| hit.object % 3 > 0), nearest.is_some());
            let mut seen = Vec::new();
            assert_eq!(
                layout.nearest_hit_where(&ray, |hit| {
                    seen.push(hit);
                    false
                }),
                None
            );
            seen.sort_by_key(|hit| hit.object);
            assert_eq!(seen, all);
        }
        found += usize::from(nearest.is_some());
        several += usize::from(all.len() > 1);
    }
    assert!(found > 300 && several > 100, "{found} {several}");
}
