//! `dempm export`: a trajectory in the formats of other programs.

mod npz;
mod vtp;

use std::path::{Path, PathBuf};

use crate::trajectory::{Trajectory, TrajectoryError, WriteError};

/// The arguments of `dempm export`.
#[derive(clap::Args, Clone, Debug)]
pub struct ExportArgs {
    /// The trajectory file
    pub file: PathBuf,
    /// The format
    #[arg(long, value_enum)]
    pub to: Format,
    /// The file to write [default: FILE with the suffix of the format]
    #[arg(short, long)]
    pub output: Option<PathBuf>,
}

/// Formats of other programs.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A .pvd file with a folder of .vtp files, one a frame, for ParaView and VTK
    Vtk,
    /// One .npz file with all arrays, for numpy.load
    Npz,
}

/// Why an export failed.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub(crate) enum ExportError {
    #[error(transparent)]
    #[diagnostic(transparent)]
    Trajectory(#[from] TrajectoryError),
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
    #[error("{}: cannot write it", path.display())]
    Io { path: PathBuf, source: std::io::Error },
}

impl ExportError {
    fn at(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}

/// Writes the trajectory in the format that the arguments ask for.
///
/// # Errors
/// If the trajectory cannot be read or the export cannot be written.
pub fn export(args: &ExportArgs) -> miette::Result<()> {
    let trajectory = Trajectory::open(&args.file)?;
    let suffix = match args.to {
        Format::Vtk => "pvd",
        Format::Npz => "npz",
    };
    let output = args.output.clone().unwrap_or_else(|| args.file.with_extension(suffix));
    match args.to {
        Format::Vtk => vtp::write(&trajectory, &output)?,
        Format::Npz => npz::write(&trajectory, &output)?,
    }
    println!("{}", output.display());
    Ok(())
}
