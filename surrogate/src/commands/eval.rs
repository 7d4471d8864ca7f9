//! `surrogate eval`: compares predictions with trajectories.

use std::path::{Path, PathBuf};
use std::time::Instant;

use dempm::commands::terminal::{note_unfinished, print_json};
use files::{announce, announces, inform, note, print_result, refuse_input, set_json, write_text};
use miette::bail;
use serde::Serialize;

use super::prediction::PredictionArgs;
use crate::data::trajectories_in;
use crate::diagnostics::Accuracy;
use crate::evaluation::{
    AgainstTruth, Case, Seeds, Summary, against_truth, chart, check_others, compare, frames_table,
    group_by_scene, noise_floor, report, summaries, summary_table, truth_csv, truth_report,
};
use crate::rollout::InitialFrames;
use crate::simulator::Simulator;
use crate::workers::for_all;

/// Arguments of `surrogate eval`.
#[derive(clap::Args)]
pub struct EvalArgs {
    /// Model (safetensors)
    model: PathBuf,
    /// Folder of trajectory files (*.h5) to reproduce
    #[arg(long)]
    data: PathBuf,
    /// Folder for the tables and the chart
    #[arg(short, long, default_value = "eval")]
    output: PathBuf,
    /// Compare at most this many frames of each
    #[arg(long)]
    frames: Option<usize>,
    /// Folder of the same runs with other packings, under the same names: their differences are
    /// the smallest error to expect of a surrogate
    #[arg(long, value_name = "DIR")]
    noise_floor: Option<PathBuf>,
    /// Compare with the mean of several seeds of each scene, beside the distance of one seed from the mean of
    /// the others; runs whose scenes differ in `seed` alone belong together
    #[arg(long, conflicts_with_all = ["frames", "noise_floor", "record"])]
    truth: bool,
    /// Runs of the same scenes by another solver, under the names of their first seeds; with --truth, repeatable
    #[arg(long, value_name = "NAME=DIR", value_parser = named_folder, requires = "truth")]
    beside: Vec<(String, PathBuf)>,
    #[command(flatten)]
    prediction: PredictionArgs,
    /// Write the errors into the model file, for the warnings of rollouts; use data that the model
    /// has not learnt from
    #[arg(long)]
    record: bool,
    /// Print the summary as one JSON object
    #[arg(long)]
    json: bool,
}

/// What was evaluated, and the errors in a few numbers for each trajectory.
#[derive(Serialize)]
struct Report<'a> {
    /// The model.
    model: &'a Path,
    /// The folder of trajectories.
    data: &'a Path,
    /// The folder of the tables.
    output: &'a Path,
    /// A row for each rollout and noise floor, then the means of both.
    rows: Vec<Summary>,
}

/// Distances from the mean of several seeds.
#[derive(Serialize)]
struct TruthReport<'a> {
    /// The model.
    model: &'a Path,
    /// The folder of trajectories.
    data: &'a Path,
    /// The table of all times.
    output: &'a Path,
    /// Names of the other runs.
    others: Vec<String>,
    /// Each scene with several seeds.
    scenes: Vec<AgainstTruth>,
}

/// Evaluates a model.
///
/// # Errors
/// If a file cannot be used, or the results cannot be written.
pub fn eval(args: &EvalArgs, verbose: bool) -> miette::Result<()> {
    set_json(args.json);
    let simulator = args.prediction.load(&args.model, verbose)?;
    let paths = trajectories_in(&args.data)?;
    if args.truth {
        return eval_truth(args, &simulator, &paths);
    }
    let outputs = ["frames.csv", "summary.csv", "errors.svg"].map(|name| args.output.join(name));
    for output in &outputs {
        refuse_input(output, paths.iter().chain([&args.model]))?;
    }
    // Before the rollouts, which take longer.
    paths.iter().try_for_each(|path| check_trajectory(&simulator, path))?;
    let cases: Vec<Case> =
        paths.iter().map(|path| evaluate(args, &simulator, path)).collect::<miette::Result<_>>()?;
    if let Some(folder) = &args.noise_floor
        && cases.iter().all(|case| case.floor.is_none())
    {
        bail!(
            "--noise-floor: {} has no file with the name of one in {}",
            folder.display(),
            args.data.display()
        );
    }
    let [frames, summary, errors] = &outputs;
    write_text(frames, &frames_table(&cases))?;
    write_text(summary, &summary_table(&cases))?;
    write_text(errors, &chart(&cases).svg()?)?;
    if args.json {
        let (model, data, output) = (&*args.model, &*args.data, &*args.output);
        print_json(&Report { model, data, output, rows: summaries(&cases) })?;
    } else if announces() {
        let _ = print_result(report(&cases));
    }
    announce!("written: {}/{{summary.csv, frames.csv, errors.svg}}", args.output.display());
    if args.record { record_accuracy(simulator, &cases, args) } else { Ok(()) }
}

/// Checks that the model can start from a trajectory, and names it if it is not finished.
fn check_trajectory(simulator: &Simulator, path: &Path) -> miette::Result<()> {
    InitialFrames::from_trajectory(path, 0, simulator)?;
    Ok(note_unfinished(path)?)
}

/// A name and a folder, `NAME=DIR`.
fn named_folder(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, folder)) if !name.is_empty() && Path::new(folder).is_dir() => {
            Ok((name.to_owned(), folder.into()))
        }
        Some((_, folder)) => Err(format!("{folder} is not a folder, or has no name before =")),
        None => Err("a name and a folder, such as rve=out/rve/test".to_owned()),
    }
}

/// Compares with the mean of several seeds of each scene.
fn eval_truth(args: &EvalArgs, simulator: &Simulator, paths: &[PathBuf]) -> miette::Result<()> {
    let output = args.output.join("truth.csv");
    refuse_input(&output, paths.iter().chain([&args.model]))?;
    let scenes = group_by_scene(paths)?;
    let others = |seeds: &Seeds| -> Vec<PathBuf> {
        let name = seeds.files[0].file_name().unwrap_or_default();
        args.beside.iter().map(|(_, folder)| folder.join(name)).collect()
    };
    // Before the rollouts, which take longer.
    for seeds in scenes.iter().filter(|seeds| seeds.files.len() > 1) {
        seeds.files.iter().try_for_each(|path| check_trajectory(simulator, path))?;
    }
    scenes.iter().try_for_each(|seeds| check_others(seeds, &others(seeds)))?;
    let compared = for_all(simulator, &scenes, |simulator, seeds| {
        against_truth(simulator, seeds, &others(seeds))
    })?;
    let compared: Vec<Option<AgainstTruth>> = compared.into_iter().collect::<Result<_, _>>()?;
    let single = compared.iter().filter(|scene| scene.is_none()).count();
    let compared: Vec<AgainstTruth> = compared.into_iter().flatten().collect();
    if compared.is_empty() {
        bail!(
            help = "runs of a scene that differ in `seed` alone, such as those of scenes/dataset/discs-test.toml",
            "--truth: no scene in {} has several seeds",
            args.data.display()
        );
    }
    if single > 0 {
        note!("{single} scenes have one seed only, and are left out");
    }
    let names: Vec<String> = args.beside.iter().map(|(name, _)| name.clone()).collect();
    write_text(&output, &truth_csv(&compared, &names))?;
    if args.json {
        let (model, data) = (&*args.model, &*args.data);
        print_json(&TruthReport { model, data, output: &output, others: names, scenes: compared })?;
    } else if announces() {
        let _ = print_result(truth_report(&compared, &names));
    }
    announce!("written: {}", output.display());
    Ok(())
}

/// Compares a rollout, and a run with another packing if there is one, with a trajectory.
fn evaluate(args: &EvalArgs, simulator: &Simulator, path: &Path) -> miette::Result<Case> {
    let began = Instant::now();
    let rollout = compare(simulator, path, args.frames)?;
    if rollout.errors.is_empty() && rollout.failure.is_none() {
        bail!(
            "{}: nothing to compare: the model starts from {} frames",
            args.frames.map_or(path.display().to_string(), |n| format!("--frames {n}")),
            simulator.first_frames()
        );
    }
    let per_frame = began.elapsed().as_secs_f64() / rollout.errors.len().max(1) as f64;
    inform!("{}: {} frames, {per_frame:.3} s each", rollout.case, rollout.errors.len());
    let twin = |folder: &PathBuf| folder.join(path.file_name().unwrap_or_default());
    let floor = match args.noise_floor.as_ref().map(twin).filter(|twin| twin.exists()) {
        Some(twin) => Some(noise_floor(simulator, path, &twin, args.frames)?),
        None => None,
    };
    Ok(Case { path: path.to_owned(), rollout, floor })
}

/// Writes the errors into the model file.
fn record_accuracy(
    mut simulator: Simulator,
    cases: &[Case],
    args: &EvalArgs,
) -> miette::Result<()> {
    let runs = cases.iter().map(|case| (&case.rollout, case.path.as_path() as &Path));
    let Some(accuracy) = Accuracy::of(runs)? else {
        bail!("--record: nothing moves in {}", args.data.display());
    };
    simulator.training.accuracy = Some(accuracy);
    simulator.save(&args.model)?;
    announce!("recorded in {}", args.model.display());
    Ok(())
}
