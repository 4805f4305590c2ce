//! Words about what a build or a search costs, and how long it takes.

use super::{rows, sorted};
use crate::support::top;
use crate::{page_says, readme_says};
use harness::report::query::{Row, number_in};
use std::collections::{BTreeMap, BTreeSet};

#[test]
fn other_libraries_divide_triangles_in_less_than_half_a_second() {
    readme_says(
        "Embree's high quality and tinybvh's SBVH divide triangles in less than half a second, \
         without a budget.",
    );
    for processor in ["amd-epyc-25-1", "amd-epyc-25-17"] {
        let file = format!("peers/{processor}/timing_rays.csv");
        let mut compared = 0;
        for row in rows(&file, "library=embree or tinybvh") {
            let mode = &row["mode"];
            if mode.contains("high") || mode.contains("splits") {
                assert!(number_in(&row, "build_seconds").unwrap() < 0.5, "{row:?}");
                compared += 1;
            }
        }
        assert!(compared > 50, "{processor}: {compared} rows");
    }
}

/// Returns whether a build of the same scene is no dearer and no slower, and better in one.
fn is_on_front(row: &Row, rows: &[Row]) -> bool {
    let [seconds, cost] = ["build_seconds", "cost_over_base"].map(|column| number_in(row, column));
    !rows.iter().any(|other| {
        let of_other = number_in(other, "build_seconds");
        let cost_of_other = number_in(other, "cost_over_base");
        let is_no_worse = of_other <= seconds && cost_of_other <= cost;
        other["scene"] == row["scene"]
            && is_no_worse
            && (of_other < seconds || cost_of_other < cost)
    })
}

#[test]
fn below_ten_milliseconds_most_trees_on_the_front_are_from_obvhs() {
    readme_says(
        "Below ten milliseconds most of the trees on the front of cost and time are from obvhs \
         (AMD EPYC, family 25, models 1 and 17).",
    );
    for processor in ["amd-epyc-25-1", "amd-epyc-25-17"] {
        let rows = rows(&format!("peers/{processor}/timing_pareto.csv"), "*");
        let mut front = 0;
        let mut from_obvhs = 0;
        for row in &rows {
            let is_fast = number_in(row, "build_seconds").unwrap() < 0.01;
            if is_fast && is_on_front(row, &rows) {
                front += 1;
                from_obvhs += usize::from(row["method"].starts_with("obvhs"));
            }
        }
        assert!(2 * from_obvhs > front, "{processor}: {from_obvhs} of {front}");
    }
}

#[test]
fn the_cheapest_trees_of_obvhs_take_less_than_a_second() {
    readme_says("is 3.5 to 6.5 % below the cheapest tree of obvhs, which takes 0.01 to 0.75 s;");
    let mut cheapest: BTreeMap<String, [f64; 2]> = BTreeMap::new();
    for row in rows("peers/amd-epyc-25-1/timing_pareto.csv", "*") {
        if row["method"].starts_with("obvhs") {
            let build =
                ["cost_over_base", "build_seconds"].map(|column| number_in(&row, column).unwrap());
            let known = cheapest.entry(row["scene"].clone()).or_insert(build);
            if build[0] < known[0] {
                *known = build;
            }
        }
    }
    let mut seconds: Vec<f64> =
        cheapest.values().map(|[_, seconds]| (seconds * 100.0).round() / 100.0).collect();
    seconds.sort_by(f64::total_cmp);
    assert_eq!((seconds[0], seconds[3]), (0.01, 0.75));
}

#[test]
fn one_thread_with_more_time_is_below_two_threads_in_two_rows() {
    page_says(
        "docs/BENCHMARKS.md",
        "In 2 of 9 rows the interval of one thread with 1.8 times the time lies below the interval \
         of two threads.",
    );
    let file = "threads/timing_threads.csv";
    let mut below = 0;
    for scene in ["kitchen", "sponza", "cloister"] {
        for limit in ["1.0", "3.0", "10.0"] {
            let [one, two] = ["1 thread\\, 1.8 times the time", "2 threads"].map(|run| {
                let conditions = format!("scene={scene}, limit_seconds={limit}, run={run}");
                sorted(file, &conditions, "cost_over_base")
            });
            below += usize::from(one.last() < two.first());
        }
    }
    assert_eq!(below, 2);
}

#[test]
fn best_for_ten_seconds_comes_near_the_best_known_tree_later_than_shorter_plans() {
    page_says(
        "docs/METHODS.md",
        "`best, 10 s` comes within 1 % of the best known tree later than `best, no end`, and than \
         `best, 1 s` where that comes so near",
    );
    let rows = rows("anytime/timing_to_target.csv", "target=best known +1 %");
    let median = |scene: &str, method: &str| {
        let row = rows.iter().find(|row| row["scene"] == scene && row["method"] == method);
        number_in(row.unwrap(), "median")
    };
    for row in rows.iter().filter(|row| row["method"] == "best, 10 s") {
        let scene = row["scene"].as_str();
        let planned = number_in(row, "median").unwrap();
        assert!(median(scene, "best, no end").unwrap() < planned, "{scene}");
        assert!(median(scene, "best, 1 s").is_none_or(|short| short < planned), "{scene}");
    }
}

/// Returns the method with the lowest median gap on every scene.
fn lowest_at_the_end() -> BTreeMap<String, String> {
    let mut lowest: BTreeMap<String, (f64, String)> = BTreeMap::new();
    for row in rows("anytime/numbers.csv", "*") {
        let gap = number_in(&row, "gap_median").unwrap();
        let best = lowest.entry(row["scene"].clone()).or_insert((f64::INFINITY, String::new()));
        if gap < best.0 {
            *best = (gap, row["method"].clone());
        }
    }
    lowest.into_iter().map(|(scene, (_, method))| (scene, method)).collect()
}

#[test]
fn the_methods_page_names_the_searches_that_end_lowest() {
    page_says(
        "docs/METHODS.md",
        "the lowest median of all searches is the median of `best, 10 s` on 4 of the 7 scenes, of \
         `best, no end` on konistil and sponza, and of ruin and recreate on cloister.",
    );
    let mut lowest = lowest_at_the_end();
    assert_eq!(lowest.remove("cloister").as_deref(), Some("ruin and recreate"));
    for scene in ["konistil", "sponza"] {
        assert_eq!(lowest.remove(scene).as_deref(), Some("best, no end"), "{scene}");
    }
    let others: Vec<&str> = lowest.values().map(String::as_str).collect();
    assert_eq!(others, ["best, 10 s"; 4]);
}

#[test]
fn the_minute_and_its_shorter_runs_are_of_the_processor_that_the_pages_name() {
    for experiment in ["anytime", "anytime_long"] {
        let path = top().join(format!("results/{experiment}/provenance.toml"));
        let provenance: toml::Table = std::fs::read_to_string(path).unwrap().parse().unwrap();
        let cpu = provenance["cpu"].as_str().unwrap();
        assert!(cpu.starts_with("AMD EPYC (family 25, model 17)"), "{experiment}: {cpu}");
        let build = provenance["build"].as_str().unwrap();
        assert!(build.contains("target features fxsr,sse,sse2,"), "{experiment}: {build}");
    }
}

#[test]
fn the_pages_name_the_scenes_whose_best_known_tree_is_one_of_the_runs_shown() {
    let mut scenes = BTreeSet::new();
    for experiment in ["anytime", "anytime_long"] {
        let references =
            rows(&format!("{experiment}/references.csv"), "objective=goldsmith_salmon");
        for row in rows(&format!("{experiment}/runs.csv"), "*") {
            let reference = references.iter().find(|reference| reference["scene"] == row["scene"]);
            if reference.is_some_and(|reference| reference["cost"] == row["cost"]) {
                scenes.insert(row["scene"].clone());
            }
        }
    }
    let scenes: Vec<String> = scenes.into_iter().collect();
    let [first, second, third] = &scenes[..] else { panic!("three scenes, not {scenes:?}") };
    page_says(
        "docs/METHODS.md",
        &format!("on {first}, {second} and {third} one of the five runs that are shown"),
    );
    readme_says("on some scenes one of the five");
}

#[test]
fn ctrl_c_ends_a_bake_of_five_million_triangles_within_a_second() {
    let seconds = sorted("interrupt/timing_interrupt.csv", "scene=city:5000000", "seconds");
    assert!(seconds.len() >= 12);
    assert!(*seconds.last().unwrap() < 1.0, "{seconds:?}");
}
