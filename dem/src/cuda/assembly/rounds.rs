//! Rounds of steps with their searches, sorts and exchanges, queued on the device.

use cudarc::driver::sys::{CUgraphInstantiate_flags, CUstreamCaptureMode};
use cudarc::driver::{CudaGraph, CudaStream};
use gpu::{ConstPointer, Launch, Pointer};

use super::abi::{Control, Parameters, STEPS};
use super::error::CudaAssemblyError;
use super::kernels::{COPY_THREADS, THREADS};
use super::search::{Begin, Bins, Finish, List};
use super::shared::{Shared, bounds};
use super::sleep::Quiet;
use super::sort::{CHUNK, Columns, Count, Places, Reorder, SCAN_THREADS, Scan, Starts};
use super::state::{CudaAssembly, over};
use super::step::Step;
use crate::cuda::real::CudaReal;

impl<R: CudaReal> CudaAssembly<R> {
    /// Puts discs in the order of bins.
    pub(super) fn sort(&mut self) -> Result<(), CudaAssemblyError> {
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
        stream.memset_zeros(&mut self.quiet)?;
        std::mem::swap(&mut self.discs, &mut self.spare);
        self.swapped = !self.swapped;
        Ok(())
    }

    /// Divides discs among ranks in the new order.
    pub(super) fn divide(&mut self) -> Result<(), CudaAssemblyError> {
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
    pub(super) fn widen(&mut self, control: &Control<R>) -> Result<(), CudaAssemblyError> {
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
    pub(super) fn agree(&self) -> Result<(), CudaAssemblyError> {
        if let Some(shared) = &self.shared {
            shared.agree(&self.arrays())?;
        }
        Ok(())
    }

    /// Queues a search, in any case or where one is due, which ends a round.
    pub(super) fn search(&self, force: u32) -> Result<(), CudaAssemblyError> {
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
            if self.sleeps {
                self.kernels.quiet.launch(stream, listed, &Quiet { a, p, force })?;
            }
            self.kernels.finish.launch(stream, one, &Finish { a, p, force })?;
        }
        Ok(())
    }

    /// Queues rounds of steps.
    pub(super) fn rounds(&mut self, mut rounds: usize) -> Result<(), CudaAssemblyError> {
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
        // Exchanges keep the priority of their stream.
        let flags = CUgraphInstantiate_flags::CUDA_GRAPH_INSTANTIATE_FLAG_USE_NODE_PRIORITY;
        let graph = stream.end_capture(flags)?;
        queued?;
        graph.ok_or_else(|| gpu::Error::Driver("an empty graph".into()).into())
    }

    fn queue_round(&self) -> Result<(), CudaAssemblyError> {
        for k in 0..STEPS {
            match &self.shared {
                Some(shared) => self.shared_step(shared, k)?,
                None => self.step(self.device.stream(), self.p, k)?,
            }
        }
        self.search(0)
    }

    /// Queues step `k` of a round for the own discs of `p`.
    fn step(
        &self,
        stream: &CudaStream,
        p: Parameters<R>,
        k: usize,
    ) -> Result<(), CudaAssemblyError> {
        let mut launch = over(p.own, THREADS).early(self.shared.is_none());
        // One more block moves the bodies; the parts of a rank all move them to the same places.
        launch.grid[0] += p.bodies_move;
        let arguments = Step { a: self.arrays(), p, k: k as u32 };
        // SAFETY: arrays are as long as the numbers of discs say.
        unsafe { self.kernels.step.launch(stream, launch, &arguments) }?;
        Ok(())
    }

    /// Queues a step of one of several ranks: discs that others receive advance first, and are on their way while
    /// the inner ones advance.
    fn shared_step(&self, shared: &Shared, k: usize) -> Result<(), CudaAssemblyError> {
        let (stream, beside) = (self.device.stream(), shared.beside());
        let (inner, outer) = shared.parts();
        beside.join(stream)?;
        self.step(beside, Parameters { own: bounds(inner), ..self.p }, k)?;
        for part in outer.into_iter().filter(|part| !part.is_empty()) {
            self.step(stream, Parameters { own: bounds(part), ..self.p }, k)?;
        }
        shared.exchange(&self.arrays(), k)?;
        stream.join(beside)?;
        shared.agree_on_moves(&self.arrays(), k)?;
        Ok(())
    }
}
