//! Checks of rays, their ranges, and the estimator that traces random rays.

use crate::transform::scaled_triangles;
use crate::{Verdict, tracing};
use anyhow::{Context, ensure};
use bvh_build::{Builder, muller_fellner};
use bvh_core::{Primitives, Ray, Triangle, validate};
use bvh_scenes::builtin::stiff;
use bvh_scenes::rays::{Family, RandomRays, empirical_cost};
use bvh_scenes::trace::Query;
use glam::Vec3;

/// S15: zero, NaN and infinite directions and origins are rejected before any traversal.
pub fn no_such_rays() -> Verdict {
    let nan = f32::NAN;
    let inf = f32::INFINITY;
    let directions = [
        Vec3::ZERO,
        -Vec3::ZERO,
        Vec3::NAN,
        Vec3::X * nan,
        Vec3::Y * inf,
        Vec3::new(1.0, -inf, 0.0),
    ];
    for bad in directions {
        ensure!(Ray::half_line(Vec3::ZERO, bad).is_err(), "direction {bad} is accepted");
    }
    let origins = [Vec3::NAN, Vec3::new(0.0, inf, 0.0), Vec3::new(0.0, 0.0, nan)];
    for bad in origins {
        ensure!(Ray::half_line(bad, Vec3::X).is_err(), "origin {bad} is accepted");
    }
    Ok(format!("{} refused", directions.len() + origins.len()))
}

/// S16: an empty range hits nothing, an infinite range equals the longest finite one, a single
/// point hits an object at that point.
pub fn ranges_are_defined() -> Verdict {
    let triangle = Primitives::Triangles(vec![Triangle([Vec3::ZERO, Vec3::X, Vec3::Y])]);
    let origin = Vec3::new(0.25, 0.25, -2.0);
    for (t_min, t_max, expected) in [
        (0.0, f32::INFINITY, true),
        (2.0, 2.0, true),
        (1.0, 1.0, false),
        (2.0, 1.0, false),
        (0.0, 2f32.next_down(), false),
        (2f32.next_up(), f32::INFINITY, false),
        (f32::INFINITY, f32::INFINITY, false),
    ] {
        let ray = Ray::new(origin, Vec3::Z, t_min, t_max)?;
        for (name, traversal) in tracing::TRAVERSALS {
            for (way, answers) in traversal(&triangle)? {
                let (nearest, any) = answers(&[ray])[0];
                let agree = nearest.is_some() == expected && any == expected;
                ensure!(
                    agree,
                    "{name}, {way}: range {t_min}..={t_max} gives {nearest:?} and {any}"
                );
            }
        }
    }
    for (t_min, t_max) in [(f32::NAN, 1.0), (0.0, f32::NAN), (-1.0, 1.0)] {
        ensure!(
            Ray::new(origin, Vec3::Z, t_min, t_max).is_err(),
            "range {t_min}..={t_max} is accepted"
        );
    }
    Ok(String::new())
}

/// S22: distances that are denormal or round to 0 are the same in every traversal.
///
/// Coordinates from 2^-100 and directions up to 1e30 make distances from far below the smallest
/// number up to 1.
pub fn denormal_distances() -> Verdict {
    let mut hits = 0;
    let mut check = |objects: &Primitives, rays: &[Ray]| {
        let mut found = 0;
        for (name, traversal) in tracing::TRAVERSALS {
            found = tracing::check(*traversal, objects, rays).context(*name)?;
        }
        hits += found;
        anyhow::Ok(())
    };
    let facing =
        Triangle([[-1.0, -1.0, 1e-30], [3.0, -1.0, 1e-30], [-1.0, 3.0, 1e-30]].map(Vec3::from));
    let ray = Ray::new(Vec3::ZERO, Vec3::Z * 1e20, 0.0, 0.0)?;
    check(&Primitives::Triangles(vec![facing]), &[ray])?;
    for k in [-100, -60, -40, -20] {
        let triangles = scaled_triangles(&stiff::uniform(60), k);
        let mut rays = Vec::new();
        for (ray, attempt) in tracing::rays(&triangles, 400, 22).iter().zip(0usize..) {
            let length = [1.0, 1e20, 1e25, 1e30][attempt % 4] / ray.direction().abs().max_element();
            let t_max = [0.0, f32::from_bits(1), 1e-40, 1e-38, f32::INFINITY][attempt % 5];
            rays.extend(Ray::new(ray.origin(), ray.direction() * length, 0.0, t_max));
        }
        check(&Primitives::Triangles(triangles), &rays)?;
    }
    ensure!(hits > 100, "only {hits} rays hit");
    Ok(format!("{hits} rays hit"))
}

/// S44: four times the rays halve the standard error, and the 95 % intervals cover the mean of many
/// more rays.
pub fn estimates_converge() -> Verdict {
    let primitives = Primitives::Triangles(stiff::uniform(500));
    let boxes = primitives.boxes();
    let tree = muller_fellner::Config::default().build(&boxes)?;
    validate(&tree, &boxes)?;
    let measure = |count, seed| {
        let rays = RandomRays { family: Family::Inside, query: Query::Any, count };
        empirical_cost(&rays, &primitives, &tree, seed).boxes
    };
    const FEWEST: u64 = 2000;
    // Enough seeds that a coverage below 95 % shows, and few enough for seconds.
    const SEEDS: u64 = 60;
    let truth = measure(1 << 18, 0).mean;
    let mut covered = 0;
    let mut errors = [0.0; 3];
    for seed in 1..=SEEDS {
        let [low, high] = measure(FEWEST, seed).interval();
        covered += u64::from((low..=high).contains(&truth));
        if seed <= 5 {
            for (factor, error) in [1, 4, 16].into_iter().zip(&mut errors) {
                *error += measure(FEWEST * factor, seed).standard_error;
            }
        }
    }
    let ratios = [errors[0] / errors[1], errors[1] / errors[2]];
    ensure!(
        ratios.iter().all(|ratio| (ratio - 2.0).abs() < 0.15),
        "standard errors fall by {ratios:?}"
    );
    // Fewer than 51 of 60 would happen once in a thousand times.
    ensure!(covered >= 51, "{covered} of {SEEDS} intervals cover {truth}");
    Ok(format!("{covered} of {SEEDS} intervals cover"))
}
