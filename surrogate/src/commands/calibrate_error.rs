//! `surrogate calibrate-error`: measures how far a network is from the truth, and lets it state its own error.

use std::path::{Path, PathBuf};

use dempm::trajectory::Trajectory;
use files::{announce, note, out};
use miette::{bail, miette};

use super::prediction::PredictionArgs;
use crate::data::trajectories_in;
use crate::diagnostics::{COVERED, ErrorModel, ErrorSample, LEAST_SCENES, PARTS};
use crate::evaluation::{error_sample, group_by_scene};
use crate::rollout::InitialFramesError;
use crate::simulator::Simulator;
use crate::workers::for_all;

/// Arguments of `surrogate calibrate-error`.
#[derive(clap::Args)]
pub struct CalibrateErrorArgs {
    /// Model (safetensors), into which the calibration is written
    model: PathBuf,
    /// Folder of trajectory files (*.h5) that the model has not learnt from
    #[arg(long)]
    data: PathBuf,
    /// Folder of further ones, on which the bound is tested
    #[arg(long, value_name = "DIR")]
    held_out: Option<PathBuf>,
    #[command(flatten)]
    prediction: PredictionArgs,
}

/// Calibrates the error that rollouts of a model state.
///
/// # Errors
/// If a file cannot be used, or there are too few scenes.
pub fn calibrate_error(args: &CalibrateErrorArgs, verbose: bool) -> miette::Result<()> {
    let mut simulator = args.prediction.load(&args.model, verbose)?;
    let samples = samples_of(&simulator, &args.data)?;
    let truth = truth_of(&args.data)?;
    let failed = samples.iter().filter(|sample| sample.errors.len() < PARTS).count();
    let Some(model) = ErrorModel::fit(&samples, &truth) else {
        bail!(
            help = "a bound for nine of ten scenes needs nine scenes, of which hardly any prediction fails",
            "{}: {} scenes, {failed} of them failed; at least {LEAST_SCENES} are needed",
            args.data.display(),
            samples.len()
        );
    };
    table(&model, &samples)?;
    let held_out = args.held_out.as_deref().map(|folder| samples_of(&simulator, folder));
    if let Some(samples) = held_out.transpose()? {
        let [end, all] = model.coverage(&samples);
        out!(
            "{} held-out scenes: {:.0} % below the bound for {:.0} % at the end, {:.0} % over time",
            samples.len(),
            100.0 * end,
            100.0 * COVERED,
            100.0 * all
        )?;
        table(&model, &samples)?;
    }
    simulator.training.error = Some(model);
    simulator.save(&args.model)?;
    announce!("written: {}", args.model.display());
    Ok(())
}

/// A rollout of each scene in a folder, of its first seed if there are several.
fn samples_of(simulator: &Simulator, folder: &Path) -> miette::Result<Vec<ErrorSample>> {
    let scenes = group_by_scene(&trajectories_in(folder)?)?;
    let paths: Vec<&PathBuf> = scenes.iter().map(|scene| &scene.files[0]).collect();
    let samples = for_all(simulator, &paths, |simulator, path| error_sample(simulator, path))?;
    let samples: Vec<ErrorSample> =
        samples.into_iter().collect::<Result<_, InitialFramesError>>()?;
    for sample in samples.iter().filter(|sample| sample.errors.len() < PARTS) {
        note!("{}: the prediction fails or the trajectory ends", sample.scene);
    }
    Ok(samples)
}

/// The model of the runs in a folder, as in scenes.
fn truth_of(folder: &Path) -> miette::Result<String> {
    let mut found: Option<String> = None;
    for path in trajectories_in(folder)? {
        let material = Trajectory::open(&path)?.header().material.clone();
        match &found {
            Some(other) if *other != material => bail!(
                help = "errors are distances from runs of one model",
                "{}: a run of `{material}`, others are of `{other}`",
                path.display()
            ),
            _ => found = Some(material),
        }
    }
    found.ok_or_else(|| miette!("{}: no trajectories", folder.display()))
}

/// True and stated errors at the end of each scene.
fn table(model: &ErrorModel, samples: &[ErrorSample]) -> miette::Result<()> {
    out!("{:<28}{:>10}{:>10}{:>10}", "at the end, in m", "error", "expected", "bound")?;
    for sample in samples {
        if let (Some(error), Some(features)) =
            (sample.errors.get(PARTS - 1), sample.features.last())
        {
            let expected = model.expected(1.0, features);
            let (scene, median, bound) = (&sample.scene, expected.median, expected.bound);
            out!("{scene:<28}{error:>10.4}{median:>10.4}{bound:>10.4}")?;
        }
    }
    Ok(())
}
