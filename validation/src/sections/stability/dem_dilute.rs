//! Dilute packings and their recompaction.

use dem::RveParameters;
use dem::element::Element;
use nalgebra::Matrix2;
use rayon::prelude::*;

use super::outcome::Outcome;
use super::packing::{consolidated, picture};
use super::study::{Axis, Finding, Map, Picture, Study, StudyError, pick};
use super::threshold::Threshold;
use crate::context::Suite;

const PRESSURE: f64 = 2.0e3;
/// The solid fraction at which a recompacted packing carries its first pressure again may differ by
/// this from that of its preparation.
const TOLERANCE: f64 = 0.02;

/// A packing expanded to `expansion` times its area and compressed again, at a rate (1/s).
struct Cycle {
    /// Solid fraction at which the pressure is [`PRESSURE`] again; not a number if it never was.
    returned: f64,
    prepared: f64,
    overlap: f64,
    free_steps: usize,
    failure: Option<String>,
    picture: Picture,
}

fn cycle(p: &RveParameters, expansion: f64, rate: f64) -> Result<Cycle, StudyError> {
    let packing = consolidated(p, 1)?;
    let prepared = packing.solid_fraction();
    let mut element = Element::new(packing, p, 1.0e-4)?;
    let steps = (expansion.ln() / rate / element.macro_step).ceil() as usize;
    let mut cycle = Cycle {
        returned: f64::NAN,
        prepared,
        overlap: 0.0,
        free_steps: 0,
        failure: None,
        picture: Picture::default(),
    };
    let (half, free) = (Matrix2::identity() * (0.5 * rate), PRESSURE);
    for n in 0..2 * steps + 200 {
        let back = n >= steps;
        // A little further than it came, should it have become looser or denser.
        let drive = if back { -half } else { half };
        if let Err(error) = element.advance(&drive) {
            cycle.failure = Some(error.to_string());
            break;
        }
        let state = &element.state;
        cycle.overlap = cycle.overlap.max(state.relative_overlap);
        if back && 0.5 * state.stress.trace() > free {
            cycle.returned = state.solid_fraction;
            break;
        }
    }
    cycle.free_steps = element.free_steps;
    cycle.picture = picture(
        &element.rve.packing,
        format!("Recompacted from {expansion} times its area at {rate} 1/s, free_solid_fraction {}", p.free_solid_fraction),
    );
    Ok(cycle)
}

fn judge(cycle: &Cycle, p: &RveParameters) -> Outcome {
    if let Some(message) = &cycle.failure {
        return Outcome::Failed { message: message.clone() };
    }
    let symptom = if cycle.returned.is_nan() {
        Some("carries no pressure at its old area".to_owned())
    } else {
        let change = cycle.returned - cycle.prepared;
        (change.abs() > TOLERANCE).then(|| format!("jams at a solid fraction {change:+.3} off"))
    };
    let free = (cycle.free_steps > 0)
        .then(|| format!("{} RVE steps stress-free (free_solid_fraction = {})", cycle.free_steps, p.free_solid_fraction));
    let deep = (cycle.overlap > p.overlap_warning)
        .then(|| dempm::watch::overlap(cycle.overlap, p.overlap_warning));
    Outcome::of(symptom, deep.or(free))
}

pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let base = RveParameters { discs: pick(suite, 100, 400), ..RveParameters::default() };
    let expansions = vec![1.02, 1.1, 1.2, 1.3, 1.6, 2.0, 4.0];
    let rates = vec![1.0, 10.0, 100.0];
    let mut study = Study {
        method: format!(
            "A dense packing of {} discs at {:.0} kPa is expanded to so many times its area and \
             compressed again until it carries that pressure. Failure: the solid fraction at that \
             moment is more than {TOLERANCE} from that of the preparation. Below \
             free_solid_fraction (0.70 by default) an RVE only keeps its area and restarts from its \
             prepared packing; with 0 its discs fly on as a gas.",
            base.discs,
            PRESSURE / 1e3
        ),
        ..Study::default()
    };
    for free_solid_fraction in [0.7, 0.0] {
        let p = RveParameters { free_solid_fraction, ..base.clone() };
        let rows: Vec<Vec<Cycle>> = rates
            .par_iter()
            .map(|&rate| expansions.par_iter().map(|&e| cycle(&p, e, rate)).collect())
            .collect::<Result<_, StudyError>>()?;
        let outcomes: Vec<Vec<Outcome>> =
            rows.iter().map(|row| row.iter().map(|c| judge(c, &p)).collect()).collect();
        for (&rate, row) in rates.iter().zip(&outcomes) {
            let works = expansions.iter().zip(row).map(|(&e, o)| (e, o.works()));
            study.findings.push(Finding {
                case: format!("free_solid_fraction {free_solid_fraction}, {rate} 1/s"),
                parameter: "area over that of the start".into(),
                measured: Threshold::of_sweep(works),
                theory: None,
                beyond: row.iter().find(|o| !o.works()).or(row.last()).cloned().unwrap_or(Outcome::Stable),
            });
        }
        study.maps.push(Map {
            title: format!("Recompaction, free_solid_fraction {free_solid_fraction}"),
            numbers: rows.iter().map(|row| row.iter().map(|c| c.returned).collect()).collect(),
            outcomes,
            x: Axis::new("area over that of the start", expansions.clone()),
            y: Axis::new("strain rate, 1/s", rates.clone()),
            caption: format!(
                "Numbers: solid fraction at {:.0} kPa on the way back; {:.3} before.",
                PRESSURE / 1e3,
                rows[0][0].prepared
            ),
        });
        study.pictures.extend(rows.into_iter().next_back().and_then(|row| row.into_iter().next_back()).map(|c| c.picture));
    }
    Ok(study)
}
