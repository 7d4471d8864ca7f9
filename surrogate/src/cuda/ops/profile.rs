//! Execution times of kernels.

use std::sync::{Arc, Mutex, MutexGuard};

use cudarc::driver::sys::CUevent_flags;
use cudarc::driver::{CudaEvent, CudaStream};

use crate::cuda::error::CudaError;

/// A launch with the events before and after it.
type Span = (&'static str, CudaEvent, CudaEvent);

/// Times the launches between `begin` and `end`; free otherwise.
#[derive(Debug, Default)]
pub struct Profile(Mutex<Option<Vec<Span>>>);

impl Profile {
    fn spans(&self) -> MutexGuard<'_, Option<Vec<Span>>> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Begins to time launches.
    pub fn begin(&self) {
        *self.spans() = Some(Vec::new());
    }

    /// Name of each kernel, launches and ms, the longest first.
    pub fn end(&self) -> Result<Vec<(&'static str, usize, f32)>, CudaError> {
        let mut kernels = Vec::<(&'static str, usize, f32)>::new();
        for (name, before, after) in self.spans().take().unwrap_or_default() {
            let time = before.elapsed_ms(&after)?;
            match kernels.iter_mut().find(|kernel| kernel.0 == name) {
                Some((_, launches, sum)) => {
                    *launches += 1;
                    *sum += time;
                }
                None => kernels.push((name, 1, time)),
            }
        }
        kernels.sort_by(|a, b| b.2.total_cmp(&a.2));
        Ok(kernels)
    }

    /// Times what `launch` queues on a stream.
    pub fn around(
        &self,
        name: &'static str,
        stream: &Arc<CudaStream>,
        launch: impl FnOnce() -> Result<(), CudaError>,
    ) -> Result<(), CudaError> {
        let mut spans = self.spans();
        let Some(spans) = spans.as_mut() else { return launch() };
        let event = || stream.record_event(Some(CUevent_flags::CU_EVENT_DEFAULT));
        let before = event()?;
        launch()?;
        spans.push((name, before, event()?));
        Ok(())
    }
}
