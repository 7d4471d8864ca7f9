//! The discs of a scene in its precision.

use dem::assembly::{Assembly, AssemblyError, Energy, GrainState};
use serde::{Deserialize, Serialize};

/// The discs in the precision of the scene.
#[derive(Clone, Serialize, Deserialize)]
pub(super) enum SceneAssembly {
    F32(Assembly<f32>),
    F64(Assembly<f64>),
}

macro_rules! with_assembly {
    ($assemblies:expr, $assembly:ident => $value:expr) => {
        match $assemblies {
            SceneAssembly::F32($assembly) => $value,
            SceneAssembly::F64($assembly) => $value,
        }
    };
}

impl SceneAssembly {
    /// Advances by DEM steps from `time` (s) on.
    pub fn advance(&mut self, time: f64, steps: usize) -> Result<(), AssemblyError> {
        with_assembly!(self, assembly => {
            // Not a running sum: a resumed run has the same times.
            assembly.set_time(time);
            assembly.advance(steps)
        })
    }

    pub fn states(&self) -> Vec<GrainState> {
        with_assembly!(self, assembly => assembly.states())
    }

    pub fn energy(&self) -> Energy {
        with_assembly!(self, assembly => assembly.energy())
    }

    pub fn max_overlap(&self) -> f64 {
        with_assembly!(self, assembly => assembly.max_overlap())
    }

    pub fn steps(&self) -> u64 {
        with_assembly!(self, assembly => assembly.steps())
    }

    pub fn searches(&self) -> u64 {
        with_assembly!(self, assembly => assembly.searches())
    }

    pub fn len(&self) -> usize {
        with_assembly!(self, assembly => assembly.len())
    }
}
