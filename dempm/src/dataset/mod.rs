//! `dempm dataset`: many scenes into a folder of trajectories that a model can be trained on.

mod error;
mod list;
mod metadata;
mod paper;
mod report;
mod split;
mod statistics;
mod work;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use miette::{IntoDiagnostic, bail};

use crate::device::Device;
use crate::run::{INTERRUPTED, checkpoint_interval, interrupt_flag};
use crate::scene::Scene;

pub use error::DatasetError;
pub use metadata::Metadata;
pub use split::{DataSet, Split, open_finished};
pub use statistics::{Statistics, Welford};

/// Arguments of `dempm dataset`.
#[derive(clap::Args)]
pub struct DatasetArgs {
    /// `paper`, the 39 scenes of Zhao, Chen & Zhao (2025), or a list of scenes (TOML).
    scenes: PathBuf,
    /// Folder of the data set.
    #[arg(short, long)]
    output: PathBuf,
    /// Only these splits (may be repeated).
    #[arg(long)]
    only: Vec<Split>,
    /// Where to compute: auto (every GPU that is visible, else the CPU), cpu, cuda or cuda:N.
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Scenes at a time on each device.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// Make trajectories again that are there already.
    #[arg(long)]
    overwrite: bool,
    /// Seconds between checkpoints, at least, and never more than 2 % of the time; 0: every frame.
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    checkpoint_interval: f64,
}

/// A scene of a data set.
#[derive(Clone, Debug)]
pub struct Case {
    pub split: Split,
    /// Name of its file without ending.
    pub name: String,
    pub scene: Scene,
    /// What distinguishes it from the other scenes of a list.
    pub values: String,
}

impl Case {
    /// Its trajectory in the data set `folder`.
    pub fn file(&self, folder: &Path) -> PathBuf {
        folder.join(self.split.name()).join(format!("{}.h5", self.name))
    }

    /// Points times steps, a measure of its cost.
    fn work(&self) -> u64 {
        self.scene.point_count() as u64 * self.scene.steps() as u64
    }
}

/// Makes a data set: what is complete stays, what was interrupted goes on.
///
/// # Errors
/// A wrong list or scene, a device that cannot be used, or scenes that failed (after all others
/// are done).
pub fn dataset(args: &DatasetArgs) -> miette::Result<ExitCode> {
    let all = cases(&args.scenes)?;
    let mut chosen = all.clone();
    if !args.only.is_empty() {
        chosen.retain(|case| args.only.contains(&case.split));
    }
    if chosen.is_empty() {
        bail!("{}: no scene of this split", args.scenes.display());
    }
    let options = work::Options {
        devices: args.device.open_all().into_diagnostic()?,
        jobs: args.jobs.into(),
        overwrite: args.overwrite,
        checkpoint_interval: checkpoint_interval(args.checkpoint_interval)?,
    };
    let interrupted = interrupt_flag()?;
    let done = work::run(&chosen, &args.output, &options, &interrupted)?;

    let rows = report::rows(&all, &args.output)?;
    print!("{}", report::table(&rows));
    report::write_csv(&rows, &args.output.join("scenes.csv"))?;
    let trained = |row: &report::Row| row.split != Split::Train || row.is_finished();
    if rows.iter().all(trained) && rows.iter().any(|row| row.split == Split::Train) {
        Metadata::of(&finished(&all, &rows, &args.output))?.write(&args.output)?;
        println!("{}", args.output.join("metadata.json").display());
    } else {
        println!("no metadata.json yet: the training set is not complete");
    }
    match done {
        work::Done::All => Ok(ExitCode::SUCCESS),
        work::Done::Interrupted => {
            eprintln!("interrupted; the same command continues");
            Ok(ExitCode::from(INTERRUPTED))
        }
        work::Done::Failed(names) => bail!("failed: {}", names.join(", ")),
    }
}

/// The part of the data set that is finished.
fn finished(cases: &[Case], rows: &[report::Row], folder: &Path) -> DataSet {
    let files = |split| {
        let of_split = cases.iter().zip(rows).filter(|(case, _)| case.split == split);
        of_split.filter(|(_, row)| row.is_finished()).map(|(case, _)| case.file(folder)).collect()
    };
    DataSet { splits: Split::ALL.map(|split| (split, files(split))).into() }
}

/// The scenes of the paper or of a list.
fn cases(scenes: &Path) -> miette::Result<Vec<Case>> {
    if scenes != Path::new("paper") {
        return list::read(scenes);
    }
    paper::SCENES
        .iter()
        .map(|&(split, name, text)| {
            let scene = Scene::parse(text, &format!("paper/{}/{name}.toml", split.name()))?;
            Ok(Case { split, name: name.to_owned(), scene, values: String::new() })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scenes_of_the_paper_are_valid_without_their_files() {
        let cases = cases(Path::new("paper")).unwrap();
        assert_eq!(cases.len(), 39);
        let penetration = cases.last().unwrap();
        // 90 000 steps of 5120 points.
        assert_eq!(penetration.work(), 460_800_000);
        assert_eq!(penetration.file(Path::new("d")), Path::new("d/test/penetration.h5"));
    }
}
