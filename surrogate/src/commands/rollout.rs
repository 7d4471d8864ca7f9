//! `surrogate rollout`: predicts a trajectory.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use dempm::scene::Scene;
use files::{FileLock, INTERRUPTED, Interrupt, announce, note, refuse_input};
use miette::{Report, bail};

use super::prediction::PredictionArgs;
use super::progress::Progress;
use super::rollout_many::{Many, rollout_many};
use crate::diagnostics::{ExpectedError, start_checks};
use crate::rollout::{InitialFrames, RecordingOptions, RolloutObserver, record};
use crate::simulator::Simulator;

/// Arguments of `surrogate rollout`.
#[derive(clap::Args)]
pub struct RolloutArgs {
    /// Model (safetensors)
    model: PathBuf,
    /// Scene file (TOML), whose first frames are simulated
    #[arg(long, required_unless_present_any = ["from", "scenes"])]
    scene: Option<PathBuf>,
    /// Many scenes: a list as of `dempm dataset`, whose first frames are simulated, or a folder of
    /// trajectories, whose first frames are read; the output is then a folder
    #[arg(long, value_name = "LIST", conflicts_with_all = ["scene", "from"])]
    scenes: Option<PathBuf>,
    /// Trajectory file (HDF5), whose first frames are read
    #[arg(long, conflicts_with = "scene")]
    from: Option<PathBuf>,
    /// First frame to read from the trajectory
    #[arg(long, value_name = "FRAME", default_value_t = 0, requires = "from")]
    start: usize,
    /// Frames of the result, the initial ones included [default: as many as scene or trajectory have]
    #[arg(long)]
    frames: Option<usize>,
    #[command(flatten)]
    prediction: PredictionArgs,
    /// Trajectory file to write (HDF5); with --scenes a folder
    #[arg(short, long)]
    output: PathBuf,
    /// Replace the output if it exists
    #[arg(long)]
    overwrite: bool,
}

/// Rolls a model out into a trajectory file.
///
/// # Errors
/// If a file cannot be used or written, or the prediction fails; the output then holds the frames
/// before.
pub fn rollout(args: &RolloutArgs, verbose: bool) -> miette::Result<ExitCode> {
    let interrupt = Interrupt::install()?;
    if let Some(list) = &args.scenes {
        return many(args, list, &interrupt, verbose);
    }
    if args.output.exists() && !args.overwrite {
        bail!(help = "--overwrite replaces it", "{}: is there already", args.output.display());
    }
    let inputs = [Some(&args.model), args.scene.as_ref(), args.from.as_ref()];
    refuse_input(&args.output, inputs.into_iter().flatten())?;
    let _lock = FileLock::take(&args.output)?;
    let simulator = args.prediction.load(&args.model, verbose)?;
    let began = Instant::now();
    let initial = initial_frames(args, &simulator)?;
    let frames = args.frames.unwrap_or(initial.frames);
    if frames < initial.positions.len() {
        bail!("--frames {frames}: the model starts from {} frames", initial.positions.len());
    }
    if let Some(warning) = start_checks(&simulator, &initial) {
        note!("{warning}");
    }

    let output = args.output.display();
    let options = RecordingOptions { model: &args.model, output: &args.output, frames, began };
    let progress = Progress::of_rollout(frames as u64);
    // From here on there is something to save.
    let _guard = interrupt.guard();
    let recorded =
        record(&simulator, &initial, &options, interrupt.flag(), &mut Observer(&progress))?;
    progress.finish();
    let made = recorded.frames;
    if let Some(error) = recorded.failure {
        return Err(Report::new(error).wrap_err(format!("{output} holds the {made} frames before")));
    }
    if made < frames {
        note!("interrupted; {output} holds {made} of {frames} frames");
        return Ok(ExitCode::from(INTERRUPTED));
    }
    note!("{}", expected_error(&simulator, made, recorded.expected));
    let (predicted, seconds) = (made - initial.positions.len(), recorded.seconds);
    announce!("{output}: {made} frames, {predicted} of them predicted in {seconds:.2} s");
    Ok(ExitCode::SUCCESS)
}

/// Predicts all scenes of a list.
fn many(
    args: &RolloutArgs,
    list: &Path,
    interrupt: &Interrupt,
    verbose: bool,
) -> miette::Result<ExitCode> {
    let simulator = args.prediction.load(&args.model, verbose)?;
    let (model, output) = (&args.model, &args.output);
    let many = Many { model, list, output, frames: args.frames, overwrite: args.overwrite };
    let _guard = interrupt.guard();
    let done = rollout_many(&many, &simulator, interrupt);
    if interrupt.requested() {
        note!("interrupted");
        return Ok(ExitCode::from(INTERRUPTED));
    }
    done.map(|()| ExitCode::SUCCESS)
}

/// The error to expect in the last of so many frames, in words.
fn expected_error(simulator: &Simulator, frames: usize, error: Option<ExpectedError>) -> String {
    let training = &simulator.training;
    match (error, &training.accuracy) {
        (Some(ExpectedError { median, bound }), _) => {
            let time = (frames - 1) as f64 * training.frame_interval;
            format!(
                "expected error after {time:.2} s: {median:.2} m (RMS over the points), below {bound:.2} m in \
                 nine of ten scenes"
            )
        }
        (None, Some(accuracy)) => format!("expected error: {}", accuracy.statement()),
        (None, None) => {
            "expected error: unknown; `surrogate calibrate-error` measures it".to_owned()
        }
    }
}

/// The initial frames of the scene or trajectory.
fn initial_frames(args: &RolloutArgs, simulator: &Simulator) -> miette::Result<InitialFrames> {
    match (&args.scene, &args.from) {
        (Some(path), _) => {
            let scene = Scene::load(path)?;
            let (own, asked) = (simulator.training.frame_interval, scene.frame_interval);
            if !simulator.training.is_interval(asked) {
                note!("frames are {own} s apart, as in training, not {asked} s as in the scene");
            }
            let initial = InitialFrames::of_scene(&scene, simulator)?;
            if initial.scene.material.name() != scene.material.name() {
                let millimetres = 1e3 * initial.scene.domain.spacing();
                note!(
                    "starts from discs, as in training, averaged over squares of {millimetres} mm"
                );
            }
            Ok(initial)
        }
        (None, Some(from)) => Ok(InitialFrames::from_trajectory(from, args.start, simulator)?),
        (None, None) => bail!("give a scene (--scene) or a trajectory (--from) to start from"),
    }
}

/// Shows the progress of a rollout, and its warnings above.
struct Observer<'a>(&'a Progress);

impl RolloutObserver for Observer<'_> {
    fn recorded(&mut self, frames: usize) {
        self.0.set(frames as u64);
    }

    fn warning(&mut self, text: &str) {
        self.0.warn(text);
    }
}
