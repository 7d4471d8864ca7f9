//! Element tests.

use std::path::{Path, PathBuf};

use dem::element::{Element, Row};
use dempm::element::{ElementTest, path_csv};
use miette::{IntoDiagnostic, miette};
use pyo3::prelude::*;

use crate::supervisor::supervise;

/// Drives a packing along the path of a test file, in double precision. Returns the path as CSV.
#[pyfunction]
pub fn element(py: Python<'_>, file: PathBuf) -> PyResult<String> {
    supervise(py, None, move |_, _| path(&file))
}

fn path(file: &Path) -> miette::Result<String> {
    let test = ElementTest::load(file)?;
    let packing = test.prepare(file.parent().unwrap_or(Path::new("")))?;
    let mut element =
        Element::<f64>::new(packing.convert(), &test.rve, test.macro_step()).into_diagnostic()?;
    let mut rows: Vec<Row> = vec![element.row()];
    for (k, stage) in test.stages().enumerate() {
        element
            .run(stage, test.sampling(), |row| rows.push(*row))
            .map_err(|error| miette!("stage {} ({}): {error}", k + 1, stage.name()))?;
    }
    Ok(path_csv(&rows))
}
