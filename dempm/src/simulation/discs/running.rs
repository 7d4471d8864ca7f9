//! The discs of a scene on a processor.

use std::f64::consts::PI;
use std::sync::Arc;

use dem::assembly::{Assembly, Energy, GrainState, Members, PointMean, Surroundings, point_means};
use dem::cuda::{CudaAssembly, CudaReal};
use gpu::ranks::Ranks;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::fronts::{CONNECTED_DEPTH, connected_front};
use crate::simulation::error::SimulationError;
use crate::simulation::span::Span;

/// The discs of a scene in its precision.
#[derive(Clone, Serialize, Deserialize)]
pub(super) enum SceneAssembly {
    F32(Assembly<f32>),
    F64(Assembly<f64>),
}

impl From<Assembly<f32>> for SceneAssembly {
    fn from(assembly: Assembly<f32>) -> Self {
        Self::F32(assembly)
    }
}

impl From<Assembly<f64>> for SceneAssembly {
    fn from(assembly: Assembly<f64>) -> Self {
        Self::F64(assembly)
    }
}

impl SceneAssembly {
    /// The discs ready to advance on the CPU.
    pub fn running(self) -> Box<dyn Running> {
        match self {
            Self::F32(assembly) => Box::new(OnProcessor { assembly, twin: None }),
            Self::F64(assembly) => Box::new(OnProcessor { assembly, twin: None }),
        }
    }
}

/// Discs that advance on the CPU or a GPU.
pub(super) trait Running {
    /// Advances on a GPU from now on, where `members` are the grains of points; as one of several ranks, a part
    /// of the discs.
    fn move_to(
        &mut self,
        device: &Arc<gpu::Device>,
        ranks: Option<&Arc<Ranks>>,
        members: &Members,
    ) -> Result<(), SimulationError>;

    /// Whether states and records are those of all discs; of several ranks only the first has them.
    fn has_states(&self) -> bool;

    /// Advances by a macro step of `substeps` DEM steps on the CPU, or to the next frame on a GPU, which may
    /// then go on. Returns the macro steps made.
    fn advance(
        &mut self,
        span: &Span,
        substeps: usize,
        frame: &Frame,
    ) -> Result<usize, SimulationError>;

    /// The states of all grains and their energy; on a GPU, as of the last checkpoint.
    fn states(&self) -> (Vec<GrainState>, Energy);

    /// What the grains of a frame come to; on a GPU, with their states only where they are kept.
    fn summary(&self, members: &Members, frame: &Frame) -> Result<Summary, SimulationError>;

    /// Brings the state for a checkpoint up to date.
    fn record(&mut self) -> Result<(), SimulationError>;

    /// The state for a checkpoint, as of the last call of [`Self::record`].
    fn recorded(&self) -> SceneAssembly;

    /// Number of discs.
    fn len(&self) -> usize;

    /// Largest overlap so far, over the smaller radius.
    fn max_overlap(&self) -> f64;

    /// Searches for neighbours so far.
    fn searches(&self) -> u64;

    /// Steps of single discs that were left out so far.
    fn skipped(&self) -> u64;

    /// Largest displacement of a disc that was computed though it would have been held (m).
    fn audit(&self) -> f64;
}

/// What is wanted of the grains of a frame.
pub(super) struct Frame {
    /// What surrounds them.
    pub around: Surroundings,
    /// Whether their states are kept.
    pub kept: bool,
}

/// What the grains of a frame come to.
pub(super) struct Summary {
    /// Means over the grains of points.
    pub means: Vec<PointMean>,
    pub energy: Energy,
    /// The foremost x (m) connected to the pile.
    pub front: f64,
    /// States of the grains, if they are kept.
    pub states: Vec<GrainState>,
}

/// The foremost x (m) connected to the pile, of grains at x (m) with radii (m) and this mean diameter (m).
pub(super) fn front_of(
    grains: impl IndexedParallelIterator<Item = (f64, f64)>,
    mean_diameter: f64,
) -> f64 {
    let solid: Vec<(f64, f64)> = grains.map(|(x, r)| (x, PI * r * r)).collect();
    connected_front(&solid, CONNECTED_DEPTH * mean_diameter)
}

/// Horizontal position (m) and radius (m) of grains.
pub(super) fn extents(states: &[GrainState]) -> impl IndexedParallelIterator<Item = (f64, f64)> {
    states.par_iter().map(|grain| (grain.x[0], grain.r))
}

/// Discs on the CPU, and their twin on a GPU.
struct OnProcessor<R: CudaReal> {
    /// On a GPU, as of the last checkpoint.
    assembly: Assembly<R>,
    twin: Option<Twin<R>>,
}

/// Discs on a GPU.
struct Twin<R: CudaReal> {
    assembly: CudaAssembly<R>,
    /// Whether steps are queued beyond the last frame.
    ahead: bool,
    /// Whether the CPU has its state.
    recorded: bool,
}

impl<R: CudaReal> Running for OnProcessor<R>
where
    SceneAssembly: From<Assembly<R>>,
{
    fn move_to(
        &mut self,
        device: &Arc<gpu::Device>,
        ranks: Option<&Arc<Ranks>>,
        members: &Members,
    ) -> Result<(), SimulationError> {
        let mut assembly = CudaAssembly::upload_on(device, &self.assembly, ranks)?;
        if assembly.is_first() {
            assembly.set_points(members)?;
        }
        self.twin = Some(Twin { assembly, ahead: false, recorded: true });
        Ok(())
    }

    fn has_states(&self) -> bool {
        self.twin.as_ref().is_none_or(|twin| twin.assembly.is_first())
    }

    fn advance(
        &mut self,
        span: &Span,
        substeps: usize,
        frame: &Frame,
    ) -> Result<usize, SimulationError> {
        // Not a running sum: a resumed run has the same times.
        let time = |step: usize| step as f64 * span.dt;
        let Some(Twin { assembly, ahead, recorded }) = &mut self.twin else {
            self.assembly.set_time(time(span.first));
            self.assembly.advance(substeps)?;
            return Ok(1);
        };
        if !*ahead {
            assembly.set_time(time(span.first));
            assembly.queue(span.to_frame * substeps)?;
        }
        assembly.finish()?;
        if assembly.is_first() {
            assembly.queue_means(&self.assembly, &frame.around, frame.kept)?;
        }
        *ahead = span.ahead > 0;
        if *ahead {
            assembly.set_time(time(span.first + span.to_frame));
            assembly.queue(span.ahead * substeps)?;
        }
        // The GPU goes on meanwhile.
        assembly.await_states()?;
        *recorded = false;
        Ok(span.to_frame)
    }

    fn states(&self) -> (Vec<GrainState>, Energy) {
        self.assembly.states_and_energy()
    }

    fn summary(&self, members: &Members, frame: &Frame) -> Result<Summary, SimulationError> {
        let Frame { around, kept } = frame;
        // Grains are coarse grained over their mean diameter.
        let diameter = around.width;
        if let Some(Twin { assembly, .. }) = &self.twin {
            let front = front_of(assembly.extents(&self.assembly)?, diameter);
            let (means, energy) = assembly.point_means()?;
            let states = if *kept { assembly.states(&self.assembly)?.0 } else { Vec::new() };
            return Ok(Summary { means, energy, front, states });
        }
        let (states, energy) = self.states();
        let means = point_means(&states, members, around);
        let front = front_of(extents(&states), diameter);
        Ok(Summary { means, energy, front, states })
    }

    fn record(&mut self) -> Result<(), SimulationError> {
        if let Some(twin) = &mut self.twin
            && !twin.recorded
            && twin.assembly.is_first()
        {
            assert!(!twin.ahead, "a checkpoint is of one moment");
            twin.assembly.download_into(&mut self.assembly)?;
            twin.recorded = true;
        }
        Ok(())
    }

    fn recorded(&self) -> SceneAssembly {
        self.assembly.clone().into()
    }

    fn len(&self) -> usize {
        self.assembly.len()
    }

    fn max_overlap(&self) -> f64 {
        let since = self.twin.as_ref().map_or(0.0, |twin| twin.assembly.max_overlap());
        self.assembly.max_overlap().max(since)
    }

    fn searches(&self) -> u64 {
        let since = self.twin.as_ref().map_or(0, |twin| twin.assembly.searches());
        self.assembly.searches() + since
    }

    fn skipped(&self) -> u64 {
        let since = self.twin.as_ref().map_or(0, |twin| twin.assembly.skipped());
        self.assembly.skipped() + since
    }

    fn audit(&self) -> f64 {
        let since = self.twin.as_ref().map_or(0.0, |twin| twin.assembly.audit());
        self.assembly.audit().max(since)
    }
}
