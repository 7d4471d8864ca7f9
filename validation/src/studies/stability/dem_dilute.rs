//! Dilute packings and their recompaction.

use dem::RveParameters;
use dem::element::Element;
use nalgebra::Matrix2;
use rayon::prelude::*;

use super::outcome::Outcome;
use super::packing::{consolidated, picture};
use super::study::{Axis, Chart, Curve, Finding, Map, Picture, Study, StudyError};
use super::threshold::Threshold;
use crate::suite::Suite;

const PRESSURE: f64 = 2.0e3;
/// The solid fraction at which a recompacted packing carries its first pressure again may be off by
/// this.
const TOLERANCE: f64 = 0.02;

/// A packing expanded to `expansion` times its area and compressed again, at a rate (1/s).
struct Cycle {
    /// Solid fraction at which the pressure is [`PRESSURE`] again; not a number if it never was.
    returned: f64,
    prepared: f64,
    overlap: f64,
    free_steps: usize,
    steps: usize,
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
        steps: 2 * steps,
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
        format!(
            "Recompacted from {expansion} times its area at {rate} 1/s, free_solid_fraction {}",
            p.free_solid_fraction
        ),
    );
    Ok(cycle)
}

/// Judges a cycle by one whose discs flew on as a gas.
fn judge(cycle: &Cycle, gas: &Cycle, p: &RveParameters) -> Outcome {
    if let Some(message) = &cycle.failure {
        return Outcome::Failed { message: message.clone() };
    }
    let change = cycle.returned - gas.returned;
    let symptom = (change.is_nan() || change.abs() > TOLERANCE)
        .then(|| format!("jams at a solid fraction {change:+.3} off"));
    let free = (cycle.free_steps > 0).then(|| {
        let part = 100.0 * cycle.free_steps as f64 / cycle.steps as f64;
        format!("stress-free {part:.0} % of RVE steps")
    });
    let deep = (cycle.overlap > p.grains.overlap_warning)
        .then(|| dempm::run::monitor::overlap(cycle.overlap, p.grains.overlap_warning));
    Outcome::of(symptom, deep.or(free))
}

/// Expands packings, compresses them again and measures the density at which they carry pressure.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let p = RveParameters { discs: suite.pick(100, 400), ..RveParameters::default() };
    let flying = RveParameters { free_solid_fraction: 0.0, ..p.clone() };
    let expansions = vec![1.02, 1.1, 1.2, 1.3, 1.6, 2.0, 4.0];
    let rates = vec![1.0, 10.0, 100.0];
    let cycles = |p: &RveParameters| -> Result<Vec<Vec<Cycle>>, StudyError> {
        let row = |&rate: &f64| expansions.par_iter().map(|&e| cycle(p, e, rate)).collect();
        rates.par_iter().map(row).collect()
    };
    let (rows, gas) = (cycles(&p)?, cycles(&flying)?);
    let judged = |(row, gas): (&Vec<Cycle>, &Vec<Cycle>)| -> Vec<Outcome> {
        row.iter().zip(gas).map(|(cycle, gas)| judge(cycle, gas, &p)).collect()
    };
    let outcomes: Vec<Vec<Outcome>> = rows.iter().zip(&gas).map(judged).collect();
    let findings = rates.iter().zip(&outcomes).map(|(&rate, row)| Finding {
        case: format!("recompaction at {rate} 1/s"),
        parameter: "area over that of the start".into(),
        measured: Threshold::of_sweep(expansions.iter().zip(row).map(|(&e, o)| (e, o.works()))),
        theory: None,
        beyond: Outcome::first_failure(row),
    });
    let curve = |name: &str, rate: &f64, row: &Vec<Cycle>| {
        let points = expansions.iter().zip(row).map(|(&e, c)| [e, c.returned]).collect();
        Curve::measured(format!("{name}, {rate} 1/s"), points)
    };
    let mut curves = Vec::new();
    for (rate, (row, gas)) in rates.iter().zip(rows.iter().zip(&gas)) {
        curves.extend([curve("default", rate, row), curve("flying", rate, gas)]);
    }
    let prepared = rows[0][0].prepared;
    curves.push(Curve::theory("as prepared", vec![[1.02, prepared], [4.0, prepared]]));
    Ok(Study {
        method: format!(
            "A dense packing of {} discs at {:.0} kPa is expanded to so many times its area and \
             compressed again until it carries that pressure. Below free_solid_fraction (0.70 by \
             default) an RVE only keeps its area, and restarts from its prepared packing when dense \
             enough. Failure: the solid fraction at which it carries the pressure again is more than \
             {TOLERANCE} from that of discs that fly on as a gas (free_solid_fraction = 0).",
            p.discs,
            PRESSURE / 1e3
        ),
        findings: findings.collect(),
        maps: vec![Map {
            title: "Recompaction".into(),
            numbers: rows.iter().map(|row| row.iter().map(|c| c.returned).collect()).collect(),
            outcomes,
            x: Axis::new("area over that of the start", expansions.clone()),
            y: Axis::new("strain rate, 1/s", rates.clone()),
            caption: format!("Numbers: solid fraction on the way back; {prepared:.3} before."),
        }],
        charts: vec![Chart {
            title: "Solid fraction of recompacted packings".into(),
            x: "area over that of the start".into(),
            y: "solid fraction at the old pressure".into(),
            log: [false, false],
            curves,
            caption:
                "A restart from the prepared packing is denser than what a gas becomes when it \
                      is compressed slowly."
                    .into(),
        }],
        pictures: [rows, gas]
            .into_iter()
            .filter_map(|rows| rows.into_iter().next()?.into_iter().next_back())
            .map(|cycle| cycle.picture)
            .collect(),
        ..Study::default()
    })
}
