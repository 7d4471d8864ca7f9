//! Damping and mass scaling, which make a packing stronger than it is.

use dem::element::{Element, Row, Stage};
use dem::{Grains, Packing, RveParameters};
use mpm::DruckerPragerParameters;
use rayon::prelude::*;

use super::outcome::Outcome;
use super::packing::{consolidated, picture};
use super::scene_messages;
use super::study::{Axis, Chart, Curve, Finding, Map, Study, StudyError};
use super::threshold::Threshold;
use crate::suite::Suite;

const PRESSURE: f64 = 20.0e3;
/// Tolerated relative change of the friction.
const TOLERANCE: f64 = 0.15;

/// Shear rate (1/s) of an inertial number with the true mass.
fn rate(p: &RveParameters, inertial_number: f64) -> f64 {
    inertial_number / (p.grains.mean_diameter() * (p.grains.grain_density / PRESSURE).sqrt())
}

/// Steady shear at constant pressure, and its friction `tau / p`: mean over strains of 1/2 to the
/// end.
fn sheared(
    packing: &Packing<f64>,
    p: &RveParameters,
    inertial_number: f64,
    strain: f64,
) -> Result<(f64, Element<f64>), StudyError> {
    let mut packing = packing.clone();
    packing.scale_mass(p.grains.mass_scale);
    let shear_rate = rate(p, inertial_number);
    let mut element = Element::new(packing, p, 10.0 * p.grains.step())?;
    let stage = Stage::ConstantPressureShear { pressure: PRESSURE, shear_rate, strain };
    let mut rows: Vec<Row> = Vec::new();
    element.run(&stage, 0.05 / shear_rate, |row| rows.push(*row))?;
    let late: Vec<&Row> = rows.iter().filter(|row| row.strain[(0, 1)] > 0.5).collect();
    let mean = |of: &dyn Fn(&Row) -> f64| late.iter().map(|row| of(row)).sum::<f64>();
    let friction = (mean(&|row| row.stress[(0, 1)]) / mean(&|row| row.stress[(1, 1)])).abs();
    Ok((friction, element))
}

fn friction(
    packing: &Packing<f64>,
    p: &RveParameters,
    inertial_number: f64,
    strain: f64,
) -> Result<f64, StudyError> {
    Ok(sheared(packing, p, inertial_number, strain)?.0)
}

/// Warnings of `dempm run` and `dempm check` for a column of such packings.
fn said(p: &RveParameters) -> Option<String> {
    scene_messages::checked(&format!(
        "duration = 1.5\n[domain]\nsize = [6.0, 2.0]\n[[column]]\nsize = [1.0, 1.0]\n\
         [material]\nkind = \"rve\"\n[grains]\nmass_scale = {:?}\nlocal_damping = {:?}\n\
         damping_ratio = {:?}\n",
        p.grains.mass_scale, p.grains.local_damping, p.grains.damping_ratio
    ))
}

/// A parameter that is varied: name, values, and how it is set.
struct Sweep {
    name: &'static str,
    values: Vec<f64>,
    set: fn(&mut RveParameters, f64),
}

impl Sweep {
    fn parameters(&self, base: &RveParameters, value: f64) -> RveParameters {
        let mut p = base.clone();
        (self.set)(&mut p, value);
        p
    }
}

/// Measures the friction of packings over damping and mass scaling.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let mut base = RveParameters { discs: suite.pick(200, 400), ..RveParameters::default() };
    base.preparation.pressure = PRESSURE;
    let packing = consolidated(&base, 1)?;
    let others = [consolidated(&base, 2)?, consolidated(&base, 3)?];
    let numbers = vec![0.01, 0.03, 0.1];
    let sweeps = [
        Sweep {
            name: "mass_scale",
            values: vec![1.0, 3.0, 10.0, 30.0, 100.0, 1000.0, 10_000.0],
            set: |p, value| p.grains.mass_scale = value,
        },
        Sweep {
            name: "local_damping",
            values: vec![0.0, 0.1, 0.2, 0.5, 0.7],
            set: |p, value| p.grains.local_damping = value,
        },
        Sweep {
            name: "damping_ratio",
            values: vec![0.2, 0.05, 0.1, 0.5, 0.9],
            set: |p, value| p.grains.damping_ratio = value,
        },
    ];
    let mut study = Study {
        method: format!(
            "{} discs in steady shear at a constant pressure of {:.0} kPa, friction tau/p averaged \
             over strains of 0.5 to {}. Failure: more than {:.0} % away from the mean of three \
             packings with the defaults. Inertial numbers are those of the true mass; scaled masses raise them by the root \
             of mass_scale.",
            base.discs,
            PRESSURE / 1e3,
            strain(suite),
            100.0 * TOLERANCE
        ),
        ..Study::default()
    };
    // What all are compared with: the default, from three packings.
    let reference: Vec<f64> = numbers
        .par_iter()
        .map(|&i| {
            let packings = [&packing, &others[0], &others[1]];
            let each =
                packings.par_iter().map(|packing| friction(packing, &base, i, strain(suite)));
            Ok(each.collect::<Result<Vec<f64>, StudyError>>()?.iter().sum::<f64>() / 3.0)
        })
        .collect::<Result<_, StudyError>>()?;
    for sweep in &sweeps {
        let measured: Vec<Vec<f64>> = numbers
            .par_iter()
            .map(|&i| {
                let of = |&value: &f64| {
                    friction(&packing, &sweep.parameters(&base, value), i, strain(suite))
                };
                sweep.values.par_iter().map(of).collect()
            })
            .collect::<Result<_, StudyError>>()?;
        add(&mut study, sweep, &base, &numbers, &reference, measured);
    }
    let heavy =
        RveParameters { grains: Grains { mass_scale: 100.0, ..base.grains }, ..base.clone() };
    let (friction, element) = sheared(&packing, &heavy, 0.1, 1.0)?;
    let title = format!("Masses scaled by 100 at I = 0.1: tau/p = {friction:.2}");
    study.pictures.push(picture(&element.rve.packing, title));
    Ok(study)
}

fn strain(suite: Suite) -> f64 {
    suite.pick(4.0, 10.0)
}

fn add(
    study: &mut Study,
    sweep: &Sweep,
    base: &RveParameters,
    numbers: &[f64],
    reference: &[f64],
    measured: Vec<Vec<f64>>,
) {
    let said: Vec<Option<String>> =
        sweep.values.iter().map(|&v| said(&sweep.parameters(base, v))).collect();
    let judge = |(row, reference): (&Vec<f64>, &f64)| -> Vec<Outcome> {
        let outcome = |(friction, said): (&f64, &Option<String>)| {
            let change = friction / reference - 1.0;
            let symptom = format!("friction {friction:.3}, {:+.0} %", 100.0 * change);
            Outcome::of((change.abs() > TOLERANCE).then_some(symptom), said.clone())
        };
        row.iter().zip(&said).map(outcome).collect()
    };
    let outcomes: Vec<Vec<Outcome>> = measured.iter().zip(reference).map(judge).collect();
    for (&i, row) in numbers.iter().zip(&outcomes) {
        let works = sweep.values.iter().zip(row).map(|(&v, o)| (v, o.works()));
        study.findings.push(Finding {
            case: format!("{} at I = {i}", sweep.name),
            parameter: sweep.name.into(),
            measured: Threshold::of_sweep(works),
            theory: (sweep.name == "mass_scale")
                .then(|| (scaled_theory(i), "μ(I √s) = 1.15 μ(I)".into())),
            beyond: Outcome::first_failure(row),
        });
    }
    if sweep.name == "mass_scale" {
        let law = DruckerPragerParameters::default();
        let curves = numbers.iter().zip(&measured).map(|(&i, row)| {
            let points = sweep.values.iter().zip(row).map(|(s, mu)| [i * s.sqrt(), *mu]);
            Curve::measured(format!("I = {i} without scaling"), points.collect())
        });
        let theory = (0..40).map(|k| {
            let i = 1e-3 * 10_f64.powf(f64::from(k) / 10.0);
            [i, law.friction(i)]
        });
        let mut curves: Vec<Curve> = curves.collect();
        curves.push(Curve::theory("mu(I) law", theory.collect()));
        study.charts.push(Chart {
            title: "Friction with scaled masses".into(),
            x: "inertial number with the scaled mass".into(),
            y: "tau/p".into(),
            log: [true, false],
            curves,
            caption: "A scaled mass acts as a larger inertial number and in no other way: the \
                      points of all rates lie on one curve."
                .into(),
        });
    }
    study.maps.push(Map {
        title: format!("Strength against {}", sweep.name),
        x: Axis::new(sweep.name, sweep.values.clone()),
        y: Axis::new("inertial number", numbers.to_vec()),
        outcomes,
        numbers: measured,
        caption: "Numbers: tau/p.".into(),
    });
}

/// Mass scale at which the mu(I) law's friction is [`TOLERANCE`] larger.
fn scaled_theory(i: f64) -> f64 {
    let law = DruckerPragerParameters::default();
    let target = (1.0 + TOLERANCE) * law.friction(i);
    // mu = mu_s + (mu_2 - mu_s) I / (I_0 + I), solved for I.
    let share = (target - law.static_friction) / (law.dynamic_friction - law.static_friction);
    (law.inertial_number * share / (1.0 - share) / i).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_theoretical_scale_raises_the_laws_friction_by_the_tolerance() {
        let law = DruckerPragerParameters::default();
        for i in [0.01, 0.03, 0.1] {
            let scaled = law.friction(i * scaled_theory(i).sqrt());
            assert!((scaled / law.friction(i) - 1.0 - TOLERANCE).abs() < 1e-12);
        }
    }
}
