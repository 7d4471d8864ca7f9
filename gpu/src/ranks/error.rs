//! Why ranks cannot work together.

use std::ffi::CStr;
use std::io;

use cudarc::driver::DriverError;
use cudarc::nccl::{result::NcclError, sys};

use super::environment::EnvironmentError;
use crate::error::Error;

/// Why ranks cannot work together.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum RanksError {
    /// The launcher's variables are incomplete or contradict each other.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// Rank 0 and this rank did not find each other.
    #[error("rank {rank}: {action} {address}")]
    #[diagnostic(help(
        "start all ranks, and set MASTER_ADDR and MASTER_PORT to the host of rank 0 and a free port that all hosts can reach"
    ))]
    Rendezvous {
        /// This rank.
        rank: usize,
        /// What failed.
        action: &'static str,
        /// Host and port of rank 0.
        address: String,
        /// Why it failed.
        source: io::Error,
    },
    /// Rank 0 refused a rank.
    #[error("rank {rank} does not belong to rank 0: {why}")]
    #[diagnostic(help("start all ranks with one launcher, or with the same command"))]
    Refused {
        /// The rank that was refused.
        rank: usize,
        /// How it differs.
        why: &'static str,
    },
    /// NCCL cannot be loaded.
    #[error("several ranks need NCCL, but libnccl.so was not found")]
    #[diagnostic(help(
        "add its folder to LD_LIBRARY_PATH; if there is only libnccl.so.2, link it to that name"
    ))]
    NcclMissing,
    /// The connection to another rank broke.
    #[error("rank {rank} has lost rank {other}")]
    Lost {
        /// This rank.
        rank: usize,
        /// The rank at the other end.
        other: usize,
        /// Why it failed.
        source: io::Error,
    },
    /// NCCL refused an operation.
    #[error("NCCL, {action}: {reason}")]
    #[diagnostic(help("each rank needs a GPU of its own"))]
    Nccl {
        /// The operation.
        action: &'static str,
        /// NCCL's message.
        reason: String,
    },
    /// Another rank failed and reports why.
    #[error("another rank failed; see its message")]
    Other,
    /// A failure of this rank's GPU.
    #[error(transparent)]
    Gpu(#[from] Error),
}

impl RanksError {
    pub(super) fn nccl(action: &'static str) -> impl Fn(NcclError) -> Self {
        move |error| {
            // SAFETY: returns a static text for every code.
            let text = unsafe { CStr::from_ptr(sys::ncclGetErrorString(error.0)) };
            Self::Nccl { action, reason: text.to_string_lossy().into_owned() }
        }
    }
}

impl From<DriverError> for RanksError {
    fn from(error: DriverError) -> Self {
        Self::Gpu(error.into())
    }
}
