//! A rollout on a thread of its own, which predicts while others write files.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use super::error::CudaError;
use super::integrator::BLOCK;
use super::rollout_graph::{CudaRollout, Network};
use crate::rollout::RolloutError;

/// A frame's positions (m), or why there are none.
type Predicted = Result<Vec<[f64; 2]>, RolloutError>;

/// The thread of a rollout, which ends when nobody listens.
struct RolloutThread(Option<JoinHandle<()>>);

impl Drop for RolloutThread {
    /// Waits for the thread: the device's stream is free for others then.
    fn drop(&mut self) {
        if let Some(thread) = self.0.take() {
            let _ = thread.join();
        }
    }
}

/// The frames of one scene of a rollout, which is a block or two ahead of those that are asked for.
pub struct PredictedFrames {
    /// `None` once nobody listens.
    frames: Option<Receiver<Predicted>>,
    /// Ends with the last of its scenes.
    _thread: Arc<RolloutThread>,
}

impl PredictedFrames {
    /// Starts a rollout of so many scenes, which `make` sets up on the thread; returns when that is done. Scenes that
    /// nobody listens to any more are left out of it. One whose frames are not asked for makes the others wait.
    pub fn start<N: Network>(
        scenes: usize,
        make: impl FnOnce() -> Result<CudaRollout<N>, CudaError> + Send + 'static,
    ) -> Vec<Self> {
        let (senders, receivers): (Vec<_>, Vec<_>) =
            (0..scenes).map(|_| sync_channel(BLOCK)).unzip();
        let (made, ready) = sync_channel::<()>(0);
        let thread = thread::spawn(move || {
            let rollout = make();
            drop(made);
            let mut listeners = senders;
            if let Err(error) = rollout.and_then(|rollout| run(rollout, &mut listeners)) {
                let error = RolloutError::Device { message: error.to_string() };
                for listener in listeners {
                    // Nobody may listen any more.
                    let _ = listener.send(Err(error.clone()));
                }
            }
        });
        // Nothing is ever sent: the sender is dropped.
        let _ = ready.recv();
        let thread = Arc::new(RolloutThread(Some(thread)));
        let of_scene = |frames| Self { frames: Some(frames), _thread: thread.clone() };
        receivers.into_iter().map(of_scene).collect()
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

impl Drop for PredictedFrames {
    fn drop(&mut self) {
        // Before the thread is waited for.
        self.frames = None;
    }
}

/// Predicts until every scene has failed or lost its listener.
fn run<N: Network>(
    mut rollout: CudaRollout<N>,
    listeners: &mut Vec<SyncSender<Predicted>>,
) -> Result<(), CudaError> {
    loop {
        let mut keep = Vec::new();
        for ((frames, failure), listener) in rollout.block()?.into_iter().zip(&*listeners) {
            let ended = failure.is_some();
            let mut all = frames.into_iter().map(Ok).chain(failure.map(Err));
            keep.push(all.all(|predicted| listener.send(predicted).is_ok()) && !ended);
        }
        if keep.contains(&false) {
            let mut kept = keep.iter();
            listeners.retain(|_| kept.next() == Some(&true));
            if listeners.is_empty() {
                return Ok(());
            }
            rollout = rollout.keep(&keep)?;
        }
    }
}
