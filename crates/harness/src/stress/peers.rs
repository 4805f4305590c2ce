//! Other libraries on the same scenes, by the same promises. Only ever called in a child process.

use super::child::Found;
use super::tracing::{brute_force, rays};
use super::transform::{same_topology, scale_range, scaled};
use super::{exact_area, scenes};
use crate::peers::{NoSettings, Obvhs, Peer, Preset, Raw};
use bvh_core::{Ray, Shear, Triangle, cost, validate};

/// The libraries by name. A further one is one line, here and in [`peer`].
pub const NAMES: &[&str] = &["bvh 0.13", "obvhs 0.4 fast", "obvhs 0.4 slow"];

fn peer(name: &str) -> Option<Peer> {
    let obvhs = |preset| Peer::Obvhs(Obvhs { preset, reinsertion: None });
    match name {
        "bvh 0.13" => Some(Peer::Bvh(NoSettings {})),
        "obvhs 0.4 fast" => Some(obvhs(Preset::Fast)),
        "obvhs 0.4 slow" => Some(obvhs(Preset::Slow)),
        _ => None,
    }
}

/// Rays per scene.
const RAYS: usize = 500;
/// More objects are not traced by brute force nor scaled.
const FEW: usize = 1000;

/// The library's tree over the triangles; `None` if there is no such library.
pub fn examine(name: &str, triangles: &[Triangle]) -> Option<Found> {
    let peer = peer(name)?;
    let boxes = scenes::boxes(triangles);
    let Raw { tree, nearest } = peer.raw(&boxes)?;
    let mut broken = Vec::new();
    let valid = validate(&tree, &boxes);
    if let Err(error) = &valid {
        broken.push(format!("P2: {error}"));
    }
    let (mut depth, mut area) = (0, f64::NAN);
    if valid.is_ok() {
        (depth, area) = (tree.depth(), cost::internal_area(&tree));
        if exact_area::relative_error(area, &exact_area::internal_area(&tree)) > super::examine::ROUNDING {
            broken.push(format!("P7: cost {area}"));
        }
    }
    if triangles.len() <= FEW {
        let differs = |ray: &&Ray| {
            let shear = Shear::new(ray);
            let found = nearest(ray, &|id| triangles[id as usize].intersect(&shear, ray.t_max()));
            found != brute_force(triangles, ray).map(|hit| hit.t)
        };
        let misses = rays(triangles, RAYS, 1).iter().filter(differs).count();
        if misses > 0 {
            broken.push(format!("P3: {misses} of {RAYS} rays differ from brute force"));
        }
        let range = scale_range(&boxes);
        for k in [(*range.start()).max(-120), (*range.end()).min(120)] {
            let other = peer.raw(&scaled(&boxes, k));
            if !other.is_some_and(|other| same_topology(&other.tree, &tree)) {
                broken.push(format!("P5: another tree at scale 2^{k}"));
            }
        }
    }
    Some(Found { depth, cost: area, broken: broken.join("; ") })
}
