//! The motion of a run: what a comparison needs of its trajectory.

use std::collections::BTreeMap;
use std::path::Path;

use dempm::comparison::{Square, Start, by_square, least_side, starts};
use dempm::trajectory::{Frame, Trajectory, TrajectoryError};

use super::arrest::arrest;
use super::fronts::fronts;

/// A run in memory.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Name of the run.
    pub name: String,
    /// Its material, such as `discs`.
    pub material: String,
    /// Its seed.
    pub seed: u64,
    /// Its status, `finished` or what stopped it.
    pub status: String,
    /// Size of the domain, m.
    pub domain: [f64; 2],
    /// Gravity, m/s².
    pub gravity: [f64; 2],
    /// Least side (m) of the squares on which it is compared.
    pub side: f64,
    /// Masses of the points, kg/m.
    pub mass: Vec<f64>,
    /// Where the points start.
    pub starts: Vec<Start>,
    /// Mean velocity at the start, m/s.
    pub start_velocity: [f64; 2],
    /// The state at each frame.
    pub states: Vec<State>,
}

/// The state of a run at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Time, s.
    pub time: f64,
    /// Positions of the points, m.
    pub position: Vec<[f64; 2]>,
    /// Front of 99 % of the mass, m.
    pub front: f64,
    /// Front of what hangs together, m; `None` where the trajectory lacks it.
    pub connected_front: Option<f64>,
    /// Centre of mass, m.
    pub centre: [f64; 2],
    /// Kinetic energy over mass, J/kg.
    pub kinetic_energy: f64,
}

impl Motion {
    /// Reads a trajectory.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: &Path) -> Result<Self, TrajectoryError> {
        let file = Trajectory::open(path)?;
        let header = file.header();
        let mass = file.points().mass.clone();
        let mut start_velocity = [0.0; 2];
        let mut states = Vec::with_capacity(file.frames());
        for index in 0..file.frames() {
            let frame = file.frame(index)?;
            if index == 0 {
                start_velocity = mean(&frame.velocity, &mass);
            }
            states.push(state(frame, &mass, header.point_spacing));
        }
        Ok(Self {
            name: path.display().to_string(),
            material: header.material.clone(),
            seed: header.seed,
            status: file.status().to_owned(),
            domain: header.domain,
            gravity: header.gravity,
            side: least_side(header),
            mass,
            starts: starts(&file)?,
            start_velocity,
            states,
        })
    }

    /// The points by the square of side `side` (m) that they start in.
    pub(super) fn squares(&self, side: f64) -> BTreeMap<Square, Vec<usize>> {
        by_square(&self.starts, side)
    }

    /// When it comes to rest, s: see [`arrest`](super::arrest()).
    pub fn arrest(&self) -> Option<f64> {
        let [time, energy]: [Vec<f64>; 2] = [|s: &State| s.time, |s: &State| s.kinetic_energy]
            .map(|f| self.states.iter().map(f).collect());
        arrest(&time, &energy)
    }
}

fn state(frame: Frame, mass: &[f64], spacing: f64) -> State {
    let total: f64 = mass.iter().sum();
    let of_points = || {
        let square = |v: &[f64; 2]| v[0] * v[0] + v[1] * v[1];
        frame.velocity.iter().zip(mass).map(|(v, m)| 0.5 * m * square(v)).sum()
    };
    let kinetic = frame.budget.get("kinetic_energy").copied().unwrap_or_else(of_points);
    let found = fronts(&frame, mass, spacing);
    State {
        time: frame.time,
        front: found.mass,
        connected_front: found.connected,
        centre: mean(&frame.position, mass),
        kinetic_energy: kinetic / total,
        position: frame.position,
    }
}

/// Mean of vectors, weighted by mass.
fn mean(values: &[[f64; 2]], mass: &[f64]) -> [f64; 2] {
    let total: f64 = mass.iter().sum();
    [0, 1].map(|k| values.iter().zip(mass).map(|(x, m)| m * x[k]).sum::<f64>() / total)
}
