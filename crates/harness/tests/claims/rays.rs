//! Words about the tests and the speed of rays in the trees of a search.

use super::{cell, rows};
use crate::{page_says, readme_says};
use harness::report::query::number_in;

/// The scenes whose rays are counted and timed.
const SCENES: [&str; 4] = ["cloister", "escher", "sponza", "kitchen"];

#[test]
fn trees_by_default_rays_lose_where_the_page_says_so() {
    page_says(
        "docs/METHODS.md",
        "and 1.117 and 1.073 times on the other, all conclusively. Incoherent rays take more on \
         cloister and sponza in the trees *rays*, *camera*",
    );
    let mut lost = Vec::new();
    let searched = "scene!=geometric mean, tree!=greedy, trained_on=default or camera or none";
    for row in rows("ray_objective/ray_cost.csv", searched) {
        if number_in(&row, "over_base_low").unwrap() > 1.0 {
            let columns = ["scene", "tree", "trained_on", "judged_on", "camera"];
            lost.push(columns.map(|column| row[column].as_str()).join(" "));
        }
    }
    lost.sort();
    let expected = [
        "cloister rays camera incoherent none",
        "escher rays default bounce other",
        "escher rays default bounce same",
        "escher rays default primary other",
        "escher rays default primary same",
        "sponza rays camera incoherent none",
    ];
    assert_eq!(lost, expected);
}

#[test]
fn the_guard_costs_the_next_frame_something_on_one_scene() {
    page_says("docs/METHODS.md", "on sponza and the kitchen the comparisons are inconclusive.");
    for row in rows("recorded_frame/ray_cost_pairs.csv", "camera=same") {
        let expected = if row["scene"] == "cloister" { "more" } else { "inconclusive" };
        assert_eq!(row["verdict"], expected, "{row:?}");
    }
}

#[test]
fn more_work_by_area_does_not_save_tests_on_two_scenes() {
    page_says("docs/METHODS.md", "from 15 million on they do not fall on escher and sponza.");
    for scene in SCENES {
        let [some, much] = ["area\\, 15 M", "area\\, 400 M"].map(|method| {
            let row = format!("scene={scene}, method={method}, camera=same");
            cell("ray_budgets/timing_ray_time.csv", &row, "tests_over_base")
        });
        assert_eq!(much >= some, scene == "escher" || scene == "sponza", "{scene}");
    }
}

#[test]
fn five_repetitions_for_a_camera_save_tests_on_the_other_path_of_escher() {
    page_says("docs/METHODS.md", "with five repetitions of such a search all three are below 1");
    for rays in ["primary", "bounce", "shadow"] {
        let row = format!("scene=escher, tree=camera, camera=other, judged_on={rays}");
        assert!(cell("splits/ray_cost.csv", &row, "over_base_high") < 1.0, "{rays}");
    }
}

#[test]
fn boxes_are_not_always_saved_by_the_cost_of_the_layout() {
    page_says("docs/CHOOSING.md", "It saves tests of nodes and blocks, not always of boxes");
    let boxes = |method: &str| {
        let row = format!("scene=sponza, rays=shadow, layout=wide, method={method}");
        cell("peers/amd-epyc-25-17/traversal.csv", &row, "boxes_per_ray")
    };
    assert!(boxes("best for the layout") > boxes("best"));
}

/// Returns the million rays per second of our batches in one tree.
fn speed(processor: &str, instructions: &str, scene: &str, rays: &str, tree: &str) -> f64 {
    let row = format!(
        "scene={scene}, library=ours, instructions={instructions}, rays={rays}, mode={tree}: wide\\, \
         batches"
    );
    cell(&format!("peers/{processor}/timing_rays.csv"), &row, "million_per_s")
}

#[test]
fn the_layouts_tree_is_no_faster_for_primary_rays_in_batches() {
    page_says("docs/CHOOSING.md", "in batches primary rays gain nothing");
    for processor in ["amd-epyc-25-1", "amd-epyc-25-17"] {
        let [layout, area] = ["best for the layout", "best"]
            .map(|tree| speed(processor, "AVX2", "geometric mean", "primary", tree));
        assert!(layout < area, "{processor}");
    }
}

#[test]
fn other_budgets_lose_or_gain_shadow_rays_on_cloister_on_both_processors() {
    readme_says("Pairs of other budgets on cloister lose or gain as much, on both processors:");
    let runs =
        [("amd-epyc-25-1", "AVX2"), ("amd-epyc-25-17", "AVX2"), ("amd-epyc-25-17", "AVX-512")];
    for (processor, instructions) in runs {
        let of = |tree: &str| speed(processor, instructions, "cloister", "shadow", tree);
        let of_best = of("best");
        for faster in ["best\\, 6.5 M", "best\\, 2 M", "reinsertion"] {
            assert!(of_best < 0.93 * of(faster), "{processor}, {instructions}: {faster}");
        }
        for slower in ["best\\, 1 M", "best\\, 0.4 M"] {
            assert!(of_best > 1.05 * of(slower), "{processor}, {instructions}: {slower}");
        }
    }
}

#[test]
fn more_seconds_by_area_make_shadow_rays_faster_on_one_scene_of_four() {
    page_says(
        "docs/BENCHMARKS.md",
        "shadow rays gain on one scene and lose on three, with one tree each.",
    );
    let mut faster = Vec::new();
    for scene in SCENES {
        let [long, short] = ["best", "best\\, 6.5 M"]
            .map(|tree| speed("amd-epyc-25-1", "AVX2", scene, "shadow", tree));
        if long > short {
            faster.push(scene);
        }
    }
    assert_eq!(faster, ["sponza"]);
}
