//! Several processes (ranks) that work together, one on each GPU, joined by NCCL. How they are
//! started ([`Launch`]) and find each other ([`meet`]) serves ranks without GPUs too.

mod launch;
mod lifeline;
mod meeting;

use std::ffi::CStr;
use std::io::{Read, Write};
use std::ops::Range;
use std::sync::{Arc, Mutex};

use cudarc::driver::{CudaSlice, DevicePtr, DevicePtrMut, DeviceRepr};
use cudarc::nccl::{result, sys};

pub use self::launch::{Launch, LaunchError};
use self::lifeline::Lifeline;
pub use self::meeting::{Fingerprint, meet};
use crate::{Device, Error};

/// Why ranks could not work together.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum RanksError {
    #[error(transparent)]
    Launch(#[from] LaunchError),
    #[error("rank {rank}: {action} {address}")]
    #[diagnostic(help(
        "all ranks have to be started, and MASTER_ADDR and MASTER_PORT to name a free port of the host of rank 0 that all hosts can reach"
    ))]
    Meeting { rank: usize, action: &'static str, address: String, source: std::io::Error },
    #[error("rank {rank} does not belong to rank 0: {why}")]
    #[diagnostic(help("all ranks have to be started by one launcher, or in the same way"))]
    Stranger { rank: usize, why: &'static str },
    #[error("several ranks need NCCL, and libnccl.so was not found")]
    #[diagnostic(help(
        "add its folder to LD_LIBRARY_PATH; where there is only libnccl.so.2, link it to that name"
    ))]
    NcclMissing,
    #[error("rank {rank} has lost rank {other}")]
    Lost { rank: usize, other: usize, source: std::io::Error },
    #[error("NCCL, {action}: {reason}")]
    #[diagnostic(help("each rank needs a GPU of its own"))]
    Nccl { action: &'static str, reason: String },
    #[error("another rank failed; see its message")]
    Other,
    #[error(transparent)]
    Gpu(#[from] Error),
}

impl RanksError {
    fn nccl(action: &'static str) -> impl Fn(result::NcclError) -> Self {
        move |error| {
            // SAFETY: returns a static text for every code.
            let text = unsafe { CStr::from_ptr(sys::ncclGetErrorString(error.0)) };
            Self::Nccl { action, reason: text.to_string_lossy().into_owned() }
        }
    }
}

impl From<cudarc::driver::DriverError> for RanksError {
    fn from(error: cudarc::driver::DriverError) -> Self {
        Self::Gpu(error.into())
    }
}

/// This process among its peers. All methods but [`rank`](Self::rank), [`size`](Self::size),
/// [`chunk`](Self::chunk) and [`slice`](Self::slice) are collective: every rank calls them in the
/// same order.
#[derive(Debug)]
pub struct Ranks {
    rank: usize,
    size: usize,
    device: Arc<Device>,
    communicator: sys::ncclComm_t,
    /// `None` once all ranks have come to the end.
    lifeline: Mutex<Option<Lifeline>>,
}

// SAFETY: a communicator may be used from any thread, one at a time. A simulation is advanced by
// one thread at a time, and so are its collective calls.
unsafe impl Send for Ranks {}
// SAFETY: as above.
unsafe impl Sync for Ranks {}

impl Ranks {
    /// Joins the peers, who are about to do what has the same fingerprint; waits until all are
    /// there. From then on this process ends if another rank ends before
    /// [`all_done`](Self::all_done).
    ///
    /// # Errors
    /// NCCL is missing, or the peers are not found or do something else.
    pub fn join(
        launch: &Launch,
        device: &Arc<Device>,
        fingerprint: &Fingerprint,
    ) -> Result<Self, RanksError> {
        // SAFETY: loads the library, whose initialisers have no preconditions, and unloads it.
        if !unsafe { sys::is_culib_present() } {
            return Err(RanksError::NcclMissing);
        }
        let mut peers = meet(launch, fingerprint)?;
        let mut id = sys::ncclUniqueId { internal: [0; 128] };
        if launch.rank == 0 {
            id = result::get_uniqueid().map_err(RanksError::nccl("making an id"))?;
        }
        let mut bytes = id.internal.map(|byte| byte as u8);
        for (place, peer) in peers.iter_mut().enumerate() {
            let (given, other) = match launch.rank {
                0 => (peer.write_all(&bytes), place + 1),
                _ => (peer.read_exact(&mut bytes), 0),
            };
            given.map_err(|source| RanksError::Lost { rank: launch.rank, other, source })?;
        }
        id.internal = bytes.map(|byte| byte as std::ffi::c_char);
        device.context().bind_to_thread()?;
        let mut communicator = std::ptr::null_mut();
        // SAFETY: writes the pointer; the context is current.
        unsafe {
            result::comm_init_rank(
                &raw mut communicator,
                launch.size as i32,
                id,
                launch.rank as i32,
            )
        }
        .map_err(RanksError::nccl("joining the ranks"))?;
        let Launch { rank, size, .. } = *launch;
        let lifeline = Lifeline::watch(rank, peers);
        let lifeline = lifeline.map_err(|source| RanksError::Lost { rank, other: 0, source })?;
        Ok(Self {
            rank,
            size,
            device: device.clone(),
            communicator,
            lifeline: Mutex::new(Some(lifeline)),
        })
    }

    /// Number of this rank, from 0. Rank 0 writes files and speaks.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// How many ranks there are.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Whether this rank writes files and speaks.
    pub fn is_first(&self) -> bool {
        self.rank == 0
    }

    /// Most of `count` items that a rank has.
    pub fn chunk(&self, count: usize) -> usize {
        count.div_ceil(self.size)
    }

    /// The items of this rank out of `count`: all ranks have [`chunk`](Self::chunk) of them, but
    /// for the last ones, which have the rest.
    pub fn slice(&self, count: usize) -> Range<usize> {
        slice(self.rank, self.size, count)
    }

    /// Queues a gathering of equal parts on the device's stream: rank `k` gives part `k` of
    /// `buffer` and gets all others. May be captured in a graph.
    ///
    /// # Errors
    /// NCCL refuses, or a peer is gone.
    ///
    /// # Panics
    /// If the buffer cannot be divided equally.
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

    /// Queues the sum of the lists of all ranks, which takes the place of each, on the device's
    /// stream. May be captured in a graph. All ranks get the same bits, and as many ranks give the
    /// same bits again on the same machine.
    ///
    /// # Errors
    /// NCCL refuses, or a peer is gone.
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

    /// Replaces numbers in the host's memory by their sums over all ranks. Waits.
    ///
    /// # Errors
    /// As [`all_reduce`](Self::all_reduce).
    pub fn sum_on_host(&self, values: &mut [f32]) -> Result<(), RanksError> {
        let mut list = self.device.upload(values)?;
        self.all_reduce(&mut list)?;
        self.device.stream().memcpy_dtoh(&list, values)?;
        Ok(self.device.stream().synchronize()?)
    }

    /// A number of every rank.
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

    /// Whether any rank says so.
    ///
    /// # Errors
    /// As [`all_gather`](Self::all_gather).
    pub fn any(&self, own: bool) -> Result<bool, RanksError> {
        Ok(self.numbers(own.into())?.contains(&1))
    }

    /// Says that all ranks are done, and each may end: what is still on its way to a peer arrives.
    pub fn all_done(&self) {
        if let Some(mut lifeline) = self.lifeline().take() {
            lifeline.goodbye();
        }
    }

    fn lifeline(&self) -> std::sync::MutexGuard<'_, Option<Lifeline>> {
        self.lifeline.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Brings the bytes of all ranks to rank 0; the others get nothing.
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
        let done = self.lifeline().is_none();
        // SAFETY: once, here. A rank that ends because it failed does not wait for the others.
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
