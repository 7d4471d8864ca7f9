//! The packings of all points, of which this rank advances its slice.

use std::ops::Range;
use std::sync::Arc;

use cudarc::driver::CudaSlice;
use dem::cuda::{CudaError, CudaReal, CudaRveBatch, DeviceState};
use dem::{RveBatch, RveState};
use gpu::Device;
use mpm::{Mat2, MaterialError};

use super::{Ranks, RanksError};

/// A batch on one GPU, or on one of several: the twin of [`RveBatch`].
pub struct RankedRveBatch<R: CudaReal> {
    device: Arc<Device>,
    /// The packings of this rank.
    own: CudaRveBatch<R>,
    range: Range<usize>,
    shared: Option<Shared>,
}

/// What several ranks exchange in every step, in equal parts.
struct Shared {
    ranks: Arc<Ranks>,
    states: CudaSlice<DeviceState>,
    /// For each rank the first of its packings that failed, counted from its own first one.
    failed: CudaSlice<i32>,
    /// Velocity gradients of this rank's packings: xx, xy, yx, yy of each.
    gradient: CudaSlice<f64>,
}

impl<R: CudaReal> RankedRveBatch<R> {
    /// Copies the packings of this rank to its GPU; all of them without `ranks`.
    ///
    /// # Errors
    /// More ranks than packings, or what [`CudaRveBatch::upload`] says.
    pub fn upload(
        device: &Arc<Device>,
        batch: &RveBatch<R>,
        ranks: Option<&Arc<Ranks>>,
    ) -> Result<Self, MaterialError> {
        let count = batch.rves.len();
        let range = ranks.map_or(0..count, |ranks| ranks.slice(count));
        let shared = ranks
            .map(|ranks| {
                if range.is_empty() {
                    return Err(RanksError::TooMany { points: count, ranks: ranks.size() });
                }
                let states = vec![DeviceState::default(); ranks.chunk(count) * ranks.size()];
                Ok(Shared {
                    ranks: ranks.clone(),
                    states: device.upload(&states)?,
                    failed: device.upload(&vec![i32::MAX; ranks.size()])?,
                    gradient: device.zeros(4 * range.len())?,
                })
            })
            .transpose()
            .map_err(other)?;
        let own = match &shared {
            None => CudaRveBatch::upload(device, batch),
            Some(_) => CudaRveBatch::upload(
                device,
                &RveBatch {
                    parameters: batch.parameters.clone(),
                    rves: batch.rves[range.clone()].to_vec(),
                    fresh: batch.fresh.clone(),
                },
            ),
        };
        Ok(Self { device: device.clone(), own: own.map_err(other)?, range, shared })
    }

    /// Advances packing `p` of all by `dt` (s) under `velocity_gradient[p]` (1/s) into `states[p]`.
    ///
    /// # Errors
    /// The packing of lowest index that failed, on every rank, or a failure of a device.
    pub fn advance(
        &mut self,
        dt: f64,
        velocity_gradient: &[Mat2],
        states: &mut [RveState],
    ) -> Result<(), MaterialError> {
        let gradient = &velocity_gradient[self.range.clone()];
        let Some(shared) = &mut self.shared else {
            return self.own.advance(dt, gradient, states).map_err(|error| failure(error, 0));
        };
        let stream = self.device.stream();
        let flat: Vec<f64> =
            gradient.iter().flat_map(|l| [l[(0, 0)], l[(0, 1)], l[(1, 0)], l[(1, 1)]]).collect();
        stream.memcpy_htod(&flat, &mut shared.gradient).map_err(gpu::Error::from).map_err(other)?;
        self.own.launch(stream, dt, &shared.gradient).map_err(other)?;
        shared.gather(&self.device, &self.own, &self.range).map_err(other)?;

        let failed = stream.clone_dtoh(&shared.failed).map_err(gpu::Error::from).map_err(other)?;
        if let Some((rank, first)) = shared.first_failure(&failed, velocity_gradient.len()) {
            return Err(shared.explain(rank, first, &self.own, self.range.start));
        }
        let gathered =
            stream.clone_dtoh(&shared.states).map_err(gpu::Error::from).map_err(other)?;
        for (state, new) in states.iter_mut().zip(gathered) {
            *state = new.into();
        }
        Ok(())
    }

    /// Copies all packings back to rank 0, for a checkpoint; `None` on the others.
    ///
    /// # Errors
    /// A failure of a device or of a rank.
    pub fn download(&self) -> Result<Option<RveBatch<R>>, MaterialError> {
        let mut batch = self.own.download().map_err(other)?;
        let Some(Shared { ranks, .. }) = &self.shared else { return Ok(Some(batch)) };
        let mine = match ranks.is_first() {
            true => Vec::new(),
            false => postcard::to_stdvec(&batch.rves).map_err(other)?,
        };
        let all = ranks.to_first(mine).map_err(other)?;
        if !ranks.is_first() {
            return Ok(None);
        }
        for part in &all[1..] {
            let rves: Vec<dem::Rve<R>> = postcard::from_bytes(part).map_err(other)?;
            batch.rves.extend(rves);
        }
        Ok(Some(batch))
    }
}

impl Shared {
    /// The states of all packings, and what failed, to every rank.
    fn gather<R: CudaReal>(
        &mut self,
        device: &Device,
        own: &CudaRveBatch<R>,
        range: &Range<usize>,
    ) -> Result<(), RanksError> {
        let stream = device.stream();
        let source = own.device_states().slice(..range.len());
        stream.memcpy_dtod(&source, &mut self.states.slice_mut(range.clone()))?;
        let rank = self.ranks.rank();
        stream.memcpy_dtod(own.failed(), &mut self.failed.slice_mut(rank..=rank))?;
        self.ranks.all_gather(&mut self.states)?;
        self.ranks.all_gather(&mut self.failed)
    }

    /// Rank and packing, counted over all, of the first failure. Slices ascend with the ranks.
    fn first_failure(&self, failed: &[i32], count: usize) -> Option<(usize, usize)> {
        let chunk = self.ranks.chunk(count);
        let found = |(rank, &own): (usize, &i32)| {
            let own = usize::try_from(own).ok().filter(|own| *own < chunk)?;
            Some((rank, rank * chunk + own))
        };
        failed.iter().enumerate().find_map(found)
    }

    /// The reason of a failure, which its rank tells rank 0.
    fn explain<R: CudaReal>(
        &self,
        rank: usize,
        point: usize,
        own: &CudaRveBatch<R>,
        first: usize,
    ) -> MaterialError {
        let mine = match own.check().map_err(|error| failure(error, first)) {
            Err(MaterialError::Point { reason, .. }) if rank == self.ranks.rank() => reason,
            _ => String::new(),
        };
        let told = self.ranks.to_first(mine.clone().into_bytes()).unwrap_or_default();
        let told = told.get(rank).map(|text| String::from_utf8_lossy(text).into_owned());
        let known = [Some(mine), told].into_iter().flatten().find(|reason| !reason.is_empty());
        let reason = known.unwrap_or_else(|| format!("it failed on rank {rank}"));
        MaterialError::Point { point, reason }
    }
}

/// A failure of a batch whose first packing is number `first` of all.
fn failure(error: CudaError, first: usize) -> MaterialError {
    match error {
        CudaError::Rve { rve, failure, .. } => {
            MaterialError::Point { point: first + rve, reason: failure.to_string() }
        }
        error => other(error),
    }
}

fn other(error: impl std::error::Error + Send + Sync + 'static) -> MaterialError {
    MaterialError::Other(Box::new(error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ranks::Launch;

    /// The way through NCCL, with one rank: where there is one GPU only.
    #[test]
    fn gathered_states_are_those_of_the_batch() {
        let Some(device) = gpu::for_tests() else { return };
        let launch =
            Launch { rank: 0, size: 1, local_rank: 0, address: ("127.0.0.1".to_owned(), 0) };
        let ranks = match Ranks::join(&launch, &device) {
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
        let batch = RveBatch { parameters: p, rves, fresh };
        let run = |ranks: Option<&Arc<Ranks>>| {
            let mut twin = RankedRveBatch::upload(&device, &batch, ranks).unwrap();
            let gradients: Vec<Mat2> =
                (1..=5).map(|k| Mat2::new(0.0, f64::from(k), 0.0, 0.0)).collect();
            let mut states = vec![RveState::default(); 5];
            (0..50).for_each(|_| twin.advance(1.0e-4, &gradients, &mut states).unwrap());
            (states, twin.download().unwrap())
        };
        assert_eq!(run(Some(&ranks)), run(None));
    }
}
