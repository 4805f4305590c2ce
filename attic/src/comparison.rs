//! Rays per second of all libraries for comparison: every mode on every scene, and geometric means
//! over the scenes.

use crate::rows::{PeerRayRow, RayRatioRow};
use crate::tracing::layout::{COMPILED, is_double, is_repeat, is_single};
use crate::tracing::speed::Traced;
use harness::processor::PROCESSOR;
use harness::statistics::{self, geometric_mean, range};
use std::collections::{BTreeMap, BTreeSet};

/// The value of the column `scene` in rows that are means over all scenes.
pub const MEAN: &str = "geometric mean";

/// The library of our own contenders.
pub const OURS: &str = "ours";

/// The largest accepted share of wrong answers is one in this number of rays. The time of a
/// contender above it is meaningless: tinybvh's packets overflow their stack in deep trees.
const WRONG_AT_MOST_ONE_IN: u64 = 100;

/// One contender's rays of one kind on one scene.
pub struct Raced<'a> {
    /// The contender's library, or [`OURS`].
    pub library: String,
    /// The seconds in which a tree of ours was built, to which its layout's are added.
    pub search_seconds: f64,
    /// Answers and seconds.
    pub traced: &'a Traced,
}

/// The speed of one contender on one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Speed {
    /// The row of `timing_rays.csv`.
    pub row: PeerRayRow,
    /// Million rays per second of each turn.
    pub turns: Vec<f64>,
}

/// Returns the speeds of contenders that did not fail.
pub fn speeds(raced: &[Raced]) -> Vec<Speed> {
    let speed_of = |raced: &Raced| {
        let traced = raced.traced;
        let Traced { answers, times, .. } = traced;
        let library = raced.library.clone();
        let mode = if library == answers.method {
            answers.layout.clone()
        } else {
            format!("{}: {}", answers.method, answers.layout)
        };
        // Our trees come ready-made, so the seconds of their search are added; libraries build
        // theirs here.
        let build_seconds = match library.as_str() {
            OURS => raced.search_seconds + times.preparation_seconds,
            _ => times.preparation_seconds,
        };
        let million = times.count as f64 * 1e-6;
        Speed {
            row: PeerRayRow {
                scene: answers.scene.clone(),
                processor: PROCESSOR.name(),
                instructions: traced.instructions.clone(),
                library,
                version: traced.version.clone(),
                mode,
                rays: answers.rays.clone(),
                million_per_s: million / times.seconds,
                build_seconds,
                disagreements: wrong_answers(traced),
            },
            turns: traced.turns.iter().map(|seconds| million / seconds).collect(),
        }
    };
    raced
        .iter()
        .filter(|Raced { traced, .. }| {
            wrong_answers(traced) * WRONG_AT_MOST_ONE_IN <= traced.answers.count
        })
        .map(speed_of)
        .collect()
}

fn wrong_answers(traced: &Traced) -> u64 {
    let answers = &traced.answers;
    answers.missed_hits + answers.false_hits + answers.other_hits
}

/// Returns the rows of `timing_rays.csv`: all speeds, and for every contender and kind of rays that
/// all scenes have, the geometric mean of the speeds and the sum of disagreements.
pub fn rows(speeds: &[Speed]) -> Vec<PeerRayRow> {
    let rows: Vec<PeerRayRow> = speeds.iter().map(|speed| speed.row.clone()).collect();
    let scenes: BTreeSet<&str> = rows.iter().map(|row| row.scene.as_str()).collect();
    let mut groups: BTreeMap<[&str; 4], Vec<usize>> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        groups
            .entry([&row.instructions, &row.library, &row.mode, &row.rays])
            .or_default()
            .push(index);
    }
    let mut complete: Vec<Vec<usize>> = groups
        .into_values()
        // A mean over fewer scenes would not be comparable with the other means.
        .filter(|group| group.len() == scenes.len())
        .collect();
    complete.sort();
    let mean = |group: &Vec<usize>| {
        let of_group: Vec<&PeerRayRow> = group.iter().map(|&index| &rows[index]).collect();
        let speeds: Vec<f64> = of_group.iter().map(|row| row.million_per_s).collect();
        PeerRayRow {
            scene: MEAN.into(),
            million_per_s: geometric_mean(&speeds),
            build_seconds: statistics::mean(of_group.iter().map(|row| row.build_seconds)),
            disagreements: of_group.iter().map(|row| row.disagreements).sum(),
            ..of_group[0].clone()
        }
    };
    let means: Vec<PeerRayRow> = complete.iter().map(mean).collect();
    [rows, means].concat()
}

/// Returns true for the modes that ours are compared with.
type IsRival = fn(&PeerRayRow) -> bool;

/// The modes of other libraries that ours are compared with.
const AGAINST: [(&str, IsRival); 5] = [
    ("any mode", |_| true),
    ("single calls", |row| is_single(&row.mode)),
    ("whole triangles", |row| !row.mode.contains("splits") && !is_split_by_embree(row)),
    ("embree in double", |row| row.library == "embree" && is_double(&row.mode)),
    ("robust", |row| row.library == "embree" && row.mode.contains("robust")),
];

/// Embree's high quality divides triangles, unless its answers have to be robust.
fn is_split_by_embree(row: &PeerRayRow) -> bool {
    row.library == "embree" && row.mode.starts_with("high") && !row.mode.contains("robust")
}

/// Returns, for each of our modes and kinds of rays, the speed divided by the speed of the fastest
/// third-party mode limited to the same instruction set: scene by scene, and the geometric mean.
pub fn ratios(speeds: &[Speed]) -> Vec<RayRatioRow> {
    let mut groups: BTreeMap<[&str; 3], Vec<&Speed>> = BTreeMap::new();
    let mut order = Vec::new();
    for speed in speeds
        .iter()
        .filter(|speed| speed.row.library == OURS && speed.row.instructions != COMPILED)
    {
        // Ratios are formed within one instruction set, to which all contenders are held.
        let key = [&speed.row.instructions, &speed.row.mode, &speed.row.rays].map(String::as_str);
        let group = groups.entry(key).or_insert_with(|| {
            order.push(key);
            Vec::new()
        });
        group.push(speed);
    }
    let mut rows = Vec::new();
    for key in order {
        for (against, is_rival) in AGAINST {
            let scenes: Vec<OverFastest> = groups[&key]
                .iter()
                .filter_map(|own| over_fastest(own, speeds, against, is_rival))
                .collect();
            rows.extend(scenes.iter().map(|over| over.row.clone()));
            rows.extend(mean_ratio(&scenes));
        }
    }
    for row in &mut rows {
        row.ratio = to_six_decimals(row.ratio);
        row.least_turn = to_six_decimals(row.least_turn);
        row.greatest_turn = to_six_decimals(row.greatest_turn);
        row.ratio_without = row.ratio_without.map(to_six_decimals);
    }
    rows
}

/// Rounds a ratio of speeds, which repeats to a percent.
fn to_six_decimals(ratio: f64) -> f64 {
    (ratio * 1e6).round() / 1e6
}

/// The ratio of our speed on one scene to the fastest rival's, over all turns and for each turn.
struct OverFastest {
    row: RayRatioRow,
    turns: Vec<f64>,
}

fn over_fastest(
    own: &Speed,
    speeds: &[Speed],
    against: &str,
    is_rival: IsRival,
) -> Option<OverFastest> {
    // A library without separate code for instruction sets is a rival under each of them.
    let accepted_instructions = [COMPILED, own.row.instructions.as_str()];
    let fastest = speeds
        .iter()
        .filter(|rival| rival.row.library != OURS && is_rival(&rival.row))
        .filter(|rival| rival.row.scene == own.row.scene && rival.row.rays == own.row.rays)
        .filter(|rival| is_double(&rival.row.mode) == is_double(&own.row.mode))
        .filter(|rival| accepted_instructions.contains(&rival.row.instructions.as_str()))
        .max_by(|a, b| a.row.million_per_s.total_cmp(&b.row.million_per_s))?;
    let turns: Vec<f64> =
        own.turns.iter().zip(&fastest.turns).map(|(own, rival)| own / rival).collect();
    let ratio = own.row.million_per_s / fastest.row.million_per_s;
    let (least_turn, greatest_turn) = range(turns.iter().copied()).unwrap_or((ratio, ratio));
    let row = RayRatioRow {
        scene: own.row.scene.clone(),
        processor: format!("{}, {}", own.row.processor, own.row.instructions),
        mode: own.row.mode.clone(),
        against: against.into(),
        fastest: format!("{} {}", fastest.row.library, fastest.row.mode),
        rays: own.row.rays.clone(),
        ratio,
        least_turn,
        greatest_turn,
        build_seconds: own.row.build_seconds,
        carried_by: String::new(),
        ratio_without: None,
    };
    Some(OverFastest { row, turns })
}

/// Returns the geometric mean over scenes, with and without the scene that raises it most.
fn mean_ratio(scenes: &[OverFastest]) -> Option<RayRatioRow> {
    let carrier = scenes.iter().max_by(|a, b| a.row.ratio.total_cmp(&b.row.ratio))?;
    let ratios: Vec<f64> = scenes.iter().map(|over| over.row.ratio).collect();
    let ratio = geometric_mean(&ratios);
    let without: Vec<f64> = scenes
        .iter()
        .filter(|over| over.row.scene != carrier.row.scene)
        .map(|over| over.row.ratio)
        .collect();
    let turn_count = scenes.iter().map(|over| over.turns.len()).min().unwrap_or(0);
    let turn_means = (0..turn_count).map(|turn| {
        let ratios: Vec<f64> = scenes.iter().map(|over| over.turns[turn]).collect();
        geometric_mean(&ratios)
    });
    let (least_turn, greatest_turn) = range(turn_means).unwrap_or((ratio, ratio));
    Some(RayRatioRow {
        scene: MEAN.into(),
        fastest: String::new(),
        ratio,
        least_turn,
        greatest_turn,
        build_seconds: statistics::mean(scenes.iter().map(|over| over.row.build_seconds)),
        carried_by: carrier.row.scene.clone(),
        ratio_without: (!without.is_empty()).then(|| geometric_mean(&without)),
        ..carrier.row.clone()
    })
}

/// Returns lines for the terminal: for every instruction set and kind of rays, the ratio of our
/// fastest mode to the fastest third-party mode.
pub fn text(ratios: &[RayRatioRow]) -> String {
    let mut text = String::from("Our speed over the fastest mode of any other library:\n");
    let groups: BTreeSet<[&str; 2]> =
        ratios.iter().map(|row| [row.processor.as_str(), row.rays.as_str()]).collect();
    for [processor, kind] in groups {
        let group: Vec<&RayRatioRow> = ratios
            .iter()
            .filter(|row| row.processor == processor && row.rays == kind)
            .filter(|row| row.against == AGAINST[0].0 && !is_repeat(&row.mode))
            .collect();
        let best_mean =
            group.iter().filter(|row| row.scene == MEAN).max_by(|a, b| a.ratio.total_cmp(&b.ratio));
        let Some(mean) = best_mean else { continue };
        let least = group
            .iter()
            .filter(|row| row.mode == mean.mode)
            .min_by(|a, b| a.ratio.total_cmp(&b.ratio));
        if let Some(least) = least {
            text += &format!(
                "  {processor}, {kind}: {:.2} ({}), least {:.2} on {}\n",
                mean.ratio, mean.mode, least.ratio, least.scene
            );
        }
    }
    text
}

#[cfg(test)]
mod tests;
