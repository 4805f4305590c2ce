//! Traces rays through the trees of finished runs and, for comparison, with other libraries.

pub mod answers;
pub mod contender;
pub mod layout;
pub mod rays;
pub mod speed;

use crate::comparison::{self, OURS, Raced};
use crate::rows::{TraceRow, TraceTimeRow};
use crate::{RACERS, programs};
use bvh_config::{OutOfRange, fault};
use contender::Contender;
use harness::Error;
use harness::peers::{FirstRun, NamedBytes};
use harness::rows::{Row, to_bytes};
use layout::own_contenders;
use speed::{Config, Traced};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use toml::Table;

/// Returns the table `tracing` of a spec with every default spelled out.
pub fn resolve(keys: Table) -> Result<Table, OutOfRange> {
    let config: Config = fault::deserialize(keys)?;
    Table::try_from(config).map_err(|error| OutOfRange::new("tracing", error, "TOML"))
}

/// Traces rays through the trees of first runs, timed in interleaved rounds.
pub fn trace(
    keys: &Table,
    runs: &[FirstRun],
    cancelled: &dyn Fn() -> bool,
) -> harness::peers::Traced {
    let config: Config =
        fault::deserialize(keys.clone()).map_err(|fault| Error::Usage(fault.to_string()))?;
    let (programs, mut text) = ray_programs(&config);
    let mut traced = Vec::new();
    for runs in runs.chunk_by(|a, b| a.scene.name == b.scene.name) {
        let of_scene = trace_scene(&config, runs, &programs, cancelled)
            .map_err(|message| Error::Tracing { scene: runs[0].scene.name.clone(), message })?;
        let Some(of_scene) = of_scene else { return Ok(None) };
        traced.extend(of_scene);
    }
    let mut files = Vec::new();
    if !config.ray_peers.is_empty() {
        let raced: Vec<Raced> = traced.iter().map(|traced| raced(runs, traced)).collect();
        let speeds = comparison::speeds(&raced);
        let ratios = comparison::ratios(&speeds);
        files.extend([file(&comparison::rows(&speeds))?, file(&ratios)?]);
        text += &comparison::text(&ratios);
    }
    files.extend(rows(runs, traced)?);
    Ok(Some((files, text)))
}

/// Returns the ray programs of other libraries that exist, and remarks on the missing ones.
fn ray_programs(config: &Config) -> (Vec<&PathBuf>, String) {
    // A missing program must not end hours of measurements, so a remark names it.
    let (found, missing): (Vec<_>, Vec<_>) =
        config.ray_peers.iter().partition(|program| program.exists());
    let remarks = missing.iter().map(|program| {
        let program = program.display();
        format!("Without {program}: it does not exist; scripts/ray-peers/build makes it.\n")
    });
    (found, remarks.collect())
}

/// Traces rays through the first trees of all methods on a scene, and with the ray programs.
/// Returns `None` if it is cancelled.
fn trace_scene(
    config: &Config,
    runs: &[FirstRun],
    programs: &[&PathBuf],
    cancelled: &dyn Fn() -> bool,
) -> Result<Option<Vec<Traced>>, String> {
    let FirstRun { scene, tree, seed, .. } = runs[0];
    let triangles = scene.triangles().map_err(|error| error.to_string())?;
    let mut contenders: Vec<(String, Contender)> = Vec::new();
    for run in runs {
        let made = match run.peer.and_then(|peer| Some((peer, racer(peer.name())?))) {
            Some((peer, racer)) => {
                racer.contenders(peer.settings(), triangles).map_err(|fault| fault.to_string())?
            }
            None => {
                let visits = run.visits.as_deref();
                own_contenders(&config.layouts, &config.instructions, scene, run.tree, visits)?
            }
        };
        contenders.extend(made.into_iter().map(|contender| (run.label.to_owned(), contender)));
    }
    for program in programs {
        for (library, contender) in programs::contenders(program, triangles)? {
            // A processor without AVX-512 makes all programs the same.
            let is_known = contenders
                .iter()
                .any(|(known, other)| *known == library && other.is_called_as(&contender));
            if !is_known {
                contenders.push((library, contender));
            }
        }
    }
    speed::measure(config, scene, tree, &contenders, seed, cancelled)
}

fn racer(name: &str) -> Option<&'static dyn crate::Racer> {
    RACERS.iter().find(|racer| racer.name() == name).copied()
}

/// Names the library behind a contender: ours, a method's library, or a library of a ray program.
fn raced<'a>(runs: &[FirstRun], traced: &'a Traced) -> Raced<'a> {
    let TraceRow { scene, method, .. } = &traced.answers;
    let run = runs.iter().find(|run| run.scene.name == *scene && run.label == *method);
    // Our kernels trace the trees of programs.
    let library = run.map_or(method.as_str(), |run| {
        run.peer.map(|peer| peer.name()).filter(|name| racer(name).is_some()).unwrap_or(OURS)
    });
    let search_seconds = run.map_or(f64::NAN, |run| run.search_seconds);
    Raced { library: library.into(), search_seconds, traced }
}

/// Returns the files of the experiment's methods.
fn rows(runs: &[FirstRun], traced: Vec<Traced>) -> Result<[NamedBytes; 2], Error> {
    // These rows are compared with committed ones. They must depend neither on a program that may
    // be missing nor on the instruction sets of this processor.
    let mut seen = BTreeSet::new();
    let mut rows = Vec::new();
    let mut times = Vec::new();
    for Traced { answers, times: row_times, .. } in traced {
        let TraceRow { scene, method, layout, rays, .. } = &answers;
        let key = [scene, method, layout, rays].map(String::clone);
        if runs.iter().any(|run| run.label == *method) && seen.insert(key) {
            rows.push(answers);
            times.push(row_times);
        }
    }
    Ok([file::<TraceRow>(&rows)?, file::<TraceTimeRow>(&times)?])
}

fn file<R: Row>(rows: &[R]) -> Result<NamedBytes, Error> {
    Ok((R::FILE, to_bytes(rows, Path::new(R::FILE))?))
}
