//! Thin cells: packings stretched until their cell is too thin for them.

use dem::RveParameters;
use dem::cuda::Room;
use dem::element::{Element, sin_phi};
use dempm::scene::{self, Precision};
use nalgebra::Matrix2;
use rayon::prelude::*;

use super::outcome::Outcome;
use super::packing::{consolidated, picture};
use super::study::{Axis, Chart, Curve, Finding, Map, Picture, Study, StudyError};
use super::threshold::Threshold;
use crate::suite::Suite;

const PRESSURE: f64 = 20.0e3;
/// Strain rate (1/s); inertial numbers are below 0.02.
const RATE: f64 = 4.0;
/// Strain between two samples.
const WINDOW: f64 = 0.25;
/// Critical state, measured on square cells.
const SIN_PHI: f64 = 0.30;
/// Strength outside of these is not that of the material.
const SOUND: [f64; 2] = [0.2, 0.4];

/// Widths at which cells are held: the default, and never.
const THIN_WIDTHS: [f64; 2] = [3.0, 0.0];

/// A packing and what was seen while it was stretched.
struct Stretched {
    p: RveParameters,
    looks: Vec<Look>,
    picture: Picture,
}

/// A sample of the path: Hencky strain, width over mean diameter, mean `sin phi` of the window, held thin, and
/// what ended the path.
struct Look {
    strain: f64,
    width: f64,
    sin_phi: f64,
    thin: bool,
    failure: Option<String>,
}

/// Stretches a packing along x and shortens it as much along y.
fn stretch(p: &RveParameters, looks: usize) -> Result<(Vec<Look>, Picture), StudyError> {
    let mut element = Element::new(consolidated(p, 1)?, p, 1.0e-4)?;
    let mut found = Vec::new();
    let steps = (WINDOW / RATE / element.macro_step).round() as usize;
    let drive = Matrix2::new(RATE, 0.0, 0.0, -RATE);
    let mut failure: Option<String> = None;
    for n in 1..=looks {
        let held = element.thin_steps;
        let mut stress = Matrix2::zeros();
        for _ in 0..if failure.is_some() { 0 } else { steps } {
            match element.advance(&drive) {
                Ok(()) => stress += element.state.stress,
                Err(error) => {
                    failure = Some(error.to_string());
                    break;
                }
            }
        }
        found.push(Look {
            strain: n as f64 * WINDOW,
            width: element.rve.packing.cell.min_width() / p.grains.mean_diameter(),
            sin_phi: if failure.is_some() { f64::NAN } else { sin_phi(&stress) },
            thin: element.thin_steps > held,
            failure: failure.clone(),
        });
    }
    let strain = looks as f64 * WINDOW;
    let title = format!("{} discs, thin_width {}, stretched by e^{strain}", p.discs, p.thin_width);
    Ok((found, picture(&element.rve.packing, title)))
}

fn judge(look: &Look, p: &RveParameters) -> Outcome {
    if let Some(message) = &look.failure {
        return Outcome::Failed { message: message.clone() };
    }
    let held = look
        .thin
        .then(|| dempm::run::monitor::thin(p.thin_width, look.width * p.grains.mean_diameter()));
    let sound = (SOUND[0]..SOUND[1]).contains(&look.sin_phi);
    let symptom = format!("sin phi {:.2} in a cell {:.1} diameters wide", look.sin_phi, look.width);
    Outcome::of((!sound).then_some(symptom), held.or_else(|| said(p)))
}

/// Errors or warnings of a scene with this limit.
fn said(p: &RveParameters) -> Option<String> {
    super::scene_messages::said(&format!(
        "duration = 0.1\n[domain]\nsize = [4.0, 2.0]\n[[column]]\nsize = [1.0, 1.0]\n\
         [material]\nkind = \"rve\"\n[rve]\nthin_width = {:?}\n",
        p.thin_width
    ))
}

/// Stretches packings until their cells are thin, and measures their strength.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let sizes = suite.pick(vec![100, 200, 400], vec![50, 100, 200, 400, 800, 1600]);
    let looks = suite.pick(10, 16);
    let mut study = Study {
        method: format!(
            "Packings prepared at {:.0} kPa are stretched along x and shortened along y at {RATE} 1/s: \
             pure extension, which the reduction of the lattice cannot help, so that the cell \
             becomes exp(-strain) times as wide. Sound: sin phi between {} and {} (critical state \
             {SIN_PHI}) in a strain of {WINDOW}. With thin_width = 3 (default) a cell thinner than 3 \
             diameters keeps its shape and is counted; with 0 it is deformed on.",
            PRESSURE / 1e3,
            SOUND[0],
            SOUND[1]
        ),
        ..Study::default()
    };
    let jobs: Vec<(f64, usize)> = THIN_WIDTHS
        .iter()
        .flat_map(|&thin_width| sizes.iter().map(move |&discs| (thin_width, discs)))
        .collect();
    let stretched = |&(thin_width, discs): &(f64, usize)| {
        let mut p = RveParameters { discs, thin_width, ..RveParameters::default() };
        p.preparation.pressure = PRESSURE;
        let (looks, picture) = stretch(&p, looks)?;
        Ok(Stretched { p, looks, picture })
    };
    let made: Vec<Stretched> = jobs.par_iter().map(stretched).collect::<Result<_, StudyError>>()?;
    for (cases, thin_width) in made.chunks(sizes.len()).zip(THIN_WIDTHS) {
        add(&mut study, thin_width, cases);
    }
    Ok(study)
}

fn add(study: &mut Study, thin_width: f64, cases: &[Stretched]) {
    let mut outcomes = Vec::new();
    let mut curves = Vec::new();
    for Stretched { p, looks, .. } in cases {
        let row: Vec<Outcome> = looks.iter().map(|look| judge(look, p)).collect();
        let side = scene::Rve {
            parameters: p.clone(),
            packings: 1,
            precision: Precision::F64,
            neighbours: Room::Usual,
        }
        .side();
        if thin_width > 0.0 {
            let first = looks.iter().map(|look| (look.strain, !look.thin));
            study.findings.push(Finding {
                case: format!("{} discs: held thin", p.discs),
                parameter: "extension, Hencky strain".into(),
                measured: Threshold::of_sweep(first),
                theory: Some((
                    (side / (thin_width * p.grains.mean_diameter())).ln(),
                    "ln(side / 3 diameters)".into(),
                )),
                beyond: looks
                    .iter()
                    .zip(&row)
                    .find(|(l, _)| l.thin)
                    .map_or(Outcome::Stable, |(_, o)| o.clone()),
            });
        }
        let strengths = looks.iter().zip(&row).map(|(look, o)| (look.strain, o.works()));
        study.findings.push(Finding {
            case: format!("{} discs, thin_width {thin_width}: strength", p.discs),
            parameter: "extension, Hencky strain".into(),
            measured: Threshold::of_sweep(strengths),
            theory: None,
            beyond: Outcome::first_failure(&row),
        });
        let points = looks.iter().map(|look| [look.width, look.sin_phi]).collect();
        curves.push(Curve::measured(format!("{} discs", p.discs), points));
        outcomes.push(row);
    }
    let strains = cases[0].looks.iter().map(|look| look.strain).collect();
    study.maps.push(Map {
        title: format!("Stretched packings, thin_width {thin_width}"),
        x: Axis::new("Hencky strain", strains),
        y: Axis::new("discs", cases.iter().map(|case| case.p.discs as f64).collect()),
        outcomes,
        numbers: cases.iter().map(|case| case.looks.iter().map(|l| l.sin_phi).collect()).collect(),
        caption: "Numbers: sin phi.".into(),
    });
    study.charts.push(Chart {
        title: format!("Strength of thin cells, thin_width {thin_width}"),
        x: "width of the cell, mean diameters".into(),
        y: "sin phi".into(),
        log: [true, false],
        curves,
        caption: format!("Critical state of square cells: {SIN_PHI}."),
    });
    study.pictures.extend(cases.first().map(|case| case.picture.clone()));
}
