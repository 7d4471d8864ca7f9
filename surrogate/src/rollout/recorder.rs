//! Records a rollout in a trajectory file.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use dempm::trajectory::{Frame, Header, TrajectoryError, TrajectoryWriter};
use files::utc_now;

use super::engine::Rollout;
use super::error::RolloutError;
use super::frames::FrameBuilder;
use super::initial_frames::InitialFrames;
use crate::diagnostics::{ErrorFeatures, ExpectedError, Monitor};
use crate::network::Precision;
use crate::simulator::Simulator;

/// What to record.
pub struct RecordingOptions<'a> {
    /// File of the model, named in the output.
    pub model: &'a Path,
    /// Trajectory file to write. A file that is there is replaced.
    pub output: &'a Path,
    /// Frames of the output, the initial ones included; at least as many as those.
    pub frames: usize,
    /// When preparation began; the output states how long it took.
    pub began: Instant,
}

/// Follows a rollout while it is recorded.
pub trait RolloutObserver {
    /// `frames` frames are in the file.
    fn recorded(&mut self, frames: usize);

    /// The prediction looks wrong.
    fn warning(&mut self, text: &str);
}

/// A recorded rollout.
#[derive(Debug)]
pub struct RecordedRollout {
    /// Frames in the file, the initial ones included.
    pub frames: usize,
    /// Wall time of the prediction, s.
    pub seconds: f64,
    /// The error that ended the rollout early.
    pub failure: Option<RolloutError>,
    /// The distance from the truth to expect in the last frame; none if the model knows none.
    pub expected: Option<ExpectedError>,
}

/// Rolls `simulator` out from `initial` into a trajectory file, until it has all frames, the
/// prediction fails or `interrupted` is set. The file is complete in each case.
///
/// # Errors
/// If the file cannot be written.
pub fn record(
    simulator: &Simulator,
    initial: &InitialFrames,
    options: &RecordingOptions,
    interrupted: &AtomicBool,
    observer: &mut dyn RolloutObserver,
) -> Result<RecordedRollout, TrajectoryError> {
    let rollout = Rollout::new(simulator, initial);
    let mut recording = Recording::new(simulator, initial, options, rollout)?;
    while !interrupted.load(Ordering::Relaxed) && recording.advance(observer)? {}
    recording.finish()
}

/// A rollout that is recorded, frame by frame.
pub struct Recording<'a> {
    simulator: &'a Simulator,
    /// None once there is nothing more to predict, so that no other waits for it.
    rollout: Option<Rollout<'a>>,
    writer: TrajectoryWriter,
    builder: FrameBuilder<'a>,
    monitor: Monitor,
    /// What the error is predicted from; none if the model knows none.
    features: Option<ErrorFeatures>,
    expected: Option<ExpectedError>,
    failure: Option<RolloutError>,
    /// Frames to record, the initial ones included.
    frames: usize,
    began: Instant,
}

impl<'a> Recording<'a> {
    /// Writes the frames that `rollout` starts from.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn new(
        simulator: &'a Simulator,
        initial: &'a InitialFrames,
        options: &RecordingOptions,
        rollout: Rollout<'a>,
    ) -> Result<Self, TrajectoryError> {
        let interval = simulator.training.frame_interval;
        let header = header(simulator, initial, options.model);
        let mut writer = TrajectoryWriter::create(options.output, &header, &initial.points)?;
        let builder = FrameBuilder::new(initial, interval);
        let knows_error = simulator.training.error.is_some();
        for mut frame in builder.initial() {
            if knows_error {
                // These are the truth's.
                expect(&mut frame, ExpectedError { median: 0.0, bound: 0.0 });
            }
            writer.push(frame)?;
        }
        let preparation = options.began.elapsed().as_secs_f64() - initial.simulated_in;
        writer.set_wall_time("preparation", preparation);
        writer.set_wall_time("start", initial.simulated_in);
        Ok(Self {
            monitor: Monitor::new(initial, interval, options.frames),
            features: knows_error.then(|| ErrorFeatures::new(simulator, initial)),
            expected: None,
            failure: None,
            frames: options.frames,
            began: Instant::now(),
            simulator,
            rollout: (writer.frames() < options.frames).then_some(rollout),
            writer,
            builder,
        })
    }

    /// Predicts and records a frame. Returns whether there are more.
    ///
    /// # Errors
    /// If the frame cannot be recorded.
    pub fn advance(&mut self, observer: &mut dyn RolloutObserver) -> Result<bool, TrajectoryError> {
        let Some(mut rollout) = self.rollout.take() else { return Ok(false) };
        match rollout.advance() {
            Ok(_) => self.push(&rollout, observer)?,
            Err(error) => self.failure = Some(error),
        }
        observer.recorded(self.writer.frames());
        let more = self.failure.is_none() && self.writer.frames() < self.frames;
        self.rollout = more.then_some(rollout);
        Ok(more)
    }

    fn push(
        &mut self,
        rollout: &Rollout<'_>,
        observer: &mut dyn RolloutObserver,
    ) -> Result<(), TrajectoryError> {
        let (frame, before, now) = (rollout.frame(), rollout.before(), rollout.last());
        for warning in self.monitor.observe(frame, before, now) {
            observer.warning(&warning);
        }
        let mut predicted = self.builder.predicted(frame, before, now);
        if let (Some(error), Some(features)) = (&self.simulator.training.error, &mut self.features)
        {
            features.observe(before, now);
            let part = frame as f64 / (self.frames - 1) as f64;
            let of_frame = error.expected(part, &features.at(frame, now));
            expect(&mut predicted, of_frame);
            self.expected = Some(of_frame);
        }
        self.writer.push(predicted)
    }

    /// Writes the file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self) -> Result<RecordedRollout, TrajectoryError> {
        let Self { mut writer, failure, expected, .. } = self;
        let (frames, seconds) = (writer.frames(), self.began.elapsed().as_secs_f64());
        writer.set_wall_time("surrogate", seconds);
        match &failure {
            Some(error) => writer.finish(&format!("failed: {error}"))?,
            None if frames < self.frames => writer.finish("interrupted")?,
            None => writer.finish("finished")?,
        }
        Ok(RecordedRollout { frames, seconds, failure, expected })
    }
}

/// States the error to expect in a frame.
fn expect(frame: &mut Frame, error: ExpectedError) {
    frame.budget.insert("expected_error".to_owned(), error.median);
    frame.budget.insert("error_bound".to_owned(), error.bound);
}

/// The header of the run that the rollout replaces, with the surrogate as its material.
fn header(simulator: &Simulator, initial: &InitialFrames, model: &Path) -> Header {
    let mut header = initial.header.clone();
    header.created = utc_now();
    header.versions.insert("surrogate".to_owned(), env!("CARGO_PKG_VERSION").to_owned());
    header.device = match &simulator.gpu {
        Some(device) => device.name().to_owned(),
        None => format!("cpu, {} threads", rayon::current_num_threads()),
    };
    let precision = match simulator.precision {
        Precision::F32 => "f32",
        Precision::Bf16 => "bf16",
    };
    header.precision = format!("{precision} (network), f64 (positions)");
    header.material = format!("surrogate ({})", model.display());
    header.frame_interval = simulator.training.frame_interval;
    header.time_step = simulator.training.frame_interval;
    header
        .parameters
        .insert("surrogate_training_steps".to_owned(), simulator.training.steps as f64);
    header
}
