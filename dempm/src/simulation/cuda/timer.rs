//! Time between two events on the device's stream.

use std::time::Duration;

use cudarc::driver::CudaEvent;
use cudarc::driver::sys::CUevent_flags;
use gpu::Device;

/// A pair of events: before and after.
pub(super) fn timer(device: &Device) -> Result<[CudaEvent; 2], gpu::Error> {
    let event = || device.context().new_event(Some(CUevent_flags::CU_EVENT_DEFAULT));
    Ok([event()?, event()?])
}

/// Device time between two recorded events.
pub(super) fn elapsed([start, end]: &[CudaEvent; 2]) -> Result<Duration, gpu::Error> {
    Ok(Duration::from_secs_f64(f64::from(start.elapsed_ms(end)?) * 1.0e-3))
}
