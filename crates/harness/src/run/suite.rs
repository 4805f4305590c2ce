//! The measurement of the suite of stiff and extreme cases, which `bvh_stress` declares and checks.

use super::jobs::Jobs;
use crate::Error;
use crate::contestant::{Contestant, Labelled};
use crate::report::suite::CELLS;
use crate::rows::store::Store;
use crate::rows::to_bytes;
use bvh_search::{Method, Observer};
use bvh_stress::{CASES, Case, Effort};
use rayon::prelude::*;
use std::path::Path;

/// Runs the cases that the spec names as scenes (all if it names none) and writes rows.
pub(crate) fn measure(effort: &Effort, jobs: &Jobs, store: &Store) -> Result<(), Error> {
    let named = &jobs.experiment.scenes;
    let cases: Vec<&Case> = CASES
        .iter()
        .filter(|case| named.is_empty() || named.iter().any(|id| id == case.id))
        .collect();
    // Specs accept only methods of ours here.
    let methods: Vec<(String, Method)> = jobs
        .experiment
        .methods
        .iter()
        .filter_map(|Labelled { label, method, .. }| match method {
            Contestant::Ours(method) => Some((label.clone(), method.clone())),
            _ => None,
        })
        .collect();
    let runs = cases.len();
    let cells = cases.par_iter().map(|case| match jobs.watch.cancelled() {
        true => Err(Error::Interrupted { finished: 0, runs }),
        false => Ok(case.cells(&methods, effort)),
    });
    let cells = cells.collect::<Result<Vec<_>, Error>>()?.concat();
    store.write(CELLS, &to_bytes(&cells, Path::new(CELLS))?)
}
