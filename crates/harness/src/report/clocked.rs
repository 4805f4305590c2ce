//! What runs that the clock ends came to, beside another library: a table for the terminal, as nothing else repeats.

use super::TEXT_FILE;
use super::output::Output;
use crate::Error;
use crate::run::rows::{self, ClockedPeerRow, ClockedRow};
use crate::run::store::Store;
use crate::statistics::{median, minimum};
use std::collections::BTreeSet;

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

/// Makes the table from the CSV files in the store's folder. Returns its text, which [`TEXT_FILE`] keeps.
pub fn write(store: &Store) -> Result<String, Error> {
    let runs: Vec<ClockedRow> = rows::read_if_any(store.folder())?;
    let peers: Vec<ClockedPeerRow> = rows::read_if_any(store.folder())?;
    let mut seen = BTreeSet::new();
    let first = runs.iter().filter(|run| seen.insert((&run.scene, &run.method)));
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
    let order: Vec<&str> = runs.iter().map(|run| run.scene.as_str()).collect();
    lines.sort_by_key(|line| order.iter().position(|scene| *scene == line.scene));
    let mut output = Output::new("", "After so many seconds");
    let explanation = "Medians of runs that the clock ended; the surface area heuristic has both constants 1 and the best leaves:";
    output.show(
        explanation,
        &lines,
        &[
            "scene",
            "method",
            "runs",
            "seconds",
            "references_per_object",
            "cost_over_base",
            "collapsed_sah",
            "least_collapsed_sah",
        ],
    )?;
    let text = output.text();
    store.write(TEXT_FILE, text.as_bytes())?;
    Ok(text)
}

/// All runs of the scene and the method of `first`.
fn line(first: &ClockedRow, runs: &[ClockedRow]) -> Line {
    let same = |run: &&ClockedRow| run.scene == first.scene && run.method == first.method;
    let of = |value: fn(&ClockedRow) -> f64| runs.iter().filter(same).map(value).collect::<Vec<f64>>();
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
