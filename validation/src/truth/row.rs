//! A model beside the truth at one time.

use serde::{Deserialize, Serialize};

/// A quantity over the seeds of the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seeds {
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation; `None` of one seed.
    pub deviation: Option<f64>,
}

impl Seeds {
    /// Of one value for each seed; `None` without any.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let deviation = (values.len() > 1).then(|| (squares / (count - 1.0)).sqrt());
        (!values.is_empty()).then_some(Self { mean, deviation })
    }
}

/// A model and the truth at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Time, s.
    pub time: f64,
    /// Root mean square distance of the model's squares from the truth's, over squares and seeds, m.
    pub distance: f64,
    /// The same between two seeds of the truth, over all pairs, m; `None` of one seed.
    pub spread: Option<f64>,
    /// Share of the mass misplaced, mean over seeds.
    pub misplaced: f64,
    /// The same between two seeds of the truth, mean over all pairs; `None` of one seed.
    pub misplaced_spread: Option<f64>,
    /// The model's front of 99 % of the mass, m.
    pub front: f64,
    /// The truth's.
    pub true_front: Seeds,
    /// The model's front of what hangs together, m; `None` where trajectories lack it.
    pub connected_front: Option<f64>,
    /// The truth's.
    pub true_connected_front: Option<Seeds>,
    /// The model's centre of mass, m.
    pub centre: [f64; 2],
    /// The truth's.
    pub true_centre: [Seeds; 2],
    /// The model's kinetic energy over mass, J/kg.
    pub kinetic_energy: f64,
    /// The truth's.
    pub true_kinetic_energy: Seeds,
}

impl Row {
    /// Distance over spread; `None` of one seed.
    pub fn ratio(&self) -> Option<f64> {
        self.spread.map(|spread| self.distance / spread)
    }

    /// Distance between the centres of mass, m.
    pub fn centre_distance(&self) -> f64 {
        let [x, y] = [0, 1].map(|k| self.centre[k] - self.true_centre[k].mean);
        x.hypot(y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_have_a_mean_and_a_deviation() {
        let two = Seeds::of(&[1.0, 3.0]).unwrap();
        assert_eq!((two.mean, two.deviation), (2.0, Some(2.0_f64.sqrt())));
        assert_eq!(Seeds::of(&[5.0]), Some(Seeds { mean: 5.0, deviation: None }));
        assert_eq!(Seeds::of(&[]), None);
    }
}
