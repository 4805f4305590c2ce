//! OBJ files of many vertices, at every scale, and with any numbers.

use crate::samples::{error, read};
use bvh_core::Triangle;
use proptest::prelude::*;

#[test]
fn a_face_of_too_many_vertices_is_rejected() {
    let text = format!("v 0 0 0\nv 1 0 0\nf{}", " 1 2".repeat(1 << 15));
    assert_eq!(read(&text, "a.obj").unwrap().triangles.len(), (1 << 16) - 2);
    let message = error(text + " 1\n", "a.obj");
    assert!(message.starts_with("a.obj:3: face of more than 65536"), "{message}");
}

#[test]
fn triangles_without_area_are_counted_and_kept_at_every_scale() {
    for scale in ["1e-45", "1", "3e38"] {
        let points = format!("v 0 0 0\nv {scale} 0 0\nv -{scale} 0 0\nv 0 {scale} 0\n");
        let faces = "f 1 1 1\nf 1 2 2\nf 1\nf 1 2 3\nf 1 2 4\n";
        let read = read(format!("{points}{faces}"), "a.obj").unwrap();
        assert_eq!(read.triangles.len(), 4);
        let remark = "faces of fewer than three vertices skipped: 1; triangles without area: 3";
        assert_eq!(read.remark().unwrap(), remark, "scale {scale}");
    }
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
        let read = read(text, "a.obj").unwrap();
        let expected: Vec<_> = corners.iter().map(|&t| Triangle::from(t)).collect();
        prop_assert_eq!(&read.triangles, &expected);
        prop_assert!(!read.remark().is_some_and(|remark| remark.contains("no face uses")));
    }
}
