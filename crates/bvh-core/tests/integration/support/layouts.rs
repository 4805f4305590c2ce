//! Trees of divided triangles, layouts of several trees by every kernel, and rays for both.

use super::{Random, SHAPES, boxes, chain, size, tree};
use bvh_core::{
    Aabb, Bvh, Clip, Frame, InFrame, Kernel, Node, Ray, Triangle, WideBvh, check_boxes,
    collapse_leaves, cost::SahConstants,
};
use glam::{DMat3, DQuat, DVec3, Vec3};

/// Divides leaves of `tree` at random planes, and divides parts again. Returns the tree, and the
/// object, axis and coordinate of each plane.
pub fn divided(
    tree: &Bvh,
    triangles: &[Triangle],
    random: &mut Random,
) -> (Bvh, Vec<(u32, usize, f32)>) {
    let objects = InFrame { triangles, frame: tree.frame.as_ref() };
    let mut tree = tree.clone();
    let mut planes = Vec::new();
    let mut index = 0;
    while index < tree.nodes.len() {
        let Node { aabb, .. } = tree.nodes[index];
        let range = tree.nodes[index].prims();
        if range.len() == 1 && random.below(3) > 0 {
            let object = tree.prim_ids[range.start];
            let axis = random.below(3);
            let corner = random.of(&triangles[object as usize].0)[axis];
            let somewhere = aabb.min[axis] + random.unit() * aabb.extent()[axis] as f32;
            // Planes through corners are the hard ones.
            let plane = random.of(&[somewhere, corner]);
            let [low, high] = aabb.halves(axis, plane).map(|region| objects.clip(object, &region));
            let divides = aabb.min[axis] < plane && plane < aabb.max[axis];
            if divides && low != Aabb::EMPTY && high != Aabb::EMPTY {
                let first = tree.nodes.len() as u32;
                let added = tree.prim_ids.len() as u32;
                tree.nodes[index] = Node::inner(aabb, first, 2);
                tree.nodes.push(Node::leaf(low, range.start as u32, 1));
                tree.nodes.push(Node::leaf(high, added, 1));
                tree.prim_ids.push(object);
                planes.push((object, axis, plane));
            }
        }
        index += 1;
    }
    (tree, planes)
}

/// Returns a layout of the triangles by a tree of one of the shapes, or by one more in a frame.
pub fn layout(triangles: &[Triangle], shape: usize) -> WideBvh {
    let mut random = Random(5);
    let framed = if shape < SHAPES.len() { None } else { framed(triangles, &mut random) };
    let shape = SHAPES[shape % SHAPES.len()];
    let tree = framed.unwrap_or_else(|| tree(&boxes(triangles), shape, &mut random));
    WideBvh::new(&tree, triangles).unwrap()
}

/// Returns a tree in a frame that is turned at random, or a little, or by right angles, about a
/// centre in the scene or beside it. `None` if its boxes would not be finite.
pub fn framed(triangles: &[Triangle], random: &mut Random) -> Option<Bvh> {
    let [x, y, z] = [(); 3].map(|()| random.point().x.into());
    let turned = DQuat::from_xyzw(x, y, z, 0.2).normalize();
    let nearly = DQuat::from_rotation_y(1e-8);
    let swapped = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
    let rotation = random.of(&[DMat3::from_quat(turned), DMat3::from_quat(nearly), swapped]);
    let corner = random.of(triangles).0[0].as_dvec3();
    let centre = random
        .of(&[DVec3::ZERO, corner, 3.0 * corner])
        .clamp(DVec3::splat(f32::MIN.into()), DVec3::splat(f32::MAX.into()));
    let frame = Frame::new(rotation, centre).unwrap();
    let boxes = frame.boxes(triangles);
    check_boxes(&boxes).ok()?;
    let mut tree = tree(&boxes, SHAPES[0], random);
    tree.frame = Some(frame);
    Some(tree)
}

/// Returns the layout for every kernel that this processor has.
pub fn by_kernel(wide: &WideBvh) -> Vec<(Kernel, WideBvh)> {
    let of = |kernel| Some((kernel, wide.clone().with_kernel(kernel)?));
    Kernel::ALL.into_iter().filter_map(of).collect()
}

/// The object, axis and coordinate of a plane that divides, and the frame that it lies in.
pub type Plane = ((u32, usize, f32), Option<Frame>);

/// A tree, and its layout for every kernel.
pub struct Traced {
    pub tree: Bvh,
    pub layouts: Vec<(Kernel, WideBvh)>,
}

impl Traced {
    pub fn new(tree: Bvh, triangles: &[Triangle]) -> Self {
        Self { layouts: by_kernel(&WideBvh::new(&tree, triangles).unwrap()), tree }
    }

    /// Makes a tree in a frame about the origin.
    pub fn framed(triangles: &[Triangle], rotation: DMat3, random: &mut Random) -> Self {
        let frame = Frame::new(rotation, DVec3::ZERO).unwrap();
        let tree = tree(&frame.boxes(triangles), SHAPES[0], random);
        Self::new(Bvh { frame: Some(frame), ..tree }, triangles)
    }

    /// Makes trees of all shapes, the deepest one, trees of larger leaves, and trees of divided
    /// triangles.
    pub fn all(triangles: &[Triangle], random: &mut Random) -> Vec<Self> {
        Self::all_and_planes(triangles, random).0
    }

    /// Returns the same, and the planes that divide triangles.
    pub fn all_and_planes(triangles: &[Triangle], random: &mut Random) -> (Vec<Self>, Vec<Plane>) {
        let boxes = boxes(triangles);
        let mut trees: Vec<Bvh> = SHAPES.iter().map(|&shape| tree(&boxes, shape, random)).collect();
        let (parts, planes) = divided(&trees[0], triangles, &mut Random(9));
        let merged =
            [&trees[0], &parts].map(|tree| collapse_leaves(tree, &SahConstants::default()));
        trees.extend(merged);
        trees.extend([parts, chain(&boxes)]);
        let mut planes = Vec::from_iter(planes.into_iter().map(|plane| (plane, None)));
        for _ in 0..2 {
            if let Some(framed) = framed(triangles, random) {
                let (parts, others) = divided(&framed, triangles, random);
                planes.extend(others.into_iter().map(|plane| (plane, framed.frame)));
                trees.extend([parts, framed]);
            }
        }
        (trees.into_iter().map(|tree| Self::new(tree, triangles)).collect(), planes)
    }
}

/// Makes rays through the points where planes divide triangles. Some rays cross the plane and some
/// are within it. Without a plane there are none.
pub fn rays_on_planes(
    triangles: &[Triangle],
    planes: &[Plane],
    count: usize,
    random: &mut Random,
) -> Vec<Ray> {
    let size = size(triangles);
    let mut rays = Vec::new();
    if planes.is_empty() {
        return rays;
    }
    for _ in 0..count {
        let ((object, axis, plane), frame) = random.of(planes);
        let Triangle([a, b, c]) = triangles[object as usize];
        let u = random.unit();
        let v = random.unit();
        let mut target = a + (b - a) * u + (c - a) * (v * (1.0 - u));
        let mut from = target + random.point() * (size * random.of(&[3.0, 0.1, 1e-3]));
        let onto_plane = |point: &mut Vec3| match frame {
            None => point[axis] = plane,
            Some(frame) => {
                let away = f64::from(plane) - frame.point(point.as_dvec3())[axis];
                let along = frame.rotation().transpose().col(axis);
                *point = (point.as_dvec3() + along * away).as_vec3();
            }
        };
        onto_plane(&mut target);
        if random.below(2) == 0 {
            onto_plane(&mut from);
        }
        // Scaled, so that the direction stays in range for huge and tiny scenes.
        rays.extend(Ray::half_line(from, (target - from) / size));
    }
    rays
}

/// Returns groups of sixteen rays that begin close to each other and run nearly in the same
/// direction, towards and beyond an edge or a corner of some triangle: the rays that packets are
/// made for, in the hardest places.
pub fn bundles(triangles: &[Triangle], count: usize, random: &mut Random) -> Vec<Ray> {
    let mut rays = Vec::new();
    let size = size(triangles);
    for _ in 0..count {
        let Triangle([a, b, c]) = random.of(triangles);
        let target = random.of(&[a, (a + b) * 0.5, (a + b + c) / 3.0]);
        let far = random.point() * 3.0;
        let inside = random.point();
        let close = target + random.point() * size * 1e-3;
        let origin = random.of(&[far * size, inside * size, close]);
        let spread = random.of(&[0.0, 1e-7, 1e-3, 0.1]);
        let shift = random.of(&[0.0, 1e-7, 1e-2]);
        for _ in 0..16 {
            let from = origin + random.point() * (shift * size);
            let mut to = target + random.point() * (spread * size) - from;
            if random.below(8) == 0 {
                to[random.below(3)] = 0.0;
            }
            let to = to / size.max(f32::MIN_POSITIVE);
            let (t_min, t_max) = random.of(&[
                (0.0, f32::MAX),
                (0.0, size),
                (size, size),
                (0.5 * size, f32::INFINITY),
            ]);
            rays.push(
                Ray::new(from, to, t_min, t_max).unwrap_or(Ray::half_line(from, Vec3::X).unwrap()),
            );
        }
    }
    rays
}
