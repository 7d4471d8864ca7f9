//! The parts of the material by which two runs are compared.

use super::squares::{by_square, least_side, means, starts};
use crate::trajectory::{Trajectory, TrajectoryError};

/// Relative tolerance on equal distances between points.
const ROUNDING: f64 = 1e-6;

/// The parts of the material that are compared in two runs: the points of each that form a part.
#[derive(Clone, Debug)]
pub struct Parts {
    groups: [Vec<Vec<usize>>; 2],
    /// Masses of the parts in the second run, kg/m.
    pub mass: Vec<f64>,
    /// Side of a part, m.
    pub side: f64,
}

impl Parts {
    /// Points of the same number, size and layout one by one. Of others, those that start in one square are averaged, as
    /// small as both runs [allow](least_side); squares begin at the lower left corner of each column. `None` if the two
    /// do not start with the same material.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn of(one: &Trajectory, other: &Trajectory) -> Result<Option<Self>, TrajectoryError> {
        let spacings = [one, other].map(|file| file.header().point_spacing);
        let sides = [one, other].map(|file| least_side(file.header()));
        let alike = |[a, b]: [f64; 2]| (a - b).abs() < ROUNDING * a.max(b);
        let mass = &other.points().mass;
        let count = mass.len();
        if one.points().mass.len() == count && alike(spacings) && alike(sides) {
            let alone = || (0..count).map(|point| vec![point]).collect();
            let groups = [alone(), alone()];
            return Ok(Some(Self { groups, mass: mass.clone(), side: spacings[1] }));
        }
        let side = sides[0].max(sides[1]);
        let [a, b] = [by_square(&starts(one)?, side), by_square(&starts(other)?, side)];
        if !a.keys().eq(b.keys()) {
            return Ok(None);
        }
        let of_group = |group: &Vec<usize>| group.iter().map(|&point| mass[point]).sum();
        let mass = b.values().map(of_group).collect();
        Ok(Some(Self { groups: [a, b].map(|map| map.into_values().collect()), mass, side }))
    }

    /// Their number.
    pub fn count(&self) -> usize {
        self.mass.len()
    }

    /// Whether each is one point in both runs.
    pub fn are_points(&self) -> bool {
        self.groups.iter().flatten().all(|group| group.len() == 1)
    }

    /// The positions (m) of the parts from those of the points of the first run and of the second.
    pub fn positions(&self, one: &[[f64; 2]], other: &[[f64; 2]]) -> [Vec<[f64; 2]>; 2] {
        [means(one, &self.groups[0]), means(other, &self.groups[1])]
    }

    /// The means over the parts of a quantity of the points of the first run and of the second.
    pub fn values(&self, one: &[f64], other: &[f64]) -> [Vec<f64>; 2] {
        let means = |values: &[f64], groups: &[Vec<usize>]| {
            let mean = |group: &Vec<usize>| {
                group.iter().map(|&point| values[point]).sum::<f64>() / group.len() as f64
            };
            groups.iter().map(mean).collect()
        };
        [means(one, &self.groups[0]), means(other, &self.groups[1])]
    }

    /// The root mean square distance (m) of corresponding parts, by mass, from the positions of the points.
    pub fn distance(&self, one: &[[f64; 2]], other: &[[f64; 2]]) -> f64 {
        let [one, other] = self.positions(one, other);
        let square = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
        let squares = one.iter().zip(&other).map(square).zip(&self.mass);
        let total: f64 = self.mass.iter().sum();
        (squares.map(|(square, mass)| mass * square).sum::<f64>() / total).sqrt()
    }
}
