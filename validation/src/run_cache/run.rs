//! The record of a finished run.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use dempm::trajectory::Trajectory;
use serde::{Deserialize, Serialize};

/// File name of the record.
pub(super) const RECORD: &str = "run.json";

/// Prefix of the files that hold a run's differences from other trajectories.
pub const DIFFERENCE: &str = "difference-";

/// A finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Hash of the inputs; the name of the run's folder.
    pub id: String,
    /// The command as a user would type it.
    pub command: String,
    /// The trajectory that it wrote.
    pub output: PathBuf,
    /// Whether it ended with exit code 0.
    pub succeeded: bool,
    /// Wall time of the process since it was last started, s, with files and preparation.
    pub seconds: f64,
    /// Processor time of the same over all threads, s; `None` where the system does not report it.
    pub processor_seconds: Option<f64>,
    /// Standard error.
    pub message: String,
    /// Standard output.
    pub summary: String,
    /// Load average per core at its end; above 1, wall times are inflated.
    pub load: Option<f64>,
    /// Hash of the program that ran it.
    pub build: String,
    /// Metadata of its trajectory, if it wrote one.
    pub about: Option<About>,
}

/// How a trajectory was made, from its own metadata.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// Seed of the scene.
    pub seed: u64,
    /// Device that computed it.
    pub device: String,
    /// Floating-point precision.
    pub precision: String,
    /// Versions of the programs, by name.
    pub versions: BTreeMap<String, String>,
    /// Wall time of each phase, s.
    pub wall_time: BTreeMap<String, f64>,
}

impl About {
    /// Metadata of a trajectory file; `None` if it cannot be read.
    pub(super) fn of(path: &Path) -> Option<Self> {
        let trajectory = Trajectory::open(path).ok()?;
        let header = trajectory.header();
        Some(Self {
            seed: header.seed,
            device: header.device.clone(),
            precision: header.precision.clone(),
            versions: header.versions.clone(),
            wall_time: trajectory.wall_time().clone(),
        })
    }
}

/// Removes the differences of an earlier run in this folder.
pub(super) fn forget_differences(folder: &Path) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with(DIFFERENCE) {
            fs::remove_file(&path)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_computed_from_an_earlier_run_is_forgotten() {
        let folder = tempfile::tempdir().unwrap();
        let [old, kept] = ["difference-1.json", "stderr.txt"].map(|name| folder.path().join(name));
        for path in [&old, &kept] {
            fs::write(path, "").unwrap();
        }
        forget_differences(folder.path()).unwrap();
        assert!(!old.exists() && kept.exists());
    }
}
