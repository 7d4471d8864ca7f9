//! Element tests of one packing against what is known of discs.

use dem::element::{Element, Stage, summary};
use dem::{Preparation, RveParameters, consolidate};
use miette::IntoDiagnostic;
use plot::{Axis, Chart, Mark, Series};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::block::{Block, Figure, Table};
use crate::context::{Context, Suite};
use crate::section::Section;
use crate::table::number;

/// Critical state and strength of one packing.
pub struct Elements;

/// Confining pressure of all tests, Pa.
const PRESSURE: f64 = 20e3;
/// Shear rates, 1/s, and what an independent prototype with the same discs measured there:
/// inertial number, tau / p, solid fraction, coordination number.
const SHEAR: [(f64, [f64; 4]); 4] = [
    (0.4, [0.0011, 0.277, 0.812, 2.95]),
    (4.0, [0.011, 0.303, 0.8097, 2.69]),
    (40.0, [0.109, 0.405, 0.780, 1.67]),
    (120.0, [0.328, 0.52, 0.719, 0.98]),
];

/// What a test came to.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Found {
    inertial_number: f64,
    peak_sin_phi: f64,
    sin_phi: f64,
    solid_fraction: f64,
    coordination: f64,
}

impl Section for Elements {
    fn title(&self) -> &'static str {
        "Element tests against critical state and mu(I)"
    }

    fn estimate(&self, context: &Context) -> f64 {
        let packings = packings(context.suite);
        let known = context.work.has_cached(KIND, &key(packings));
        if known { 0.0 } else { SECONDS * packings as f64 }
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let packings = packings(context.suite);
        let seconds = SECONDS * packings as f64;
        // All packings of one test after the other.
        let found: Vec<Found> = context.cached(KIND, &key(packings), seconds, || {
            let tests = tests();
            let jobs: Vec<(&Test, u64)> = tests
                .iter()
                .flat_map(|test| (1..=packings).map(move |seed| (test, seed)))
                .collect();
            jobs.par_iter().map(|(test, seed)| run(test, *seed)).collect::<miette::Result<_>>()
        })?;
        let results: Vec<&[Found]> = found.chunks(packings as usize).collect();
        let (biaxial, shear) = results.split_at(2);
        let columns = ["test", "quantity", "reference", "ours", "between packings", "ratio"];
        let mut table = Table::new("Element tests", columns).note(
            "Means over the last third of the path and over the packings, whose standard deviation \
             is in the column before the last. References: an independent prototype with the same \
             discs and contact law.",
        );
        let mut ratios = Vec::new();
        let mut row = |test: &str, quantity: &str, reference: f64, of: &[Found], value: Value| {
            let (ours, scatter) = mean_and_deviation(of, value);
            ratios.push(ours / reference);
            table.row([
                test.to_owned(),
                quantity.to_owned(),
                number(reference),
                number(ours),
                number(scatter),
                number(ours / reference),
            ]);
        };
        row("biaxial, dense", "peak sin phi", 0.458, biaxial[0], |found| found.peak_sin_phi);
        for (test, found) in ["biaxial, dense", "biaxial, loose"].iter().zip(biaxial) {
            row(test, "critical sin phi", 0.28, found, |found| found.sin_phi);
            row(test, "critical solid fraction", 0.813, found, |found| found.solid_fraction);
            row(test, "critical coordination", 3.05, found, |found| found.coordination);
        }
        for ((rate, [i, strength, solid, contacts]), found) in SHEAR.iter().zip(shear) {
            let test = format!("shear at {rate} 1/s");
            row(&test, "inertial number", *i, found, |found| found.inertial_number);
            row(&test, "sin phi", *strength, found, |found| found.sin_phi);
            row(&test, "solid fraction", *solid, found, |found| found.solid_fraction);
            row(&test, "coordination", *contacts, found, |found| found.coordination);
        }
        let law = |i: f64| 0.28 + (0.80 - 0.28) * i / (0.35 + i);
        let rates = |from: i32, to: i32| (from..=to).map(|k| 10_f64.powf(0.1 * f64::from(k)));
        let picture = Chart {
            x: Axis::log("inertial number I"),
            y: Axis::linear("shear strength"),
            series: vec![
                Series::new(
                    "mu(I) law of dempm",
                    Mark::Line,
                    rates(-35, 0).map(|i| (i, law(i))).collect(),
                ),
                Series::new(
                    "da Cruz et al. 2005, 0.25 + 1.1 I",
                    Mark::Line,
                    rates(-35, -7).map(|i| (i, 0.25 + 1.1 * i)).collect(),
                ),
                Series::new(
                    "prototype",
                    Mark::Crosses,
                    SHEAR.map(|(_, [i, strength, ..])| (i, strength)).to_vec(),
                ),
                Series::new(
                    "this code",
                    Mark::Circles,
                    shear
                        .iter()
                        .flat_map(|found| found.iter())
                        .map(|f| (f.inertial_number, f.sin_phi))
                        .collect(),
                ),
            ],
            floor: None,
        }
        .svg()
        .map(crate::figure::Picture::Svg)?;
        let (least, most) =
            ratios.iter().fold((f64::MAX, f64::MIN), |(low, high), r| (low.min(*r), high.max(*r)));
        Ok(vec![
            Block::headline(format!(
                "{} quantities of critical state and strength are {} to {} times those of an \
                 independent prototype.",
                ratios.len(),
                number(least),
                number(most)
            )),
            Block::text(
                "Packings of 400 discs at 20 kPa, friction 0.5. Biaxial compression from a dense \
                 and a loose packing has to end in one critical state; simple shear at constant \
                 normal stress gives the strength over the inertial number I. Da Cruz et al. (2005) \
                 had discs with friction 0.4 and measured up to I = 0.2.",
            ),
            Block::Figure(Figure::new(
                "Strength over inertial number",
                picture,
                "sin phi of this code and of the law, tau / p of the others.",
            )),
            Block::Table(table),
        ])
    }
}

const KIND: &str = "elements";
/// About, for one packing, s.
const SECONDS: f64 = 20.0;

/// Packings that every test is made with.
fn packings(suite: Suite) -> u64 {
    match suite {
        Suite::Quick => 1,
        Suite::Full => 6,
    }
}

type Value = fn(&Found) -> f64;

/// Mean over packings and standard deviation between them, which a single one does not have.
fn mean_and_deviation(found: &[Found], value: Value) -> (f64, f64) {
    let count = found.len() as f64;
    let mean = found.iter().map(value).sum::<f64>() / count;
    let squares: f64 = found.iter().map(|f| (value(f) - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0)).sqrt())
}

/// A test: the friction of the preparation, and the path.
type Test = (f64, Stage, f64);

/// All tests with the time between rows, s.
fn tests() -> Vec<Test> {
    let biaxial = Stage::Biaxial { pressure: PRESSURE, shortening_rate: 0.05, strain: 0.2 };
    let mut tests = vec![(1e-3, biaxial.clone(), 0.05), (0.5, biaxial, 0.05)];
    tests.extend(SHEAR.map(|(shear_rate, _)| {
        let strain = 3.0;
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
    let preparation =
        Preparation { pressure: PRESSURE, friction: *friction, ..Preparation::default() };
    let parameters = RveParameters { preparation, ..RveParameters::default() };
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
