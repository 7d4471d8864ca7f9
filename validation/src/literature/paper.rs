//! Numbers of the paper: Zhao, Chen, Zhao, CMAME 433 (2025) 117536.

/// A row of Table 6.
pub struct Network {
    /// Number of parameters.
    pub parameters: usize,
    /// Training time of a step on two H800 with a batch of two on each, ms.
    pub step_milliseconds: f64,
}

const fn network(parameters: usize, step_milliseconds: f64) -> Network {
    Network { parameters, step_milliseconds }
}

/// Table 6, in the order of [`PAPER_NETWORKS`](surrogate::network::PAPER_NETWORKS).
pub const NETWORKS: [Network; 10] = [
    network(1_425_282, 70.5),
    network(1_062_018, 64.7),
    network(1_276_546, 66.1),
    network(1_127_810, 61.9),
    network(830_594, 54.6),
    network(1_127_810, 51.5),
    network(599_170, 37.2),
    network(979_074, 46.3),
    network(830_594, 47.6),
    network(748_802, 85.3),
];

/// A row of Table 7.
pub struct WallTime {
    /// Name of the case.
    pub case: &'static str,
    /// Number of material points.
    pub points: usize,
    /// Number of steps.
    pub steps: usize,
    /// Solver (DEMPM) on an RTX 4090, s.
    pub solver: f64,
    /// Network (TGNNS) on an RTX 4090, s.
    pub network_rtx_4090: f64,
    /// Network (TGNNS) on an H800, s.
    pub network_h800: f64,
}

const fn wall_time(
    case: &'static str,
    points: usize,
    steps: usize,
    [solver, network_rtx_4090, network_h800]: [f64; 3],
) -> WallTime {
    WallTime { case, points, steps, solver, network_rtx_4090, network_h800 }
}

/// Table 7.
pub const WALL_TIMES: [WallTime; 8] = [
    wall_time("col2x2", 1024, 30_000, [325.0, 4.8, 3.2]),
    wall_time("col2x2twins", 2048, 30_000, [639.0, 7.6, 5.1]),
    wall_time("col5x2", 2560, 30_000, [948.0, 9.3, 6.0]),
    wall_time("col10x2", 5120, 30_000, [1718.0, 16.5, 11.0]),
    wall_time("col5x3", 3840, 30_000, [1370.0, 13.3, 8.4]),
    wall_time("col5x4", 5120, 50_000, [1614.0, 28.3, 17.9]),
    wall_time("col5x5", 6400, 50_000, [2299.0, 35.2, 22.2]),
    wall_time("col3x3barriers", 2304, 30_000, [962.0, 10.0, 6.6]),
];

/// A data set of Table 2.
pub struct DataSet {
    /// Its number.
    pub name: &'static str,
    /// Solver steps between frames.
    pub steps_per_frame: f64,
    /// Frames of a trajectory.
    pub frames: f64,
}

/// The five data sets, from fine to coarse frames.
pub const DATA_SETS: [DataSet; 5] = [
    DataSet { name: "1", steps_per_frame: 100.0, frames: 300.0 },
    DataSet { name: "2", steps_per_frame: 200.0, frames: 150.0 },
    DataSet { name: "3", steps_per_frame: 300.0, frames: 100.0 },
    DataSet { name: "4", steps_per_frame: 600.0, frames: 50.0 },
    DataSet { name: "5", steps_per_frame: 1000.0, frames: 30.0 },
];

/// Numbers of trajectories for training, validation and test, by folder.
pub const TRAJECTORIES: [(&str, usize); 3] = [("train", 25), ("valid", 5), ("test", 9)];

/// When an error of a rollout is taken.
#[derive(Clone, Copy)]
pub enum When {
    /// At a frame of data set 1.
    Frame(usize),
    /// At its largest.
    Peak,
    /// At the last frame.
    End,
}

/// An error that the text states, as an order of magnitude.
pub struct StatedError {
    /// Folder of the case: `valid` or `test`.
    pub set: &'static str,
    /// Name of the case's file.
    pub case: &'static str,
    /// When the error is taken.
    pub when: When,
    /// Case and time in words.
    pub words: &'static str,
    /// Mean square distance of points, box width 1.
    pub mse: f64,
}

/// The stated errors. For Col2x2 the text gives a quarter of Col5x2's.
pub const STATED_ERRORS: [StatedError; 4] = [
    StatedError {
        set: "valid",
        case: "case1",
        when: When::Frame(50),
        words: "Case 1 at frame 50",
        mse: 1e-6,
    },
    StatedError {
        set: "test",
        case: "col5x2",
        when: When::Peak,
        words: "Col5x2 at its peak",
        mse: 1e-4,
    },
    StatedError {
        set: "test",
        case: "col2x2",
        when: When::Peak,
        words: "Col2x2 at its peak",
        mse: 2.5e-5,
    },
    StatedError {
        set: "test",
        case: "col3x3barriers",
        when: When::End,
        words: "Col3x3barriers at the end",
        mse: 5e-5,
    },
];

/// Frames of the truth that its network is given.
pub const GIVEN_FRAMES: usize = 6;

#[cfg(test)]
mod tests {
    use surrogate::network::{ModelConfig, PAPER_NETWORKS};

    use super::*;

    #[test]
    fn parameters_are_those_of_the_paper() {
        for (name, network) in PAPER_NETWORKS.iter().zip(NETWORKS) {
            let config = ModelConfig::named(name).unwrap();
            assert_eq!(config.parameter_count(), network.parameters, "{name}");
        }
    }
}
