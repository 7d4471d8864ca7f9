//! `dempm import`: makes trajectories of other learned simulators readable here.

use std::path::PathBuf;

use files::{announce, note};

use crate::import::{Format, Imported};

/// The arguments of `dempm import`.
#[derive(clap::Args, Clone, Debug)]
pub struct ImportArgs {
    /// The file of trajectories, or a folder with train, valid and test; metadata.json lies beside
    pub source: PathBuf,
    /// The program that the file is for
    #[arg(long, value_enum)]
    pub from: Format,
    /// The folder for trajectories and statistics
    #[arg(short, long)]
    pub output: PathBuf,
}

/// Imports trajectories and prints their names and sizes.
///
/// # Errors
/// If they cannot be read, or not be written.
pub fn import(args: &ImportArgs) -> miette::Result<()> {
    crate::import::import(&args.source, args.from, &args.output, &mut |imported| {
        let Imported { path, frames, points, boxes, all_in_scene } = imported;
        let boxes = match boxes {
            0 => String::new(),
            1 => ", 1 box".to_owned(),
            more => format!(", {more} boxes"),
        };
        announce!("{}: {frames} frames, {points} points{boxes}", path.display());
        if !all_in_scene {
            note!("its boxes move other than a plate: they are drawn, but stop no predicted point");
        }
    })?;
    announce!("{}", args.output.display());
    Ok(())
}
