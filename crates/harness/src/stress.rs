//! The measurement of the suite of stiff and extreme cases, which `bvh_stress` declares and checks.
//!
//! Only the commands and specs that run the suite know it.

use crate::Error;
use crate::contestant::{Contestant, Labelled};
use crate::report::output::Output;
use crate::rows::store::Store;
use crate::rows::{read, to_bytes};
use bvh_config::{Nested, config};
use bvh_stress::{CASES, Case, Cell, Class, Effort, LargerScenes, Size, tracing};
use std::path::Path;

config! {
    serde;
    /// A measurement over the suite, selected by a spec.
    pub struct Measure {
        /// Every case with every method, traversal and part.
        stability: Stability, in Nested;
    }
}

config! {
    serde;
    /// Parameters of the measurement.
    pub struct Stability {
        /// Size of the scenes for builders.
        builders: Size = Size::Many;
        /// Budget of a search: nodes per object that it may make or visit.
        work_per_object: u64 = 1000, in 1..;
        /// Larger scenes for searches, in addition to the scenes of few objects. Default none.
        larger_searches: Option<LargerScenes>;
        /// Rays per scene and traversal.
        rays: usize = 5000, in 1..=100_000_000;
    }
}

impl Stability {
    /// Runs the cases (all if none are named) and writes rows.
    pub fn execute(
        &self,
        cases: &[String],
        methods: &[Labelled],
        store: &Store,
        interrupted: &dyn Fn() -> bool,
    ) -> Result<String, Error> {
        let cases: Vec<&Case> = CASES
            .iter()
            .filter(|case| cases.is_empty() || cases.iter().any(|id| id == case.id))
            .collect();
        let effort = Effort {
            builders: self.builders,
            work_per_object: self.work_per_object,
            larger: self.larger_searches,
        };
        let mut cells = Vec::new();
        for (done, case) in cases.iter().enumerate() {
            if interrupted() {
                return Err(Error::Interrupted { finished: done, runs: cases.len() });
            }
            for Labelled { label, method, .. } in methods {
                // Specs accept only methods of ours here.
                let Contestant::Ours(method) = method else { continue };
                cells.extend(case.of_method(label, method, &effort));
            }
            let ways = tracing::TRAVERSALS.iter();
            cells.extend(ways.filter_map(|(name, way)| case.of_traversal(name, *way, self.rays)));
            cells.extend(case.of_parts());
        }
        store.write("cells.csv", &to_bytes(&cells, Path::new("cells.csv"))?)?;
        Ok(output(store.folder())?.text())
    }
}

const HEADING: &str = "Stiff and extreme cases";

/// Makes the summary and the table of broken promises from the rows in the folder.
pub fn output(folder: &Path) -> Result<Output, Error> {
    let cells: Vec<Cell> = read(&folder.join("cells.csv"))?;
    let cells_with =
        |outcome| cells.iter().filter(|cell| cell.outcome == outcome).collect::<Vec<&Cell>>();
    let broken = cells_with(Class::Broken);
    let worst = cells.iter().filter_map(|cell| cell.relative_error).fold(0.0, f64::max);
    let title = format!(
        "{} cells: {} as promised, {} with the error promised, {} broken. Largest error of a cost: \
         {worst:.1e}.",
        cells.len(),
        cells_with(Class::Kept).len(),
        cells_with(Class::Refused).len(),
        broken.len(),
    );
    let mut output = Output::new(HEADING, &title);
    if !broken.is_empty() {
        output.show("Broken promises:", &broken, "scene method outcome note")?;
    }
    Ok(output)
}
