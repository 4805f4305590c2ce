//! Rays per second of all libraries side by side: every mode on every scene, and geometric means over the scenes.

use crate::run::rows::{PeerRayRow, TraceRow, TraceTimeRow};
use crate::statistics::geometric_mean;
use std::collections::BTreeMap;

/// The library of our own contenders.
pub const OURS: &str = "ours";

/// The name in the column `scene` of rows that are means over all scenes.
pub const MEAN: &str = "geometric mean";

/// Most of a contender's answers that may be wrong: one in so many rays. What answers worse has failed, and so has its time:
/// tinybvh's packets overflow their stack in deep trees.
const WRONG_AT_MOST_ONE_IN: u64 = 100;

/// The rows of `rays.csv`, without contenders that failed. `traces` and `times` are rows of the same contenders in the same order; `library_of` names the
/// library of a method's label.
pub fn rows(
    traces: &[TraceRow],
    times: &[TraceTimeRow],
    library_of: impl Fn(&str) -> String,
) -> Vec<PeerRayRow> {
    let row = |(trace, time): (&TraceRow, &TraceTimeRow)| {
        let library = library_of(&trace.method);
        let mode = if library == trace.method {
            trace.layout.clone()
        } else {
            format!("{}: {}", trace.method, trace.layout)
        };
        PeerRayRow {
            scene: trace.scene.clone(),
            library,
            mode,
            rays: trace.rays.clone(),
            million_per_s: time.count as f64 * 1e-6 / time.seconds,
            disagreements: trace.missed_hits + trace.false_hits + trace.other_hits,
        }
    };
    let answers = |(trace, _): &(&TraceRow, &TraceTimeRow)| {
        (trace.missed_hits + trace.false_hits + trace.other_hits) * WRONG_AT_MOST_ONE_IN <= trace.count
    };
    let mut rows: Vec<PeerRayRow> = traces.iter().zip(times).filter(answers).map(row).collect();
    rows.extend(means(&rows));
    rows
}

/// For every mode and kind of rays that all scenes have, the geometric mean of the speeds and all disagreements.
fn means(rows: &[PeerRayRow]) -> Vec<PeerRayRow> {
    let scenes = rows.iter().map(|row| &row.scene).collect::<std::collections::BTreeSet<_>>().len();
    let mut groups: BTreeMap<(&str, &str, &str), (usize, Vec<&PeerRayRow>)> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        let group = groups.entry((&row.library, &row.mode, &row.rays)).or_insert((index, vec![]));
        group.1.push(row);
    }
    let mut complete: Vec<_> = groups.into_values().filter(|(_, rows)| rows.len() == scenes).collect();
    complete.sort_by_key(|(first, _)| *first);
    let mean = |(_, rows): (usize, Vec<&PeerRayRow>)| PeerRayRow {
        scene: MEAN.into(),
        million_per_s: geometric_mean(&rows.iter().map(|row| row.million_per_s).collect::<Vec<_>>()),
        disagreements: rows.iter().map(|row| row.disagreements).sum(),
        ..rows[0].clone()
    };
    complete.into_iter().map(mean).collect()
}

/// Lines for the terminal: for every scene and kind of rays our fastest mode, the fastest of other libraries, and the
/// ratio of their speeds; then the geometric means of these ratios.
pub fn text(rows: &[PeerRayRow]) -> String {
    let mut kinds: Vec<&str> = Vec::new();
    let mut ratios: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut text = String::from("Million rays per second, ours and the fastest other library:\n");
    for own in rows.iter().filter(|row| row.library == OURS && row.scene != MEAN) {
        let same = |row: &&PeerRayRow| row.scene == own.scene && row.rays == own.rays;
        let fastest = |ours: bool| {
            let of = rows.iter().filter(same).filter(|row| (row.library == OURS) == ours);
            of.max_by(|a, b| a.million_per_s.total_cmp(&b.million_per_s))
        };
        let (Some(ours), Some(theirs)) = (fastest(true), fastest(false)) else { continue };
        if ours != own {
            continue;
        }
        let ratio = ours.million_per_s / theirs.million_per_s;
        text += &format!(
            "  {} {}: {:.2} ({}), {} {:.2} ({}), ratio {ratio:.2}\n",
            ours.scene,
            ours.rays,
            ours.million_per_s,
            ours.mode,
            theirs.library,
            theirs.million_per_s,
            theirs.mode
        );
        if !kinds.contains(&ours.rays.as_str()) {
            kinds.push(&ours.rays);
        }
        ratios.entry(&ours.rays).or_default().push(ratio);
    }
    for kind in kinds {
        let ratios = &ratios[kind];
        text += &format!("  {MEAN} of the ratios, {kind}: {:.2}\n", geometric_mean(ratios));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(scene: &str, library: &str, mode: &str, million_per_s: f64, disagreements: u64) -> PeerRayRow {
        let [scene, library, mode] = [scene, library, mode].map(String::from);
        PeerRayRow { scene, library, mode, rays: "primary".into(), million_per_s, disagreements }
    }

    #[test]
    fn means_are_over_all_scenes_and_disagreements_add_up() {
        let measured = [
            row("a", OURS, "wide", 2.0, 0),
            row("a", "embree", "high", 1.0, 3),
            row("b", OURS, "wide", 8.0, 0),
            row("b", "embree", "high", 4.0, 4),
            row("b", "embree", "robust", 4.0, 0),
        ];
        let means = means(&measured);
        let shown: Vec<_> =
            means.iter().map(|row| (row.library.as_str(), row.million_per_s, row.disagreements)).collect();
        assert_eq!(shown.len(), 2, "a mode that not all scenes have has no mean: {shown:?}");
        assert_eq!((shown[0].0, shown[1].0), (OURS, "embree"));
        assert!((shown[0].1 - 4.0).abs() < 1e-12 && (shown[1].1 - 2.0).abs() < 1e-12 && shown[1].2 == 7);
    }

    #[test]
    fn a_contender_that_answers_wrongly_has_no_speed() {
        let trace = |missed_hits| TraceRow {
            scene: "a".into(),
            method: "tinybvh".into(),
            layout: "packets".into(),
            rays: "primary".into(),
            count: 1000,
            hits: 900,
            missed_hits,
            false_hits: 0,
            other_hits: 0,
            boxes_per_ray: None,
            objects_per_ray: None,
        };
        let time = TraceTimeRow {
            scene: "a".into(),
            method: "tinybvh".into(),
            layout: "packets".into(),
            rays: "primary".into(),
            count: 1000,
            rounds: 1,
            preparation_seconds: 0.0,
            seconds: 1.0,
            median_seconds: 1.0,
        };
        let shown = |missed| rows(&[trace(missed)], std::slice::from_ref(&time), str::to_owned).len();
        assert_eq!((shown(10), shown(11)), (2, 0), "the row and its mean, or nothing");
    }

    #[test]
    fn the_text_compares_our_fastest_mode_with_the_fastest_of_others() {
        let measured = [
            row("a", OURS, "binary", 1.0, 0),
            row("a", OURS, "wide", 3.0, 0),
            row("a", "embree", "high", 2.0, 0),
            row("a", "tinybvh", "BVH8", 1.5, 0),
        ];
        let text = text(&measured);
        assert!(text.contains("a primary: 3.00 (wide), embree 2.00 (high), ratio 1.50"), "{text}");
        assert!(text.contains("of the ratios, primary: 1.50"), "{text}");
    }
}
