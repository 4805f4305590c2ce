//! Instances give the same answers as the scene with all triangles written out, and as their parts,
//! for any tree over the instances.

use crate::support::layouts::bundles;
use crate::support::{self, Random, SHAPES, ball, boxes, chain, grid_box, soup, tree};
use bvh_core::{
    Aabb, Bvh, Instance, InstanceHit, Instances, InvalidInstances, Kernel, Ray, Triangle, WideBvh,
    nearest_hit,
};
use glam::{Affine3A, Mat3, Mat3A, Quat, Vec3, Vec3A};
use std::sync::Arc;

/// Parts as triangles and in the wide layout, and instances of the parts.
struct Scene {
    triangles: Vec<Vec<Triangle>>,
    parts: Vec<WideBvh>,
    instances: Vec<Instance>,
}

fn scene(triangles: Vec<Vec<Triangle>>, transforms: Vec<Affine3A>, random: &mut Random) -> Scene {
    let mut tree_of = |part: &Vec<Triangle>| tree(&boxes(part), SHAPES[0], random);
    let parts = triangles.iter().map(|part| WideBvh::new(&tree_of(part), part).unwrap()).collect();
    let numbers = (0..triangles.len() as u32).cycle();
    let instances = numbers.zip(transforms);
    let instances = instances.map(|(part, transform)| Instance { part, transform }).collect();
    Scene { triangles, parts, instances }
}

impl Scene {
    fn all(&self, random: &mut Random) -> Vec<Instances> {
        let boxes = Instance::boxes(&self.instances, &self.parts).unwrap();
        let mut scenes = Vec::new();
        for shape in SHAPES {
            let mut top = tree(&boxes, shape, random);
            // Padded boxes change no answer: a ray is far from some of these roots, and near others.
            top.nodes[0].aabb.max += random.of(&[0.0, 10.0, 1e4]);
            scenes.push(Instances::new(self.parts.clone(), self.instances.clone(), top).unwrap());
        }
        scenes
    }

    /// Returns the triangles of all instances, moved in f64 and rounded. Every triangle has the
    /// index of its instance and its id in the part.
    fn flat(&self) -> (Vec<Triangle>, Vec<(u32, u32)>) {
        let mut flat = Vec::new();
        let mut names = Vec::new();
        for (instance, Instance { part, transform }) in (0..).zip(&self.instances) {
            for (id, triangle) in (0..).zip(&self.triangles[*part as usize]) {
                flat.push(triangle.transformed(transform));
                names.push((instance, id));
            }
        }
        (flat, names)
    }
}

fn transform(random: &mut Random) -> Affine3A {
    let turn = Quat::from_axis_angle(random.point().normalize(), random.unit() * 6.0);
    let scale = Vec3::splat(random.of(&[0.1, 1.0, 3.0])) * (random.point() * 0.4 + 1.0);
    let shift = random.point() * 20.0;
    let mut transform = Affine3A::from_scale_rotation_translation(scale, turn, shift);
    transform.matrix3.y_axis += transform.matrix3.x_axis * 0.3;
    transform
}

fn bits(hit: Option<InstanceHit>) -> Option<(u32, u32, u32)> {
    hit.map(|hit| (hit.t.to_bits(), hit.instance, hit.triangle))
}

#[test]
fn turned_scaled_and_sheared_instances_answer_as_the_flat_scene() {
    let mut random = Random(1);
    let transforms = (0..60).map(|_| transform(&mut random)).collect();
    let scene = scene(vec![ball(2), grid_box(3), ball(1)], transforms, &mut random);
    let (flat, names) = scene.flat();
    let flat_tree = tree(&boxes(&flat), SHAPES[0], &mut random);
    let instances = scene.all(&mut random).remove(0);
    let mut hits = 0;
    // Rays that graze a surface may differ by rounding.
    let mut differences = 0;
    let Aabb { min, max } = flat_tree.root_aabb().unwrap();
    for i in 0..6000 {
        let [from, to] = [(); 2].map(|()| min + (max - min) * (random.point() * 0.5 + 0.5));
        let from = if i % 3 == 0 { from * 3.0 } else { from };
        let t_max = if i % 5 == 0 { 0.7 } else { f32::INFINITY };
        let ray = Ray::new(from, to - from, 0.0, t_max).unwrap();
        let found = instances.nearest_hit(&ray);
        let expected = nearest_hit(&flat_tree, &flat, &ray);
        hits += usize::from(expected.is_some());
        match (found, expected) {
            (Some(found), Some(expected)) => {
                let name = names[expected.object as usize];
                differences += usize::from((found.instance, found.triangle) != name);
                let reach = ray.origin().abs().max_element() + 40.0;
                let length = ray.direction().length();
                let error = (found.t - expected.t).abs() * length / reach;
                // A ray that only grazes a surface multiplies the rounding.
                differences += usize::from(error > 1e-5);
            }
            (found, expected) => differences += usize::from(found.is_some() != expected.is_some()),
        }
    }
    assert!(hits > 1000, "{hits}");
    assert!(differences < 3, "{differences} of {hits} hits");
}

#[test]
fn transforms_without_rounding_give_the_distances_of_the_flat_scene_bit_by_bit() {
    let mut random = Random(2);
    let quarter_turn = Mat3A::from_cols(Vec3A::Y, Vec3A::NEG_X, Vec3A::Z);
    let turns = [Mat3A::IDENTITY, quarter_turn * 2.0, -Mat3A::IDENTITY];
    let shift = |_| integer_point(30, &mut random);
    let moved = |(turn, shift)| Affine3A::from_mat3_translation(Mat3::from(turn), shift);
    let transforms = turns.into_iter().cycle().zip((0..40).map(shift)).map(moved).collect();
    let scene = scene(vec![grid_box(4), grid_box(2)], transforms, &mut random);
    let (flat, names) = scene.flat();
    let flat_tree = tree(&boxes(&flat), SHAPES[0], &mut random);
    let scenes = scene.all(&mut random);
    let mut hits = 0;
    for _ in 0..4000 {
        let from = integer_point(40, &mut random) - 4.0;
        let to = integer_point(240, &mut random) / 8.0;
        let Ok(ray) = Ray::half_line(from, to - from) else { continue };
        let expected = nearest_hit(&flat_tree, &flat, &ray).map(|hit| {
            let (instance, triangle) = names[hit.object as usize];
            InstanceHit { t: hit.t, instance, triangle }
        });
        hits += usize::from(expected.is_some());
        for scene in &scenes {
            assert_eq!(scene.nearest_hit(&ray), expected, "{ray:?}");
        }
    }
    assert!(hits > 1000, "{hits}");
}

/// Mirrors, nests, flattens and enlarges a part near the origin, so that boxes overlap and contain
/// each other.
fn nested_transform(random: &mut Random) -> Affine3A {
    let size = random.of(&[0.01, 0.3, 1.0, 1.0, 1.0, 8.0]);
    let sign = random.of(&[-1.0, 1.0]);
    let scale = Vec3::new(size * sign, size, size * random.of(&[1.0, 1.0, 1e-3]));
    let turn = match random.below(3) {
        0 => Quat::IDENTITY,
        _ => Quat::from_axis_angle(random.point().normalize(), random.unit() * 6.0),
    };
    let shift = random.point() * random.of(&[0.0, 1.0, 5.0]);
    Affine3A::from_scale_rotation_translation(scale, turn, shift)
}

/// Rays of every kind: towards edges and corners in bundles, difficult ones, from far away, and of
/// extreme lengths, which vector kernels leave to others.
fn rays_of_every_kind(flat: &[Triangle], random: &mut Random) -> Vec<Ray> {
    let mut all = bundles(flat, 20, random);
    all.extend(support::rays(flat, 200, random));
    // From 10²⁰ away a kernel leaves every triangle to exact arithmetic, so a few rays are enough.
    for (scale, count) in [(1e4, 20), (1e7, 20), (1e20, 2)] {
        for _ in 0..count {
            let origin = random.point() * scale;
            let Triangle([a, ..]) = random.of(flat);
            all.extend(Ray::half_line(origin, (a - origin) / scale));
            all.extend(Ray::new(a, random.point() * scale, 0.0, 1.0 / scale));
        }
    }
    all
}

/// Returns the nearest hit and the nearest of those that a filter accepts.
fn answers(scene: &Instances, ray: &Ray) -> [Option<(u32, u32, u32)>; 2] {
    let is_accepted = |hit: InstanceHit| (hit.triangle + hit.instance).is_multiple_of(3);
    let mut accepted = Vec::new();
    let rejects_all = |hit| {
        accepted.extend(is_accepted(hit).then_some(hit));
        false
    };
    assert_eq!(scene.nearest_hit_where(ray, rejects_all), None);
    let answers = [scene.nearest_hit(ray), scene.nearest_hit_where(ray, is_accepted)];
    assert_eq!(answers[0].is_some(), scene.any_hit(ray), "{ray:?}");
    assert_eq!(answers[1].is_some(), scene.any_hit_where(ray, is_accepted), "{ray:?}");
    if let Some(nearest) = answers[1] {
        // A hit in front of its instance's box is moved into it.
        let is_nearest = accepted.iter().all(|hit| hit.t >= nearest.t * (1.0 - 1e-5));
        assert!(is_accepted(nearest) && !accepted.is_empty() && is_nearest, "{ray:?}");
    }
    answers.map(bits)
}

#[test]
fn every_tree_and_every_kernel_answers_alike_and_filters_see_every_hit() {
    let mut random = Random(5);
    let mut hits = 0;
    for count in [1, 2, 7, 40, 90] {
        let transforms = (0..count).map(|_| nested_transform(&mut random)).collect();
        let parts = vec![ball(2), grid_box(2), soup(30, &mut random)];
        let mut scene = scene(parts, transforms, &mut random);
        let (flat, _) = scene.flat();
        let rays = rays_of_every_kind(&flat, &mut random);
        let mut expected = None;
        for kernel in Kernel::ALL.into_iter().filter(|kernel| kernel.is_available()) {
            for part in &mut scene.parts {
                *part = part.clone().with_kernel(kernel).unwrap();
            }
            let boxes = Instance::boxes(&scene.instances, &scene.parts).unwrap();
            let deep = Instances::new(scene.parts.clone(), scene.instances.clone(), chain(&boxes));
            for scene in scene.all(&mut random).into_iter().chain(deep) {
                let answers: Vec<_> = rays.iter().map(|ray| answers(&scene, ray)).collect();
                hits += answers.iter().flatten().flatten().count();
                let expected = expected.get_or_insert_with(|| answers.clone());
                for ((ray, expected), answer) in rays.iter().zip(expected).zip(&answers) {
                    assert_eq!(expected, answer, "{kernel:?}, {ray:?}");
                }
            }
        }
    }
    assert!(hits > 4000, "{hits}");
}

/// Returns a point whose coordinates are integers from 0 to `end` − 1.
fn integer_point(end: usize, random: &mut Random) -> Vec3 {
    Vec3::from([(); 3].map(|()| random.below(end) as f32))
}

#[test]
fn an_invalid_scene_is_rejected_by_its_instance() {
    let mut random = Random(3);
    let Scene { mut parts, .. } = scene(vec![soup(20, &mut random)], vec![], &mut random);
    parts.push(WideBvh::new(&Bvh::default(), &[]).unwrap());
    let valid = Instance { part: 0, transform: Affine3A::IDENTITY };
    let rejection = |instance| Instance::boxes(&[valid, instance], &parts).unwrap_err();
    let no_part = InvalidInstances::Part { instance: 1, part: 2, parts: 2 };
    assert_eq!(rejection(Instance { part: 2, ..valid }), no_part);
    assert_eq!(rejection(Instance { part: 1, ..valid }), InvalidInstances::Empty(1));
    let scales = [Vec3::new(1.0, 0.0, 1.0), Vec3::NAN, Vec3::INFINITY, Vec3::splat(3e38)];
    // The first column is the sum of the others, and the determinant is all rounding.
    let a = 8_388_611.0;
    let singular = Mat3::from_cols_array(&[a, 1037.0, a, a, 1.0, 0.0, 0.0, 1036.0, a]);
    for transform in
        scales.map(Affine3A::from_scale).into_iter().chain([Affine3A::from_mat3(singular)])
    {
        let found = rejection(Instance { transform, ..valid });
        assert_eq!(found, InvalidInstances::Transform(1), "{transform}");
    }
    let wrong_tree = Instances::new(parts.clone(), vec![valid], Bvh::default());
    assert!(matches!(wrong_tree, Err(InvalidInstances::Tree(_))));
    let empty = Instances::new(parts, vec![], Bvh::default()).unwrap();
    let ray = Ray::half_line([0.0; 3], [1.0; 3]).unwrap();
    assert!(empty.nearest_hit(&ray).is_none() && !empty.any_hit(&ray));
}

#[test]
fn moved_and_replaced_instances_answer_as_a_new_scene_of_the_same_parts() {
    let mut random = Random(7);
    let mut transforms = |count| (0..count).map(|_| nested_transform(&mut random)).collect();
    let places: [Vec<Affine3A>; 3] = [transforms(30), transforms(30), transforms(50)];
    let mut random = Random(8);
    let mut now = scene(vec![ball(2), grid_box(2)], vec![], &mut random);
    let parts: Vec<Arc<WideBvh>> = now.parts.iter().cloned().map(Arc::new).collect();
    let mut moving = Instances::new(parts.clone(), vec![], Bvh::default()).unwrap();
    for (frame, transforms) in places.into_iter().enumerate() {
        let instance = |(i, transform): (u32, _)| Instance { part: i % 2, transform };
        now.instances = (0..).zip(transforms).map(instance).collect();
        let expected = now.all(&mut random).remove(0);
        if frame == 1 {
            moving.refit(&now.instances).unwrap();
        } else {
            let boxes = Instance::boxes(&now.instances, moving.parts()).unwrap();
            moving.replace(&now.instances, tree(&boxes, SHAPES[0], &mut random)).unwrap();
        }
        // Rejected, and unchanged.
        let mut wrong = now.instances.clone();
        wrong[3].part = 2;
        let no_part = InvalidInstances::Part { instance: 3, part: 2, parts: 2 };
        assert_eq!(moving.refit(&wrong), Err(no_part));
        assert!(moving.replace(&now.instances, Bvh::default()).is_err());
        let rays = rays_of_every_kind(&now.flat().0, &mut random);
        let nearest: Vec<_> = rays.iter().map(|ray| expected.nearest_hit(ray)).collect();
        let mut hits = vec![InstanceHit { t: 0.0, instance: 0, triangle: 0 }; rays.len()];
        let mut any = vec![false; rays.len()];
        moving.nearest_hits(&rays, &mut hits);
        moving.any_hits(&rays, &mut any);
        assert!(any.into_iter().eq(nearest.iter().map(Option::is_some)));
        let expected = nearest.into_iter().map(|hit| bits(hit.or(Some(InstanceHit::MISS))));
        assert!(hits.into_iter().map(|hit| bits(Some(hit))).eq(expected));
    }
    for (part, kept) in parts.iter().zip(moving.parts()) {
        assert!(Arc::ptr_eq(part, kept));
    }
}
