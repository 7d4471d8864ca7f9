//! An assembly in device memory.

use std::sync::Arc;

use cudarc::driver::{CudaEvent, CudaGraph, CudaSlice, PinnedHostSlice};
use gpu::{ConstPointer, Device, Launch, Pointer};

use super::abi::{
    Arrays, Binned, Body, Control, Disc, History, Loss, NEAR_BODIES, Output, Parameters,
    PlacedBody, Position, Rest,
};
use super::grid::{Grid, row_length};
use super::kernels::Kernels;
use super::points::DevicePoints;
use super::shared::Shared;
use crate::assembly::Losses;
use crate::cuda::real::CudaReal;

/// An assembly on a GPU: the twin of [`Assembly`](crate::assembly::Assembly).
///
/// State stays on the device between calls of [`advance`](Self::advance), each of which begins with a new
/// order of memory and a search: results have the same bits from run to run, and whether or not the
/// assembly was downloaded and uploaded in between.
pub struct CudaAssembly<R: CudaReal> {
    pub(super) device: Arc<Device>,
    pub(super) kernels: Kernels<R>,
    pub(super) p: Parameters<R>,
    pub(super) grid: Grid,
    pub(super) control: CudaSlice<Control<R>>,
    /// Discs with their contacts, and room for them in another order.
    pub(super) discs: DeviceDiscs<R>,
    pub(super) spare: DeviceDiscs<R>,
    pub(super) reference: CudaSlice<Position<R>>,
    pub(super) body: CudaSlice<Body>,
    pub(super) placed: CudaSlice<PlacedBody<R>>,
    pub(super) loss: CudaSlice<Loss>,
    /// One entry: of all discs, since the last fetch.
    pub(super) lost: CudaSlice<Loss>,
    /// Of each warp, the discs that steps leave out.
    pub(super) quiet: CudaSlice<u32>,
    /// Whether discs that rest are held.
    pub(super) sleeps: bool,
    pub(super) bin_count: CudaSlice<u32>,
    pub(super) binned: CudaSlice<Binned<R>>,
    pub(super) sorted: CudaSlice<R::Fraction>,
    pub(super) chunk: CudaSlice<u32>,
    pub(super) start: CudaSlice<u32>,
    pub(super) place_of: CudaSlice<u32>,
    pub(super) disc_at: CudaSlice<u32>,
    pub(super) output: CudaSlice<Output<R>>,
    /// The same on the host, and the sums in `lost`, of the last fetch.
    pub(super) fetched: PinnedHostSlice<Output<R>>,
    pub(super) fetched_losses: PinnedHostSlice<Loss>,
    /// The points whose means are wanted.
    pub(super) points: Option<DevicePoints<R>>,
    /// The end of a fetch under way.
    pub(super) fetch: Option<CudaEvent>,
    /// A round of steps, for each of the two sets of discs.
    pub(super) graphs: [Option<CudaGraph>; 2],
    /// Which of the sets is in use.
    pub(super) swapped: bool,
    /// Time of the device (s), steps and searches of the last sequence.
    pub(super) time: f64,
    pub(super) steps: u64,
    pub(super) searches: u64,
    /// Steps of single discs that were left out, since the last download.
    pub(super) skipped: u64,
    pub(super) last: Option<Control<R>>,
    /// Losses up to the last fetch.
    pub(super) losses: Losses,
    /// As one of several ranks. Dropped after the graphs, which hold its operations.
    pub(super) shared: Option<Shared>,
}

/// Arrays in the order of memory.
#[derive(Debug)]
pub(super) struct DeviceDiscs<R: CudaReal> {
    pub disc: CudaSlice<Disc<R>>,
    pub id: CudaSlice<u32>,
    pub list: CudaSlice<u32>,
    pub history: CudaSlice<History<R>>,
    pub near_bodies: CudaSlice<u32>,
    pub body_history: CudaSlice<History<R>>,
    /// One entry where discs do not sleep.
    pub rest: CudaSlice<Rest<R>>,
}

impl<R: CudaReal> DeviceDiscs<R> {
    pub fn zeros(
        device: &Device,
        discs: usize,
        grid: &Grid,
        sleeps: bool,
    ) -> Result<Self, gpu::Error> {
        let (rows, histories) = (grid.rows as usize, grid.histories());
        let row = row_length(discs);
        Ok(Self {
            disc: device.zeros(2 * discs)?,
            id: device.zeros(discs)?,
            list: device.zeros(rows * row)?,
            history: device.zeros(histories * rows * row)?,
            near_bodies: device.zeros(discs)?,
            body_history: device.zeros(histories * NEAR_BODIES * row)?,
            rest: device.zeros(if sleeps { discs } else { 1 })?,
        })
    }
}
impl<R: CudaReal> CudaAssembly<R> {
    /// Whether this is the only rank or the first one.
    pub fn is_first(&self) -> bool {
        self.shared.as_ref().is_none_or(Shared::is_first)
    }

    pub(super) fn arrays(&self) -> Arrays<R> {
        self.arrays_of(&self.discs)
    }

    pub(super) fn arrays_of(&self, discs: &DeviceDiscs<R>) -> Arrays<R> {
        let stream = self.device.stream();
        Arrays {
            control: Pointer::to(&self.control, stream),
            disc: Pointer::to(&discs.disc, stream),
            id: Pointer::to(&discs.id, stream),
            reference: Pointer::to(&self.reference, stream),
            list: Pointer::to(&discs.list, stream),
            history: Pointer::to(&discs.history, stream),
            near_bodies: Pointer::to(&discs.near_bodies, stream),
            body_history: Pointer::to(&discs.body_history, stream),
            rest: Pointer::to(&discs.rest, stream),
            quiet: Pointer::to(&self.quiet, stream),
            body: ConstPointer::to(&self.body, stream),
            placed: Pointer::to(&self.placed, stream),
            loss: Pointer::to(&self.loss, stream),
            bin_count: Pointer::to(&self.bin_count, stream),
            binned: Pointer::to(&self.binned, stream),
            sorted: Pointer::to(&self.sorted, stream),
        }
    }

    /// One thread for each disc.
    pub(super) fn over_all(&self, threads: u32) -> Launch {
        over([0, self.p.discs], threads)
    }
}

/// One thread for each of a range of discs.
pub(super) fn over([first, end]: [u32; 2], threads: u32) -> Launch {
    Launch::each((end - first) as usize, threads)
}
