//! Messages about the device.

use crate::device::Selection;
use files::note;

/// Reports the device with `--verbose`, and always a GPU that is there but cannot be used.
pub(super) fn report(selection: &Selection, verbose: bool) {
    for gpu in selection.gpus.iter().filter(|_| verbose) {
        note!("running on {}", gpu.name());
    }
    if let Some(reason) = &selection.fallback
        && (verbose || selection.is_faulty)
    {
        note!("running on the CPU: {reason}");
    }
}
