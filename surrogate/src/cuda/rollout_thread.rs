//! A rollout on a thread of its own, which predicts while the caller writes files.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use super::error::CudaError;
use super::integrator::BLOCK;
use super::rollout_graph::{CudaRollout, Network};
use crate::rollout::RolloutError;

/// A frame's positions (m), or why there are none.
type Predicted = Result<Vec<[f64; 2]>, RolloutError>;

/// Predicts a block or two ahead of the frames that are asked for.
pub struct RolloutThread {
    /// `None` once nobody listens.
    frames: Option<Receiver<Predicted>>,
    thread: Option<JoinHandle<()>>,
}

impl RolloutThread {
    /// Starts a rollout, which `make` sets up on the thread; returns when that is done.
    pub fn start<N: Network>(
        make: impl FnOnce() -> Result<CudaRollout<N>, CudaError> + Send + 'static,
    ) -> Self {
        let (send, frames) = sync_channel(BLOCK);
        let (made, ready) = sync_channel::<()>(0);
        let thread = thread::spawn(move || {
            let rollout = make();
            drop(made);
            if let Err(error) = rollout.and_then(|rollout| run(rollout, &send)) {
                // Nobody may listen any more.
                let _ = send.send(Err(RolloutError::Device { message: error.to_string() }));
            }
        });
        // Nothing is ever sent: the sender is dropped.
        let _ = ready.recv();
        Self { frames: Some(frames), thread: Some(thread) }
    }

    /// Waits for the next frame's positions (m).
    ///
    /// # Errors
    /// If the frame makes no sense, or the device failed.
    pub fn next_frame(&self) -> Predicted {
        self.frames.as_ref().and_then(|frames| frames.recv().ok()).unwrap_or_else(|| {
            Err(RolloutError::Device { message: "its thread has ended".to_owned() })
        })
    }
}

impl Drop for RolloutThread {
    /// Waits for the thread: the device's stream is free for others then.
    fn drop(&mut self) {
        self.frames = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn run<N: Network>(
    mut rollout: CudaRollout<N>,
    send: &SyncSender<Predicted>,
) -> Result<(), CudaError> {
    loop {
        let (frames, failure) = rollout.block()?;
        let ended = failure.is_some();
        for predicted in frames.into_iter().map(Ok).chain(failure.map(Err)) {
            if send.send(predicted).is_err() {
                return Ok(());
            }
        }
        if ended {
            return Ok(());
        }
    }
}
