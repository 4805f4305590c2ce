//! Turning meshes from the command line.

use crate::support::{bvh, facts, glb};
use glam::{DMat3, DVec3};
use std::fs;

#[test]
fn an_oblique_mesh_gets_smaller_boxes_and_is_turned_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // The walls and floors of a building that stands obliquely.
    let turn = DMat3::from_rotation_z(0.6) * DMat3::from_rotation_x(0.4);
    let mut bytes: Vec<u8> = Vec::new();
    for i in 0..300 {
        let place = DVec3::new(f64::from(i % 17), f64::from(i * 7 % 23), 0.0);
        let wall =
            [[DVec3::X, DVec3::Z], [DVec3::Y, DVec3::Z], [DVec3::X, DVec3::Y]][i as usize % 3];
        for corner in [place, place + 9.0 * wall[0], place + 2.0 * wall[1]] {
            let turned = (turn * corner).as_vec3().to_array();
            bytes.extend(turned.into_iter().flat_map(f32::to_le_bytes));
        }
    }
    let json = r#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 900}],
        "bufferViews": [{"buffer": 0, "byteLength": 10800}], "buffers": [{"byteLength": 10800}]}"#;
    fs::write(at.join("walls.glb"), glb(json.into(), &bytes)).unwrap();
    let facts = facts(at, "orient walls.glb --out=new.glb --report");
    let mesh = &facts["meshes"][0];
    assert!(mesh["triangles"] == 300 && mesh["saved"].as_f64() > Some(0.2), "{mesh}");
    let said = bvh(at, "orient new.glb --out=again.glb");
    assert!(said.contains("nothing to gain"), "{said}");
    assert_eq!(fs::read(at.join("again.glb")).unwrap(), fs::read(at.join("new.glb")).unwrap());
}
