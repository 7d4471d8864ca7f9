//! The mu(I) law of the same grains: shear of packings over inertial numbers, their stiffness and density.

use dem::element::{Element, Stage};
use dem::{RveParameters, consolidate};
use mpm::DruckerPragerParameters;
use nalgebra::Matrix2;
use rayon::prelude::*;

use super::error::CalibrationError;
use super::experiment::{Specimen, steady_friction, steady_shear};
use super::laboratory::{Laboratory, Progress, Task, parameters};
use super::line::Line;

/// The law with what it was fitted to.
#[derive(Clone, Debug, PartialEq)]
pub struct Law {
    /// Parameters of `[mu-i]`.
    pub parameters: DruckerPragerParameters,
    /// Inertial number, mean `sin phi` over packings and its standard deviation.
    pub points: Vec<[f64; 3]>,
}

/// Inertial numbers of the shear tests.
const INERTIAL: [f64; 6] = [1.0e-3, 3.0e-3, 1.0e-2, 3.0e-2, 0.1, 0.3];
/// Strain of the elastic moduli, its rate (1/s), and the rest after it (s).
const STRAIN: f64 = 2.0e-4;
const RATE: f64 = 0.05;
const REST: f64 = 0.01;
/// Candidates of `I_0`.
const I0: [f64; 2] = [0.03, 3.0];
/// Largest friction at infinite inertial number.
const STRONGEST: f64 = 0.99;

/// Shear tests of a fit to so many packings.
pub fn tests(packings: usize) -> usize {
    INERTIAL.len() * packings
}

/// Fits the law to `packings` packings at a pressure (Pa); `None` if it was told to stop.
///
/// # Errors
/// A packing cannot be made or sheared, or the device fails.
pub fn fit(
    laboratory: &Laboratory<impl Progress>,
    rve: &RveParameters,
    pressure: f64,
    packings: usize,
    seed: u64,
) -> Result<Option<Law>, CalibrationError> {
    let seeds: Vec<u64> = (0..packings as u64).map(|k| seed.wrapping_shl(32) + k).collect();
    let tasks: Vec<Task> = INERTIAL
        .iter()
        .flat_map(|&inertial| {
            let loading = steady_shear(&rve.grains, pressure, inertial);
            seeds.iter().map(move |&seed| Task {
                specimen: Specimen { rve: rve.clone(), seed },
                loading: loading.clone(),
            })
        })
        .collect();
    let Some(tested) = laboratory.test(&tasks)? else { return Ok(None) };
    let steady: Vec<[f64; 2]> = tested
        .into_iter()
        .map(|tested| Ok(steady_friction(&tested?)))
        .collect::<Result<_, String>>()
        .map_err(CalibrationError::Law)?;
    let points: Vec<[f64; 3]> = steady
        .chunks(packings)
        .map(|values| {
            let n = values.len() as f64;
            let [inertial, mean] = [0, 1].map(|k| values.iter().map(|x| x[k]).sum::<f64>() / n);
            let variance =
                values.iter().map(|x| (x[1] - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
            [inertial, mean, variance.sqrt()]
        })
        .collect();
    let elastic: Vec<[f64; 3]> = seeds
        .par_iter()
        .map(|&seed| elasticity(rve, pressure, seed))
        .collect::<Result<_, _>>()
        .map_err(CalibrationError::Law)?;
    let mean = |k: usize| elastic.iter().map(|e| e[k]).sum::<f64>() / elastic.len() as f64;
    let [static_friction, dynamic_friction, inertial_number] = friction_law(&points);
    let parameters = DruckerPragerParameters {
        bulk_modulus: mean(0),
        shear_modulus: mean(1),
        density: mean(2),
        static_friction,
        dynamic_friction,
        inertial_number,
        grain_diameter: rve.grains.mean_diameter(),
        grain_density: rve.grains.grain_density,
    };
    Ok(Some(Law { parameters, points }))
}

/// Bulk and shear modulus (Pa) at a small strain, and bulk density (kg/m³).
fn elasticity(rve: &RveParameters, pressure: f64, seed: u64) -> Result<[f64; 3], String> {
    let rve = parameters(rve, pressure);
    let mut packing = consolidate(&rve, seed).map_err(|error| error.to_string())?;
    packing.scale_mass(rve.grains.mass_scale);
    let density = rve.grains.grain_density * packing.solid_fraction();
    let change = |direction: [f64; 2]| -> Result<Matrix2<f64>, String> {
        let macro_step = 10.0 * rve.grains.step();
        let text = |error: dem::element::StageError| error.to_string();
        let mut element = Element::<f64>::new(packing.clone(), &rve, macro_step).map_err(text)?;
        let start = element.state.stress;
        let [x, y] = direction.map(|d| RATE * d);
        for (gradient, duration) in [([[x, 0.0], [0.0, y]], STRAIN / RATE), ([[0.0; 2]; 2], REST)] {
            let stage = Stage::VelocityGradient { gradient, duration };
            element.run(&stage, f64::INFINITY, |_| ()).map_err(text)?;
        }
        Ok(element.state.stress - start)
    };
    // Compression is positive: shortening raises the pressure by K times the change of area.
    let squeezed = change([-1.0, -1.0])?;
    let sheared = change([1.0, -1.0])?;
    let bulk = 0.5 * squeezed.trace() / (2.0 * STRAIN);
    let shear = (sheared[(1, 1)] - sheared[(0, 0)]) / (4.0 * STRAIN);
    Ok([bulk, shear, density])
}

/// `mu_s`, `mu_2` and `I_0` of `mu_s + (mu_2 - mu_s) I / (I_0 + I)` by least squares: linear in the first two, and
/// sought over the third.
fn friction_law(points: &[[f64; 3]]) -> [f64; 3] {
    let at = |i0: f64| {
        let line: Line = points
            .iter()
            .map(|[inertial, friction, _]| [inertial / (i0 + inertial), *friction])
            .collect();
        let slope = line.slope().max(0.0);
        let first = line.intercept(slope);
        // A law that would become too strong ends at the strongest.
        let slope = slope.min(STRONGEST - first);
        let misfit: f64 = points
            .iter()
            .map(|[inertial, friction, _]| {
                (first + slope * inertial / (i0 + inertial) - friction).powi(2)
            })
            .sum();
        (misfit, [first, first + slope, i0])
    };
    let candidates = (0..=200).map(|k| I0[0] * (I0[1] / I0[0]).powf(f64::from(k) / 200.0));
    let best = candidates.map(at).min_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or([0.0; 3], |(_, law)| law)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_is_found_again() {
        let law = |inertial: f64| 0.28 + (0.8 - 0.28) * inertial / (0.35 + inertial);
        let points = INERTIAL.map(|inertial| [inertial, law(inertial), 0.0]);
        let [first, second, i0] = friction_law(&points);
        // The step between candidates of I_0 is 2 %.
        assert!(
            (first - 0.28).abs() < 2e-3 && (second - 0.8).abs() < 0.02 && (i0 - 0.35).abs() < 0.02
        );
    }

    /// 60 discs: the moduli are of the order of kn / t = 13 MPa, and friction, which scatters by 0.7 / sqrt(60), is that
    /// of the default law.
    #[test]
    fn default_grains_have_about_the_default_law() {
        let rve = RveParameters { discs: 60, ..RveParameters::default() };
        let law =
            fit(&Laboratory { gpu: None, progress: () }, &rve, 20.0e3, 2, 1).unwrap().unwrap();
        let p = law.parameters;
        let scale = rve.grains.normal_stiffness / rve.grains.thickness;
        assert!((0.3..0.8).contains(&(p.bulk_modulus / scale)), "{p:?}");
        assert!((0.2..0.7).contains(&(p.shear_modulus / scale)), "{p:?}");
        let usual = DruckerPragerParameters::default().static_friction;
        assert!((p.static_friction - usual).abs() < 0.1, "{p:?}");
        assert!((2100.0..2300.0).contains(&p.density), "{p:?}");
    }
}
