//! Exporting trees to other tracers from the command line.

use crate::support::bvh;
use bvh_core::export::Target;
use bvh_core::{Bvh, FirstCountNode, file};
use bvh_scenes::{Scene, tree_file};
use std::fs;

#[test]
fn an_export_is_the_fitted_tree_and_says_how_it_compares() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake escher:900 --budget=1Mwork --out=x.bvh");
    let scene = Scene::load("escher:900").unwrap();
    let (tree, _) = tree_file::load(&at.join("x.bvh"), &scene).unwrap();
    for target in Target::ALL {
        let line = bvh(at, &format!("export x.bvh escher:900 --for={} --out=x.bin", target.name));
        assert!(line.contains(" % below a greedy tree's "), "{line}");
        let bytes = fs::read(at.join("x.bin")).unwrap();
        let fitted = target.fit(&tree);
        assert_eq!(bytes, target.bytes(&fitted, &scene.boxes));
        let words = [4, 8, 12, 16].map(|at| {
            let (word, _) = bytes[at..].split_first_chunk().unwrap();
            u32::from_le_bytes(*word)
        });
        let [version, nodes, ids, scene_checksum] = words;
        assert_eq!((&bytes[..4], version, ids), (&b"BVHX"[..], 1, 900));
        assert_eq!(scene_checksum, file::boxes_checksum(&scene.boxes));
        assert_eq!(bytes.len(), 32 + 32 * nodes as usize + 4 * 900);
        if target == Target::OBVHS {
            let (_, body) = bytes.split_at(32);
            let (nodes, ids) = body.split_at(32 * nodes as usize);
            let nodes: Vec<FirstCountNode> =
                nodes.chunks_exact(32).map(bytemuck::pod_read_unaligned).collect();
            let ids: Vec<u32> = ids.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
            assert_eq!(Bvh::from_first_count(&nodes, &ids).unwrap(), fitted);
        }
    }
}
