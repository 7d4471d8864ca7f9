//! A training from its start or a checkpoint to its end or an interrupt.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use files::{FileLock, INTERRUPTED};
use gpu::ranks::Environment;
use indicatif::ProgressBar;
use miette::{IntoDiagnostic, bail};

use super::checkpoint::{Checkpoint, Identity};
use super::config::{Precision, TrainConfig};
use super::engine::{Preparation, State};
use super::folder::{checkpoint_in, claim, clear};
use super::given::Given;
use super::log::Log;
use super::place::{Engine, EngineBatch, open};
use super::ranks::{self, AllReduce};
use super::{TrainArgs, progress, weights};
use crate::backend::Cpu;
use crate::data::{DataFolder, DataSet, Draft, Prefetch, Recipe, Shape, Shard};
use crate::eval::errors;
use crate::model::Model;
use crate::range::Range;
use crate::simulator::{Simulator, Training};
use crate::start::Start;

/// Steps after which GPUs agree on whether to stop, since they wait for one another then.
const AGREE_EVERY: u64 = 16;

/// Steps during which kernels are compiled and room is made, so that they say nothing of the others.
const FIRST: u64 = 50;

/// What the next step learns from.
enum Work {
    Batch(Box<EngineBatch>),
    /// Windows that the network has to move on first, as it is by then, on the processor.
    Draft(Draft),
}

/// A training under way.
pub struct Sitting {
    config: TrainConfig,
    identity: Identity,
    frame_interval: f64,
    /// What the training data hold, those of the model that it started from included.
    range: Option<Range>,
    /// Steps that this model had made.
    steps_before: u64,
    engine: Engine,
    ranks: Box<dyn AllReduce>,
    recipe: Recipe,
    preparation: Preparation,
    batches: Prefetch<Work>,
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
        let environment = Environment::read().into_diagnostic()?;
        let Environment { rank, size, .. } = environment;
        let model = config.model();
        let files = DataFolder::open(data)?;
        let frames = model.window() + config.pushforward.steps;
        let (stride, before) = (config.data.stride, config.data.before_start);
        let shape = Shape { frames, stride, before };
        let data = DataSet::open(&files.train, shape, config.data.memory << 20)?
            .with_statics(&model.node_features)?
            .with_obstacles(model.obstacles)?;
        let frame_interval = data.frame_interval();
        let mut range = Range::of(&data, model.connection_radius)?;
        let given = Given::load(&config)?;
        let hash = given.as_ref().map(|given| given.hash);
        let identity = Identity::of(&config, &data, size, hash)?;
        let (mut normalisation, mut steps_before) = (identity.normalisation.clone(), 0);
        if let Some(given) = &given {
            given.check(&config, frame_interval)?;
            normalisation = given.normalisation();
            range = given.range(range);
            steps_before = given.simulator.training.steps;
        }

        let device = open(args.device, &environment)?;
        if device.is_none() && config.precision == Precision::Bf16 {
            bail!(
                help = "leave it out, or say \"f32\"",
                "{}: `precision` is \"bf16\", which only tensor cores of a GPU have; this training \
                 computes on the CPU",
                args.config.display()
            );
        }
        let (mut log, mut best, mut state) = (Log::default(), None, None);
        if args.resume {
            let checkpoint = Checkpoint::read(&checkpoint_in(folder), &identity)?;
            (log, best, state) = (checkpoint.log, checkpoint.best, Some(checkpoint.state));
        }
        if let (None, Some(given)) = (&state, &given) {
            state = Some(State::new(weights(&given.simulator.model), config.ema > 0.0));
        }
        let step = state.as_ref().map_or(0, |state| state.step);
        let fingerprint = identity.fingerprint(step, device.is_some());
        let (ranks, gpus) = ranks::join(environment, device.as_ref(), &fingerprint)?;
        if let Some(device) = device.as_ref().filter(|_| rank == 0) {
            let count = if size > 1 { format!("{size} x ") } else { String::new() };
            eprintln!("on {count}{}", device.name());
        }
        let largest = data.recordings().iter().map(|file| file.points()).max().unwrap_or(0);
        let points = config.batch * largest;
        let mut engine = Engine::new(device.as_ref(), gpus, &model, &config, points)?;
        if let Some(state) = state
            && !engine.resume(state)?
        {
            let path = checkpoint_in(folder);
            bail!("{}: the checkpoint is that of another network", path.display());
        }
        let recipe = Recipe {
            seed: config.seed,
            batch: config.batch,
            shard: Shard { rank, ranks: size },
            alike: config.data.alike,
            frames: model.window(),
            unroll: config.pushforward.steps,
            unroll_from: config.pushforward.start,
            noise: config.data.noise,
            mirror: config.data.mirror,
            without_gravity: config.data.subtract_gravity,
            normalisation: normalisation.clone(),
        };
        let preparation = Preparation { config: model, normalisation, bounds: data.bounds() };
        if rank == 0 {
            eprintln!(
                "{} parameters; {} windows of {} files to learn from, {} files to validate",
                preparation.config.parameter_count(),
                data.len(),
                files.train.len(),
                files.valid.len()
            );
        }
        let bar = if rank == 0 { progress::bar(config.steps, step) } else { ProgressBar::hidden() };
        let (ahead, prepare) = (recipe.clone(), engine.prepare(&preparation));
        let pushes_forward = engine.pushes_forward();
        let batches = Prefetch::start(data, recipe.clone(), step, move |draft| {
            if draft.unroll > 0 && !pushes_forward {
                Work::Draft(draft)
            } else {
                Work::Batch(Box::new(prepare(&ahead, &draft)))
            }
        });
        Ok(Self {
            config,
            identity,
            frame_interval,
            range,
            steps_before,
            engine,
            ranks,
            recipe,
            preparation,
            batches,
            log,
            best,
            valid: files.valid,
            folder: folder.to_owned(),
            bar,
        })
    }

    /// Takes the folder, where this is the process that writes; the files of an old training there go,
    /// unless this one goes on with it. What would stop the training only later is looked for first, so
    /// that nothing is lost or written for a training that cannot be.
    pub fn take_folder(&self, resume: bool) -> miette::Result<Option<FileLock>> {
        if self.ranks.rank() > 0 {
            return Ok(None);
        }
        self.check_validation()?;
        let lock = claim(&self.folder)?;
        if !resume {
            clear(&self.folder)?;
        }
        Ok(Some(lock))
    }

    /// Starts the rollouts of all validation files.
    fn check_validation(&self) -> miette::Result<()> {
        let simulator = self.simulator(self.engine.model()?);
        for path in &self.valid {
            let start = Start::from_trajectory(path, 0, &simulator)?;
            let given = start.positions.len();
            if start.frames <= given {
                bail!(
                    help = "take it out of valid/, or simulate it for longer",
                    "{}: a rollout starts from {given} frames, {} s apart, and has to predict at least one \
                     more, but the file has only {}",
                    path.display(),
                    self.frame_interval,
                    start.frames
                );
            }
        }
        Ok(())
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
        let mut warm = None;
        while self.engine.step_number() < steps {
            if self.asked_to_stop(interrupted)? {
                self.save()?;
                self.part()?;
                self.bar.finish_and_clear();
                if self.ranks.rank() == 0 {
                    let step = self.engine.step_number();
                    eprintln!("interrupted at step {step} of {steps}; --resume continues");
                }
                return Ok(ExitCode::from(INTERRUPTED));
            }
            self.step()?;
            if self.engine.step_number() == began.1 + FIRST {
                warm = Some(Instant::now());
            }
            if saved.elapsed() >= interval {
                self.save()?;
                saved = Instant::now();
            }
        }
        let each = warm.map(|warm| warm.elapsed().as_secs_f64());
        self.save()?;
        self.part()?;
        self.bar.finish_and_clear();
        if self.ranks.rank() > 0 {
            return Ok(ExitCode::SUCCESS);
        }
        let made = steps - began.1.min(steps);
        let seconds = began.0.elapsed().as_secs_f64();
        println!("{steps} steps, {made} of them now in {seconds:.1} s");
        if let Some(each) = each.filter(|_| made > FIRST) {
            let each = 1e3 * each / (made - FIRST) as f64;
            println!("{each:.3} ms each after the first {FIRST}");
        }
        if let Some(loss) = self.log.losses().last() {
            println!("loss {loss:.3e}");
        }
        match self.best {
            Some(best) => println!("best validation MSE {best:.3e} [box²]: best.safetensors"),
            None if self.valid.is_empty() => {
                println!("no valid/ in the data, so no best.safetensors: last.safetensors");
            }
            None => println!("no validation rollout came to its end: last.safetensors"),
        }
        println!("written: {}", self.folder.display());
        Ok(ExitCode::SUCCESS)
    }

    /// Whether any process was asked to; all stop after the same step.
    fn asked_to_stop(&mut self, interrupted: &AtomicBool) -> miette::Result<bool> {
        let own = interrupted.load(Ordering::Relaxed);
        if self.ranks.ranks() == 1 {
            return Ok(own);
        }
        let due =
            self.engine.gpu().is_none() || self.engine.step_number().is_multiple_of(AGREE_EVERY);
        Ok(due && self.ranks.any(own)?)
    }

    /// Lets the other processes go, after a last look at whether all have the same.
    fn part(&mut self) -> miette::Result<()> {
        if self.ranks.ranks() > 1 {
            let state = postcard::to_allocvec(&self.engine.state()?).into_diagnostic()?;
            if !self.ranks.all_equal(blake3::hash(&state).as_bytes())? {
                let rank = self.ranks.rank();
                bail!(
                    help = "an error of the program or of a GPU: do not trust this training",
                    "rank {rank} does not hold the same weights as the others"
                );
            }
        }
        self.ranks.done();
        Ok(())
    }

    fn step(&mut self) -> miette::Result<()> {
        let batch = match self.batches.next()? {
            Some(Work::Batch(batch)) => *batch,
            Some(Work::Draft(draft)) => {
                let draft = self.push_forward(draft)?;
                self.engine.prepare(&self.preparation)(&self.recipe, &draft)
            }
            None => bail!("the thread that prepares the data has died"),
        };
        let steps = self.config.steps;
        let ranks = self.ranks.as_mut();
        let rate = self.config.schedule.at(self.engine.step_number(), steps, ranks.ranks());
        self.engine.step(batch, rate, ranks)?;
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
        if due && !self.valid.is_empty() && self.ranks.rank() == 0 {
            self.validate()?;
        }
        Ok(())
    }

    fn push_forward(&mut self, draft: Draft) -> miette::Result<Draft> {
        let (recipe, prepare) = (&self.recipe, self.engine.prepare(&self.preparation));
        draft.push_forward(|draft| {
            let normalised = self.engine.predict(&prepare(recipe, draft))?;
            Ok(recipe.accelerations(draft, &normalised))
        })
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
        let simulator = self.simulator(self.engine.model()?);
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

    /// Rank 0 saves for all. The models first, then the checkpoint: what comes after it will be made again.
    fn save(&mut self) -> miette::Result<()> {
        self.read_losses()?;
        if self.ranks.rank() > 0 {
            return Ok(());
        }
        self.simulator(self.engine.model()?).save(&self.folder.join("last.safetensors"))?;
        self.log.write(&self.folder)?;
        let (identity, state) = (self.identity.clone(), self.engine.state()?);
        let checkpoint = Checkpoint::new(identity, state, self.log.clone(), self.best);
        checkpoint.write(&checkpoint_in(&self.folder))?;
        Ok(())
    }

    fn simulator(&self, model: Model<Cpu>) -> Simulator {
        let training = Training {
            before_start: self.config.data.before_start,
            steps: self.steps_before + self.engine.step_number(),
            range: self.range,
            ..Training::untrained(self.frame_interval, self.config.data.subtract_gravity)
        };
        let Preparation { config, normalisation, .. } = &self.preparation;
        let (config, normalisation) = (config.clone(), normalisation.clone());
        let gpu = self.engine.gpu();
        Simulator { gpu, ..Simulator::new(model, config, normalisation, training) }
    }
}
