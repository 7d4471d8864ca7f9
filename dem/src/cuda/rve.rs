//! The kernel `rve.cu`: its arguments, its source, and how it is loaded.

use std::sync::Arc;

use gpu::{ConstPointer, Device, Function, checks, definitions, files, kernel};

use super::abi::{
    Batch, Disc, Header, Motion, Parameters, Position, Queue, Rows, State, Status, Tensor, Turn,
    Vector,
};
use super::error::CudaError;
use super::real::CudaReal;
use super::shape::Shape;

const FILES: &str = files!(
    "real.cuh",
    "batch.cuh",
    "queue.cuh",
    "copies.cuh",
    "shared.cuh",
    "cell.cuh",
    "position.cuh",
    "macro_step.cuh",
    "neighbours.cuh",
    "list.cuh",
    "contact.cuh",
    "substeps.cuh",
    "rve.cu"
);

kernel! {
    /// One macro step of all RVEs, one block each.
    pub(super) struct RveAdvance<R: CudaReal>: rve_advance {
        /// The RVEs.
        pub batch: Batch<R>,
        /// Parameters of the macro step.
        pub p: Parameters<R>,
        /// Velocity gradient of each RVE (1/s).
        pub velocity_gradient: ConstPointer<Tensor>,
    }
}

/// The source of the kernel; needs the [`defines`](Shape::defines) of a shape.
pub fn source<R: CudaReal>() -> String {
    let structs = definitions![
        Tensor,
        Vector<R>,
        Motion<R>,
        Position<R>,
        Disc<R>,
        Status,
        Header,
        Rows,
        State,
        Turn,
        Queue,
        Parameters<R>,
        Batch<R>,
    ];
    [&structs, FILES, &checks![RveAdvance<R>]].concat()
}

/// Compiles the kernel for a shape, or takes it from the cache.
pub(super) fn load<R: CudaReal>(
    device: &Arc<Device>,
    shape: &Shape,
) -> Result<Function<RveAdvance<R>>, CudaError> {
    let module = device.module("rve.cu", &source::<R>(), &shape.defines())?;
    Ok(Function::load(device, &module)?.with_shared(shape.shared_bytes)?)
}
