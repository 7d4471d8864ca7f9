//! Work on a thread of its own, while the thread of Python looks after signals and progress.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use files::Interrupt;
use miette::Report;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::failure::exception;

/// Time between two looks at signals and progress.
const PAUSE: Duration = Duration::from_millis(50);

/// What the work tells while it goes on.
#[derive(Default)]
struct News {
    /// Steps done, all steps, and a remark.
    progress: Option<(usize, usize, String)>,
    warnings: Vec<String>,
    notes: Vec<String>,
}

/// The end of the work that tells.
#[derive(Clone, Default)]
pub struct Reporter(Arc<Mutex<News>>);

impl Reporter {
    /// `done` of `all` steps are done.
    pub fn progress(&self, done: usize, all: usize, remark: String) {
        self.with(|news| news.progress = Some((done, all, remark)));
    }

    /// Warns.
    pub fn warning(&self, text: &str) {
        self.with(|news| news.warnings.push(text.to_owned()));
    }

    /// Says something.
    pub fn note(&self, text: &str) {
        self.with(|news| news.notes.push(text.to_owned()));
    }

    fn with<T>(&self, change: impl FnOnce(&mut News) -> T) -> T {
        change(&mut self.0.lock().expect("no holder of the lock panics"))
    }

    /// Passes the news on to a Python object with methods of the same names.
    fn deliver(&self, watcher: &Bound<'_, PyAny>) -> PyResult<()> {
        let news = self.with(std::mem::take);
        for warning in news.warnings {
            watcher.call_method1("warning", (warning,))?;
        }
        for note in news.notes {
            watcher.call_method1("note", (note,))?;
        }
        if let Some(progress) = news.progress {
            watcher.call_method1("progress", progress)?;
        }
        Ok(())
    }
}

/// Does `work` on a thread of its own without Python's lock.
///
/// An exception of a signal handler, such as `KeyboardInterrupt`, or of the watcher requests an end. What
/// has something to save is waited for, and everything else goes on behind the scenes until it looks at
/// its interrupt: files are written whole or not at all.
///
/// # Errors
/// That exception, or the error of the work.
pub fn supervise<T: Send + 'static>(
    py: Python<'_>,
    watcher: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Interrupt, &Reporter) -> miette::Result<T> + Send + 'static,
) -> PyResult<T> {
    let (interrupt, reporter) = (Interrupt::default(), Reporter::default());
    let (send, receive) = channel::<Result<T, Report>>();
    let theirs = (interrupt.clone(), reporter.clone());
    thread::spawn(move || {
        let (interrupt, reporter) = theirs;
        interrupt.host();
        // Nobody listens after an exception.
        let _ = send.send(work(&interrupt, &reporter));
    });
    // Waiting gives up Python's lock, for which all that is used must be shareable between threads.
    let receive = Mutex::new(receive);
    let wait = || py.detach(|| receive.lock().expect("one thread waits").recv_timeout(PAUSE));
    loop {
        let result = wait();
        let attended = py
            .check_signals()
            .and_then(|()| watcher.map_or(Ok(()), |watcher| reporter.deliver(watcher)));
        if let Err(exception) = attended {
            interrupt.request();
            while interrupt.is_guarded() && matches!(result, Err(RecvTimeoutError::Timeout)) {
                if !matches!(wait(), Err(RecvTimeoutError::Timeout)) {
                    break;
                }
            }
            return Err(exception);
        }
        match result {
            Ok(result) => return result.map_err(|report| exception(&report)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("the computation panicked"));
            }
        }
    }
}
