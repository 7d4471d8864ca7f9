//! Advancing a scene.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gpu::ranks::Ranks;
use mpm::Solver;

use super::cuda::CudaSimulation;
use super::error::SimulationError;
use super::initial::initial_state;
use super::state::{SceneMaterial, State};
use crate::scene::Scene;

/// A scene and its present state.
pub struct Simulation {
    /// The scene.
    pub scene: Scene,
    /// Points, material and time; on a GPU, as of the last frame or checkpoint.
    pub state: State,
    pub(crate) solver: Solver,
    /// Name of the processor, as in [`Header::device`](crate::trajectory::Header::device).
    pub(crate) device: String,
    /// The copy that advances on a GPU.
    gpu: Option<CudaSimulation>,
    /// Wall time of steps since it was last recorded.
    advancing: Duration,
}

impl Simulation {
    /// A scene at time zero. Prepares the packings, or finds them in the cache.
    ///
    /// # Errors
    /// If a packing cannot be prepared or the grid cannot be set up.
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

    /// A scene in the state of a checkpoint.
    ///
    /// # Errors
    /// If the state does not fit the scene.
    pub fn resume(scene: Scene, state: State) -> Result<Self, SimulationError> {
        let mut solver = scene.solver().map_err(SimulationError::Setup)?;
        solver.set_ledger(state.ledger.clone()).map_err(SimulationError::Setup)?;
        Ok(Self { scene, state, solver, device: cpu(), gpu: None, advancing: Duration::ZERO })
    }

    /// Advances on a GPU from now on; as one of several ranks, with this rank's share of the packings.
    ///
    /// # Errors
    /// If the simulation does not fit into the GPU's memory or a kernel cannot be compiled.
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

    /// Advances by one macro step on the CPU, or to the next frame on a GPU. Points are then up to
    /// date; a material on a GPU only after [`record`](Self::record).
    ///
    /// # Errors
    /// If a point leaves the grid or its material fails; the step is then half done.
    pub fn advance(&mut self) -> Result<(), SimulationError> {
        self.advance_and(false)
    }

    /// As [`advance`](Self::advance). With `go_on`, a GPU already computes the next frame while the
    /// caller processes this one, which then cannot be [recorded](Self::record).
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

    /// One macro step on the CPU. [`Solver::advance`] transfers mass and momentum from points to grid,
    /// updates the grid momentum, applies boundaries and obstacles, transfers velocities back to the
    /// points, evaluates their velocity gradients and asks the material for the new stresses: an
    /// [`RveMaterial`](super::RveMaterial) deforms the packings of all points.
    fn step(&mut self) -> Result<(), SimulationError> {
        // Not a running sum: a resumed run has the same times.
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

    /// Brings the whole state up to date for a checkpoint.
    ///
    /// # Errors
    /// If the GPU fails.
    pub fn record(&mut self) -> Result<(), SimulationError> {
        self.record_wall_time();
        self.state.ledger.clone_from(self.solver.ledger());
        if let Some(gpu) = &mut self.gpu {
            gpu.fetch_material(&mut self.state)
                .map_err(|error| SimulationError::on_gpu(error, self.scene.step))?;
        }
        Ok(())
    }

    /// Adds the wall time since the last call to the phases `rve` and `mpm`.
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

    /// Frames up to now, including the initial one.
    pub fn frames_so_far(&self) -> usize {
        self.state.step / self.scene.steps_per_frame() + 1
    }
}

/// Name of the CPU backend.
fn cpu() -> String {
    format!("cpu, {} threads", rayon::current_num_threads())
}
