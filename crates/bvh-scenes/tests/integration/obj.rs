//! Valid and invalid OBJ files: the triangles of the valid ones, and the lines that errors name.

use bvh_core::Triangle;
use bvh_scenes::load::mesh::Mesh;
use bvh_scenes::load::{MeshError, parse};
use glam::Vec3;
use proptest::prelude::*;
use std::path::Path;

const POINTS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 2 0\n";

fn read(text: impl AsRef<[u8]>) -> Result<Mesh, MeshError> {
    parse(text.as_ref(), Path::new("scene.obj"))
}

fn mesh(faces: &str) -> Mesh {
    read(format!("{POINTS}{faces}")).unwrap()
}

/// Returns the error about the points, on lines 1 to 5, followed by `statements`.
fn error(statements: &str) -> String {
    read(format!("{POINTS}{statements}")).unwrap_err().to_string()
}

#[test]
fn a_triangle_has_its_corners_and_leaves_two_vertices_unused() {
    let read = mesh("f 1 2 3\n");
    assert_eq!(read.triangles, [Triangle([Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y])]);
    assert_eq!(read.remarks, ["vertices that no face uses: 2"]);
}

#[test]
fn spellings_of_the_same_triangle_agree() {
    let expected = mesh("f 1 2 3\n");
    for faces in [
        "f -5 -4 -3\n",
        "f 1/1 2/2/2 3//3\n",
        "vt 0 0\nvn 0 0 1\nf 1/-9 2/99 3//-9\n",
        "  f\t1 2  3",
        "f 1 2 3 # the first\n",
        "f 1 2\\\n3\n",
        "f \\\r\n1 2 \\  \r\n\\\r\n3\r\n",
        "f 1 2 3 \\",
        "# f 1 2 4 \\\nf 1 2 3\n#f 1 2 4\n",
        "l 1 2 3 4\np 1 2 3\nl\nf 1 2 3\n",
        "mtllib none.mtl\nusemtl\nusemtl gold\ng\no\ns off\nf 1 2 3\ncurv 0 1 1 2 \\\n3\n",
    ] {
        assert_eq!(mesh(faces), expected, "{faces:?}");
    }
    let text = format!("{POINTS}f 1 2 3\n");
    assert_eq!(read(text.replace('\n', "\r\n")).unwrap(), expected);
    assert_eq!(read(text.replace('\n', "\r")).unwrap(), expected);
    // Two programs may each have added a byte order mark.
    for marks in ["\u{feff}", "\u{feff}\u{feff}"] {
        assert_eq!(read(format!("{marks}{text}")).unwrap(), expected);
    }
    assert_eq!(read([b"# caf\xe9\ng \xff\n", text.as_bytes()].concat()).unwrap(), expected);
    let colours =
        text.replacen("0 0 0", "0 0 0 1 0.5 nan", 1).replacen("1 0 0", "1 0 0 1 1 1 1", 1);
    assert_eq!(read(colours).unwrap(), expected);
    // A face may name vertices below it.
    assert_eq!(read(format!("g a\nf 1 2 3\ng b\n{POINTS}")).unwrap(), expected);
}

#[test]
fn objects_and_groups_are_joined_in_the_order_of_the_file() {
    let grouped = "o a\nf 5 4 3\ng b\nf 1 2 3\nusemtl c\nf 1 3 4\n";
    assert_eq!(mesh(grouped), mesh("f 5 4 3\nf 1 2 3\nf 1 3 4\n"));
}

#[test]
fn a_weight_divides_the_coordinates() {
    let weighted = read("v 2 4 6 2\nv 0 0 0 -1\nv 1 0 0\nf 1 2 3\n").unwrap();
    assert_eq!(weighted.triangles[0].0[0], Vec3::new(1.0, 2.0, 3.0));
}

#[test]
fn lines_with_unknown_keywords_are_counted_and_one_sentence_lists_all_oddities() {
    let read = mesh("w 7 7 7\nf 1 2 3\ncurv 0 1 \\\n1 2\nfx 1 2 4\nf 1 2 2\nf 1 2\nf\nf 1\n");
    let remark = read.remark().unwrap();
    for part in [
        "vertices that no face uses: 2",
        "faces of fewer than three vertices skipped: 3",
        "triangles without area: 1",
        "lines with unknown keywords ignored: 2 (`w` in line 6)",
    ] {
        assert!(remark.contains(part), "{part}: {remark}");
    }
    assert_eq!(mesh("f 1 2 3\nf 3 4 5\n").remark(), None);
}

#[test]
fn a_face_of_too_many_vertices_is_rejected() {
    let corners = " 1 2".repeat(1 << 15);
    assert_eq!(mesh(&format!("f{corners}\n")).triangles.len(), (1 << 16) - 2);
    let message = error(&format!("f{corners} 1\n"));
    assert!(message.starts_with("scene.obj:6: face of more than 65536"), "{message}");
}

#[test]
fn triangles_without_area_are_counted_and_kept_at_every_scale() {
    for scale in ["1e-45", "1", "3e38"] {
        let points = format!("v 0 0 0\nv {scale} 0 0\nv -{scale} 0 0\nv 0 {scale} 0\n");
        let read = read(format!("{points}f 1 1 1\nf 1 2 2\nf 1 2 3\nf 1 2 4\n")).unwrap();
        assert_eq!(read.triangles.len(), 4);
        assert_eq!(read.remarks, ["triangles without area: 3"], "scale {scale}");
    }
}

#[test]
fn an_invalid_statement_is_named_with_its_line_and_the_accepted_values() {
    for (statements, names) in [
        ("v nan 0 0\nf 1 2 6\n", [":6: ", "`nan`", "finite"]),
        ("v nan 0 0\nv 1 -1.#IND 0\nf 1 2 -1\n", [":7: ", "`-1.#IND`", "finite"]),
        ("f 1 2 6\n\nv 0 -inf 0", [":8: ", "`-inf`", "finite"]),
        ("v 0 0 1e39\nf 6 1 2", [":6: ", "`1e39`", "3.4e38"]),
        ("v 0 0 0,5", [":6: ", "`0,5`", "finite number"]),
        ("v 0 0", [":6: ", "length 2", "3 (x y z)"]),
        ("v 0 0 0 1 1", [":6: ", "length 5", "3 (x y z)"]),
        ("v 0 0 0 0", [":6: ", "weight `0`", "other than 0"]),
        ("v 1e30 0 0 1e-30", [":6: ", "weight `1e-30`", "3.4e38"]),
        ("v 1 1 1 inf", [":6: ", "weight `inf`", "finite"]),
        ("f 0 1 2", [":6: ", "`0`", "from 1"]),
        ("f 1 2 x/1", [":6: ", "`x/1`", "whole number"]),
        ("f 1 2 \u{a0}3", [":6: ", r"`\xc2\xa03`", "whole number"]),
        ("f 1 2 3\\\n4 \\\n\nf 1 2 6", [":9: ", "6", "at most 5"]),
        ("f 6\nf 1 2 3", [":6: ", "6", "at most 5"]),
        ("f -6 1 2\nv 0 0 0", [":6: ", "-6", "at least -5"]),
        ("f 1 2 9223372036854775808", [":6: ", "5808`", "from 1"]),
        ("f 1 2 9223372036854775807", [":6: ", "5807", "most 5"]),
        ("f 1 2 -9223372036854775808", [":6: ", "5808", "least -5"]),
    ] {
        let message = error(statements);
        for name in names {
            assert!(message.contains(name), "{statements:?}: {message}");
        }
    }
}

#[test]
fn an_endless_word_gives_a_short_message() {
    assert!(error(&format!("v 0 0 {}", "x".repeat(1_000_000))).len() < 200);
}

#[test]
fn a_file_without_triangles_is_rejected_in_one_sentence() {
    let message = read("[package]\nname = 1\n").unwrap_err().to_string();
    assert!(message.starts_with("scene.obj: 0 vertices and no face"), "{message}");
    assert!(error("l 1 2 3\nf 1 2\n").contains("5 vertices and no face"));
}

proptest! {
    #[test]
    fn written_triangles_are_read_unchanged(
        corners in prop::collection::vec(
            prop::array::uniform3(prop::array::uniform3(
                any::<f32>().prop_filter("finite", |x| x.is_finite()))),
            1..20,
        )
    ) {
        let mut text = String::new();
        for triangle in &corners {
            for [x, y, z] in triangle {
                text += &format!("v {x} {y} {z:e}\n");
            }
            text += "f -3 -2 -1\n";
        }
        let read = read(text).unwrap();
        let expected: Vec<_> = corners.iter().map(|&t| Triangle::from(t)).collect();
        prop_assert_eq!(&read.triangles, &expected);
        prop_assert!(!read.remark().is_some_and(|remark| remark.contains("no face uses")));
    }
}
