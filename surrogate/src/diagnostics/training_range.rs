//! Range of the training data: initial frames outside it are an extrapolation.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::data::{DataError, DataSet, Recording};
use crate::features::radius_graph;

/// Relative tolerance on the training range.
const MARGIN: f64 = 0.05;
/// The same for a quantity that scatters from frame to frame.
const SCATTER: f64 = 1.0;
/// Largest logarithm of a quantity over its limit that counts: beyond, nothing is known.
const FARTHEST: f64 = 2.0;
/// Every tenth frame of the training data is measured.
const STRIDE: usize = 10;

/// A state of flow in a few numbers, measured in three consecutive frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlowState {
    /// Number of points.
    pub points: f64,
    /// Horizontal extent of the points, m.
    pub width: f64,
    /// Vertical extent of the points, m.
    pub height: f64,
    /// Mean number of neighbours within the connection radius.
    pub neighbours: f64,
    /// Root mean square velocity, m/s.
    pub speed: f64,
    /// Root mean square difference between a point's acceleration and the mean of its neighbours',
    /// m/s². Noise on positions makes it large, as neighbours move alike.
    pub roughness: f64,
}

/// A quantity of a [`FlowState`].
struct Quantity {
    name: &'static str,
    unit: &'static str,
    of: fn(&FlowState) -> f64,
    /// Relative tolerance.
    margin: f64,
    /// Whether values below the range count as outside.
    least: bool,
}

const QUANTITIES: [Quantity; 6] = [
    Quantity { name: "points", unit: "", of: |s| s.points, margin: MARGIN, least: true },
    Quantity { name: "width", unit: " m", of: |s| s.width, margin: MARGIN, least: true },
    Quantity { name: "height", unit: " m", of: |s| s.height, margin: MARGIN, least: true },
    Quantity {
        name: "neighbours of a point",
        unit: "",
        of: |s| s.neighbours,
        margin: MARGIN,
        least: true,
    },
    Quantity { name: "mean speed", unit: " m/s", of: |s| s.speed, margin: MARGIN, least: false },
    Quantity {
        name: "differences between neighbours' accelerations",
        unit: " m/s²",
        of: |s| s.roughness,
        margin: SCATTER,
        least: false,
    },
];

impl FlowState {
    /// Measures positions (m) in frames `interval` (s) apart; `radius` is the connection radius (m).
    pub fn measure([first, second, third]: [&[[f64; 2]]; 3], interval: f64, radius: f64) -> Self {
        let count = third.len().max(1) as f64;
        let extent = |k: usize| {
            let end = |pick: fn(f64, f64) -> f64, from| third.iter().map(|x| x[k]).fold(from, pick);
            end(f64::max, f64::MIN) - end(f64::min, f64::MAX)
        };
        let flat: Vec<f32> = third.iter().flatten().map(|&x| x as f32).collect();
        let graph = radius_graph(&flat, radius as f32);
        let acceleration: Vec<[f64; 2]> = (0..third.len())
            .map(|p| [0, 1].map(|k| third[p][k] - 2.0 * second[p][k] + first[p][k]))
            .collect();
        let roughness = |p: usize| {
            let near = &graph.sender[graph.start[p] as usize..graph.start[p + 1] as usize];
            let [x, y] = [0, 1].map(|k| {
                let sum: f64 = near.iter().map(|&w| acceleration[w as usize][k]).sum();
                acceleration[p][k] - sum / near.len() as f64
            });
            if near.is_empty() { 0.0 } else { x * x + y * y }
        };
        let moved = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
        let path: f64 = third.iter().zip(second).map(moved).sum();
        Self {
            points: third.len() as f64,
            width: extent(0),
            height: extent(1),
            neighbours: graph.edges() as f64 / count,
            speed: (path / count).sqrt() / interval,
            roughness: ((0..third.len()).map(roughness).sum::<f64>() / count).sqrt()
                / (interval * interval),
        }
    }

    /// The smaller or larger of each quantity.
    fn with(&self, other: &Self, pick: fn(f64, f64) -> f64) -> Self {
        Self {
            points: pick(self.points, other.points),
            width: pick(self.width, other.width),
            height: pick(self.height, other.height),
            neighbours: pick(self.neighbours, other.neighbours),
            speed: pick(self.speed, other.speed),
            roughness: pick(self.roughness, other.roughness),
        }
    }
}

/// Smallest and largest value of each quantity in the training data.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingRange {
    /// Smallest values.
    pub least: FlowState,
    /// Largest values.
    pub most: FlowState,
}

impl TrainingRange {
    /// Measures every tenth frame of all files; `None` if they are too short. `radius` is the
    /// connection radius (m).
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn of(data: &DataSet, radius: f64) -> Result<Option<Self>, DataError> {
        let (stride, interval) = (data.shape().stride, data.frame_interval());
        let of_one = |recording: &Recording| {
            let mut range: Option<Self> = None;
            for first in (0..recording.frames().saturating_sub(2 * stride)).step_by(STRIDE) {
                let frame = |k: usize| recording.positions(first + k * stride);
                let [a, b, c] = [frame(0)?, frame(1)?, frame(2)?];
                let frames = [&a, &b, &c].map(|frame| frame.as_chunks::<2>().0);
                let state = FlowState::measure(frames, interval, radius);
                let state = Self { least: state, most: state };
                range = Some(range.map_or(state, |range| range.and(state)));
            }
            Ok::<_, DataError>(range)
        };
        let ranges: Result<Vec<_>, _> = data.recordings().par_iter().map(of_one).collect();
        Ok(ranges?.into_iter().flatten().reduce(Self::and))
    }

    /// The union of two ranges.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            least: self.least.with(&other.least, f64::min),
            most: self.most.with(&other.most, f64::max),
        }
    }

    /// How far a number of neighbours is outside the training range: the logarithm of its ratio to the limit.
    pub fn excess_of_neighbours(&self, neighbours: f64) -> f64 {
        let [least, most] = [&self.least, &self.most].map(|state| state.neighbours);
        (neighbours / most).ln().max((least / neighbours).ln()).max(0.0)
    }

    /// How far a state is outside the training range: the sum of the logarithms of values over limits.
    pub fn excess(&self, state: &FlowState) -> f64 {
        let beyond = |q: &Quantity| {
            let [value, least, most] = [state, &self.least, &self.most].map(q.of);
            let above = (value / most.max(f64::MIN_POSITIVE)).ln();
            let below = if q.least { (least / value.max(f64::MIN_POSITIVE)).ln() } else { 0.0 };
            above.max(below).clamp(0.0, FARTHEST)
        };
        QUANTITIES.iter().map(beyond).sum()
    }

    /// The quantities of an initial state outside the training range, with their limits.
    pub fn outside(&self, initial: &FlowState) -> Vec<String> {
        let outside = |q: &Quantity| {
            let [value, least, most] = [initial, &self.least, &self.most].map(q.of);
            let text = |how: &str, limit: f64| {
                let [value, limit] = [value, limit].map(rounded);
                format!("{} {value}{unit}, {how} {limit}{unit} in training", q.name, unit = q.unit)
            };
            if value > (1.0 + q.margin) * most {
                Some(text("at most", most))
            } else if q.least && value < (1.0 - q.margin) * least {
                Some(text("at least", least))
            } else {
                None
            }
        };
        QUANTITIES.iter().filter_map(outside).collect()
    }
}

/// Rounds to three digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: f64 = 0.01;
    const RADIUS: f64 = 0.11;

    /// A lattice of 10 x 5 points, 0.1 m apart, that falls; every point has its own noise.
    fn state(noise: impl Fn(usize, usize) -> f64) -> FlowState {
        let frame = |k: usize| -> Vec<[f64; 2]> {
            let fall = 0.5 * 9.81 * (k as f64 * INTERVAL).powi(2);
            (0..50)
                .map(|p| [0.1 * (p % 10) as f64, 0.1 * (p / 10) as f64 - fall + noise(p, k)])
                .collect()
        };
        FlowState::measure([&frame(0), &frame(1), &frame(2)], INTERVAL, RADIUS)
    }

    #[test]
    fn a_falling_lattice() {
        let state = state(|_, _| 0.0);
        assert_eq!(state.points, 50.0);
        assert!((state.width - 0.9).abs() < 1e-12 && (state.height - 0.4).abs() < 1e-12);
        // 10 columns of 4 and 5 rows of 9 pairs, each of them two edges.
        assert_eq!(state.neighbours, 2.0 * (10.0 * 4.0 + 5.0 * 9.0) / 50.0);
        // Half way between the last two frames.
        assert!((state.speed - 9.81 * 1.5 * INTERVAL).abs() < 1e-9);
        assert!(state.roughness < 1e-9, "all fall alike: {}", state.roughness);
    }

    #[test]
    fn every_other_point_shaken_is_rough() {
        // A chequerboard: each neighbour is accelerated the other way.
        let shaken = state(|p, k| if k == 1 && (p + p / 10) % 2 == 0 { 1e-3 } else { 0.0 });
        let expected = 2e-3 / (INTERVAL * INTERVAL);
        assert!((shaken.roughness / expected - 1.0).abs() < 1e-9, "{}", shaken.roughness);
    }

    #[test]
    fn only_what_is_outside_is_reported() {
        let quiet = state(|_, _| 0.0);
        let most = FlowState { width: 2.0, speed: 1.0, roughness: 1.0, ..quiet };
        let range = TrainingRange { least: quiet, most };
        assert!(range.outside(&quiet).is_empty() && range.excess(&quiet) == 0.0);
        // Slower and smoother than in training, and a little beyond: all the same.
        let near = FlowState { speed: 0.0, roughness: 1.5, width: 2.05, ..quiet };
        assert!(range.outside(&near).is_empty());
        for (start, expected) in [
            (FlowState { points: 25.0, ..quiet }, "points 25, at least 50"),
            (FlowState { width: 3.0, ..quiet }, "width 3 m, at most 2 m"),
            (FlowState { height: 0.2, ..quiet }, "height 0.2 m, at least 0.4 m"),
            (FlowState { neighbours: 6.0, ..quiet }, "neighbours of a point 6, at most 3.4"),
            (FlowState { speed: 5.0, ..quiet }, "mean speed 5 m/s, at most 1 m/s"),
            (FlowState { roughness: 34.6, ..quiet }, "accelerations 34.6 m/s², at most 1 m/s²"),
        ] {
            let [found] = &range.outside(&start)[..] else { panic!("{expected}") };
            assert!(found.contains(expected), "{found}");
        }
        // Half as many points and twice the width: ln 2 each. A hundredfold counts as much as e² times.
        let beyond = FlowState { points: 25.0, width: 4.0, ..quiet };
        assert!((range.excess(&beyond) - 2.0 * 2.0_f64.ln()).abs() < 1e-12);
        assert_eq!(range.excess(&FlowState { speed: 100.0, ..quiet }), 2.0);
    }
}
