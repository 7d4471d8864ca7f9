//! Element tests of single packings against what is known of discs.

use mpm::DruckerPragerParameters;
use plot::{Axis, Chart, Mark, Series};

use crate::context::Context;
use crate::literature::discs::{
    CRITICAL_COORDINATION, CRITICAL_SIN_PHI, CRITICAL_SOLID_FRACTION, PEAK_SIN_PHI, SHEAR, da_cruz,
};
use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::element_tests::{
    ElementTests as Measurement, Found, estimate, mean_and_deviation, measure,
};
use crate::studies::statistics::range;
use crate::text::number;

/// Critical state and strength of single packings.
pub struct ElementTests;

/// A quantity of a test, ours and the reference's.
struct Row<'f> {
    test: String,
    quantity: &'static str,
    reference: f64,
    found: &'f [Found],
    value: fn(&Found) -> f64,
}

impl Section for ElementTests {
    fn title(&self) -> &'static str {
        "Element tests against critical state and mu(I)"
    }

    fn lead(&self) -> &'static str {
        "Strength and density of single packings in compression and shear, beside an independent \
         code."
    }

    fn estimate(&self, context: &Context) -> f64 {
        estimate(context)
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let tests = measure(context)?;
        let rows = rows(&tests);
        let ratios =
            rows.iter().map(|row| mean_and_deviation(row.found, row.value).0 / row.reference);
        let [least, most] = range(ratios).unwrap_or([f64::NAN; 2]);
        Ok(vec![
            Block::headline(format!(
                "{} quantities of critical state and strength are {} to {} times those of an \
                 independent prototype.",
                rows.len(),
                number(least),
                number(most)
            )),
            Block::text(
                "Packings of 400 discs at 20 kPa, friction 0.5. Biaxial compression of a dense and of \
                 a loose packing has to end in one critical state; simple shear at constant normal \
                 stress gives the strength over the inertial number I. Da Cruz et al. (2005) had \
                 discs with friction 0.4 and measured up to I = 0.2.",
            ),
            figure(&tests.shear)?,
            Block::Table(table(&rows)),
        ])
    }
}

fn rows(tests: &Measurement) -> Vec<Row<'_>> {
    let mut rows = vec![Row {
        test: "biaxial, dense".to_owned(),
        quantity: "peak sin phi",
        reference: PEAK_SIN_PHI,
        found: &tests.dense,
        value: |found| found.peak_sin_phi,
    }];
    for (test, found) in [("biaxial, dense", &tests.dense), ("biaxial, loose", &tests.loose)] {
        let row = |quantity, reference, value| Row {
            test: test.to_owned(),
            quantity,
            reference,
            found,
            value,
        };
        rows.push(row("critical sin phi", CRITICAL_SIN_PHI, |found| found.sin_phi));
        rows.push(row("critical solid fraction", CRITICAL_SOLID_FRACTION, |found| {
            found.solid_fraction
        }));
        rows.push(row("critical coordination", CRITICAL_COORDINATION, |found| found.coordination));
    }
    for (shear, found) in SHEAR.iter().zip(&tests.shear) {
        let row = |quantity, reference, value| Row {
            test: format!("shear at {} 1/s", shear.rate),
            quantity,
            reference,
            found,
            value,
        };
        rows.push(row("inertial number", shear.inertial_number, |found| found.inertial_number));
        rows.push(row("sin phi", shear.strength, |found| found.sin_phi));
        rows.push(row("solid fraction", shear.solid_fraction, |found| found.solid_fraction));
        rows.push(row("coordination", shear.coordination, |found| found.coordination));
    }
    rows
}

fn table(rows: &[Row]) -> Table {
    let columns = ["test", "quantity", "reference", "ours", "between packings", "ratio"];
    let mut table = Table::new("Element tests", columns).note(
        "Means over the last third of the path and over the packings; between packings: their \
         standard deviation. References: an independent prototype with the same discs and contact \
         law.",
    );
    for Row { test, quantity, reference, found, value } in rows {
        let (ours, deviation) = mean_and_deviation(found, *value);
        table.row([
            test.clone(),
            (*quantity).to_owned(),
            number(*reference),
            number(ours),
            number(deviation),
            number(ours / reference),
        ]);
    }
    table
}

fn figure(shear: &[Vec<Found>]) -> miette::Result<Block> {
    let law = DruckerPragerParameters::default();
    let powers = |from: i32, to: i32| (from..=to).map(|k| 10_f64.powf(0.1 * f64::from(k)));
    let series = vec![
        Series::new(
            "mu(I) law of dempm",
            Mark::Line,
            powers(-35, 0).map(|i| (i, law.friction(i))).collect(),
        ),
        Series::new(
            "da Cruz et al. 2005, 0.25 + 1.1 I",
            Mark::Line,
            powers(-35, -7).map(|i| (i, da_cruz(i))).collect(),
        ),
        Series::new(
            "prototype",
            Mark::Crosses,
            SHEAR.iter().map(|shear| (shear.inertial_number, shear.strength)).collect(),
        ),
        Series::new(
            "this code",
            Mark::Circles,
            shear.iter().flatten().map(|f| (f.inertial_number, f.sin_phi)).collect(),
        ),
    ];
    let x = Axis::log("inertial number I");
    let svg = Chart { x, y: Axis::linear("shear strength"), series, floor: None }.svg()?;
    Ok(Block::Figure(Figure::new(
        "Strength over inertial number",
        Picture::Svg(svg),
        "sin phi of this code and of the law, tau / p of the others.",
    )))
}
