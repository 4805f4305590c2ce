//! The README's result tables are those of the committed results. `UPDATE_README=1 cargo test` rewrites them.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// The committed table of one experiment as Markdown: ours, and the paper's ratios in parentheses.
fn markdown(top: &Path, name: &str) -> String {
    let mut reader = csv::Reader::from_path(top.join("results").join(name).join("table.csv")).unwrap();
    let (mut columns, mut scenes) = (Vec::new(), Vec::new());
    let mut cells = BTreeMap::new();
    let mut has_paper = false;
    for row in reader.deserialize::<BTreeMap<String, String>>() {
        let row = row.unwrap();
        let scene = match row["scene_kind"].as_str() {
            "file" => row["scene"].clone(),
            kind => format!("{} ({kind})", row["scene"]),
        };
        for (list, entry) in [(&mut scenes, &scene), (&mut columns, &row["column"])] {
            if !list.contains(entry) {
                list.push(entry.clone());
            }
        }
        let digits =
            |text: &String| text.parse::<f64>().map_or_else(|_| String::new(), |ratio| format!("{ratio:.3}"));
        let paper = digits(&row["paper_over_base"]);
        has_paper |= !paper.is_empty();
        let paper = if paper.is_empty() { paper } else { format!(" ({paper})") };
        cells.insert((scene, row["column"].clone()), digits(&row["cost_over_base"]) + &paper);
    }
    columns.retain(|column| column != "base");
    let scene = if has_paper { "scene, ours (paper)" } else { "scene" };
    let mut lines = vec![format!("| {scene} | {} |", columns.join(" | "))];
    lines.push(format!("|---|{}", "---|".repeat(columns.len())));
    for scene in scenes {
        let row: Vec<&str> =
            columns.iter().map(|column| cells[&(scene.clone(), column.clone())].as_str()).collect();
        lines.push(format!("| {scene} | {} |", row.join(" | ")));
    }
    lines.join("\n").replace("|S(L) − S(R)|", "\\|S(L) − S(R)\\|").replace("|L|^0.9", "\\|L\\|^0.9")
}

#[test]
fn the_readme_shows_the_committed_tables() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let readme = fs::read_to_string(top.join("README.md")).unwrap();
    let mut expected = readme.clone();
    for name in ["table2", "table3", "table4", "local_search"] {
        let (begin, end) = (format!("<!-- begin {name} -->\n"), format!("<!-- end {name} -->"));
        let start = expected.find(&begin).expect(name) + begin.len();
        let stop = expected.find(&end).expect(name);
        expected.replace_range(start..stop, &(markdown(&top, name) + "\n"));
    }
    if std::env::var_os("UPDATE_README").is_some() {
        fs::write(top.join("README.md"), &expected).unwrap();
    } else {
        assert!(
            readme == expected,
            "README.md differs from results/*/table.csv; UPDATE_README=1 cargo test rewrites it"
        );
    }
}
