//! Instances answer as the same triangles written out, and as their parts do, whatever the tree over them.

mod support;

use bvh_core::{
    Aabb, Bvh, Instance, InstanceHit, Instances, InvalidInstances, Ray, Triangle, WideBvh, nearest_hit,
};
use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Quat, Vec3, Vec3A};
use support::{Random, SHAPES, ball, boxes, grid_box, soup, tree};

/// Parts, the same in the wide layout, and instances of them.
struct Scene {
    triangles: Vec<Vec<Triangle>>,
    parts: Vec<WideBvh>,
    instances: Vec<Instance>,
}

fn scene(triangles: Vec<Vec<Triangle>>, transforms: Vec<Affine3A>, random: &mut Random) -> Scene {
    let layout = |t: &Vec<Triangle>| WideBvh::new(&tree(&boxes(t), SHAPES[0], random), t).unwrap();
    let parts: Vec<WideBvh> = triangles.iter().map(layout).collect();
    let instance = |(at, transform)| Instance { part: (at % parts.len()) as u32, transform };
    let instances = transforms.into_iter().enumerate().map(instance).collect();
    Scene { triangles, parts, instances }
}

impl Scene {
    /// With trees of every shape over the instances.
    fn all(&self, random: &mut Random) -> Vec<Instances> {
        let boxes = Instance::boxes(&self.instances, &self.parts).unwrap();
        let made = |shape| {
            Instances::new(self.parts.clone(), self.instances.clone(), tree(&boxes, shape, random)).unwrap()
        };
        SHAPES.map(made).into()
    }

    /// The triangles of all instances, moved in f64 and rounded, each with its instance and its id there.
    fn flat(&self) -> (Vec<Triangle>, Vec<(u32, u32)>) {
        let (mut flat, mut names) = (Vec::new(), Vec::new());
        for (instance, Instance { part, transform }) in (0..).zip(&self.instances) {
            let matrix = DMat3::from_cols_array(&transform.matrix3.to_cols_array().map(f64::from));
            let shift = DVec3::from_array(transform.translation.to_array().map(f64::from));
            let moved = DAffine3::from_mat3_translation(matrix, shift);
            for (id, triangle) in (0..).zip(&self.triangles[*part as usize]) {
                flat.push(Triangle(triangle.0.map(|p| moved.transform_point3(p.as_dvec3()).as_vec3())));
                names.push((instance, id));
            }
        }
        (flat, names)
    }
}

/// Rays that meet about every second instance, from inside and outside.
fn rays(bounds: &Aabb, n: usize, random: &mut Random) -> Vec<Ray> {
    let inside = |random: &mut Random| bounds.min + (bounds.max - bounds.min) * ((random.point() + 1.0) * 0.5);
    (0..n)
        .map(|i| {
            let (from, to) = (inside(random) * if i % 3 == 0 { 3.0 } else { 1.0 }, inside(random));
            Ray::new(from, to - from, 0.0, if i % 5 == 0 { 0.7 } else { f32::INFINITY }).unwrap()
        })
        .collect()
}

#[test]
fn turned_scaled_and_sheared_instances_answer_as_the_flat_scene() {
    let mut random = Random(1);
    let transforms = (0..60)
        .map(|_| {
            let turn = Quat::from_axis_angle(random.point().normalize(), random.unit() * 6.0);
            let scale = Vec3::splat(random.of(&[0.1, 1.0, 3.0])) * (random.point() * 0.4 + 1.0);
            let mut transform = Affine3A::from_scale_rotation_translation(scale, turn, random.point() * 20.0);
            transform.matrix3.y_axis += transform.matrix3.x_axis * 0.3;
            transform
        })
        .collect();
    let scene = scene(vec![ball(2), grid_box(3), ball(1)], transforms, &mut random);
    let (flat, names) = scene.flat();
    let flat_tree = tree(&boxes(&flat), SHAPES[0], &mut random);
    let scenes = scene.all(&mut random);
    let (mut hits, mut others) = (0, 0);
    for ray in rays(&flat_tree.root_aabb().unwrap(), 6000, &mut random) {
        let found = scenes[0].nearest_hit(&ray);
        for other in &scenes {
            let bits = |hit: Option<InstanceHit>| hit.map(|hit| (hit.t.to_bits(), hit.instance, hit.triangle));
            assert_eq!(bits(other.nearest_hit(&ray)), bits(found), "{ray:?}");
            assert_eq!(other.any_hit(&ray), found.is_some(), "{ray:?}");
        }
        let expected = nearest_hit(&flat_tree, &flat, &ray);
        hits += usize::from(expected.is_some());
        match (found, expected) {
            (Some(found), Some(expected)) => {
                let name = names[expected.object as usize];
                others += usize::from((found.instance, found.triangle) != name);
                let reach = ray.origin().abs().max_element() + 40.0;
                let length = ray.direction().length();
                let error = (found.t - expected.t).abs() * length / reach;
                // A ray that only grazes a surface multiplies the rounding.
                others += usize::from(error > 1e-5);
                let local = scenes[0].local_ray(found.instance, &ray).unwrap();
                let part = scene.instances[found.instance as usize].part as usize;
                assert_eq!(scene.parts[part].nearest_hit(&local).unwrap().object, found.triangle);
            }
            (found, expected) => others += usize::from(found.is_some() != expected.is_some()),
        }
    }
    assert!(hits > 1000 && others < 3, "{others} others of {hits} hits");
}

#[test]
fn transforms_without_rounding_give_the_distances_of_the_flat_scene_bit_by_bit() {
    let mut random = Random(2);
    let whole = |random: &mut Random, n: usize| {
        Vec3::new(random.below(n) as f32, random.below(n) as f32, random.below(n) as f32)
    };
    let turns = [Mat3A::IDENTITY, Mat3A::from_cols(Vec3A::Y, Vec3A::NEG_X, Vec3A::Z) * 2.0, -Mat3A::IDENTITY];
    let transforms =
        (0..40).map(|i| Affine3A::from_mat3_translation(turns[i % 3].into(), whole(&mut random, 30))).collect();
    let scene = scene(vec![grid_box(4), grid_box(2)], transforms, &mut random);
    let (flat, names) = scene.flat();
    let flat_tree = tree(&boxes(&flat), SHAPES[0], &mut random);
    let scenes = scene.all(&mut random);
    let mut hits = 0;
    for _ in 0..4000 {
        let (from, to) = (whole(&mut random, 40) - 4.0, whole(&mut random, 240) / 8.0);
        let Ok(ray) = Ray::half_line(from, to - from) else { continue };
        let expected = nearest_hit(&flat_tree, &flat, &ray).map(|hit| {
            let (instance, triangle) = names[hit.object as usize];
            InstanceHit { t: hit.t, instance, triangle }
        });
        hits += usize::from(expected.is_some());
        scenes.iter().for_each(|scene| assert_eq!(scene.nearest_hit(&ray), expected, "{ray:?}"));
    }
    assert!(hits > 1000, "{hits}");
}

#[test]
fn scenes_that_cannot_be_are_refused_by_their_instance() {
    let mut random = Random(3);
    let Scene { mut parts, .. } = scene(vec![soup(20, &mut random)], vec![], &mut random);
    parts.push(WideBvh::new(&Bvh::default(), &[]).unwrap());
    let at = |part, transform| Instance { part, transform };
    let refused = |instance| {
        let instances = [at(0, Affine3A::IDENTITY), instance];
        Instance::boxes(&instances, &parts).unwrap_err()
    };
    assert_eq!(refused(at(2, Affine3A::IDENTITY)), InvalidInstances::Part { instance: 1, part: 2, parts: 2 });
    assert_eq!(refused(at(1, Affine3A::IDENTITY)), InvalidInstances::Empty(1));
    for scale in [Vec3::new(1.0, 0.0, 1.0), Vec3::NAN, Vec3::INFINITY, Vec3::splat(3e38)] {
        assert_eq!(refused(at(0, Affine3A::from_scale(scale))), InvalidInstances::Transform(1), "{scale}");
    }
    let wrong = Instances::new(parts.clone(), vec![at(0, Affine3A::IDENTITY)], Bvh::default());
    assert!(matches!(wrong, Err(InvalidInstances::Tree(_))));
    let empty = Instances::new(parts, vec![], Bvh::default()).unwrap();
    let ray = Ray::half_line([0.0; 3], [1.0; 3]).unwrap();
    assert!(empty.nearest_hit(&ray).is_none() && !empty.any_hit(&ray));
}
