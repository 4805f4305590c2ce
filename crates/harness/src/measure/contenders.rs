//! Our trees in their layouts, behind what all contenders can do: answer rays, against the clock, and count tests.

use super::Layout;
use crate::measure::rays::Query;
use crate::scenes::Scene;
use bvh_core::cost::SahConstants;
use bvh_core::{Bvh, Hit, Ray, Shear, TestCounts, Triangle, WideBvh, any_hit, collapse_leaves, nearest_hit};
use std::borrow::Cow;
use std::time::Instant;

/// Answers rays, the distance and the object of a hit for each (any of both for an any-hit query), and returns the
/// seconds that took, part by part.
pub type Trace<'a> = Box<dyn Fn(Query, &[Ray], &mut [Option<Hit>]) -> Vec<f64> + 'a>;

/// Counts the tests of one ray.
pub type Count<'a> = Box<dyn Fn(Query, &Ray, &mut TestCounts) + 'a>;

/// A structure that traces rays, with its name.
pub struct Contender<'a> {
    /// Name of the layout.
    pub layout: String,
    /// Whether its answers must be ours, bit by bit.
    pub exact: bool,
    /// What it took to make the layout from a tree, for other libraries with the tree.
    pub preparation_seconds: f64,
    /// Traces.
    pub trace: Trace<'a>,
    /// Counts tests, the same on every machine; none where they cannot be counted.
    pub count: Option<Count<'a>>,
}

/// Rays whose time is taken together: few enough that some part of every turn is not interrupted by other programs.
pub(super) const PART: usize = 4096;

/// Answers every ray and returns the seconds that took, part by part.
#[inline(always)]
pub fn timed<R>(rays: &[R], hits: &mut [Option<Hit>], mut answer: impl FnMut(&R) -> Option<Hit>) -> Vec<f64> {
    let part = |(rays, hits): (&[R], &mut [Option<Hit>])| {
        let start = Instant::now();
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = answer(ray);
        }
        start.elapsed().as_secs_f64()
    };
    rays.chunks(PART).zip(hits.chunks_mut(PART)).map(part).collect()
}

/// One of our trees in its layouts.
pub(super) fn own_contenders<'a>(
    layouts: &[Layout],
    scene: &Scene,
    tree: &'a Bvh,
) -> Result<Vec<Contender<'a>>, String> {
    let mut contenders = Vec::new();
    for &layout in layouts {
        let triangles = scene.triangles().map_err(|error| error.to_string())?;
        let start = Instant::now();
        contenders.push(match layout {
            Layout::Binary => binary("binary", Cow::Borrowed(tree), triangles, 0.0),
            Layout::BinaryLeaves => {
                let merged = collapse_leaves(tree, &SahConstants::default());
                let seconds = start.elapsed().as_secs_f64();
                binary("binary, merged leaves", Cow::Owned(merged), triangles, seconds)
            }
            Layout::Wide | Layout::WidePortable => {
                let wide = WideBvh::new(tree, &triangles).map_err(|error| error.to_string())?;
                self::wide(wide, layout, start.elapsed().as_secs_f64())
            }
        });
    }
    Ok(contenders)
}

pub(super) fn binary<'a>(
    layout: &str,
    tree: Cow<'a, Bvh>,
    triangles: Vec<Triangle>,
    preparation_seconds: f64,
) -> Contender<'a> {
    let (counted_tree, counted) = (tree.clone(), triangles.clone());
    Contender {
        layout: layout.into(),
        exact: true,
        preparation_seconds,
        trace: Box::new(move |query, rays, hits| match query {
            Query::Any => timed(rays, hits, |ray| {
                let shear = Shear::new(ray);
                let test = |id: u32| triangles[id as usize].intersect(&shear, ray.t_max()).is_some();
                any_hit(&*tree, ray, test, &mut ()).then_some(SOME_HIT)
            }),
            _ => timed(rays, hits, |ray| {
                let shear = Shear::new(ray);
                nearest_hit(&*tree, ray, |id, t_max| triangles[id as usize].intersect(&shear, t_max), &mut ())
            }),
        }),
        count: Some(Box::new(move |query, ray, counts| {
            let shear = Shear::new(ray);
            let test = |id: u32, t_max| counted[id as usize].intersect(&shear, t_max);
            if query == Query::Any {
                any_hit(&*counted_tree, ray, |id| test(id, ray.t_max()).is_some(), counts);
            } else {
                nearest_hit(&*counted_tree, ray, test, counts);
            }
        })),
    }
}

pub(super) fn wide(wide: WideBvh, layout: Layout, preparation_seconds: f64) -> Contender<'static> {
    let counted = wide.clone();
    let portable = layout == Layout::WidePortable;
    Contender {
        layout: if portable { "wide, portable" } else { "wide" }.into(),
        exact: true,
        preparation_seconds,
        trace: Box::new(move |query, rays, hits| match (query, portable) {
            (Query::Any, false) => timed(rays, hits, |ray| wide.any_hit(ray).then_some(SOME_HIT)),
            (Query::Any, true) => {
                timed(rays, hits, |ray| wide.view().any_hit_portable(ray).then_some(SOME_HIT))
            }
            (_, false) => timed(rays, hits, |ray| wide.nearest_hit(ray)),
            (_, true) => timed(rays, hits, |ray| wide.view().nearest_hit_portable(ray)),
        }),
        count: Some(Box::new(move |query, ray, counts| match query {
            Query::Any => drop(counted.view().any_hit_counted(ray, counts)),
            _ => drop(counted.view().nearest_hit_counted(ray, counts)),
        })),
    }
}

/// What any-hit queries answer for a hit.
pub(super) const SOME_HIT: Hit = Hit { t: 0.0, object: 0 };
