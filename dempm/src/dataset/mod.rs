//! `dempm dataset`: many scenes into a folder of trajectories that a model can be trained on.

mod choice;
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

use files::{INTERRUPTED, interrupt_flag};
use miette::{IntoDiagnostic, bail};

use crate::device::Device;
use crate::run::checkpoint_interval;
use crate::scene::Scene;

use choice::Choice;
pub use error::DatasetError;
pub use metadata::Metadata;
pub use split::{DataSet, Split, open_finished};
pub use statistics::{Statistics, Welford};

/// Scenes at a time on a GPU: measured in docs/notes/2026-11-22-rve-kernel.md.
const JOBS_ON_A_GPU: usize = 4;

/// Arguments of `dempm dataset`.
#[derive(clap::Args)]
pub struct DatasetArgs {
    /// `paper`, the 39 scenes of Zhao, Chen & Zhao (2025), or a list of scenes (TOML).
    scenes: PathBuf,
    /// Folder of the data set.
    #[arg(short, long)]
    output: PathBuf,
    /// Only this split, or the scenes of it that a name stands for: test, test/col2x2, test/col*
    /// (may be repeated).
    #[arg(long, value_name = "SPLIT[/NAME]")]
    only: Vec<Choice>,
    /// Where to compute: auto (every visible GPU, else the CPU), cpu, cuda (every GPU) or cuda:N.
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Scenes at a time on each device [default: 4 on a GPU, whose gaps they fill, 1 on the CPU].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,
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
    /// What its block of a list says of it, to tell it from the others.
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
    same_interval(&all, &args.scenes)?;
    let chosen = chosen(&all, &args.only, &args.scenes)?;
    let devices = args.device.open_all().into_diagnostic()?;
    let usual = if devices.is_empty() { 1 } else { JOBS_ON_A_GPU };
    let options = work::Options {
        jobs: args.jobs.map_or(usual, usize::from),
        devices,
        overwrite: args.overwrite,
        checkpoint_interval: checkpoint_interval(args.checkpoint_interval)?,
    };
    let interrupted = interrupt_flag()?;
    let done = work::run(&chosen, &args.output, &options, &interrupted)?;

    let rows = report::rows(&all, &args.output);
    print!("{}", report::table(&rows));
    report::write_csv(&rows, &args.output.join("scenes.csv"))?;
    let trained = |row: &report::Row| row.split != Split::Train || row.is_finished();
    if rows.iter().all(trained) && rows.iter().any(|row| row.split == Split::Train) {
        Metadata::of(&finished(&all, &rows, &args.output))?.write(&args.output)?;
        println!("{}", args.output.join("metadata.json").display());
    } else {
        println!("no metadata.json yet: the training set is not complete");
    }
    let mut failed = match done {
        work::Done::Interrupted => {
            let how = if args.overwrite { " without --overwrite" } else { "" };
            eprintln!("interrupted; the same command{how} continues");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        work::Done::All => Vec::new(),
        work::Done::Failed(names) => names,
    };
    // Some damage shows only to who reads every frame.
    let damaged = rows.iter().filter(|row| row.damaged).map(|row| row.split.case(&row.name));
    failed.extend(damaged.filter(|name| !failed.contains(name)).collect::<Vec<_>>());
    if failed.is_empty() { Ok(ExitCode::SUCCESS) } else { bail!("failed: {}", failed.join(", ")) }
}

/// The cases that `only` names, or all if it is empty.
fn chosen(cases: &[Case], only: &[Choice], scenes: &Path) -> miette::Result<Vec<Case>> {
    if let Some(nothing) = only.iter().find(|choice| !cases.iter().any(|case| choice.has(case))) {
        bail!("{}: no scene {nothing}", scenes.display());
    }
    let is_chosen = |case: &Case| only.is_empty() || only.iter().any(|choice| choice.has(case));
    Ok(cases.iter().filter(|case| is_chosen(case)).cloned().collect())
}

/// Refuses a training set that [`Metadata::of`] would refuse, before it has been made.
fn same_interval(cases: &[Case], scenes: &Path) -> Result<(), DatasetError> {
    let mut train = cases.iter().filter(|case| case.split == Split::Train);
    let Some(first) = train.next() else { return Ok(()) };
    match train.find(|case| case.scene.frame_interval != first.scene.frame_interval) {
        None => Ok(()),
        Some(other) => Err(DatasetError::Intervals {
            path: scenes.to_owned(),
            one: first.name.clone(),
            other: other.name.clone(),
            values: (first.scene.frame_interval, other.scene.frame_interval),
        }),
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

/// The text of a scene of the paper, such as `col5x5`.
pub fn paper_scene(name: &str) -> Option<&'static str> {
    paper::SCENES.iter().find(|scene| scene.1 == name).map(|scene| scene.2)
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
    fn splits_and_scenes_are_chosen_by_name() {
        let (all, paper) = (cases(Path::new("paper")).unwrap(), Path::new("paper"));
        let count = |only: &[&str]| {
            let only: Vec<Choice> = only.iter().map(|choice| choice.parse().unwrap()).collect();
            chosen(&all, &only, paper).map(|cases| cases.len())
        };
        assert_eq!(count(&[]).unwrap(), 39);
        assert_eq!(count(&["test"]).unwrap(), 9);
        // The collapses of Table 7.
        assert_eq!(count(&["test/col*"]).unwrap(), 8);
        assert_eq!(count(&["valid", "test/col2x2"]).unwrap(), 6);
        let unknown = count(&["test/col9*"]).unwrap_err().to_string();
        assert_eq!(unknown, "paper: no scene test/col9*");
        assert!("tests".parse::<Choice>().unwrap_err().contains("train, valid, test"));
    }

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
