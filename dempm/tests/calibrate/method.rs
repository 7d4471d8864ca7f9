//! The method alone: calibrations of a material whose curves are closed forms with noise.

use dem::Grains;
use dempm::calibrate::ensemble::standard_normal;
use dempm::calibrate::{CalibrationError, Predictions, Simulator, Specimen, Targets};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::calibrated;

/// Axial strains of the biaxial and shear strains of the shear test.
const AXIAL: [f64; 6] = [0.005, 0.016, 0.027, 0.038, 0.049, 0.06];
const SHEAR: [f64; 6] = [0.01, 0.048, 0.086, 0.124, 0.162, 0.2];
/// Usual size of each curve: its noise is a share of this and of its value.
const SIZE: [f64; 4] = [4.0e4, 2.0e-3, 2.0e4, 3.0e-3];
const NOISE: f64 = 0.12;

/// Curves as of dense grains at 100 kPa: strength rises with both frictions, of which the first saturates; strains of
/// the rise go down with stiffness. Deviatoric stress, volumetric strain, shear stress, volumetric strain.
fn curves(grains: &Grains) -> [[f64; 6]; 4] {
    let (mu, rolling) = (grains.friction, grains.rolling_friction);
    let strength =
        0.08 + 0.38 * (1.0 - (-mu / 0.25).exp()) * (1.0 + rolling * rolling * mu / (mu + 0.2));
    let soft = 1.0e5 / grains.normal_stiffness;
    let (first, second) = (0.004 * soft.powf(0.8), 0.01 * soft.powf(0.7));
    let rise = |x: f64, over: f64| 1.0 - (-x / over).exp();
    [
        AXIAL.map(|x| 2.0e5 * strength / (1.0 - strength) * rise(x, first)),
        AXIAL.map(|x| first * rise(x, 0.004) - 0.25 * strength * (x - 0.006) * rise(x, 0.02)),
        SHEAR.map(|x| 1.0e5 * strength * rise(x, second)),
        SHEAR.map(|x| 0.002 * soft - 0.12 * strength * x * (-x / 0.3).exp()),
    ]
}

/// Curves of one packing: half of the variance of its noise is that of the whole curve, neighbouring points share most
/// of the rest.
fn packing(grains: &Grains, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || standard_normal(&mut rng);
    let mut values = Vec::new();
    for (curve, size) in curves(grains).into_iter().zip(SIZE) {
        let (whole, mut point) = (normal(), normal());
        for y in curve {
            values.push(y + NOISE * (0.3 * size + 0.5 * y.abs()) * (0.7 * whole + 0.7 * point));
            point = 0.6 * point + 0.8 * normal();
        }
    }
    values
}

struct ClosedForm;

impl Simulator for ClosedForm {
    fn simulate(
        &self,
        _: &Targets,
        specimens: &[Specimen],
    ) -> Result<Option<Predictions>, CalibrationError> {
        let of = |specimen: &Specimen| Ok(packing(&specimen.rve.grains, specimen.seed));
        Ok(Some(specimens.iter().map(of).collect()))
    }
}

/// Where the truth lies in the posterior of a calibration.
fn level(truth: &Grains, seed: u64) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = [1, 2].map(|k| packing(truth, 1_000_000 + 10 * seed + k));
    let mean: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 0.5 * (a + b)).collect();
    let head = super::head(seed, 24, 3, super::THREE);
    let targets = super::load(folder.path(), &head, &[super::BIAXIAL, super::SHEAR], &mean);
    let (_, posterior) = calibrated(&targets, &ClosedForm);
    posterior.level(&targets, &super::values(truth))
}

/// Five materials, ten calibrations each. With a probability of 0.95, 45 of 50 or more are within with one of 0.96.
/// The first material is at the end of the range of its rolling friction.
#[test]
fn the_truth_lies_within_the_region_as_often_as_it_says() {
    let levels: Vec<Vec<f64>> = super::MATERIALS
        .map(super::grains)
        .iter()
        .enumerate()
        .map(|(k, truth)| {
            (0..10).into_par_iter().map(|n| level(truth, 100 * k as u64 + n)).collect()
        })
        .collect();
    println!("{levels:.2?}");
    let within = levels.iter().flatten().filter(|&&level| level < 0.95).count();
    assert!(within >= 45, "{within} of 50");
    // They are spread, not all close to the centre: regions are no wider than they need be.
    let mean = levels.iter().flatten().sum::<f64>() / 50.0;
    assert!((0.35..0.65).contains(&mean), "{mean}");
}
