//! What runs that the clock ends came to, beside another library: a table and a figure.

use super::data::distinct;
use super::prelude::*;
use crate::rows::{self, ClockedPeerRow, ClockedRow};
use crate::statistics::{median, minimum};
use std::collections::BTreeSet;
use std::path::Path;

#[derive(serde::Serialize)]
struct Line {
    scene: String,
    method: String,
    runs: usize,
    seconds: Option<f64>,
    references_per_object: Option<f64>,
    cost_over_base: Option<f64>,
    collapsed_sah: Option<f64>,
    least_collapsed_sah: Option<f64>,
}

/// Makes the table and the figure from the CSV files in a folder.
pub fn output(folder: &Path) -> Result<Output, Error> {
    let runs: Vec<ClockedRow> = rows::read_if_any(folder)?;
    let peers: Vec<ClockedPeerRow> = rows::read_if_any(folder)?;
    let mut seen = BTreeSet::new();
    let first = runs
        .iter()
        .filter(|run| seen.insert((&run.scene, &run.method)));
    let mut lines: Vec<Line> = first.map(|run| line(run, &runs)).collect();
    lines.extend(peers.into_iter().map(|peer| Line {
        scene: peer.scene,
        method: peer.method,
        runs: 1,
        seconds: Some(peer.seconds),
        references_per_object: Some(peer.references_per_object),
        cost_over_base: None,
        collapsed_sah: Some(peer.collapsed_sah),
        least_collapsed_sah: Some(peer.collapsed_sah),
    }));
    let order: Vec<&str> = runs
        .iter()
        .map(|run| run.scene.as_str())
        .collect();
    lines.sort_by_key(|line| {
        order
            .iter()
            .position(|scene| *scene == line.scene)
    });
    let mut output = Output::new("", "After so many seconds");
    let explanation = "Medians of runs that the clock ended; the surface area heuristic has both constants 1 and the best \
                       leaves:";
    output.show(
        explanation,
        &lines,
        "scene method runs seconds references_per_object cost_over_base collapsed_sah least_collapsed_sah",
    )?;
    let scenes = distinct(order.into_iter());
    let methods = distinct(lines.iter().map(|line| line.method.as_str()));
    let of = |scene: &str, method: &str| {
        let own = lines
            .iter()
            .find(|line| line.scene == scene && line.method == method);
        own.and_then(|line| line.collapsed_sah)
            .unwrap_or(f64::NAN)
    };
    let least =
        |scene: &str| minimum(methods.iter().map(|method| of(scene, method))).unwrap_or(f64::NAN);
    let wins = |method: &str| {
        scenes
            .iter()
            .filter(|scene| of(scene, method) == least(scene))
            .count()
    };
    let counts = tally(
        methods
            .iter()
            .map(|method| (*method, wins(method))),
        scenes.len(),
        "scenes",
    );
    output.reading = format!("Lowest median by the surface area heuristic: {counts}.");
    let bars = |method: &&str| {
        let values = scenes
            .iter()
            .map(|scene| of(scene, method) / least(scene))
            .collect();
        Layer::bars(*method, values, 1.0)
    };
    let layers = methods.iter().map(bars).collect();
    let x = Axis::categories(
        "",
        scenes
            .iter()
            .map(|scene| (*scene).to_owned())
            .collect(),
    );
    let caption = "Medians of runs that the clock ended, by the surface area heuristic, over the least of the scene.";
    let y = Axis::linear("cost / least of the scene");
    output.add_figure("timing_runs", caption, 1, vec![panel("", x, y, layers)]);
    Ok(output)
}

/// All runs of the scene and the method of `first`.
fn line(first: &ClockedRow, runs: &[ClockedRow]) -> Line {
    let same = |run: &&ClockedRow| run.scene == first.scene && run.method == first.method;
    let of = |value: fn(&ClockedRow) -> f64| {
        runs.iter()
            .filter(same)
            .map(value)
            .collect::<Vec<f64>>()
    };
    let costs = of(|run| run.collapsed_sah);
    Line {
        scene: first.scene.clone(),
        method: first.method.clone(),
        runs: costs.len(),
        seconds: median(&of(|run| run.seconds)),
        references_per_object: median(&of(|run| run.references_per_object)),
        cost_over_base: median(&of(|run| run.cost_over_base)),
        collapsed_sah: median(&costs),
        least_collapsed_sah: minimum(costs),
    }
}
