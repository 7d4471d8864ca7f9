//! `dempm export`: writes a trajectory or a data set in another format.

use std::path::{Path, PathBuf};

use files::{announce, note};

use crate::export::{self, write_data_set, write_npz, write_vtk, write_vtkhdf};
use crate::trajectory::Trajectory;

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
    /// Leave the walls of the domain to the bounds in metadata.json (gns and lagrangebench)
    #[arg(long)]
    pub no_walls: bool,
}

/// Formats of other programs.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A .pvd file with a folder of .vtp files, one a frame, for ParaView and VTK
    Vtk,
    /// One .vtkhdf file of the grains over time, for ParaView and VTK
    Vtkhdf,
    /// One .npz file with all arrays, for numpy.load
    Npz,
    /// A folder with train.npz, valid.npz, test.npz and metadata.json, for geoelements/gns
    Gns,
    /// A folder with train.h5, valid.h5, test.h5 and metadata.json, for LagrangeBench
    Lagrangebench,
}

/// Writes the trajectory or data set and prints the name of the output.
///
/// # Errors
/// If a trajectory cannot be read or the export cannot be written.
pub fn export(args: &ExportArgs) -> miette::Result<()> {
    let with_suffix = |suffix| args.file.with_extension(suffix);
    let output = args.output.clone().unwrap_or_else(|| match args.to {
        Format::Vtk => with_suffix("pvd"),
        Format::Vtkhdf => with_suffix("vtkhdf"),
        Format::Npz => with_suffix("npz"),
        Format::Gns => folder_beside(&args.file, "gns"),
        Format::Lagrangebench => folder_beside(&args.file, "lagrangebench"),
    });
    let data_set_format = matches!(args.to, Format::Gns | Format::Lagrangebench);
    if args.no_walls && !data_set_format {
        miette::bail!("--no-walls is an option of `--to gns` and `--to lagrangebench`");
    }
    match args.to {
        Format::Vtk => write_vtk(&Trajectory::open(&args.file)?, &output)?,
        Format::Vtkhdf => write_vtkhdf(&Trajectory::open(&args.file)?, &output)?,
        Format::Npz => write_npz(&Trajectory::open(&args.file)?, &output)?,
        Format::Gns => write_splits(args, &output, export::Format::Gns)?,
        Format::Lagrangebench => write_splits(args, &output, export::Format::Lagrangebench)?,
    }
    announce!("{}", output.display());
    Ok(())
}

/// Writes a data set and reports what its reader has to know.
fn write_splits(args: &ExportArgs, folder: &Path, format: export::Format) -> miette::Result<()> {
    let written = write_data_set(&args.file, folder, format, !args.no_walls)?;
    let counts = || written.particles.iter().flat_map(|(_, counts)| counts);
    let mixed = counts().min() != counts().max();
    if mixed && format == export::Format::Lagrangebench {
        note!("numbers of particles differ: LagrangeBench needs `neighbors.backend: matscipy`");
    }
    if !written.friction && format == export::Format::Gns {
        note!("no material property: not every trajectory has a friction angle");
    }
    Ok(())
}

/// `NAME-suffix` beside `NAME.h5` or the folder `NAME`.
fn folder_beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or(path.as_os_str()).to_owned();
    name.push(format!("-{suffix}"));
    path.with_file_name(name)
}
