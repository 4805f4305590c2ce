//! The report of the suite of stiff and extreme cases.

use super::data::distinct;
use super::output::{Output, panel};
use crate::Error;
use crate::rows::{read, to_bytes};
use bvh_stress::{Cell, Class, KINDS};
use figures::{Axis, Layer, Marks, Panel, Unit};
use std::path::Path;

/// The file of the suite's rows.
pub(crate) const CELLS: &str = "cells.csv";

/// Makes the summary, the table of broken promises and the figure from the rows in the folder.
pub(super) fn output(folder: &Path) -> Result<Output, Error> {
    let cells: Vec<Cell> = read(&folder.join(CELLS))?;
    let cells_with =
        |outcome| cells.iter().filter(|cell| cell.outcome == outcome).collect::<Vec<&Cell>>();
    let broken = cells_with(Class::Broken);
    let worst = cells.iter().filter_map(|cell| cell.relative_error).fold(0.0, f64::max);
    let cases = distinct(cells.iter().map(|cell| &cell.scene)).len();
    let title = format!(
        "{} checks on {cases} stiff and extreme cases: {} as promised, {} with the error promised, \
         {} broken. Largest error of a cost: {worst:.1e}.",
        cells.len(),
        cells_with(Class::Kept).len(),
        cells_with(Class::Refused).len(),
        broken.len(),
    );
    let mut output = Output::new("", &title);
    if !broken.is_empty() {
        let bytes = to_bytes(&broken, Path::new(CELLS))?;
        output.unwritten.push(("Broken promises".into(), bytes));
    }
    let methods = distinct(cells.iter().map(|cell| cell.method.as_str()));
    let caption = format!(
        "A mark per case and method; none where the case has no check of it. From the left: {}.",
        methods.join(" · ")
    );
    output.add_figure("matrix", &caption, 1, panels(&cells));
    Ok(output)
}

/// The outcomes by the name of their colour.
const OUTCOMES: [(&str, Class); 3] = [
    ("valid tree or right answer", Class::Kept),
    ("refused with the promised error", Class::Refused),
    ("broken promise", Class::Broken),
];

/// One panel per kind of cases: a row per case and a column per method.
fn panels(cells: &[Cell]) -> Vec<Panel> {
    let methods = distinct(cells.iter().map(|cell| &cell.method));
    let mut panels = Vec::new();
    for (name, ids) in KINDS {
        let is_own = |cell: &&Cell| ids.iter().any(|id| cell.scene.starts_with(id));
        let own: Vec<&Cell> = cells.iter().filter(is_own).collect();
        let scenes = distinct(own.iter().map(|cell| cell.scene.as_str()));
        let mut layers = Vec::new();
        for (name, outcome) in OUTCOMES {
            let place = |cell: &&Cell| {
                let column = methods.iter().position(|method| **method == cell.method)?;
                let row = scenes.iter().position(|scene| *scene == cell.scene)?;
                Some((column as f64, row as f64))
            };
            let own = own.iter().filter(|cell| cell.outcome == outcome);
            let points: Vec<_> = own.filter_map(place).collect();
            if !points.is_empty() {
                layers.push(Layer::new(name, Marks::Points(points)));
            }
        }
        if layers.is_empty() {
            continue;
        }
        let names = scenes.iter().map(|scene| scene.get(4..).unwrap_or_default().to_owned());
        let x = Axis::linear("").unit(Unit::Bare).range(-1.5, methods.len() as f64 + 0.5);
        panels.push(panel(name, x, Axis::rows(names.collect(), 20.0), layers));
    }
    panels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_title_and_the_figure_tell_a_broken_promise() {
        let cell = |scene: &str, outcome| Cell {
            scene: scene.into(),
            method: "grasp".into(),
            outcome,
            ..Cell::default()
        };
        let made = |last| {
            let folder = tempfile::tempdir().unwrap();
            let cells = [cell("S01 empty", Class::Kept), cell("S02 one object", last)];
            let path = folder.path().join(CELLS);
            std::fs::write(&path, to_bytes(&cells, &path).unwrap()).unwrap();
            output(folder.path()).unwrap()
        };
        assert!(made(Class::Kept).heading.contains(" 0 broken"));
        assert!(made(Class::Broken).heading.contains(" 1 broken"));
        let figure = made(Class::Broken).figures.remove(0).1;
        let layers = figure.panels[0].layers.iter().map(|layer| layer.name.as_str());
        assert_eq!(layers.collect::<Vec<_>>(), [OUTCOMES[0].0, OUTCOMES[2].0]);
    }
}
