//! The advance of an assembly on a GPU.

use gpu::Pointer;

use super::abi::{Control, Failure, STEPS};
use super::error::CudaAssemblyError;
use super::parameters::CACHED;
use super::state::CudaAssembly;
use crate::assembly::{AssemblyError, GrainFailure, Region};
use crate::cuda::real::CudaReal;

/// Rounds queued beyond those that the last steps took, where they cost less than to wait for the host.
const SPARE_ROUNDS: usize = 2;

impl<R: CudaReal> CudaAssembly<R> {
    /// Sets the time (s) of the next step.
    pub fn set_time(&mut self, time: f64) {
        self.time = time;
    }

    /// As [`Assembly::set_drag`](crate::assembly::Assembly::set_drag), from the next steps on.
    pub fn set_drag(&mut self, rate: f64) {
        let drag = R::from_f64(rate);
        if self.p.drag != drag {
            self.p.drag = drag;
            // Graphs hold the arguments of their kernels.
            self.graphs = [None, None];
        }
    }

    /// Sets the part of the skin, below a half, up to which a disc counts as not moved since the last search. Lists are
    /// made anew only around discs that have moved, and more often, as less of the skin is left for them. By default 0.1
    /// for scenes that do not fit into the cache, otherwise 0.
    pub fn set_stayed(&mut self, part: f64) {
        self.p.set_stayed(part);
        // As above.
        self.graphs = [None, None];
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

    /// Rounds to queue for so many steps: as many as the last steps took, as searches interrupt rounds. One that is not
    /// needed costs some 20 kernels that do nothing; one that is missing waits for the host.
    fn expected_rounds(&self, steps: usize) -> usize {
        let least = steps.div_ceil(STEPS);
        let as_last = |last: Control<R>| {
            (steps * last.rounds as usize).div_ceil(last.made().max(1) as usize).max(least)
        };
        match self.last {
            // Ranks exchange even where no step is made; of many discs, kernels that do nothing take longer than the host.
            Some(last) if self.shared.is_some() || self.p.discs as usize > CACHED => as_last(last),
            Some(last) => as_last(last) + SPARE_ROUNDS,
            None => least + least / 4 + 1,
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
                self.skipped += control.skipped;
                self.searches += u64::from(control.searches - self.parity_searches());
                self.time += f64::from(control.made()) * self.p.dt;
                self.last = Some(control);
                self.gather()?;
                return Ok(());
            }
            let left = (control.target - control.steps) as usize;
            self.rounds(left.div_ceil(STEPS) + 1)?;
        }
    }

    /// Gives the first of several ranks what all have.
    fn gather(&mut self) -> Result<(), CudaAssemblyError> {
        let Some(shared) = &self.shared else { return Ok(()) };
        shared.gather_all(&self.arrays())?;
        self.sum_losses()?;
        let stream = self.device.stream().clone();
        shared.reduce_losses(Pointer::to(&self.lost, &stream))?;
        if !shared.is_first() {
            stream.memset_zeros(&mut self.lost)?;
        }
        Ok(())
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

    /// Largest overlap over the smaller radius since the upload.
    pub fn max_overlap(&self) -> f64 {
        self.last.map_or(0.0, |c| c.overlap())
    }

    /// Steps of single grains since the last download that were left out, as nothing around them moved.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Largest displacement of a grain since the upload that was computed though it would have been held (m).
    pub fn audit(&self) -> f64 {
        self.last.map_or(0.0, |c| c.audit())
    }

    /// Searches since the last download.
    pub fn searches(&self) -> u64 {
        self.searches
    }

    /// Which set of counts the next search finds empty: the parity of all searches so far.
    fn parity_searches(&self) -> u32 {
        self.last.map_or(0, |c| c.searches & 1)
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
