//! `dempm dataset`: runs many scenes into a data set.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::OnceLock;

use files::{
    INTERRUPTED, Interrupt, announce, announces, duration, inform, note, out, print_result,
    refuse_input,
};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Report, bail, miette};

use super::choose::Chooser;
use super::device::report as report_device;
use super::learned::{Network, Predicted};
use super::progress::{SceneProgress, Total, bars};
use crate::choose::{Family, Within};
use crate::dataset::scheduler::{self, Done};
use crate::dataset::{self, Case, DatasetError, Estimate, Metadata, Selection, Split, report};
use crate::device::Device;
use crate::run::{self, Outcome, SessionError, checkpoint_interval};

/// Scenes at a time on a GPU: measured in docs/notes/2026-11-22-rve-kernel.md.
const JOBS_ON_A_GPU: usize = 4;

/// Arguments of `dempm dataset`.
#[derive(clap::Args)]
pub struct DatasetArgs {
    /// `paper` for the 39 scenes of Zhao, Chen & Zhao (2025), or a list of scenes (TOML).
    scenes: PathBuf,
    /// Folder of the data set.
    #[arg(short, long, required_unless_present = "list")]
    output: Option<PathBuf>,
    /// Print the scenes and what they cost, and run nothing.
    #[arg(long)]
    list: bool,
    /// Only this split or these scenes of it: test, test/col2x2, test/col* (may be repeated).
    #[arg(long, value_name = "SPLIT[/NAME]")]
    only: Vec<Selection>,
    /// Compute each scene with the cheapest model that stays so near to its grains computed one by one: metres (root mean
    /// square), or 5% of the run-out.
    #[arg(long, value_name = "DISTANCE")]
    within: Option<Within>,
    /// A network (safetensors) that is a candidate too, with the error that it expects of itself.
    #[arg(long, value_name = "MODEL", requires = "within")]
    learned: Option<PathBuf>,
    /// Device to run on: auto (every visible GPU, else the CPU), cpu, cuda (every GPU) or cuda:N.
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Scenes at a time on each device [default: 4 on a GPU, 1 on the CPU].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,
    /// Make what is missing: continue interrupted runs, begin others, keep those that are finished.
    #[arg(long)]
    resume: bool,
    /// Start again scenes whose trajectories exist.
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Least time between checkpoints, which never take more than 2 % of the time; 0: every frame.
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    checkpoint_interval: f64,
}

/// Makes a data set. To resume one, complete trajectories stay and interrupted runs continue.
///
/// # Errors
/// If the list or a scene is wrong, trajectories exist that are neither to be resumed nor overwritten, a device cannot
/// be used, or scenes failed (after all others are finished).
pub fn dataset(args: &DatasetArgs, verbose: bool) -> miette::Result<ExitCode> {
    let interrupt = Interrupt::install()?;
    let mut all = dataset::cases(&args.scenes)?;
    let network = args.learned.as_deref().map(|model| Network::new(model, args.device));
    let network = network.transpose()?;
    let predicted = match args.within {
        Some(within) => choose_models(&mut all, within, network.as_ref(), args)?,
        None => HashSet::new(),
    };
    dataset::check_intervals(&all, &args.scenes)?;
    let selected = dataset::select(&all, &args.only, &args.scenes)?;
    let Some(folder) = args.output.as_deref().filter(|_| !args.list) else {
        let jobs = args.jobs.map_or(JOBS_ON_A_GPU, usize::from);
        return list(&selected, jobs).map(|()| ExitCode::SUCCESS);
    };
    let tables = ["scenes.csv", "metadata.json"].map(|name| folder.join(name));
    for output in tables.into_iter().chain(selected.iter().map(|case| case.file(folder))) {
        refuse_input(&output, [&args.scenes])?;
    }
    if !args.resume && !args.overwrite {
        dataset::refuse_existing(&selected, folder)?;
    }
    let selection = args.device.select_all().into_diagnostic()?;
    report_device(&selection, verbose);
    let usual = if selection.gpus.is_empty() { 1 } else { JOBS_ON_A_GPU };
    let options = scheduler::Options {
        jobs: args.jobs.map_or(usual, usize::from),
        devices: selection.gpus,
        overwrite: args.overwrite,
        checkpoint_interval: checkpoint_interval(args.checkpoint_interval)?,
    };
    let progress = Progress::new();
    let (predicted, simulated): (Vec<Case>, Vec<Case>) =
        selected.into_iter().partition(|case| predicted.contains(&case.full_name()));
    let mut done = vec![scheduler::run(&simulated, folder, &options, &progress, &interrupt)?];
    done.extend(network.map(|network| predict(&network, &predicted, folder, args, &interrupt)));
    // What is done by now is reported even after an interrupt.
    let _guard = interrupt.guard();

    let rows = report::rows(&all, folder);
    if announces() {
        let _ = print_result(report::table(&rows));
    }
    report::write_csv(&rows, &folder.join("scenes.csv"))?;
    let trained = |row: &report::Row| row.split != Split::Train || row.is_finished();
    if rows.iter().all(trained) && rows.iter().any(|row| row.split == Split::Train) {
        let finished = dataset::finished(&all, &rows, folder);
        Metadata::of(&finished)?.write(folder)?;
        announce!("{}", folder.join("metadata.json").display());
    } else {
        announce!("no metadata.json yet: the training set is not complete");
    }
    let mut failed = Vec::new();
    for done in done {
        match done {
            Done::Interrupted => {
                note!("interrupted; --resume continues");
                return Ok(ExitCode::from(INTERRUPTED));
            }
            Done::All => {}
            Done::Failed(names) => failed.extend(names),
        }
    }
    // Some damage shows only when every frame is read.
    let damaged = rows.iter().filter(|row| row.damaged).map(|row| row.split.case(&row.name));
    failed.extend(damaged.filter(|name| !failed.contains(name)).collect::<Vec<_>>());
    if failed.is_empty() { Ok(ExitCode::SUCCESS) } else { bail!("failed: {}", failed.join(", ")) }
}

/// Replaces the model of each case by the one that is chosen; a run that is continued keeps its model. Returns the names
/// of those that the network predicts.
fn choose_models(
    cases: &mut [Case],
    within: Within,
    network: Option<&Network>,
    args: &DatasetArgs,
) -> miette::Result<HashSet<String>> {
    let chooser = Chooser::new(args.device.open().into_diagnostic()?.is_some())?;
    let mut predicted = HashSet::new();
    for case in cases {
        let learned = network.map(|network| network.expect(&case.scene)).transpose()?;
        let learned = learned.map(|learned| learned.with_frames(case.scene.frame_interval));
        let mut choice = chooser.choice(&case.scene, within, learned.as_ref())?;
        if let Some(folder) = args.output.as_deref().filter(|_| args.resume) {
            choice = choice.continued(&case.file(folder));
        }
        inform!("{}: {}", case.full_name(), choice.verdict());
        case.scene = choice.chosen_scene().map_err(|why| miette!("{}: {why}", case.full_name()))?;
        if choice.taken().family == Family::Learned {
            predicted.insert(case.full_name());
        }
    }
    Ok(predicted)
}

/// Predicts cases one after the other.
fn predict(
    network: &Network,
    cases: &[Case],
    folder: &Path,
    args: &DatasetArgs,
    interrupt: &Interrupt,
) -> Done {
    let mut failed = Vec::new();
    for case in cases {
        if interrupt.requested() {
            return Done::Interrupted;
        }
        let output = case.file(folder);
        match network.predict(&case.scene, &output, args.resume, args.overwrite) {
            Ok(Predicted::Now | Predicted::Before) => inform!("{} done", case.full_name()),
            Ok(Predicted::Interrupted) => return Done::Interrupted,
            Err(error) => {
                note!("{} failed: {error:?}", case.full_name());
                failed.push(case.full_name());
            }
        }
    }
    if failed.is_empty() { Done::All } else { Done::Failed(failed) }
}

/// Prints the scenes and what they cost.
fn list(cases: &[Case], jobs: usize) -> miette::Result<()> {
    print_result(report::list(cases))?;
    let of = |split: Split| {
        let count = cases.iter().filter(|case| case.split == split).count();
        (count > 0).then(|| format!("{count} {}", split.name()))
    };
    let counts: Vec<String> = Split::ALL.into_iter().filter_map(of).collect();
    out!("\n{} runs: {}", cases.len(), counts.join(", "))?;
    let refused: u32 = cases.iter().map(|case| case.refused).sum();
    if refused > 0 {
        out!("{refused} invalid draws were replaced")?;
    }
    let estimate = Estimate::of(cases, jobs);
    if estimate.disc_steps > 0.0 {
        out!(
            "{:.1e} disc-steps, less where grains come to rest: up to some {} on one H200, {jobs} scenes at a \
             time",
            estimate.disc_steps,
            duration(estimate.gpu_seconds)
        )?;
    }
    Ok(())
}

/// Progress of the scenes being run, and of all together.
struct Progress {
    bars: MultiProgress,
    total: OnceLock<Total>,
}

impl Progress {
    fn new() -> Self {
        Self { bars: bars(), total: OnceLock::new() }
    }

    fn print(&self, line: &str) {
        self.bars.suspend(|| note!("{line}"));
    }
}

impl scheduler::Observer for Progress {
    fn begin(&self, open: &[&Case], all: usize, damaged: usize) {
        let complete = all - open.len() - damaged;
        if complete > 0 {
            inform!("{complete} of {all} scenes are complete");
        }
        let style = "{prefix:<20} {bar:24} {percent:>3} %  {eta} left";
        let bar = ProgressBar::new(open.iter().map(|case| case.work()).sum());
        bar.set_style(ProgressStyle::with_template(style).expect("the template is valid"));
        bar.set_prefix(format!("{} scenes", open.len()));
        let bar = self.bars.add(bar);
        self.total.get_or_init(|| Total::new(bar, open.len()));
    }

    fn session(&self) -> Box<dyn run::Observer> {
        Box::new(SceneProgress::new(self.bars.clone(), self.total.get().cloned()))
    }

    fn damaged(&self, error: DatasetError) {
        note!("{:?}", Report::new(error));
    }

    fn ended(&self, case: &Case, outcome: Result<Outcome, SessionError>) {
        if let Some(total) = self.total.get() {
            total.scene_ended();
        }
        let name = case.full_name();
        match outcome {
            Ok(Outcome::Finished { .. } | Outcome::WasFinished) => {
                self.bars.suspend(|| inform!("{name} done"));
            }
            Ok(Outcome::Interrupted { step, steps }) => {
                self.print(&format!("{name} interrupted at step {step} of {steps}"));
            }
            Err(error) => self.print(&format!("{name} failed: {:?}", Report::new(error))),
        }
    }

    fn finish(&self) {
        if let Some(total) = self.total.get() {
            total.bar.finish_and_clear();
        }
    }
}
