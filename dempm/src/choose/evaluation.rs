//! How good the error model is on scenes that it was not fitted to.

use serde::Serialize;

use super::error_model::{ErrorModel, Expected};
use super::family::Family;
use super::library::Case;

/// Groups of scenes that are left out in turn.
const FOLDS: usize = 5;
/// Factor up to which a median counts as right.
pub const FACTOR: f64 = 1.5;

/// Predictions of cases from other scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// The kind of model; `None` for all together.
    pub family: Option<Family>,
    /// What is predicted.
    pub what: &'static str,
    /// Number of cases.
    pub cases: usize,
    /// Share of errors below the bound.
    pub covered: f64,
    /// Share of errors within [`FACTOR`] of the median.
    pub near: f64,
    /// Median over cases of the bound over the expected error.
    pub width: f64,
}

/// A predicted and a measured error (m).
struct Pair {
    family: Family,
    what: &'static str,
    expected: Expected,
    measured: f64,
}

/// Leaves out a fifth of the scenes at a time and predicts them from the others.
///
/// # Errors
/// A sentence, if there are too few scenes.
pub fn evaluate(cases: &[Case]) -> Result<Vec<Evaluation>, String> {
    let mut names: Vec<&str> = cases.iter().map(|case| case.scene.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let fold = |case: &Case| names.partition_point(|name| *name < case.scene.as_str()) % FOLDS;
    let mut pairs = Vec::new();
    for out in 0..FOLDS {
        let known: Vec<Case> = cases.iter().filter(|case| fold(case) != out).cloned().collect();
        let model = ErrorModel::fit(&known, String::new())?;
        for case in cases.iter().filter(|case| fold(case) == out) {
            pairs.extend(of_case(&model, case));
        }
    }
    let groups = [None].into_iter().chain(Family::ALL.map(Some));
    let whats = ["largest", "end", "largest, from a coarser run"];
    let all = groups.flat_map(|family| whats.map(|what| (family, what)));
    Ok(all.filter_map(|(family, what)| summary(&pairs, family, what)).collect())
}

fn of_case(model: &ErrorModel, case: &Case) -> Vec<Pair> {
    let Some(measured) = case.distance else { return Vec::new() };
    let pair = |what, expected, measured| Pair { family: case.family, what, expected, measured };
    let mut pairs = Vec::new();
    if let Some(found) = model.predict(case.family, &case.features, case.height) {
        pairs.push(pair("largest", found.largest, measured.largest));
        pairs.push(pair("end", found.end, measured.end));
    }
    let change = case.change.map(|change| change.largest);
    let expected = change.and_then(|change| model.from_change(case.family, &case.features, change));
    pairs
        .extend(expected.map(|found| pair("largest, from a coarser run", found, measured.largest)));
    pairs
}

fn summary(pairs: &[Pair], family: Option<Family>, what: &'static str) -> Option<Evaluation> {
    let own = pairs
        .iter()
        .filter(|pair| pair.what == what && family.is_none_or(|family| pair.family == family));
    let own: Vec<&Pair> = own.collect();
    let share = |holds: &dyn Fn(&Pair) -> bool| {
        own.iter().filter(|pair| holds(pair)).count() as f64 / own.len() as f64
    };
    let is_near = |pair: &Pair| (pair.measured / pair.expected.median).ln().abs() <= FACTOR.ln();
    let mut widths: Vec<f64> =
        own.iter().map(|pair| pair.expected.bound / pair.expected.median).collect();
    widths.sort_by(f64::total_cmp);
    Some(Evaluation {
        family,
        what,
        cases: own.len(),
        covered: share(&|pair| pair.measured <= pair.expected.bound),
        near: share(&is_near),
        width: *widths.get(own.len() / 2)?,
    })
}
