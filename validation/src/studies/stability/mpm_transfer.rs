//! Dissipation of the velocity transfers over the step: viscosity, and energy of a vibrating bar.

use std::f64::consts::PI;

use mpm::{
    Domain, Elastic, ElasticParameters, Numerics, Points, Scheme, Solver, Transfer, Vec2, Walls,
};
use rayon::prelude::*;

use super::outcome::Outcome;
use super::scene_messages;
use super::study::{Axis, Chart, Curve, Finding, Map, Study, StudyError};
use super::threshold::{Threshold, log_range};
use crate::suite::Suite;
use crate::text::number;

/// As in a column of packings: cell (m), density (kg/m³), wave speed (m/s).
const CELL: f64 = 0.125;
const DENSITY: f64 = 2000.0;
const SPEED: f64 = 80.0;
/// Cells in a wave, and in the bar.
const WAVE: f64 = 32.0;
const LENGTH: f64 = 64.0;
const PERIODS: f64 = 5.0;
/// Where the bar begins (m), and how fast it moves (m/s).
const MARGIN: f64 = 4.0 * CELL;
const SHAKEN: f64 = 0.01;
/// Energy that may be lost or gained in these periods.
const LOSS: f64 = 0.1;
const GAIN: f64 = 0.01;

const TRANSFERS: [(&str, Transfer); 8] = [
    ("flip, 0", Transfer::Flip { rate: 0.0 }),
    ("flip, 1 1/s", Transfer::Flip { rate: 1.0 }),
    ("flip, 100 1/s", Transfer::Flip { rate: 100.0 }),
    ("flip-apic, 100 1/s", Transfer::FlipApic { rate: 100.0 }),
    ("flip-apic, 500 1/s (default)", Transfer::FlipApic { rate: 500.0 }),
    ("flip-apic, 2000 1/s", Transfer::FlipApic { rate: 2000.0 }),
    ("apic", Transfer::Apic),
    ("pic", Transfer::Pic),
];

/// A free elastic bar after [`PERIODS`] of its mode of two waves, and the part of its energy that is
/// left.
fn vibrate(transfer: Transfer, step: f64) -> Result<(Points, f64), StudyError> {
    let modulus = DENSITY * SPEED * SPEED;
    let numerics = Numerics { transfer, ..Numerics::default() };
    let size = Vec2::new((LENGTH + 8.0) * CELL, CELL);
    let domain = Domain { size, walls: Walls::default(), cell: CELL };
    let mut solver = Solver::new(domain, numerics, Vec2::zeros(), vec![])?;
    let law = ElasticParameters { young_modulus: modulus, poisson_ratio: 0.0 };
    let mut material = Elastic::new(law)?;
    let start = MARGIN;
    let end = start + LENGTH * CELL;
    let mut points =
        Points::rectangle(Vec2::new(start, 0.0), Vec2::new(end, CELL), CELL / 2.0, DENSITY);
    let k = 2.0 * PI / (WAVE * CELL);
    let v0 = SHAKEN;
    for p in 0..points.len() {
        let x = points.position[p].x - start;
        points.velocity[p].x = v0 * (k * x).cos();
        points.affine[p][(0, 0)] = -v0 * k * (k * x).sin();
    }
    let energy = |points: &Points| -> f64 {
        let of_point = |p: usize| {
            let s = points.stress[p][(0, 0)];
            0.5 * points.mass[p] * points.velocity[p].norm_squared()
                + 0.5 * points.volume[p] * s * s / modulus
        };
        (0..points.len()).map(of_point).sum()
    };
    let before = energy(&points);
    for _ in 0..(PERIODS * WAVE * CELL / SPEED / step).round() as usize {
        solver.advance(&mut points, &mut material, step)?;
    }
    let left = energy(&points) / before;
    Ok((points, left))
}

fn energy_left(transfer: Transfer, step: f64) -> Result<f64, StudyError> {
    Ok(vibrate(transfer, step)?.1)
}

/// Velocity along the lower row of points at the end, over that of the start.
fn profile(name: &str, transfer: Transfer, step: f64) -> Result<Curve, StudyError> {
    let (points, _) = vibrate(transfer, step)?;
    let row = points.position.iter().zip(&points.velocity).take(points.len() / 2);
    Ok(Curve::measured(name, row.map(|(x, v)| [x.x - MARGIN, v.x / SHAKEN]).collect()))
}

/// The same by theory.
fn lossless() -> Vec<[f64; 2]> {
    let places = (0..=128).map(|k| f64::from(k) / 128.0 * LENGTH * CELL);
    places.map(|x| [x, (2.0 * PI / (WAVE * CELL) * x).cos()]).collect()
}

/// Viscosity (m²/s) from the decay of a shear wave of [`WAVE`] cells in material without stress.
fn viscosity(transfer: Transfer, step: f64) -> Result<f64, StudyError> {
    let numerics = Numerics { scheme: Scheme::Usl, transfer, ..Numerics::default() };
    let size = Vec2::new(10.0 * CELL, 3.0 * WAVE * CELL);
    let domain = Domain { size, walls: Walls::default(), cell: CELL };
    let mut solver = Solver::new(domain, numerics, Vec2::zeros(), vec![])?;
    let (left, right) = (Vec2::new(3.0 * CELL, 0.0), Vec2::new(7.0 * CELL, size.y));
    let mut points = Points::rectangle(left, right, CELL / 2.0, DENSITY);
    // As good as none: E = 1e-6 Pa.
    let mut dust = Elastic::new(ElasticParameters { young_modulus: 1e-6, poisson_ratio: 0.0 })?;
    let k = 2.0 * PI / (WAVE * CELL);
    for p in 0..points.len() {
        let y = points.position[p].y;
        points.velocity[p].x = 1e-6 * (k * y).sin();
        points.affine[p][(0, 1)] = 1e-6 * k * (k * y).cos();
    }
    // The wave in the middle, far from the walls.
    let amplitude = |points: &Points| -> f64 {
        let points = points.position.iter().zip(&points.velocity);
        let middle = points.filter(|(x, _)| (x.y - 0.5 * size.y).abs() < 0.5 * WAVE * CELL);
        middle.map(|(x, v)| v.x * (k * x.y).sin()).sum()
    };
    let (before, steps) = (amplitude(&points), 20);
    for _ in 0..steps {
        solver.advance(&mut points, &mut dust, step)?;
    }
    Ok((before / amplitude(&points)).ln() / (f64::from(steps) * step) / (k * k))
}

/// `nu = (PIC share) dx² / (4 dt)`; the affine transfers only dissipate at fourth order.
fn theory(transfer: Transfer, step: f64) -> Option<f64> {
    match transfer {
        Transfer::Flip { rate } => Some(rate * CELL * CELL / 4.0),
        Transfer::Pic => Some(CELL * CELL / (4.0 * step)),
        Transfer::FlipApic { .. } | Transfer::Apic => None,
    }
}

/// Energy left under a viscosity (m²/s) by theory: it acts on the kinetic half of the energy.
fn share_left(viscosity: f64) -> f64 {
    let k = 2.0 * PI / (WAVE * CELL);
    (-viscosity * k * k * PERIODS * WAVE * CELL / SPEED).exp()
}

/// Errors or warnings of a scene with this transfer and step.
fn said(transfer: Transfer, step: f64) -> Option<String> {
    let (kind, rate) = match transfer {
        Transfer::Flip { rate } => ("flip", Some(rate)),
        Transfer::FlipApic { rate } => ("flip-apic", Some(rate)),
        Transfer::Apic => ("apic", None),
        Transfer::Pic => ("pic", None),
    };
    let rate = rate.map_or(String::new(), |rate| format!("relaxation = {rate:?}\n"));
    scene_messages::said(&format!(
        "duration = {0:?}\nframe_interval = {0:?}\nstep = {step:?}\n[domain]\nsize = [4.0, 2.0]\n\
         cell = 0.125\n[[column]]\nsize = [1.0, 1.0]\n[material]\nkind = \"mu-i\"\n[numerics]\n\
         transfer = \"{kind}\"\n{rate}",
        100.0 * step
    ))
}

fn judge(transfer: Transfer, step: f64) -> (f64, Outcome) {
    let said = said(transfer, step);
    match energy_left(transfer, step) {
        Ok(left) => {
            let gained = format!("gains {:.1} % of its energy", 100.0 * (left - 1.0));
            let lost = format!("loses {:.0} % of its energy", 100.0 * (1.0 - left));
            let symptom =
                if left > 1.0 + GAIN { Some(gained) } else { (left < 1.0 - LOSS).then_some(lost) };
            (left, Outcome::of(symptom, said))
        }
        Err(error) => (f64::NAN, Outcome::Failed { message: error.to_string() }),
    }
}

/// Measures the energy and the viscosity of each transfer over the step.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let steps = log_range(2.5e-5, 8.0e-4, suite.pick(6, 11));
    let rows: Vec<Vec<(f64, Outcome)>> = TRANSFERS
        .par_iter()
        .map(|&(_, transfer)| steps.par_iter().map(|&step| judge(transfer, step)).collect())
        .collect();
    let findings = TRANSFERS.iter().zip(&rows).map(|((name, _), row)| {
        // From the longest step down: the share of a step is what dissipates.
        let sweep = steps.iter().zip(row).rev().map(|(&s, (_, o))| (s, o.works()));
        Finding {
            case: (*name).to_owned(),
            parameter: "smallest step, s".into(),
            measured: Threshold::of_sweep(sweep),
            theory: None,
            beyond: Outcome::first_failure(row.iter().rev().map(|(_, o)| o)),
        }
    });
    let mut curves = Vec::new();
    // Plain FLIP has none but the grid's own, 1e-9 m²/s.
    for &(name, transfer) in &TRANSFERS[1..] {
        let measured = steps.iter().map(|&s| Ok([s, viscosity(transfer, s)?]));
        curves.push(Curve::measured(name, measured.collect::<Result<_, StudyError>>()?));
        let expected = steps.iter().filter_map(|&s| Some([s, theory(transfer, s)?]));
        let expected: Vec<[f64; 2]> = expected.filter(|[_, nu]| *nu > 0.0).collect();
        if !expected.is_empty() {
            let known = curves.iter().any(|c: &Curve| c.theory);
            curves.push(Curve::theory(if known { "" } else { "theory" }, expected));
        }
    }
    let shortest = steps[0];
    let bars = [
        profile("flip-apic, 500 1/s", Transfer::default(), shortest)?,
        profile("flip, 100 1/s", Transfer::Flip { rate: 100.0 }, shortest)?,
        profile("apic", Transfer::Apic, shortest)?,
        profile("pic", Transfer::Pic, shortest)?,
        Curve::theory("without losses", lossless()),
    ];
    Ok(Study {
        method: format!(
            "A free elastic bar (waves of {SPEED} m/s, cells of {CELL} m) vibrates with two waves of \
             {WAVE} cells along it for {PERIODS} periods; failure is more than {:.0} % of the energy \
             lost or {:.0} % gained. Viscosity: from the decay of a shear wave of {WAVE} cells in \
             material without stress.",
            100.0 * LOSS,
            100.0 * GAIN
        ),
        findings: findings.collect(),
        maps: vec![Map {
            title: "Energy of a vibrating bar".into(),
            x: Axis::new("step, s", steps.clone()),
            y: Axis::named("transfer", TRANSFERS.map(|(name, _)| name.to_owned()).into()),
            numbers: rows.iter().map(|row| row.iter().map(|(left, _)| *left).collect()).collect(),
            outcomes: rows
                .into_iter()
                .map(|row| row.into_iter().map(|(_, o)| o).collect())
                .collect(),
            caption: format!(
                "Numbers: share of the energy left after {PERIODS} periods. By theory exp(-ν k² t) is \
                 left: {} for flip at 100 1/s, whatever the step.",
                number(share_left(100.0 * CELL * CELL / 4.0))
            ),
        }],
        charts: vec![
            Chart {
                title: "The bar at the end, with the shortest step".into(),
                x: "place, m".into(),
                y: "velocity over that of the start".into(),
                log: [false, false],
                curves: bars.into(),
                caption: format!("After {PERIODS} periods the bar should move as at the start."),
            },
            Chart {
                title: "Viscosity of the transfers".into(),
                x: "step, s".into(),
                y: "viscosity, m²/s".into(),
                log: [true, true],
                curves,
                caption:
                    "Lines: nu = (PIC share per step) dx²/(4 dt), for FLIP and PIC. A share given \
                      per second makes a viscosity that does not depend on the step; PIC and APIC \
                      dissipate more the shorter the step."
                        .into(),
            },
        ],
        ..Study::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viscosity_and_loss_are_those_of_theory() {
        let (transfer, step) = (Transfer::Flip { rate: 100.0 }, 2.0e-4);
        let expected = theory(transfer, step).unwrap();
        // Fourth-order terms: (k dx)²/4 = 1 %; the decay in a step is not infinitesimal: another.
        assert!((viscosity(transfer, step).unwrap() / expected - 1.0).abs() < 0.03);
        assert!((energy_left(transfer, step).unwrap() / share_left(expected) - 1.0).abs() < 0.02);
        assert!(energy_left(Transfer::default(), step).unwrap() > 0.98);
    }
}
