//! The time to load a tree, with all checks, compared with the time to build one; and the parts of
//! the loading time.
//!
//! After a build, caches hold the builder's data, and the file, the boxes and the kernel's records
//! of the file's pages come from memory. A second load finds them in caches. The time to map a file
//! depends on the pieces in which the kernel holds it, from one page to hundreds of pages.
//!
//! `cargo bench --manifest-path attic/Cargo.toml --bench load`

mod paired;

use bvh_build::{Builder, muller_fellner};
use bvh_core::file::{self, Origin, TreeFile};
use bvh_scenes::Scene;
use memmap2::Mmap;
use paired::{Contender, compare, compare_each_after};
use std::fs::{self, File};
use std::hint::black_box;
use std::path::Path;

const MULLER_FELLNER: &str = "Müller–Fellner, one thread";

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
    let boxes = &scene.boxes;
    let config = muller_fellner::Config::default();
    let tree = config.build(boxes).expect("finite boxes");
    fs::write(path, file::save(&tree, boxes, &Origin::default()).expect("a valid tree"))
        .expect("a file");
    let held = map(path);
    let build = || drop(config.build(boxes));
    let load = || {
        let bytes = map(path);
        let view = TreeFile::open(&bytes).and_then(|file| file.for_boxes(boxes)?.view());
        assert_eq!(view.expect("the tree").nodes.len(), tree.nodes.len());
    };
    let parts = || -> Vec<Contender> {
        let touch =
            || _ = black_box(map(path).iter().step_by(4096).fold(0, |all, byte| all ^ byte));
        vec![
            ("  of that: map, touch every page, unmap", Box::new(touch)),
            (
                "  of that: checksum and structure of the file",
                Box::new(|| _ = black_box(TreeFile::open(&held))),
            ),
            (
                "  of that: checksum of the boxes",
                Box::new(|| _ = black_box(file::boxes_checksum(boxes))),
            ),
            ("one addition per eight bytes of the file", Box::new(|| _ = black_box(sum(&held)))),
        ]
    };
    let copy = || {
        let bytes = fs::read(path).expect("the file");
        assert_eq!(file::load(&bytes, boxes).expect("the tree").nodes.len(), tree.nodes.len());
    };
    let mut contenders: Vec<Contender> = vec![
        (MULLER_FELLNER, Box::new(build)),
        ("map, check, view: right after that build", Box::new(load)),
        ("map, check, view: once more right away", Box::new(load)),
    ];
    contenders.extend(parts());
    contenders.push(("read, check, copy", Box::new(copy)));
    let title = format!("{}, {} objects, {} bytes", scene.name, boxes.len(), held.len());
    compare(&title, 25, contenders);

    // A build before every part leaves the caches in the same state.
    let mut contenders: Vec<Contender> =
        vec![(MULLER_FELLNER, Box::new(build)), ("map, check, view", Box::new(load))];
    contenders.extend(parts());
    compare_each_after(build, &format!("{title}, each right after a build"), 25, contenders);
}

fn map(path: &Path) -> Mmap {
    let file = File::open(path).expect("the file");
    // SAFETY: the file is in a temporary folder of this process, which never writes to it while it
    // is mapped.
    unsafe { Mmap::map(&file) }.expect("a mapping")
}

/// Sums the bytes, the cheapest way to read all of them.
fn sum(bytes: &[u8]) -> u64 {
    let words = bytes.as_chunks::<8>().0;
    words.iter().fold(0, |sum, word| sum.wrapping_add(u64::from_le_bytes(*word)))
}
