//! Over-compression: packings compressed until discs pass through each other.

use dem::RveParameters;
use dem::element::Element;
use nalgebra::Matrix2;
use rayon::prelude::*;

use super::outcome::Outcome;
use super::packing::{consolidated, picture};
use super::study::{Axis, Chart, Curve, Finding, Map, Study, StudyError};
use super::threshold::Threshold;
use crate::suite::Suite;

/// A sample of the path: areal strain, stiffness number `kn / (p t)`, largest overlap over the radius.
struct Look {
    strain: f64,
    stiffness_number: f64,
    overlap: f64,
    failure: Option<String>,
}

/// Compresses a packing isotropically at an areal strain rate (1/s) in steps of 1/200.
fn compress(
    p: &RveParameters,
    rate: f64,
    last: f64,
) -> Result<(Vec<Look>, Element<f64>), StudyError> {
    let step = 0.005;
    let macro_step = (step / rate).min(1.0e-4);
    let mut element = Element::new(consolidated(p, 1)?, p, macro_step)?;
    let per_look = (step / rate / macro_step).round() as usize;
    let drive = Matrix2::identity() * (-0.5 * rate);
    let mut looks = Vec::new();
    while looks.len() < (last / step) as usize {
        let mut overlap: f64 = 0.0;
        let failure = (0..per_look).find_map(|_| {
            let error = element.advance(&drive).err();
            overlap = overlap.max(element.state.relative_overlap);
            error.map(|e| e.to_string())
        });
        let pressure = 0.5 * element.state.stress.trace();
        let stiffness_number = p.grains.stiffness_number(pressure);
        let strain = (looks.len() + 1) as f64 * step;
        let failed = failure.is_some();
        looks.push(Look { strain, stiffness_number, overlap, failure });
        if failed {
            break;
        }
    }
    Ok((looks, element))
}

fn judge(look: &Look, p: &RveParameters) -> Outcome {
    if let Some(message) = &look.failure {
        return Outcome::Failed { message: message.clone() };
    }
    let deep = look.overlap > p.grains.overlap_warning;
    Outcome::of(
        None,
        deep.then(|| dempm::run::monitor::overlap(look.overlap, p.grains.overlap_warning)),
    )
}

/// Compresses packings until the run ends.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let p = RveParameters { discs: suite.pick(100, 400), ..RveParameters::default() };
    let rates = [1.0, 10.0, 100.0, 1000.0];
    let last = 1.0;
    let cases: Vec<(Vec<Look>, Element<f64>)> =
        rates.par_iter().map(|&rate| compress(&p, rate, last)).collect::<Result<_, _>>()?;
    let mut study = Study {
        method: format!(
            "A packing of {} discs prepared at 2 kPa is compressed isotropically, at areal strain \
             rates of 1 to 1000 1/s, until the run ends. An overlap of more than {} of a radius is \
             warned of, more than {} ends the run.",
            p.discs, p.grains.overlap_warning, p.grains.overlap_limit
        ),
        ..Study::default()
    };
    for (&rate, (looks, _)) in rates.iter().zip(&cases) {
        for (limit, name) in
            [(p.grains.overlap_warning, "warned"), (p.grains.overlap_limit, "ended")]
        {
            let reached = looks.iter().position(|l| l.overlap > limit || l.failure.is_some());
            let measured = match reached {
                Some(0) => Threshold::Before(looks[0].stiffness_number),
                Some(k) => {
                    Threshold::Between(looks[k - 1].stiffness_number, looks[k].stiffness_number)
                }
                None => Threshold::Beyond(looks.last().map_or(f64::NAN, |l| l.stiffness_number)),
            };
            study.findings.push(Finding {
                case: format!("{rate} 1/s: {name} (overlap {limit} r)"),
                parameter: "kappa = kn/(p t)".into(),
                measured,
                theory: Some((mean_field(limit), "mean overlap: δ/r = 2π/(Z φ κ)".into())),
                beyond: reached.map_or(Outcome::Stable, |k| judge(&looks[k], &p)),
            });
        }
    }
    let strains: Vec<f64> =
        (1..=suite.pick(10, 20)).map(|k| last * f64::from(k) / suite.pick(10.0, 20.0)).collect();
    // Beyond its end a run has failed as at its end.
    let at = |looks: &[Look], strain: f64| {
        looks.iter().position(|l| l.strain >= strain - 1e-9).unwrap_or(looks.len() - 1)
    };
    let each = |f: &dyn Fn(&Look) -> f64| -> Vec<Vec<f64>> {
        let row = |looks: &Vec<Look>| strains.iter().map(|&s| f(&looks[at(looks, s)])).collect();
        cases.iter().map(|(looks, _)| row(looks)).collect()
    };
    study.maps.push(Map {
        title: "Over-compression".into(),
        numbers: each(&|l| l.overlap),
        outcomes: cases
            .iter()
            .map(|(looks, _)| strains.iter().map(|&s| judge(&looks[at(looks, s)], &p)).collect())
            .collect(),
        x: Axis::new("areal strain", strains),
        y: Axis::new("strain rate, 1/s", rates.to_vec()),
        caption: "Numbers: largest overlap over the radius.".into(),
    });
    let curve = |(rate, (looks, _)): (&f64, &(Vec<Look>, Element<f64>))| {
        let points = looks.iter().map(|l| [l.stiffness_number, l.overlap]);
        Curve::measured(format!("{rate} 1/s"), points.collect())
    };
    let theory = [3.0, 10.0, 100.0, 1000.0].map(|kappa| [kappa, mean_field(kappa)]);
    study.charts.push(Chart {
        title: "Largest overlap against the stiffness number".into(),
        x: "kappa = kn/(p t)".into(),
        y: "largest overlap over the radius".into(),
        log: [true, true],
        curves: rates
            .iter()
            .zip(&cases)
            .map(curve)
            .chain([Curve::theory("mean overlap by theory", theory.into())])
            .collect(),
        caption: "The largest of some hundred overlaps is several times the mean.".into(),
    });
    study.pictures.extend(
        cases
            .first()
            .map(|(_, e)| picture(&e.rve.packing, "Over-compressed packing at the end".into())),
    );
    Ok(study)
}

/// Mean overlap over the radius of a dense packing at a stiffness number, and the stiffness number
/// of an overlap (the relation is its own inverse): `p t = Z phi kn delta / (2 pi r)`.
fn mean_field(x: f64) -> f64 {
    let (coordination, solid_fraction) = (4.0, 0.84);
    2.0 * std::f64::consts::PI / (coordination * solid_fraction * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dense packing at kappa = 222 has overlaps of about 0.6 % of a diameter.
    #[test]
    fn the_mean_overlap_is_that_of_known_packings() {
        assert!((mean_field(222.0) / 2.0 - 0.006).abs() < 0.003);
        assert!((mean_field(mean_field(50.0)) - 50.0).abs() < 1e-12);
    }
}
