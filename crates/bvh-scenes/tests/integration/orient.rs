//! Files with turned meshes show the same world.

use crate::gltf::{cases, file};
use crate::samples::{gltf, read, with};
use bvh_scenes::load::{Oriented, orient};
use glam::{DMat3, DVec3, Vec3};
use serde_json::{Value, json};
use std::path::Path;

fn rotation() -> DMat3 {
    DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7)
}

fn corners(bytes: &[u8], name: &str) -> Vec<Vec3> {
    read(bytes, name).unwrap().triangles.iter().flat_map(|triangle| triangle.0).collect()
}

/// Turns a file, and asserts that corners, which `back` brings back from the new file, differ by
/// rounding at most.
fn turned(bytes: &[u8], name: &str, back: DMat3) -> Oriented {
    let find = &mut |_: usize, _: &[_]| Some(rotation());
    let new = orient(bytes, Path::new(name), Path::new("new"), find).unwrap();
    let [old, world] = [bytes, &new.bytes].map(|bytes| corners(bytes, name));
    let size = old.iter().fold(0.0, |size: f32, corner| size.max(corner.abs().max_element()));
    assert_eq!(old.len(), world.len(), "{name}");
    for (old, new) in old.into_iter().zip(world) {
        let off = (back * new.as_dvec3()).as_vec3() - old;
        assert!(off.abs().max_element() <= f32::EPSILON * size, "{name}: {old} {new}");
    }
    new
}

/// Returns the JSON and the buffer of a GLB file.
fn split(glb: &[u8]) -> (Value, &[u8]) {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    assert!(length.is_multiple_of(4) && glb.len().is_multiple_of(4));
    (serde_json::from_slice(&glb[20..20 + length]).unwrap(), &glb[28 + length..])
}

#[test]
fn a_mesh_in_any_form_is_turned_or_left_with_a_reason() {
    for case in cases().into_iter().filter(|case| case["fault"].is_null()) {
        let new = turned(&file(&case), "a.glb", DMat3::IDENTITY);
        let is_left =
            case["accessor"]["componentType"] != 5126 || case["node"].get("skin").is_some();
        assert_eq!(new.turned.is_empty(), is_left, "{case}");
        let is_named = new.remarks.iter().any(|remark| remark.contains("left as it is: "));
        assert_eq!(is_named, is_left, "{:?}", new.remarks);
    }
    let new = turned(&gltf(), "data.gltf", DMat3::IDENTITY);
    assert!(split(&new.bytes).0["buffers"][0].get("uri").is_none());
    let images = with(&gltf(), "{\"asset\"", r#"{"images": [{"uri": "i.png"}], "asset""#);
    let folder = tempfile::tempdir().unwrap();
    let fault = orient(&images, Path::new("a.gltf"), &folder.path().join("a"), &mut |_, _| None);
    let fault = fault.unwrap_err().to_string();
    assert!(fault.starts_with("a.gltf: `i.png` is not beside"), "{fault}");
}

/// A file with much of what a mesh, its nodes and their animations may have.
const RICH: &str = r#"{
    "views": ["f32 0 0 0 5 0 0 5 7 0 0 7 0.1 0 0 1 0 1 0 1 0 0 0 0 1 0 0 2 0 0 0 0 0 0 1 0 0",
        "f32 1 0 0 1 1 0 0 -1 0 1 0 1 1 0 0 1", "u16 0 1 2 0 2 3"],
    "accessor": {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
    "accessors": [
        {"bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC3"},
        {"bufferView": 0, "byteOffset": 96, "componentType": 5126, "count": 4, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC4", "name": "tangents"},
        {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}],
    "mesh": {"weights": [0], "primitives": [{"indices": 4, "material": 0,
        "attributes": {"POSITION": 0, "NORMAL": 1, "TANGENT": 3, "TEXCOORD_0": 9},
        "targets": [{"POSITION": 2, "NORMAL": 2}], "extensions": {"KHR_materials_variants": {}}}]},
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}]}],
    "node": {"mesh": 0, "translation": [1, 2, 3], "rotation": [0.6, 0, 0, 0.8], "scale": [2, 2, 2]},
    "nodes": [{"mesh": 0, "matrix": [1,0,0,0, 0,3,0,0, 0,1,1,0, 5,0,0,1], "children": [2],
        "weights": [0]}, {"mesh": 0, "translation": [0, 0, 9]}, {"mesh": 1}],
    "animations": [{"samplers": [{"input": 9, "output": 9}], "channels": [
        {"sampler": 0, "target": {"node": 1, "path": "weights"}},
        {"sampler": 0, "target": {"node": 1, "path": "rotation"}}]}],
    "materials": [{"extensions": {"KHR_materials_ior": {"ior": 1.1234567890123457}}}],
    "extras": {"a": [1e300, null]}
}"#;

fn rich(from: &str, to: &str) -> Vec<u8> {
    file(&serde_json::from_str(&RICH.replacen(from, to, 1)).unwrap())
}

#[test]
fn vectors_turn_and_everything_else_stays() {
    let bytes = rich("", "");
    let new = turned(&bytes, "rich.glb", DMat3::IDENTITY);
    assert_eq!((&new.turned[..], &new.remarks[..]), (&[0][..], &[][..]));
    let [(mut old, before), (json, after)] = [&bytes, &new.bytes].map(|bytes| split(bytes));
    let numbers = |bytes: &[u8]| -> Vec<f32> {
        bytes.as_chunks().0.iter().map(|word| f32::from_le_bytes(*word)).collect()
    };
    let (kept, added) = after.split_at(before.len());
    assert_eq!(kept, before);
    let [from, to] = [before, added].map(numbers);
    // Three lists of positions, normals and a target, and one of tangents, as in the old buffer.
    for (start, width) in (0..36).step_by(3).map(|i| (i, 3)).chain([36, 40, 44, 48].map(|i| (i, 4)))
    {
        let [from, to] = [&from, &to].map(|numbers| &numbers[start..start + width]);
        let [v, w] = [from, to].map(|v| Vec3::from_slice(v).as_dvec3());
        assert!((rotation() * v).distance(w) < 1e-6 && from.get(3) == to.get(3), "{v} {w}");
    }
    let least = |axis: usize| (0..4).map(|i| to[3 * i + axis]).reduce(f32::min);
    assert_eq!(json["accessors"][5]["min"], json!([0, 1, 2].map(least)));
    // What changed is changed in the old JSON, too, after which both must be the same.
    let primitive = &mut old["meshes"][0]["primitives"][0];
    primitive["attributes"] = json!({"POSITION": 5, "NORMAL": 6, "TANGENT": 8, "TEXCOORD_0": 9});
    primitive["targets"] = json!([{"POSITION": 7, "NORMAL": 7}]);
    for (list, count) in [("accessors", 4), ("bufferViews", 4), ("nodes", 3)] {
        let elements = old[list].as_array_mut().unwrap();
        let first = elements.len();
        elements.extend(json[list].as_array().unwrap()[first..].iter().cloned());
        assert_eq!(elements.len(), first + count, "{list}");
    }
    for (node, children) in [(0, json!([4])), (1, json!([5, 2])), (2, json!([6]))] {
        let own = old["nodes"][node].as_object_mut().unwrap();
        own.retain(|key, _| !["mesh", "weights"].contains(&&key[..]));
        own.insert("children".into(), children);
    }
    assert_eq!((&json["nodes"][5]["mesh"], &json["nodes"][5]["weights"]), (&json!(0), &json!([0])));
    old["animations"][0]["channels"][0]["target"]["node"] = json!(5);
    old["buffers"][0]["byteLength"] = json!(after.len());
    assert_eq!(json, old);
    // Without an animation, a node of its own is turned itself.
    let still = turned(&rich("animations", "notes"), "still.glb", DMat3::IDENTITY);
    let nodes = split(&still.bytes).0["nodes"].clone();
    assert_eq!((nodes.as_array().unwrap().len(), &nodes[0]["mesh"]), (5, &json!(0)));
}

#[test]
fn a_mesh_that_would_lose_something_is_left_as_it_is() {
    for (from, to, reason) in [
        ("KHR_materials_variants", "KHR_draco_mesh_compression", "KHR_draco_mesh_compression"),
        (
            "\"matrix\"",
            r#""extensions": {"EXT_mesh_gpu_instancing": {}}, "matrix""#,
            "EXT_mesh_gpu",
        ),
        ("\"byteOffset\": 96,", "\"sparse\": {},", "accessors[2]: items that are not all"),
        (
            "48, \"componentType\": 5126",
            "48, \"componentType\": 5120",
            "accessors[1]: VEC3 of byte",
        ),
        ("0 0 0 1 0 0\"", "0 0 0 3e38 3e38 3e38\"", "accessors[2] would not contain finite"),
    ] {
        let bytes = rich(from, to);
        let new = turned(&bytes, "a.glb", DMat3::IDENTITY);
        assert!(new.bytes == bytes && new.turned.is_empty(), "{reason}");
        assert!(new.remarks.iter().any(|remark| remark.contains(reason)), "{:?}", new.remarks);
    }
    // Meshes that each use a part of the same vertices would make the file as many times as large.
    let mut shared: Value = serde_json::from_str(RICH).unwrap();
    shared["meshes"] = vec![json!({"primitives": [{"attributes": {"POSITION": 0}}]}); 99].into();
    shared["nodes"] = (1..100).map(|mesh| json!({ "mesh": mesh })).collect();
    let new = turned(&file(&shared), "shared.glb", DMat3::IDENTITY);
    assert!((10..50).contains(&new.turned.len()) && new.bytes.len() < 30_000, "{:?}", new.turned);
    assert!(new.remarks[0].contains("those of many meshes"), "{:?}", new.remarks);
}

#[test]
fn an_obj_file_keeps_every_other_byte_and_has_its_matrix_in_a_comment() {
    let text =
        "\u{feff}# a\r\nv 1 2 -3 0.5 0.25 1 # b\r\nvn 0 0 1\n V 4 5e0 6#c\rv 7 8 9 2\rf 1 2 3";
    let new = turned(text.as_bytes(), "a.obj", rotation().transpose());
    let new = String::from_utf8(new.bytes).unwrap();
    let (comment, rest) = new.split_once('\n').unwrap();
    let rows = rotation().to_cols_array().map(|number| number.to_string()).join(" ");
    assert!(comment.starts_with('#') && comment.ends_with(&rows), "{comment}");
    for part in ["# a\r\nv ", " 0.5 0.25 1 # b\r\nvn ", " 2\rf 1 2 3"] {
        assert!(rest.contains(part), "{part}: {rest}");
    }
    let continued = text.replace("5e0 6", "5e0\\\n6");
    let find = &mut |_: usize, _: &[_]| Some(rotation());
    let fault = orient(continued.as_bytes(), Path::new("a.obj"), Path::new("b"), find).unwrap_err();
    assert!(fault.to_string().starts_with("a.obj:4: a vertex on two lines"), "{fault}");
}
