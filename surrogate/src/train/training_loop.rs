//! The training loop: steps, log, validation, checkpoints, and a clean end.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::checkpoint::Checkpoint;
use super::error::TrainError;
use super::folder::checkpoint_in;
use super::observer::TrainObserver;
use super::session::{NextBatch, Session};
use crate::data::Examples;
use crate::evaluation::compare;

/// Steps between agreements of GPUs on whether to stop, for which they wait for one another.
const AGREE_EVERY: u64 = 16;

/// First steps, in which kernels are compiled and memory is allocated; not timed.
pub const WARM_UP_STEPS: u64 = 50;

/// How a training ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// All steps are made.
    Finished(Report),
    /// Interrupted after this many steps; the checkpoint is written.
    Interrupted(u64),
}

/// A finished training in numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Steps made since it was started or resumed.
    pub made: u64,
    /// Wall time of these, s.
    pub seconds: f64,
    /// Wall time of a step after [`WARM_UP_STEPS`], s.
    pub seconds_per_step: Option<f64>,
    /// Mean loss in the last row of the log.
    pub loss: Option<f64>,
    /// Best validation MSE, box².
    pub best: Option<f64>,
}

impl Session {
    /// Trains to the last step or until `interrupted` is set, with checkpoints at least `interval`
    /// apart.
    ///
    /// # Errors
    /// If the training diverges, a device or process fails, or a file cannot be read or written.
    pub fn run(
        &mut self,
        interrupted: &AtomicBool,
        interval: Duration,
        observer: &mut dyn TrainObserver,
    ) -> Result<Outcome, TrainError> {
        let steps = self.config.steps;
        let (began, first) = (Instant::now(), self.backend.step_number());
        let mut saved = Instant::now();
        let mut warm = None;
        if first >= steps {
            self.leave()?;
            return Ok(Outcome::Finished(Report {
                made: 0,
                seconds: 0.0,
                seconds_per_step: None,
                loss: self.log.losses().last(),
                best: self.best,
            }));
        }
        while self.backend.step_number() < steps {
            if self.must_stop(interrupted)? {
                self.save()?;
                self.leave()?;
                return Ok(Outcome::Interrupted(self.backend.step_number()));
            }
            self.step(observer)?;
            if self.backend.step_number() == first + WARM_UP_STEPS {
                warm = Some(Instant::now());
            }
            if saved.elapsed() >= interval {
                self.save()?;
                saved = Instant::now();
            }
        }
        let timed = warm.map(|warm| warm.elapsed().as_secs_f64());
        self.save()?;
        self.leave()?;
        let made = steps - first;
        let timed = timed.filter(|_| made > WARM_UP_STEPS);
        Ok(Outcome::Finished(Report {
            made,
            seconds: began.elapsed().as_secs_f64(),
            seconds_per_step: timed.map(|timed| timed / (made - WARM_UP_STEPS) as f64),
            loss: self.log.losses().last(),
            best: self.best,
        }))
    }

    /// Whether any process was interrupted; all stop after the same step.
    fn must_stop(&mut self, interrupted: &AtomicBool) -> Result<bool, TrainError> {
        let own = interrupted.load(Ordering::Relaxed);
        if self.ranks.ranks() == 1 {
            return Ok(own);
        }
        let step = self.backend.step_number();
        let due = self.backend.gpu().is_none() || step.is_multiple_of(AGREE_EVERY);
        Ok(due && self.ranks.any(own)?)
    }

    /// Releases the other processes, after a check that all hold the same state.
    fn leave(&mut self) -> Result<(), TrainError> {
        if self.ranks.ranks() > 1 {
            let hash = self.backend.state()?.hash();
            if !self.ranks.all_equal(&hash)? {
                return Err(TrainError::RanksDiffer { rank: self.ranks.rank() });
            }
        }
        self.ranks.done();
        Ok(())
    }

    /// One step, with its log and validation if they are due.
    fn step(&mut self, observer: &mut dyn TrainObserver) -> Result<(), TrainError> {
        let batch = match self.batches.next()? {
            Some(NextBatch::Ready(batch)) => *batch,
            Some(NextBatch::ToUnroll(examples)) => {
                let examples = self.push_forward(examples)?;
                self.backend.prepare(&self.inputs)(&self.recipe, &examples)
            }
            None => return Err(TrainError::Prefetch),
        };
        let steps = self.config.steps;
        let ranks = self.ranks.as_mut();
        let rate = self.config.schedule.at(self.backend.step_number(), steps, ranks.ranks());
        self.backend.step(batch, rate, ranks)?;
        let step = self.backend.step_number();
        observer.step(step);
        if step.is_multiple_of(self.config.log_every) || step == steps {
            self.read_losses()?;
            observer.logged(self.log.row(step, rate), self.best);
        }
        let due = step.is_multiple_of(self.config.validation.every) || step == steps;
        if due && !self.valid.is_empty() && self.is_leader() {
            self.validate()?;
        }
        Ok(())
    }

    /// Unrolls the windows with the network in its present state.
    fn push_forward(&mut self, examples: Examples) -> Result<Examples, TrainError> {
        let (recipe, prepare) = (&self.recipe, self.backend.prepare(&self.inputs));
        examples.push_forward(|examples| {
            let normalised = self.backend.predict(&prepare(recipe, examples))?;
            Ok(recipe.accelerations(examples, &normalised))
        })
    }

    /// Moves the losses since the last call to the log.
    fn read_losses(&mut self) -> Result<(), TrainError> {
        let losses = self.backend.take_losses()?;
        if let Some(place) = losses.iter().position(|loss| !loss.is_finite()) {
            let step = self.backend.step_number() - (losses.len() - place) as u64 + 1;
            return Err(TrainError::Diverged { step });
        }
        self.log.add(&losses);
        Ok(())
    }

    /// Rolls out all validation files and saves the model if it is the best so far.
    fn validate(&mut self) -> Result<(), TrainError> {
        let simulator = self.simulator()?;
        let frames = Some(self.config.validation.frames).filter(|&frames| frames > 0);
        let mut sum = 0.0;
        for path in &self.valid {
            sum += compare(&simulator, path, frames)?.mean();
        }
        let mse = sum / self.valid.len() as f64;
        self.log.validation(self.backend.step_number(), mse);
        if mse < self.best.unwrap_or(f64::INFINITY) {
            self.best = Some(mse);
            simulator.save(&self.folder.join("best.safetensors"))?;
        }
        Ok(())
    }

    /// Saves the model and log, then the checkpoint: steps after it are made again. Rank 0 saves for
    /// all.
    fn save(&mut self) -> Result<(), TrainError> {
        self.read_losses()?;
        if !self.is_leader() {
            return Ok(());
        }
        self.simulator()?.save(&self.folder.join("last.safetensors"))?;
        self.log.write(&self.folder)?;
        let (identity, state) = (self.identity.clone(), self.backend.state()?);
        let checkpoint = Checkpoint::new(identity, state, self.log.clone(), self.best);
        checkpoint.write(&checkpoint_in(&self.folder))?;
        Ok(())
    }
}
