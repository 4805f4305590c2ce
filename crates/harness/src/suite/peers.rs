//! Other libraries on the same scenes, by the same promises. Only ever called in a child process.

use super::child::Found;
use super::tracing::{brute_force, rays};
use super::transform::{same_topology, scale_range};
use super::{exact_area, scenes};
use bvh_core::{Aabb, Bvh, Node, Ray, Shear, Triangle, cost, validate};
use glam::Vec3;

/// The nearest distance at which a ray meets a triangle, by the library's own traversal.
type Nearest = Box<dyn Fn(&Ray) -> Option<f32>>;

/// A library's tree in our form, and its traversal.
struct Built {
    tree: Bvh,
    nearest: Nearest,
}

macro_rules! peers {
    ($($name:literal => $build:expr,)*) => {
        /// The libraries by name.
        pub const NAMES: &[&str] = &[$($name),*];

        fn build(name: &str, triangles: &[Triangle]) -> Option<Built> {
            match name {
                $($name => Some($build(triangles)),)*
                _ => None,
            }
        }
    };
}

// A further library is one line and one function.
peers! {
    "bvh 0.13" => bvh_0_13,
    "obvhs 0.4 fast" => |t| obvhs_0_4(t, obvhs::BvhBuildParams::fast_build()),
    "obvhs 0.4 slow" => |t| obvhs_0_4(t, obvhs::BvhBuildParams::slow_build()),
}

/// Rays per scene.
const RAYS: usize = 500;
/// More objects are not traced by brute force nor scaled.
const FEW: usize = 1000;

/// The library's tree over the triangles; `None` if there is no such library.
pub fn examine(name: &str, triangles: &[Triangle]) -> Option<Found> {
    let Built { tree, nearest } = build(name, triangles)?;
    let boxes = scenes::boxes(triangles);
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
        let rays = rays(triangles, RAYS, 1);
        let misses =
            rays.iter().filter(|ray| nearest(ray) != brute_force(triangles, ray).map(|hit| hit.t)).count();
        if misses > 0 {
            broken.push(format!("P3: {misses} of {RAYS} rays differ from brute force"));
        }
        let range = scale_range(&boxes);
        for k in [(*range.start()).max(-120), (*range.end()).min(120)] {
            let scale = |p: Vec3| (p.as_dvec3() * libm::exp2(k.into())).as_vec3();
            let scaled: Vec<Triangle> = triangles.iter().map(|t| Triangle(t.0.map(scale))).collect();
            if !build(name, &scaled).is_some_and(|other| same_topology(&other.tree, &tree)) {
                broken.push(format!("P5: another tree at scale 2^{k}"));
            }
        }
    }
    Some(Found { depth, cost: area, broken: broken.join("; ") })
}

fn nearest_of(triangles: &[Triangle], ray: &Ray, ids: impl IntoIterator<Item = usize>) -> Option<f32> {
    let shear = Shear::new(ray);
    let hits = ids.into_iter().filter_map(|id| triangles[id].intersect(&shear, ray.t_max()));
    hits.min_by(f32::total_cmp)
}

struct Shape {
    aabb: Aabb,
    id: usize,
    node: usize,
}

impl bvh::aabb::Bounded<f32, 3> for Shape {
    fn aabb(&self) -> bvh::aabb::Aabb<f32, 3> {
        bvh::aabb::Aabb::with_bounds(self.aabb.min.to_array().into(), self.aabb.max.to_array().into())
    }
}

impl bvh::bounding_hierarchy::BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

fn bvh_0_13(triangles: &[Triangle]) -> Built {
    use bvh::bvh::{Bvh as Theirs, BvhNode};
    let mut shapes: Vec<Shape> =
        triangles.iter().enumerate().map(|(id, t)| Shape { aabb: t.aabb(), id, node: 0 }).collect();
    let theirs: Theirs<f32, 3> = Theirs::build(&mut shapes);
    let corner = |p: nalgebra::Point3<f32>| Vec3::new(p.x, p.y, p.z);
    let aabb = |b: &bvh::aabb::Aabb<f32, 3>| Aabb { min: corner(b.min), max: corner(b.max) };
    let mut tree = Bvh::default();
    let mut open = Vec::new();
    if !theirs.nodes.is_empty() {
        tree.nodes.push(Node::leaf(Aabb::EMPTY, 0, 1));
        open.push((0, 0));
    }
    while let Some((from, to)) = open.pop() {
        match &theirs.nodes[from] {
            BvhNode::Leaf { shape_index, .. } => {
                tree.nodes[to] = Node::leaf(shapes[*shape_index].aabb, tree.prim_ids.len() as u32, 1);
                tree.prim_ids.push(shapes[*shape_index].id as u32);
            }
            BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } => {
                let first = tree.nodes.len();
                let (left, right) = (aabb(child_l_aabb), aabb(child_r_aabb));
                tree.nodes[to] = Node::inner(left.union(&right), first as u32, 2);
                tree.nodes.extend([Node::leaf(left, 0, 1), Node::leaf(right, 0, 1)]);
                open.extend([(*child_r_index, first + 1), (*child_l_index, first)]);
            }
        }
    }
    let triangles = triangles.to_vec();
    let nearest = move |ray: &Ray| {
        let (origin, direction) = (ray.origin().to_array(), ray.direction().to_array());
        let theirs_ray = bvh::ray::Ray::new(origin.into(), direction.into());
        let found = theirs.traverse(&theirs_ray, &shapes);
        nearest_of(&triangles, ray, found.iter().map(|shape| shape.id))
    };
    Built { tree, nearest: Box::new(nearest) }
}

fn obvhs_0_4(triangles: &[Triangle], params: obvhs::BvhBuildParams) -> Built {
    use obvhs::bvh2::builder::build_bvh2;
    let boxes: Vec<obvhs::aabb::Aabb> = triangles
        .iter()
        .map(Triangle::aabb)
        .map(|b| obvhs::aabb::Aabb::new(b.min.to_array().into(), b.max.to_array().into()))
        .collect();
    let theirs = build_bvh2(&boxes, params, &mut Default::default());
    let aabb = |node: &obvhs::bvh2::node::Bvh2Node| Aabb {
        min: Vec3::from_array(node.aabb().min.to_array()),
        max: Vec3::from_array(node.aabb().max.to_array()),
    };
    let mut tree = Bvh::default();
    let mut open = Vec::new();
    if !theirs.nodes.is_empty() && !triangles.is_empty() {
        tree.nodes.push(Node::leaf(Aabb::EMPTY, 0, 1));
        open.push((0, 0));
    }
    while let Some((from, to)) = open.pop() {
        let node = &theirs.nodes[from];
        if node.is_leaf() {
            let prims = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            tree.nodes[to] = Node::leaf(aabb(node), tree.prim_ids.len() as u32, node.prim_count);
            tree.prim_ids.extend_from_slice(&theirs.primitive_indices[prims]);
        } else {
            let first = tree.nodes.len();
            tree.nodes[to] = Node::inner(aabb(node), first as u32, 2);
            tree.nodes.extend([Node::leaf(Aabb::EMPTY, 0, 1); 2]);
            open.extend([(node.first_index as usize + 1, first + 1), (node.first_index as usize, first)]);
        }
    }
    let triangles = triangles.to_vec();
    let nearest = move |ray: &Ray| {
        let (shear, ids) = (Shear::new(ray), &theirs.primitive_indices);
        let theirs_ray = obvhs::ray::Ray::new(
            ray.origin().to_array().into(),
            ray.direction().to_array().into(),
            ray.t_min(),
            // Theirs takes hits below the end of the range only.
            ray.t_max().next_up(),
        );
        let mut hit = obvhs::ray::RayHit::none();
        theirs.ray_traverse(theirs_ray, &mut hit, |_, at| {
            let triangle = &triangles[ids[at] as usize];
            triangle.intersect(&shear, ray.t_max()).unwrap_or(f32::INFINITY)
        });
        // The distance is overwritten at the end, whether there was a hit or not.
        (hit.primitive_id != u32::MAX).then_some(hit.t)
    };
    Built { tree, nearest: Box::new(nearest) }
}
