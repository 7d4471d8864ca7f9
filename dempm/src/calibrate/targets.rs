//! Files of targets: what is measured, what is free and what stays.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use dem::{Grains, RveParameters};
use serde::Deserialize;
use toml::Spanned;

use super::column::ColumnTest;
use super::curve::{Curve, read};
use super::error::CalibrationError;
use super::experiment::{Experiment, Observation};
use super::parameter::{Free, Prior, with};
use super::quantity::Quantity;
use crate::scene::parameters::outside;
use crate::toml_error::TomlError;

/// What is measured, what is free and what stays.
#[derive(Clone, Debug)]
pub struct Targets {
    /// Name of the material.
    pub title: String,
    /// Seed of packings and of the ensemble.
    pub seed: u64,
    /// How parameters are sought.
    pub method: Method,
    /// Grains and packings, but for what is free.
    pub rve: RveParameters,
    /// Free parameters; none, and no measurements, if only a law is fitted to these grains.
    pub free: Vec<Free>,
    /// The measurements.
    pub observations: Vec<Observation>,
    /// Hash of the file and of all tables.
    pub hash: [u8; 32],
    /// The file and the tables it names.
    pub inputs: Vec<PathBuf>,
}

/// How parameters are sought.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Method {
    /// Sets of parameters side by side.
    pub members: usize,
    /// Packings of each.
    pub packings: usize,
    /// Steps of the inversion.
    pub rounds: usize,
    /// Most points of a curve that are compared.
    pub points: usize,
    /// Inertial number of slow tests.
    pub inertial_number: f64,
}

impl Default for Method {
    fn default() -> Self {
        Self { members: 32, packings: 2, rounds: 4, points: 8, inertial_number: 2.0e-3 }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    title: String,
    #[serde(default = "first_seed")]
    seed: u64,
    #[serde(default)]
    method: Method,
    #[serde(default)]
    grains: Grains,
    #[serde(default = "small")]
    rve: RveParameters,
    #[serde(default)]
    free: BTreeMap<String, Spanned<FreeEntry>>,
    #[serde(default)]
    target: Vec<Spanned<Target>>,
}

fn first_seed() -> u64 {
    1
}

/// Packings of calibrations are small: scatter between them is part of the likelihood.
fn small() -> RveParameters {
    RveParameters { discs: 200, ..RveParameters::default() }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FreeEntry {
    range: [f64; 2],
    #[serde(default)]
    prior: Prior,
}

#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum Target {
    Biaxial { data: PathBuf, pressure: f64, sd: BTreeMap<String, f64> },
    SimpleShear { data: PathBuf, pressure: f64, sd: BTreeMap<String, f64> },
    Oedometer { data: PathBuf, sd: BTreeMap<String, f64> },
    CriticalFriction { pressure: f64, angle: f64, sd: f64 },
    BulkDensity { pressure: f64, density: f64, sd: f64 },
    RunOut { size: [f64; 2], run_out: f64, sd: f64 },
    Repose { size: [f64; 2], angle: f64, sd: f64 },
}

impl Targets {
    /// Reads a file of targets and its tables.
    ///
    /// # Errors
    /// If a file cannot be read, or a key, column or unit is wrong.
    pub fn load(path: &Path) -> Result<Self, CalibrationError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| CalibrationError::Read { path: path.to_owned(), source })?;
        let at = |span: std::ops::Range<usize>, message: String| {
            CalibrationError::Invalid(TomlError::at(path, &text, span, "here", message))
        };
        let whole = |problem: String| CalibrationError::Targets { path: path.to_owned(), problem };
        let file: File = TomlError::read(path, &text)?;
        let Method { members, packings, rounds, points, inertial_number } = file.method;
        if members < 8 || packings == 0 || rounds == 0 || points < 3 {
            return Err(whole(
                "[method] needs 8 members, 1 packing, 1 round and 3 points or more".into(),
            ));
        }
        if !(1.0e-5..=0.1).contains(&inertial_number) {
            return Err(whole("`method.inertial_number` is slow between 1e-5 and 0.1".into()));
        }
        let mut rve = file.rve;
        rve.grains = file.grains;
        let mut free = Vec::new();
        for (key, entry) in file.free {
            let (span, FreeEntry { range, prior }) = (entry.span(), entry.into_inner());
            let one = Free { key, range, prior };
            if let Some(problem) = one.problem() {
                return Err(at(span, problem));
            }
            for value in range {
                let grains = with(&rve.grains, std::slice::from_ref(&one), &[value]);
                if let Some(problem) = outside("grains", &grains) {
                    return Err(at(span, problem));
                }
            }
            free.push(one);
        }
        if let Some(problem) = outside("grains", &rve.grains).or_else(|| outside("rve", &rve)) {
            return Err(whole(problem));
        }
        if free.is_empty() != file.target.is_empty() {
            return Err(whole("[free.KEY] and [[target]] need each other".into()));
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut inputs = vec![path.to_owned()];
        let mut observations = Vec::new();
        for (k, target) in file.target.into_iter().enumerate() {
            let (span, target) = (target.span(), target.into_inner());
            let (mut observation, data) =
                observation(target, folder, points).map_err(|problem| match problem {
                    Problem::Here(message) => at(span, message),
                    Problem::Data(error) => error,
                })?;
            observation.name = format!("{}: {}", k + 1, observation.name);
            inputs.extend(data);
            observations.push(observation);
        }
        let mut hasher = blake3::Hasher::new();
        for input in &inputs {
            let bytes = std::fs::read(input)
                .map_err(|source| CalibrationError::Read { path: input.clone(), source })?;
            hasher.update(blake3::hash(&bytes).as_bytes());
        }
        let hash = *hasher.finalize().as_bytes();
        Ok(Self {
            title: file.title,
            seed: file.seed,
            method: file.method,
            rve,
            free,
            observations,
            hash,
            inputs,
        })
    }

    /// Packings of grains with these values of the free parameters.
    pub fn rve_with(&self, values: &[f64]) -> RveParameters {
        RveParameters { grains: with(&self.rve.grains, &self.free, values), ..self.rve.clone() }
    }

    /// Values that standard normal variables stand for.
    pub fn values(&self, u: &[f64]) -> Vec<f64> {
        self.free.iter().zip(u).map(|(free, &u)| free.value(u)).collect()
    }

    /// Tests of all packings in a round.
    pub fn tests(&self) -> usize {
        self.method.members * self.method.packings * self.observations.len()
    }

    /// The coordinates of standard normal variables.
    pub fn coordinates(&self, u: &[f64]) -> Vec<f64> {
        self.free.iter().zip(u).map(|(free, &u)| free.coordinate(u)).collect()
    }

    /// All measured values.
    pub fn observed(&self) -> Vec<f64> {
        self.observations.iter().flat_map(Observation::values).collect()
    }

    /// Their standard deviations.
    pub fn deviations(&self) -> Vec<f64> {
        self.observations.iter().flat_map(Observation::deviations).collect()
    }
}

enum Problem {
    /// At the target.
    Here(String),
    Data(CalibrationError),
}

/// A target with the tables that it reads.
fn observation(
    target: Target,
    folder: &Path,
    points: usize,
) -> Result<(Observation, Option<PathBuf>), Problem> {
    use Quantity::{
        AxialStrain, AxialStress, DeviatoricStress, ShearStrain, ShearStress, VolumetricStrain,
    };
    type Found = Result<(Observation, Option<PathBuf>), Problem>;
    let curve = |name: &str,
                 experiment: Experiment,
                 data: &Path,
                 sd: &BTreeMap<String, f64>,
                 abscissa: Quantity,
                 all: &[Quantity]|
     -> Found {
        let path = folder.join(data);
        let (curve, ordinates) = read(&path, abscissa, all).map_err(Problem::Data)?;
        let sd = deviations(sd, &ordinates)?;
        let curve = curve.reduced(points);
        let name = format!("{name}, {}", data.display());
        let abscissa = Some(abscissa);
        Ok((Observation { name, experiment, abscissa, ordinates, curve, sd }, Some(path)))
    };
    let positive = |key: &str, values: &[f64]| {
        if values.iter().all(|&value| value > 0.0 && value.is_finite()) {
            Ok(())
        } else {
            Err(Problem::Here(format!("`{key}` must be positive")))
        }
    };
    let acute = |angle: f64| {
        if (0.0..90.0).contains(&angle) {
            Ok(())
        } else {
            Err(Problem::Here("`angle` is in degrees, from 0 to 90".into()))
        }
    };
    let scalar = |name: String, experiment: Experiment, value: f64, sd: f64| -> Found {
        positive("sd", &[sd])?;
        let curve = Curve { x: vec![0.0], y: vec![vec![value]] };
        let (abscissa, ordinates, sd) = (None, Vec::new(), vec![sd]);
        Ok((Observation { name, experiment, abscissa, ordinates, curve, sd }, None))
    };
    match target {
        Target::Biaxial { data, pressure, sd } => {
            positive("pressure", &[pressure])?;
            let experiment = Experiment::Biaxial { pressure };
            let name = format!("biaxial at {} kPa", 1.0e-3 * pressure);
            curve(&name, experiment, &data, &sd, AxialStrain, &[DeviatoricStress, VolumetricStrain])
        }
        Target::SimpleShear { data, pressure, sd } => {
            positive("pressure", &[pressure])?;
            let experiment = Experiment::SimpleShear { pressure };
            let name = format!("simple shear at {} kPa", 1.0e-3 * pressure);
            curve(&name, experiment, &data, &sd, ShearStrain, &[ShearStress, VolumetricStrain])
        }
        Target::Oedometer { data, sd } => {
            curve("oedometer", Experiment::Oedometer, &data, &sd, AxialStress, &[AxialStrain])
        }
        Target::CriticalFriction { pressure, angle, sd } => {
            positive("pressure", &[pressure])?;
            acute(angle)?;
            let name = format!("critical friction at {} kPa", 1.0e-3 * pressure);
            scalar(name, Experiment::CriticalFriction { pressure }, angle, sd)
        }
        Target::BulkDensity { pressure, density, sd } => {
            positive("pressure", &[pressure])?;
            positive("density", &[density])?;
            let name = format!("bulk density at {} kPa", 1.0e-3 * pressure);
            scalar(name, Experiment::BulkDensity { pressure }, density, sd)
        }
        Target::RunOut { size, run_out, sd } => {
            positive("size", &size)?;
            positive("run_out", &[run_out])?;
            let name = format!("run-out of {} m x {} m", size[0], size[1]);
            scalar(name, Experiment::RunOut(ColumnTest { size }), run_out, sd)
        }
        Target::Repose { size, angle, sd } => {
            positive("size", &size)?;
            acute(angle)?;
            let name = format!("repose of {} m x {} m", size[0], size[1]);
            scalar(name, Experiment::Repose(ColumnTest { size }), angle, sd)
        }
    }
}

/// Standard deviations of the ordinates of a curve, in their order.
fn deviations(sd: &BTreeMap<String, f64>, ordinates: &[Quantity]) -> Result<Vec<f64>, Problem> {
    for key in sd.keys() {
        if !ordinates.iter().any(|quantity| quantity.name() == key) {
            return Err(Problem::Here(format!("`sd.{key}`: the table has no such column")));
        }
    }
    let of = |quantity: &Quantity| match sd.get(quantity.name()) {
        Some(&sd) if sd > 0.0 && sd.is_finite() => Ok(sd),
        _ => Err(Problem::Here(format!("`sd.{}` must be positive", quantity.name()))),
    };
    ordinates.iter().map(of).collect()
}
