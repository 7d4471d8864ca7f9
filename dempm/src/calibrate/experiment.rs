//! The tests of a laboratory: how packings are driven through them, and what is compared.

use dem::element::{Row, Stage, Until, sin_phi};
use dem::{Grains, RveParameters};

use super::column::{ColumnTest, Pile};
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

/// Grains and the seed that packings of them are made from.
#[derive(Clone, Debug, PartialEq)]
pub struct Specimen {
    /// The grains, and the number of them in a packing.
    pub rve: RveParameters,
    /// Seed.
    pub seed: u64,
}

/// How a packing is driven through a test.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Loading {
    /// Pressure (Pa) at which the packing is consolidated.
    pub pressure: f64,
    /// What then follows, if anything.
    pub stage: Option<Stage>,
    /// Time between two rows of its path (s).
    pub sampling: f64,
}

/// What a test of a packing gives.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tested {
    /// Solid fraction after consolidation.
    pub solid_fraction: f64,
    /// The path after it.
    pub rows: Vec<Row>,
}

/// Strain of slow shear, and how much more of it for an inertial number of 1: fast flow dilates, and takes strains of
/// some ten times as much to find its density. Shear is steady in the second half.
const SHEAR_STRAIN: f64 = 1.0;
const DILATION_STRAIN: f64 = 25.0;
/// Rows of steady shear.
const STEADY_ROWS: f64 = 50.0;
/// Rows of a simulated curve for every point that is compared.
const ROWS: f64 = 4.0;
/// Simulated beyond the last point, in parts of its abscissa.
const BEYOND: f64 = 1.02;
/// Fastest shortening (1/s) in which the servo, of 1/s at most, follows a packing that dilates.
const FASTEST: f64 = 0.4;
/// Part of its pressure below which a packing counts as one that loses its contacts.
const CONTACT: f64 = 0.5;
/// Largest axial strain of an oedometer.
const CRUSHED: f64 = 0.2;
/// Least stress of an oedometer, in parts of the largest: that of the packing before the test.
const SEATING: f64 = 1.0e-3;

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

    /// The column of the test, if it is one.
    pub(super) fn column(&self) -> Option<ColumnTest> {
        match self.experiment {
            Experiment::RunOut(test) | Experiment::Repose(test) => Some(test),
            _ => None,
        }
    }

    /// How packings of these grains are driven; `None` for columns. Flow is quasi-static: it has the inertial number
    /// `inertial`.
    pub(super) fn loading(&self, grains: &Grains, inertial: f64) -> Option<Loading> {
        let last = last(&self.curve.x);
        let rows = ROWS * self.curve.x.len() as f64;
        Some(match self.experiment {
            Experiment::Biaxial { pressure } => {
                let strain = BEYOND * last;
                // Shortening in logarithmic strain; a biaxial test that dilates has a shear rate near twice this.
                let rate = (0.5 * shear_rate(grains, pressure, inertial)).min(FASTEST);
                let strain = -(-strain).ln_1p();
                let stage = Stage::Biaxial { pressure, shortening_rate: rate, strain };
                Loading { pressure, stage: Some(stage), sampling: strain / rate / rows }
            }
            Experiment::SimpleShear { pressure } => {
                let strain = BEYOND * last;
                let shear_rate = shear_rate(grains, pressure, inertial);
                let stage = Stage::ConstantPressureShear { pressure, shear_rate, strain };
                Loading { pressure, stage: Some(stage), sampling: strain / shear_rate / rows }
            }
            Experiment::Oedometer => {
                let pressure = self.curve.x[0].max(SEATING * last);
                let rate = 0.5 * shear_rate(grains, pressure, inertial);
                let until = Until::Pressure(last);
                let stage = Stage::Oedometric { shortening_rate: rate, until };
                let strain = self::last(&self.curve.y[0]).abs().clamp(1.0e-3, CRUSHED);
                Loading { pressure, stage: Some(stage), sampling: strain / rate / rows }
            }
            Experiment::CriticalFriction { pressure } => steady_shear(grains, pressure, inertial),
            Experiment::BulkDensity { pressure } => {
                Loading { pressure, stage: None, sampling: f64::INFINITY }
            }
            Experiment::RunOut(_) | Experiment::Repose(_) => return None,
        })
    }

    /// What a packing of these grains gives in place of the measured values.
    pub(super) fn of_packing(&self, grains: &Grains, tested: &Tested) -> Vec<f64> {
        match self.experiment {
            Experiment::CriticalFriction { .. } => {
                vec![steady_friction(tested)[1].asin().to_degrees()]
            }
            Experiment::BulkDensity { .. } => vec![grains.grain_density * tested.solid_fraction],
            _ => self.on_curve(&tested.rows),
        }
    }

    /// What a column gives in place of the measured value.
    pub(super) fn of_pile(&self, pile: &Pile) -> Vec<f64> {
        vec![if matches!(self.experiment, Experiment::RunOut(_)) {
            pile.run_out
        } else {
            pile.slope
        }]
    }

    /// The curve of a path at the measured points.
    fn on_curve(&self, rows: &[Row]) -> Vec<f64> {
        let abscissa = self.abscissa.unwrap_or(Quantity::AxialStrain);
        let rows: Vec<Row> = rows.iter().map(|row| self.at_its_pressure(row)).collect();
        let curve = of_rows(&rows, abscissa, &self.ordinates).rising();
        // Stresses fluctuate: neighbouring rows are averaged, but for the first points.
        let at = |k: usize, x: f64| curve.at(k, x);
        let half = 0.5 * last(&self.curve.x) / (self.curve.x.len() as f64 * ROWS);
        let mean = |k: usize, x: f64| (at(k, x - half) + at(k, x) + at(k, x + half)) / 3.0;
        let values = (0..self.ordinates.len())
            .flat_map(|k| self.curve.x.iter().map(move |&x| (k, x)))
            .map(|(k, x)| if x > half { mean(k, x) } else { at(k, x) });
        values.collect()
    }

    /// A row with its stresses in proportion to the pressure of the test. In fast tests of grains that dilate the servo
    /// lags, and holds up to a fifth more; the strength of grains is proportional to it.
    fn at_its_pressure(&self, row: &Row) -> Row {
        let (pressure, held) = match self.experiment {
            Experiment::Biaxial { pressure } => (pressure, -row.stress[(0, 0)]),
            Experiment::SimpleShear { pressure } => (pressure, -row.stress[(1, 1)]),
            _ => return *row,
        };
        // A packing that loses its contacts loses its strength.
        Row { stress: row.stress * (pressure / held.max(CONTACT * pressure)), ..*row }
    }
}

/// Shear at an inertial number, half of it until it is steady.
pub(super) fn steady_shear(grains: &Grains, pressure: f64, inertial: f64) -> Loading {
    let shear_rate = shear_rate(grains, pressure, inertial);
    let strain = SHEAR_STRAIN + DILATION_STRAIN * inertial;
    let stage = Stage::ConstantPressureShear { pressure, shear_rate, strain };
    Loading { pressure, stage: Some(stage), sampling: strain / STEADY_ROWS / shear_rate }
}

/// Mean inertial number and `sin phi` of the mean stress of steady shear.
pub(super) fn steady_friction(tested: &Tested) -> [f64; 2] {
    let steady = &tested.rows[tested.rows.len() / 2..];
    let stress: nalgebra::Matrix2<f64> = steady.iter().map(|row| row.stress).sum();
    let inertial = steady.iter().map(|row| row.inertial_number).sum::<f64>();
    [inertial / steady.len() as f64, sin_phi(&stress)]
}

/// Shear rate (1/s) of an inertial number at a pressure (Pa).
fn shear_rate(grains: &Grains, pressure: f64, inertial: f64) -> f64 {
    let density = grains.mass_scale * grains.grain_density;
    inertial / grains.mean_diameter() * (pressure / density).sqrt()
}

fn last(values: &[f64]) -> f64 {
    values.last().copied().unwrap_or_default()
}
