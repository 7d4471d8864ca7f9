//! Biaxial and shear tests of single packings.

use dem::element::{Element, Stage, summary};
use dem::{Grains, Preparation, RveParameters, consolidate};
use miette::IntoDiagnostic;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::literature::discs::SHEAR;
use crate::studies::statistics::{deviation, mean};
use crate::suite::Suite;

/// Confining pressure of all tests, Pa.
const PRESSURE: f64 = 20e3;
/// Kind of the kept value.
const KIND: &str = "elements";
/// Estimated time of one packing, s.
const SECONDS: f64 = 20.0;

/// The results of a test with one packing, as means over the last third of its path.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Found {
    /// Inertial number.
    pub inertial_number: f64,
    /// Largest sin phi of the path.
    pub peak_sin_phi: f64,
    /// Sine of the mobilised friction angle.
    pub sin_phi: f64,
    /// Solid fraction.
    pub solid_fraction: f64,
    /// Contacts per disc.
    pub coordination: f64,
}

/// The results of all tests: one entry for each packing.
pub struct ElementTests {
    /// Biaxial compression of a dense packing.
    pub dense: Vec<Found>,
    /// Biaxial compression of a loose packing.
    pub loose: Vec<Found>,
    /// Simple shear at the rates of [`SHEAR`].
    pub shear: Vec<Vec<Found>>,
}

/// Estimated time of what is not kept, s.
pub fn estimate(context: &Context) -> f64 {
    let packings = packings(context.suite);
    let known = context.cache.has_cached(KIND, &key(packings));
    if known { 0.0 } else { SECONDS * packings as f64 }
}

/// Tests all packings of the suite.
///
/// # Errors
/// If a packing cannot be made or tested, or the user interrupts.
pub fn measure(context: &mut Context) -> miette::Result<ElementTests> {
    let packings = packings(context.suite);
    // All packings of one test after the other.
    let found: Vec<Found> =
        context.cached(KIND, &key(packings), SECONDS * packings as f64, || {
            let tests = tests();
            let jobs: Vec<(&Test, u64)> = tests
                .iter()
                .flat_map(|test| (1..=packings).map(move |seed| (test, seed)))
                .collect();
            jobs.par_iter().map(|(test, seed)| run(test, *seed)).collect::<miette::Result<_>>()
        })?;
    let mut tests = found.chunks(packings as usize).map(<[Found]>::to_vec);
    let [dense, loose] = [tests.next(), tests.next()].map(Option::unwrap_or_default);
    Ok(ElementTests { dense, loose, shear: tests.collect() })
}

/// Mean of a quantity over packings, and its standard deviation between them.
pub fn mean_and_deviation(found: &[Found], quantity: fn(&Found) -> f64) -> (f64, f64) {
    let values: Vec<f64> = found.iter().map(quantity).collect();
    (mean(&values), deviation(&values))
}

/// Number of packings that every test is repeated with.
fn packings(suite: Suite) -> u64 {
    suite.pick(1, 6)
}

/// A test: friction during the preparation, the path, and the time between rows (s).
type Test = (f64, Stage, f64);

fn tests() -> Vec<Test> {
    let biaxial = Stage::Biaxial { pressure: PRESSURE, shortening_rate: 0.05, strain: 0.2 };
    let mut tests = vec![(1e-3, biaxial.clone(), 0.05), (0.5, biaxial, 0.05)];
    tests.extend(SHEAR.iter().map(|shear| {
        let (shear_rate, strain) = (shear.rate, 3.0);
        let stage = Stage::ConstantPressureShear { pressure: PRESSURE, shear_rate, strain };
        (1e-3, stage, 0.01 * strain / shear_rate.min(120.0))
    }));
    tests
}

/// What the results depend on.
fn key(packings: u64) -> String {
    format!("{:?}, {packings} packings", tests())
}

fn run((friction, stage, sampling): &Test, seed: u64) -> miette::Result<Found> {
    let grains = Grains { preparation_friction: *friction, ..Grains::default() };
    let preparation = Preparation { pressure: PRESSURE, ..Preparation::default() };
    let parameters = RveParameters { grains, preparation, ..RveParameters::default() };
    let packing = consolidate(&parameters, seed).into_diagnostic()?;
    let mut element = Element::<f64>::new(packing, &parameters, 1e-4).into_diagnostic()?;
    let mut rows = Vec::new();
    element.run(stage, *sampling, |row| rows.push(*row)).into_diagnostic()?;
    let found = summary(&rows).ok_or_else(|| miette::miette!("the path has no rows"))?;
    Ok(Found {
        inertial_number: found.late_inertial_number,
        peak_sin_phi: found.peak_sin_phi,
        sin_phi: found.late_sin_phi,
        solid_fraction: found.late_solid_fraction,
        coordination: found.late_coordination,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packings_are_averaged() {
        let found = |sin_phi| Found {
            inertial_number: 0.0,
            peak_sin_phi: 0.0,
            sin_phi,
            solid_fraction: 0.0,
            coordination: 0.0,
        };
        let (mean, deviation) = mean_and_deviation(&[found(1.0), found(3.0)], |f| f.sin_phi);
        assert_eq!((mean, deviation), (2.0, 2.0_f64.sqrt()));
        assert!(mean_and_deviation(&[found(1.0)], |f| f.sin_phi).1.is_nan());
    }
}
