//! f32 against f64: the smallest pressure whose overlaps single precision still resolves.

use dem::element::{Element, Stage};
use dem::{Packing, PlainDisc, Real, Rung, RveParameters};
use rayon::prelude::*;

use super::outcome::Outcome;
use super::packing::{consolidated, picture};
use super::study::{Axis, Chart, Curve, Finding, Map, Picture, Study, StudyError};
use super::threshold::Threshold;
use crate::suite::Suite;

/// Relative difference of stress that counts as failure.
const TOLERANCE: f64 = 0.01;

/// A shear test in both precisions.
struct Look {
    /// Relative difference of stress.
    difference: f64,
    /// At the start or at the end, whichever is smaller, Pa.
    pressure: f64,
}

impl Look {
    fn agrees(&self) -> bool {
        self.difference < TOLERANCE
    }
}

/// A small shear at constant volume.
fn shear<R: Real>(
    packing: &Packing<f64>,
    p: &RveParameters,
    strain: f64,
) -> Result<Element<R>, StudyError> {
    let mut element = Element::<R>::new(packing.convert(), p, 1.0e-4)?;
    let stage = Stage::ConstantVolumeShear { shear_rate: 0.1, strain };
    element.run(&stage, f64::INFINITY, |_| ())?;
    Ok(element)
}

fn compare(rung: &Rung, p: &RveParameters, strain: f64) -> Result<Look, StudyError> {
    let single = shear::<f32>(&rung.packing, p, strain)?.state.stress;
    let double = shear::<f64>(&rung.packing, p, strain)?.state.stress;
    let pressure = 0.5 * single.trace().min(rung.stress.trace());
    Ok(Look { difference: (single - double).norm() / double.norm(), pressure })
}

/// The packing in f64, coloured by the distance of discs from where they are in f32.
fn apart(packing: &Packing<f64>, p: &RveParameters, strain: f64) -> Result<Picture, StudyError> {
    let single = shear::<f32>(packing, p, strain)?.rve.packing.plain_discs();
    let double = shear::<f64>(packing, p, strain)?.rve.packing;
    let away = |(a, b): (&PlainDisc, &PlainDisc)| 1e6 * (a.x[0] - b.x[0]).hypot(a.x[1] - b.x[1]);
    let value = single.iter().zip(&double.plain_discs()).map(away).collect();
    let title = format!("Discs in f32 and in f64 after a shear of {strain}, from 1 Pa");
    Ok(Picture { colour: "distance, µm".into(), value, ..picture(&double, title) })
}

/// Shears packings in f32 and in f64 at ever smaller pressures.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let p = RveParameters { discs: suite.pick(100, 400), ..RveParameters::default() };
    let packing = consolidated(&p, 1)?;
    let pressures = vec![1.0, 10.0, 100.0, 1.0e3, 1.0e4, 1.0e5];
    let strains = suite.pick(vec![1e-5, 1e-4, 1e-3], vec![1e-5, 1e-4, 3e-4, 1e-3]);
    let rungs = dem::ladder(&p, 1, &packing, &pressures)?;
    let column = |&strain: &f64| -> Result<Vec<Look>, StudyError> {
        let look = |rung: &Rung| compare(rung, &p, strain);
        rungs.par_iter().map(look).collect()
    };
    let rows: Vec<Vec<Look>> = strains.par_iter().map(column).collect::<Result<_, _>>()?;
    let judge = |look: &Look| {
        let symptom = format!("stress differs by {:.1} %", 100.0 * look.difference);
        let said = dempm::run::monitor::unresolved(
            "the smallest pressure of the path",
            look.pressure,
            &p.grains,
        );
        Outcome::of((!look.agrees()).then_some(symptom), said)
    };
    let outcomes: Vec<Vec<Outcome>> =
        rows.iter().map(|row| row.iter().map(judge).collect()).collect();
    let findings = strains.iter().zip(&rows).map(|(&strain, row)| {
        let sweep = pressures.iter().zip(row).rev().map(|(&p, look)| (p, look.agrees()));
        let bad = row.iter().rev().map(judge).find(|o| !o.works());
        Finding {
            case: format!("after a shear of {strain}"),
            parameter: "vertical stress, Pa, at least".into(),
            measured: Threshold::of_sweep(sweep),
            theory: Some((
                p.grains.single_precision_pressure(),
                "δ = ε d / 0.01, one contact alone".into(),
            )),
            beyond: bad.unwrap_or(Outcome::Stable),
        }
    });
    let curve = |(strain, row): (&f64, &Vec<Look>)| {
        let points = pressures.iter().zip(row).map(|(&p, look)| [p, look.difference]);
        Curve::measured(format!("shear {strain}"), points.collect())
    };
    Ok(Study {
        method: format!(
            "Packings of {} discs at vertical stresses from 1 Pa to 100 kPa (loading and unloading \
             at equal strains) are sheared at constant volume in f32 and in f64. Failure: stresses differ \
             by more than {:.0} %.",
            p.discs,
            100.0 * TOLERANCE
        ),
        findings: findings.collect(),
        charts: vec![Chart {
            title: "f32 against f64".into(),
            x: "vertical stress at the start, Pa".into(),
            y: "relative difference of stress".into(),
            log: [true, true],
            curves: strains.iter().zip(&rows).map(curve).collect(),
            caption:
                "Strains stay small: beyond about 1 % any two runs part, in whatever precision, \
                      since packings are chaotic."
                    .into(),
        }],
        maps: vec![Map {
            title: "f32 against f64: where they agree".into(),
            x: Axis::new("vertical stress, Pa", pressures.clone()),
            y: Axis::new("shear strain", strains.clone()),
            numbers: rows.iter().map(|row| row.iter().map(|l| l.difference).collect()).collect(),
            outcomes,
            caption: "Numbers: relative difference of stress.".into(),
        }],
        pictures: vec![apart(&rungs[0].packing, &p, strains[strains.len() - 1])?],
        ..Study::default()
    })
}
