//! The files of a baked scene of instances, loaded as users load them, give the same answers as the
//! flat scene.

use crate::support::{bvh, glb, names, unsaid, words, wrong};
use bvh_core::{
    Hit, Instance, Instances, PreparedRay, Ray, Triangle, WideBvh, boxes, file, nearest_hit_of_all,
};
use bvh_scenes::Scene;
use glam::{Affine3A, Vec3};
use std::fs;
use std::path::Path;

/// Returns the triangle of this number, with small whole coordinates.
fn triangle(number: u32) -> Triangle {
    let coordinates: [u32; 9] = std::array::from_fn(|i| 9 * number + i as u32);
    Triangle::from(coordinates.map(|i| (i.wrapping_mul(2_654_435_761) >> 27) as f32))
}

/// Returns a GLB file of two meshes of triangles and one of points, and the triangles. Nodes turn
/// the meshes by right angles and mirror them, so that nothing is rounded.
fn forest() -> (Vec<u8>, [Vec<Triangle>; 2]) {
    let meshes = [0..150, 150..400].map(|range| range.map(triangle).collect::<Vec<_>>());
    let corners: Vec<u8> = bytemuck::cast_slice(&meshes.concat()).to_vec();
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 4, 5, 6]}}], "nodes": [
            {{"translation": [100, 0, 0], "children": [1, 2]}},
            {{"mesh": 1, "matrix": [0,1,0,0, -1,0,0,0, 0,0,1,0, 40,-20,8,1], "children": [3]}},
            {{"mesh": 0, "scale": [-1, 1, 1]}}, {{"mesh": 0, "translation": [0, 0, 64]}},
            {{"mesh": 1}}, {{"mesh": 2}}, {{"mesh": 0, "translation": [-50, 25, -7]}}],
          "meshes": [
            {{"primitives": [{{"attributes": {{"POSITION": 0}}}}, {{"attributes": {{"POSITION": 1}}}}]}},
            {{"primitives": [{{"attributes": {{"POSITION": 2}}}}]}},
            {{"primitives": [{{"attributes": {{"POSITION": 0}}, "mode": 0}}]}}],
          "accessors": [
            {{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 150}},
            {{"bufferView": 0, "byteOffset": 1800, "componentType": 5126, "type": "VEC3", "count": 300}},
            {{"bufferView": 0, "byteOffset": 5400, "componentType": 5126, "type": "VEC3", "count": 750}}],
          "bufferViews": [{{"buffer": 0, "byteLength": {0}}}], "buffers": [{{"byteLength": {0}}}]}}"#,
        corners.len()
    );
    (glb(json, &corners), meshes)
}

/// Loads a folder of instances as a user who has the meshes does.
fn load_instances(folder: &Path, meshes: &[Vec<Triangle>]) -> Instances {
    let mut parts = Vec::new();
    for (mesh, triangles) in meshes.iter().enumerate() {
        let bytes = fs::read(folder.join(format!("mesh_{mesh}.bvh"))).unwrap();
        let tree = file::load(&bytes, &boxes(triangles)).unwrap();
        parts.push(WideBvh::new(&tree, triangles).unwrap());
    }
    let mut rows = csv::Reader::from_path(folder.join("instances.csv")).unwrap();
    let mut instances = Vec::new();
    for row in rows.deserialize() {
        let (_node, part, columns): (u32, u32, [f32; 12]) = row.unwrap();
        instances.push(Instance { part, transform: Affine3A::from_cols_array(&columns) });
    }
    let boxes = Instance::boxes(&instances, &parts).unwrap();
    let top = file::load(&fs::read(folder.join("top.bvh")).unwrap(), &boxes).unwrap();
    Instances::new(parts, instances, top).unwrap()
}

#[test]
fn a_scene_of_instances_is_baked_mesh_by_mesh_and_answers_like_the_flat_scene() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (glb, meshes) = forest();
    fs::write(at.join("forest.glb"), glb).unwrap();
    let bake = "bake forest.glb --instances --budget=2Mwork --references=1.1 --out=baked";
    let said = bvh(at, bake);
    assert!(said.contains("instances.csv: 5 instances of 2 meshes"), "{said}");
    assert_eq!(names(&at.join("baked")), ["instances.csv", "mesh_0.bvh", "mesh_1.bvh", "top.bvh"]);
    let scene = load_instances(&at.join("baked"), &meshes);

    let flat = Scene::load(at.join("forest.glb").to_str().unwrap()).unwrap();
    let flat = flat.triangles().unwrap();
    // The first triangle of each instance in the flat scene, whose nodes place these meshes in
    // order.
    let first: Vec<usize> = [1, 0, 0, 1, 0]
        .iter()
        .scan(0, |end, &mesh: &usize| Some(std::mem::replace(end, *end + meshes[mesh].len())))
        .collect();
    let number = |i: u32| (i.wrapping_mul(2_246_822_519) >> 26) as f32 - 32.0;
    let mut hits = 0;
    for i in 0..2000 {
        // The ray goes from a lattice point towards the rounded middle of a triangle.
        let corners = flat[7 * i as usize % flat.len()].0;
        let middle = (corners.iter().sum::<Vec3>() / 3.0).round();
        let away = Vec3::new(number(2 * i), number(2 * i + 1), 128.0);
        let ray = Ray::half_line((middle + away).to_array(), (-away / 128.0).to_array()).unwrap();
        let prepared = PreparedRay::new(&ray);
        let test = |id: u32, t_max| flat[id as usize].intersect(&prepared, t_max);
        let expected = nearest_hit_of_all(flat.len() as u32, &ray, test, &mut ());
        let found = scene.nearest_hit(&ray).map(|hit| {
            let object = first[hit.instance as usize] as u32 + hit.triangle;
            Hit { t: hit.t, object }
        });
        assert_eq!(found, expected, "ray {i}");
        hits += u32::from(found.is_some());
    }
    assert!((1000..2000).contains(&hits), "{hits} of 2000 rays hit");
}

#[cfg(target_os = "linux")]
#[test]
fn a_bake_whose_output_is_lost_still_writes_its_trees() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("forest.glb"), forest().0).unwrap();
    // This bake prints a line before its search, and another after each tree.
    unsaid(at, &words("bake forest.glb --instances --out=baked"));
    assert_eq!(names(&at.join("baked")), ["instances.csv", "mesh_0.bvh", "mesh_1.bvh", "top.bvh"]);
}

#[test]
fn a_transform_without_an_inverse_is_named_and_leaves_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (mut flat, _) = forest();
    let scale = flat.windows(9).position(|bytes| bytes == b"[-1, 1, 1").unwrap();
    flat[scale..scale + 9].copy_from_slice(b"[ 0, 1, 1");
    fs::write(at.join("flat.glb"), flat).unwrap();
    let bake = "bake flat.glb --instances --budget=10kwork --out=new";
    wrong(at, bake, &["nodes[2] places meshes[0]", "no inverse"]);
    assert_eq!(names(at), ["flat.glb"]);
}
