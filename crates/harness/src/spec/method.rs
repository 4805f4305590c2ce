//! One entry of a spec's `methods`: what is run, with its label, limits and seeds.

use crate::peers::Peer;
use bvh_search::{Budget, Method, Omission};
use serde::{Deserialize, Serialize};

/// A method with the label that tables and figures show, by default its name, and limits of its own, if it has any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "toml::Table", into = "toml::Table")]
pub struct Labelled {
    /// Unique within the experiment.
    pub label: String,
    /// What is run.
    pub method: Contestant,
    /// Limits of its runs besides the experiment's: the lower of both counts. Default none.
    pub budget: Option<Budget>,
    /// What its runs do although the scene does not need it, to measure what leaving it out saves. Default nothing.
    pub keep: Vec<Omission>,
    /// Label whose seeds its runs have, for methods that are to differ in nothing else. Default its own.
    pub seed_as: Option<String>,
}

/// A method of ours, or another library.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
#[allow(missing_docs, reason = "said above")]
pub enum Contestant {
    Ours(Method),
    Peer(Peer),
}

impl TryFrom<toml::Table> for Labelled {
    type Error = String;

    fn try_from(mut table: toml::Table) -> Result<Self, String> {
        let known = |name: &String| Method::NAMES.iter().chain(Peer::NAMES).any(|known| known == name);
        let mut text = |key: &str| match table.remove(key) {
            Some(toml::Value::String(text)) => Ok(Some(text)),
            Some(found) => Err(format!("{key} is {found}; accepted: a text")),
            None => Ok(None),
        };
        let (label, seed_as) = (text("label")?, text("seed_as")?);
        let budget = table.remove("budget").map(Budget::deserialize).transpose();
        let budget = budget.map_err(|error| format!("budget: {}", error.message()))?;
        let keep = table.remove("keep").map_or(Ok(vec![]), Vec::deserialize);
        let keep = keep.map_err(|error| format!("keep: {}", error.message()))?;
        let name = match table.get("method") {
            Some(toml::Value::String(name)) if known(name) => name.clone(),
            found => {
                let found = found.map_or_else(|| "is missing".to_owned(), |found| format!("is {found}"));
                let (ours, peers) = (Method::NAMES.join(", "), Peer::NAMES.join(", "));
                return Err(format!("method {found}; accepted: {ours}, or the libraries {peers}"));
            }
        };
        let method = if Method::NAMES.contains(&name.as_str()) {
            Method::deserialize(table).map(Contestant::Ours)
        } else {
            Peer::deserialize(table).map(Contestant::Peer)
        };
        let method = method.map_err(|error| format!("{name}: {}", error.message()))?;
        Ok(Self { label: label.unwrap_or(name), method, budget, keep, seed_as })
    }
}

impl From<Labelled> for toml::Table {
    fn from(labelled: Labelled) -> Self {
        let mut table = Self::try_from(&labelled.method).unwrap_or_default();
        table.insert("label".into(), labelled.label.into());
        if let Some(budget) = labelled.budget.and_then(|budget| toml::Value::try_from(budget).ok()) {
            table.insert("budget".into(), budget);
        }
        if !labelled.keep.is_empty()
            && let Ok(keep) = toml::Value::try_from(labelled.keep)
        {
            table.insert("keep".into(), keep);
        }
        if let Some(label) = labelled.seed_as {
            table.insert("seed_as".into(), label.into());
        }
        table
    }
}
