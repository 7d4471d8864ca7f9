//! A rollout: the model predicts a frame, sees it, predicts the next one, and so on.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use dempm::device::Device;
use dempm::scene::Scene;
use dempm::trajectory::{Frame, TrajectoryWriter};
use files::{FileLock, INTERRUPTED, interrupt_flag, refuse_input};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{Context, IntoDiagnostic, bail};

use crate::asymmetry::asymmetry;
use crate::constraints::Constraints;
use crate::cuda::{Ahead, Capacity, CudaNetwork, CudaRollout, Motion, Past};
use crate::doubts::doubts;
use crate::features::{Obstacle, Window};
use crate::inference::Inference;
use crate::pressed::Packing;
use crate::simulator::Simulator;
use crate::start::Start;
use crate::train::{Precision, weights};
use crate::watch::Watch;

/// A prediction that makes no sense.
#[derive(Clone, Debug, PartialEq, thiserror::Error, miette::Diagnostic)]
pub enum RolloutError {
    #[error("frame {frame}: the predicted position of point {point} is not finite")]
    NotFinite { frame: usize, point: usize },
    #[error("frame {frame}: point {point} leaves the domain by {distance:.3} m")]
    Left { frame: usize, point: usize, distance: f64 },
    #[error(
        "frame {frame}: points are pressed together ({neighbours:.0} neighbours on average, {plane:.0} \
         if they filled the plane)"
    )]
    Pressed { frame: usize, neighbours: f64, plane: f64 },
    #[error("the rollout on the GPU: {message}")]
    Device { message: String },
}

/// What predicts frames.
enum Engine {
    /// The network on the processor.
    Cpu(Box<Inference>, Packing),
    /// A rollout on a GPU, some frames ahead.
    Cuda(Ahead),
}

/// A rollout under way.
pub struct Rollout<'a> {
    simulator: &'a Simulator,
    engine: Engine,
    constraints: Constraints,
    /// The window of frames that the model sees next, the oldest first.
    window: VecDeque<Vec<[f64; 2]>>,
    /// Features of the points that never change.
    statics: Vec<f32>,
    obstacles: Vec<Obstacle>,
    gravity: [f64; 2],
    start: f64,
    frame: usize,
}

impl<'a> Rollout<'a> {
    /// Begins after the frames of `start`.
    pub fn new(simulator: &'a Simulator, start: &Start) -> Self {
        let interval = simulator.training.frame_interval;
        Self {
            simulator,
            // Sets the GPU up, kernels and all, before it returns.
            engine: match &simulator.gpu {
                Some(device) => Engine::Cuda(ahead(device, simulator, start)),
                None => Engine::Cpu(Box::new(simulator.inference()), packing(simulator, start)),
            },
            obstacles: Constraints::new(&start.scene).obstacles(),
            constraints: Constraints::new(&start.scene),
            window: start.window(simulator.config.window(), interval).into(),
            statics: start.statics.clone(),
            gravity: start.scene.gravity.map(|g| g * interval * interval),
            start: start.time,
            frame: start.positions.len() - 1,
        }
    }

    /// The number of the last frame, counted from the first of the start.
    pub fn frame(&self) -> usize {
        self.frame
    }

    /// Positions of the last frame, m.
    pub fn last(&self) -> &[[f64; 2]] {
        &self.window[self.window.len() - 1]
    }

    /// Positions of the frame before it, m.
    pub fn before(&self) -> &[[f64; 2]] {
        &self.window[self.window.len() - 2]
    }

    /// The time of a frame, s.
    fn time(&self, frame: usize) -> f64 {
        self.start + frame as f64 * self.simulator.training.frame_interval
    }

    /// Predicts one frame.
    ///
    /// # Errors
    /// If a position is not finite or leaves the domain so far that no wall explains it, points are
    /// [pressed together](crate::pressed), or the GPU fails; the frame is then not made.
    pub fn advance(&mut self) -> Result<&[[f64; 2]], RolloutError> {
        let next = match &mut self.engine {
            Engine::Cuda(ahead) => ahead.next_frame()?,
            Engine::Cpu(network, packing) => {
                let packing = *packing;
                let frames = self.window.iter().flatten().flatten();
                let positions: &Vec<f32> = &frames.map(|&x| x as f32).collect();
                let points = self.window[0].len();
                let (statics, obstacles) = (&self.statics, &self.obstacles);
                let window = Window { positions, points, statics, obstacles };
                let domain = self.constraints.domain();
                let accelerations =
                    self.simulator.accelerations(network, &window, domain, self.gravity);
                let next = self.integrate(&accelerations)?;
                packing.check(self.frame + 1, &next)?;
                next
            }
        };
        self.window.pop_front();
        self.window.push_back(next);
        self.frame += 1;
        Ok(&self.window[self.window.len() - 1])
    }

    /// Semi-implicit Euler, walls and boxes.
    fn integrate(&self, accelerations: &[f64]) -> Result<Vec<[f64; 2]>, RolloutError> {
        let last = &self.window[self.window.len() - 1];
        let before = &self.window[self.window.len() - 2];
        let domain = self.constraints.domain();
        let frame = self.frame + 1;
        let times = [self.time(self.frame), self.time(frame)];
        let mut next = Vec::with_capacity(last.len());
        for (point, a) in accelerations.as_chunks::<2>().0.iter().enumerate() {
            let velocity = [0, 1].map(|k| last[point][k] - before[point][k] + a[k]);
            let free = [0, 1].map(|k| last[point][k] + velocity[k]);
            if !free.iter().all(|x| x.is_finite()) {
                return Err(RolloutError::NotFinite { frame, point });
            }
            let beyond = (0..2).map(|k| (-free[k]).max(free[k] - domain[k])).fold(0.0, f64::max);
            if beyond > self.simulator.config.connection_radius {
                return Err(RolloutError::Left { frame, point, distance: beyond });
            }
            next.push(self.constraints.confine(last[point], free, times));
        }
        Ok(next)
    }

    /// The last frame as a trajectory records it.
    fn record(&self, mass: &[f64]) -> Frame {
        let interval = self.simulator.training.frame_interval;
        let last = &self.window[self.window.len() - 1];
        let before = &self.window[self.window.len() - 2];
        let velocity = |(x, b): (&[f64; 2], &[f64; 2])| [0, 1].map(|k| (x[k] - b[k]) / interval);
        let velocity = last.iter().zip(before).map(velocity).collect();
        self.frame_of(self.frame, last.clone(), velocity, mass)
    }

    fn frame_of(
        &self,
        frame: usize,
        position: Vec<[f64; 2]>,
        velocity: Vec<[f64; 2]>,
        mass: &[f64],
    ) -> Frame {
        let time = self.time(frame);
        let largest = |k: usize| position.iter().map(|x| x[k]).fold(f64::MIN, f64::max);
        let kinetic = |(v, m): (&[f64; 2], &f64)| 0.5 * m * (v[0] * v[0] + v[1] * v[1]);
        let budget = BTreeMap::from([
            ("front".to_owned(), largest(0)),
            ("max_height".to_owned(), largest(1)),
            ("kinetic_energy".to_owned(), velocity.iter().zip(mass).map(kinetic).sum()),
        ]);
        let boxes = self.constraints.boxes(time);
        Frame { time, position, velocity, boxes, budget, ..Frame::default() }
    }
}

/// How densely points may be packed.
fn packing(simulator: &Simulator, start: &Start) -> Packing {
    Packing::new(simulator.config.connection_radius, start.scene.domain.spacing())
}

/// Begins a rollout on a GPU.
fn ahead(device: &Arc<gpu::Device>, simulator: &Simulator, start: &Start) -> Ahead {
    let interval = simulator.training.frame_interval;
    let relative = f64::from(u8::from(simulator.training.without_gravity));
    let motion = Motion {
        constraints: Constraints::new(&start.scene),
        fall: start.scene.gravity.map(|g| relative * (g * interval * interval)),
        start: start.time,
        interval,
        mirror: simulator.mirror,
        packing: packing(simulator, start),
    };
    let (config, norm) = (simulator.config.clone(), simulator.normalisation.clone());
    let weights = weights(&simulator.model);
    let window = start.window(simulator.config.window(), interval);
    let next = start.positions.len();
    let statics = start.statics.clone();
    let (device, precision) = (device.clone(), simulator.precision);
    Ahead::start(move || {
        let room = Capacity { points: window[0].len(), edges: 1 };
        let mut network = CudaNetwork::new(&device, &config, precision.into(), room, false)?;
        network.set_weights(&weights)?;
        let past = Past { window: &window, statics: &statics, next };
        CudaRollout::new(&device, &config, &norm, &motion, past, network)
    })
}

/// Arguments of `surrogate rollout`.
#[derive(clap::Args)]
pub struct RolloutArgs {
    /// Model (safetensors)
    model: PathBuf,
    /// Scene file (TOML), whose first frames are simulated
    #[arg(long, required_unless_present = "from")]
    scene: Option<PathBuf>,
    /// Trajectory file (HDF5), whose first frames are taken
    #[arg(long, conflicts_with = "scene")]
    from: Option<PathBuf>,
    /// First frame to take from the trajectory
    #[arg(long, value_name = "FRAME", default_value_t = 0, requires = "from")]
    start: usize,
    /// Frames of the result, the first ones included [default: as many as scene or trajectory have]
    #[arg(long)]
    frames: Option<usize>,
    /// Average each prediction with the mirrored one of the mirrored window
    #[arg(long)]
    mirror: bool,
    /// Where to compute: auto, cpu, cuda or cuda:N
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Precision of products on a GPU; bf16 is faster and less exact
    #[arg(long, value_enum, default_value_t = Precision::F32)]
    precision: Precision,
    /// Trajectory file to write (HDF5)
    #[arg(short, long)]
    output: PathBuf,
    /// Replace the output if it exists
    #[arg(long)]
    overwrite: bool,
}

/// Rolls a model out into a trajectory file.
///
/// # Errors
/// If a file is wrong or cannot be written, or the prediction breaks down; the frames before are
/// then in the output.
pub fn rollout(args: &RolloutArgs) -> miette::Result<ExitCode> {
    if args.output.exists() && !args.overwrite {
        bail!(help = "--overwrite replaces it", "{}: is there already", args.output.display());
    }
    let inputs = [Some(&args.model), args.scene.as_ref(), args.from.as_ref()];
    refuse_input(&args.output, inputs.into_iter().flatten())?;
    let _lock = FileLock::take(&args.output)?;
    let (mirror, precision) = (args.mirror, args.precision);
    let mut simulator = Simulator { mirror, precision, ..Simulator::load(&args.model)? };
    simulator.place(args.device).into_diagnostic().wrap_err("--device, --precision")?;
    let began = Instant::now();
    let start = match (&args.scene, &args.from) {
        (Some(path), _) => {
            let scene = Scene::load(path)?;
            let (own, asked) = (simulator.training.frame_interval, scene.frame_interval);
            if !simulator.training.is_interval(asked) {
                eprintln!("frames are {own} s apart, as the model's, not {asked} s as the scene's");
            }
            Start::from_scene(scene, &simulator)?
        }
        (None, Some(from)) => Start::from_trajectory(from, args.start, &simulator)?,
        (None, None) => bail!("give a --scene or a trajectory to start --from"),
    };
    let frames = args.frames.unwrap_or(start.frames);
    if frames < start.positions.len() {
        bail!("--frames {frames}: the model starts from {} frames", start.positions.len());
    }
    let interrupted = interrupt_flag()?;

    for doubt in doubts(&simulator, &start).into_iter().chain(asymmetry(&simulator, &start)) {
        eprintln!("{doubt}");
    }
    let mut writer = begin(&args.output, &args.model, &simulator, &start)?;
    let mut rollout = Rollout::new(&simulator, &start);
    let preparation = began.elapsed().as_secs_f64() - start.simulated_in;
    for (frame, (x, v)) in start.positions.iter().zip(&start.velocities).enumerate() {
        writer.push(rollout.frame_of(frame, x.clone(), v.clone(), &start.points.mass))?;
    }
    let bar = ProgressBar::new(frames as u64).with_style(
        ProgressStyle::with_template("{bar:24} {percent:>3} %  frame {pos}/{len}  {eta} left")
            .into_diagnostic()?,
    );
    let began = Instant::now();
    let mut failure = None;
    let mut watch = Watch::new(&start, simulator.training.frame_interval, frames);
    while writer.frames() < frames && !interrupted.load(Ordering::Relaxed) && failure.is_none() {
        match rollout.advance() {
            Ok(_) => {
                for doubt in watch.observe(rollout.frame, rollout.before(), rollout.last()) {
                    bar.suspend(|| eprintln!("{doubt}"));
                }
                writer.push(rollout.record(&start.points.mass))?;
            }
            Err(error) => failure = Some(error),
        }
        bar.set_position(writer.frames() as u64);
    }
    bar.finish_and_clear();
    let seconds = began.elapsed().as_secs_f64();
    writer.set_wall_time("preparation", preparation);
    writer.set_wall_time("start", start.simulated_in);
    writer.set_wall_time("surrogate", seconds);
    let made = writer.frames();
    if let Some(error) = failure {
        writer.finish(&format!("failed: {error}"))?;
        return Err(miette::Report::new(error)
            .wrap_err(format!("{} holds the {made} frames before", args.output.display())));
    }
    if made < frames {
        writer.finish("interrupted")?;
        eprintln!("interrupted; {} holds {made} of {frames} frames", args.output.display());
        return Ok(ExitCode::from(INTERRUPTED));
    }
    writer.finish("finished")?;
    let predicted = made - start.positions.len();
    println!(
        "{}: {made} frames, {predicted} of them predicted in {seconds:.2} s",
        args.output.display()
    );
    Ok(ExitCode::SUCCESS)
}

/// Makes the output with the header of the run that it stands for.
fn begin(
    output: &Path,
    model: &Path,
    simulator: &Simulator,
    start: &Start,
) -> miette::Result<TrajectoryWriter> {
    let mut header = start.header.clone();
    header.created = files::utc_now();
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
    Ok(TrajectoryWriter::create(output, &header, &start.points)?)
}
