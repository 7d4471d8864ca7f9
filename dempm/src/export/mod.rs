//! `dempm export`: a trajectory in the formats of other programs.

mod gns;
mod lagrangebench;
mod npz;
mod vtp;

use std::path::{Path, PathBuf};

use files::{WriteError, refuse_input};

use crate::dataset::{DataSet, DatasetError, Metadata};
use crate::trajectory::{Trajectory, TrajectoryError, system_error};

/// The arguments of `dempm export`.
#[derive(clap::Args, Clone, Debug)]
pub struct ExportArgs {
    /// The trajectory file; for gns and lagrangebench also the folder of a data set
    pub file: PathBuf,
    /// The format
    #[arg(long, value_enum)]
    pub to: Format,
    /// The file to write, or the folder for gns and lagrangebench [default: FILE with the suffix of
    /// the format, or with its name after a dash]
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
    /// A folder with train.npz, valid.npz, test.npz and metadata.json, for geoelements/gns
    Gns,
    /// A folder with train.h5, valid.h5, test.h5 and metadata.json, for LagrangeBench
    Lagrangebench,
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
    #[error(transparent)]
    #[diagnostic(transparent)]
    Dataset(#[from] DatasetError),
    #[error("{}: HDF5 refuses to write it", path.display())]
    Hdf5 { path: PathBuf, source: hdf5::Error },
}

impl ExportError {
    fn at(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        move |source| Self::Write(WriteError::at(path, "write it")(source))
    }

    fn hdf5(path: &Path) -> impl Fn(hdf5::Error) -> Self + '_ {
        move |source| match system_error(&source) {
            Some(source) => Self::at(path)(source),
            None => Self::Hdf5 { path: path.to_owned(), source },
        }
    }
}

/// Writes the trajectory in the format that the arguments ask for.
///
/// # Errors
/// If the trajectory cannot be read or the export cannot be written.
pub fn export(args: &ExportArgs) -> miette::Result<()> {
    let with_suffix = |suffix| args.file.with_extension(suffix);
    let output = args.output.clone().unwrap_or_else(|| match args.to {
        Format::Vtk => with_suffix("pvd"),
        Format::Npz => with_suffix("npz"),
        Format::Gns => folder_beside(&args.file, "gns"),
        Format::Lagrangebench => folder_beside(&args.file, "lagrangebench"),
    });
    refuse_input(&output, [&args.file])?;
    let open = || Trajectory::open(&args.file);
    match args.to {
        Format::Vtk => vtp::write(&open()?, &output)?,
        Format::Npz => npz::write(&open()?, &output)?,
        Format::Gns => write_set(&args.file, &output, gns::write)?,
        Format::Lagrangebench => write_set(&args.file, &output, lagrangebench::write)?,
    }
    println!("{}", output.display());
    Ok(())
}

/// `NAME-suffix` beside `NAME.h5` or the folder `NAME`.
fn folder_beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or(path.as_os_str()).to_owned();
    name.push(format!("-{suffix}"));
    path.with_file_name(name)
}

/// Writes each split of a data set (one trajectory is a training set) and its `metadata.json`.
fn write_set(
    source: &Path,
    folder: &Path,
    write: fn(&[Trajectory], &Path) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let set = DataSet::open(source)?;
    let metadata = Metadata::of(&set)?;
    for (split, files) in &set.splits {
        let mut trajectories =
            files.iter().map(|file| Trajectory::open(file)).collect::<Result<Vec<_>, _>>()?;
        // Readers that take the length of the first for that of all then stay inside the others.
        trajectories.sort_by_key(Trajectory::frames);
        let boxes = trajectories.iter().filter(|t| !matches!(t.boxes(0..1), Ok(b) if b.is_empty()));
        let boxes = boxes.count();
        if boxes > 0 {
            eprintln!(
                "{}: obstacles and plates of {boxes} trajectories have no place in this format",
                split.name()
            );
        }
        write(&trajectories, &folder.join(split.name()))?;
    }
    Ok(metadata.write(folder)?)
}

/// Positions of all frames in single precision, as both kinds of files keep them.
fn frames_f32(
    trajectory: &Trajectory,
) -> impl Iterator<Item = Result<ndarray::Array2<f32>, TrajectoryError>> {
    (0..trajectory.frames()).map(|index| {
        let frame = trajectory.positions(index..index + 1)?;
        Ok(frame.index_axis(ndarray::Axis(0), 0).mapv(|x| x as f32))
    })
}
