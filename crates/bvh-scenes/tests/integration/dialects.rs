//! Files as programs write them, beside the letter of the formats, are read as the square that they
//! contain, with a remark where a reader has to choose.

use crate::samples::{
    INDEXED, NODE, buffer, changes, data_uri, error, floats, glb, gltf_json, ply_binary, ply_text,
    samples, square, stl_binary, stl_text, with,
};
use bvh_core::Triangle;
use bvh_scenes::load::parse;
use std::path::Path;

type Case = (&'static str, Vec<u8>, &'static str);

fn assert_square(case: &str, bytes: &[u8], name: &str, remark: &str) {
    let mesh = parse(bytes, Path::new(name)).unwrap_or_else(|error| panic!("{case}: {error}"));
    assert_eq!(mesh.triangles, square(), "{case}");
    assert_eq!(mesh.remark().unwrap_or_default(), remark, "{case}");
}

/// Asserts that each file contains the square, and nothing but what the remark names.
fn assert_read(name: &str, cases: Vec<Case>) {
    cases.iter().for_each(|(case, bytes, remark)| assert_square(case, bytes, name, remark));
}

/// Asserts the same of each change of a file.
fn assert_changes_read(name: &str, file: &[u8], table: &str) {
    changes(file, table).for_each(|(line, bytes, remark)| {
        assert_square(line, &bytes, name, remark[0]);
    });
}

#[test]
fn text_ply_files_as_programs_write_them() {
    let ply = ply_text();
    assert_changes_read(
        "a.ply",
        &ply,
        r"
\n ⇒ \r |
\n ⇒ \r\n |
255\n ⇒ 255\n\n \n |
end_header\n → end_header\n\n |
0 1 2 3\n → 0 1 2 3 |
comment a square → comment |
ply\n → ply\ncomment caf\xe9\n |
comment a square → obj_info num_cols 5 |
 255 ⇒ \x09 255  |
255 ⇒ nan |
4\nprop → 5\nprop & 4 0 1 2 → -nan(ind) nan 1.#QNAN 0\n4 0 1 2 | 1 vertex is used by no face
end_header → element cell 4000000000\nend_header |
element v → element camera 2\nproperty list uchar float m\nelement v & 0 0 0 → 2 nan 5\n0\n0 0 0 |
4 0 1 2 3 → 5 0 1 2 3 0 |
face 1 → face 2 & 4 0 1 → 2 0 1\n4 0 1 | 1 face has fewer than three vertices and was skipped
element face → element tristrips & 4 0 1 2 3 → 8 0 1 2 -1 0 2 3 -1 |
",
    );
    let more = [&ply[..], b"1 2 3\n"].concat();
    assert_square("more lines", &more, "a.ply", "5 bytes after the last element were ignored");
}

#[test]
fn binary_ply_files_as_programs_write_them() {
    for is_big in [false, true] {
        let ply = ply_binary(is_big);
        let header = ply.windows(10).position(|window| window == b"end_header").unwrap() + 11;
        let text = String::from_utf8(ply[..header].to_vec()).unwrap();
        let crlf = [text.replace('\n', "\r\n").as_bytes(), &ply[header..]].concat();
        let cr = [text.replace('\n', "\r").as_bytes(), &ply[header..]].concat();
        let zeros = [&ply[..], &[0; 3]].concat();
        assert_read(
            "a.ply",
            vec![
                ("CRLF", crlf, ""),
                ("CR", cr.clone(), ""),
                ("more bytes", zeros, "3 bytes after the last element were ignored"),
            ],
        );
        // The first number of the body may look like the end of a line, after any end of the header.
        for (bytes, header) in [(&ply, header), (&cr, header)] {
            for first in [b"\n\x00\x00\x00", b"\n\r\n\x00", b"\r\n\x00\x00"] {
                let mut bytes = bytes.clone();
                if bytes[header - 1] == b'\n' || first[0] == b'\n' {
                    bytes[header..header + 4].copy_from_slice(first);
                    let number = if is_big {
                        f32::from_be_bytes(*first)
                    } else {
                        f32::from_le_bytes(*first)
                    };
                    let mesh = parse(&bytes, Path::new("a.ply")).unwrap();
                    assert_eq!(mesh.triangles[0].0[0].x.to_bits(), number.to_bits());
                }
            }
        }
    }
}

#[test]
fn text_stl_files_as_programs_write_them() {
    let stl = stl_text();
    assert_changes_read(
        "a.stl",
        &stl,
        r"
\r\n ⇒ \r |
endloop ⇒ end loop & endfacet ⇒ end facet |
endsolid ⇒ end solid |
endloop ⇒ END LOOP |
normal 0 0 1 ⇒ normal NaN -nan(ind) 1.#QNAN |
normal 0 0 1 ⇒ normal 0,0 0,0 1,0 |
 normal 0 0 1 ⇒ |
facet normal ⇒ color 1 0 0\r\nfacet normal |
facet normal ⇒ color 1 0 0 facet normal |
solid a square → ; made by x\n\n# and y\nsolid a square |
a square → facet vertex endloop |
endsolid\r\n → |
",
    );
    assert_square("a long name", &with(&stl, "a square", &"n".repeat(5000)), "a.stl", "");
}

#[test]
fn binary_stl_files_as_programs_write_them() {
    let stl = stl_binary();
    let (header, facets) = stl.split_at(84);
    let [one, two] = [&facets[..48], &facets[50..98]];
    let counted = |count: u32| [&header[..80], &count.to_le_bytes(), facets].concat();
    assert_read(
        "a.stl",
        vec![
            ("attributes", [header, one, b"\x03\0abc", two, b"\0\0"].concat(), ""),
            (
                "long attributes",
                [header, one, b"\x08\0abcdefgh", two, b"\x08\0abcdefgh"].concat(),
                "",
            ),
            ("colours", [header, one, b"\x1f\x80", two, b"\x00\x7c"].concat(), ""),
            (
                "zeros at the end",
                [&stl[..], &[0; 2]].concat(),
                "2 bytes after the last facet were ignored",
            ),
            (
                "facets and more",
                [&stl[..], &[0; 57]].concat(),
                "57 bytes after the last facet were ignored",
            ),
            ("a count of 0", counted(0), "the header counts 0 facets and the file has 2"),
            (
                "a count of -1",
                counted(u32::MAX),
                "the header counts 4294967295 facets and the file has 2",
            ),
        ],
    );
    for (count, room) in
        [(1, "room for 2 facets; expected the 1"), (3, "room for 2 facets; expected the 3")]
    {
        assert!(error(counted(count), "a.stl").contains(room));
    }
    for empty in [&counted(0)[..84], &[&counted(0)[..], &[0; 2]].concat()] {
        assert!(error(empty, "a.stl").contains("no facet"));
    }
}

#[test]
fn obj_files_as_programs_write_them() {
    let (_, _, obj) = samples()[0].clone();
    assert_square("capitals", &obj.to_ascii_uppercase(), "a.obj", "");
    assert_changes_read(
        "a.obj",
        &obj,
        r"
f 1 → fo 1 |
\nv 1 1 0.5 ⇒ \nv 1 1 0.5 1 0.5 nan 0 1 |
f 1 → v nan 1.#QNAN -nan(ind)\nf 1 | 1 vertex is used by no face
f 1 2 3 4 → f 1 2 3 4 1 |
",
    );
}

#[test]
fn gltf_files_as_programs_write_them() {
    let json = |uri: &str| gltf_json(uri, NODE, INDEXED).into_bytes();
    let base64 = data_uri().split_once(',').unwrap().1.to_owned();
    let percents: String = buffer().iter().map(|byte| format!("%{byte:02x}")).collect();
    let glb = glb();
    let chunk = 20 + u32::from_le_bytes(*glb[12..].first_chunk().unwrap()) as usize;
    let mut nuls = glb.clone();
    let text = glb[20..chunk].trim_ascii_end().len();
    nuls[20 + text..chunk].fill(0);
    let unpadded = base64.trim_end_matches('=');
    assert_read(
        "a.gltf",
        vec![
            ("percents", json(&format!("data:application/octet-stream,{percents}")), ""),
            ("base64 in no type", json(&format!("data:;base64,{base64}")), ""),
            (
                "base64 without padding",
                json(&format!("data:application/gltf-buffer;base64,{unpadded}")),
                "",
            ),
            ("padding by zeros", nuls, ""),
            ("the version as a number", with(&json(&data_uri()), r#""2.0""#, "2.0"), ""),
        ],
    );
    let message = error(json("data:;base64,A"), "a.gltf");
    assert!(message.contains("buffers[0]: a data URI of invalid base64"), "{message}");
}

#[test]
fn text_in_utf_16_is_rejected_in_these_words() {
    for name in ["a.obj", "a.ply", "a.stl", "a.gltf"] {
        let (_, _, bytes) =
            samples().into_iter().find(|(sample, ..)| sample.ends_with(&name[1..])).unwrap();
        let text = format!("\u{feff}{}", String::from_utf8(bytes).unwrap());
        let little = text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
        let big = text.encode_utf16().flat_map(u16::to_be_bytes).collect::<Vec<u8>>();
        for bytes in [little, big] {
            assert!(error(bytes, name).contains("the text is UTF-16; expected UTF-8 or ASCII"));
        }
    }
}

#[test]
fn a_strip_turns_every_second_triangle_and_ends_at_minus_one() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 6\nproperty float x\n\
                  property float y\nproperty float z\nelement tristrips 1\n\
                  property list int int vertex_indices\nend_header\n";
    let corners = [0, 1, 2, 3, 4, 5].map(|i| [(i % 2) as f32, (i / 2) as f32, 0.0]);
    let strips = [10i32, 0, 1, 2, 3, -1, 2, 3, 4, 5, -1].map(i32::to_le_bytes).concat();
    let bytes = [header.as_bytes(), &floats(corners.concat()), &strips].concat();
    let expected = [[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]];
    assert_eq!(
        parse(&bytes, Path::new("a.ply")).unwrap().triangles,
        Triangle::from_mesh(&corners, &expected).unwrap()
    );
}
