//! One entry of a spec's `methods`: what is run, with its label, limits and seeds.

use crate::measure::empirical_cost;
use crate::measure::ray_cost::TrainedOn;
use crate::peers::{Peer, command};
use bvh_config::fault::{self, Fault, Read};
use bvh_config::{Check, Keys, Nested, OutOfRange};
use bvh_core::cost::Objective;
use bvh_search::{Budget, Method, Shortcut};
use serde::{Deserialize, Deserializer, Serialize};
use toml::Table;

/// A method with the label that tables and figures show, and what its entry says besides.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(into = "Table")]
pub struct Labelled {
    /// Unique within the experiment.
    pub label: String,
    /// What is run.
    pub method: Contestant,
    /// The keys of the entry that are no parameters of the method; without the label.
    pub own: Own,
}

/// A method of ours, another library, or a program.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(untagged)]
#[allow(missing_docs, reason = "said above")]
pub enum Contestant {
    Ours(Method),
    Peer(Peer),
    External(command::Config),
}

impl Contestant {
    /// Its name in specs.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Ours(method) => method.name(),
            Self::Peer(peer) => peer.name(),
            Self::External(_) => command::Config::NAME,
        }
    }

    fn read<'de, D: Deserializer<'de>>(
        name: &str,
        parameters: D,
    ) -> Result<Option<Self>, D::Error> {
        match name {
            command::Config::NAME => command::Config::deserialize(parameters)
                .map(|program| Some(Self::External(program))),
            _ if Method::NAMES.contains(&name) => {
                Method::read(name, parameters).map(|method| method.map(Self::Ours))
            }
            _ => Peer::read(name, parameters).map(|peer| peer.map(Self::Peer)),
        }
    }
}

impl Check for Contestant {
    fn faults(&self) -> Vec<OutOfRange> {
        match self {
            Self::Ours(method) => method.faults(),
            Self::Peer(peer) => peer.faults(),
            Self::External(program) => program.faults(),
        }
    }
}

bvh_config::config! { serde;
    /// The keys of an entry besides those of its method.
    pub struct Own {
        /// What tables and figures call the method: unique within the experiment. Default the method's name.
        label: Option<String>;
        /// Limits of its runs besides the experiment's: the lower of both counts. Default none.
        budget: Option<Budget>;
        /// Seconds that each of its runs may take, besides the experiment's `max_seconds`: the lower of both counts. Default none.
        max_seconds: Option<f64>, in 0.001..=1e6;
        /// What its runs do although the scene does not need it, to measure what leaving it out saves. Default nothing.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        keep: Vec<Shortcut>;
        /// Label whose seeds its runs have, for methods that are to differ in nothing else. Default its own.
        seed_as: Option<String>;
        /// Random rays whose mean number of box tests judges the trees of its runs in place of the objective; the costs in
        /// `history.csv` are then such numbers. Default none.
        judge: Option<empirical_cost::Config>, in Nested;
        /// Rays of the experiment's `ray_cost` whose visits take the place of areas in its runs and in their objective; the costs in
        /// `history.csv` are then such numbers. Not for `median_cut`, which compares no sizes of boxes. Default none.
        for_rays: Option<TrainedOn>;
        /// The cost that its runs minimise in place of the experiment's. Default none.
        objective: Option<Objective>;
        /// Maximum number of references per object where objects may be divided among leaves: for `best`. Default none: they may not.
        references: Option<f64>, in 1.0..=16.0;
    }
}

impl Labelled {
    /// Methods that make every tree anew, so that it can be judged as a whole.
    pub(crate) const JUDGED: [&str; 3] = ["genetic", "random_orders", "grasp"];

    /// A method under its own name, without limits.
    pub fn new(method: Method) -> Self {
        Self { label: method.name().into(), method: Contestant::Ours(method), own: Own::default() }
    }

    /// Reads an entry, and finds everything that is wrong with it by itself.
    pub(crate) fn read(mut table: Table) -> Read<Self> {
        let own = Own::KEYS
            .iter()
            .filter_map(|key| table.remove_entry(*key))
            .collect();
        let (own, mut faults) = fault::deserialize::<Own>(own);
        let ours = Method::NAMES.join(", ");
        let libraries = Peer::NAMES.join(", ");
        let accepted =
            || format!("{ours}, the libraries {libraries}, or {}", command::Config::NAME);
        let (method, of_method) = fault::tagged(
            table,
            "method",
            |name, parameters| Contestant::read(name, parameters),
            accepted,
        );
        faults.extend(of_method);
        let labelled = own.zip(method).map(|(mut own, method)| {
            let label = own
                .label
                .take()
                .unwrap_or_else(|| method.name().into());
            Self { label, method, own }
        });
        (labelled, faults)
    }
}

impl<'de> Deserialize<'de> for Labelled {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (read, faults) = Self::read(Table::deserialize(deserializer)?);
        let wrong = || {
            serde::de::Error::custom(
                faults
                    .iter()
                    .map(Fault::to_string)
                    .collect::<String>(),
            )
        };
        read.filter(|_| faults.is_empty())
            .ok_or_else(wrong)
    }
}

impl From<Labelled> for Table {
    fn from(Labelled { label, method, own }: Labelled) -> Self {
        let mut table = Self::try_from(&method).unwrap_or_default();
        table.extend(Self::try_from(&Own { label: Some(label), ..own }).unwrap_or_default());
        table
    }
}
