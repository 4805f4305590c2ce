//! Time to load a tree, every check included, against the time to build one; and where the time to load goes.
//!
//! `cargo bench -p harness --bench load`

mod paired;

use bvh_build::{Builder, muller_fellner};
use bvh_core::WideBvh;
use bvh_core::file::{self, Origin, TreeFile};
use harness::scene::Scene;
use memmap2::Mmap;
use paired::{Contender, compare};
use std::fs::{self, File};
use std::hint::black_box;
use std::path::Path;

fn main() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of threads");
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["sponza", "cloister"] {
        match Scene::load(name) {
            Ok(scene) => one.install(|| loads(&scene, &folder.path().join("tree.bvh"))),
            Err(error) => println!("\n{error}"),
        }
    }
}

fn loads(scene: &Scene, path: &Path) {
    let (boxes, config) = (&scene.boxes, muller_fellner::Config::default());
    let tree = config.build(boxes).expect("finite boxes");
    fs::write(path, file::save(&tree, boxes, &Origin::default()).expect("a valid tree")).expect("a file");
    let held = map(path);
    let file = TreeFile::open(&held).expect("a tree file");
    let contenders: Vec<Contender> = vec![
        ("Müller–Fellner, one thread", Box::new(|| drop(config.build(boxes)))),
        (
            "map, check, view",
            Box::new(|| {
                let bytes = map(path);
                let view = TreeFile::open(&bytes).and_then(|file| file.for_boxes(boxes)?.view());
                assert_eq!(view.expect("the tree").nodes.len(), tree.nodes.len());
            }),
        ),
        (
            "  of that: map, touch every page, unmap",
            Box::new(|| _ = black_box(map(path).iter().step_by(4096).fold(0, |all, byte| all ^ byte))),
        ),
        ("  of that: checksum of the file", Box::new(|| _ = black_box(TreeFile::open(&held)))),
        ("  of that: checksum of the boxes", Box::new(|| _ = black_box(file::boxes_checksum(boxes)))),
        ("  of that: structure", Box::new(|| _ = black_box(file.view()))),
        ("one addition per eight bytes of the file", Box::new(|| _ = black_box(sum(&held)))),
        (
            "read, check, copy",
            Box::new(|| {
                let bytes = fs::read(path).expect("the file");
                assert_eq!(file::load(&bytes, boxes).expect("the tree").nodes.len(), tree.nodes.len());
            }),
        ),
    ];
    let title = format!("{}, {} objects, {} bytes", scene.name, boxes.len(), held.len());
    compare(&title, 25, contenders);

    let Ok(triangles) = &scene.triangles() else { return };
    fs::write(path, file::save_wide(&tree, triangles, &Origin::default()).expect("a valid tree"))
        .expect("a file");
    let bytes = fs::metadata(path).expect("the file").len();
    let contenders: Vec<Contender> = vec![
        (
            "Müller–Fellner, then the wide layout",
            Box::new(|| drop(config.build(boxes).map(|tree| WideBvh::new(&tree, triangles)))),
        ),
        (
            "map, check, view",
            Box::new(|| {
                let bytes = map(path);
                let file = TreeFile::open(&bytes).and_then(|file| file.for_triangles(triangles));
                _ = black_box(file.expect("the file").wide_view().expect("the layout"));
            }),
        ),
    ];
    compare(&format!("{}, wide layout, {bytes} bytes", scene.name), 25, contenders);
}

fn map(path: &Path) -> Mmap {
    let file = File::open(path).expect("the file");
    // SAFETY: nobody else writes to this file while it is mapped.
    unsafe { Mmap::map(&file) }.expect("a mapping")
}

/// What reading the bytes costs at least.
fn sum(bytes: &[u8]) -> u64 {
    let words = bytes.as_chunks::<8>().0;
    words.iter().fold(0, |sum, word| sum.wrapping_add(u64::from_le_bytes(*word)))
}
