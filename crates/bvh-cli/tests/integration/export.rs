//! Exporting trees to other tracers from the command line.

use crate::support::{refused, said};
use bvh_core::export::Target;
use bvh_core::{Bvh, FirstCountNode, file};
use bvh_scenes::{Scene, tree_file};
use std::fs;

#[test]
fn an_export_is_the_fitted_tree_and_says_how_it_compares() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    said(at, &["bake", "escher:900", "--budget=1Mwork", "--out=x.bvh"]);
    let scene = Scene::load("escher:900").unwrap();
    let (tree, _) = tree_file::load(&at.join("x.bvh"), &scene).unwrap();
    for target in Target::ALL {
        let args = ["export", "x.bvh", "escher:900", "--for", target.name, "--out=x.bin"];
        let line = said(at, &args);
        assert!(line.contains(" % less than in a greedy tree ("), "{line}");
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
    let refused = |args: &[&str], parts: &[&str]| refused(at, args, 2, parts);
    refused(
        &["export", "x.bvh", "escher:900", "--for=embree", "--out=x.bin"],
        &["embree", "obvhs"],
    );
    refused(&["export", "x.bvh", "escher:900", "--for=obvhs", "--out=x.bvh"], &["--out", ".bin"]);
    refused(&["export", "x.bvh", "escher:800", "--for=obvhs", "--out=x.bin"], &["x.bvh", "800"]);
}
