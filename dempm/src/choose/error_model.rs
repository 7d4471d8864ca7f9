//! The error to expect of a candidate, from cases that were measured.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::conformal::quantile;
use super::family::Family;
use super::features::{Features, MEANINGS, NAMES, terms};
use super::kernel_regression::{Regression, Rows};
use super::library::Case;

/// The model that ships: `validation fit dempm/src/choose/library.csv`.
const SHIPPED: &str = include_str!("error-model.json");
/// Probability that the error does not exceed the bound.
pub const LEVEL: f64 = 0.9;
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
    rows: Rows,
    end: Predictor,
    largest: Predictor,
    /// The error from the change to the next coarser candidate; `None` if that was not measured.
    from_change: Option<Predictor>,
}

/// The logarithm of an error over a length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Predictor {
    regression: Regression,
    /// What scenes that were left out add to its median.
    median: f64,
    /// What they add to that up to the bound.
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
            end: known.expected(&known.end, features, height),
            largest: known.expected(&known.largest, features, height),
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
        let known = self.families.get(&family)?;
        Some(known.expected(known.from_change.as_ref()?, features, change))
    }
}

impl OfFamily {
    fn fit(cases: &[&Case]) -> Option<Self> {
        let range = |k: usize| {
            let values = cases.iter().map(|case| case.features[k]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
        };
        let mut scenes: Vec<&str> = cases.iter().map(|case| case.scene.as_str()).collect();
        scenes.sort_unstable();
        scenes.dedup();
        let scene_of = |case: &Case| scenes.partition_point(|name| *name < case.scene.as_str());
        let scene_of: Vec<usize> = cases.iter().map(|case| scene_of(case)).collect();
        let features: Vec<_> = cases.iter().map(|case| terms(&case.features)).collect();
        let rows = Rows::of(&features);
        let of = |value: &dyn Fn(&Case) -> Option<[f64; 2]>| {
            let answers: Vec<_> = cases.iter().map(|case| value(case)).collect();
            Predictor::fit(&rows, &answers, &scene_of)
        };
        Some(Self {
            range: (0..NAMES.len()).map(range).collect(),
            end: of(&|case| Some([case.distance?.end, case.height]))?,
            largest: of(&|case| Some([case.distance?.largest, case.height]))?,
            from_change: of(&|case| Some([case.distance?.largest, case.change?.largest])),
            rows,
        })
    }

    /// What to expect of an error over a length (m).
    fn expected(&self, predictor: &Predictor, features: &Features, length: f64) -> Expected {
        let Predictor { regression, median, bound } = predictor;
        let median = length * (self.rows.at(regression, &terms(features)) + median).exp();
        Expected { median, bound: median * bound.exp() }
    }
}

impl Predictor {
    /// From cases with their errors and lengths (m), where known, and the number of the scene of each. Quantiles are
    /// those of scenes that are predicted from all others. `None` from too few scenes.
    fn fit(rows: &Rows, answers: &[Option<[f64; 2]>], scenes: &[usize]) -> Option<Self> {
        let mut known: Vec<usize> =
            scenes.iter().zip(answers).filter(|(_, a)| a.is_some()).map(|(s, _)| *s).collect();
        known.sort_unstable();
        known.dedup();
        if known.len() < LEAST_SCENES {
            return None;
        }
        let logarithm = |[error, length]: [f64; 2]| (error.max(LEAST) / length.max(LEAST)).ln();
        let answers: Vec<Option<f64>> = answers.iter().map(|a| a.map(logarithm)).collect();
        let found = rows.fit(&answers, scenes)?;
        let median = quantile(&found.left_out, 0.5)?;
        let bound = quantile(&found.left_out, LEVEL)? - median;
        Some(Self { regression: found.regression, median, bound })
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::library::Distance;
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
            // The penalty takes up to two per cent, most of it at the ends of the range.
            assert!((found.largest.median / distance.largest - 1.0).abs() < 0.03);
            assert!((found.end.median / distance.end - 1.0).abs() < 0.03);
            let from = model.from_change(case.family, &case.features, 3.0 * distance.largest);
            assert!((from.unwrap().median / distance.largest - 1.0).abs() < 0.03);
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
