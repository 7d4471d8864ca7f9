//! The rounds of a calibration: all sets of parameters are simulated, then moved towards the targets.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::emulator::Emulator;
use super::ensemble::{standard_normal, update};
use super::error::CalibrationError;
use super::experiment::Specimen;
use super::posterior::Posterior;
use super::targets::Targets;

/// A set of parameters and what packings of it predict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Member {
    /// Standard normal variables in place of the parameters.
    pub u: Vec<f64>,
    /// Mean over packings; empty if it could not be simulated.
    pub predicted: Vec<f64>,
    /// Scatter of single packings: differences from the mean.
    scatter: Vec<Vec<f64>>,
    /// Root mean square of the misfits over their standard deviations.
    pub misfit: f64,
}

/// What each specimen gives in place of all measured values, or the reason why it gives nothing.
pub type Predictions = Vec<Result<Vec<f64>, String>>;

/// What simulates the tests of a calibration.
pub trait Simulator {
    /// Takes specimens through all tests; `None` if it was told to stop.
    ///
    /// # Errors
    /// The device fails.
    fn simulate(
        &self,
        targets: &Targets,
        specimens: &[Specimen],
    ) -> Result<Option<Predictions>, CalibrationError>;
}

/// All that has been simulated so far; what a calibration continues from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Study {
    hash: [u8; 32],
    /// Rounds that are done.
    pub rounds: Vec<Vec<Member>>,
    /// The ensemble of the next round.
    next: Vec<Vec<f64>>,
}

/// The last rounds are those that the emulator is fitted to.
const EMULATED: usize = 3;

impl Study {
    /// A study of which nothing has been done: an ensemble of the prior.
    pub fn new(targets: &Targets) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(targets.seed);
        let mut normal = || standard_normal(&mut rng);
        let member = |_| targets.free.iter().map(|_| normal()).collect();
        let next = (0..targets.method.members).map(member).collect();
        Self { hash: targets.hash, rounds: Vec::new(), next }
    }

    /// Whether it belongs to these targets.
    pub fn is_of(&self, targets: &Targets) -> bool {
        self.hash == targets.hash
    }

    /// Whether all rounds are done.
    pub fn is_done(&self, targets: &Targets) -> bool {
        self.rounds.len() > targets.method.rounds
    }

    /// The member that fits best so far.
    pub fn best(&self) -> Option<&Member> {
        let simulated = self.rounds.iter().flatten().filter(|member| !member.predicted.is_empty());
        simulated.min_by(|a, b| a.misfit.total_cmp(&b.misfit))
    }

    /// Simulates the next round and moves the ensemble. Returns whether it was done: not if the simulator was told to
    /// stop.
    ///
    /// # Errors
    /// Most members cannot be simulated, or the device fails.
    pub fn advance(
        &mut self,
        targets: &Targets,
        simulator: &impl Simulator,
    ) -> Result<bool, CalibrationError> {
        let round = self.rounds.len();
        let packings = targets.method.packings;
        let specimens: Vec<Specimen> = (0..targets.method.members * packings)
            .map(|n| {
                let (member, packing) = (n / packings, n % packings);
                let rve = targets.rve_with(&targets.values(&self.next[member]));
                Specimen { rve, seed: seed(targets.seed, [round, member, packing]) }
            })
            .collect();
        let Some(results) = simulator.simulate(targets, &specimens)? else { return Ok(false) };
        let mut failure = None;
        let members: Vec<Member> = results
            .chunks(packings)
            .zip(&self.next)
            .map(|(results, u)| {
                let predicted: Result<Vec<Vec<f64>>, String> = results.iter().cloned().collect();
                member(targets, u, predicted).unwrap_or_else(|reason| {
                    failure.get_or_insert(reason);
                    let (predicted, scatter) = (Vec::new(), Vec::new());
                    Member { u: u.clone(), predicted, scatter, misfit: f64::INFINITY }
                })
            })
            .collect();
        let succeeded = members.iter().filter(|member| !member.predicted.is_empty()).count();
        if succeeded < members.len().div_ceil(2).max(targets.free.len() + 3) {
            let reason = failure.unwrap_or_default();
            return Err(CalibrationError::Failed { succeeded, members: members.len(), reason });
        }
        self.rounds.push(members);
        if !self.is_done(targets) {
            self.next = self.moved(targets).ok_or(CalibrationError::Covariance)?;
        }
        Ok(true)
    }

    /// The ensemble after the last round, moved towards the targets.
    fn moved(&self, targets: &Targets) -> Option<Vec<Vec<f64>>> {
        let members = self.rounds.last()?;
        let round = self.rounds.len() as u64;
        let mut rng = ChaCha8Rng::seed_from_u64(targets.seed.wrapping_add(round << 48));
        let alive: Vec<&Member> =
            members.iter().filter(|member| !member.predicted.is_empty()).collect();
        let [u, g] = columns(&alive);
        let sd = DVector::from_vec(targets.deviations());
        let observed = DVector::from_vec(targets.observed());
        let covariance = DMatrix::from_diagonal(&sd.component_mul(&sd)) + scatter(&alive, targets);
        let alpha = targets.method.rounds as f64;
        let moved = update(&u, &g, &observed, &covariance, alpha, &mut rng)?;
        let mean = moved.column_mean();
        let mut next: Vec<Vec<f64>> =
            moved.column_iter().map(|column| column.iter().copied().collect()).collect();
        // In place of those that could not be simulated: random ones of the same mean and covariance.
        while next.len() < members.len() {
            let mut u = mean.clone();
            for column in moved.column_iter() {
                let weight = standard_normal(&mut rng) / ((moved.ncols() - 1) as f64).sqrt();
                u += weight * (column - &mean);
            }
            next.push(u.as_slice().to_vec());
        }
        Some(next)
    }

    /// The posterior, once all rounds are done.
    ///
    /// # Errors
    /// Too few simulations, or no covariance.
    pub fn posterior(&self, targets: &Targets) -> Result<Posterior, CalibrationError> {
        let simulated = |members: &[Member]| -> Vec<Member> {
            members.iter().filter(|member| !member.predicted.is_empty()).cloned().collect()
        };
        let first = self.rounds.len().saturating_sub(EMULATED);
        let near = simulated(&self.rounds[first..].concat());
        let [mut u, g] = columns(&near.iter().collect::<Vec<_>>());
        for mut column in u.column_iter_mut() {
            column.copy_from_slice(&targets.coordinates(column.clone_owned().as_slice()));
        }
        let emulator = Emulator::fit(&u, &g).ok_or(CalibrationError::Covariance)?;
        let last = simulated(self.rounds.last().map_or(&[][..], Vec::as_slice));
        let u: Vec<Vec<f64>> = last.into_iter().map(|member| member.u).collect();
        Posterior::sample(targets, emulator, &u).ok_or(CalibrationError::Covariance)
    }
}

/// The seed of a packing, from that of the calibration and the numbers of its round, member and packing.
fn seed(first: u64, [round, member, packing]: [usize; 3]) -> u64 {
    first.wrapping_shl(32) + ((round as u64) << 24) + ((member as u64) << 8) + packing as u64
}

/// A member from the predictions of its packings.
fn member(
    targets: &Targets,
    u: &[f64],
    packings: Result<Vec<Vec<f64>>, String>,
) -> Result<Member, String> {
    let packings = packings?;
    let count = packings.len() as f64;
    let values = packings[0].len();
    let predicted: Vec<f64> =
        (0..values).map(|k| packings.iter().map(|p| p[k]).sum::<f64>() / count).collect();
    if !predicted.iter().all(|value| value.is_finite()) {
        return Err("a prediction is not finite".into());
    }
    let scatter = packings
        .iter()
        .map(|packing| packing.iter().zip(&predicted).map(|(a, b)| a - b).collect())
        .collect();
    let misfits = targets.observed().into_iter().zip(targets.deviations()).zip(&predicted);
    let squares = misfits.map(|((y, sd), g)| ((y - g) / sd).powi(2)).sum::<f64>();
    let misfit = (squares / values as f64).sqrt();
    Ok(Member { u: u.to_vec(), predicted, scatter, misfit })
}

/// Parameters and predictions, one column for each member.
fn columns(members: &[&Member]) -> [DMatrix<f64>; 2] {
    let matrix = |of: fn(&Member) -> &Vec<f64>| {
        let rows = members.first().map_or(0, |member| of(member).len());
        DMatrix::from_fn(rows, members.len(), |i, k| of(members[k])[i])
    };
    [matrix(|member| &member.u), matrix(|member| &member.predicted)]
}

/// Covariance of the mean over packings, by their scatter within members.
fn scatter(members: &[&Member], targets: &Targets) -> DMatrix<f64> {
    let packings = targets.method.packings as f64;
    let values = targets.observed().len();
    let mut sum = DMatrix::zeros(values, values);
    for difference in members.iter().flat_map(|member| &member.scatter) {
        let difference = DVector::from_column_slice(difference);
        sum += &difference * difference.transpose();
    }
    let degrees = members.len() as f64 * (packings - 1.0);
    if degrees > 0.0 { sum / (degrees * packings) } else { sum }
}
