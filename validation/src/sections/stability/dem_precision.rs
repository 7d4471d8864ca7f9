//! f32 against f64: the smallest pressure whose overlaps single precision still resolves.

use dem::element::{Element, Stage};
use dem::{Packing, Real, RveParameters};
use nalgebra::Matrix2;
use rayon::prelude::*;

use super::outcome::Outcome;
use super::packing::consolidated;
use super::study::{Axis, Chart, Curve, Finding, Map, Study, StudyError, pick};
use super::threshold::Threshold;
use crate::context::Suite;

/// Relative difference of stress that counts as failure.
const TOLERANCE: f64 = 0.01;

/// Stress (Pa) after a small shear at constant volume.
fn stress<R: Real>(
    packing: &Packing<f64>,
    p: &RveParameters,
    strain: f64,
) -> Result<Matrix2<f64>, StudyError> {
    let mut element = Element::<R>::new(packing.convert(), p, 1.0e-4)?;
    let stage = Stage::ConstantVolumeShear { shear_rate: 0.1, strain };
    element.run(&stage, f64::INFINITY, |_| ())?;
    Ok(element.state.stress)
}

pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let p = RveParameters { discs: pick(suite, 100, 400), ..RveParameters::default() };
    let packing = consolidated(&p, 1)?;
    let pressures = vec![1.0, 10.0, 100.0, 1.0e3, 1.0e4, 1.0e5];
    let strains = pick(suite, vec![1e-5, 1e-4, 1e-3], vec![1e-5, 1e-4, 3e-4, 1e-3]);
    let rungs = dem::ladder(&p, 1, &packing, &pressures)?;
    let column = |&strain: &f64| -> Result<Vec<f64>, StudyError> {
        let difference = |rung: &dem::Rung| {
            let single = stress::<f32>(&rung.packing, &p, strain)?;
            let double = stress::<f64>(&rung.packing, &p, strain)?;
            Ok((single - double).norm() / double.norm())
        };
        rungs.par_iter().map(difference).collect()
    };
    let rows: Vec<Vec<f64>> = strains.par_iter().map(column).collect::<Result<_, _>>()?;
    let judge = |difference: &f64| {
        let symptom = format!("stress differs by {:.1} %", 100.0 * difference);
        Outcome::of((difference.is_nan() || *difference >= TOLERANCE).then_some(symptom), None)
    };
    let outcomes: Vec<Vec<Outcome>> =
        rows.iter().map(|row| row.iter().map(judge).collect()).collect();
    let resolution = f64::from(f32::EPSILON) * p.mean_diameter();
    let findings = strains.iter().zip(&rows).map(|(&strain, row)| {
        let sweep = pressures.iter().zip(row).rev().map(|(&p, &d)| (p, d < TOLERANCE));
        let bad = row.iter().rev().map(judge).find(|o| !o.works());
        Finding {
            case: format!("after a shear of {strain}"),
            parameter: "vertical stress, Pa, at least".into(),
            measured: Threshold::of_sweep(sweep),
            theory: Some((
                resolved(&p, resolution / TOLERANCE),
                "δ = ε d / 0.01, one contact alone".into(),
            )),
            beyond: bad.unwrap_or(Outcome::Stable),
        }
    });
    let curve = |(strain, row): (&f64, &Vec<f64>)| {
        let points = pressures.iter().zip(row).map(|(&p, &d)| [p, d]);
        Curve::measured(format!("shear {strain}"), points.collect())
    };
    Ok(Study {
        method: format!(
            "Packings of {} discs at vertical stresses from 1 Pa to 100 kPa (oedometric loading and \
             unloading) are sheared at constant volume in f32 and in f64. Failure: stresses differ \
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
            y: Axis::new("shear strain", strains),
            numbers: rows,
            outcomes,
            caption: "Numbers: relative difference of stress.".into(),
        }],
        ..Study::default()
    })
}

/// Pressure (Pa) of a dense packing whose mean overlap is `overlap` (m): `p t = Z phi kn delta /
/// (2 pi r)`.
fn resolved(p: &RveParameters, overlap: f64) -> f64 {
    let fabric = 4.0 * 0.84 / (2.0 * std::f64::consts::PI);
    fabric * p.normal_stiffness * overlap / (0.5 * p.mean_diameter() * p.thickness)
}
