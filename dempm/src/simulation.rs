//! A scene in motion: material points, background grid and material, advanced step by step.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use dem::Packing;
use gpu::ranks::{Ranks, RanksError};
use mpm::{Ledger, Mat2, Material, MaterialError, Points, Solver, Vec2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::cuda::CudaSimulation;
use crate::packings::{self, Ladder};
use crate::rve_material::RveMaterial;
use crate::scene::{self, InitialStress, Scene};

/// Why a simulation could not be set up or stopped.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum SimulationError {
    #[error(transparent)]
    Packing(#[from] dem::Error),
    #[error(transparent)]
    Material(#[from] MaterialError),
    #[error(transparent)]
    Ranks(#[from] RanksError),
    #[error(transparent)]
    Rves(#[from] dem::cuda::CudaError),
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    #[error("setting up the background grid")]
    Setup(#[source] mpm::Error),
    #[error("step {step} (t = {time:.4} s)")]
    Step { step: usize, time: f64, source: mpm::Error },
}

impl SimulationError {
    /// What stopped a simulation with macro steps of `dt` (s) on a GPU.
    pub(crate) fn on_gpu(error: mpm::cuda::CudaError, dt: f64) -> Self {
        match error {
            mpm::cuda::CudaError::Gpu(error) => Self::Gpu(error),
            mpm::cuda::CudaError::Step { step, source } => {
                Self::Step { step, time: step as f64 * dt, source }
            }
        }
    }
}

/// A scene and where it is.
pub struct Simulation {
    pub scene: Scene,
    pub state: State,
    pub(crate) solver: Solver,
    /// What it is advanced on, in words.
    pub(crate) device: String,
    /// The points and packings that are advanced, if they are on a GPU.
    gpu: Option<CudaSimulation>,
    /// Wall time of this sitting since it was last recorded.
    advancing: Duration,
}

/// Everything that changes during a run; a checkpoint is this and nothing else.
#[derive(Clone, Serialize, Deserialize)]
pub struct State {
    /// Macro steps made.
    pub step: usize,
    pub points: Points,
    /// What contacts have done so far.
    pub ledger: Ledger,
    pub material: SceneMaterial,
    /// Wall time per phase (s), over all sittings.
    pub wall_time: BTreeMap<String, f64>,
}

/// The material of a scene.
#[derive(Clone, Serialize, Deserialize)]
pub enum SceneMaterial {
    Rve(Box<RveMaterial>),
    MuI(mpm::DruckerPrager),
    Elastic(mpm::Elastic),
}

impl SceneMaterial {
    fn as_dyn_mut(&mut self) -> &mut dyn Material {
        match self {
            Self::Rve(material) => material.as_mut(),
            Self::MuI(material) => material,
            Self::Elastic(material) => material,
        }
    }

    pub(crate) fn as_dyn(&self) -> &dyn Material {
        match self {
            Self::Rve(material) => material.as_ref(),
            Self::MuI(material) => material,
            Self::Elastic(material) => material,
        }
    }
}

impl Simulation {
    /// The scene at time zero, packings prepared.
    ///
    /// # Errors
    /// When a packing cannot be prepared or the grid cannot be set up.
    pub fn new(scene: Scene) -> Result<Self, SimulationError> {
        let start = Instant::now();
        let solver = scene.solver().map_err(SimulationError::Setup)?;
        let (points, material) = initial_state(&scene)?;
        let prepared = start.elapsed().as_secs_f64();
        let wall_time = BTreeMap::from([("preparation".to_owned(), prepared)]);
        let ledger = solver.ledger().clone();
        let state = State { step: 0, points, ledger, material, wall_time };
        Ok(Self { scene, state, solver, device: cpu(), gpu: None, advancing: Duration::ZERO })
    }

    /// The scene where a checkpoint left it.
    ///
    /// # Errors
    /// When the state does not fit the scene.
    pub fn resume(scene: Scene, state: State) -> Result<Self, SimulationError> {
        let mut solver = scene.solver().map_err(SimulationError::Setup)?;
        solver.set_ledger(state.ledger.clone()).map_err(SimulationError::Setup)?;
        Ok(Self { scene, state, solver, device: cpu(), gpu: None, advancing: Duration::ZERO })
    }

    /// Has everything advanced on a GPU from now on; with `ranks`, the packings of this rank.
    ///
    /// # Errors
    /// When it does not fit or a kernel cannot be compiled.
    pub fn move_to(
        &mut self,
        device: &Arc<gpu::Device>,
        ranks: Option<&Arc<Ranks>>,
    ) -> Result<(), SimulationError> {
        let start = Instant::now();
        let Self { scene, state, solver, .. } = self;
        self.gpu = Some(CudaSimulation::new(device, solver, state, scene, ranks)?);
        let count = ranks.map_or(1, |ranks| ranks.size());
        let gpus = if count > 1 { format!("{count} x ") } else { String::new() };
        self.device = format!("{gpus}{}", device.name());
        let upload = self.state.wall_time.entry("upload".to_owned()).or_default();
        *upload += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Advances to the next stop, where `state` is complete but for a material on a GPU (see
    /// [`record`](Self::record)): by one macro step on the CPU, and to the next frame on a GPU.
    ///
    /// # Errors
    /// When a point leaves the grid or its material fails; the step is then half done.
    pub fn advance(&mut self) -> Result<(), SimulationError> {
        self.advance_and(false)
    }

    /// As [`advance`](Self::advance); told to `go_on`, a GPU makes the steps to the stop after it
    /// while the caller looks at this one, and may not be asked to [`record`](Self::record) it.
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    pub fn advance_and(&mut self, go_on: bool) -> Result<(), SimulationError> {
        let start = Instant::now();
        let per_frame = self.scene.steps_per_frame();
        let to_next_frame = per_frame - self.state.step % per_frame;
        let time = match &mut self.gpu {
            None => {
                self.step()?;
                start.elapsed()
            }
            Some(gpu) => {
                let left = self.scene.steps().saturating_sub(self.state.step + to_next_frame);
                let next = if go_on { left.min(per_frame) } else { 0 };
                gpu.advance(to_next_frame, next, &mut self.state, &mut self.solver)
                    .map_err(|error| SimulationError::on_gpu(error, self.scene.step))?
            }
        };
        self.advancing += time;
        Ok(())
    }

    /// One macro step: points to grid, grid momentum, boundaries, grid to points, RVEs.
    fn step(&mut self) -> Result<(), SimulationError> {
        // Not a running sum, so that a resumed run has the same times.
        self.solver.set_time(self.time());
        let State { step, points, material, .. } = &mut self.state;
        let done = self.solver.advance(points, material.as_dyn_mut(), self.scene.step);
        done.map_err(|source| SimulationError::Step {
            step: *step + 1,
            time: (*step + 1) as f64 * self.scene.step,
            source,
        })?;
        *step += 1;
        Ok(())
    }

    /// Brings the state up to date for a checkpoint.
    ///
    /// # Errors
    /// A failure of the GPU.
    pub fn record(&mut self) -> Result<(), SimulationError> {
        self.record_wall_time();
        self.state.ledger.clone_from(self.solver.ledger());
        if let Some(gpu) = &mut self.gpu {
            gpu.fetch_material(&mut self.state)
                .map_err(|error| SimulationError::on_gpu(error, self.scene.step))?;
        }
        Ok(())
    }

    /// Adds the wall time since the last call to the phases.
    pub fn record_wall_time(&mut self) {
        let advancing = std::mem::take(&mut self.advancing);
        let material = match &mut self.state.material {
            SceneMaterial::Rve(rve) => std::mem::take(&mut rve.time),
            SceneMaterial::MuI(_) | SceneMaterial::Elastic(_) => Duration::ZERO,
        };
        let phases = [("rve", material), ("mpm", advancing.saturating_sub(material))];
        for (phase, time) in phases {
            *self.state.wall_time.entry(phase.to_owned()).or_default() += time.as_secs_f64();
        }
    }

    /// Simulated time (s).
    pub fn time(&self) -> f64 {
        self.state.step as f64 * self.scene.step
    }

    /// Frames recorded up to now, the initial one included.
    pub fn frames_so_far(&self) -> usize {
        self.state.step / self.scene.steps_per_frame() + 1
    }
}

fn cpu() -> String {
    format!("cpu, {} threads", rayon::current_num_threads())
}

/// Points and material at time zero.
fn initial_state(scene: &Scene) -> Result<(Points, SceneMaterial), SimulationError> {
    let start = scene.points();
    let area = scene.point_area();
    let mut points = Points::default();
    for x in start.position {
        points.push(Vec2::from(x), scene.material.density() * area, area);
    }
    points.velocity = start.velocity.into_iter().map(Vec2::from).collect();
    let depth: Vec<f64> = match scene.initial_stress {
        InitialStress::Ladder => start.depth,
        InitialStress::None => vec![0.0; points.len()],
    };
    let material = match &scene.material {
        scene::Material::Rve(rve) => {
            SceneMaterial::Rve(Box::new(rve_material(scene, rve, &depth, &mut points)?))
        }
        scene::Material::MuI(law) => {
            // Isotropic: this law has no memory of a lateral stress ratio.
            let weight = law.density * scene.gravity[1];
            let stress = depth.iter().map(|z| Mat2::identity() * (weight * z));
            points.stress = stress.collect();
            SceneMaterial::MuI(mpm::DruckerPrager::new(*law, &points.stress)?)
        }
        scene::Material::Elastic(law) => SceneMaterial::Elastic(mpm::Elastic::new(law.into())?),
    };
    Ok((points, material))
}

/// One packing per point: the rung of its depth on the ladder of one of the scene's packings.
fn rve_material(
    scene: &Scene,
    rve: &scene::Rve,
    depth: &[f64],
    points: &mut Points,
) -> Result<RveMaterial, SimulationError> {
    let (mut depths, rung) = distinct(depth);
    if scene.initial_stress == InitialStress::None {
        // All points start isotropic: no ladder to climb.
        depths.clear();
    }
    let seeds: Vec<u64> = (0..rve.packings as u64).map(|k| (scene.seed << 16) + k).collect();
    let g = scene.gravity[1].abs();
    let ladders = packings::ladders(&rve.parameters, &seeds, &depths, g)?;

    let mut rng = ChaCha8Rng::seed_from_u64(scene.seed);
    let mut chosen: Vec<&Packing<f64>> = Vec::with_capacity(depth.len());
    for (p, &rung) in rung.iter().enumerate() {
        let ladder: &Ladder = &ladders[rng.random_range(0..ladders.len())];
        let (packing, stress) = match scene.initial_stress {
            InitialStress::Ladder => (&ladder.rungs[rung].packing, ladder.rungs[rung].stress),
            InitialStress::None => {
                let pressure = rve.parameters.preparation.pressure;
                (&ladder.isotropic, Mat2::identity() * pressure)
            }
        };
        // Compression is positive in the packing, tension in the MPM.
        points.stress[p] = -stress;
        points.mass[p] = packings::bulk_density(&rve.parameters, packing) * points.volume[p];
        chosen.push(packing);
    }
    let fresh = &ladders[0].isotropic;
    Ok(RveMaterial::new(&rve.parameters, rve.precision, &chosen, fresh, &points.volume))
}

/// The distinct values, ascending, and for each entry the index of its value.
fn distinct(values: &[f64]) -> (Vec<f64>, Vec<usize>) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    // Depths of one row differ by round-off only.
    sorted.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let index =
        |value: &f64| sorted.iter().position(|s| (s - value).abs() < 2e-9).unwrap_or_default();
    let indices = values.iter().map(index).collect();
    (sorted, indices)
}
