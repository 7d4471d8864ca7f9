//! NCCL's collective operations between ranks.

use std::io::{Read, Write};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use cudarc::driver::{CudaSlice, DevicePtr, DevicePtrMut, DeviceRepr};
use cudarc::nccl::{result, sys};

use super::environment::Environment;
use super::error::RanksError;
use super::rendezvous::{Fingerprint, rendezvous};
use super::watchdog::Watchdog;
use crate::device::Device;
use crate::pointer::{ConstPointer, Pointer};

/// What a reduction makes of the numbers of all ranks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reduction {
    /// The smallest one.
    Least,
    /// The largest one.
    Largest,
    /// Their sum, modulo 2 to the number of their bits.
    Sum,
}

/// This process among its peers. Methods marked *collective* have to be called by all ranks, in the
/// same order.
#[derive(Debug)]
pub struct Ranks {
    rank: usize,
    size: usize,
    device: Arc<Device>,
    communicator: sys::ncclComm_t,
    /// `None` once all ranks are done.
    watchdog: Mutex<Option<Watchdog>>,
}

// SAFETY: NCCL allows calls from any thread, one at a time. One thread at a time advances a simulation
// and so makes collective calls.
unsafe impl Send for Ranks {}
// SAFETY: as above.
unsafe impl Sync for Ranks {}

impl Ranks {
    /// Joins the other ranks and waits until all have joined. From then on this process ends if
    /// another rank ends before [`all_done`](Self::all_done). A long wait is reported to `waiting` as by
    /// [`rendezvous`]. Collective.
    ///
    /// # Errors
    /// NCCL is missing, ranks are missing, or their fingerprints differ.
    pub fn join(
        environment: &Environment,
        device: &Arc<Device>,
        fingerprint: &Fingerprint,
        waiting: impl FnOnce(&str),
    ) -> Result<Self, RanksError> {
        // SAFETY: loads the library, whose initialisers have no preconditions, and unloads it.
        if !unsafe { sys::is_culib_present() } {
            return Err(RanksError::NcclMissing);
        }
        let mut peers = rendezvous(environment, fingerprint, waiting)?;
        let mut id = sys::ncclUniqueId { internal: [0; 128] };
        if environment.rank == 0 {
            id = result::get_uniqueid().map_err(RanksError::nccl("creating an id"))?;
        }
        let mut bytes = id.internal.map(|byte| byte as u8);
        for (place, peer) in peers.iter_mut().enumerate() {
            let (given, other) = match environment.rank {
                0 => (peer.write_all(&bytes), place + 1),
                _ => (peer.read_exact(&mut bytes), 0),
            };
            given.map_err(|source| RanksError::Lost { rank: environment.rank, other, source })?;
        }
        id.internal = bytes.map(|byte| byte as std::ffi::c_char);
        device.context().bind_to_thread()?;
        let mut communicator = std::ptr::null_mut();
        // SAFETY: writes the pointer; the context is current.
        unsafe {
            result::comm_init_rank(
                &raw mut communicator,
                environment.size as i32,
                id,
                environment.rank as i32,
            )
        }
        .map_err(RanksError::nccl("joining the ranks"))?;
        let Environment { rank, size, .. } = *environment;
        let watchdog = Watchdog::start(rank, peers);
        let watchdog = watchdog.map_err(|source| RanksError::Lost { rank, other: 0, source })?;
        Ok(Self {
            rank,
            size,
            device: device.clone(),
            communicator,
            watchdog: Mutex::new(Some(watchdog)),
        })
    }

    /// Number of this rank, from 0.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Number of ranks.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Whether this is rank 0, which writes files and messages.
    pub fn is_first(&self) -> bool {
        self.rank == 0
    }

    /// Largest share of a rank if the ranks divide `count` items.
    pub fn chunk(&self, count: usize) -> usize {
        count.div_ceil(self.size)
    }

    /// This rank's share of `count` items: [`chunk`](Self::chunk) of them, fewer on the last ranks.
    pub fn slice(&self, count: usize) -> Range<usize> {
        slice(self.rank, self.size, count)
    }

    /// Queues an all-gather on the device's stream: rank `k` sends part `k` of `buffer` and receives
    /// the other parts. Collective; may be captured in a graph.
    ///
    /// # Errors
    /// NCCL failed or a rank is gone.
    ///
    /// # Panics
    /// If the length of the buffer is no multiple of the number of ranks.
    pub fn all_gather<T: DeviceRepr>(&self, buffer: &mut CudaSlice<T>) -> Result<(), RanksError> {
        assert_eq!(buffer.len() % self.size, 0, "equal parts");
        let part = buffer.len() / self.size * size_of::<T>();
        let stream = self.device.stream();
        self.device.context().bind_to_thread()?;
        let (address, _synchronised) = buffer.device_ptr_mut(stream);
        // SAFETY: the part lies in the buffer, which lives until the stream is done with it.
        unsafe {
            result::all_gather(
                (address + (self.rank * part) as u64) as *const _,
                address as *mut _,
                part,
                sys::ncclDataType_t::ncclUint8,
                self.communicator,
                stream.cu_stream().cast(),
            )
        }
        .map_err(RanksError::nccl("gathering"))?;
        Ok(())
    }

    /// Queues an all-reduce on the device's stream: `list` becomes the sum of the lists of all ranks.
    /// Collective; may be captured in a graph. All ranks get the same bits, and a repetition with as
    /// many ranks on the same machine gets them again.
    ///
    /// # Errors
    /// NCCL failed or a rank is gone.
    pub fn all_reduce(&self, list: &mut CudaSlice<f32>) -> Result<(), RanksError> {
        let (stream, count) = (self.device.stream(), list.len());
        self.device.context().bind_to_thread()?;
        let (address, _synchronised) = list.device_ptr_mut(stream);
        // SAFETY: the list lives until the stream is done with it.
        unsafe {
            result::all_reduce(
                address as *const _,
                address as *mut _,
                count,
                sys::ncclDataType_t::ncclFloat32,
                sys::ncclRedOp_t::ncclSum,
                self.communicator,
                stream.cu_stream().cast(),
            )
        }
        .map_err(RanksError::nccl("adding"))?;
        Ok(())
    }

    /// Queues as one operation what `operations` queue with [`send`](Self::send),
    /// [`receive`](Self::receive), [`broadcast`](Self::broadcast) and [`reduce`](Self::reduce). Collective; may
    /// be captured in a graph, but not the first one: only then do ranks connect.
    ///
    /// # Errors
    /// NCCL failed or a rank is gone.
    pub fn group(
        &self,
        operations: impl FnOnce() -> Result<(), RanksError>,
    ) -> Result<(), RanksError> {
        self.device.context().bind_to_thread()?;
        result::group_start().map_err(RanksError::nccl("beginning a group"))?;
        let queued = operations();
        // Always ended: NCCL would add all that follows to the group.
        let ended = result::group_end().map_err(RanksError::nccl("exchanging"));
        queued?;
        ended?;
        Ok(())
    }

    /// Sends `count` entries to another rank, which has to [receive](Self::receive) as many; in a
    /// [group](Self::group).
    ///
    /// # Errors
    /// NCCL failed.
    ///
    /// # Safety
    /// The entries lie in device memory that lives until the stream is done with it.
    pub unsafe fn send<T>(
        &self,
        from: ConstPointer<T>,
        count: usize,
        peer: usize,
    ) -> Result<(), RanksError> {
        let (address, stream) = (from.address() as *const _, self.device.stream().cu_stream());
        // SAFETY: the caller's.
        unsafe {
            let (bytes, kind) = (count * size_of::<T>(), sys::ncclDataType_t::ncclUint8);
            result::send(address, bytes, kind, peer as i32, self.communicator, stream.cast())
        }
        .map_err(RanksError::nccl("sending"))?;
        Ok(())
    }

    /// Receives `count` entries from another rank; in a [group](Self::group).
    ///
    /// # Errors
    /// NCCL failed.
    ///
    /// # Safety
    /// As of [`send`](Self::send); nobody else uses them in the meantime.
    pub unsafe fn receive<T>(
        &self,
        to: Pointer<T>,
        count: usize,
        peer: usize,
    ) -> Result<(), RanksError> {
        let (address, stream) = (to.address() as *mut _, self.device.stream().cu_stream());
        // SAFETY: the caller's.
        unsafe {
            let (bytes, kind) = (count * size_of::<T>(), sys::ncclDataType_t::ncclUint8);
            result::recv(address, bytes, kind, peer as i32, self.communicator, stream.cast())
        }
        .map_err(RanksError::nccl("receiving"))?;
        Ok(())
    }

    /// Replaces `count` entries by those of rank 0. Collective; in a [group](Self::group).
    ///
    /// # Errors
    /// NCCL failed.
    ///
    /// # Safety
    /// As of [`receive`](Self::receive).
    pub unsafe fn broadcast<T>(&self, list: Pointer<T>, count: usize) -> Result<(), RanksError> {
        let (address, stream) = (list.address() as *mut _, self.device.stream().cu_stream());
        // SAFETY: the caller's.
        unsafe {
            let (bytes, kind) = (count * size_of::<T>(), sys::ncclDataType_t::ncclUint8);
            result::broadcast(address, address, bytes, kind, 0, self.communicator, stream.cast())
        }
        .map_err(RanksError::nccl("sending to all"))?;
        Ok(())
    }

    /// Replaces a `u32` or `u64` by the smallest or largest one of all ranks. Collective; in a
    /// [group](Self::group).
    ///
    /// # Errors
    /// NCCL failed.
    ///
    /// # Panics
    /// If `T` has neither 4 nor 8 bytes.
    ///
    /// # Safety
    /// As of [`receive`](Self::receive).
    pub unsafe fn reduce<T>(
        &self,
        number: Pointer<T>,
        reduction: Reduction,
    ) -> Result<(), RanksError> {
        let (address, stream) = (number.address() as *mut _, self.device.stream().cu_stream());
        let kind = match size_of::<T>() {
            4 => sys::ncclDataType_t::ncclUint32,
            8 => sys::ncclDataType_t::ncclUint64,
            bytes => panic!("a number of {bytes} bytes"),
        };
        let operation = match reduction {
            Reduction::Least => sys::ncclRedOp_t::ncclMin,
            Reduction::Largest => sys::ncclRedOp_t::ncclMax,
            Reduction::Sum => sys::ncclRedOp_t::ncclSum,
        };
        // SAFETY: the caller's.
        unsafe {
            let stream = stream.cast();
            result::all_reduce(address, address, 1, kind, operation, self.communicator, stream)
        }
        .map_err(RanksError::nccl("comparing"))?;
        Ok(())
    }

    /// Replaces numbers in host memory by their sums over all ranks, and waits. Collective.
    ///
    /// # Errors
    /// As [`all_reduce`](Self::all_reduce).
    pub fn sum_on_host(&self, values: &mut [f32]) -> Result<(), RanksError> {
        let mut list = self.device.upload(values)?;
        self.all_reduce(&mut list)?;
        self.device.stream().memcpy_dtoh(&list, values)?;
        Ok(self.device.stream().synchronize()?)
    }

    /// Gathers one number from every rank, in the order of ranks. Collective.
    ///
    /// # Errors
    /// As [`all_gather`](Self::all_gather).
    pub fn numbers(&self, own: u64) -> Result<Vec<u64>, RanksError> {
        let mut numbers = vec![0; self.size];
        numbers[self.rank] = own;
        let mut on_device = self.device.upload(&numbers)?;
        self.all_gather(&mut on_device)?;
        Ok(self.device.stream().clone_dtoh(&on_device)?)
    }

    /// Whether `own` is true on any rank. Collective.
    ///
    /// # Errors
    /// As [`all_gather`](Self::all_gather).
    pub fn any(&self, own: bool) -> Result<bool, RanksError> {
        Ok(self.numbers(own.into())?.contains(&1))
    }

    /// Stops the watchdog: ranks may end. Data on its way to another rank still arrives.
    pub fn all_done(&self) {
        if let Some(mut watchdog) = self.watchdog().take() {
            watchdog.goodbye();
        }
    }

    fn watchdog(&self) -> MutexGuard<'_, Option<Watchdog>> {
        self.watchdog.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gathers bytes of all ranks on rank 0; the others get nothing. Collective.
    ///
    /// # Errors
    /// As [`all_gather`](Self::all_gather), or too little memory on the GPU of rank 0.
    pub fn to_first(&self, own: Vec<u8>) -> Result<Vec<Vec<u8>>, RanksError> {
        let lengths = self.numbers(own.len() as u64)?;
        let stream = self.device.stream();
        self.device.context().bind_to_thread()?;
        if self.rank > 0 {
            if !own.is_empty() {
                let sent = self.device.upload(&own)?;
                let (address, _synchronised) = sent.device_ptr(stream);
                // SAFETY: the buffer lives until the stream is done with it.
                unsafe {
                    let kind = sys::ncclDataType_t::ncclUint8;
                    let (bytes, stream) = (own.len(), stream.cu_stream().cast());
                    result::send(address as *const _, bytes, kind, 0, self.communicator, stream)
                }
                .map_err(RanksError::nccl("sending to rank 0"))?;
                stream.synchronize()?;
            }
            return Ok(Vec::new());
        }
        let mut all = vec![own];
        for (peer, &bytes) in lengths.iter().enumerate().skip(1) {
            if bytes == 0 {
                all.push(Vec::new());
                continue;
            }
            let mut received = self.device.zeros::<u8>(bytes as usize)?;
            {
                let (address, _synchronised) = received.device_ptr_mut(stream);
                // SAFETY: the buffer has the size that the peer sends.
                unsafe {
                    let kind = sys::ncclDataType_t::ncclUint8;
                    let (bytes, stream) = (bytes as usize, stream.cu_stream().cast());
                    let peer = peer as i32;
                    result::recv(address as *mut _, bytes, kind, peer, self.communicator, stream)
                }
                .map_err(RanksError::nccl("receiving on rank 0"))?;
            }
            all.push(stream.clone_dtoh(&received)?);
        }
        Ok(all)
    }
}

impl Drop for Ranks {
    fn drop(&mut self) {
        let done = self.watchdog().is_none();
        // SAFETY: called once. A rank that failed aborts: it does not wait for the others.
        let _ = unsafe {
            if done {
                result::comm_destroy(self.communicator)
            } else {
                result::comm_abort(self.communicator)
            }
        };
    }
}

fn slice(rank: usize, size: usize, count: usize) -> Range<usize> {
    let chunk = count.div_ceil(size);
    (rank * chunk).min(count)..((rank + 1) * chunk).min(count)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Slices follow each other without gaps, and part `k` of a buffer of equal parts begins
        /// where slice `k` does.
        #[test]
        fn slices_cover_all_once(count in 1_usize..5000, size in 1_usize..64) {
            let chunk = count.div_ceil(size);
            let mut next = 0;
            for rank in 0..size {
                let own = slice(rank, size, count);
                prop_assert_eq!(own.start, next);
                prop_assert!(own.len() <= chunk);
                prop_assert!(own.is_empty() || own.start == rank * chunk);
                next = own.end;
            }
            prop_assert_eq!(next, count);
            prop_assert!(chunk * size >= count);
        }
    }
}
