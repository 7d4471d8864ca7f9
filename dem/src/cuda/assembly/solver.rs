//! An assembly in device memory.

use std::sync::Arc;

use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use cudarc::driver::{CudaGraph, CudaSlice, PinnedHostSlice};
use gpu::ranks::Ranks;
use gpu::{ConstPointer, Device, Launch, Pointer};
use rayon::prelude::*;

use super::abi::{
    Arrays, Binned, Body, Control, Disc, Failure, History, Loss, NEAR_BODIES, Output, Parameters,
    PlacedBody, Position, RareLoss, STEPS,
};
use super::error::CudaAssemblyError;
use super::grid::{Grid, row_length};
use super::kernels::{Kernels, THREADS};
use super::losses::{LOSSES, SUM_THREADS, SumLosses};
use super::output::WriteOutput;
use super::parameters::{bytes, parameters};
use super::search::{Begin, Bins, Finish, List};
use super::shared::Shared;
use super::sort::{CHUNK, Columns, Count, Places, Reorder, SCAN_THREADS, Scan, Starts};
use super::step::Step;
use super::transfer::Host;
use crate::assembly::{Assembly, AssemblyError, Energy, GrainFailure, GrainState, Losses, Region};
use crate::cuda::real::CudaReal;

/// Threads of the blocks of searches and copies.
const COPY_THREADS: u32 = 128;

/// An assembly on a GPU: the twin of [`Assembly`].
///
/// State stays on the device between calls of [`advance`](Self::advance), each of which begins with a new
/// order of memory and a search: results have the same bits from run to run, and whether or not the
/// assembly was downloaded and uploaded in between.
pub struct CudaAssembly<R: CudaReal> {
    device: Arc<Device>,
    kernels: Kernels<R>,
    p: Parameters<R>,
    grid: Grid,
    control: CudaSlice<Control<R>>,
    /// Discs with their contacts, and room for them in another order.
    discs: DeviceDiscs<R>,
    spare: DeviceDiscs<R>,
    reference: CudaSlice<Position<R>>,
    body: CudaSlice<Body>,
    placed: CudaSlice<PlacedBody<R>>,
    loss: CudaSlice<Loss<R>>,
    rare_loss: CudaSlice<RareLoss<R>>,
    /// By block of [`SUM_THREADS`] discs, since the last fetch.
    lost: CudaSlice<f64>,
    bin_count: CudaSlice<u32>,
    binned: CudaSlice<Binned<R>>,
    sorted: CudaSlice<R::Fraction>,
    chunk: CudaSlice<u32>,
    start: CudaSlice<u32>,
    place_of: CudaSlice<u32>,
    disc_at: CudaSlice<u32>,
    output: CudaSlice<Output<R>>,
    /// The same on the host, of the last fetch.
    fetched: PinnedHostSlice<Output<R>>,
    /// A round of steps, for each of the two sets of discs.
    graphs: [Option<CudaGraph>; 2],
    /// Which of the sets is in use.
    swapped: bool,
    /// Time of the device (s), steps and searches of the last sequence.
    time: f64,
    steps: u64,
    searches: u64,
    last: Option<Control<R>>,
    /// Losses up to the last fetch.
    losses: Losses,
    /// As one of several ranks. Dropped after the graphs, which hold its operations.
    shared: Option<Shared>,
}

/// Arrays in the order of memory.
#[derive(Debug)]
struct DeviceDiscs<R: CudaReal> {
    disc: CudaSlice<Disc<R>>,
    id: CudaSlice<u32>,
    list: CudaSlice<u32>,
    history: CudaSlice<History<R>>,
    near_bodies: CudaSlice<u32>,
    body_history: CudaSlice<History<R>>,
}

impl<R: CudaReal> DeviceDiscs<R> {
    fn zeros(device: &Device, discs: usize, grid: &Grid) -> Result<Self, gpu::Error> {
        let (rows, histories) = (grid.rows as usize, grid.histories());
        let row = row_length(discs);
        Ok(Self {
            disc: device.zeros(2 * discs)?,
            id: device.zeros(discs)?,
            list: device.zeros(rows * row)?,
            history: device.zeros(histories * rows * row)?,
            near_bodies: device.zeros(discs)?,
            body_history: device.zeros(histories * NEAR_BODIES * row)?,
        })
    }
}

impl<R: CudaReal> CudaAssembly<R> {
    /// Copies an assembly to the GPU.
    ///
    /// # Errors
    /// Too little memory; radii too unequal for the lists; no compiler.
    pub fn upload(device: &Arc<Device>, assembly: &Assembly<R>) -> Result<Self, CudaAssemblyError> {
        Self::upload_on(device, assembly, None)
    }

    /// As [`upload`](Self::upload); as one of several ranks, to advance a part of the discs. Calls of
    /// [`queue`](Self::queue), [`finish`](Self::finish) and [`advance`](Self::advance) are then collective, and
    /// only [the first](Self::is_first) of the ranks can fetch states and losses or download.
    ///
    /// # Errors
    /// As [`upload`](Self::upload).
    pub fn upload_on(
        device: &Arc<Device>,
        assembly: &Assembly<R>,
        ranks: Option<&Arc<Ranks>>,
    ) -> Result<Self, CudaAssemblyError> {
        let count = assembly.discs.len();
        if count >= 1 << 31 {
            return Err(CudaAssemblyError::TooMany(count));
        }
        let grid = Grid::of(assembly)?;
        let rows = grid.rows as usize;
        device.reserve(bytes::<R>(count, &grid))?;
        let host = Host::from_assembly(assembly, &grid);
        let mut discs = DeviceDiscs::zeros(device, count, &grid)?;
        let stream = device.stream();
        stream.memcpy_htod(&host.disc, &mut discs.disc.slice_mut(..count))?;
        stream.memcpy_htod(&host.id, &mut discs.id)?;
        stream.memcpy_htod(&host.list, &mut discs.list)?;
        stream.memcpy_htod(&host.history, &mut discs.history)?;
        stream.memcpy_htod(&host.near_bodies, &mut discs.near_bodies)?;
        stream.memcpy_htod(&host.body_history, &mut discs.body_history)?;
        let bodies: Vec<Body> = assembly.bodies.iter().map(Body::from).collect();
        let kernels = Kernels::load(device, rows, grid.rolling)?;
        let shared = ranks.map(|ranks| Shared::new(device, ranks, &grid, count)).transpose()?;
        let p = parameters(assembly, &grid, bodies.len());
        Ok(Self {
            kernels,
            p: shared.as_ref().map_or(p, |shared| shared.parameters(&p)),
            grid,
            control: device.upload(&[Control::sequence(0.0, 0, None)])?,
            spare: DeviceDiscs::zeros(device, count, &grid)?,
            discs,
            reference: device.zeros(count)?,
            body: device.upload(&bodies)?,
            placed: device.zeros(2 * bodies.len())?,
            loss: device.zeros(count)?,
            rare_loss: device.zeros(count)?,
            lost: device.zeros(LOSSES * count.div_ceil(SUM_THREADS as usize))?,
            bin_count: device.zeros(2 * grid.count())?,
            binned: device.zeros(grid.capacity as usize * grid.count())?,
            sorted: device.zeros(count)?,
            chunk: device.zeros(grid.count().div_ceil(CHUNK))?,
            start: device.zeros(grid.count())?,
            place_of: device.zeros(count)?,
            disc_at: device.zeros(count)?,
            output: device.zeros(assembly.len())?,
            fetched: device.pinned(assembly.len())?,
            graphs: [None, None],
            swapped: false,
            time: assembly.time(),
            steps: 0,
            searches: 0,
            last: None,
            losses: assembly.losses,
            shared,
            device: device.clone(),
        })
    }

    /// Whether this is the only rank or the first one.
    pub fn is_first(&self) -> bool {
        self.shared.as_ref().is_none_or(Shared::is_first)
    }

    /// Device memory that an assembly takes (bytes).
    ///
    /// # Errors
    /// Radii too unequal for the lists.
    pub fn bytes(assembly: &Assembly<R>) -> Result<usize, CudaAssemblyError> {
        Ok(bytes::<R>(assembly.discs.len(), &Grid::of(assembly)?))
    }

    /// Sets the time (s) of the next step.
    pub fn set_time(&mut self, time: f64) {
        self.time = time;
    }

    /// As [`Assembly::set_drag`], from the next steps on.
    pub fn set_drag(&mut self, rate: f64) {
        let drag = R::from_f64(rate);
        if self.p.drag != drag {
            self.p.drag = drag;
            // Graphs hold the arguments of their kernels.
            self.graphs = [None, None];
        }
    }

    /// As [`Assembly::agitation`].
    ///
    /// # Errors
    /// A kernel failed.
    pub fn agitation(
        &mut self,
        assembly: &Assembly<R>,
        gravity: f64,
    ) -> Result<f64, CudaAssemblyError> {
        self.fetch_states()?;
        let grains = self.fetched.as_slice()?.iter().map(|o| (o.inv_mass, [o.vx, o.vy]));
        Ok(assembly.agitation_of(grains, gravity))
    }

    /// Queues `steps` DEM steps; [`finish`](Self::finish) waits for them and makes those that searches have
    /// delayed.
    ///
    /// # Errors
    /// A launch was refused.
    pub fn queue(&mut self, steps: usize) -> Result<(), CudaAssemblyError> {
        let control = Control::sequence(self.time, steps as u32, self.last.as_ref());
        let arrays = self.arrays();
        if let Some(shared) = &mut self.shared {
            shared.make_equal(&arrays)?;
        }
        let stream = self.device.stream().clone();
        stream.memcpy_htod(&[control], &mut self.control)?;
        self.sort()?;
        self.divide()?;
        self.search(1)?;
        self.rounds(self.expected_rounds(steps))
    }

    /// Rounds to queue for so many steps: searches interrupt rounds.
    fn expected_rounds(&self, steps: usize) -> usize {
        let least = steps.div_ceil(STEPS);
        match self.last {
            // Ranks exchange even where no step is made: as many as the last steps took.
            Some(last) if self.shared.is_some() => {
                (steps * last.rounds as usize).div_ceil(last.made().max(1) as usize).max(least)
            }
            _ => least + least / 4 + 1,
        }
    }

    /// Waits for queued steps.
    ///
    /// # Errors
    /// A grain failed, as on the CPU; the assembly then stands still.
    pub fn finish(&mut self) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream().clone();
        loop {
            self.agree()?;
            let control = stream.clone_dtoh(&self.control)?[0];
            if control.failed != u64::MAX {
                return Err(self.failure(&control)?);
            }
            if self.shared.is_some() && control.drift > self.p.margin {
                self.widen(&control)?;
                continue;
            }
            if control.steps >= control.target {
                self.steps += u64::from(control.made());
                self.searches += u64::from(control.searches - self.parity_searches());
                self.time += f64::from(control.made()) * self.p.dt;
                self.last = Some(control);
                if let Some(shared) = &self.shared {
                    shared.gather_all(&self.arrays())?;
                }
                return Ok(());
            }
            let left = (control.target - control.steps) as usize;
            self.rounds(left.div_ceil(STEPS) + 1)?;
        }
    }

    /// Advances by `steps` DEM steps.
    ///
    /// # Errors
    /// As [`finish`](Self::finish).
    pub fn advance(&mut self, steps: usize) -> Result<(), CudaAssemblyError> {
        if steps == 0 {
            return Ok(());
        }
        self.queue(steps)?;
        self.finish()
    }

    /// Copies the states of all grains to the host, for [`states`](Self::states). More steps can be queued
    /// before those are asked for.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn fetch_states(&mut self) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream().clone();
        let launch = self.over_all(COPY_THREADS);
        let output = Pointer::to(&self.output, &stream);
        let arguments = WriteOutput { a: self.arrays(), p: self.p, output };
        // SAFETY: the output has one entry for each grain that can move.
        unsafe { self.kernels.output.launch(&stream, launch, &arguments) }?;
        stream.memcpy_dtoh(&self.output, &mut self.fetched)?;
        self.fetch_losses()?;
        stream.synchronize()?;
        Ok(())
    }

    /// State of each grain that was last fetched, in the order of
    /// [`Packed::grains`](crate::assembly::Packed::grains), and the energy. `assembly` is the one that was
    /// uploaded.
    ///
    /// # Errors
    /// The device failed.
    pub fn states(
        &self,
        assembly: &Assembly<R>,
    ) -> Result<(Vec<GrainState>, Energy), CudaAssemblyError> {
        let fetched = self.fetched.as_slice()?;
        let states: Vec<GrainState> = fetched.par_iter().map(|o| o.state(assembly)).collect();
        let mut energy = Energy { losses: self.losses, ..assembly.energy_of(&states) };
        let elastic = |part: &[Output<R>]| part.iter().map(|o| o.elastic.to_f64()).sum::<f64>();
        let parts: Vec<f64> = fetched.par_chunks(SUM_THREADS as usize).map(elastic).collect();
        energy.elastic = parts.iter().sum();
        Ok((states, energy))
    }

    /// Adds up what was lost since the last call, after all queued work. Sums of sequences are added one by one, so
    /// that they have the same bits after a download.
    fn fetch_losses(&mut self) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream().clone();
        let launch = self.over_all(SUM_THREADS);
        let total = Pointer::to(&self.lost, &stream);
        let arguments = SumLosses { a: self.arrays(), p: self.p, total };
        // SAFETY: totals have as many entries as there are blocks.
        unsafe { self.kernels.losses.launch(&stream, launch, &arguments) }?;
        for block in stream.clone_dtoh(&self.lost)?.chunks(LOSSES) {
            self.losses += Losses {
                dashpots: block[0],
                friction: block[1],
                damping: block[2],
                boxes: block[3],
            };
        }
        stream.memset_zeros(&mut self.lost)?;
        Ok(())
    }

    /// Brings the assembly that was uploaded up to date.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn download_into(&mut self, assembly: &mut Assembly<R>) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream().clone();
        self.fetch_losses()?;
        assembly.losses = self.losses;
        let count = self.p.discs as usize;
        // Ranks end their rounds with the first buffer.
        let parity = self.last.map_or(0, |c| c.steps as usize & 1);
        let from = if self.shared.is_some() { 0 } else { parity * count };
        Host {
            disc: stream.clone_dtoh(&self.discs.disc.slice(from..from + count))?,
            id: stream.clone_dtoh(&self.discs.id)?,
            list: stream.clone_dtoh(&self.discs.list)?,
            history: stream.clone_dtoh(&self.discs.history)?,
            near_bodies: stream.clone_dtoh(&self.discs.near_bodies)?,
            body_history: stream.clone_dtoh(&self.discs.body_history)?,
        }
        .write_to(assembly, &self.grid);
        assembly.time = self.time;
        assembly.steps += std::mem::take(&mut self.steps);
        assembly.searches += std::mem::take(&mut self.searches);
        if let Some(control) = &self.last {
            assembly.max_overlap = assembly.max_overlap.max(control.overlap());
        }
        Ok(())
    }

    /// Largest overlap over the smaller radius since the upload.
    pub fn max_overlap(&self) -> f64 {
        self.last.map_or(0.0, |c| c.overlap())
    }

    /// Searches since the last download.
    pub fn searches(&self) -> u64 {
        self.searches
    }

    /// Which set of counts the next search finds empty: the parity of all searches so far.
    fn parity_searches(&self) -> u32 {
        self.last.map_or(0, |c| c.searches & 1)
    }

    /// Puts discs in the order of bins.
    fn sort(&mut self) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream().clone();
        let a = self.arrays();
        let all = [0, self.p.discs];
        let p = Parameters { own: all, window: all, margin: R::Fraction::default(), ..self.p };
        let chunk = Pointer::to(&self.chunk, &stream);
        let start = Pointer::to(&self.start, &stream);
        let place_of = Pointer::to(&self.place_of, &stream);
        let disc_at = Pointer::to(&self.disc_at, &stream);
        let chunks = self.grid.count().div_ceil(CHUNK) as u32;
        let blocks = Launch::blocks(chunks, SCAN_THREADS);
        let each = self.over_all(COPY_THREADS);
        let b = self.arrays_of(&self.spare);
        let k = &self.kernels;
        // SAFETY: arrays are as long as the numbers of discs, bins and chunks say.
        unsafe {
            k.begin.launch(&stream, Launch::blocks(1, 32), &Begin { a, p })?;
            // Losses are by place.
            let total = Pointer::to(&self.lost, &stream);
            k.losses.launch(&stream, self.over_all(SUM_THREADS), &SumLosses { a, p, total })?;
            k.bins.launch(&stream, each, &Bins { a, p, force: 1 })?;
            k.count.launch(&stream, blocks, &Count { a, p, chunk })?;
            k.scan.launch(&stream, Launch::blocks(1, SCAN_THREADS), &Scan { chunk, chunks })?;
            let starts = Starts { a, p, chunk: chunk.into(), start };
            k.starts.launch(&stream, blocks, &starts)?;
            let places = Places { a, p, start: start.into(), place_of, disc_at };
            k.places.launch(&stream, each, &places)?;
            let (place_of, disc_at) = (place_of.into(), disc_at.into());
            k.reorder.launch(&stream, each, &Reorder { a, b, p, place_of, disc_at })?;
        }
        // The search that follows counts anew.
        stream.memset_zeros(&mut self.bin_count)?;
        std::mem::swap(&mut self.discs, &mut self.spare);
        self.swapped = !self.swapped;
        Ok(())
    }

    /// Divides discs among ranks in the new order.
    fn divide(&mut self) -> Result<(), CudaAssemblyError> {
        let Some(shared) = &mut self.shared else { return Ok(()) };
        let stream = self.device.stream();
        let start = ConstPointer::to(&self.start, stream);
        let arguments = Columns { p: self.p, start, column: Pointer::to(shared.column(), stream) };
        // SAFETY: one number for each column of tiles.
        unsafe {
            self.kernels.columns.launch(stream, Launch::blocks(1, COPY_THREADS), &arguments)
        }?;
        let columns = stream.clone_dtoh(shared.column())?;
        shared.divide(&columns);
        self.take_share();
        Ok(())
    }

    /// Makes the search that is due after discs have moved too far for the windows of ranks.
    fn widen(&mut self, control: &Control<R>) -> Result<(), CudaAssemblyError> {
        let arrays = self.arrays();
        let Some(shared) = &mut self.shared else { return Ok(()) };
        shared.gather_discs(&arrays)?;
        shared.widen(R::fraction_to_f64(control.drift) * f64::from(self.grid.bins));
        self.take_share();
        let control = Control { drift: R::Fraction::default(), ..*control };
        let stream = self.device.stream();
        stream.memcpy_htod(&[control], &mut self.control)?;
        stream.memset_zeros(&mut self.bin_count)?;
        self.search(1)
    }

    /// Sets the constants of this rank's share.
    fn take_share(&mut self) {
        let Some(shared) = &self.shared else { return };
        let p = shared.parameters(&self.p);
        let share = |p: &Parameters<R>| (p.ranked, p.own, p.window, p.margin);
        if share(&p) != share(&self.p) {
            // Graphs hold the arguments of their kernels and the addresses of what ranks exchange.
            self.graphs = [None, None];
            self.p = p;
        }
    }

    /// Queues that all ranks learn what concerns all.
    fn agree(&self) -> Result<(), CudaAssemblyError> {
        if let Some(shared) = &self.shared {
            shared.agree(&self.arrays())?;
        }
        Ok(())
    }

    /// Queues a search, in any case or where one is due, which ends a round.
    fn search(&self, force: u32) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream();
        let (a, p) = (self.arrays(), self.p);
        let early = self.shared.is_none();
        let binned = over(p.window, COPY_THREADS).early(early);
        let listed = over(p.own, COPY_THREADS).early(early);
        let one = Launch::blocks(1, 1).early(early);
        // SAFETY: arrays are as long as the numbers of discs and bins say.
        unsafe {
            self.kernels.bins.launch(stream, binned, &Bins { a, p, force })?;
            self.agree()?;
            self.kernels.list.launch(stream, listed, &List { a, p, force })?;
            self.kernels.finish.launch(stream, one, &Finish { a, p, force })?;
        }
        Ok(())
    }

    /// Queues rounds of steps.
    fn rounds(&mut self, mut rounds: usize) -> Result<(), CudaAssemblyError> {
        let set = usize::from(self.swapped);
        if self.graphs[set].is_none() {
            if self.shared.is_some() && rounds > 0 {
                // Ranks connect outside of a capture.
                self.queue_round()?;
                rounds -= 1;
            }
            self.graphs[set] = Some(self.capture()?);
        }
        if let Some(graph) = &self.graphs[set] {
            for _ in 0..rounds {
                graph.launch()?;
            }
        }
        Ok(())
    }

    /// One round as a graph.
    fn capture(&self) -> Result<CudaGraph, CudaAssemblyError> {
        let stream = self.device.stream();
        stream.begin_capture(CUstreamCaptureMode::CU_STREAM_CAPTURE_MODE_THREAD_LOCAL)?;
        let queued = self.queue_round();
        // Always ended: a stream in capture mode is unusable.
        let graph = stream.end_capture(CUgraphInstantiate_flags(0))?;
        queued?;
        graph.ok_or_else(|| gpu::Error::Driver("an empty graph".into()).into())
    }

    fn queue_round(&self) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream();
        let (a, p) = (self.arrays(), self.p);
        let mut launch = over(p.own, THREADS).early(self.shared.is_none());
        // One more block moves the bodies.
        launch.grid[0] += p.bodies_move;
        for k in 0..STEPS {
            let arguments = Step { a, p, k: k as u32 };
            // SAFETY: arrays are as long as the numbers of discs say.
            unsafe { self.kernels.step.launch(stream, launch, &arguments) }?;
            if let Some(shared) = &self.shared {
                shared.exchange(&a, k)?;
            }
        }
        self.search(0)
    }

    /// One thread for each disc.
    fn over_all(&self, threads: u32) -> Launch {
        over([0, self.p.discs], threads)
    }

    fn arrays(&self) -> Arrays<R> {
        self.arrays_of(&self.discs)
    }

    fn arrays_of(&self, discs: &DeviceDiscs<R>) -> Arrays<R> {
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
            body: ConstPointer::to(&self.body, stream),
            placed: Pointer::to(&self.placed, stream),
            loss: Pointer::to(&self.loss, stream),
            rare_loss: Pointer::to(&self.rare_loss, stream),
            bin_count: Pointer::to(&self.bin_count, stream),
            binned: Pointer::to(&self.binned, stream),
            sorted: Pointer::to(&self.sorted, stream),
        }
    }

    /// The grain that failed first.
    fn failure(&self, control: &Control<R>) -> Result<CudaAssemblyError, CudaAssemblyError> {
        let step = self.steps + (control.failed >> 36) - u64::from(control.first);
        let kind = control.failed >> 32 & 15;
        let id = control.failed as u32;
        let grain = id as usize;
        let stream = self.device.stream();
        let full = |what| CudaAssemblyError::Full { step, grain, what };
        let failure = match kind {
            Failure::NOT_FINITE => GrainFailure::NotFinite,
            Failure::LEAK => GrainFailure::Leak,
            Failure::OVERLAP => GrainFailure::Overlap(control.overlap()),
            Failure::LIST_FULL => return Ok(full("grains")),
            Failure::BODIES_FULL => return Ok(full("walls and boxes")),
            _ => return Ok(full("grains in one place")),
        };
        if let Some(shared) = &self.shared {
            shared.gather_discs(&self.arrays())?;
        }
        let ids = stream.clone_dtoh(&self.discs.id)?;
        let at = ids.iter().position(|&i| i == id).unwrap_or(0);
        let place = stream.clone_dtoh(&self.discs.disc.slice(at..=at))?[0].place;
        let region = Region { origin: self.p.origin, side: self.p.side };
        let position = region.decode::<R>([place.x, place.y]);
        Ok(AssemblyError::Grain { step, grain, position, failure }.into())
    }
}

/// One thread for each of a range of discs.
fn over([first, end]: [u32; 2], threads: u32) -> Launch {
    Launch::each((end - first) as usize, threads)
}
