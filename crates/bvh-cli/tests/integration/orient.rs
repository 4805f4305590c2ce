//! Turning meshes from the command line.

use crate::support::{bvh, facts, obj};
use bvh_scenes::Scene;
use glam::{DMat3, DVec3};
use std::fs;

#[test]
fn an_oblique_mesh_gets_smaller_boxes_and_is_turned_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // The walls and floors of a building that stands obliquely.
    let turn = DMat3::from_rotation_z(0.6) * DMat3::from_rotation_x(0.4);
    let walls = (0..300).map(|i| {
        let place = DVec3::new(f64::from(i % 17), f64::from(i * 7 % 23), 0.0);
        let [x, y] =
            [[DVec3::X, DVec3::Z], [DVec3::Y, DVec3::Z], [DVec3::X, DVec3::Y]][i as usize % 3];
        [place, place + 9.0 * x, place + 2.0 * y].map(|corner| turn * corner)
    });
    fs::write(at.join("walls.obj"), obj(walls)).unwrap();
    let facts = facts(at, "orient walls.obj --out=new.obj --report");
    let mesh = &facts["meshes"][0];
    assert!(mesh["triangles"] == 300 && mesh["saved"].as_f64() > Some(0.2), "{mesh}");
    let areas = ["walls.obj", "new.obj"].map(|name| {
        let scene = Scene::load(at.join(name).to_str().unwrap()).unwrap();
        scene.boxes.iter().map(|aabb| aabb.half_area()).sum::<f64>()
    });
    assert!(areas[1] < 0.8 * areas[0], "{areas:?}");
    let said = bvh(at, "orient new.obj --out=again.obj");
    assert!(said.contains("nothing to gain"), "{said}");
    assert_eq!(fs::read(at.join("again.obj")).unwrap(), fs::read(at.join("new.obj")).unwrap());
}
