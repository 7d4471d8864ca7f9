//! One packing on one shear path in this code and in YADE.

use std::collections::BTreeMap;
use std::process::Command;

use miette::{IntoDiagnostic, WrapErr, bail};
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::machine::processor;
use crate::studies::statistics::mean;

/// The comparison, and the part of it that YADE runs; also commands of their own.
const SCRIPTS: [(&str, &str); 2] = [
    ("compare.py", include_str!("../../yade/compare.py")),
    ("shear.py", include_str!("../../yade/shear.py")),
];
/// Kind of the kept value.
const KIND: &str = "yade";
/// Estimated time, s.
const SECONDS: f64 = 60.0;

/// A comparison, which may have been made on another machine than the rest of the report.
#[derive(Serialize, Deserialize)]
pub struct Comparison {
    /// Version of YADE.
    pub version: String,
    /// The processor that both codes ran on.
    pub processor: String,
    /// The paths and speeds of both.
    pub found: Found,
}

/// What `compare.py` writes, by code: `f64`, `f32`, `yade`.
#[derive(Serialize, Deserialize)]
pub struct Found {
    /// Disc-steps per second on one thread.
    speed: BTreeMap<String, f64>,
    /// Shear strain, pressure p and shear stress q (Pa) along the path.
    path: BTreeMap<String, Vec<[f64; 3]>>,
}

/// Compares the codes; `None` if YADE is not installed and no comparison is kept.
///
/// # Errors
/// If the scripts fail or the user interrupts.
pub fn measure(context: &mut Context) -> miette::Result<Option<Comparison>> {
    let key = format!("{}\n{}", SCRIPTS[0].1, SCRIPTS[1].1);
    let installed = Command::new("yade").arg("--version").output();
    if installed.is_err() && !context.cache.has_cached(KIND, &key) {
        return Ok(None);
    }
    let program = context.cache.program().to_owned();
    let comparison = context.cached(KIND, &key, SECONDS, || {
        let version = installed.into_diagnostic()?.stdout;
        let version = String::from_utf8_lossy(&version).trim().to_owned();
        Ok(Comparison { version, processor: processor(), found: run_scripts(&program)? })
    });
    comparison.map(Some)
}

fn run_scripts(program: &std::path::Path) -> miette::Result<Found> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    for (name, text) in SCRIPTS {
        std::fs::write(folder.path().join(name), text).into_diagnostic()?;
    }
    let json = folder.path().join("found.json");
    let output = Command::new("python3")
        .arg(folder.path().join("compare.py"))
        .arg("--dempm")
        .arg(program)
        .arg("--json")
        .arg(&json)
        .output()
        .into_diagnostic()
        .wrap_err("cannot start python3")?;
    if !output.status.success() {
        bail!("compare.py failed: {}", String::from_utf8_lossy(&output.stderr).trim());
    }
    let text = std::fs::read(json).into_diagnostic()?;
    serde_json::from_slice(&text).into_diagnostic().wrap_err("cannot read what compare.py wrote")
}

impl Found {
    /// Disc-steps per second of a code on one thread; NaN if it is missing.
    pub fn speed(&self, code: &str) -> f64 {
        self.speed.get(code).copied().unwrap_or(f64::NAN)
    }

    /// Shear strain, pressure and shear stress (Pa) along the path of a code.
    pub fn path(&self, code: &str) -> &[[f64; 3]] {
        self.path.get(code).map_or(&[], Vec::as_slice)
    }

    /// Mean relative difference in pressure from YADE between two shear strains.
    pub fn difference(&self, code: &str, [from, to]: [f64; 2]) -> f64 {
        let differences: Vec<f64> = self
            .path(code)
            .iter()
            .zip(self.path("yade"))
            .filter(|([strain, ..], _)| from < *strain && *strain <= to)
            .map(|(a, b)| (a[1] / b[1] - 1.0).abs())
            .collect();
        mean(&differences)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pressures_are_compared_over_a_part_of_the_path() {
        let path = |p: [f64; 3]| (0..3).map(|k| [0.1 * k as f64, p[k], 1.0]).collect::<Vec<_>>();
        let paths = [("f64", path([1.0, 2.2, 4.4])), ("yade", path([1.0, 2.0, 4.0]))];
        let path = paths.map(|(code, path)| (code.to_owned(), path)).into();
        let found = Found { speed: BTreeMap::new(), path };
        assert!((found.difference("f64", [0.0, 0.3]) - 0.1).abs() < 1e-12);
        assert_eq!(found.difference("f64", [-0.1, 0.05]), 0.0);
        assert!(found.difference("f32", [0.0, 0.3]).is_nan());
    }
}
