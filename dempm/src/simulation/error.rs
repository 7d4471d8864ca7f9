//! Errors of simulations.

use dem::assembly::AssemblyError;
use dem::cuda::CudaAssemblyError;
use gpu::ranks::RanksError;
use mpm::MaterialError;

/// A simulation that could not be set up or had to stop.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum SimulationError {
    /// A packing could not be prepared.
    #[error(transparent)]
    Packing(#[from] dem::Error),
    /// The material refuses its parameters or the initial stress.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// A rank of a run on several GPUs is gone.
    #[error(transparent)]
    Ranks(#[from] RanksError),
    /// The packings could not be moved to the GPU.
    #[error(transparent)]
    Rves(#[from] dem::cuda::CudaError),
    /// The GPU failed.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// The solver refuses the domain, the numerics or an obstacle.
    #[error("cannot set up the background grid")]
    Setup(#[source] mpm::Error),
    /// A macro step failed.
    #[error("step {step} (t = {time:.4} s)")]
    Step {
        /// Number of the step, counted from 1.
        step: usize,
        /// Simulated time at its end (s).
        time: f64,
        /// The point or packing that failed, and why.
        source: mpm::Error,
    },
    /// A column of discs could not be prepared, or a grain failed.
    #[error(transparent)]
    Discs(#[from] AssemblyError),
    /// No grain starts in the square of a point.
    #[error(
        "no grain starts in the square of point {point} at ({:.3}, {:.3}) m", position[0], position[1]
    )]
    #[diagnostic(help("a larger `cell`, fewer `points_per_cell`, or smaller grains"))]
    Empty {
        /// Index of the point.
        point: usize,
        /// Centre of its square (m).
        position: [f64; 2],
    },
    /// The state of a checkpoint is that of another model.
    #[error("the state is not that of the scene's model")]
    OtherModel,
    /// Discs failed on a GPU.
    #[error(transparent)]
    CudaDiscs(#[from] CudaAssemblyError),
    /// There is too little memory for the discs.
    #[error(
        "about {discs:.2e} discs need {:.1} GB of memory, and {:.1} GB are free",
        1e-9 * needed, 1e-9 * available
    )]
    #[diagnostic(help("larger grains or smaller columns; `dempm check` estimates the need"))]
    Memory {
        /// Number of discs, about.
        discs: f64,
        /// Memory that they need (bytes).
        needed: f64,
        /// Memory that is free (bytes).
        available: f64,
    },
    /// A continuum is compressed beyond what its law describes.
    #[error(
        "at t = {time:.3} s point {point} at ({:.3}, {:.3}) m is compressed to {:.0} % of its volume",
        position[0], position[1], 100.0 * left
    )]
    #[diagnostic(help("a slower impact, a lower column, or a stiffer material"))]
    Compressed {
        /// Simulated time (s).
        time: f64,
        /// Index of the point.
        point: usize,
        /// Its position (m).
        position: [f64; 2],
        /// Part of its initial volume that is left.
        left: f64,
    },
}

impl SimulationError {
    /// The failure of a simulation with macro steps of `dt` (s) on a GPU.
    pub(super) fn on_gpu(error: mpm::cuda::CudaError, dt: f64) -> Self {
        match error {
            mpm::cuda::CudaError::Gpu(error) => Self::Gpu(error),
            mpm::cuda::CudaError::Step { step, source } => {
                Self::Step { step, time: step as f64 * dt, source }
            }
        }
    }
}
