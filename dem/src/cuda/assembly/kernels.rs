//! The source of all kernels of an assembly, and how they are loaded.

use std::sync::Arc;

use gpu::{Device, Function, Source, checks, definitions, files};

use super::abi::{
    Arrays, Binned, Body, Box, Control, Disc, Extent, Failure, History, Loss, Motion, Output,
    Parameters, Place, PlacedBody, PointMean, Position, Rest, STEPS, Surroundings,
};
use super::energy::SumEnergy;
use super::error::CudaAssemblyError;
use super::grid::rows;
use super::losses::SumLosses;
use super::means::{BinGrains, Means, OrderBins};
use super::output::WriteOutput;
use super::search::{Begin, Bins, Finish, List};
use super::sleep::Quiet;
use super::sort::{Columns, Count, Places, Reorder, Scan, Starts};
use super::step::Step;
use crate::assembly::SAMPLES;
use crate::cuda::real::CudaReal;
use crate::grains::Grains;

/// Threads of a block of a step.
pub(super) const THREADS: u32 = 256;
/// Threads of the blocks of searches and copies.
pub(super) const COPY_THREADS: u32 = 128;

const FILES: &str = files!(
    "../real.cuh",
    "../contact.cuh",
    "assembly.cuh",
    "losses.cu",
    "sleep.cu",
    "step.cu",
    "search.cu",
    "sort.cu",
    "output.cu",
    "means.cu",
    "energy.cu"
);

/// The source of the kernels; needs [`defines`].
pub fn source<R: CudaReal>() -> String {
    let structs = definitions![
        Place<R>,
        Motion<R>,
        Disc<R>,
        Position<R>,
        History<R>,
        Loss,
        Rest<R>,
        Binned<R>,
        Body,
        PlacedBody<R>,
        Output<R>,
        Extent<R>,
        Box,
        Surroundings,
        PointMean,
        Control<R>,
        Arrays<R>,
        Parameters<R>,
        Failure,
    ];
    let checks = checks![
        Step<R>,
        Begin<R>,
        Bins<R>,
        List<R>,
        Finish<R>,
        Quiet<R>,
        Count<R>,
        Scan,
        Starts<R>,
        Columns<R>,
        Places<R>,
        Reorder<R>,
        SumLosses<R>,
        WriteOutput<R>,
        BinGrains<R>,
        OrderBins<R>,
        Means<R>,
        SumEnergy<R>,
    ];
    [&structs, FILES, &checks].concat()
}

/// Compile-time constants of the kernels, for lists of so many `rows`, contacts that may resist `rolling`, and discs that
/// may `sleep`.
pub fn defines<R: CudaReal>(rows: usize, rolling: bool, sleep: bool) -> Vec<String> {
    [
        ("REAL_BITS", R::BITS),
        ("THREADS", THREADS as usize),
        ("COPY_THREADS", COPY_THREADS as usize),
        ("BLOCKS", if R::BITS == 32 { 5 } else { 2 }),
        ("ROWS", rows),
        ("STEPS", STEPS),
        ("SAMPLES", SAMPLES),
        ("ROLLING", usize::from(rolling)),
        ("SLEEP", usize::from(sleep)),
    ]
    .map(|(name, value)| format!("{name}={value}"))
    .to_vec()
}

/// What an assembly of these grains compiles on a GPU if its discs may `sleep`, or may not, as while they are prepared.
///
/// # Errors
/// Radii too unequal for the lists.
pub fn kernels_of<R: CudaReal>(grains: &Grains, sleep: bool) -> Result<Source, CudaAssemblyError> {
    Ok(kernels::<R>(rows(grains)?, grains.resist_rolling(), sleep))
}

fn kernels<R: CudaReal>(rows: usize, rolling: bool, sleep: bool) -> Source {
    let (text, defines) = (source::<R>(), defines::<R>(rows, rolling, sleep));
    Source { name: "assembly.cu", text, defines }
}

/// The kernels, loaded.
#[derive(Debug)]
pub(super) struct Kernels<R: CudaReal> {
    pub step: Function<Step<R>>,
    pub begin: Function<Begin<R>>,
    pub bins: Function<Bins<R>>,
    pub list: Function<List<R>>,
    pub finish: Function<Finish<R>>,
    pub quiet: Function<Quiet<R>>,
    pub count: Function<Count<R>>,
    pub scan: Function<Scan>,
    pub starts: Function<Starts<R>>,
    pub columns: Function<Columns<R>>,
    pub places: Function<Places<R>>,
    pub reorder: Function<Reorder<R>>,
    pub losses: Function<SumLosses<R>>,
    pub output: Function<WriteOutput<R>>,
    pub bin_grains: Function<BinGrains<R>>,
    pub order_bins: Function<OrderBins<R>>,
    pub means: Function<Means<R>>,
    pub energy: Function<SumEnergy<R>>,
}

impl<R: CudaReal> Kernels<R> {
    /// Compiles the kernels, or takes them from the cache.
    pub fn load(
        device: &Arc<Device>,
        rows: usize,
        rolling: bool,
        sleep: bool,
    ) -> Result<Self, gpu::Error> {
        let Source { name, text, defines } = kernels::<R>(rows, rolling, sleep);
        let module = device.module(name, &text, &defines)?;
        Ok(Self {
            step: Function::load(device, &module)?,
            begin: Function::load(device, &module)?,
            bins: Function::load(device, &module)?,
            list: Function::load(device, &module)?,
            finish: Function::load(device, &module)?,
            quiet: Function::load(device, &module)?,
            count: Function::load(device, &module)?,
            scan: Function::load(device, &module)?,
            starts: Function::load(device, &module)?,
            columns: Function::load(device, &module)?,
            places: Function::load(device, &module)?,
            reorder: Function::load(device, &module)?,
            losses: Function::load(device, &module)?,
            output: Function::load(device, &module)?,
            bin_grains: Function::load(device, &module)?,
            order_bins: Function::load(device, &module)?,
            means: Function::load(device, &module)?,
            energy: Function::load(device, &module)?,
        })
    }
}
