//! `surrogate train`: trains a network on trajectories.

use std::path::PathBuf;
use std::process::ExitCode;

use dempm::device::Device;
use dempm::run::checkpoint_interval;
use files::{INTERRUPTED, Interrupt, announce, inform, note};

use super::progress::Progress;
use crate::train::{
    Outcome, Report, Session, SessionOptions, Summary, TrainConfig, TrainObserver, WARM_UP_STEPS,
    check_new, checkpoint_in,
};

/// Arguments of `surrogate train`.
#[derive(clap::Args)]
pub struct TrainArgs {
    /// Training file (TOML)
    config: PathBuf,
    /// Folder of trajectory files (*.h5), or with train/ and valid/
    #[arg(long)]
    data: PathBuf,
    /// Folder for models, log and checkpoint
    #[arg(short, long)]
    output: PathBuf,
    /// Continue an interrupted training, begin one that is not there, and leave a finished one; the result is the same
    /// to the bit as that of an uninterrupted one
    #[arg(long)]
    resume: bool,
    /// Replace a training that is in the folder already
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Smallest time between checkpoints
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    checkpoint_interval: f64,
    /// Where to compute: auto (a GPU if there is one), cpu, cuda or cuda:N
    #[arg(long, default_value = "auto")]
    device: Device,
}

/// Trains a network.
///
/// # Errors
/// If the configuration or the data cannot be used, the training diverges, or a file cannot be
/// written.
pub fn train(args: &TrainArgs) -> miette::Result<ExitCode> {
    let interrupt = Interrupt::install()?;
    let config = TrainConfig::load(&args.config)?;
    let interval = checkpoint_interval(args.checkpoint_interval)?;
    // What has not begun, or was killed before its first checkpoint, begins.
    let resume = args.resume && checkpoint_in(&args.output).exists();
    if !resume {
        check_new(&args.output, args.overwrite, &config, &args.config)?;
    }
    let steps = config.steps;
    let options = SessionOptions {
        config_file: args.config.clone(),
        data: args.data.clone(),
        folder: args.output.clone(),
        resume,
        device: args.device,
    };
    let mut session = Session::open(config, &options, |ranks| note!("waiting for {ranks}"))?;
    let (summary, is_leader) = (session.summary().clone(), session.is_leader());
    if is_leader {
        print_summary(&summary);
    }
    let _lock = session.take_folder(resume)?;
    // Other ranks would repeat what the first reports.
    let progress = is_leader.then(|| Progress::of_training(steps, summary.step));
    // From here on there is something to save.
    let _guard = interrupt.guard();
    let outcome = session.run(interrupt.flag(), interval, &mut Observer(progress.as_ref()))?;
    if let Some(progress) = progress {
        progress.finish();
    }
    match outcome {
        Outcome::Interrupted(step) => {
            if is_leader {
                note!("interrupted at step {step} of {steps}; --resume continues");
            }
            Ok(ExitCode::from(INTERRUPTED))
        }
        Outcome::Finished(Report { made: 0, .. }) => {
            if is_leader {
                announce!("{}: finished already", args.output.display());
            }
            Ok(ExitCode::SUCCESS)
        }
        Outcome::Finished(report) => {
            if is_leader {
                print(&report, steps, &summary);
                announce!("written: {}", args.output.display());
            }
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Shows the progress of a training.
struct Observer<'a>(Option<&'a Progress>);

impl TrainObserver for Observer<'_> {
    fn step(&mut self, step: u64) {
        if let Some(progress) = self.0 {
            progress.set(step);
        }
    }

    fn logged(&mut self, loss: f64, best: Option<f64>) {
        if let Some(progress) = self.0 {
            progress.set_message(match best {
                Some(best) => format!("loss {loss:.3e}  best MSE {best:.2e}"),
                None => format!("loss {loss:.3e}"),
            });
        }
    }
}

fn print_summary(summary: &Summary) {
    let Summary { ranks, parameters, windows, train_files, valid_files, .. } = summary;
    if let Some(gpu) = &summary.gpu {
        let count = if *ranks > 1 { format!("{ranks} x ") } else { String::new() };
        inform!("training on {count}{gpu}");
    }
    inform!(
        "{parameters} parameters; {windows} windows in {train_files} training files, {valid_files} \
         validation files"
    );
    if let Some(own) = summary.stretched_from {
        inform!(
            "start weights predict frames {own} s apart, the data have {} s: normalisation stretched",
            summary.frame_interval
        );
    }
}

fn print(report: &Report, steps: u64, summary: &Summary) {
    let Report { made, seconds, seconds_per_step, loss, best } = report;
    announce!("{steps} steps, {made} of them now in {seconds:.1} s");
    if let Some(seconds) = seconds_per_step {
        announce!("{:.3} ms per step after the first {WARM_UP_STEPS}", 1e3 * seconds);
    }
    if let Some(loss) = loss {
        announce!("loss {loss:.3e}");
    }
    match best {
        Some(best) => announce!("best validation MSE {best:.3e} [box²]: best.safetensors"),
        None if summary.valid_files == 0 => {
            announce!("no valid/ in the data, so no best.safetensors: use last.safetensors");
        }
        None => announce!("every validation rollout failed: use last.safetensors"),
    }
}
