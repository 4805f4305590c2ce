//! Rays per second of all libraries side by side: every mode on every scene, and geometric means over the scenes.

use crate::run::rows::{PeerRayRow, RayRatioRow, TraceRow, TraceTimeRow};
use crate::statistics::geometric_mean;
use std::collections::BTreeMap;

/// The library of our own contenders.
pub const OURS: &str = "ours";

/// The name in the column `scene` of rows that are means over all scenes.
pub const MEAN: &str = "geometric mean";

/// Most of a contender's answers that may be wrong: one in so many rays. What answers worse has failed, and so has its time:
/// tinybvh's packets overflow their stack in deep trees.
const WRONG_AT_MOST_ONE_IN: u64 = 100;

/// The rows of `timing_rays.csv`, without contenders that failed. `traces` and `times` are rows of the same contenders in the same order; `library_of` names the
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

/// Whether a row is of a mode that one of ours is compared with.
type IsRival = fn(&PeerRayRow) -> bool;

/// The modes of other libraries that ours are compared with.
const AGAINST: [(&str, IsRival); 3] = [
    ("any mode", |_| true),
    ("whole triangles", |row| row.mode != "high" && !row.mode.contains("splits")),
    ("robust", |row| row.library == "embree" && row.mode.contains("robust")),
];

/// For each of our modes and kind of rays, its speed over that of the fastest mode of other libraries: scene by scene, and their
/// geometric mean.
pub fn ratios(rows: &[PeerRayRow]) -> Vec<RayRatioRow> {
    let mut ratios = Vec::new();
    for mean in rows.iter().filter(|row| row.library == OURS && row.scene == MEAN) {
        let of_scenes = |row: &&PeerRayRow| row.scene != MEAN && row.rays == mean.rays;
        let own = rows.iter().filter(of_scenes).filter(|row| row.library == OURS && row.mode == mean.mode);
        for (against, is_rival) in AGAINST {
            let over = |scene: &str, ratio| RayRatioRow {
                scene: scene.into(),
                mode: mean.mode.clone(),
                against: against.into(),
                rays: mean.rays.clone(),
                ratio,
            };
            let of_scene = |own: &PeerRayRow| {
                let rivals = rows.iter().filter(of_scenes).filter(|row| row.scene == own.scene);
                let rivals = rivals.filter(|row| row.library != OURS && is_rival(row));
                let fastest = rivals.map(|row| row.million_per_s).reduce(f64::max)?;
                Some(over(&own.scene, own.million_per_s / fastest))
            };
            let found: Vec<RayRatioRow> = own.clone().filter_map(of_scene).collect();
            if !found.is_empty() {
                let mean = geometric_mean(&found.iter().map(|row| row.ratio).collect::<Vec<_>>());
                ratios.extend(found);
                ratios.push(over(MEAN, mean));
            }
        }
    }
    ratios
}

/// Lines for the terminal: for every kind of rays our fastest mode, over the fastest of other libraries.
pub fn text(ratios: &[RayRatioRow]) -> String {
    let mut text = String::from("Speeds over those of the fastest mode of any other library:\n");
    let mut kinds: Vec<&str> = ratios.iter().map(|row| row.rays.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    for kind in kinds {
        let of_kind = || ratios.iter().filter(|row| row.rays == kind && row.against == AGAINST[0].0);
        let order = |a: &&RayRatioRow, b: &&RayRatioRow| a.ratio.total_cmp(&b.ratio);
        let fastest = of_kind().filter(|row| row.scene == MEAN).max_by(order);
        let of_mode = |mode: &str| of_kind().filter(|row| row.mode == mode).min_by(order);
        if let Some((mean, least)) = fastest.and_then(|mean| Some((mean, of_mode(&mean.mode)?))) {
            let (RayRatioRow { ratio, mode, .. }, least, scene) = (mean, least.ratio, &least.scene);
            text += &format!("  {kind}: {ratio:.2} ({mode}), least {least:.2} on {scene}\n");
        }
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
    fn ratios_are_to_the_fastest_rival_of_each_scene_and_kind() {
        let mut measured = vec![
            row("a", OURS, "wide", 2.0, 0),
            row("a", "embree", "high", 4.0, 0),
            row("a", "embree", "high robust", 1.0, 0),
            row("b", OURS, "wide", 9.0, 0),
            row("b", "embree", "high robust", 1.0, 0),
            row("b", "tinybvh", "BVH8 splits", 4.5, 0),
            row("b", "tinybvh", "BVH8", 3.0, 0),
        ];
        measured.extend(means(&measured));
        let ratios = ratios(&measured);
        let of = |against: &str| -> Vec<(&str, f64)> {
            let of = ratios.iter().filter(|row| row.against == against);
            of.map(|row| (row.scene.as_str(), row.ratio)).collect()
        };
        assert_eq!(of("any mode"), [("a", 0.5), ("b", 2.0), (MEAN, 1.0)]);
        assert_eq!(of("whole triangles")[..2], [("a", 2.0), ("b", 3.0)]);
        assert_eq!(of("robust")[..2], [("a", 2.0), ("b", 9.0)]);
        assert!((of("robust")[2].1 - 18f64.sqrt()).abs() < 1e-12);
        let slower = RayRatioRow { mode: "binary".into(), ratio: 0.4, ..ratios[2].clone() };
        let text = text(&[vec![slower], ratios].concat());
        assert!(text.contains("primary: 1.00 (wide), least 0.50 on a"), "of our fastest mode: {text}");
    }

    #[test]
    fn a_contender_that_answers_wrongly_has_no_speed() {
        let trace = |missed_hits| TraceRow { count: 1000, missed_hits, ..TraceRow::default() };
        let time = TraceTimeRow { count: 1000, seconds: 1.0, ..TraceTimeRow::default() };
        let shown = |missed| rows(&[trace(missed)], std::slice::from_ref(&time), str::to_owned).len();
        assert_eq!((shown(10), shown(11)), (2, 0), "the row and its mean, or nothing");
    }
}
