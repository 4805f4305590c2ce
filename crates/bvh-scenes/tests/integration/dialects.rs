//! Files as programs write them, beside the letter of the formats, are read as the square that they
//! contain, with a remark where a reader has to choose. Faults are named.

use crate::samples::{
    GLTF as JSON, buffer, changes, data_uri, error, glb, gltf, gltf_json, ply_binary, ply_text,
    read, samples, square, stl_binary, stl_text, with,
};
use base64::Engine;

const PLY: &str = r"
\n ⇒ \r |
\n ⇒ \r\n |
255\n ⇒ 255\n\n \n |
end_header\n → end_header\n\n |
0 1 2 3\n → 0 1 2 3 |
comment a square → comment |
ply\n → PLY\n |
ply\n → ply\ncomment caf\xe9\n |
comment a square → obj_info num_cols 5 |
 255 ⇒ \x09 255  |
255 ⇒ nan |
4\nprop → 5\nprop & 4 0 1 2 → -nan(ind) nan 1.#QNAN 0\n4 0 1 2 | vertices that no face uses: 1
end_header → element cell 4000000000\nend_header |
element face → property uchar red\nelement face & 255\n ⇒ 255 255\n |
end_header → element tristrips 0\nproperty list int int vertex_indices\nend_header |
element v → element camera 2\nproperty list uchar float m\nelement v & 0 0 0 → 2 nan 5\n0\n0 0 0 |
4 0 1 2 3 → 5 0 1 2 3 0 |
face 1 → face 2 & 4 0 1 → 2 0 1\n4 0 1 | faces of fewer than three vertices skipped: 1
1 1 0.5 → 1 nan 0.5 ! face 0 | vertex 2 at [1, NaN, 0.5]; expected finite
1 1 0.5 → 1 1e99 0.5 ! face 0 | vertex 2 at [1, inf, 0.5]
1 1 0.5 → 1 one 0.5 ! a.ply:14: vertex 2 | y: `one`
1 1 0.5 → 1 1 ! a.ply:14: vertex 2 | red: its line ends
1 1 0.5 → 1 1 0.5 7 ! a.ply:14: | `255` after its last
4 0 1 2 3 → 4 0 1 2 4 ! face 0 | vertex 4 | below 4
4 0 1 2 3 → 4 0 1 2 -1 ! face 0 | vertex -1
4 0 1 2 3 → -4 0 1 2 3 ! face 0 | list of length -4
4 0 1 2 3 → 4 0 1 2 3.0 ! a.ply:16: face 0 | `3.0`
4 0 1 2 3 → 2 0 1 ! 4 vertices and 0 triangles
property float x → property float u ! element vertex has other properties; expected x, y and z
element vertex 4\n → element vertex 90000000000\nelement a 0\n ! element vertex has other properties
element vertex 4 → element vertex 4000000000 ! a.ply:16: vertex 4, counted from 0
format ascii → format octal ! a.ply:2: format `octal 1.0`; expected ascii, binary_little
ply\n → p\x00ly\n ! a.ply:1: `p\x00ly`; expected ply
format ascii 1.0 → format ascii 2.0 ! a.ply:2: format `ascii 2.0`; expected ascii
format ascii 1.0 → comment ! no format; expected a line
list uchar int → list float int ! a.ply:10: | list float int; expected a length of an integer type
list uchar int → list uchar double ! a.ply:10: | list uchar double; expected a list of an integer
list uchar int → int ! `vertex_indices` of type int; expected a list
property float x → property f x ! a.ply:5: type `f`
end_header → end ! a.ply:11: `end`; expected format, comment
element face → element tristrips ! a.ply:11: element tristrips; expected faces instead
element face 1 → element vertex 1 ! a.ply:9: element `vertex` repeats a name
property float z → property float x ! a.ply:7: property `x` repeats a name
";

const STL: &str = r"
\r\n ⇒ \r |
endloop ⇒ end loop & endfacet ⇒ end facet |
endsolid ⇒ end solid |
endsolid → endsolidAscii |
\r\n ⇒ \x20 |
solid a square\r\n → |
endloop ⇒ END LOOP |
\r\n\x20\x20 ⇒ \x20 |
normal 0 0 1 ⇒ normal NaN -nan(ind) 1.#QNAN |
normal 0 0 1 ⇒ normal 0,0 0,0 1,0 |
 normal 0 0 1 ⇒ |
facet normal ⇒ color 1 0 0\r\nfacet normal |
facet normal ⇒ color 1 0 0 facet normal |
solid a square → ; made by x\n\n# and y\nsolid a square |
a square → facet vertex endloop |
endsolid\r\n → |
vertex 1 0e0 0\r → vertex 1 0 0 4\r ! a.stl:5: `4`; expected a keyword
vertex 1 0e0 0\r → vertex 1 0 inf\r ! a.stl:5: | `1 0 inf` | three finite
vertex 1 0e0 0\r → vertex 1 0\r ! a.stl:5: | `1 0`
solid → \xef\xbb\xbfsolid & vertex 1 0e0 0\r → vertex 1 0\r ! a.stl:5: | `1 0`
   vertex 1 0e0 0\r\n → \r\n ! a.stl:7: | 2 vertices
endfacet\r\nendsolid\r\nsolid\r → vertecks\r ! a.stl:8: | `vertecks`
";

const OBJ: &str = r"
\n ⇒ \r |
\n ⇒ \r\n |
v 0 0 0 → \xef\xbb\xbf\xef\xbb\xbfv 0 0 0 |
v 0 0 0 → # caf\xe9\ng \xff\nv 0 0 0 |
v 0 0 0 → g a\nf 1 2 3 4\ng b\nv 0 0 0 & 0.5\nf 1 → 0.5\n# |
v 0 0 0 → v 0 0 0 1 0.5 nan & v 1 0 0 → v 1 0 0 1 1 1 1 |
\nv 1 1 0.5 ⇒ \nv 1 1 0.5 1 0.5 nan 0 1 |
v 1 1 0.5 → v 2 2 1 2 & v 0 1 0.5 → v 0 -2 -1 -2 |
f 1 → v nan 1.#QNAN -nan(ind)\nf 1 | vertices that no face uses: 1
f 1 → v 1 1 1 0\nf 1 | vertices that no face uses: 1
f 1 → fo 1 |
f 1 2 3 4 → f 1 2 3 4 1 |
f 1 2 3 4 → f -4 -3 -2 -1 |
f 1 2 3 4 → f 1/1 2/2/2 3//3 4 |
f 1 2 3 4 → vt 0 0\nvn 0 0 1\nf 1/-9 2/99 3//-9 4 |
f 1 2 3 4\n →   f\x091 2  3 4 |
f 1 2 3 4 → f 1 2 3 4 # the first |
f 1 2 3 4 → f 1 2\x5c\n3 4 |
f 1 2 3 4 → f \x5c\r\n1 2 \x5c  \r\n\x5c\r\n3 4\r |
f 1 2 3 4 → f 1 2 3 4 \x5c |
f 1 2 3 4 → # f 1 2 4 \x5c\nf 1 2 3 4\n#f 1 2 4 |
f 1 2 3 4 → l 1 2 3 4\np 1 2 3\nl\nf 1 2 3 4 |
f 1 2 3 4 → mtllib none.mtl\nusemtl\nusemtl gold\ng\no\ns off\nf 1 2 3 4\ncurv 0 1 1 2 \x5c\n3 |
f 1 2 3 4 → o a\nf 1 2 3\ng b\nusemtl c\nf 1 3 4 |
f 1 2 3 4 → f 1 2 3 4\nf 1 2\nf\nf 1 | faces of fewer than three vertices skipped: 3
f 1 → w 7 7 7\ncurv 0 1 \x5c\n1 2\nfx 1 2 4\nf 1 | lines with unknown keywords ignored: 2 (`w` in line 5)
f 1 2 3 4 → v nan 0 0\nf 1 2 5 ! a.obj:5: vertex coordinate `nan`; expected a finite number up to ±3.4e38
f 1 2 3 4 → v 1 -1.#IND 0\nf 1 2 -1 ! a.obj:5: | `-1.#IND` | finite
f 1 2 3 4 → f 1 2 5\n\nv 0 -inf 0 ! a.obj:7: | `-inf` | finite
f 1 2 3 4 → v 0 0 1e39\nf 5 1 2 ! a.obj:5: | `1e39` | up to ±3.4e38
f 1 2 3 4 → v 0 0 0 0\nf 1 2 5 ! a.obj:5: | weight `0` | other than 0
f 1 2 3 4 → v 1e30 0 0 1e-30\nf 1 2 5 ! a.obj:5: | weight `1e-30` | divided
f 1 2 3 4 → v 1 1 1 inf\nf 1 2 5 ! a.obj:5: | weight `inf` | finite
f 1 → v 0.12345678901234567 1.12345678901234567 nan\nf 5 ! a.obj:5: vertex coordinate `nan`
f 1 2 3 4 → v 0 0 0,5 ! a.obj:5: | `0,5` | finite number
f 1 2 3 4 → v 0 0 ! a.obj:5: | length 2 | 3 (x y z)
f 1 2 3 4 → v 0 0 0 1 1 ! a.obj:5: | length 5 | 3 (x y z)
f 1 2 3 4 → f 0 1 2 ! a.obj:5: | `0` | from 1
f 1 2 3 4 → f 1 2 x/1 ! a.obj:5: | `x/1` | whole number
f 1 2 3 4 → f 1 2 \xc2\xa03 ! a.obj:5: | `\xc2\xa03` | whole number
f 1 2 3 4 → f 1 2 3\x5c\n4 \x5c\n\nf 1 2 5 ! a.obj:8: | 5 | at most 4
f 1 2 3 4 → f 5\nf 1 2 3 ! a.obj:5: | 5 | at most 4
f 1 2 3 4 → f -5 1 2\nv 0 0 0 ! a.obj:5: | -5 | at least -4
f 1 2 3 4 → f 1 2 9223372036854775808 ! a.obj:5: | 5808` | from 1
f 1 2 3 4 → f 1 2 9223372036854775807 ! a.obj:5: | 5807 | most 4
f 1 2 3 4 → f 1 2 -9223372036854775808 ! a.obj:5: | 5808 | least -4
f 1 2 3 4 → l 1 2 3\nf 1 2 ! 4 vertices and no face of three
";

const GLTF: &str = r#"
"mesh": 0 → "mesh": 7 ! a.gltf: nodes[0]: no meshes[7]
"count": 6 → "count": 7 ! meshes[0].primitives[0]: accessors[1]: bufferViews[1] | 7 items
"byteOffset": 48 → "byteOffset": 46 ! index | below 4
"version": "2.0" → "version": "1.0" ! a.gltf: asset: version `1.0`; expected 2.0
"indices": 1 → "indices": 1, "mode": 99 ! meshes[0].primitives[0]: mode 99; expected 0 to 6
5126 → 5125 ! accessors[0]: VEC3 of unsigned int; expected VEC3 of float or byte
"byteLength": 60 → "byteLength": 61 ! buffers[0]: 60 bytes; expected 61
[{"mesh": 0}] → [{"mesh": 0, "children": null, "weights": null}] |
"indices": 1 → "indices": 1, "mode": null, "targets": null |
"nodes": [0] → "nodes": [0, 1] & [{"mesh": 0}] → [{"children": [1]}, {"mesh": 0}] |
0, "byteLength": 48 → 0, "byteStride": 0, "byteLength": 48 |
5126, "count": 4 → 5126.0, "count": 4.0 |
5126, "count": 4 → 5126, "count": 4.5 ! 4.5; expected a whole number
"scenes": [ → "animations": {}, "scenes": [ & "2.0" → "1.0" ! a.gltf: asset: version `1.0` | gltf-pipeline
[{"mesh": 0}] → [{"children": [1]}, {"children": [0], "mesh": 0}] ! expected a tree of nodes
[{"mesh": 0}] → [{"children": [0], "mesh": 0}] ! expected a tree of nodes
[{"mesh": 0}] → [{"children": [1, 1]}, {"mesh": 0}] ! expected a tree of nodes
"byteOffset": 48 → "byteOffset": 18446744073709551615 ! bufferViews[1] has no room
"count": 4 → "count": 18446744073709551615 ! accessors[0]: 18446744073709551615 items
0, "byteLength": 48 → 0, "byteStride": 4, "byteLength": 48 ! bufferViews[0] has no room
"byteLength": 60 → "byteLength": 18446744073709551615 ! buffers[0]: 60 bytes; expected 184467
"POSITION": 0 → "POSITION": 4294967296 ! accessors[4294967296]
"indices": 1 → "indices": 4294967297 ! accessors[4294967297]
"bufferView": 0 → "bufferView": 4294967296 ! bufferViews[4294967296]
"buffer": 0 → "buffer": 4294967296 ! buffers[4294967296]
"componentType": 5126 → "componentType": 4294972422 ! 4294972422
"mesh": 0 → "mesh": 4294967296 ! meshes[4294967296]
"scene": 0 → "scene": 4294967296 ! scenes[4294967296]
"nodes": [0] → "nodes": [4294967296] ! nodes[4294967296]
{"asset" → {"extras": {"mesh": 4294967296}, "asset" |
{"version" → {"copyright": "\xa9 2019", "extras": [1e999, "\x5cud800"], "version" |
"version" → "version": "2.0", "version" ! duplicate field `version`
"#;

/// Asserts that the file contains the square, and nothing but what the remark names.
fn assert_square(case: &str, bytes: &[u8], name: &str, remark: &str) {
    let mesh = read(bytes, name).unwrap_or_else(|error| panic!("{case}: {error}"));
    assert_eq!(mesh.triangles, square(), "{case}");
    assert_eq!(mesh.remark().unwrap_or_default(), remark, "{case}");
}

/// Asserts that the file is rejected in one short line with each of these words.
fn assert_refused(bytes: impl AsRef<[u8]>, name: &str, words: &[&str]) {
    let message = error(bytes, name);
    assert!(words.iter().all(|words| message.contains(words)), "{words:?}: {message}");
    assert!(message.len() < 400 && !message.contains('\n'), "{message}");
}

#[test]
fn files_as_programs_write_them_are_read_and_faults_are_named_with_their_places() {
    let (_, _, obj) = samples()[0].clone();
    for (name, file, table) in [
        ("a.ply", ply_text(), PLY),
        ("a.stl", stl_text(), STL),
        ("a.obj", obj, OBJ),
        ("a.gltf", gltf(), GLTF),
    ] {
        for (line, bytes, is_fault, words) in changes(&file, table) {
            match is_fault {
                true => assert_refused(bytes, name, &words),
                false => assert_square(line, &bytes, name, words[0]),
            }
        }
    }
    let more = [&ply_text()[..], b"1 2 3\n"].concat();
    assert_square("Ctrl-Z", &[&stl_text()[..], b"\x1a"].concat(), "a.stl", "");
    assert_square("more lines", &more, "a.ply", "bytes ignored at the end: 5");
    assert_square("a long name", &with(&stl_text(), "a square", &"n".repeat(5000)), "a.stl", "");
    assert_square("capitals", &samples()[0].2.to_ascii_uppercase(), "a.obj", "");
    assert_square("capitals", &stl_text().to_ascii_uppercase(), "a.stl", "");
    let face = format!("element {} 9000", "face".repeat(1000));
    let long = with(&ply_text(), "element face 1", &face);
    assert_refused(long, "a.ply", &["a.ply:16: facefaceface", "…"]);
    assert_refused(format!("v 0 0 {}", "x".repeat(1_000_000)), "a.obj", &["a.obj:1: ", "…"]);
    assert_refused(b"glTF\x01\0\0\0", "a.glb", &["a.glb: asset: version `1`; expected 2.0"]);
    assert_refused("[package]\nname = 1\n", "a.obj", &["a.obj: 0 vertices and no face"]);
    let cut = &["a.ply: vertex 1, counted from 0: z: the file ends"];
    assert_refused(&ply_binary(false)[..190], "a.ply", cut);
    let mut nan = stl_binary();
    nan[84 + 50 + 20..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_refused(nan, "a.stl", &["a.stl: facet 1", "NaN"]);
    assert_refused(&stl_binary()[..150], "a.stl", &["room for 1 facets; expected the 2"]);
    assert_refused(&gltf()[..200], "a.gltf", &["a.gltf: ", "EOF"]);
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
        assert_square("CRLF", &crlf, "a.ply", "");
        assert_square("CR", &cr, "a.ply", "");
        assert_square("more bytes", &zeros, "a.ply", "bytes ignored at the end: 3");
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
                    let mesh = read(&bytes, "a.ply").unwrap();
                    assert_eq!(mesh.triangles[0].0[0].x.to_bits(), number.to_bits());
                }
            }
        }
    }
}

#[test]
fn binary_stl_files_as_programs_write_them() {
    let stl = stl_binary();
    let (header, facets) = stl.split_at(84);
    let [one, two] = [&facets[..48], &facets[50..98]];
    let counted = |count: u32| [&header[..80], &count.to_le_bytes(), facets].concat();
    for (case, bytes, remark) in [
        ("colours", [header, one, b"\x1f\x80", two, b"\x00\x7c"].concat(), ""),
        ("zeros at the end", [&stl[..], &[0; 2]].concat(), "bytes ignored at the end: 2"),
        ("facets and more", [&stl[..], &[0; 57]].concat(), "bytes ignored at the end: 57"),
        ("none counted", counted(0), "the header counts 0 facets and the file has 2"),
        ("blanks", counted(0x2020_2020), "the header counts 538976288 facets and the file has 2"),
        ("-1", counted(u32::MAX), "the header counts 4294967295 facets and the file has 2"),
    ] {
        assert_square(case, &bytes, "a.stl", remark);
    }
    for count in [1, 3] {
        let room = format!("room for 2 facets; expected the {count}");
        assert!(error(counted(count), "a.stl").contains(&room));
    }
    for attributes in [
        [header, one, b"\x03\0abc", two, b"\0\0"].concat(),
        [header, one, b"\x08\0abcdefgh", two, b"\x08\0abcdefgh"].concat(),
    ] {
        assert!(error(attributes, "a.stl").contains("facets with attributes"));
    }
    for empty in [&counted(0)[..84], &[&counted(0)[..], &[0; 2]].concat()] {
        assert!(error(empty, "a.stl").contains("no facet"));
    }
}

#[test]
fn gltf_files_as_programs_write_them() {
    let json = |uri: &str| gltf_json(uri).into_bytes();
    let base64 = data_uri().split_once(',').unwrap().1.to_owned();
    let percents: String = buffer().iter().map(|byte| format!("%{byte:02x}")).collect();
    let glb = glb();
    let chunk = 20 + u32::from_le_bytes(*glb[12..].first_chunk().unwrap()) as usize;
    let mut nuls = glb.clone();
    let text = glb[20..chunk].trim_ascii_end().len();
    nuls[20 + text..chunk].fill(0);
    let unpadded = base64.trim_end_matches('=');
    for uri in [
        format!("data:application/octet-stream,{percents}"),
        format!("data:;base64,{base64}"),
        format!("data:application/gltf-buffer;base64,{unpadded}"),
    ] {
        assert_square(&uri, &json(&uri), "a.gltf", "");
    }
    assert_square("padding by zeros", &nuls, "a.gltf", "");
    let marked = crate::glb::glb(format!("\u{feff}{JSON}"), &buffer());
    assert_square("a mark in the chunk", &marked, "a.glb", "");
    let version = with(&json(&data_uri()), r#""2.0""#, "2.0");
    assert_square("the version as a number", &version, "a.gltf", "");
    let message = error(json("data:;base64,A"), "a.gltf");
    assert!(message.contains("buffers[0]: a data URI of invalid base64"), "{message}");
}

/// Compressed views of the square, as the reference's encoder in JavaScript wrote them: positions
/// as they are and by the filter for floats, indices of triangles and of any kind.
const MESHOPT: [[&str; 4]; 2] = [
    [
        "\"ATTRIBUTES\"",
        "oAAAATMAAAD//wEzAAAAfn0AAAEMAAAA/wEMAAAAfgAAAAEMAAAAfgAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA\
         AAAA",
        "\"TRIANGLES\"",
        "4fAAAHaHVmd4qYZliWiYAWkAAA==",
    ],
    [
        "\"ATTRIBUTES\", \"filter\": \"EXPONENTIAL\"",
        "oAABMwAAAIB/AAEwAAAAygABDAAAAIAAATAAAADKAAEMAAAAQAABMAAAAMoAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAI0A\
         AACNAAAAjQ==",
        "\"INDICES\"",
        "0QAEBAYIBAAAAAA=",
    ],
];

#[test]
fn views_that_meshopt_compressed_are_read_and_damaged_ones_are_named() {
    for [mode, positions, index_mode, indices] in MESHOPT {
        let decode = |text: &str| base64::engine::general_purpose::STANDARD.decode(text).unwrap();
        let [positions, indices] = [decode(positions), decode(indices)];
        let view = |from: usize, length: usize, count: usize, stride: usize, mode: &str| {
            format!(
                r#", "extensions": {{"EXT_meshopt_compression": {{"buffer": 0, "byteOffset": {from},
                "byteLength": {length}, "byteStride": {stride}, "count": {count}, "mode": {mode}}}}}"#
            )
        };
        let first = view(0, positions.len(), 4, 12, mode);
        let second = view(positions.len(), indices.len(), 6, 2, index_mode);
        let (zero, other) =
            (r#"{"buffer": 0, "byteLength": 48"#, r#"{"buffer": 1, "byteLength": 48"#);
        let json = JSON
            .replace(zero, &format!("{other}{first}"))
            .replace(r#"48, "byteLength": 12"#, &format!(r#"0, "byteLength": 12{second}"#))
            .replace(
                r#"[{"byteLength": 60}]"#,
                &format!(
                    r#"[{{"byteLength": {}}}, {{"byteLength": 48}}]"#,
                    positions.len() + indices.len()
                ),
            );
        let binary = [positions, indices].concat();
        assert_square(mode, &crate::glb::glb(json.clone(), &binary), "a.glb", "");
        let refused = |json: String, binary: &[u8], words: &[&str]| {
            assert_refused(crate::glb::glb(json, binary), "a.glb", words);
        };
        let mut damaged = binary.clone();
        damaged[0] = 0;
        refused(json.clone(), &damaged, &["bufferViews[0]: 4 items of 12 bytes", "meshopt"]);
        for (from, to, words) in [
            (
                "\"count\": 4,",
                "\"count\": 4000000000000000,",
                "accessors[0]: 4000000000000000 items",
            ),
            (
                "\"byteStride\": 12, \"count\": 4",
                "\"byteStride\": 12, \"count\": 5",
                "5 items of 12",
            ),
            ("ATTRIBUTES", "COLOURS", "COLOURS"),
            ("\"byteOffset\": 0,", "\"byteOffset\": 900,", "the buffer ends before"),
        ] {
            refused(json.replacen(from, to, 1), &binary, &[words]);
        }
    }
}

#[test]
fn files_of_other_kinds_are_rejected_by_their_kind() {
    for (bytes, kind) in [
        (&b"\x89BVH\r\n\x1a\n"[..], "a tree"),
        (b"\n<!doctype html><html>", "a web page"),
        (b"<?xml version=\"1.0\"?><COLLADA>", "XML"),
        (b"version https://git-lfs.github.com/spec/v1\noid", "Git LFS"),
        (b"\x1f\x8b\x08\0", "gzip"),
        (b"PK\x03\x04\0", "3MF"),
        (b"Kaydara FBX Binary  \0", "FBX"),
        (b"; FBX 7.4.0 project file", "FBX"),
        (b"PXR-USDC\0", "USD"),
        (b"#usda 1.0\n", "USD"),
        (b"ISO-10303-21;\nHEADER;", "STEP"),
        (b"BLENDER-v300", "Blender"),
        (b"OFF\n3 1 0\n", "OFF"),
        (b"DRACO\x02\x02", "Draco"),
        (b"\x89PNG\r\n\x1a\n", "PNG"),
        (b"\xff\xd8\xff\xe0", "JPEG"),
    ] {
        for name in ["a.obj", "a.stl", "a.glb", "a"] {
            assert_refused(bytes, name, &[kind, "expected an OBJ, PLY, STL or glTF file"]);
        }
    }
    let mut stl = stl_binary();
    stl[..4].copy_from_slice(b"PK\x03\x04");
    assert_square("a binary STL file with any comment", &stl, "a.stl", "");
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
