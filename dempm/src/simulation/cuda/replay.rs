//! Macro steps on a GPU, replayed as CUDA graphs.

use std::sync::Arc;
use std::time::{Duration, Instant};

use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use cudarc::driver::{CudaEvent, CudaGraph};
use dem::cuda::Room;
use gpu::Device;
use gpu::ranks::Ranks;
use mpm::cuda::{CudaError, CudaSolver};
use mpm::{Points, Solver};

use super::material::DeviceMaterial;
use super::timer::{elapsed, timer};
use crate::scene::{Material, Scene};
use crate::simulation::error::SimulationError;
use crate::simulation::scene_material::SceneMaterial;

/// Macro steps in the graph that most steps are replayed from.
const STEPS_PER_GRAPH: usize = 25;

/// The points and the material of a simulation on a GPU.
pub(crate) struct CudaSimulation {
    device: Arc<Device>,
    solver: CudaSolver,
    material: DeviceMaterial,
    /// [`STEPS_PER_GRAPH`] steps, and the steps that are left over in a frame: single launches would take longer
    /// than the steps.
    graph: Option<CudaGraph>,
    rest: Option<(usize, CudaGraph)>,
    /// When the steps were queued that the CPU does not know of yet.
    ahead: Option<Instant>,
    /// The step whose material the CPU has.
    recorded: usize,
    /// Before and after the last step queued outside of a graph.
    events: [CudaEvent; 2],
}

impl CudaSimulation {
    /// Copies the simulation of a scene to a GPU.
    ///
    /// # Errors
    /// If it does not fit into memory or a kernel cannot be compiled.
    pub fn new(
        device: &Arc<Device>,
        solver: &Solver,
        material: &SceneMaterial,
        points: &Points,
        step: usize,
        scene: &Scene,
        ranks: Option<&Arc<Ranks>>,
    ) -> Result<Self, SimulationError> {
        let dt = scene.step;
        let room = match &scene.material {
            Material::Rve(rve) => rve.neighbours,
            Material::Discs(_) | Material::MuI(_) | Material::Elastic(_) => Room::default(),
        };
        Ok(Self {
            solver: CudaSolver::new(device, solver, points, dt, step)
                .map_err(|error| SimulationError::on_gpu(error, dt))?,
            material: DeviceMaterial::new(device, material, room, ranks)?,
            graph: None,
            rest: None,
            ahead: None,
            recorded: step,
            events: timer(device)?,
            device: device.clone(),
        })
    }

    /// Makes `steps` macro steps, copies back the data of a frame, and queues the `next` steps, which are
    /// those of the next call. Returns the time of the `steps`.
    ///
    /// # Errors
    /// If a point leaves the grid or its material fails, as on the CPU.
    pub fn advance(
        &mut self,
        steps: usize,
        next: usize,
        points: &mut Points,
        material: &mut SceneMaterial,
        solver: &mut Solver,
    ) -> Result<Duration, CudaError> {
        let start = match self.ahead.take() {
            Some(start) => start,
            None => {
                let start = Instant::now();
                self.queue(steps)?;
                start
            }
        };
        self.solver.queue_fetch()?;
        if let DeviceMaterial::Rve(twin) = &mut self.material {
            twin.queue_fetch()?;
        }
        self.device.stream().synchronize().map_err(gpu::Error::from)?;
        let end = Instant::now();
        let step = self.time()?;
        let packings = match &self.material {
            DeviceMaterial::Rve(twin) => twin.time()?,
            DeviceMaterial::MuI(_) | DeviceMaterial::Elastic(_) => Duration::ZERO,
        };
        if next > 0 {
            self.queue(next)?;
            self.ahead = Some(end);
        }

        self.solver.fetched(points, solver, self.material.as_dyn())?;
        let time = end - start;
        if let (DeviceMaterial::Rve(twin), SceneMaterial::Rve(rve)) = (&self.material, material) {
            twin.fetched(rve, steps)?;
            rve.time += time.mul_f64(packings.div_duration_f64(step));
        }
        Ok(time)
    }

    /// Copies back the state of the material, which only checkpoints need, unless the CPU has it.
    ///
    /// # Errors
    /// If the GPU fails.
    ///
    /// # Panics
    /// If steps beyond `step` are queued.
    pub fn fetch_material(
        &mut self,
        material: &mut SceneMaterial,
        step: usize,
    ) -> Result<(), CudaError> {
        assert!(self.ahead.is_none(), "a checkpoint is of one moment");
        if self.recorded == step {
            return Ok(());
        }
        match (&self.material, material) {
            (DeviceMaterial::Rve(twin), SceneMaterial::Rve(rve)) => twin.fetch_packings(rve)?,
            (DeviceMaterial::MuI(twin), SceneMaterial::MuI(law)) => twin.fetch(law)?,
            _ => {}
        }
        self.recorded = step;
        Ok(())
    }

    /// Queues macro steps: all but the last as graphs, the last one timed.
    fn queue(&mut self, steps: usize) -> Result<(), CudaError> {
        let mut left = steps - 1;
        if left > 0 && self.graph.is_none() {
            // Once outside of a capture, so that all kernels are loaded.
            self.solver.queue_step(self.material.as_dyn_mut())?;
            left -= 1;
            self.graph = Some(self.capture(STEPS_PER_GRAPH)?);
        }
        if let Some(graph) = &self.graph {
            for _ in 0..left / STEPS_PER_GRAPH {
                graph.launch()?;
            }
            self.launch_rest(left % STEPS_PER_GRAPH)?;
        }
        let stream = self.device.stream();
        self.events[0].record(stream)?;
        self.solver.queue_step(self.material.as_dyn_mut())?;
        self.events[1].record(stream)?;
        Ok(())
    }

    /// Launches fewer steps than a graph holds, from a graph of their own.
    fn launch_rest(&mut self, steps: usize) -> Result<(), CudaError> {
        if steps == 0 {
            return Ok(());
        }
        if self.rest.as_ref().is_none_or(|(captured, _)| *captured != steps) {
            self.rest = Some((steps, self.capture(steps)?));
        }
        if let Some((_, graph)) = &self.rest {
            graph.launch()?;
        }
        Ok(())
    }

    fn capture(&mut self, steps: usize) -> Result<CudaGraph, CudaError> {
        let stream = self.device.stream();
        stream.begin_capture(CUstreamCaptureMode::CU_STREAM_CAPTURE_MODE_THREAD_LOCAL)?;
        let queued =
            (0..steps).try_for_each(|_| self.solver.queue_step(self.material.as_dyn_mut()));
        // Always ended: a stream in capture mode is unusable.
        let graph = stream.end_capture(CUgraphInstantiate_flags(0))?;
        queued?;
        graph.ok_or_else(|| gpu::Error::Driver("an empty graph".into()).into())
    }

    /// Device time of the last step.
    fn time(&self) -> Result<Duration, gpu::Error> {
        elapsed(&self.events)
    }
}
