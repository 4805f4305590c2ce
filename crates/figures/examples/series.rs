//! Draws counts that a CSV file records commit by commit, each over the first count of its name:
//! `cargo run -p figures --example series -- COUNTS.csv FIGURE.svg`.

use figures::{Axis, Figure, Layer, Marks, Panel};
use std::collections::BTreeMap;
use std::error::Error;
use std::{env, fs};

/// The counts of one name: the index of the commit, and the number of instructions.
type Series = Vec<(usize, f64)>;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [counts, drawing] = &arguments[..] else {
        return Err("expected COUNTS.csv FIGURE.svg".into());
    };
    let figure = figure(&fs::read_to_string(counts)?)?;
    fs::write(drawing, figures::svg(&figure)?)?;
    Ok(())
}

/// Reads lines `commit,rustc,kernel,name,instructions` in the order of the commits.
fn figure(text: &str) -> Result<Figure, Box<dyn Error>> {
    let mut commits: Vec<String> = Vec::new();
    let mut series: BTreeMap<&str, Series> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let [commit, _rustc, _kernel, name, count] = line.split(',').collect::<Vec<_>>()[..] else {
            return Err(format!("{line}: expected five columns").into());
        };
        if commits.last().is_none_or(|last| last != commit) {
            commits.push(commit.to_owned());
        }
        series.entry(name).or_default().push((commits.len() - 1, count.parse()?));
    }
    let mut layers = vec![Layer::new("", Marks::HLine(1.0))];
    for (name, counts) in series {
        let first = counts[0].1;
        let points: Vec<(f64, f64)> =
            counts.iter().map(|(commit, count)| (*commit as f64, count / first)).collect();
        layers.push(Layer::new(name, Marks::Line(points.clone())));
        layers.push(Layer::new(name, Marks::Points(points)));
    }
    let panel = Panel {
        x: Axis::categories("commit", commits),
        y: Axis::linear("instructions over the first count"),
        layers,
        ..Panel::default()
    };
    Ok(Figure {
        title: "Instructions by commit".into(),
        caption: "Each line is one program on one scene, with one thread. Lower is faster.".into(),
        columns: 1,
        panels: vec![panel],
        ..Figure::default()
    })
}
