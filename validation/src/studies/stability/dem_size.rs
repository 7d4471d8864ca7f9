//! Size of the RVE: scatter of the strength over the number of discs.

use dem::RveParameters;
use dem::element::{Element, Stage, sin_phi};
use rayon::prelude::*;

use super::outcome::Outcome;
use super::packing::{consolidated, picture};
use super::scene_messages;
use super::study::{Axis, Chart, Curve, Finding, Map, Picture, Study, StudyError};
use super::threshold::Threshold;
use crate::suite::Suite;

const PRESSURE: f64 = 20.0e3;
const SHEAR_RATE: f64 = 4.0;
/// Strain of one sample.
const WINDOW: f64 = 0.02;
/// Scatter of `sin phi` between samples that counts as failure.
const SCATTER: f64 = 0.1;

/// Mean and standard deviation of `sin phi` over windows of a shear test after a strain of 1/2.
struct Strength {
    mean: f64,
    scatter: f64,
    picture: Picture,
}

type Measured = Result<Strength, StudyError>;

fn strength(p: &RveParameters, seed: u64, strain: f64) -> Measured {
    let mut element = Element::new(consolidated(p, seed)?, p, 1.0e-4)?;
    let stage = Stage::ConstantPressureShear { pressure: PRESSURE, shear_rate: SHEAR_RATE, strain };
    let mut samples = Vec::new();
    element.run(&stage, WINDOW / SHEAR_RATE, |row| {
        if row.strain[(0, 1)] > 0.5 {
            samples.push(sin_phi(&row.stress));
        }
    })?;
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / n;
    let title = format!("RVE of {} discs after a shear of {strain}", p.discs);
    let picture = picture(&element.rve.packing, title);
    Ok(Strength { mean, scatter: variance.sqrt(), picture })
}

/// Errors or warnings of a scene with so many discs.
fn said(discs: usize) -> Option<String> {
    scene_messages::said(&format!(
        "duration = 0.1\n[domain]\nsize = [4.0, 2.0]\n[[column]]\nsize = [1.0, 1.0]\n\
         [material]\nkind = \"rve\"\npackings = 1\n[rve]\ndiscs = {discs}\n"
    ))
}

fn judge(discs: usize, result: &Measured) -> Outcome {
    let said = said(discs);
    match result {
        Ok(Strength { scatter, .. }) => {
            let symptom = format!("sin phi scatters by {scatter:.2}");
            Outcome::of((*scatter > SCATTER).then_some(symptom), said)
        }
        Err(error) => Outcome::Failed { message: error.to_string() },
    }
}

/// Measures the scatter of the strength over the number of discs.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let sizes: Vec<usize> = suite.pick(
        vec![9, 16, 25, 50, 100, 200, 400],
        vec![9, 12, 16, 25, 36, 50, 70, 100, 200, 400, 800, 1600],
    );
    let seeds: Vec<u64> = (1..=suite.pick(2, 6)).collect();
    let strain = suite.pick(1.5, 4.0);
    let parameters = |discs: usize| {
        let mut p = RveParameters { discs, ..RveParameters::default() };
        p.preparation.pressure = PRESSURE;
        p
    };
    let rows: Vec<Vec<Measured>> = seeds
        .par_iter()
        .map(|&seed| sizes.par_iter().map(|&n| strength(&parameters(n), seed, strain)).collect())
        .collect();
    let outcomes: Vec<Vec<Outcome>> = rows
        .iter()
        .map(|row| sizes.iter().zip(row).map(|(&n, result)| judge(n, result)).collect())
        .collect();
    let scatter = |k: usize| {
        let found = rows.iter().filter_map(|row| row[k].as_ref().ok()).map(|s| s.scatter.powi(2));
        let all: Vec<f64> = found.collect();
        (all.iter().sum::<f64>() / all.len() as f64).sqrt()
    };
    let measured: Vec<[f64; 2]> =
        sizes.iter().enumerate().map(|(k, &n)| [n as f64, scatter(k)]).collect();
    let theory = sizes.iter().map(|&n| [n as f64, 0.7 / (n as f64).sqrt()]).collect();
    // From large to small.
    let sweep = measured.iter().rev().map(|&[n, s]| (n, s < SCATTER));
    let worst = outcomes[0].iter().rev().find(|o| !o.works());
    let refused = Threshold::of_sweep(
        (2..400).rev().map(|n| (n as f64, !said(n).is_some_and(|text| text.contains("too few")))),
    );
    let small = said(9).map_or(Outcome::Stable, |message| Outcome::Failed { message });
    Ok(Study {
        method: format!(
            "Steady shear at {:.0} kPa and {SHEAR_RATE} 1/s (I = 0.01): standard deviation of sin phi \
             between strains of {WINDOW}, after a strain of 0.5. Failure: more than {SCATTER}, a third \
             of the strength itself.",
            PRESSURE / 1e3
        ),
        findings: vec![
            Finding {
                case: "scatter of the strength".into(),
                parameter: "discs, at least".into(),
                measured: Threshold::of_sweep(sweep),
                theory: Some(((0.7 / SCATTER).powi(2), "0.7/√N".into())),
                beyond: worst.cloned().unwrap_or(Outcome::Stable),
            },
            Finding {
                case: "refused: discs would see several images of a neighbour".into(),
                parameter: "discs, at least".into(),
                measured: refused,
                theory: None,
                beyond: small,
            },
        ],
        charts: vec![Chart {
            title: "Scatter of the strength".into(),
            x: "discs".into(),
            y: "standard deviation of sin phi".into(),
            log: [true, true],
            curves: vec![
                Curve::measured("measured", measured),
                Curve::theory("0.7/√N (an earlier code)", theory),
            ],
            caption: format!("Windows of a strain of {WINDOW}."),
        }],
        maps: vec![Map {
            title: "Size of the RVE".into(),
            x: Axis::new("discs", sizes.iter().map(|&n| n as f64).collect()),
            y: Axis::new("seed", seeds.iter().map(|&s| s as f64).collect()),
            numbers: rows
                .iter()
                .map(|row| row.iter().map(|r| r.as_ref().map_or(f64::NAN, |s| s.mean)).collect())
                .collect(),
            outcomes,
            caption: "Numbers: mean sin phi.".into(),
        }],
        pictures: rows
            .into_iter()
            .next()
            .into_iter()
            .flatten()
            .flatten()
            .map(|strength| strength.picture)
            .take(1)
            .collect(),
        ..Study::default()
    })
}
