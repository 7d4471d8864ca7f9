//! Ctrl-C and requests to terminate.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::sleep;
use std::time::Duration;

use crate::terminal::print_note;

/// Exit code of an interrupted command: 128 + SIGINT, as shells report it.
pub const INTERRUPTED: u8 = 130;

thread_local! {
    /// The interrupt of the program that embeds the commands of this thread.
    static HOST: RefCell<Option<Interrupt>> = const { RefCell::new(None) };
}

/// The handler for Ctrl-C could not be installed.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("cannot handle Ctrl-C")]
pub struct InterruptError(#[source] ctrlc::Error);

/// A request to stop: SIGINT (Ctrl-C), SIGTERM or, unless started with `nohup`, SIGHUP.
///
/// Work with something to save holds a [`guard`](Self::guard), looks at [`requested`](Self::requested)
/// several times a second and saves before it drops the guard. While no guard is held, a request ends
/// the process at once with [`INTERRUPTED`]: files are written whole or not at all, so nothing is lost
/// during preparations, or while a lock or another process is waited for.
#[derive(Clone, Debug, Default)]
pub struct Interrupt {
    requested: Arc<AtomicBool>,
    guards: Arc<AtomicUsize>,
}

impl Interrupt {
    /// Handles the signals from now on; on a thread of a [host](Self::host), gives its interrupt.
    ///
    /// # Errors
    /// If the process already has a handler.
    pub fn install() -> Result<Self, InterruptError> {
        if let Some(host) = HOST.with_borrow(Clone::clone) {
            return Ok(host);
        }
        let interrupt = Self::default();
        let handled = interrupt.clone();
        let ignores_hangup = ignores_hangup();
        ctrlc::set_handler(move || handled.stop()).map_err(InterruptError)?;
        if ignores_hangup {
            ignore_hangup();
        }
        Ok(interrupt)
    }

    /// Leaves the signals to a program that embeds the commands of the calling thread: it makes its
    /// [requests](Self::request) itself, and they never end the process.
    pub fn host(&self) {
        HOST.set(Some(self.clone()));
    }

    /// Requests an end.
    pub fn request(&self) {
        self.requested.store(true, Ordering::SeqCst);
    }

    /// Whether there is work that ends in order after a request.
    pub fn is_guarded(&self) -> bool {
        self.guards.load(Ordering::SeqCst) > 0
    }

    /// Whether a guarded computation should save its state and end.
    pub fn requested(&self) -> bool {
        self.requested.load(Ordering::Relaxed)
    }

    /// The flag that a request sets.
    pub fn flag(&self) -> &AtomicBool {
        &self.requested
    }

    /// Keeps the process alive after a request until it is dropped.
    pub fn guard(&self) -> Guard {
        self.guards.fetch_add(1, Ordering::SeqCst);
        Guard(Arc::clone(&self.guards))
    }

    /// Runs on the handler's own thread.
    fn stop(&self) {
        self.request();
        if !self.is_guarded() {
            print_note("interrupted");
            end_process();
        }
        while self.is_guarded() {
            while self.is_guarded() {
                sleep(Duration::from_millis(20));
            }
            // What was guarded has ended and says so itself, unless other threads are at work.
            sleep(Duration::from_millis(500));
        }
        end_process();
    }
}

/// A section of work that ends in order after a request to stop; see [`Interrupt`].
#[derive(Debug)]
pub struct Guard(Arc<AtomicUsize>);

impl Drop for Guard {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Without destructors, which could wait for threads that are still at work.
fn end_process() -> ! {
    // SAFETY: ends the process.
    unsafe { libc::_exit(i32::from(INTERRUPTED)) }
}

/// Whether the process was started to outlive its terminal, with `nohup` for example.
fn ignores_hangup() -> bool {
    // SAFETY: a null action only queries; all zeros are a valid `sigaction`.
    unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        libc::sigaction(libc::SIGHUP, std::ptr::null(), &raw mut action) == 0
            && action.sa_sigaction == libc::SIG_IGN
    }
}

fn ignore_hangup() {
    // SAFETY: replaces the disposition of a signal by "ignored".
    unsafe { libc::signal(libc::SIGHUP, libc::SIG_IGN) };
}

/// Makes a write beyond a limit on file sizes (`ulimit -f`) an ordinary error instead of the end of the
/// process. Called first in every program.
pub fn report_size_limits_as_errors() {
    // SAFETY: replaces the disposition of a signal by "ignored".
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_on_a_thread_of_a_host_gets_its_interrupt() {
        let host = Interrupt::default();
        let theirs = host.clone();
        let command = std::thread::spawn(move || {
            theirs.host();
            // Twice: a process can handle signals once only, but a host runs many commands.
            let interrupts = [Interrupt::install().unwrap(), Interrupt::install().unwrap()];
            let _guard = interrupts[0].guard();
            while !interrupts.iter().all(Interrupt::requested) {
                std::thread::yield_now();
            }
            interrupts[1].is_guarded()
        });
        host.request();
        assert!(command.join().unwrap());
        assert!(!host.is_guarded());
    }
}
