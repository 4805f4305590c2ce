//! Filters of hits, ray by ray and in batches, by every kernel.

use crate::support::layouts::{bundles, layouts};
use crate::support::{Random, rays, soup};
use bvh_core::{Coherence, Hit, PreparedRay, Ray, Triangle};

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

#[test]
fn a_filter_of_a_batch_sees_the_number_of_the_ray_with_each_hit() {
    let mut random = Random(10);
    let triangles = soup(150, &mut random);
    let layouts = layouts(&triangles, &mut random);
    // Packets, single rays between them, and a length that fills no vector.
    let mut rays = rays(&triangles, 501, &mut random);
    rays.extend(bundles(&triangles, 40, &mut random));
    let all: Vec<Vec<Hit>> = rays.iter().map(|ray| all_hits(&triangles, ray)).collect();
    let is_kept = |number: usize, hit: &Hit| !(hit.object as usize + number).is_multiple_of(3);
    let expected: Vec<Hit> = (0..)
        .zip(&all)
        .map(|(number, hits)| {
            let kept = hits.iter().filter(|hit| is_kept(number, hit));
            nearest(kept).unwrap_or(Hit::MISS)
        })
        .collect();
    let differ = (0..)
        .zip(&all)
        .filter(|(number, hits)| nearest(hits.iter()).is_some_and(|hit| !is_kept(*number, &hit)));
    assert!(differ.count() > 100);
    for (kernel, layout) in &layouts {
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let case = format!("{kernel:?}, {coherence:?}");
            let mut hits = vec![Hit::MISS; rays.len()];
            let mut any = vec![false; rays.len()];
            layout.nearest_hits_where(&rays, &mut hits, coherence, |number, hit| {
                is_kept(number, &hit)
            });
            layout.any_hits_where(&rays, &mut any, coherence, |number, hit| is_kept(number, &hit));
            assert_eq!(hits, expected, "{case}");
            let has_hit: Vec<bool> = expected.iter().map(|hit| !hit.is_miss()).collect();
            assert_eq!(any, has_hit, "{case}");
            let mut seen = vec![Vec::new(); rays.len()];
            layout.nearest_hits_where(&rays, &mut hits, coherence, |number, hit| {
                seen[number].push(hit);
                false
            });
            for hits in &mut seen {
                hits.sort_by_key(|hit| hit.object);
            }
            assert_eq!(seen, all, "{case}");
            assert!(hits.iter().all(Hit::is_miss), "{case}");
        }
    }
}
