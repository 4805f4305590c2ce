//! Everything in a glTF file that moves, hides or repeats a vertex is read, or named.

use crate::glb::glb;
use crate::samples::floats;
use bvh_core::Triangle;
use bvh_scenes::load::gltf::parts;
use bvh_scenes::load::mesh::{Fault, Mesh};
use bvh_scenes::load::{MeshError, OutsideFiles, parse};
use glam::Vec3;
use std::path::Path;

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// An accessor of [`CORNERS`] in the first view.
const FLOATS: &str = r#"{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}"#;
const VEC3: &str = r#""componentType": 5126, "type": "VEC3""#;
/// A primitive of the first accessor.
const PRIMITIVE: &str = r#"{"attributes": {"POSITION": 0}}"#;

/// Returns a GLB file of these views and accessors; `$P` stands for [`PRIMITIVE`], and `$V` for
/// [`VEC3`].
fn file(views: &[Vec<u8>], accessors: &[&str], more: &str) -> Vec<u8> {
    strided(views, "", accessors, more)
}

/// Returns a [`file`] whose views have further keys.
fn strided(views: &[Vec<u8>], keys: &str, accessors: &[&str], more: &str) -> Vec<u8> {
    let mut binary = Vec::new();
    let mut texts = Vec::new();
    for view in views {
        let (start, length) = (binary.len(), view.len());
        let place = format!(r#""buffer": 0, "byteOffset": {start}, "byteLength": {length}"#);
        texts.push(format!("{{{place}{keys}}}"));
        binary.extend_from_slice(view);
        binary.resize(binary.len().next_multiple_of(4), 0);
    }
    let (texts, accessors, length) = (texts.join(","), accessors.join(","), binary.len());
    let text = format!(
        r#"{{"asset": {{"version": "2.0"}}, "buffers": [{{"byteLength": {length}}}],
        "bufferViews": [{texts}], "accessors": [{accessors}], {more}}}"#
    );
    glb(text.replace("$P", PRIMITIVE).replace("$V", VEC3), &binary)
}

fn corners() -> Vec<u8> {
    floats(CORNERS.as_flattened().iter().copied())
}

fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    parse(bytes, Path::new("a.glb"))
}

/// Returns the triangle of the corners after a change of each.
fn moved(change: impl Fn(Vec3) -> Vec3) -> Triangle {
    Triangle(CORNERS.map(|corner| change(corner.into())))
}

fn bytes<const N: usize>(words: impl IntoIterator<Item = [u8; N]>) -> Vec<u8> {
    words.into_iter().flatten().collect()
}

/// The rest of a file whose one node has these keys besides its mesh.
fn node(keys: &str) -> String {
    format!(r#""nodes": [{{"mesh": 0{keys}}}], "meshes": [{{"primitives": [$P]}}]"#)
}

#[test]
fn positions_of_every_type_and_sparse_ones_are_read() {
    let point = |unit: i16| [0, 0, 0, unit, 0, 0, 0, unit, 0].map(i16::to_le_bytes);
    let byte = |unit: i8| [0, 0, 0, 0, unit, 0, 0, 0, 0, unit, 0, 0].map(i8::to_le_bytes);
    let integers = |component: u32, is_normalized: bool| {
        format!(
            r#"{{"bufferView": 0, "componentType": {component}, "normalized": {is_normalized},
            "count": 3, "type": "VEC3"}}"#
        )
    };
    let shorts = |bytes: Vec<u8>, accessor: String, unit: f32| {
        (file(&[bytes], &[&accessor], &node("")), unit)
    };
    let padded = |bytes: Vec<u8>, accessor: String, unit: f32| {
        (strided(&[bytes], r#", "byteStride": 4"#, &[&accessor], &node("")), unit)
    };
    let sparse = |base: &str, indices: &str| {
        format!(
            r#"{{{base}$V, "count": 3, "sparse": {{"count": 2, "indices": {{"bufferView": 1,
            "componentType": {indices}}}, "values": {{"bufferView": 2}}}}}}"#
        )
    };
    let ends = || floats(CORNERS[1..].as_flattened().iter().copied());
    let cases = [
        shorts(bytes(point(32767)), integers(5122, true), 1.0),
        shorts(bytes(point(-32768)), integers(5122, true), -1.0),
        shorts(bytes(point(-7)), integers(5122, false), -7.0),
        shorts(bytes(point(-1)), integers(5123, true), 1.0),
        shorts(bytes(point(40)), integers(5123, false), 40.0),
        padded(bytes(byte(127)), integers(5120, true), 1.0),
        padded(bytes(byte(-5)), integers(5120, false), -5.0),
        padded(bytes(byte(-1)), integers(5121, true), 1.0),
        padded(bytes(byte(-1)), integers(5121, false), 255.0),
        (file(&[vec![], vec![1, 2], ends()], &[&sparse("", "5121")], &node("")), 1.0),
        (
            file(
                &[floats([0.0; 9]), bytes([1u16, 2].map(u16::to_le_bytes)), ends()],
                &[&sparse(r#""bufferView": 0, "#, "5123")],
                &node(""),
            ),
            1.0,
        ),
    ];
    for (number, (bytes, unit)) in cases.iter().enumerate() {
        let mesh = read(bytes).unwrap();
        assert_eq!(mesh.triangles, [moved(|p| p * *unit)], "{number}");
        assert_eq!(mesh.remarks, [""; 0], "{number}");
    }
    for (indices, expected) in
        [(vec![2, 1], "out of order"), (vec![1, 1], "out of order"), (vec![1, 3], "below 3")]
    {
        let bytes = file(&[vec![], indices, ends()], &[&sparse("", "5121")], &node(""));
        let message = read(&bytes).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    // Zeros take no bytes of the file, so that it could ask for any number of them.
    let zeros = format!(r#"{{"count": 500000000, {VEC3}}}"#);
    let message = read(&file(&[], &[&zeros], &node(""))).unwrap_err().to_string();
    assert!(message.contains("more than 100000000 triangles"), "{message}");
    let zeros = format!(r#"{{"count": 9000000, {VEC3}}}"#);
    let message = read(&file(&[], &[&zeros], &node(""))).unwrap_err().to_string();
    assert!(message.contains("9000000 zeros without a buffer view"), "{message}");
}

#[test]
fn morph_targets_move_vertices_by_the_weights_of_the_node_or_of_the_mesh() {
    let up = || floats([0.0, 0.0, 1.0].repeat(3));
    let right = || bytes([2i16, 0, 0].repeat(3).into_iter().map(i16::to_le_bytes));
    let accessors = [
        FLOATS,
        r#"{"bufferView": 1, "count": 3, $V}"#,
        r#"{"bufferView": 2, "count": 3, "componentType": 5122, "type": "VEC3"}"#,
    ];
    let primitive = r#"{"attributes": {"POSITION": 0},
        "targets": [{"POSITION": 1}, {"POSITION": 2}, {"NORMAL": 9}]}"#;
    let read_with = |of_node: &str, of_mesh: &str| {
        let more = format!(
            r#""nodes": [{{"mesh": 0{of_node}}}],
            "meshes": [{{"primitives": [{primitive}]{of_mesh}}}]"#
        );
        let file = file(&[corners(), up(), right()], &accessors, &more);
        (read(&file), parts(&file, Path::new("a.glb"), OutsideFiles::Rejected))
    };
    let weights = |weights: &str| format!(r#", "weights": [{weights}]"#);
    for (of_node, of_mesh, by) in [
        ("", "", [0.0, 0.0, 0.0]),
        ("", &weights("1, 0, 1")[..], [0.0, 0.0, 1.0]),
        ("", &weights("0.25, -0.5, 0"), [-1.0, 0.0, 0.25]),
        (&weights("0, 1, 0"), &weights("1, 0, 0"), [2.0, 0.0, 0.0]),
        (&weights("1, 0, 0"), &weights("1, 0, 0"), [0.0, 0.0, 1.0]),
    ] {
        let (mesh, parts) = read_with(of_node, of_mesh);
        let expected = [moved(|p| p + Vec3::from(by))];
        assert_eq!(mesh.unwrap().triangles, expected, "{of_node} {of_mesh}");
        match parts {
            Ok(parts) => assert_eq!(parts.meshes[&0], expected),
            Err(fault) => assert!(by[0] == 2.0 && fault.to_string().contains("nodes[0]: weights")),
        }
    }
    let message = read_with("", &weights("1, 0")).0.unwrap_err().to_string();
    assert!(message.contains("2 weights; expected 3"), "{message}");
}

#[test]
fn a_skin_moves_vertices_by_its_joints_and_not_by_its_node() {
    let joints = || [0, 1, 0, 0].repeat(3);
    let weights =
        || floats([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]].concat());
    // The first joint undoes the translation of its parent, the second one doubles.
    let bind = [
        [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -10.0, 0.0, 0.0, 1.0],
        [2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ];
    let accessors = [
        FLOATS,
        r#"{"bufferView": 1, "componentType": 5121, "count": 3, "type": "VEC4"}"#,
        r#"{"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC4"}"#,
        r#"{"bufferView": 3, "componentType": 5126, "count": 2, "type": "MAT4"}"#,
    ];
    let more = r#""scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "skin": 0, "translation": [7, 7, 7]},
            {"children": [2, 3], "translation": [10, 0, 0]}, {}, {"translation": [0, 0, 3]}],
        "skins": [{"joints": [2, 3], "inverseBindMatrices": 3}],
        "meshes": [{"primitives":
            [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}]}]"#;
    let views = [corners(), joints(), weights(), floats(bind.concat())];
    let bytes = file(&views, &accessors, more);
    // The third corner is half way between (0, 1, 0) and (10, 2, 3).
    let expected = Triangle([[0.0, 0.0, 0.0], [12.0, 0.0, 3.0], [5.0, 1.5, 1.5]].map(Vec3::from));
    assert_eq!(read(&bytes).unwrap().triangles, [expected]);
    let message = |fault: Fault| fault.to_string();
    let found = parts(&bytes, Path::new("a.glb"), OutsideFiles::Rejected).map_err(message);
    assert!(found.as_ref().unwrap_err().contains("nodes[0]: a skin; expected none"), "{found:?}");

    for (from, to, expected) in [
        (r#", "JOINTS_0": 1"#, "", "a skin; expected JOINTS_0 and WEIGHTS_0"),
        (r#""skin": 0"#, r#""skin": 1"#, "no skins[1]"),
        ("[2, 3], \"inv", "[2, 4], \"inv", "no nodes[4]"),
        ("[2, 3], \"inv", "[2], \"inv", "no joints[1]"),
        ("[2, 3], \"inv", "[2, 3, 1], \"inv", "2 inverse bind matrices; expected 3"),
    ] {
        let message = read(&file(&views, &accessors, &more.replace(from, to))).unwrap_err();
        assert!(message.to_string().contains(expected), "{message}");
    }
    let unweighted = [corners(), joints(), floats([0.0; 12]), floats(bind.concat())];
    let message = read(&file(&unweighted, &accessors, more)).unwrap_err().to_string();
    assert!(message.contains("position 0 with sum 0"), "{message}");
}

#[test]
fn instances_repeat_a_mesh_and_hidden_nodes_leave_theirs_out() {
    let instances = |keys: &str| {
        format!(r#", "extensions": {{"EXT_mesh_gpu_instancing": {{"attributes": {{{keys}}}}}}}"#)
    };
    let views = [
        corners(),
        floats([0.0, 0.0, 0.0, 0.0, 0.0, 4.0]),
        // A quarter turn about z, in shorts, and none.
        bytes([0i16, 0, 23170, 23170, 0, 0, 0, 32767].map(i16::to_le_bytes)),
        floats([2.0, 2.0, 2.0, -1.0, 1.0, 1.0]),
    ];
    let accessors = [
        FLOATS,
        r#"{"bufferView": 1, "count": 2, $V}"#,
        r#"{"bufferView": 2, "componentType": 5122, "normalized": true, "count": 2,
            "type": "VEC4"}"#,
        r#"{"bufferView": 3, "count": 2, $V}"#,
    ];
    let turned = |p: Vec3| Vec3::new(-p.y, p.x, p.z);
    let four = 4.0 * Vec3::Z;
    let mirrored = |p: Vec3| Vec3::new(-p.x, p.y, p.z);
    let cases = [
        (instances(r#""TRANSLATION": 1"#), vec![moved(|p| p), moved(|p| p + four)]),
        (instances(r#""ROTATION": 2"#), vec![moved(turned), moved(|p| p)]),
        (
            instances(r#""TRANSLATION": 1, "SCALE": 3, "_ID": 9"#) + r#", "scale": [3, 3, 3]"#,
            vec![moved(|p| p * 6.0), moved(|p| (mirrored(p) + four) * 3.0)],
        ),
    ];
    for (keys, expected) in cases {
        let bytes = file(&views, &accessors, &node(&keys));
        let near = |found: &[Triangle]| {
            let pairs = found.iter().zip(&expected).flat_map(|(a, b)| a.0.into_iter().zip(b.0));
            found.len() == expected.len() && pairs.into_iter().all(|(a, b)| a.distance(b) < 1e-6)
        };
        let mesh = read(&bytes).unwrap();
        assert!(near(&mesh.triangles), "{keys}: {:?}", mesh.triangles);
        let parts = parts(&bytes, Path::new("a.glb"), OutsideFiles::Rejected).unwrap();
        assert_eq!((parts.meshes.len(), parts.places.len()), (1, 2));
    }
    for (keys, expected) in [
        (instances(""), "expected"),
        (instances(r#""TRANSLATION": 0, "SCALE": 3"#), "2 items of SCALE; expected 3"),
        (instances(r#""TRANSLATION": 1"#) + r#", "skin": 0"#, "instances of a mesh with a skin"),
    ] {
        let message = read(&file(&views, &accessors, &node(&keys))).unwrap_err().to_string();
        assert!(message.contains("nodes[0]: ") && message.contains(expected), "{message}");
    }

    let hidden = r#", "extensions": {"KHR_node_visibility": {"visible": false}}, "children": [1]}, {"mesh": 0"#;
    let rest = format!(
        r#"{}, "scenes": [{{"nodes": [0, 2]}}]"#,
        node(&format!(r#"{hidden}}}, {{"mesh": 0"#))
    );
    let mesh = read(&file(&[corners()], &[FLOATS], &rest)).unwrap();
    assert_eq!(mesh.triangles, [moved(|p| p)]);
    assert_eq!(mesh.remarks, ["1 invisible node was left out with its children"]);
}

#[test]
fn parts_that_have_no_triangle_are_left_out_with_a_remark() {
    let empty = r#"{"count": 0, $V}"#;
    let zeros = r#"{"count": 3, $V}"#;
    let none = r#"{"bufferView": 0, "componentType": 5121, "count": 0, "type": "SCALAR"}"#;
    let two = r#"{"bufferView": 1, "componentType": 5121, "count": 5, "type": "SCALAR"}"#;
    let all = moved(|p| p);
    let flat = Triangle([Vec3::ZERO; 3]);
    for (primitive, triangles, remark) in [
        (r#"{"attributes": {}}"#, vec![all], "1 primitive without positions was left out"),
        (
            r#"{"attributes": {"POSITION": 1}}"#,
            vec![all],
            "1 primitive without positions was left out",
        ),
        (r#"{"attributes": {"POSITION": 2}}"#, vec![all, flat], "1 triangle has no area"),
        (r#"{"attributes": {"POSITION": 0}, "indices": 3}"#, vec![all], ""),
        (
            r#"{"attributes": {"POSITION": 0}, "indices": 4}"#,
            vec![all, all],
            "1 primitive ends in an incomplete triangle",
        ),
        (
            r#"{"attributes": {"POSITION": 0}, "mode": 0}"#,
            vec![all],
            "1 primitive of points or lines was left out",
        ),
    ] {
        let more =
            format!(r#""nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [$P, {primitive}]}}]"#);
        let file =
            file(&[corners(), vec![0, 1, 2, 0, 1]], &[FLOATS, empty, zeros, none, two], &more);
        let mesh = read(&file).unwrap();
        assert_eq!(mesh.triangles, triangles, "{primitive}");
        assert_eq!(mesh.remark().unwrap_or_default(), remark, "{primitive}");
    }
}

#[test]
fn the_default_scene_is_read_and_a_file_without_scenes_is_one() {
    let nodes =
        r#""nodes": [{"mesh": 0}, {"children": [2]}, {"mesh": 0, "translation": [5, 0, 0]}]"#;
    let near = moved(|p| p);
    let far = moved(|p| p + 5.0 * Vec3::X);
    for (scenes, triangles, remark) in [
        ("", vec![near, far], None),
        (r#", "scenes": [{"nodes": [1]}]"#, vec![far], None),
        (
            r#", "scene": 1, "scenes": [{"nodes": [0]}, {"nodes": [1]}]"#,
            vec![far],
            Some("scenes[1] of 2 was read"),
        ),
        (
            r#", "scenes": [{"nodes": [0]}, {"nodes": [1]}], "animations": [{}]"#,
            vec![near],
            Some("scenes[0] of 2 was read; 1 animation was ignored"),
        ),
    ] {
        let more = format!(r#"{nodes}, "meshes": [{{"primitives": [$P]}}]{scenes}"#);
        let mesh = read(&file(&[corners()], &[FLOATS], &more)).unwrap();
        assert_eq!(mesh.triangles, triangles, "{scenes}");
        assert_eq!(mesh.remark().as_deref(), remark, "{scenes}");
    }
}

#[test]
fn transforms_that_the_format_excludes_are_named() {
    let matrix = r#", "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]"#;
    for (keys, expected) in [
        (matrix.to_owned() + r#", "scale": [1, 1, 1]"#, "a matrix and its parts"),
        (matrix.replace("0, 1]", "0, 2]"), "the last row [0.0, 0.0, 0.0, 2.0]"),
        (r#", "rotation": [0, 0, 0, 0]"#.to_owned(), "expected a quaternion of length 1"),
        (r#", "translation": [1e39, 0, 0]"#.to_owned(), "expected finite numbers"),
    ] {
        let message = read(&file(&[corners()], &[FLOATS], &node(&keys))).unwrap_err().to_string();
        assert!(message.contains("nodes[0]") && message.contains(expected), "{message}");
    }
}

#[test]
fn instances_that_a_transform_flattens_to_a_line_are_left_out_of_the_parts() {
    let more = r#""nodes": [{"mesh": 0}, {"mesh": 0, "scale": [0, 0, 0]},
        {"mesh": 0, "scale": [1, 0, 0]}, {"mesh": 0, "scale": [1, 1, 0]}],
        "meshes": [{"primitives": [$P]}]"#;
    let bytes = file(&[corners()], &[FLOATS], more);
    assert_eq!(read(&bytes).unwrap().triangles.len(), 4);
    let parts = parts(&bytes, Path::new("a.glb"), OutsideFiles::Rejected).unwrap();
    let nodes: Vec<usize> = parts.places.iter().map(|place| place.node).collect();
    assert_eq!(nodes, [0, 3]);
    assert_eq!(parts.remark.unwrap(), "2 instances without area were left out");
}
