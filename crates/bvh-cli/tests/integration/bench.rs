//! Measuring rays per second from the command line.

use crate::support::{bvh, facts, wrong};

#[test]
fn a_bench_measures_every_kind_of_rays_and_finds_the_greedy_tree_as_fast_as_itself() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake escher:900 --budget=0s --out=x.bvh");
    let found = facts(at, "bench x.bvh escher:900 --time=500ms");
    let kinds = found["kinds"].as_array().unwrap();
    let names: Vec<&str> = kinds.iter().map(|kind| kind["kind"].as_str().unwrap()).collect();
    assert_eq!(names, ["primary", "bounce", "shadow", "incoherent"]);
    for kind in kinds {
        let [low, high] = [0, 1].map(|end| kind["ratio_interval"][end].as_f64().unwrap());
        let ratio = kind["ratio"].as_f64().unwrap();
        // Other tests share the machine, and may stop some rounds.
        assert!(low <= ratio && ratio <= high && low < 1.5 && high > 0.7, "{kind}");
        let [baked, greedy] = ["baked", "greedy"].map(|tree| &kind[format!("{tree}_per_second")]);
        assert!(baked.as_f64() > Some(1e3) && greedy.as_f64() > Some(1e3), "{kind}");
        let found = baked.as_f64().unwrap() / greedy.as_f64().unwrap();
        assert!((found - ratio).abs() < 1e-12, "{kind}");
    }
    assert!(found["rounds"].as_u64() >= Some(5) && found["seconds"].as_f64() >= Some(0.5));
    for line in bvh(at, "bench x.bvh escher:900 --time=1ms").lines() {
        let spans_zero = line.contains("(−") && line.contains(" to +");
        assert!(!spans_zero || line.contains("undecided"), "{line}");
    }
    let said = bvh(at, "bake spheres75 --budget=0s --out=s.bvh");
    assert!(said.contains("`bvh report s.bvh") && !said.contains("bvh bench"), "{said}");
    wrong(at, "bench s.bvh spheres75", &["spheres75", "triangles"]);
    wrong(at, "bench x.bvh escher:800", &["x.bvh"]);
}
