//! How much is measured.

use std::time::Duration;

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// More scenes and batch sizes.
    pub full: bool,
    /// Duration of one measurement.
    pub time: Duration,
}
