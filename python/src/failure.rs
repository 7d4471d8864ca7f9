//! Errors of the commands as exceptions with the same text.

use miette::{GraphicalReportHandler, GraphicalTheme, Report};
use pyo3::PyErr;
use pyo3::exceptions::PyException;

pyo3::create_exception!(dempm, Error, PyException, "What a command of DEMPM reports as its error.");

/// Columns of the text, as in a terminal.
const WIDTH: usize = 100;

/// An exception with the text of a command's error, without colours.
pub fn exception(report: &Report) -> PyErr {
    Error::new_err(text(report))
}

/// The text of an error or a warning as a command prints it, without colours.
pub fn text(report: &Report) -> String {
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
    let mut text = String::new();
    match handler.with_width(WIDTH).render_report(&mut text, report.as_ref()) {
        Ok(()) => format!("\n{}", text.trim_matches('\n')),
        Err(std::fmt::Error) => report.to_string(),
    }
}
