//! Time to load a tree, every check included, against the time to build one.
//!
//! `cargo bench -p harness --bench load`

mod paired;

use bvh_build::{Builder, muller_fellner};
use bvh_core::file::{self, Origin, TreeFile};
use harness::scene::Scene;
use memmap2::Mmap;
use paired::{Contender, compare};
use std::fs::{self, File};
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
    let contenders: Vec<Contender> = vec![
        ("Müller–Fellner, one thread", Box::new(|| drop(config.build(boxes)))),
        (
            "map, check, view",
            Box::new(|| {
                let file = File::open(path).expect("the file");
                // SAFETY: nobody else writes to this file.
                let bytes = unsafe { Mmap::map(&file) }.expect("a mapping");
                let view = TreeFile::open(&bytes).and_then(|file| file.for_boxes(boxes)?.view());
                assert_eq!(view.expect("the tree").nodes.len(), tree.nodes.len());
            }),
        ),
        (
            "read, check, copy",
            Box::new(|| {
                let bytes = fs::read(path).expect("the file");
                assert_eq!(file::load(&bytes, boxes).expect("the tree").nodes.len(), tree.nodes.len());
            }),
        ),
    ];
    let bytes = fs::metadata(path).expect("the file").len();
    compare(&format!("{}, {} objects, {bytes} bytes", scene.name, boxes.len()), 25, contenders);
}
