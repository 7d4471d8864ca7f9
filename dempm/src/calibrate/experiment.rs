//! The tests of a laboratory, simulated with packings.

use dem::element::{Element, Row, Stage, Until, sin_phi};
use dem::{Grains, Packing, RveParameters, consolidate};

use super::column::{self, ColumnTest};
use super::curve::{Curve, of_rows};
use super::quantity::Quantity;

/// A test and how it is driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Experiment {
    /// Axial shortening under a lateral pressure (Pa).
    Biaxial {
        /// Lateral pressure (Pa), at which the packing is consolidated.
        pressure: f64,
    },
    /// Shear under a normal pressure (Pa), without lateral strain.
    SimpleShear {
        /// Normal pressure (Pa).
        pressure: f64,
    },
    /// Axial shortening without lateral strain, up to the largest axial stress measured.
    Oedometer,
    /// Angle of friction (degrees) of steady shear under a normal pressure (Pa).
    CriticalFriction {
        /// Normal pressure (Pa).
        pressure: f64,
    },
    /// Bulk density (kg/m³) of a packing consolidated at a pressure (Pa).
    BulkDensity {
        /// Of both axes (Pa).
        pressure: f64,
    },
    /// Run-out (L - L0) / L0 of a column of grains against a smooth wall; L is the front of 99 % of the mass.
    RunOut(ColumnTest),
    /// Slope (degrees) of the pile that a low column leaves.
    Repose(ColumnTest),
}

/// Measurements of one test.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// Name on the page.
    pub name: String,
    /// The test.
    pub experiment: Experiment,
    pub(super) abscissa: Option<Quantity>,
    pub(super) ordinates: Vec<Quantity>,
    /// Points of the curve, at which simulations are compared; of scalars one, at 0.
    pub(super) curve: Curve,
    /// Standard deviation of each ordinate, or of the scalar.
    pub(super) sd: Vec<f64>,
}

/// Strains of steady shear: up to the first it becomes steady, and then it is averaged.
const STEADY: [f64; 2] = [0.5, 1.0];
/// Rows of a simulated curve for every point that is compared.
const ROWS: f64 = 4.0;
/// Simulated beyond the last point, in parts of its abscissa.
const BEYOND: f64 = 1.02;
/// DEM steps between two decisions of the servo.
const CONTROL_STEPS: f64 = 10.0;
/// Fastest shortening (1/s) in which the servo, of 1/s at most, holds the lateral pressure of a packing that dilates.
const FASTEST: f64 = 0.4;
/// Largest axial strain of an oedometer.
const CRUSHED: f64 = 0.2;

impl Observation {
    /// The measured values: curve by curve, point by point.
    pub fn values(&self) -> Vec<f64> {
        self.curve.y.concat()
    }

    /// Their standard deviations.
    pub fn deviations(&self) -> Vec<f64> {
        let points = self.curve.x.len();
        self.sd.iter().flat_map(|&sd| std::iter::repeat_n(sd, points)).collect()
    }

    /// Unit of a scalar.
    pub(super) fn unit(&self) -> &'static str {
        match self.experiment {
            Experiment::CriticalFriction { .. } | Experiment::Repose(_) => "degrees",
            Experiment::BulkDensity { .. } => "kg/m³",
            _ => "",
        }
    }
}

/// What one packing made from `seed` gives in place of the measured values. Flow is quasi-static: it has the
/// inertial number `inertial`.
///
/// # Errors
/// The packing cannot be made, or the test cannot be driven; the reason.
pub fn simulate(
    rve: &RveParameters,
    observation: &Observation,
    inertial: f64,
    seed: u64,
) -> Result<Vec<f64>, String> {
    match observation.experiment {
        Experiment::Biaxial { pressure } => {
            let strain = BEYOND * last(&observation.curve.x);
            // Shortening in logarithmic strain; a biaxial test that dilates has a shear rate near twice this.
            let shortening_rate = (0.5 * shear_rate(&rve.grains, pressure, inertial)).min(FASTEST);
            let stage = Stage::Biaxial { pressure, shortening_rate, strain: -(-strain).ln_1p() };
            curve_of(rve, observation, pressure, seed, &stage, strain / shortening_rate)
        }
        Experiment::SimpleShear { pressure } => {
            let strain = BEYOND * last(&observation.curve.x);
            let shear_rate = shear_rate(&rve.grains, pressure, inertial);
            let stage = Stage::ConstantPressureShear { pressure, shear_rate, strain };
            curve_of(rve, observation, pressure, seed, &stage, strain / shear_rate)
        }
        Experiment::Oedometer => {
            let least = observation.curve.x[0].max(1.0e-3 * last(&observation.curve.x));
            let until = Until::Pressure(last(&observation.curve.x));
            let shortening_rate = 0.5 * shear_rate(&rve.grains, least, inertial);
            let stage = Stage::Oedometric { shortening_rate, until };
            let strain = last(&observation.curve.y[0]).abs().clamp(1.0e-3, CRUSHED);
            curve_of(rve, observation, least, seed, &stage, strain / shortening_rate)
        }
        Experiment::CriticalFriction { pressure } => {
            let friction = steady_friction(rve, pressure, inertial, seed)?;
            Ok(vec![friction.asin().to_degrees()])
        }
        Experiment::BulkDensity { pressure } => {
            let (_, packing) = prepared(rve, pressure, seed)?;
            Ok(vec![rve.grains.grain_density * packing.solid_fraction()])
        }
        Experiment::RunOut(test) => Ok(vec![column::collapse(&rve.grains, &test, seed)?.run_out]),
        Experiment::Repose(test) => Ok(vec![column::collapse(&rve.grains, &test, seed)?.slope]),
    }
}

/// `sin phi` of steady shear at an inertial number, from the mean stress.
pub(super) fn steady_friction(
    rve: &RveParameters,
    pressure: f64,
    inertial: f64,
    seed: u64,
) -> Result<f64, String> {
    let (rve, packing) = prepared(rve, pressure, seed)?;
    let shear_rate = shear_rate(&rve.grains, pressure, inertial);
    let stage = Stage::ConstantPressureShear { pressure, shear_rate, strain: STEADY[1] };
    let rows = drive(&rve, packing, &stage, 0.02 / shear_rate)?;
    let steady = rows.iter().filter(|row| row.strain[(0, 1)] > STEADY[0]);
    let stress: nalgebra::Matrix2<f64> = steady.map(|row| row.stress).sum();
    Ok(sin_phi(&stress))
}

/// Shear rate (1/s) of an inertial number at a pressure (Pa).
fn shear_rate(grains: &Grains, pressure: f64, inertial: f64) -> f64 {
    let density = grains.mass_scale * grains.grain_density;
    inertial / grains.mean_diameter() * (pressure / density).sqrt()
}

/// A packing in equilibrium under `pressure`, and its parameters.
pub(super) fn prepared(
    rve: &RveParameters,
    pressure: f64,
    seed: u64,
) -> Result<(RveParameters, Packing<f64>), String> {
    let mut rve = rve.clone();
    rve.preparation.pressure = pressure;
    let mut packing = consolidate(&rve, seed).map_err(|error| error.to_string())?;
    packing.scale_mass(rve.grains.mass_scale);
    Ok((rve, packing))
}

/// Rows of a stage, from the state before it.
fn drive(
    rve: &RveParameters,
    packing: Packing<f64>,
    stage: &Stage,
    sampling: f64,
) -> Result<Vec<Row>, String> {
    let macro_step = CONTROL_STEPS * rve.grains.step();
    let mut element = Element::<f32>::new(packing.convert(), rve, macro_step)
        .map_err(|error| error.to_string())?;
    let mut rows = vec![element.row()];
    element.run(stage, sampling, |row| rows.push(*row)).map_err(|error| error.to_string())?;
    Ok(rows)
}

/// The curve of a stage that takes `duration` (s), at the measured points.
fn curve_of(
    rve: &RveParameters,
    observation: &Observation,
    pressure: f64,
    seed: u64,
    stage: &Stage,
    duration: f64,
) -> Result<Vec<f64>, String> {
    let (rve, packing) = prepared(rve, pressure, seed)?;
    let points = observation.curve.x.len();
    let rows = drive(&rve, packing, stage, duration / (ROWS * points as f64))?;
    let abscissa = observation.abscissa.unwrap_or(Quantity::AxialStrain);
    let curve = of_rows(&rows, abscissa, &observation.ordinates).rising();
    // Stresses fluctuate: neighbouring rows are averaged, but for the first points.
    let at = |k: usize, x: f64| curve.at(k, x);
    let half = 0.5 * last(&observation.curve.x) / (points as f64 * ROWS);
    let mean = |k: usize, x: f64| (at(k, x - half) + at(k, x) + at(k, x + half)) / 3.0;
    let values = (0..observation.ordinates.len())
        .flat_map(|k| observation.curve.x.iter().map(move |&x| (k, x)))
        .map(|(k, x)| if x > half { mean(k, x) } else { at(k, x) });
    Ok(values.collect())
}

fn last(values: &[f64]) -> f64 {
    values.last().copied().unwrap_or_default()
}
