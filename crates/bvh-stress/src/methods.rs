//! The methods that the suite checks.

use bvh_build::{goldsmith_salmon, median_cut, muller_fellner, ploc, top_down::AreaOnly};
use bvh_search::Method;
use goldsmith_salmon::Descent;
use muller_fellner::Heuristic;

/// The number of objects for which the exact optimum is computed.
pub const EXACT_OBJECTS: usize = 12;

/// Returns true if the method is a builder: one evaluation, no search.
pub fn is_builder(method: &Method) -> bool {
    use Method::{Agglomerative, GoldsmithSalmon, MedianCut, MullerFellner};
    matches!(method, MullerFellner(_) | MedianCut(_) | GoldsmithSalmon(_) | Agglomerative(_))
}

/// Returns every method of the registry and every variant of the builders, with labels.
pub fn methods() -> Vec<(String, Method)> {
    let mut methods: Vec<(String, Method)> =
        Method::all().into_iter().map(|method| (method.name().to_owned(), method)).collect();
    let readings = [
        AreaOnly::Sum,
        AreaOnly::InnerSum,
        AreaOnly::Max,
        AreaOnly::SumOfSquares,
        AreaOnly::Difference,
        AreaOnly::Product,
    ];
    for heuristic in
        readings.map(Heuristic::AreaOnly).into_iter().chain([Heuristic::AreaTimesPower(0.9)])
    {
        let config = muller_fellner::Config { heuristic, ..Default::default() };
        methods.push((format!("muller_fellner, {heuristic:?}"), Method::MullerFellner(config)));
    }
    let longest = median_cut::Config { axis: median_cut::CutAxis::Longest, ..Default::default() };
    methods.push(("median_cut, longest".into(), Method::MedianCut(longest)));
    for (descent, pair_inner) in
        [(Descent::Cost, true), (Descent::Area, false), (Descent::Area, true)]
    {
        let config = goldsmith_salmon::Config { descent, pair_inner };
        methods.push((format!("goldsmith_salmon, {config:?}"), Method::GoldsmithSalmon(config)));
    }
    let narrow = ploc::Config { radius: 1, ..Default::default() };
    methods.push(("agglomerative, radius 1".into(), Method::Agglomerative(narrow)));
    methods
}
