//! Ctrl-C and requests to terminate.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of an interrupted command: 128 + SIGINT, as shells report it.
pub const INTERRUPTED: u8 = 130;

/// The handler for Ctrl-C could not be installed.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("cannot handle Ctrl-C")]
pub struct InterruptError(#[source] ctrlc::Error);

/// Installs a handler for SIGINT, SIGTERM and SIGHUP and returns the flag that it sets.
///
/// # Errors
/// If the process already has a handler.
pub fn interrupt_flag() -> Result<Arc<AtomicBool>, InterruptError> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).map_err(InterruptError)?;
    Ok(interrupted)
}
