//! Assemblies to the device, and what is fetched from it.

use std::sync::Arc;

use gpu::ranks::Ranks;
use gpu::{Device, Launch, Pointer};
use rayon::prelude::*;

use super::abi::{Body, Control, Output};
use super::energy::SUM_THREADS;
use super::error::CudaAssemblyError;
use super::grid::Grid;
use super::kernels::{COPY_THREADS, Kernels};
use super::losses::SumLosses;
use super::output::WriteOutput;
use super::parameters::{bytes, parameters};
use super::shared::Shared;
use super::sort::CHUNK;
use super::state::{CudaAssembly, DeviceDiscs};
use super::transfer::Host;
use crate::assembly::{Assembly, Energy, GrainState};
use crate::cuda::real::CudaReal;
use crate::cuda::shape::WARP;

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
        // Ranks would have to tell each other which discs are held.
        let sleep = assembly.sleep.as_ref().filter(|_| ranks.is_none());
        let sleeps = sleep.is_some();
        device.reserve(bytes::<R>(count, &grid))?;
        let host = Host::from_assembly(assembly, &grid, sleeps);
        let mut discs = DeviceDiscs::zeros(device, count, &grid, sleeps)?;
        let stream = device.stream();
        stream.memcpy_htod(&host.disc, &mut discs.disc.slice_mut(..count))?;
        stream.memcpy_htod(&host.id, &mut discs.id)?;
        stream.memcpy_htod(&host.list, &mut discs.list)?;
        stream.memcpy_htod(&host.history, &mut discs.history)?;
        stream.memcpy_htod(&host.near_bodies, &mut discs.near_bodies)?;
        stream.memcpy_htod(&host.body_history, &mut discs.body_history)?;
        if sleeps {
            stream.memcpy_htod(&host.rest, &mut discs.rest)?;
        }
        let bodies: Vec<Body> = assembly.bodies.iter().map(Body::from).collect();
        let kernels = Kernels::load(device, rows, grid.rolling, sleeps)?;
        let shared = ranks.map(|ranks| Shared::new(device, ranks, &grid, count)).transpose()?;
        let p = parameters(assembly, &grid, bodies.len(), sleep);
        Ok(Self {
            kernels,
            p: shared.as_ref().map_or(p, |shared| shared.parameters(&p)),
            grid,
            control: device.upload(&[Control::sequence(0.0, 0, None)])?,
            spare: DeviceDiscs::zeros(device, count, &grid, sleeps)?,
            discs,
            reference: device.zeros(count)?,
            body: device.upload(&bodies)?,
            placed: device.zeros(2 * bodies.len())?,
            loss: device.zeros(count.div_ceil(WARP))?,
            lost: device.zeros(1)?,
            quiet: device.zeros(count.div_ceil(WARP))?,
            sleeps,
            bin_count: device.zeros(2 * grid.count())?,
            binned: device.zeros(grid.capacity as usize * grid.count())?,
            sorted: device.zeros(count)?,
            chunk: device.zeros(grid.count().div_ceil(CHUNK))?,
            start: device.zeros(grid.count())?,
            place_of: device.zeros(count)?,
            disc_at: device.zeros(count)?,
            output: device.zeros(assembly.len())?,
            fetched: device.pinned(assembly.len())?,
            fetched_losses: device.pinned(1)?,
            points: None,
            fetch: None,
            graphs: [None, None],
            swapped: false,
            time: assembly.time(),
            steps: 0,
            searches: 0,
            skipped: 0,
            last: None,
            losses: assembly.losses,
            shared,
            device: device.clone(),
        })
    }

    /// Device memory that an assembly takes (bytes).
    ///
    /// # Errors
    /// Radii too unequal for the lists.
    pub fn bytes(assembly: &Assembly<R>) -> Result<usize, CudaAssemblyError> {
        Ok(bytes::<R>(assembly.discs.len(), &Grid::of(assembly)?))
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

    /// Copies the states of all grains to the host, for [`states`](Self::states).
    ///
    /// # Errors
    /// A kernel failed.
    pub fn fetch_states(&mut self) -> Result<(), CudaAssemblyError> {
        self.queue_states()?;
        self.await_states()
    }

    /// Queues that the states of all grains are copied to the host; more steps can be queued behind.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn queue_states(&mut self) -> Result<(), CudaAssemblyError> {
        self.write_output()?;
        let stream = self.device.stream().clone();
        stream.memcpy_dtoh(&self.output, &mut self.fetched)?;
        self.fetch = Some(stream.record_event(None)?);
        Ok(())
    }

    /// Queues that the states of all grains are written on the device, and losses copied to the host.
    pub(super) fn write_output(&mut self) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream().clone();
        let launch = self.over_all(COPY_THREADS);
        let output = Pointer::to(&self.output, &stream);
        let arguments = WriteOutput { a: self.arrays(), p: self.p, output };
        // SAFETY: the output has one entry for each grain that can move.
        unsafe { self.kernels.output.launch(&stream, launch, &arguments) }?;
        self.queue_losses()
    }

    /// Waits for states that were queued.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn await_states(&mut self) -> Result<(), CudaAssemblyError> {
        if let Some(fetch) = self.fetch.take() {
            fetch.synchronize()?;
            self.add_losses()?;
        }
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

    /// Queues that the losses of the last sequence of steps are added to the totals.
    pub(super) fn sum_losses(&self) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream();
        let launch = Launch::each(self.loss.len(), COPY_THREADS);
        let total = Pointer::to(&self.lost, stream);
        let arguments = SumLosses { a: self.arrays(), p: self.p, total };
        // SAFETY: one entry for each warp of discs.
        unsafe { self.kernels.losses.launch(stream, launch, &arguments) }?;
        Ok(())
    }

    /// Queues that what was lost since the last call is copied to the host.
    fn queue_losses(&mut self) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream().clone();
        self.sum_losses()?;
        stream.memcpy_dtoh(&self.lost, &mut self.fetched_losses)?;
        stream.memset_zeros(&mut self.lost)?;
        Ok(())
    }

    /// Adds up the losses that were copied. Sums of sequences are added one by one, so that they have the same bits
    /// after a download.
    fn add_losses(&mut self) -> Result<(), CudaAssemblyError> {
        let unit = R::to_f64(self.p.per_joule);
        for lost in self.fetched_losses.as_slice()? {
            self.losses += lost.in_joules(unit);
        }
        Ok(())
    }

    /// Brings the assembly that was uploaded up to date.
    ///
    /// # Errors
    /// A kernel failed.
    pub fn download_into(&mut self, assembly: &mut Assembly<R>) -> Result<(), CudaAssemblyError> {
        let stream = self.device.stream().clone();
        self.queue_losses()?;
        stream.synchronize()?;
        self.add_losses()?;
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
            rest: if self.sleeps { stream.clone_dtoh(&self.discs.rest)? } else { Vec::new() },
        }
        .write_to(assembly, &self.grid);
        assembly.time = self.time;
        assembly.steps += std::mem::take(&mut self.steps);
        assembly.searches += std::mem::take(&mut self.searches);
        assembly.skipped += std::mem::take(&mut self.skipped);
        if let Some(control) = &self.last {
            assembly.max_overlap = assembly.max_overlap.max(control.overlap());
            assembly.audit = assembly.audit.max(control.audit());
        }
        Ok(())
    }
}
