//! One scene on several GPUs, one process (rank) per GPU. Every rank makes the MPM step of all points and
//! advances its slice of the packings, where most of the work is. The states of all packings are then
//! gathered, so that all ranks continue with the same numbers: the result is bitwise independent of the
//! number of ranks.

use std::ops::Range;
use std::sync::Arc;

use cudarc::driver::{CudaSlice, CudaView};
use dem::RveBatch;
use dem::cuda::{CudaError, CudaReal, CudaRveBatch, Room, State};
use gpu::Device;
use gpu::ranks::Ranks;

/// A batch on one GPU, or on one of several: the twin of [`RveBatch`].
pub struct RankedRveBatch<R: CudaReal> {
    device: Arc<Device>,
    /// The packings of this rank.
    own: CudaRveBatch<R>,
    range: Range<usize>,
    /// Packings on all ranks.
    count: usize,
    shared: Option<Shared>,
}

/// The data that ranks exchange in every step, in equal parts.
struct Shared {
    ranks: Arc<Ranks>,
    states: CudaSlice<State>,
    failed: CudaSlice<i32>,
}

impl<R: CudaReal> RankedRveBatch<R> {
    /// Copies the packings of this rank to its GPU; all of them without `ranks`.
    ///
    /// # Errors
    /// If there are more ranks than packings, or [`CudaRveBatch::upload`] fails.
    pub fn upload(
        device: &Arc<Device>,
        batch: &RveBatch<R>,
        room: Room,
        ranks: Option<&Arc<Ranks>>,
    ) -> Result<Self, CudaError> {
        let count = batch.rves.len();
        let device = device.clone();
        let Some(ranks) = ranks else {
            let own = CudaRveBatch::upload_with_room(&device, batch, room)?;
            return Ok(Self { device, own, range: 0..count, count, shared: None });
        };
        let range = ranks.slice(count);
        if range.is_empty() {
            let ranks = ranks.size();
            return Err(failed(format!("{count} points cannot be shared by {ranks} ranks")));
        }
        let slice = RveBatch {
            parameters: batch.parameters.clone(),
            rves: batch.rves[range.clone()].to_vec(),
            fresh: batch.fresh.clone(),
        };
        let states = vec![State::default(); ranks.chunk(count) * ranks.size()];
        let shared = Shared {
            ranks: ranks.clone(),
            states: device.upload(&states)?,
            failed: device.upload(&vec![i32::MAX; ranks.size()])?,
        };
        let own = CudaRveBatch::upload_with_room(&device, &slice, room)?;
        Ok(Self { device, own, range, count, shared: Some(shared) })
    }

    /// Queues one macro step of `dt` (s) of all packings under velocity gradients in device memory
    /// (1/s; xx, xy, yx, yy of each) on the device's stream, up to the gathering of their states.
    /// May be captured in a graph.
    ///
    /// # Errors
    /// The launch was refused, or a peer is gone.
    pub fn launch(&mut self, dt: f64, velocity_gradient: &CudaView<f64>) -> Result<(), CudaError> {
        let stream = self.device.stream();
        let Range { start, end } = self.range;
        self.own.launch(stream, dt, &velocity_gradient.slice(4 * start..4 * end))?;
        let Some(Shared { ranks, states, failed: first }) = &mut self.shared else {
            return Ok(());
        };
        let own = self.own.device_states().slice(..end - start);
        stream.memcpy_dtod(&own, &mut states.slice_mut(start..end))?;
        let rank = ranks.rank();
        stream.memcpy_dtod(self.own.failed(), &mut first.slice_mut(rank..=rank))?;
        ranks.all_gather(states).map_err(failed)?;
        ranks.all_gather(first).map_err(failed)
    }

    /// States of all packings after the last launch.
    pub fn device_states(&self) -> &CudaSlice<State> {
        self.shared.as_ref().map_or_else(|| self.own.device_states(), |shared| &shared.states)
    }

    /// For each rank the first of its packings that failed, counted from its own first one, which
    /// is number `rank * chunk` of all; larger than all while none has.
    pub fn failed(&self) -> &CudaSlice<i32> {
        self.shared.as_ref().map_or_else(|| self.own.failed(), |shared| &shared.failed)
    }

    /// Most packings of a rank.
    pub fn chunk(&self) -> usize {
        self.shared.as_ref().map_or(self.count, |shared| shared.ranks.chunk(self.count))
    }

    /// Copies all packings back to rank 0, for a checkpoint; `None` on the others.
    ///
    /// # Errors
    /// A failure of a device or of a rank.
    pub fn download(&self) -> Result<Option<RveBatch<R>>, CudaError> {
        let mut batch = self.own.download()?;
        let Some(Shared { ranks, .. }) = &self.shared else { return Ok(Some(batch)) };
        let mine = match ranks.is_first() {
            true => Vec::new(),
            false => postcard::to_stdvec(&batch.rves).map_err(failed)?,
        };
        let all = ranks.to_first(mine).map_err(failed)?;
        if !ranks.is_first() {
            return Ok(None);
        }
        for part in &all[1..] {
            let rves: Vec<dem::Rve<R>> = postcard::from_bytes(part).map_err(failed)?;
            batch.rves.extend(rves);
        }
        Ok(Some(batch))
    }

    /// The reason why a packing failed, known to its rank and to rank 0; other ranks know the rank only.
    ///
    /// # Errors
    /// A failure of a device or of a rank.
    pub fn failure(&self, packing: usize) -> Result<String, CudaError> {
        let reason = |own: usize| -> Result<String, CudaError> {
            Ok(match self.own.failure(own)? {
                CudaError::Rve { failure, .. } => failure.to_string(),
                other => other.to_string(),
            })
        };
        let Some(Shared { ranks, .. }) = &self.shared else { return reason(packing) };
        let rank = packing / self.chunk();
        let mut mine = String::new();
        if rank == ranks.rank() {
            mine = reason(packing - self.range.start)?;
        }
        let told = ranks.to_first(mine.clone().into_bytes()).map_err(failed)?;
        let told = told.get(rank).map(|text| String::from_utf8_lossy(text).into_owned());
        let known = [Some(mine), told].into_iter().flatten().find(|reason| !reason.is_empty());
        Ok(known.unwrap_or_else(|| format!("it failed on rank {rank}")))
    }
}

/// An error that is not the failure of a packing.
fn failed(error: impl std::fmt::Display) -> CudaError {
    CudaError::Gpu(gpu::Error::Driver(error.to_string()))
}

#[cfg(test)]
mod tests {
    use gpu::ranks::{Environment, RanksError};

    use super::*;

    /// The way through NCCL, with one rank: where there is one GPU only.
    #[test]
    fn gathered_states_are_those_of_the_batch() {
        let Some(device) = gpu::for_tests() else { return };
        let environment =
            Environment { rank: 0, size: 1, local_rank: 0, address: ("127.0.0.1".to_owned(), 0) };
        let ranks = match Ranks::join(&environment, &device, &[0; 32], |_| ()) {
            Ok(ranks) => Arc::new(ranks),
            Err(RanksError::NcclMissing) => {
                eprintln!("skipped: {}", RanksError::NcclMissing);
                return;
            }
            Err(error) => panic!("{error}"),
        };
        assert_eq!(ranks.numbers(7).unwrap(), [7]);
        assert_eq!(ranks.to_first(vec![1, 2, 3]).unwrap(), [vec![1, 2, 3]]);

        let p = dem::RveParameters { discs: 60, ..dem::RveParameters::default() };
        let fresh: dem::Packing<f32> = dem::consolidate(&p, 1).unwrap().convert();
        let rves = vec![dem::Rve::new(fresh.clone()); 5];
        let batch = RveBatch { parameters: p, rves, fresh: vec![fresh] };
        let run = |ranks: Option<&Arc<Ranks>>| {
            let mut twin = RankedRveBatch::upload(&device, &batch, Room::Usual, ranks).unwrap();
            let gradients: Vec<f64> = (1..=5).flat_map(|k| [0.0, f64::from(k), 0.0, 0.0]).collect();
            let gradients = device.upload(&gradients).unwrap();
            (0..50).for_each(|_| twin.launch(1.0e-4, &gradients.as_view()).unwrap());
            let states = device.stream().clone_dtoh(twin.device_states()).unwrap();
            let states: Vec<_> = states.into_iter().map(dem::RveState::from).collect();
            (states, twin.download().unwrap())
        };
        assert_eq!(run(Some(&ranks)), run(None));
    }
}
