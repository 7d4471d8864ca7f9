//! The three programs and their commands.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;
use files::divert_notes;
use miette::{Report, miette};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::supervisor::supervise;

/// A program of DEMPM.
#[derive(Clone, Copy)]
enum Program {
    Dempm,
    Surrogate,
    Validation,
}

impl Program {
    fn named(name: &str) -> PyResult<Self> {
        match name {
            "dempm" => Ok(Self::Dempm),
            "surrogate" => Ok(Self::Surrogate),
            "validation" => Ok(Self::Validation),
            other => Err(PyValueError::new_err(format!("there is no program {other}"))),
        }
    }

    /// The program itself, which prints its error.
    fn main(self, arguments: Vec<OsString>) -> ExitCode {
        match self {
            Self::Dempm => dempm::program::main(arguments),
            Self::Surrogate => surrogate::program::main(arguments),
            Self::Validation => validation::program::main(arguments),
        }
    }

    /// One command of it, which returns its error.
    fn run(self, arguments: Vec<OsString>) -> miette::Result<ExitCode> {
        match self {
            Self::Dempm => dempm::program::Arguments::try_parse_from(arguments)
                .map_err(|error| wrong(&error))?
                .run(),
            Self::Surrogate => surrogate::program::Arguments::try_parse_from(arguments)
                .map_err(|error| wrong(&error))?
                .run(),
            Self::Validation => validation::program::Arguments::try_parse_from(arguments)
                .map_err(|error| wrong(&error))?
                .run(),
        }
    }
}

/// What is wrong with an option, without the hints for a terminal.
fn wrong(error: &clap::Error) -> Report {
    let text = error.to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    let hints = ["\n\n  tip:", "\n\nUsage:", "\n\nFor more information"];
    let end = hints.iter().filter_map(|hint| text.find(hint)).min();
    miette!("{}", &text[..end.unwrap_or(text.len())])
}

/// Runs a program as the process: it prints, handles signals and may end the process. Returns its exit code.
#[pyfunction]
pub fn main(py: Python<'_>, program: &str, arguments: Vec<OsString>) -> PyResult<u8> {
    let program = Program::named(program)?;
    let code = py.detach(|| program.main(arguments));
    // An exit code can only be compared.
    Ok((0..=u8::MAX).find(|&number| ExitCode::from(number) == code).unwrap_or(1))
}

/// Runs a command of a program; `arguments` do not include the program's name. What it prints to the standard error
/// stream goes to the method `note(text)` of `watcher`; its summary goes nowhere, as the package in Python returns
/// what it is about.
#[pyfunction]
pub fn command(
    py: Python<'_>,
    program: &str,
    arguments: Vec<OsString>,
    watcher: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let program = Program::named(program)?;
    let arguments = std::iter::once(OsString::new()).chain(arguments).collect();
    supervise(py, Some(watcher), move |_, reporter| {
        let reporter = reporter.clone();
        divert_notes(move |text| reporter.note(text));
        program.run(arguments).map(drop)
    })
}
