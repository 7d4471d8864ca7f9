//! Compiling kernels in threads of their own before they are needed.
//!
//! The first run of a program on a GPU compiles some seconds of kernels. Threads compile them side by side, and
//! beside whatever else prepares the run; whoever loads a kernel that is not ready waits for it.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, OnceLock, PoisonError};
use std::thread::JoinHandle;

/// Kernels that a thread compiles or has compiled, by all that they depend on; `None` if it failed.
static STARTED: LazyLock<Mutex<HashMap<u64, Slot>>> = LazyLock::new(Mutex::default);

/// Threads that compile; dropped, it waits for them. A program that ended before would tear NVRTC down beneath them
/// and crash.
#[derive(Debug, Default)]
pub(crate) struct Threads(Mutex<Vec<JoinHandle<()>>>);

impl Threads {
    fn spawn(&self, work: impl FnOnce() + Send + 'static) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(std::thread::spawn(work));
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        for thread in self.0.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
            // A thread that panicked has said so.
            drop(thread.join());
        }
    }
}

type Slot = Arc<OnceLock<Option<Vec<u8>>>>;

fn slot(key: u64) -> Option<Slot> {
    STARTED.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned()
}

/// Starts `compile` in one of the `threads` unless that happened before for this `key`.
pub(crate) fn start<E>(
    threads: &Threads,
    key: u64,
    compile: impl FnOnce() -> Result<Vec<u8>, E> + Send + 'static,
) {
    let slot = Slot::default();
    {
        let mut started = STARTED.lock().unwrap_or_else(PoisonError::into_inner);
        if started.contains_key(&key) {
            return;
        }
        started.insert(key, slot.clone());
    }
    threads.spawn(move || {
        slot.get_or_init(|| compile().ok());
    });
}

/// The kernel of this `key`: from the thread that was started for it, or by `compile`.
///
/// # Errors
/// Those of `compile`.
pub(crate) fn take<E>(key: u64, compile: impl Fn() -> Result<Vec<u8>, E>) -> Result<Vec<u8>, E> {
    // Whoever is first, the thread or this, compiles; the other waits.
    let ready = slot(key).and_then(|slot| slot.get_or_init(|| compile().ok()).clone());
    // The errors are those of a second attempt.
    ready.map_or_else(compile, Ok)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use super::*;

    /// Two who need a kernel that takes a while get the one that was started, which is compiled once.
    #[test]
    fn a_kernel_is_compiled_once() {
        static CALLS: AtomicUsize = AtomicUsize::new(0);
        let compile = || {
            CALLS.fetch_add(1, Ordering::Relaxed);
            std::thread::sleep(Duration::from_millis(50));
            Ok::<_, ()>(vec![7])
        };
        let threads = Threads::default();
        start(&threads, 1, compile);
        start(&threads, 1, compile);
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| assert_eq!(take(1, compile), Ok(vec![7])));
            }
        });
        assert_eq!(CALLS.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn what_was_not_started_or_failed_is_compiled_with_its_error() {
        assert_eq!(take(2, || Ok::<_, ()>(vec![8])), Ok(vec![8]));
        start(&Threads::default(), 3, || Err("first"));
        assert_eq!(take(3, || Err("log")), Err("log"));
    }

    #[test]
    fn threads_are_waited_for() {
        static COMPILED: AtomicUsize = AtomicUsize::new(0);
        let threads = Threads::default();
        for key in 4..8 {
            start(&threads, key, || {
                std::thread::sleep(Duration::from_millis(50));
                COMPILED.fetch_add(1, Ordering::Relaxed);
                Ok::<_, ()>(vec![9])
            });
        }
        drop(threads);
        assert_eq!(COMPILED.load(Ordering::Relaxed), 4);
    }
}
