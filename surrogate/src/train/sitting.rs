//! A training from its start or a checkpoint to its end or an interrupt.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use miette::bail;

use super::checkpoint::{Checkpoint, Identity};
use super::config::TrainConfig;
use super::log::Log;
use super::place::{Engine, EngineBatch};
use super::{TrainArgs, progress};
use crate::backend::device;
use crate::config::ModelConfig;
use crate::data::{DataFolder, DataSet, Prefetch, Recipe, Shape, Statistics};
use crate::eval::errors;
use crate::simulator::{Simulator, Training};

/// Exit code after Ctrl-C, as shells use it.
const INTERRUPTED: u8 = 130;

/// The checkpoint of a training in `folder`.
pub fn checkpoint_in(folder: &Path) -> PathBuf {
    folder.join("checkpoint.bin")
}

/// A training under way.
pub struct Sitting {
    config: TrainConfig,
    model: ModelConfig,
    identity: Identity,
    frame_interval: f64,
    engine: Engine,
    batches: Prefetch<EngineBatch>,
    log: Log,
    best: Option<f64>,
    valid: Vec<PathBuf>,
    folder: PathBuf,
    bar: ProgressBar,
}

impl Sitting {
    /// Opens the data and prepares everything.
    pub fn start(args: &TrainArgs, config: TrainConfig) -> miette::Result<Self> {
        let (data, folder) = (&args.data, &args.output);
        let model = config.model();
        let files = DataFolder::open(data)?;
        let shape = Shape { frames: model.frames, stride: config.data.stride };
        let data = DataSet::open(&files.train, shape, config.data.memory << 20)?;
        let frame_interval = data.frame_interval();

        let mut statistics = Statistics::measure(&data, config.data.subtract_gravity)?;
        if config.data.mirror {
            statistics = statistics.mirrored();
        }
        let identity = Identity {
            config: config.identity(),
            files: data
                .recordings()
                .iter()
                .map(|r| {
                    let name = r.path().file_name().unwrap_or_default().to_string_lossy();
                    (name.into_owned(), r.points() as u64, r.frames() as u64)
                })
                .collect(),
            normalisation: statistics.normalisation(config.data.noise),
        };

        let mut engine = Engine::new(args.device, args.precision, &model, config.seed, config.ema)?;
        let (mut log, mut best) = (Log::default(), None);
        if args.resume {
            let path = checkpoint_in(folder);
            let checkpoint = Checkpoint::read(&path, &identity)?;
            (log, best) = (checkpoint.log, checkpoint.best);
            if !engine.resume(checkpoint.state)? {
                bail!("{}: the checkpoint is that of another network", path.display());
            }
        }
        let recipe = Recipe {
            seed: config.seed,
            batch: config.batch,
            noise: config.data.noise,
            mirror: config.data.mirror,
            without_gravity: config.data.subtract_gravity,
            normalisation: identity.normalisation.clone(),
        };
        eprintln!(
            "{} parameters; {} windows of {} files to learn from, {} files to validate",
            model.parameter_count(),
            data.len(),
            files.train.len(),
            files.valid.len()
        );
        let bounds = data.bounds();
        let prepare =
            engine.preparation(model.clone(), identity.normalisation.clone(), bounds.to_vec());
        let step = engine.step_number();
        let batches = Prefetch::start(data, recipe, step, prepare);
        let bar = progress::bar(config.steps, step);
        Ok(Self {
            config,
            model,
            identity,
            frame_interval,
            engine,
            batches,
            log,
            best,
            valid: files.valid,
            folder: folder.to_owned(),
            bar,
        })
    }

    /// Trains to the end or until `interrupted`.
    pub fn advance(
        &mut self,
        interrupted: &AtomicBool,
        interval: Duration,
    ) -> miette::Result<ExitCode> {
        let steps = self.config.steps;
        let began = (Instant::now(), self.engine.step_number());
        let mut saved = Instant::now();
        while self.engine.step_number() < steps {
            if interrupted.load(Ordering::Relaxed) {
                self.save()?;
                self.bar.finish_and_clear();
                eprintln!(
                    "interrupted at step {} of {steps}; --resume continues",
                    self.engine.step_number()
                );
                return Ok(ExitCode::from(INTERRUPTED));
            }
            self.step()?;
            if saved.elapsed() >= interval {
                self.save()?;
                saved = Instant::now();
            }
        }
        self.save()?;
        self.bar.finish_and_clear();
        let made = steps - began.1.min(steps);
        let seconds = began.0.elapsed().as_secs_f64();
        println!("{steps} steps, {made} of them now in {seconds:.1} s");
        if let Some(loss) = self.log.losses().last() {
            println!("loss {loss:.3e}");
        }
        match self.best {
            Some(best) => println!("best validation MSE {best:.3e} [box²]: best.safetensors"),
            None if self.valid.is_empty() => {
                println!("no valid/ beside train/, so no best.safetensors: last.safetensors");
            }
            None => println!("no validation rollout came to its end: last.safetensors"),
        }
        println!("written: {}", self.folder.display());
        Ok(ExitCode::SUCCESS)
    }

    fn step(&mut self) -> miette::Result<()> {
        let Some(batch) = self.batches.next()? else {
            bail!("the thread that prepares the data has died");
        };
        let steps = self.config.steps;
        let rate = self.config.schedule.at(self.engine.step_number(), steps);
        self.engine.step(batch, rate)?;
        let step = self.engine.step_number();
        self.bar.set_position(step);
        if step.is_multiple_of(self.config.log_every) || step == steps {
            self.read_losses()?;
            let loss = self.log.row(step, rate);
            self.bar.set_message(match self.best {
                Some(best) => format!("loss {loss:.3e}  best MSE {best:.2e}"),
                None => format!("loss {loss:.3e}"),
            });
        }
        let due = step.is_multiple_of(self.config.validation.every) || step == steps;
        if due && !self.valid.is_empty() {
            self.validate()?;
        }
        Ok(())
    }

    fn read_losses(&mut self) -> miette::Result<()> {
        let losses = self.engine.take_losses()?;
        if let Some(place) = losses.iter().position(|loss| !loss.is_finite()) {
            let step = self.engine.step_number() - (losses.len() - place) as u64 + 1;
            bail!(
                help = "a lower schedule.rate or a schedule.warm_up may help",
                "the loss of step {step} is not finite; the last checkpoint is from before"
            );
        }
        self.log.add(&losses);
        Ok(())
    }

    /// Rolls out all validation files and keeps the model if it is the best so far.
    fn validate(&mut self) -> miette::Result<()> {
        let simulator = self.simulator()?;
        let frames = Some(self.config.validation.frames).filter(|&frames| frames > 0);
        let mut sum = 0.0;
        for path in &self.valid {
            sum += errors(&simulator, path, frames)?.mean();
        }
        let mse = sum / self.valid.len() as f64;
        self.log.validation(self.engine.step_number(), mse);
        if mse < self.best.unwrap_or(f64::INFINITY) {
            self.best = Some(mse);
            simulator.save(&self.folder.join("best.safetensors"))?;
        }
        Ok(())
    }

    /// The models first, then the checkpoint: what comes after it will be made again.
    fn save(&mut self) -> miette::Result<()> {
        self.read_losses()?;
        self.simulator()?.save(&self.folder.join("last.safetensors"))?;
        self.log.write(&self.folder)?;
        let (identity, state) = (self.identity.clone(), self.engine.state()?);
        let checkpoint = Checkpoint::new(identity, state, self.log.clone(), self.best);
        checkpoint.write(&checkpoint_in(&self.folder))?;
        Ok(())
    }

    fn simulator(&self) -> miette::Result<Simulator> {
        Ok(Simulator {
            model: self.engine.model()?,
            config: self.model.clone(),
            normalisation: self.identity.normalisation.clone(),
            training: Training {
                frame_interval: self.frame_interval,
                without_gravity: self.config.data.subtract_gravity,
                steps: self.engine.step_number(),
            },
            device: device(),
        })
    }
}
