//! Checks other libraries on the same scenes for the same promises. It runs only in a child
//! process, because a library's crash or hang would end the program.

use serde::{Deserialize, Serialize};

/// The findings about another library's tree.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Found {
    /// Edges from the root to the deepest leaf.
    pub depth: usize,
    /// The internal area.
    pub cost: f64,
    /// The broken promises, in the notation of [`Broken`](bvh_stress::Broken).
    pub broken: Vec<String>,
}

#[cfg(feature = "peers")]
pub use compiled_in::{NAMES, examine};

/// The names of the other libraries; none without the feature `peers`.
#[cfg(not(feature = "peers"))]
pub const NAMES: &[&str] = &[];

/// Examines a library's tree over the triangles; `None`, because no library is compiled in.
#[cfg(not(feature = "peers"))]
pub fn examine(_: &str, _: &[bvh_core::Triangle]) -> Option<Found> {
    None
}

#[cfg(feature = "peers")]
mod compiled_in {
    use super::Found;
    use crate::peers::{NoSettings, Obvhs, Peer, Preset, Raw};
    use bvh_core::{Primitives, Ray, Shear, Triangle, cost, validate};
    use bvh_scenes::builtin::stiff;
    use bvh_scenes::trace::{Accelerator, Structure};
    use bvh_stress::Promise::{P2, P3, P5, P7};
    use bvh_stress::exact_area;
    use bvh_stress::examine::ROUNDING;
    use bvh_stress::tracing::rays;
    use bvh_stress::transform::{same_topology, scale_range, scaled};

    /// The names of the libraries. Adding a library takes one line here and one in [`peer`].
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
    /// The maximum number of objects of a scene that is traced by brute force and scaled.
    const FEW: usize = 1000;

    /// Examines a library's tree over the triangles; `None` if there is no such library.
    pub fn examine(name: &str, triangles: &[Triangle]) -> Option<Found> {
        let peer = peer(name)?;
        let boxes = stiff::boxes(triangles);
        let Raw { tree, nearest } = peer.raw(&boxes);
        let mut broken = Vec::new();
        let valid = validate(&tree, &boxes);
        if let Err(error) = &valid {
            broken.push(P2.broken(error));
        }
        let mut depth = 0;
        let mut area = f64::NAN;
        if valid.is_ok() {
            (depth, area) = (tree.depth(), cost::internal_area(&tree));
            if exact_area::relative_error(area, &exact_area::internal_area(&tree)) > ROUNDING {
                broken.push(P7.broken(format!("cost {area}")));
            }
        }
        // Brute force over many objects would take longer than the limit of the child.
        if triangles.len() <= FEW {
            let objects = Primitives::Triangles(triangles.to_vec());
            let brute_force = Accelerator::new(&objects, Structure::Brute);
            // Every object is tested by our exact test, so differences come from the traversal
            // alone.
            let differs = |ray: &&Ray| {
                let shear = Shear::new(ray);
                let found =
                    nearest(ray, &|id| triangles[id as usize].intersect(&shear, ray.t_max()));
                found != brute_force.nearest_hit(ray).map(|hit| hit.t)
            };
            let misses = rays(triangles, RAYS, 1)
                .iter()
                .filter(differs)
                .count();
            if misses > 0 {
                broken.push(P3.broken(format!("{misses} of {RAYS} rays differ from brute force")));
            }
            let range = scale_range(&boxes);
            for k in [(*range.start()).max(-120), (*range.end()).min(120)] {
                let other = peer.raw(&scaled(&boxes, k));
                if !same_topology(&other.tree, &tree) {
                    broken.push(P5.broken(format!("another tree at scale 2^{k}")));
                }
            }
        }
        Some(Found { depth, cost: area, broken: broken.iter().map(ToString::to_string).collect() })
    }
}
