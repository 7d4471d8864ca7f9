//! The error to expect of a candidate, from cases that were measured.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::conformal::quantile;
use super::family::Family;
use super::features::{ALL, FEW, Features, MEANINGS, NAMES, terms};
use super::library::{Case, Distance};
use super::regression::Regression;

/// The model that ships: `validation fit dempm/src/choose/library.csv`.
const SHIPPED: &str = include_str!("error-model.json");
/// Probability that the error does not exceed the bound.
pub const LEVEL: f64 = 0.9;
/// Groups of scenes, each of which is predicted from the others.
const FOLDS: usize = 10;
/// Penalties that are tried.
const PENALTIES: [f64; 8] = [0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0];
/// Terms that are tried: the first seven, all, all with their products.
const TERMS: [(usize, bool); 3] = [(FEW, false), (ALL, false), (ALL, true)];
/// Share of the mean square error that further terms have to go below.
const GAIN: f64 = 0.9;
/// Scenes without which nothing is fitted.
const LEAST_SCENES: usize = 4;
/// How far beyond the measured range a feature may be, as a share of the range.
const MARGIN: f64 = 0.05;
/// Least error (m) whose logarithm is taken.
const LEAST: f64 = 1.0e-5;

/// What is expected of errors, by the kind of model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorModel {
    /// Where the cases come from, in words.
    pub source: String,
    /// Scenes that were measured.
    pub scenes: usize,
    families: BTreeMap<Family, OfFamily>,
}

/// The same of one family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct OfFamily {
    /// Least and largest value of each feature.
    range: Vec<[f64; 2]>,
    end: Predictor,
    largest: Predictor,
    /// The error from the change to the next coarser candidate; `None` if that was not measured.
    from_change: Option<Predictor>,
}

/// The logarithm of an error over a length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Predictor {
    /// How many of the [`terms`] are used.
    terms: usize,
    regression: Regression,
    /// What cross-validation adds to its median.
    median: f64,
    /// What it adds to that up to the bound.
    bound: f64,
}

/// An expected error (m).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// Half of the errors are smaller.
    pub median: f64,
    /// Nine of ten errors are smaller.
    pub bound: f64,
}

/// What is expected of a candidate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Prediction {
    /// The distance at the end.
    pub end: Expected,
    /// The largest distance over time.
    pub largest: Expected,
    /// Ways in which it lies outside of the measured cases.
    pub beyond: Vec<&'static str>,
}

impl ErrorModel {
    /// The model that ships.
    ///
    /// # Panics
    /// Never: a test reads it.
    pub fn shipped() -> Self {
        serde_json::from_str(SHIPPED).expect("a test reads it")
    }

    /// Fits the model to cases.
    ///
    /// # Errors
    /// A sentence, if there are too few scenes.
    pub fn fit(cases: &[Case], source: String) -> Result<Self, String> {
        let mut names: Vec<&str> = cases.iter().map(|case| case.scene.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        if names.len() < LEAST_SCENES {
            let count = names.len();
            return Err(format!("{count} scenes are too few to fit; at least {LEAST_SCENES}"));
        }
        let mut families = BTreeMap::new();
        for family in Family::ALL {
            let own: Vec<&Case> = cases.iter().filter(|case| case.family == family).collect();
            if let Some(found) = OfFamily::fit(&own) {
                families.insert(family, found);
            }
        }
        Ok(Self { source, scenes: names.len(), families })
    }

    /// What to expect of a candidate with these features on a scene of this height (m); `None` of a family that was
    /// not measured.
    pub fn predict(&self, family: Family, features: &Features, height: f64) -> Option<Prediction> {
        let known = self.families.get(&family)?;
        let beyond = known.range.iter().zip(features).zip(MEANINGS).filter(|((range, x), _)| {
            let margin = MARGIN * (range[1] - range[0]) + 1.0e-9;
            !(range[0] - margin..=range[1] + margin).contains(*x)
        });
        Some(Prediction {
            end: known.end.expected(features, height),
            largest: known.largest.expected(features, height),
            beyond: beyond.map(|(_, meaning)| meaning).collect(),
        })
    }

    /// What the largest change (m) from the next coarser candidate says about the largest distance from the truth.
    pub fn from_change(
        &self,
        family: Family,
        features: &Features,
        change: f64,
    ) -> Option<Expected> {
        let known = self.families.get(&family)?.from_change.as_ref()?;
        Some(known.expected(features, change))
    }
}

impl OfFamily {
    fn fit(cases: &[&Case]) -> Option<Self> {
        let range = |k: usize| {
            let values = cases.iter().map(|case| case.features[k]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
        };
        let of = |value: fn(&Distance) -> f64| {
            let known =
                cases.iter().filter_map(|case| Some((*case, value(&case.distance?), case.height)));
            Predictor::fit(&known.collect::<Vec<_>>())
        };
        let changed = cases
            .iter()
            .filter_map(|case| Some((*case, case.distance?.largest, case.change?.largest)));
        Some(Self {
            range: (0..NAMES.len()).map(range).collect(),
            end: of(|distance| distance.end)?,
            largest: of(|distance| distance.largest)?,
            from_change: Predictor::fit(&changed.collect::<Vec<_>>()),
        })
    }
}

impl Predictor {
    /// From cases with their errors and lengths (m). Products and penalty are those with which scenes are predicted
    /// best from others.
    fn fit(cases: &[(&Case, f64, f64)]) -> Option<Self> {
        let folds = Folds::of(cases.iter().map(|(case, _, _)| case.scene.as_str()));
        if folds.scenes < LEAST_SCENES {
            return None;
        }
        let rows: Vec<[f64; ALL]> =
            cases.iter().map(|(case, _, _)| terms(&case.features)).collect();
        let answer =
            |(_, error, length): &(&Case, f64, f64)| (error.max(LEAST) / length.max(LEAST)).ln();
        let answers: Vec<f64> = cases.iter().map(answer).collect();
        let mut best: Option<(usize, f64, Self)> = None;
        for (set, (terms, with_products)) in TERMS.into_iter().enumerate() {
            let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..terms]).collect();
            let products = if with_products { pairs(terms) } else { Vec::new() };
            for penalty in PENALTIES {
                let Some(errors) = folds.errors(&rows, &answers, &products, penalty) else {
                    continue;
                };
                let square: f64 = errors.iter().map(|error| error * error).sum();
                // Further terms have to pay.
                let is_better = |(last, least, _): &(usize, f64, Self)| {
                    square < if set > *last { GAIN * least } else { *least }
                };
                if best.as_ref().is_none_or(is_better) {
                    let regression = Regression::fit(&rows, &answers, &products, penalty)?;
                    let median = quantile(&errors, 0.5)?;
                    let bound = quantile(&errors, LEVEL)? - median;
                    best = Some((set, square, Self { terms, regression, median, bound }));
                }
            }
        }
        Some(best?.2)
    }

    fn expected(&self, features: &Features, length: f64) -> Expected {
        let row = &terms(features)[..self.terms];
        let median = length * (self.regression.at(row) + self.median).exp();
        Expected { median, bound: median * self.bound.exp() }
    }
}

/// Squares and products of so many terms.
fn pairs(terms: usize) -> Vec<[usize; 2]> {
    (0..terms).flat_map(|a| (0..=a).map(move |b| [a, b])).collect()
}

/// Cases in groups, with all of a scene in the same one.
struct Folds {
    of: Vec<usize>,
    scenes: usize,
}

impl Folds {
    fn of<'a>(scenes: impl Iterator<Item = &'a str> + Clone) -> Self {
        let mut names: Vec<&str> = scenes.clone().collect();
        names.sort_unstable();
        names.dedup();
        let place = |scene: &str| names.partition_point(|name| *name < scene) % FOLDS;
        Self { of: scenes.map(place).collect(), scenes: names.len() }
    }

    /// Answer minus prediction of every case, each predicted from the other groups.
    fn errors(
        &self,
        rows: &[&[f64]],
        answers: &[f64],
        products: &[[usize; 2]],
        penalty: f64,
    ) -> Option<Vec<f64>> {
        let mut errors = vec![0.0; rows.len()];
        for fold in 0..FOLDS {
            let known = (0..rows.len()).filter(|k| self.of[*k] != fold);
            let (x, y): (Vec<&[f64]>, Vec<f64>) = known.map(|k| (rows[k], answers[k])).unzip();
            if x.len() == rows.len() {
                continue;
            }
            let found = Regression::fit(&x, &y, products, penalty)?;
            for k in (0..rows.len()).filter(|k| self.of[*k] == fold) {
                errors[k] = answers[k] - found.at(rows[k]);
            }
        }
        Some(errors)
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Scenes whose errors are `0.1 H (d / H)^0.5 e^(s g)` with `d / H` from e^-5 to e^-3, the size of discs from 1 to
    /// 4, and g about normal.
    fn cases(seed: u64, scenes: usize, scatter: f64) -> Vec<Case> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut all = Vec::new();
        for scene in 0..scenes {
            let height = 0.5 + random.random::<f64>();
            let grain = -5.0 + 2.0 * random.random::<f64>();
            for size in [1.0_f64, 2.0, 4.0] {
                // The sum of twelve uniform numbers has a variance of 1.
                let normal: f64 = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
                let law = 0.1 * height * (0.5 * (grain + size.ln())).exp();
                let error = law * (scatter * normal).exp();
                let mut features = [0.0; NAMES.len()];
                (features[0], features[NAMES.len() - 1]) = (grain, size.ln());
                all.push(Case {
                    scene: format!("{scene}"),
                    candidate: format!("{size}"),
                    family: Family::Discs,
                    features,
                    height,
                    distance: Some(Distance { end: 0.5 * error, largest: error }),
                    change: Some(Distance { end: error, largest: 3.0 * error }),
                    seconds: [1.0, 0.0],
                    failure: String::new(),
                });
            }
        }
        all
    }

    #[test]
    fn nine_of_ten_new_scenes_are_below_the_bound() {
        let model = ErrorModel::fit(&cases(1, 80, 0.3), String::new()).unwrap();
        let new = cases(2, 400, 0.3);
        let predicted =
            |case: &Case| model.predict(Family::Discs, &case.features, case.height).unwrap();
        let share = |holds: &dyn Fn(&Case) -> bool| {
            new.iter().filter(|case| holds(case)).count() as f64 / new.len() as f64
        };
        let largest = |case: &Case| case.distance.unwrap().largest;
        // 240 errors give the quantile to about sqrt(0.9 x 0.1 / 240) = 0.02; two of these, and 0.01 for the new ones.
        let covered = share(&|case| largest(case) <= predicted(case).largest.bound);
        assert!((covered - 0.9).abs() < 0.05, "{covered}");
        let below = share(&|case| largest(case) <= predicted(case).largest.median);
        assert!((below - 0.5).abs() < 0.08, "{below}");
        // A deviation of 0.3: the bound is e^(1.28 x 0.3) = 1.47 medians.
        let found = predicted(&new[0]).largest;
        assert!((found.bound / found.median / 1.47 - 1.0).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn a_law_without_scatter_is_found() {
        let model = ErrorModel::fit(&cases(1, 40, 0.0), String::new()).unwrap();
        for case in cases(2, 20, 0.0) {
            let found = model.predict(case.family, &case.features, case.height).unwrap();
            let distance = case.distance.unwrap();
            // The least penalty of 0.3 on some 120 rows changes slopes by a quarter of a per cent.
            assert!((found.largest.median / distance.largest - 1.0).abs() < 0.01);
            assert!((found.end.median / distance.end - 1.0).abs() < 0.01);
            let from = model.from_change(case.family, &case.features, 3.0 * distance.largest);
            assert!((from.unwrap().median / distance.largest - 1.0).abs() < 0.01);
        }
    }

    #[test]
    fn what_was_not_measured_is_named() {
        let model = ErrorModel::fit(&cases(1, 40, 0.3), String::new()).unwrap();
        let mut features = cases(3, 1, 0.3)[0].features;
        let beyond =
            |features: &Features| model.predict(Family::Discs, features, 1.0).unwrap().beyond;
        assert_eq!(beyond(&features), Vec::<&str>::new());
        (features[0], features[2]) = (-8.0, 0.5);
        assert_eq!(beyond(&features), [MEANINGS[0], MEANINGS[2]]);
        assert_eq!(model.predict(Family::MuI, &features, 1.0), None);
        assert!(ErrorModel::fit(&cases(1, 2, 0.3), String::new()).is_err());
    }

    #[test]
    fn the_model_that_ships_is_one_of_the_table_that_ships() {
        let cases = super::super::library::read(include_str!("library.csv")).unwrap();
        let shipped = ErrorModel::shipped();
        let again = ErrorModel::fit(&cases, shipped.source.clone()).unwrap();
        let case = cases.iter().find(|case| case.distance.is_some()).unwrap();
        let of = |model: &ErrorModel| model.predict(case.family, &case.features, case.height);
        let [shipped, again] = [&shipped, &again].map(|model| of(model).unwrap().largest.bound);
        // Round-off of the sums, whose order may differ between processors.
        assert!((shipped / again - 1.0).abs() < 1e-6);
    }
}
