//! `bvh sky` from the command line.

use crate::support::{bvh, facts, number, obj};
use glam::DVec3;
use std::fs;
use std::path::Path;

/// Returns the rows of a table without its header.
fn rows(file: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(file).unwrap();
    let row = |line: &str| line.split(',').map(|field| field.parse().unwrap()).collect();
    text.lines().skip(1).map(row).collect()
}

/// A rectangle from three of its corners.
fn rectangle(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> [[DVec3; 3]; 2] {
    let [a, b, c] = [a, b, c].map(DVec3::from);
    [[a, b, c], [a, c, a - b + c]]
}

#[test]
fn the_view_of_the_sky_from_a_street_is_that_of_its_formula_for_points_of_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Walls of height 1 at x = -1 and x = 1, on each side of the street along y.
    let wall = |x: f64| rectangle([x, -1e4, 0.0], [x, 1e4, 0.0], [x, 1e4, 1.0]);
    fs::write(at.join("street.obj"), obj([wall(-1.0), wall(1.0)].concat())).unwrap();
    let xs = [-0.9, -0.5, 0.0, 0.7f32];
    let lines = xs.map(|x| format!("{x},0,0"));
    fs::write(at.join("p.csv"), format!("x,y,z\n{}\n", lines.join("\n"))).unwrap();
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (4, 3), }\n";
    let length = (header.len() as u16).to_le_bytes();
    let bytes = xs.map(|x| [x, 0.0, 0.0].map(f32::to_le_bytes)).concat().concat();
    let npy = [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), &bytes].concat();
    fs::write(at.join("p.npy"), npy).unwrap();
    // Columns between semicolons, and normals.
    fs::write(at.join("n.csv"), lines.join(";0;0;3\n").replace(',', ";") + ";0;0;3\n").unwrap();
    for (points, sky, error) in [
        ("p.csv", "uniform:50000", 3e-3),
        ("p.npy", "reinhart", 2e-2),
        ("n.csv --offset=0", "tregenza", 4e-2),
    ] {
        bvh(at, &format!("sky street.obj --points={points} --sky={sky} --out=v.csv"));
        let rows = rows(&at.join("v.csv"));
        assert_eq!(rows.len(), xs.len());
        for (row, x) in rows.iter().zip(xs.map(f64::from)) {
            let sine = |distance: f64| distance / distance.hypot(1.0);
            let formula = (sine(1.0 - x) + sine(1.0 + x)) / 2.0;
            assert!((row[4] - formula).abs() < error, "{points}: {row:?} {formula}");
        }
    }
}

#[test]
fn weights_of_free_directions_on_the_side_of_the_normal_are_summed_in_columns() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // A floor that is free but for a roof high above its first triangle, whose front is below.
    let floor = rectangle([0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [9.0, 9.0, 0.0]);
    let roof = rectangle([5.0, 0.0, 5.0], [5.0, 9.0, 5.0], [9.0, 9.0, 5.0]);
    fs::write(at.join("roof.obj"), obj([floor, roof].concat())).unwrap();
    fs::write(at.join("d.csv"), "x,y,z,h,kWh\n0,0,2,1,10\n\n0,0,-1,2,20\n4,0,1,4,40\n").unwrap();
    let sky = "sky roof.obj --directions=d.csv --out=x.csv";
    let values = |line: &str| -> Vec<[f64; 2]> {
        bvh(at, line);
        rows(&at.join("x.csv")).iter().map(|row| [row[4], row[5]]).collect()
    };
    let free = values(sky);
    assert_eq!(free, [[4.0, 40.0], [5.0, 50.0], [0.0, 0.0], [0.0, 0.0]]);
    let both = values(&format!("{sky} --two-sided"));
    assert_eq!(both[2..], [[5.0, 50.0]; 2]);
    let header = fs::read_to_string(at.join("x.csv")).unwrap();
    assert_eq!(header.lines().next(), Some("point,x,y,z,h,kWh"));
    assert_eq!(number(at, &format!("{sky} --column=kWh"), "maximum"), 50.0);
}

#[test]
fn a_roof_hides_the_sun_as_long_as_the_sun_takes_across_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let roof = rectangle([2.0, -9.0, 5.0], [2.0, 9.0, 5.0], [6.0, 9.0, 5.0]);
    fs::write(at.join("roof.obj"), obj(roof)).unwrap();
    fs::write(at.join("p.csv"), "0,0,0\n").unwrap();
    let hours = |more: &str| {
        let sun = "--sun=0,0 --dates=2026-03-20 --step=5";
        bvh(at, &format!("sky roof.obj --points=p.csv {sun} --out=x.csv {more}"));
        rows(&at.join("x.csv"))[0][4]
    };
    // On the equator at an equinox the sun rises straight up from the east, 15 degrees an hour.
    let hidden = (f64::atan2(5.0, 2.0) - f64::atan2(5.0, 6.0)).to_degrees() / 15.0;
    for (turn, expected) in [("", hidden), ("--north=180", hidden), ("--north=90", 0.0)] {
        let found = hours(turn);
        assert!((found - (12.0 - expected)).abs() < 0.15, "{turn}: {found} {expected}");
    }
    // Where y is up, the roof stands beside the path of the sun.
    assert!((hours("--up=y") - 12.0).abs() < 0.15);
}

#[test]
fn any_number_of_threads_and_any_tree_write_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake escher:1000 --budget=1Mwork --out=a.bvh");
    for kind in ["csv", "png", "glb", "ply"] {
        let mut files = Vec::new();
        for how in ["--jobs=1", "--jobs=4", "--tree=a.bvh"] {
            bvh(at, &format!("sky escher:1000 --out=x.{kind} --size=60x40 {how}"));
            files.push(fs::read(at.join("x").with_extension(kind)).unwrap());
        }
        assert!(files[0] == files[1] && files[0] == files[2], "{kind}");
    }
}

#[test]
fn coloured_meshes_are_the_scene_and_see_what_it_sees() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = facts(at, "sky konistil:2000 --out=x.csv");
    for out in ["x.ply", "x.glb", "y.ply --per=vertex", "y.glb --per=vertex"] {
        bvh(at, &format!("sky konistil:2000 --out={out}"));
        // Up is y in the GLB file.
        let file = out.split(' ').next().unwrap();
        let again = facts(at, &format!("sky {file} --out=again.csv"));
        assert_eq!(again["points"], 2000);
        let [mean, of_scene] = [&again, &scene].map(|facts| facts["mean"].as_f64().unwrap());
        assert!((mean - of_scene).abs() < 1e-3, "{out}: {mean} {of_scene}");
    }
    // The red of the darkest and of the brightest vertex.
    let ply = fs::read(at.join("x.ply")).unwrap();
    let body = ply.windows(11).position(|part| part == b"end_header\n").unwrap() + 11;
    let red = || ply[body..].chunks_exact(19).take(6000).map(|vertex| vertex[12]);
    assert_eq!((red().min(), red().max()), (Some(0), Some(252)));
}
