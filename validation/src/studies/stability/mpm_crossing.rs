//! Cell-crossing noise: roughness of the stress over the displacement of points.

use std::f64::consts::PI;

use mpm::{
    Basis, Domain, Elastic, ElasticParameters, Mat2, Numerics, Points, Solver, Transfer, Vec2,
    Walls,
};
use rayon::prelude::*;

use super::mpm_step::{BASES, name};
use super::outcome::Outcome;
use super::scene_messages;
use super::study::{Axis, Chart, Curve, Finding, Map, Study, StudyError};
use super::threshold::{bisect, log_range};
use crate::suite::Suite;

/// Length of the bar in cells; cells, density and stiffness are 1, so waves cross a cell in 1 s.
const LENGTH: f64 = 64.0;
const STEP: f64 = 0.2;
/// Stress that differs from its neighbours' mean by more than this part is noise.
const ROUGH: f64 = 0.1;

/// A free bar that vibrates in its first mode, `u = U cos(pi x / L) sin(pi c t / L)`, after a period
/// and a half. Its ends move by `U` cells to both sides.
fn vibrate(basis: Basis, amplitude: f64) -> Result<Points, StudyError> {
    let numerics =
        Numerics { basis, transfer: Transfer::Flip { rate: 0.0 }, ..Numerics::default() };
    let domain = Domain { size: Vec2::new(LENGTH + 16.0, 1.0), walls: Walls::default(), cell: 1.0 };
    let mut solver = Solver::new(domain, numerics, Vec2::zeros(), vec![])?;
    let law = ElasticParameters { young_modulus: 1.0, poisson_ratio: 0.0 };
    let mut material = Elastic::new(law)?;
    let mut points = Points::rectangle(Vec2::new(8.0, 0.0), Vec2::new(8.0 + LENGTH, 1.0), 0.5, 1.0);
    let k = PI / LENGTH;
    for (x, v) in points.position.iter().zip(&mut points.velocity) {
        v.x = amplitude * k * (k * (x.x - 8.0)).cos();
    }
    // At the end of a period and a quarter the bar is stretched most.
    let steps = (2.5 * LENGTH / STEP) as usize;
    for _ in 0..steps {
        solver.advance(&mut points, &mut material, STEP)?;
    }
    Ok(points)
}

/// Root mean square difference of the stress of a point from the mean of its neighbours along the
/// bar, over the root mean square of the stress.
fn roughness(points: &Points) -> f64 {
    let row = points.len() / 2;
    let along = |s: &Mat2| s[(0, 0)];
    let stress: Vec<f64> = points.stress[..row].iter().map(along).collect();
    let rms = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let rough = rms(&mut stress.windows(3).map(|s| s[1] - 0.5 * (s[0] + s[2])));
    rough / rms(&mut stress.iter().copied())
}

/// Errors or warnings of a scene with this basis.
fn said(basis: Basis) -> Option<String> {
    scene_messages::said(&format!(
        "duration = 0.1\n[domain]\nsize = [4.0, 2.0]\n[[column]]\nsize = [1.0, 1.0]\n\
         [material]\nkind = \"mu-i\"\n[numerics]\nbasis = \"{}\"\n",
        match basis {
            Basis::Gimp => "gimp",
            other => name(other),
        }
    ))
}

fn judge(basis: Basis, amplitude: f64) -> (f64, Outcome) {
    match vibrate(basis, amplitude) {
        Ok(points) => {
            let rough = roughness(&points);
            let symptom = format!("stress scatters by {:.0} %", 100.0 * rough);
            (rough, Outcome::of((rough > ROUGH).then_some(symptom), said(basis)))
        }
        Err(error) => (f64::NAN, Outcome::Failed { message: error.to_string() }),
    }
}

/// Measures the roughness of the stress in a vibrating bar over its amplitude.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let amplitudes = log_range(0.05, 2.0, suite.pick(9, 25));
    let rows: Vec<Vec<(f64, Outcome)>> = BASES
        .par_iter()
        .map(|&basis| amplitudes.par_iter().map(|&a| judge(basis, a)).collect())
        .collect();
    let findings = BASES.par_iter().map(|&basis| {
        let smooth = |a: f64| judge(basis, a).1.works();
        let measured = bisect(0.05, 2.0, suite.pick(0.1, 0.02), smooth);
        Finding {
            case: format!("{} basis", name(basis)),
            parameter: "displacement, cells".into(),
            measured,
            theory: (basis == Basis::Linear)
                .then(|| (0.25, "first points reach a face, dx/4 away".into())),
            beyond: judge(basis, measured.value().map_or(2.0, |v| 1.1 * v)).1,
        }
    });
    let curve = |(basis, row): (&Basis, &Vec<(f64, Outcome)>)| {
        let points = amplitudes.iter().zip(row).map(|(&a, (rough, _))| [a, *rough]);
        Curve::measured(name(*basis), points.collect())
    };
    let limit = vec![[amplitudes[0], ROUGH], [2.0, ROUGH]];
    let curves = BASES.iter().zip(&rows).map(curve);
    Ok(Study {
        method: format!(
            "A free elastic bar of {LENGTH} cells vibrates in its first mode under FLIP with 2 x 2 \
             points a cell; its ends move by the given number of cells. After a period and a \
             quarter, the stress of a point is compared with the mean of its two neighbours: more \
             than {ROUGH} of the mean stress is failure. Linear functions have gradients that jump \
             at cell faces, so a point that crosses one kicks the grid."
        ),
        findings: findings.collect(),
        charts: vec![
            Chart {
                title: "Roughness of the stress".into(),
                x: "displacement, cells".into(),
                y: "roughness of the stress".into(),
                log: [true, true],
                curves: curves.chain([Curve::theory("limit", limit)]).collect(),
                caption: "A smooth half wave over 128 points has a roughness of 3e-4.".into(),
            },
            Chart {
                title: "Stress along the bar when its ends moved by one cell".into(),
                x: "place, cells".into(),
                y: "stress over Young's modulus".into(),
                log: [false, false],
                curves: vec![profile(Basis::Linear)?, profile(Basis::Quadratic)?],
                caption: "Points that crossed cell faces kick the grid of linear functions.".into(),
            },
        ],
        maps: vec![Map {
            title: "Cell crossing".into(),
            x: Axis::new("displacement, cells", amplitudes.clone()),
            y: Axis::named("basis", BASES.map(|b| name(b).to_owned()).into()),
            numbers: rows.iter().map(|row| row.iter().map(|(r, _)| *r).collect()).collect(),
            outcomes: rows
                .into_iter()
                .map(|row| row.into_iter().map(|(_, o)| o).collect())
                .collect(),
            caption: "Numbers: roughness of the stress.".into(),
        }],
        ..Study::default()
    })
}

/// Stress over Young's modulus along the lower row of points.
fn profile(basis: Basis) -> Result<Curve, StudyError> {
    let points = vibrate(basis, 1.0)?;
    let row = points.len() / 2;
    let places = points.position[..row].iter().zip(&points.stress);
    Ok(Curve::measured(name(basis), places.map(|(x, s)| [x.x - 8.0, s[(0, 0)]]).collect()))
}
